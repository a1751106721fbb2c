"""The closed-form estimator: sums, exact covariances, and what it gives for exact expectations."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base import threads
from fractalcontact.dimensions import _increment_covariance, _increment_moments, _increments

STENCILS = {1: np.array([-1.0, 1.0]), 2: np.array([1.0, -2.0, 1.0])}


def plain_squares(heights, step=1):
    """Mean squares and numbers of the twelve increments, by numpy, NaN left out."""
    means, numbers = [], []
    for axis in (1, 0):
        for order in (1, 2):
            for lag in (1, 2, 4):
                d = heights
                for _ in range(order):
                    n, m = d.shape[axis], lag * step
                    d = d.take(range(m, n), axis) - d.take(range(max(n - m, 0)), axis) if n > m else d[:0]
                d = d[np.isfinite(d)]
                means.append(np.mean(d**2) if d.size else np.nan)
                numbers.append(d.size)
    return np.array(means), np.array(numbers)


@pytest.mark.parametrize("shape", [(40, 37), (9, 9), (6, 25), (1, 50)])
@pytest.mark.parametrize("step", [1, 2])
@pytest.mark.parametrize("gaps", [False, True])
def test_sums_are_those_of_numpy(shape, step, gaps):
    rng = np.random.default_rng(1)
    heights = rng.standard_normal(shape).cumsum(axis=1)
    if gaps:
        heights[rng.random(shape) < 0.1] = np.nan
    means, numbers = plain_squares(heights, step)
    found = _increment_moments.increment_moments([(heights, shape[0])], shape, step)
    np.testing.assert_array_equal(found.counts, numbers)
    np.testing.assert_allclose(found.means, means, rtol=1e-12)


@pytest.mark.parametrize("gaps", [False, True])
def test_slabs_and_threads_change_no_bit(gaps):
    heights = np.random.default_rng(2).standard_normal((70, 40))
    if gaps:
        heights[33, 5] = np.nan
    whole = _increment_moments.increment_moments([(heights, 70)], (70, 40))
    parts = [(heights[a : a + 15 + _increment_moments.REACH], min(15, 70 - a)) for a in range(0, 70, 15)]
    for count in (1, 2):
        with threads.limit(count):
            sliced = _increment_moments.increment_moments(parts, (70, 40))
        np.testing.assert_array_equal(sliced.means, whole.means)
        np.testing.assert_array_equal(sliced.counts, whole.counts)
    assert (whole.observed is not None) is gaps


@pytest.mark.parametrize("hurst", [0.05, 0.3, 0.44, 0.6, 0.95])
@pytest.mark.parametrize("steps", [(1.0, 1.0), (3.0, 1.0), (1.0,)])
def test_exact_mean_squares_give_the_exact_exponent(hurst, steps):
    means = np.full(12, np.nan)
    for axis in range(len(steps)):
        first = 6 * (len(steps) == 2 and axis == 0)
        for k, lag in enumerate((1, 2, 4)):
            square = (lag * steps[axis]) ** (2 * hurst)
            means[first + k] = square
            means[first + 3 + k] = square * (4 - 4**hurst)
    shape = (50, 60)[-len(steps) :]
    counts = np.where(np.isfinite(means), 1000, 0)
    found = _increments.closed_form(_increment_moments.Moments(means, counts, shape, 1, None), steps)
    assert found.hurst == pytest.approx(hurst, abs=1e-12)
    assert found.rms_increment == pytest.approx(1.0, rel=1e-9)
    assert found.order == (1 if hurst < _increments.FIRST_BELOW else 2)


def dense_covariance(shape, steps, order, hurst, observed=None):
    """Covariance of the logarithms of the mean squares, from the covariance of all increments."""
    axes = len(shape)
    index = np.arange(np.prod(shape)).reshape(shape)
    positions = np.stack([p.ravel() * s for p, s in zip(np.indices(shape), steps, strict=True)])
    distance = np.sqrt(((positions[:, :, None] - positions[:, None, :]) ** 2).sum(axis=0))
    generalised = -0.5 * distance ** (2 * hurst)
    rows = []
    for axis in range(axes):
        for lag in (1, 2, 4):
            parts = [
                index.take(range(i * lag, shape[axis] - (order - i) * lag), axis).ravel()
                for i in range(order + 1)
            ]
            kept = np.ones(parts[0].size, dtype=bool)
            if observed is not None:
                for part in parts:
                    kept &= observed.ravel()[part]
            operator = np.zeros((parts[0].size, index.size))
            for part, weight in zip(parts, STENCILS[order], strict=True):
                operator[np.arange(part.size), part] = weight
            rows.append(operator[kept])
    own = [np.mean(np.einsum("ij,jk,ik->i", a, generalised, a)) for a in rows]
    return np.array(
        [
            [2 * np.mean((a @ generalised @ b.T) ** 2) / (own[i] * own[j]) for j, b in enumerate(rows)]
            for i, a in enumerate(rows)
        ]
    )


@pytest.mark.parametrize(
    ("shape", "steps"), [((14, 13), (1.0, 1.0)), ((13, 12), (2.0, 1.0)), ((60,), (1.0,))]
)
@pytest.mark.parametrize(("order", "hurst"), [(1, 0.2), (2, 0.7)])
def test_covariance_of_logs_against_dense_algebra(shape, steps, order, hurst):
    overlap = _increment_covariance.complete_pairs(shape, order, 1)
    found = _increment_covariance.covariance_of_logs(hurst, steps, order, overlap, 1)
    exact = dense_covariance(shape, steps, order, hurst)
    np.testing.assert_allclose(found, exact, rtol=0.02, atol=2e-3 * exact.max())


def test_covariance_with_gaps_against_dense_algebra():
    rng = np.random.default_rng(3)
    observed = rng.random((14, 13)) > 0.15
    observed[5:8, 5:9] = False
    overlap = _increment_covariance.gapped_pairs(observed, 2, 2, 1)
    found = _increment_covariance.covariance_of_logs(0.6, (1.0, 1.0), 2, overlap, 1)
    exact = dense_covariance((14, 13), (1.0, 1.0), 2, 0.6, observed)
    np.testing.assert_allclose(found, exact, rtol=0.03, atol=3e-3 * exact.max())


def test_standard_error_is_near_the_least_possible():
    """The bound is c(H) / n; see the references of `estimate`."""
    bound = {0.1: 0.512, 0.3: 0.856, 0.5: 1.029, 0.7: 1.130, 0.9: 1.194}
    for hurst, least in bound.items():
        means = np.tile([4.0 ** (hurst * k) for k in range(3)], 4)
        means[[3, 4, 5, 9, 10, 11]] *= 4 - 4**hurst
        moments = _increment_moments.Moments(means, np.full(12, 256 * 256), (256, 256), 1, None)
        error = _increments.closed_form(moments, (1.0, 1.0)).standard_error * 256 / least
        assert 1.0 < error < 1.2


def test_constant_heights_give_no_exponent():
    found = _increments.closed_form(
        _increment_moments.increment_moments([(np.ones((9, 9)), 9)], (9, 9)), (1.0, 1.0)
    )
    assert np.isnan(found.hurst)


def test_lags_that_disagree_widen_the_interval():
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
def test_noise_in_exact_mean_squares_is_found(steps, shape, noise):
    means, hurst = np.full(12, np.nan), 0.7
    for axis in range(len(steps)):
        for order, level in ((1, 1.0), (2, 4.0 - 4.0**hurst)):
            lags = np.array([1.0, 2.0, 4.0])
            place = 6 * axis + 3 * (order - 1)
            means[place : place + 3] = level * lags ** (2 * hurst) + (2.0 if order == 1 else 6.0) * noise
    counts = np.full(12, 10000)
    found = _increments.closed_form(_increment_moments.Moments(means, counts, shape, 1, None), steps)
    assert np.sign(found.noise_z) == np.sign(noise)
    assert abs(found.hurst - hurst) > 5e-4
    assert found.with_noise[0] == pytest.approx(hurst, abs=2e-5)
    assert found.with_noise[1] > 2 * found.standard_error


@pytest.mark.parametrize("lags", [2, 3])
def test_white_noise_cannot_be_told_from_two_lags(lags):
    heights = np.random.default_rng(3).standard_normal((40, 40)).cumsum(0).cumsum(1)
    found = _increments.closed_form(
        _increment_moments.increment_moments([(heights, 40)], (40, 40)), (1.0, 1.0), lags=lags
    )
    assert (found.noise_z == 0.0) is (lags == 2)
    assert np.isnan(found.with_noise[0]) == (lags == 2)


def test_the_turn_of_a_family_face_is_a_normal_number():
    faces = fc.surfaces.fbm((48, 48), 1.0, hurst=0.7, rms_increment=1.0, rng=8, members=300).values
    moments = (_increment_moments.increment_moments([(face, 48)], (48, 48)) for face in faces)
    turns = [_increments.closed_form(one, (1.0, 1.0)).noise_z for one in moments]
    assert abs(np.mean(turns)) < 0.25
    assert np.std(turns) == pytest.approx(1.0, abs=0.13)


@pytest.mark.parametrize("shape", [(40, 40), (400,)])
def test_smooth_and_white_faces_with_gaps_are_told_as_complete_ones_are(shape):
    places = np.arange(shape[-1]) + 0.3 * np.arange(shape[0] if len(shape) > 1 else 1)[:, None]
    smooth = np.sin(0.4 * places).reshape(shape)
    white = np.random.default_rng(1).standard_normal(shape)
    for heights, words in ((smooth, "no fractal"), (white, "")):
        gapped = heights.copy()
        gapped[..., 17] = np.nan
        found = fc.dimensions.estimate(fc.surfaces.from_array(gapped, 1.0), "increments")
        whole = fc.dimensions.estimate(fc.surfaces.from_array(heights, 1.0), "increments")
        assert words in found.ci_low.attrs["reason"]
        assert bool(np.isfinite(found.ci_low)[0]) == bool(np.isfinite(whole.ci_low)[0])
