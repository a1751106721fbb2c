"""Higuchi, detrended fluctuation and dividers against loops, closed forms and exact profiles."""

import numpy as np
import pytest

import fractalcontact as fc


def profile_of(heights, spacing=1.0):
    return fc.surfaces.from_array(np.asarray(heights, float), spacing)


def brownian(hurst, rng, n=1024):
    return fc.surfaces.fbm((n,), 1e-4, hurst=hurst, rms_increment=1e-6, rng=rng)


def test_higuchi_length_is_that_of_the_paper():
    """Higuchi (1988): the lengths of the series m, m + k, m + 2 k ... averaged over m."""
    heights = np.random.default_rng(2).standard_normal(65).cumsum()
    result = fc.dimensions.higuchi(profile_of(heights, 0.5))
    for lag, length in zip((1, 2, 4), result.higuchi_length.values[[0, 1, 3]], strict=True):
        lengths = []
        for m in range(lag):
            series = heights[m::lag]
            lengths.append(np.abs(np.diff(series)).sum() * 64 / ((series.size - 1) * lag) / lag)
        # 64 is a multiple of the lag: all starts but the first have one increment less
        weights = [heights[m::lag].size - 1 for m in range(lag)]
        assert length == pytest.approx(np.average(lengths, weights=weights), rel=1e-12)
    assert result.lag.values[0] == 0.5


def test_fluctuation_is_that_of_fitted_lines():
    heights = np.random.default_rng(3).standard_normal(70).cumsum()
    result = fc.dimensions.detrended_fluctuation(profile_of(heights))
    for size, value, number in zip(
        result.window_size.values.astype(int), result.fluctuation, result.pair_count, strict=True
    ):
        squares = []
        first = range(0, 70 - size + 1, size // 4)
        for k in {*first, *(70 - size - start for start in first)}:
            part = heights[k : k + size]
            line = np.polyval(np.polyfit(np.arange(size), part, 1), np.arange(size))
            squares.append(np.mean((part - line) ** 2))
        assert int(number) == len(squares)
        assert float(value) == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-9)


def test_gaps_are_left_out():
    heights = np.random.default_rng(3).standard_normal(64).cumsum()
    gapped = heights.copy()
    gapped[10] = np.nan
    curve = fc.dimensions.higuchi(profile_of(gapped))
    assert int(curve.pair_count[0]) == 61
    # 61 windows of 4 points, less those that start at 7 to 10
    assert int(fc.dimensions.detrended_fluctuation(profile_of(gapped)).pair_count[0]) == 57
    result = fc.dimensions.estimate(profile_of(gapped), ["higuchi", "detrended_fluctuation"])
    assert np.isnan(result.ci_low).all()
    assert "missing" in str(result.reason.sel({"method": "higuchi"}).values)


def test_dividers_walk_along_a_zigzag():
    """Slopes of 3 / 4 up and down over four points: one spacing is 1.25 long along the profile."""
    heights = 0.75 * np.abs((np.arange(65) + 4) % 8 - 4)
    result = fc.dimensions.divider(profile_of(heights))
    assert float(result.divider_length[0]) == pytest.approx(80.0, rel=1e-8)
    # dividers of 5 reach from peak to foot, those of 8 from peak to peak
    assert float(result.divider_length[3]) == pytest.approx(64.0, rel=1e-12)


def test_dividers_end_on_the_circle():
    heights = np.random.default_rng(5).standard_normal(200).cumsum()
    opening = 4.0
    at, steps, k = np.array([0.0, heights[0]]), 0, 1
    while k < 200:
        point = np.array([float(k), heights[k]])
        if np.hypot(*(point - at)) < opening:
            k += 1
            continue
        before = at if at[0] > k - 1 else np.array([k - 1.0, heights[k - 1]])
        low, high = 0.0, 1.0
        for _ in range(60):
            share = 0.5 * (low + high)
            inside = np.hypot(*(before + share * (point - before) - at)) < opening
            low, high = (share, high) if inside else (low, share)
        at, steps = before + low * (point - before), steps + 1
    result = fc.dimensions.divider(profile_of(heights))
    assert int(result.pair_count[2]) == steps
    rest = float(np.hypot(199.0 - at[0], heights[-1] - at[1]))
    assert float(result.divider_length[2]) == pytest.approx(opening * steps + rest, abs=1e-9)


def test_steep_profiles_have_the_divider_dimension_of_their_graph():
    """Where heights exceed the dividers by far the dimension is 1 / H, for H 0.5 that is 2 (Brown 1987)."""
    flat, steep = (
        fc.dimensions.estimate(brownian(0.5, 4, 4096) * factor, "divider", scales=scales)
        for factor, scales in ((1e-3, None), (1e5, None))
    )
    assert float(flat.fractal_dimension[0]) == pytest.approx(1.0, abs=1e-3)
    assert "unit of height" in str(steep.note.values)


@pytest.mark.parametrize("members", [30, pytest.param(60, marks=pytest.mark.slow)])
@pytest.mark.parametrize("method", ["higuchi", "detrended_fluctuation", "roughness_length", "spectrum"])
@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.8])
def test_intervals_hold_the_exponent_of_profiles(method, hurst, members):
    profiles = fc.surfaces.fbm((1024,), 1e-4, hurst=hurst, rms_increment=1e-6, rng=1000, members=members)
    result = fc.dimensions.estimate(profiles, method).isel(method=0)
    given = np.isfinite(result.ci_low)
    if (method, hurst) == ("higuchi", 0.8):
        assert not given.all()
        assert "above H = 0.75" in str(result.reason.values)
    else:
        assert given.mean() > 0.85  # chi square withholds up to a tenth of exact profiles at H = .2
        covered = ((result.ci_low <= hurst) & (hurst <= result.ci_high))[given]
        assert covered.mean() >= 0.86
        assert 0.7 < float(result.fitted_hurst.std() / result.standard_error.mean()) < 1.35
    assert abs(float(result.fitted_hurst.mean()) - hurst) < 0.03


@pytest.mark.parametrize("method", ["higuchi", "detrended_fluctuation", "divider"])
def test_surfaces_take_rows_and_columns(method):
    surface = fc.surfaces.fbm((128, 128), 1e-4, hurst=0.6, rms_increment=1e-6, rng=2)
    result = fc.dimensions.estimate(surface, method)
    other = fc.dimensions.estimate(surface.transpose("y", "x").copy(data=surface.values.T), method)
    assert float(result.hurst[0]) == pytest.approx(float(other.hurst[0]), rel=1e-9)
    if method != "divider":
        assert float(result.hurst[0]) == pytest.approx(0.6, abs=0.06)
        assert "single profile" in str(result.reason.values)
