"""Lacunarity beside its random null."""

import numpy as np
import plotting_synthetic as synthetic
import pytest
from plotting_figures import factor

from fractalcontact import plotting


@pytest.fixture
def closed():
    return synthetic.closure(synthetic.delta(synthetic.heights(), shears=(8e-4, 1.6e-3, 8e-3)))


def test_curves_and_null(closed):
    result = synthetic.lacunarity(closed)
    by_load, by_shear = plotting.lacunarity(result, shear=8e-3)
    shown = [np.asarray(line.get_ydata()) for line in by_load.lines]
    for step in range(1, 5):
        expected = result.sel(shear=8e-3).isel(step=step)
        for name in ("lacunarity", "null_lacunarity"):
            assert any(np.allclose(y, expected[name].transpose("box_size")) for y in shown)
    assert factor(by_load.get_xlabel()) * np.asarray(by_load.lines[0].get_xdata()) == pytest.approx(
        result.box_length.values
    )
    assert len(by_shear.lines) == 6


def test_intervals_are_bands(closed):
    result = synthetic.lacunarity(closed)
    ends = {"lacunarity_low": result.lacunarity / 2, "lacunarity_high": result.lacunarity * 3}
    by_load, _ = plotting.lacunarity(result.assign(ends), shear=8e-3)
    numbers = plotting.curves(by_load)
    state = result.sel(shear=8e-3).isel(step=4)
    band = numbers[numbers["curve"] == "interval, normal force F = 30 kN"]["y"]
    assert (band.min(), band.max()) == pytest.approx(
        (float(state.lacunarity.min()) / 2, float(state.lacunarity.max()) * 3)
    )
