"""Detection of the step of rounded heights."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.dimensions._quantisation import quantisation

SIZE, SPACING, STEP = 96, 1e-4, 1e-5


def brownian(hurst, rng, shape=(SIZE, SIZE)):
    return fc.surfaces.fbm(shape, SPACING, hurst=hurst, rms_increment=STEP, rng=rng).values


@pytest.mark.parametrize(("factor", "offset"), [(1.0, 0.0), (1e-9, 0.0), (1e6, 3e6), (25.4e-3, -1.0)])
def test_step_in_any_unit(factor, offset):
    heights = np.round(6 * np.random.default_rng(10).standard_normal((64, 64)).cumsum(axis=1))
    step, share = quantisation(heights * factor + offset)
    assert step == pytest.approx(factor, rel=1e-6)
    bend = np.mean(np.diff(heights[::4], 2, axis=1) ** 2)
    assert share == pytest.approx(0.5 / bend, rel=0.1)


def test_unrounded_heights_have_no_step():
    assert quantisation(brownian(0.6, 11)) == (0.0, 0.0)
    assert quantisation(np.zeros((20, 20))) == (0.0, 0.0)
    assert quantisation(np.full((20, 20), np.nan)) == (0.0, 0.0)
    assert quantisation(np.arange(9.0)[None]) == (0.0, 0.0)


@pytest.mark.parametrize("levels", [16, 40])
def test_rounding_of_a_known_step_does_not_change_the_exponent(levels):
    errors = []
    for seed in range(4):
        surface = fc.surfaces.fbm((128, 128), 1e-6, hurst=0.3, rms_increment=1e-7, rng=seed)
        step = float(surface.max() - surface.min()) / (levels - 1)
        result = fc.dimensions.estimate((surface / step).round() * step)
        assert result.ci_low.item() < 0.3 < result.ci_high.item()
        assert result.noise_height.item() == pytest.approx(step / np.sqrt(12.0), rel=1e-6)
        errors.append(result.hurst.item() - 0.3)
    assert abs(np.mean(errors)) < 0.012  # -0.035 if the rounding of 16 levels is not in the model
