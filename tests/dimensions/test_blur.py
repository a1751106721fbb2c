"""Intervals of blurred surfaces hold the exponent of the surface under the blur."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

import fractalcontact as fc


@pytest.mark.parametrize("spread", [0.5, 1.0])
@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.8])
def test_interval_holds_exponent_before_blur(hurst, spread):
    """The blur mixes points beyond the edge too, as an instrument does."""
    held, members = 0, 6
    for k in range(members):
        wide = fc.surfaces.fbm((160, 160), 1e-4, hurst=hurst, rms_increment=1e-6, rng=[k, 160])
        blurred = gaussian_filter(wide.values, spread)[16:-16, 16:-16]
        result = fc.dimensions.estimate(fc.surfaces.from_array(blurred, 1e-4)).isel(method=0)
        assert float(result.fitted_hurst) > hurst + 0.1  # the estimate itself is wrong
        held += bool(float(result.ci_low) <= hurst <= float(result.ci_high))
        assert "blurred surface" in result.hurst.attrs["comment"]
    assert held >= members - 1


def test_unblurred_surface_is_not_noted():
    surface = fc.surfaces.fbm((128, 128), 1e-4, hurst=0.5, rms_increment=1e-6, rng=4)
    result = fc.dimensions.estimate(surface)
    assert "blurred" not in result.hurst.attrs["comment"]
    assert np.ptp([result.ci_low.item(), result.ci_high.item()]) < 0.05
