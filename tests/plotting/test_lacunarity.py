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
