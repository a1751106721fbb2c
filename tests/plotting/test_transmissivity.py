"""Hydraulic aperture."""

import plotting_synthetic as synthetic
import pytest
from plotting_figures import drawn, holds

from fractalcontact import plotting


@pytest.fixture
def closed():
    return synthetic.closure(synthetic.delta(synthetic.heights(), shears=(8e-4, 1.6e-3, 8e-3)))


def test_curve_per_flow_direction(closed):
    result = synthetic.transmissivity(closed)
    ax = plotting.plot(result, "hydraulic_aperture")
    for v in result.shear:
        for word in "xy":
            expected = result.sel(shear=v, axis=word)
            assert holds(drawn(ax), expected.normal_force, expected.hydraulic_aperture)
