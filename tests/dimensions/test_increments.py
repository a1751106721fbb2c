"""Closed-form estimator on exact mean squares and on fractional Brownian surfaces."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.dimensions import _increment_moments, _increments


@pytest.mark.parametrize("hurst", [0.05, 0.3, 0.44, 0.6, 0.95])
@pytest.mark.parametrize("steps", [(1.0, 1.0), (3.0, 1.0), (1.0,)])
def test_exact_mean_squares_give_exact_exponent(hurst, steps):
    means = np.full(12, np.nan)
    for axis in range(len(steps)):
        first = 6 * (len(steps) == 2 and axis == 0)
        for k, lag in enumerate((1, 2, 4)):
            square = (lag * steps[axis]) ** (2 * hurst)
            means[first + k] = square
            means[first + 3 + k] = square * (4 - 4**hurst)
    shape = (50, 60)[-len(steps) :]
    counts = np.where(np.isfinite(means), 1000, 0)
    result = _increments.closed_form(_increment_moments.Moments(means, counts, shape, 1, None), steps)
    assert result.hurst == pytest.approx(hurst, abs=1e-12)
    assert result.rms_increment == pytest.approx(1.0, rel=1e-9)
    assert result.order == (1 if hurst < _increments.FIRST_BELOW else 2)


def test_standard_error_near_bound():
    """The bound is c(H) / n, computed in `test_coverage.py`."""
    bound = {0.1: 0.512, 0.3: 0.856, 0.5: 1.029, 0.7: 1.130, 0.9: 1.194}
    for hurst, least in bound.items():
        means = np.tile([4.0 ** (hurst * k) for k in range(3)], 4)
        means[[3, 4, 5, 9, 10, 11]] *= 4 - 4**hurst
        moments = _increment_moments.Moments(means, np.full(12, 256 * 256), (256, 256), 1, None)
        error = _increments.closed_form(moments, (1.0, 1.0)).standard_error * 256 / least
        assert 1.0 < error < 1.2


def test_constant_heights_give_no_exponent():
    result = _increments.closed_form(
        _increment_moments.increment_moments([(np.ones((9, 9)), 9)], (9, 9)), (1.0, 1.0)
    )
    assert np.isnan(result.hurst)


def test_disagreeing_lags_inflate_error():
    means = np.tile([1.0, 4.0**0.6, 16.0**0.6], 4)
    means[[3, 4, 5, 9, 10, 11]] *= 4 - 4**0.6
    counts = np.full(12, 4096)
    agreed = _increments.closed_form(_increment_moments.Moments(means, counts, (64, 64), 1, None), (1.0, 1.0))
    assert agreed.inflation == 1.0
    means[[5, 11]] *= 1.5  # as if noise or smoothing had changed the longest lag
    bent = _increments.closed_form(_increment_moments.Moments(means, counts, (64, 64), 1, None), (1.0, 1.0))
    assert bent.inflation > 3.0


@pytest.mark.parametrize(("steps", "shape"), [((1.0, 1.0), (128, 128)), ((1.0,), (4096,))])
@pytest.mark.parametrize("noise", [1e-3, -1e-3])
def test_noise_in_exact_mean_squares(steps, shape, noise):
    means, hurst = np.full(12, np.nan), 0.7
    for axis in range(len(steps)):
        for order, level in ((1, 1.0), (2, 4.0 - 4.0**hurst)):
            lags = np.array([1.0, 2.0, 4.0])
            place = 6 * axis + 3 * (order - 1)
            means[place : place + 3] = level * lags ** (2 * hurst) + (2.0 if order == 1 else 6.0) * noise
    counts = np.full(12, 10000)
    result = _increments.closed_form(_increment_moments.Moments(means, counts, shape, 1, None), steps)
    assert np.sign(result.noise_z) == np.sign(noise)
    assert abs(result.hurst - hurst) > 5e-4
    assert result.with_noise[0] == pytest.approx(hurst, abs=2e-5)
    assert result.with_noise[1] > 2 * result.standard_error


@pytest.mark.parametrize("lags", [2, 3])
def test_two_lags_cannot_show_noise(lags):
    heights = np.random.default_rng(3).standard_normal((40, 40)).cumsum(0).cumsum(1)
    result = _increments.closed_form(
        _increment_moments.increment_moments([(heights, 40)], (40, 40)), (1.0, 1.0), lags=lags
    )
    assert (result.noise_z == 0.0) is (lags == 2)
    assert np.isnan(result.with_noise[0]) == (lags == 2)


def test_noise_z_is_standard_normal():
    surfaces = fc.surfaces.fbm((48, 48), 1.0, hurst=0.7, rms_increment=1.0, rng=8, members=300).values
    moments = (_increment_moments.increment_moments([(surface, 48)], (48, 48)) for surface in surfaces)
    scores = [_increments.closed_form(moment, (1.0, 1.0)).noise_z for moment in moments]
    assert abs(np.mean(scores)) < 0.25
    assert np.std(scores) == pytest.approx(1.0, abs=0.13)


@pytest.mark.parametrize("shape", [(40, 40), (400,)])
def test_gaps_do_not_change_interval_or_reason(shape):
    places = np.arange(shape[-1]) + 0.3 * np.arange(shape[0] if len(shape) > 1 else 1)[:, None]
    smooth = np.sin(0.4 * places).reshape(shape)
    white = np.random.default_rng(1).standard_normal(shape)
    for heights, words in ((smooth, "no fractal"), (white, "")):
        gapped = heights.copy()
        gapped[..., 17] = np.nan
        result = fc.dimensions.estimate(fc.surfaces.from_array(gapped, 1.0), "increments")
        complete = fc.dimensions.estimate(fc.surfaces.from_array(heights, 1.0), "increments")
        assert words in result.ci_low.attrs["reason"]
        assert bool(np.isfinite(result.ci_low)[0]) == bool(np.isfinite(complete.ci_low)[0])
