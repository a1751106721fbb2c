"""Estimates of the Hurst exponent: names, labels, families, limits, errors, invariances."""

import functools

import numpy as np
import pytest
import xarray as xr
from counting import at_least

import fractalcontact as fc
from fractalcontact.base import resources
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.study import provenance_of

VARIABLES = {
    "hurst", "fractal_dimension", "fitted_hurst", "standard_error", "ci_low", "ci_high", "scale_min",
    "scale_max", "rms_increment", "topothesy", "noise_height", "blur_spread", "misfit", "run_time",
    "fractal_dimension_low", "fractal_dimension_high", "note", "reason", "window_rule",
}  # fmt: skip
NAMES = list(fc.dimensions.methods())
VALIDATED = ["likelihood", "increments"]
SCALE_FREE = [name for name in NAMES if name not in ("covering", "divider")]


def estimate(*arguments, **options):
    return fc.dimensions.estimate(*arguments, **options)


@pytest.fixture(scope="module")
def rough():
    return fc.surfaces.fbm((96, 80), 1e-4, hurst=0.7, rms_increment=2e-6, rng=21)


@pytest.fixture(scope="module")
def of_rough(rough):
    """Return a function: the estimate by some methods, made once for all of them."""
    complete = functools.cache(lambda: estimate(rough, NAMES))
    return lambda *methods: complete().sel({"method": list(methods)})


def estimate_one(surface, method=None, **options):
    return estimate(surface, method, **options).isel(method=0)


def surface_of(heights, spacing=1e-3):
    return fc.surfaces.from_array(np.asarray(heights, float), spacing)


def with_gaps(surface, share=0.1, seed=0):
    rng = np.random.default_rng(seed)
    heights = surface.values.copy()
    heights[rng.random(heights.shape) < share] = np.nan
    heights[10:20, 30:45] = np.nan
    return surface.copy(data=heights)


def test_default_method(rough, of_rough):
    result = estimate(rough)
    assert list(result.method.values) == ["default"]
    assert provenance_of(result)["default_method"] == "likelihood"
    assert set(result.data_vars) == VARIABLES
    assert all(result[name].dims == ("method",) for name in VARIABLES)
    assert float(result.increment_lag) == 1e-4
    again = of_rough("likelihood")
    for name in VARIABLES - {"run_time"}:
        np.testing.assert_array_equal(result[name], again[name])


def test_every_method(rough, tmp_path):
    result = estimate(rough, ["default", *NAMES])
    assert list(result.method.values) == ["default", *NAMES]
    np.testing.assert_allclose(result.fractal_dimension, 3.0 - result.hurst, rtol=1e-15)
    near = result.hurst.sel({"method": ["default", "increments", "madogram"]})
    np.testing.assert_allclose(near, 0.7, atol=0.05)
    has_interval = np.isfinite(result.ci_low)
    assert list(result.method.values[has_interval.values]) == ["default", *VALIDATED, "spectrum"]
    np.testing.assert_array_equal(result.reason != "", ~has_interval)
    assert (result.window_rule != "").all()
    np.testing.assert_array_equal(result.fractal_dimension_low, 3.0 - result.ci_high)
    np.testing.assert_array_equal(result.fractal_dimension_high, 3.0 - result.ci_low)
    assert (result.scale_min < result.scale_max).all()
    xr.testing.assert_identical(fc.open(fc.save(result, tmp_path / "result.nc")), result)


def test_increment_and_topothesy(of_rough):
    result = of_rough(*VALIDATED)
    np.testing.assert_allclose(result.rms_increment, 2e-6, rtol=0.05)
    exact = 1e-4 * (2e-6 / 1e-4) ** (1 / (1 - result.hurst))
    np.testing.assert_allclose(
        result.topothesy, exact * (result.rms_increment / 2e-6) ** (1 / (1 - result.hurst))
    )


@pytest.mark.parametrize("hurst", [0.15, 0.5, 0.85])
@pytest.mark.parametrize("method", VALIDATED)
def test_fbm_within_bound(hurst, method):
    """Within four times the least possible standard deviation, 1.742 sqrt(H / (H + .979)) / n."""
    surface = fc.surfaces.fbm((128, 128), 1e-3, hurst=hurst, rms_increment=1e-4, rng=22)
    result = estimate_one(surface, method)
    bound = 1.742 * np.sqrt(hurst / (hurst + 0.979)) / 128
    assert abs(float(result.hurst) - hurst) < 4 * bound
    # `likelihood` allows for noise and blur that the heights do not exclude
    # the standard deviation of a posterior, with the tails of departures: .020 at H = .85
    assert 0.9 * bound < float(result.standard_error) < 2.2 * bound


@pytest.mark.parametrize("hurst", [0.2, 0.8])
@pytest.mark.parametrize("cut", [{}, {"long_cutoff": 0.1, "rolloff": 0.03, "short_cutoff": 0.004}])
def test_periodic_surfaces(hurst, cut):
    surface = fc.surfaces.spectral((160, 160), 1e-3, hurst=hurst, rms_height=1e-5, rng=23, **cut)
    result = estimate(surface, ["default", "spectrum", "increments"])
    # of 20 surfaces with all cuts the errors are .03 (H = .8) and .10 (.2), standard errors .03 and .06
    error = 2.0 * float(result.standard_error[0]) if cut else 0.03
    assert float(result.hurst[0]) == pytest.approx(hurst, abs=error)
    assert float(result.standard_error[0]) < 0.1
    assert float(result.ci_low[0]) < hurst < float(result.ci_high[0])
    assert np.isnan(result.ci_low[2])
    assert "periodic" in str(result.reason.sel({"method": "increments"}).values)
    if cut:
        assert 0.004 <= float(result.scale_min[0]) < 0.006  # the middle of a bin, a third of an octave wide
        assert "30" in str(result.note.values[0]) or float(result.scale_max[0]) < 0.1


def test_crop_of_band_limited_surface_holds_exponent():
    surface = fc.surfaces.spectral((256, 256), 1e-3, hurst=0.8, rms_height=1e-5, rolloff=0.03, rng=24)
    result = estimate_one(surface[:128, :128])
    assert float(result.ci_low) < 0.8 < float(result.ci_high)


def test_levels_of_a_plateau_are_no_stretch():
    """Power hardly changes with length: levels that differ by chance gave lengths of 1 to 3, and H = .45."""
    edge, corner = 256, 8.0
    q = np.hypot(np.fft.fftfreq(edge)[:, None], np.fft.rfftfreq(edge))
    q[0, 0] = np.inf
    density = np.maximum(q, 1.0 / corner) ** -3.8 * np.isfinite(q)
    white = np.random.default_rng([0, 8, 10009]).standard_normal((edge, edge))
    heights = np.fft.irfft2(np.fft.rfft2(white) * np.sqrt(density))[:128, :128]
    found = estimate_one(surface_of(1e-6 * heights, 1e-4))
    assert found.hurst == pytest.approx(0.9, abs=0.05)
    assert found.ci_low < 0.9 < found.ci_high


def test_intervals_hold_with_most_points_missing():
    """The correction is repeated until it settles; after two rounds 2 of 12 held."""

    def holds(seed):
        surface = fc.surfaces.fbm((256, 256), 1e-4, hurst=0.7, rms_increment=1e-6, rng=91000 + seed)
        observed = np.random.default_rng([917, seed]).random(surface.shape) < 0.3
        result = estimate(surface.where(observed)).squeeze()
        assert abs(float(result.hurst) - 0.7) < 0.05
        return float(result.ci_low) < 0.7 < float(result.ci_high)

    assert at_least(3, map(holds, range(4)))


@pytest.mark.parametrize("hurst", [0.3, 0.7, 0.9])
def test_hole_in_the_middle_makes_no_short_waves(hurst):
    """With steps of its own the fill gave H = .74 for .7 here, and .45 for 768 x 768 points."""
    surface = fc.surfaces.fbm((384, 384), 1e-4, hurst=hurst, rms_increment=1e-6, rng=6)
    hole = slice(74, 310)
    observed = np.ones(surface.shape, dtype=bool)
    observed[hole, hole] = False
    result = estimate(surface.where(observed)).squeeze()
    assert float(result.ci_low) < hurst < float(result.ci_high)
    assert abs(float(result.hurst) - hurst) < 0.01
    assert float(result.ci_high - result.ci_low) < 0.05


def test_gaps_cause_no_bias(rough, of_rough):
    result, complete = estimate(with_gaps(rough), VALIDATED), of_rough(*VALIDATED)
    np.testing.assert_allclose(result.hurst, complete.hurst, atol=0.03)
    assert float(result.standard_error[1]) > float(complete.standard_error[1])
    np.testing.assert_allclose(result.standard_error, complete.standard_error, rtol=0.5)
    np.testing.assert_allclose(result.rms_increment, 2e-6, rtol=0.06)
    margin = rough.where((rough.y > rough.y[5]) & (rough.x < rough.x[-9]))
    np.testing.assert_allclose(estimate_one(margin).hurst, estimate_one(rough[6:, :-9]).hurst, rtol=1e-9)


def test_noise_is_separated():
    rng = np.random.default_rng(25)
    surface = fc.surfaces.fbm((160, 160), 1e-4, hurst=0.8, rms_increment=1e-6, rng=26)
    noisy = surface.copy(data=surface.values + 2.3e-7 * rng.standard_normal(surface.shape))
    plain, result = estimate_one(noisy), estimate_one(noisy, noise=2.3e-7)
    for found in (plain, result):  # this noise shows by itself
        assert float(found.ci_low) < 0.8 < float(found.ci_high)
        assert float(found.noise_height) == pytest.approx(2.3e-7, rel=0.1)
    gapped = estimate_one(with_gaps(noisy), noise=2.3e-7)
    assert float(gapped.ci_low) < 0.8 < float(gapped.ci_high)
    assert float(gapped.noise_height) == pytest.approx(2.3e-7, rel=0.15)
    others = estimate(noisy, ["increments", "variogram"], noise=2.3e-7)
    assert np.isnan(others.ci_low).all()
    assert "noise" in str(others.reason.values)


def test_unequal_spacings_and_transposed():
    surface = fc.surfaces.fbm((80, 150), (3e-4, 1e-4), hurst=0.4, rms_increment=1e-6, rng=27)
    result = estimate(surface, VALIDATED)
    assert ((result.ci_low < 0.4) & (result.ci_high > 0.4)).all()
    np.testing.assert_allclose(result.rms_increment, 1e-6, rtol=0.06)
    transposed = xr.DataArray(
        surface.values.T,
        dims=("y", "x"),
        coords={"y": surface.x.values, "x": surface.y.values},
        attrs=surface.attrs,
    )
    np.testing.assert_allclose(estimate(transposed, VALIDATED).hurst, result.hurst, atol=3e-3)


@pytest.mark.parametrize("name", SCALE_FREE)
def test_powers_of_two_change_no_bit(rough, of_rough, name):
    result, tiny = of_rough(name), estimate(rough * 2.0**-40, name)
    for key in ("hurst", "standard_error", "ci_low", "ci_high", "misfit"):
        np.testing.assert_array_equal(result[key], tiny[key])
    np.testing.assert_array_equal(result.rms_increment * 2.0**-40, tiny.rms_increment)
    longer = rough.assign_coords(x=rough.x * 2.0**10, y=rough.y * 2.0**10)
    if name != "cube_counts":
        np.testing.assert_allclose(estimate(longer, name).hurst, result.hurst, rtol=1e-12)


@pytest.mark.parametrize("factor", [1e-9, 1e6])
def test_any_unit_of_height(rough, of_rough, factor):
    np.testing.assert_allclose(
        estimate(rough * factor, SCALE_FREE).hurst, of_rough(*SCALE_FREE).hurst, rtol=1e-7
    )


def test_far_from_zero():
    """At 1e9 m heights have a precision of 1e-7 m; the exponent tolerates that."""
    surface = fc.surfaces.fbm((64, 64), 1.0, hurst=0.6, rms_increment=1e-3, rng=28)
    np.testing.assert_allclose(
        estimate(surface + 1e9, SCALE_FREE).hurst, estimate(surface, SCALE_FREE).hurst, atol=1e-3
    )


def test_threads_change_no_bit(rough):
    result = []
    for count in (1, 2):
        with resources.limit(count):
            result.append(
                estimate(with_gaps(rough), [name for name in NAMES if name != "spectrum"]).drop_vars(
                    "run_time"
                )
            )
    for key in result[0].data_vars:
        np.testing.assert_array_equal(result[0][key], result[1][key])


def test_scales_limit_the_fit(rough, of_rough):
    window = (4e-4, 3.2e-3)
    result = estimate(rough, NAMES, scales=window)
    assert (result.scale_min >= window[0] * (1 - 1e-9)).all()
    assert (result.scale_max <= window[1] * (1 + 1e-9)).all()
    free = of_rough("likelihood")
    assert float(result.standard_error[0]) > 1.5 * float(free.standard_error[0])
    assert float(result.ci_low[0]) < 0.7 < float(result.ci_high[0])
    with pytest.raises(InvalidInput, match="scales: expected a window that meets the lengths of the surface"):
        estimate(rough, NAMES, scales=(1.0, 2.0))
    empty = estimate(rough, NAMES, scales=(1.05e-4, 1.3e-4))
    assert np.isnan(empty.hurst).all()
    assert (empty.note != "").all()


@pytest.mark.parametrize("method", ["variogram", "madogram"])
def test_scales_beyond_default_lags(rough, method):
    """Lags longer than those of the default curve."""
    extent = min(n * 1e-4 for n in rough.shape)
    longest = 0.8 * extent
    result = fc.dimensions.estimate(rough, method, scales=(0.1 * extent, longest))
    assert 0.85 * longest < float(result.scale_max[0]) <= longest * (1 + 1e-9)


def test_stack_equals_single_results():
    stack = fc.surfaces.fbm((40, 40), 1e-3, hurst=0.5, rms_increment=1e-5, members=3, rng=30)
    result = estimate(stack, ["default", "variogram"])
    assert result.hurst.dims == ("member", "method")
    np.testing.assert_array_equal(result.hurst[2], estimate(stack[2], ["default", "variogram"]).hurst)
    assert "member" in result.coords


@pytest.mark.parametrize("hurst", [0.25, pytest.param(0.75, marks=pytest.mark.slow)])
def test_profiles(hurst):
    profile = fc.surfaces.fbm(900, 1e-4, hurst=hurst, rms_increment=1e-6, rng=31)
    result = estimate(profile, NAMES)
    np.testing.assert_allclose(result.fractal_dimension, 2.0 - result.hurst)
    # the first one is the default method
    assert float(result.ci_low[0]) < hurst < float(result.ci_high[0])
    assert abs(float(result.hurst[0]) - hurst) < 4 * 0.7 / 30
    assert float(result.rms_increment[0]) == pytest.approx(1e-6, rel=0.1)
    gapped = profile.where(np.random.default_rng(1).random(900) > 0.2)
    assert float(estimate_one(gapped).hurst) == pytest.approx(hurst, abs=0.1)
    tilted = profile.copy(data=profile.values + 1e-5 * np.arange(900))
    np.testing.assert_allclose(estimate_one(tilted).hurst, result.hurst[0], atol=1e-4)


def test_white_noise_gives_zero():
    result = estimate(surface_of(np.random.default_rng(33).standard_normal((64, 64))), VALIDATED)
    assert (result.hurst < 0.06).all()
    assert (result.ci_low < 0.01).all()
    assert (result.ci_high < 0.4).all()


def test_planes_and_smooth_caps_give_one():
    y = np.arange(24.0)
    result = estimate(surface_of(np.add.outer(0.03 * y, 0.1 * y)), NAMES)
    np.testing.assert_allclose(result.hurst, 1.0, rtol=1e-12)
    assert np.isnan(result.ci_low).all()
    assert "plane" in str(result.note.sel({"method": "likelihood"}).values)
    cap = estimate(surface_of(np.sqrt(2000 - np.add.outer((y - 12) ** 2, (y - 12) ** 2))), VALIDATED)
    np.testing.assert_array_equal(cap.hurst, 1.0)
    assert "smoother than a fractal" in str(cap.note.values)


@pytest.mark.parametrize("shape", [(40, 36), (60,)])
def test_plane_far_from_zero(shape):
    """Its heights are rounded to 1e-7 m."""
    heights = np.sum(np.indices(shape).T * np.array([0.1, 0.03])[: len(shape)], axis=-1).T + 1e9
    surface = fc.surfaces.from_array(heights, 1e-4)
    result = fc.dimensions.estimate(surface, ["likelihood", "increments", "roughness_length"])
    assert (result.hurst == 1.0).all()
    assert result.ci_low.isnull().all()


def test_constant_heights():
    result = estimate(surface_of(np.full((16, 16), 1e6)), NAMES)
    covers = result.method.isin(["cube_counts", "covering", "divider"]).values
    assert (result.fractal_dimension.values[covers] == 2.0).all()
    assert np.isnan(result.hurst.values[~covers]).all()
    assert "constant" in str(result.note.sel({"method": "likelihood"}).values)


@pytest.mark.parametrize("shape", [(5, 5), (7, 11), (4, 9), (4, 200), (31, 37)])
def test_small_and_prime_shapes(shape):
    surface = surface_of(np.random.default_rng(34).standard_normal(shape).cumsum(0).cumsum(1))
    result = estimate(surface, [name for name in NAMES if name != "roughness_length"])
    assert (np.isfinite(result.hurst) | (result.note != "")).all()
    low, high = float(result.ci_low[0]), float(result.ci_high[0])
    if np.isnan(low):  # twice summed noise may be smoother than any fractal
        assert str(result.reason.sel({"method": "likelihood"}).values)
    else:
        assert 0.0 <= low <= float(result.hurst[0]) <= high <= 1.0


def test_spike_and_rounded_heights():
    spike = np.zeros((20, 20))
    spike[7, 9] = 1.0
    assert str(estimate_one(surface_of(spike)).reason.values)
    surface = fc.surfaces.fbm((64, 64), 1e-3, hurst=0.7, rms_increment=1e-4, rng=35)
    steps = surface.copy(data=5e-5 * np.rint(surface.values / 5e-5))
    assert 0.5 < float(estimate_one(steps).hurst) < 0.75
    assert float(estimate_one(steps, noise=5e-5 / np.sqrt(12.0)).hurst) == pytest.approx(0.7, abs=0.15)


@pytest.mark.parametrize("shape", [(3, 3), (3, 9), (40, 3), (5, 5), (3,), (8,)])
def test_small_surfaces_have_an_estimate_or_the_reason(shape):
    names = list(fc.dimensions.methods())
    face = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.5, rms_increment=1e-6, rng=9)
    small = face[: shape[0], : shape[1]] if len(shape) == 2 else face[5, : shape[0]]
    result = estimate(small, names)
    assert all(result.reason.values[np.isnan(result.ci_low.values)])
    assert int(np.prod(shape)) >= 8 or (result.reason == "3 observed points, at least 8 are needed").all()


@pytest.mark.parametrize("hurst", [0.3, 0.7])
def test_intervals_of_small_surfaces_hold_the_exponent(hurst):
    """A strip of 3 x 40 points and a profile of 8."""
    faces = [fc.surfaces.fbm((64, 64), 1e-4, hurst=hurst, rms_increment=1e-6, rng=n) for n in range(30)]
    for parts in ([face[:3, :40] for face in faces], [face[5, :8] for face in faces]):
        results = (estimate_one(part, "increments") for part in parts)
        assert at_least(26, (each.ci_low <= hurst <= each.ci_high for each in results))


def test_invalid_arguments(rough):
    with pytest.raises(ValueError, match=r"methods: .*'defalt'") as caught:
        estimate(rough, ["defalt"], scales=(2.0, 1.0), noise="yes")
    assert "3 problems" in str(caught.value)
    for text, bad in {
        "at least one name": lambda: estimate(rough, []),
        "nothing but NaN": lambda: estimate(rough * np.nan),
        "infinite": lambda: estimate(rough.where(rough > 0, np.inf)),
        "uniform spacing": lambda: estimate(rough.assign_coords(x=rough.x**2)),
        "see fractalcontact.surfaces.fill": lambda: estimate(with_gaps(rough), "spectrum"),
        "a DataArray of heights": lambda: estimate(rough.values),
        "'m'": lambda: estimate(rough.assign_attrs(units="kg")),
    }.items():
        with pytest.raises(ValueError, match=text):
            bad()


@pytest.mark.parametrize("factor", [2.0**530, 2.0**-530])
@pytest.mark.parametrize("name", ["estimate", "directions", "spectrum", "variogram", "cube_counts"])
def test_heights_whose_powers_are_no_numbers_are_refused(rough, name, factor):
    with pytest.raises(InvalidInput, match="1e-100 to 1e100 m"):
        getattr(fc.dimensions, name)(rough.copy(data=rough.values * factor))


@pytest.mark.parametrize("factor", [2.0**280, 2.0**-280])
def test_exponents_do_not_depend_on_the_unit_of_height(rough, of_rough, factor):
    here, there = of_rough(*SCALE_FREE), estimate(rough.copy(data=rough.values * factor), SCALE_FREE)
    np.testing.assert_array_equal(here.hurst, there.hurst)
    np.testing.assert_array_equal(here.rms_increment * factor, there.rms_increment)


@pytest.mark.parametrize(("hurst", "noise"), [(0.9, 0.3), pytest.param(0.3, 1.0, marks=pytest.mark.slow)])
def test_known_noise_gives_a_narrower_interval_that_holds(hurst, noise):
    """The amplitude of the surface is unknown, that of the noise is not."""
    free, known = [], []
    for seed in range(8):
        surface = fc.surfaces.fbm((64, 64), 1e-4, hurst=hurst, rms_increment=2e-6, rng=seed)
        white = noise * 2e-6 * np.random.default_rng(99 + seed).standard_normal(surface.shape)
        for results, height in ((free, None), (known, noise * 2e-6)):
            results.append(
                fc.dimensions.estimate(surface.copy(data=surface.values + white), noise=height).isel(method=0)
            )
    low, high = (np.array([float(result[name]) for result in known]) for name in ("ci_low", "ci_high"))
    assert np.sum((low <= hurst) & (high >= hurst)) >= 7
    error = [np.sqrt(np.mean([(float(r.hurst) - hurst) ** 2 for r in results])) for results in (free, known)]
    assert error[1] < error[0]
    assert np.median([float(result.rms_increment) for result in known]) == pytest.approx(2e-6, rel=0.15)


@pytest.mark.parametrize("factor", [1e-9, 1.0, 1e6])
def test_noise_that_is_not_in_the_heights_is_refused(factor):
    """Once H = .05 with an interval to .29, and an rms increment of eleven times that of the heights."""
    rough = factor * fc.surfaces.fbm((64, 64), 1e-4, hurst=0.6, rms_increment=1e-6, rng=1)
    refused = estimate_one(rough, noise=factor * 5e-6)
    assert np.isnan(refused.hurst)
    assert np.isnan(refused.rms_increment)
    assert "noise" in str(refused.reason.values)
    white = rough.copy(data=factor * 1e-6 * np.random.default_rng(1).standard_normal((64, 64)))
    assert np.isfinite(estimate_one(white, noise=factor * 1e-6).hurst)


def test_words_on_a_gridded_surface_are_of_what_was_done():
    """Nobody asked for the scales; a method without an interval holds no error; a plane was not fitted."""
    x, y = np.random.default_rng(1).uniform(0.0, 12e-3, (2, 12000))
    rough = fc.surfaces.fbm((128, 128), 1e-4, hurst=0.7, rms_increment=1e-5, rng=1)
    z = rough.interp(x=("point", x), y=("point", y), kwargs={"fill_value": None}).values
    methods = ["likelihood", "increments", "variogram"]
    gridded = fc.surfaces.from_points(np.stack([x, y, z], axis=1), plane="xy")
    result = estimate(gridded, methods)
    assert not (result.window_rule == "asked for").any()
    holds = [note.endswith("which the interval holds") for note in result.note.values]
    np.testing.assert_array_equal(holds, np.isfinite(result.ci_low))
    flat = estimate(fc.surfaces.from_points(np.stack([x, y, 0.1 * x], axis=1), plane="xy"), methods)
    assert not any("nan" in note for note in flat.note.values)
    asked = estimate(gridded, "increments", scales=(2e-3, 1e-2))
    assert str(asked.window_rule.values[0]) == "asked for"


def test_every_interval_of_a_gridded_surface_holds_what_gridding_adds():
    """Once those of directions, windows and octaves were as long as if all points were measured."""
    x, y = np.random.default_rng(1).uniform(0, 16e-3, (2, 25000))
    rough = fc.surfaces.fbm((170, 170), 1e-4, hurst=0.7, rms_increment=1e-5, rng=1)
    z = rough.interp(x=("point", x), y=("point", y), kwargs={"fill_value": None}).values
    gridded = fc.surfaces.from_points(np.stack([x, y, z], axis=1), plane="xy")
    finest = float(gridded.finest_scale)
    scales = (finest, 4.0 * max(n * 1e-4 for n in gridded.shape))
    measured = gridded.drop_vars("finest_scale")
    dimensions = fc.dimensions
    for result, same in (
        (dimensions.directions(gridded), dimensions.directions(measured, scales=scales)),
        (dimensions.hurst_map(gridded, 1.2e-2), dimensions.hurst_map(measured, 1.2e-2, scales=scales)),
    ):
        np.testing.assert_allclose(result.hurst, same.hurst, atol=1e-6)
        np.testing.assert_allclose(result.ci_high, same.ci_high, atol=1e-6)
        np.testing.assert_allclose(result.ci_low, np.maximum(same.ci_low - 0.035, 0.0), atol=1e-6)
    whole, octaves = estimate_one(gridded), dimensions.scaling(gridded)
    assert float(octaves.window_ci_low) == float(whole.ci_low)
    assert float(octaves.window_ci_high) == float(whole.ci_high)
