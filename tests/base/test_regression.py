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
    line = regression.fit_line(scale, value)
    np.testing.assert_allclose(
        [line.slope, line.intercept, line.standard_error],
        [reference.slope, reference.intercept, reference.stderr],
    )
    part = regression.fit_line(scale, np.where(scale < 10, value, np.nan))
    np.testing.assert_allclose(part.slope, stats.linregress(np.log(scale[:6]), np.log(value[:6])).slope)


def test_local_slope_of_a_power_law():
    scale = np.geomspace(1e-6, 1e-2, 9)
    np.testing.assert_allclose(
        regression.local_slope(scale, np.stack([scale**1.5, scale**-2])), [[1.5] * 9, [-2] * 9]
    )
    assert np.isnan(regression.fit_line(scale[:1], scale[:1]).slope)


@pytest.mark.parametrize("powers", [(-20, 0), (13, -7), (-300, 200)])
def test_units_change_no_bit_of_a_slope(powers):
    stream = np.random.default_rng(6)
    scale, value = np.sort(stream.random(9)), stream.random((3, 9))
    scaled = [np.ldexp(part, power) for part, power in zip((scale, value), powers, strict=True)]
    np.testing.assert_array_equal(regression.local_slope(scale, value), regression.local_slope(*scaled))
    ours, other = regression.fit_line(scale, value[0]), regression.fit_line(scaled[0], scaled[1][0])
    assert (ours.slope, ours.standard_error) == (other.slope, other.standard_error)
    assert other.intercept == pytest.approx(
        ours.intercept + (powers[1] - other.slope * powers[0]) * np.log(2.0), rel=1e-9
    )


def test_values_of_rounding_beside_large_ones_do_not_overflow():
    """As in the spectrum of a parabola: the slope is that of the values that are not rounding."""
    scale = np.arange(1.0, 7.0)
    value = np.array([1e-320, 5e-324, *(1e3 * scale[2:] ** 2)])
    with np.errstate(all="raise", under="ignore"):
        logarithm, unit = regression.logarithm(value)
        slope = regression.fit_line(scale[2:], value[2:]).slope
    assert np.isfinite(logarithm[2:]).all()
    np.testing.assert_allclose(logarithm[2:] + unit * np.log(2.0), np.log(value[2:]))
    assert slope == pytest.approx(2.0)
