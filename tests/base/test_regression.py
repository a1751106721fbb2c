"""Power-law fits against scipy, and their independence of units."""

import numpy as np
import pytest
from scipy import stats

from fractalcontact.base import regression


def test_line_agrees_with_scipy():
    stream = np.random.default_rng(4)
    scale = np.geomspace(1, 100, 12)
    value = 3 * scale**0.7 * np.exp(0.05 * stream.normal(size=12))
    reference = stats.linregress(np.log(scale), np.log(value))
    np.testing.assert_allclose(regression.fitted_slope(scale, value), reference.slope)
    part = regression.fitted_slope(scale, np.where(scale < 10, value, np.nan))
    np.testing.assert_allclose(part, stats.linregress(np.log(scale[:6]), np.log(value[:6])).slope)


def test_local_slope_of_a_power_law():
    scale = np.geomspace(1e-6, 1e-2, 9)
    np.testing.assert_allclose(
        regression.local_slope(scale, np.stack([scale**1.5, scale**-2])), [[1.5] * 9, [-2] * 9]
    )
    assert np.isnan(regression.fitted_slope(scale[:1], scale[:1]))


@pytest.mark.parametrize("powers", [(-20, 0), (13, -7), (-300, 200)])
def test_units_change_no_bit_of_a_slope(powers):
    stream = np.random.default_rng(6)
    scale, value = np.sort(stream.random(9)), stream.random((3, 9))
    scaled = [np.ldexp(part, power) for part, power in zip((scale, value), powers, strict=True)]
    np.testing.assert_array_equal(regression.local_slope(scale, value), regression.local_slope(*scaled))
    assert regression.fitted_slope(scale, value[0]) == regression.fitted_slope(scaled[0], scaled[1][0])


def test_values_of_rounding_beside_large_ones_do_not_overflow():
    """As in the spectrum of a parabola: the slope is that of the values that are not rounding."""
    scale = np.arange(1.0, 7.0)
    value = np.array([1e-320, 5e-324, *(1e3 * scale[2:] ** 2)])
    with np.errstate(all="raise", under="ignore"):
        logarithm = regression.logarithm(value)
        slope = regression.fitted_slope(scale[2:], value[2:])
    assert np.isfinite(logarithm[2:]).all()
    np.testing.assert_allclose(np.diff(logarithm[2:]), np.diff(np.log(value[2:])))
    assert slope == pytest.approx(2.0)
