"""Modes of a surface with gaps, restored: their mean power is that of the complete surface."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import fractalcontact as fc
from fractalcontact.dimensions._cosine_modes import Lattice, mode_power
from fractalcontact.dimensions._restored_power import restored_power

SHAPE, SPACING = (80, 96), (1.5, 1.0)


@pytest.mark.parametrize("spread", [0.0, 0.8])
@pytest.mark.parametrize("kind", ["scattered", "block"])
def test_mean_power_of_each_octave_is_restored(kind, spread):
    missing = np.zeros(SHAPE, dtype=bool)
    if kind == "block":
        missing[20:40, 30:60] = True
    else:
        missing |= np.random.default_rng(1).random(SHAPE) < 0.1
    lattice = Lattice.of(SHAPE, SPACING)
    ny, nx = (np.pi * np.arange(1, n) / (n * d) for n, d in zip(SHAPE, SPACING, strict=True))
    octave = np.log2(np.hypot(ny[:, None], nx)).round().astype(int)
    octave -= octave.min()
    complete, restored, raw = (np.zeros((12, octave.max() + 1)) for _ in range(3))
    for seed in range(12):
        wide = fc.surfaces.fbm((100, 116), SPACING, hurst=0.5, rms_increment=1.0, rng=seed).values
        heights = gaussian_filter(wide, spread)[10:90, 10:106]
        power, share = restored_power(np.where(missing, np.nan, heights), lattice, 0.5)
        filled = mode_power(np.where(missing, heights[~missing].mean(), heights))
        for values, table in ((mode_power(heights), complete), (power, restored), (filled, raw)):
            table[seed] = np.bincount(octave.ravel(), values.ravel()) / np.bincount(octave.ravel())
    assert 0.0 < share.min() <= share.max() <= np.mean(~missing)
    ratio = restored.mean(axis=0) / complete.mean(axis=0)
    np.testing.assert_allclose(ratio[1:4], 1.0, atol=0.12)  # of few waves
    np.testing.assert_allclose(ratio[4:-1], 1.0, atol=0.05)
    np.testing.assert_allclose(ratio[-1], 1.0, atol=0.1)  # blurred waves are weaker than those of the filling
    if spread:  # the rough surface has a few per cent more or less, the smooth one many times as much
        assert (raw.mean(axis=0) / complete.mean(axis=0))[-1] > 1.5


def test_restored_power_scales_with_the_heights():
    heights = fc.surfaces.fbm((64, 64), 1.0, hurst=0.4, rms_increment=1.0, rng=1).values
    heights[5:20, 30:40] = np.nan
    lattice = Lattice.of((64, 64), (1.0, 1.0))
    power, share = restored_power(heights, lattice, 0.4)
    again, same = restored_power(1e-150 * heights, lattice, 0.4)
    np.testing.assert_allclose(again, 1e-300 * power, rtol=1e-9)
    np.testing.assert_allclose(same, share, rtol=1e-9)
