"""What `estimate` promises: names, labels, families, limits, errors, invariances."""

import json

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base import threads
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.results import provenance_of

VARIABLES = {
    "hurst", "fractal_dimension", "fitted_hurst", "standard_error", "ci_low", "ci_high", "scale_min",
    "scale_max", "rms_increment", "topothesy", "noise_height", "misfit", "run_time",
}  # fmt: skip
NAMES = list(fc.dimensions.methods())
HONEST = ["likelihood", "increments"]
SCALE_FREE = [name for name in NAMES if name != "covering"]


def estimate(*arguments, **options):
    return fc.dimensions.estimate(*arguments, **options)


def one(surface, method=None, **options):
    return estimate(surface, method, **options).isel(method=0)


def surface(heights, spacing=1e-3):
    return fc.surfaces.from_array(np.asarray(heights, float), spacing)


@pytest.fixture(scope="module")
def rough():
    return fc.surfaces.fbm((96, 80), 1e-4, hurst=0.7, rms_increment=2e-6, rng=21)


def holes(face, share=0.1, seed=0):
    rng = np.random.default_rng(seed)
    heights = face.values.copy()
    heights[rng.random(heights.shape) < share] = np.nan
    heights[10:20, 30:45] = np.nan
    return face.copy(data=heights)


def test_the_default_alone(rough):
    found = estimate(rough)
    assert list(found.method.values) == ["default"]
    assert provenance_of(found)["default_method"] == "likelihood"
    assert set(found.data_vars) == VARIABLES
    assert all(found[name].dims == ("method",) for name in VARIABLES)
    assert float(found.increment_lag) == 1e-4
    again = estimate(rough, ["likelihood"])
    for name in VARIABLES - {"run_time"}:
        np.testing.assert_array_equal(found[name], again[name])


def test_every_method_by_name(rough, tmp_path):
    found = estimate(rough, ["default", *NAMES])
    assert list(found.method.values) == ["default", *NAMES]
    np.testing.assert_allclose(found.fractal_dimension, 3.0 - found.hurst, rtol=1e-15)
    near = found.hurst.sel({"method": ["default", "increments", "second_variogram"]})
    np.testing.assert_allclose(near, 0.7, atol=0.05)
    given = np.isfinite(found.ci_low)
    assert list(found.method.values[given.values]) == ["default", *HONEST]
    reasons = json.loads(found.ci_low.attrs["reason"])
    assert set(reasons) == set(NAMES) - set(HONEST)
    assert all(reasons.values())
    assert set(json.loads(found.scale_min.attrs["comment"])) == {"default", *NAMES}
    assert (found.scale_min < found.scale_max).all()
    xr.testing.assert_identical(fc.open(fc.save(found, tmp_path / "found.nc")), found)


def test_methods_are_described():
    table = fc.dimensions.methods()
    assert next(iter(table)) == "likelihood"
    assert all(isinstance(line, str) and line.count("\n") == 0 for line in table.values())
    assert [name for name, line in table.items() if "95 % interval" in line] == HONEST


def test_amplitude_is_found(rough):
    found = estimate(rough, HONEST)
    np.testing.assert_allclose(found.rms_increment, 2e-6, rtol=0.05)
    exact = 1e-4 * (2e-6 / 1e-4) ** (1 / (1 - found.hurst))
    np.testing.assert_allclose(
        found.topothesy, exact * (found.rms_increment / 2e-6) ** (1 / (1 - found.hurst))
    )


@pytest.mark.parametrize("hurst", [0.15, 0.5, 0.85])
@pytest.mark.parametrize("method", HONEST)
def test_fractional_brownian_faces(hurst, method):
    """Within four times the least possible standard deviation, 1.742 sqrt(H / (H + .979)) / n."""
    face = fc.surfaces.fbm((128, 128), 1e-3, hurst=hurst, rms_increment=1e-4, rng=22)
    found = one(face, method)
    bound = 1.742 * np.sqrt(hurst / (hurst + 0.979)) / 128
    assert abs(float(found.hurst) - hurst) < 4 * bound
    assert 0.9 * bound < float(found.standard_error) < 1.35 * bound


@pytest.mark.parametrize("hurst", [0.2, 0.8])
@pytest.mark.parametrize("cut", [{}, {"long_cutoff": 0.1, "rolloff": 0.03, "short_cutoff": 0.004}])
def test_periodic_faces_belong_to_another_family(hurst, cut):
    face = fc.surfaces.spectral((160, 160), 1e-3, hurst=hurst, rms_height=1e-5, rng=23, **cut)
    found = estimate(face, ["default", "spectrum", "increments"])
    assert float(found.hurst[0]) == pytest.approx(hurst, abs=0.1 if cut else 0.03)
    assert float(found.ci_low[0]) < hurst < float(found.ci_high[0])
    assert "periodic" in json.loads(found.hurst.attrs["comment"])["default"]
    assert np.isnan(found.ci_low[2])
    assert "periodic" in json.loads(found.ci_low.attrs["reason"])["increments"]
    if cut:
        assert float(found.scale_min[0]) == pytest.approx(0.004, rel=0.1)
        assert 0.015 < float(found.scale_max[0]) < 0.04


def test_a_crop_of_a_band_limited_face_is_found_out():
    face = fc.surfaces.spectral((256, 256), 1e-3, hurst=0.8, rms_height=1e-5, rolloff=0.03, rng=24)
    found = one(face[:128, :128])
    assert abs(float(found.misfit)) > 3.3
    note = json.loads(estimate(face[:128, :128]).hurst.attrs["comment"])["default"]
    assert "changes with scale" in note
    assert float(found.ci_high - found.ci_low) > 8 * float(found.standard_error)


def test_gaps_are_left_out_without_bias(rough):
    found, whole = estimate(holes(rough), HONEST), estimate(rough, HONEST)
    np.testing.assert_allclose(found.hurst, whole.hurst, atol=0.03)
    assert (found.standard_error > whole.standard_error).all()
    np.testing.assert_allclose(found.standard_error, whole.standard_error, rtol=0.35)
    np.testing.assert_allclose(found.rms_increment, 2e-6, rtol=0.06)
    margin = rough.where((rough.y > rough.y[5]) & (rough.x < rough.x[-9]))
    np.testing.assert_allclose(one(margin).hurst, one(rough[6:, :-9]).hurst, rtol=1e-9)


def test_noise_is_told_apart():
    rng = np.random.default_rng(25)
    face = fc.surfaces.fbm((160, 160), 1e-4, hurst=0.8, rms_increment=1e-6, rng=26)
    noisy = face.copy(data=face.values + 2.3e-7 * rng.standard_normal(face.shape))
    plain, found = one(noisy), one(noisy, noise=True)
    assert float(plain.hurst) < 0.72
    assert float(found.ci_low) < 0.8 < float(found.ci_high)
    assert float(found.noise_height) == pytest.approx(2.3e-7, rel=0.1)
    assert np.isnan(plain.noise_height)
    gapped = one(holes(noisy), noise=True)
    assert float(gapped.ci_low) < 0.8 < float(gapped.ci_high)
    assert float(gapped.noise_height) == pytest.approx(2.3e-7, rel=0.15)
    others = estimate(noisy, ["increments", "variogram"], noise=True)
    assert np.isnan(others.ci_low).all()
    assert "noise" in others.ci_low.attrs["reason"]


def test_unequal_spacings_and_any_orientation():
    face = fc.surfaces.fbm((80, 150), (3e-4, 1e-4), hurst=0.4, rms_increment=1e-6, rng=27)
    found = estimate(face, HONEST)
    assert ((found.ci_low < 0.4) & (found.ci_high > 0.4)).all()
    np.testing.assert_allclose(found.rms_increment, 1e-6, rtol=0.06)
    turned = xr.DataArray(
        face.values.T, dims=("y", "x"), coords={"y": face.x.values, "x": face.y.values}, attrs=face.attrs
    )
    np.testing.assert_allclose(estimate(turned, HONEST).hurst, found.hurst, rtol=1e-5)


@pytest.mark.parametrize("name", SCALE_FREE)
def test_units_of_powers_of_two_change_no_bit(rough, name):
    found, tiny = estimate(rough, name), estimate(rough * 2.0**-40, name)
    for key in ("hurst", "standard_error", "ci_low", "ci_high", "misfit"):
        np.testing.assert_array_equal(found[key], tiny[key])
    np.testing.assert_array_equal(found.rms_increment * 2.0**-40, tiny.rms_increment)
    longer = rough.assign_coords(x=rough.x * 2.0**10, y=rough.y * 2.0**10)
    if name != "cube_counts":
        np.testing.assert_allclose(estimate(longer, name).hurst, found.hurst, rtol=1e-12)


@pytest.mark.parametrize("factor", [1e-9, 1e6])
def test_any_unit_of_height(rough, factor):
    np.testing.assert_allclose(
        estimate(rough * factor, SCALE_FREE).hurst, estimate(rough, SCALE_FREE).hurst, rtol=1e-7
    )


def test_far_from_zero():
    """At 1e9 m heights have a precision of 1e-7 m; the exponent must survive that and no more."""
    face = fc.surfaces.fbm((64, 64), 1.0, hurst=0.6, rms_increment=1e-3, rng=28)
    np.testing.assert_allclose(
        estimate(face + 1e9, SCALE_FREE).hurst, estimate(face, SCALE_FREE).hurst, atol=1e-3
    )


def test_tilt_row_offsets_and_mirrors_leave_the_likelihood(rough):
    rng = np.random.default_rng(29)
    lines = rough.copy(data=rough.values + 1e-5 * rng.standard_normal((96, 1)) + 1e-3 * np.arange(80))
    # another pilot estimate, and with it other nodes of interpolation
    np.testing.assert_allclose(one(lines).hurst, one(rough).hurst, rtol=2e-5)
    np.testing.assert_allclose(one(rough.copy(data=rough.values[::-1])).hurst, one(rough).hurst, rtol=1e-9)


def test_threads_change_no_bit(rough):
    found = []
    for count in (1, 2):
        with threads.limit(count):
            found.append(
                estimate(holes(rough), [name for name in NAMES if name != "spectrum"]).drop_vars("run_time")
            )
    for key in found[0].data_vars:
        np.testing.assert_array_equal(found[0][key], found[1][key])


def test_scales_limit_the_fit(rough):
    window = (4e-4, 3.2e-3)
    found = estimate(rough, NAMES, scales=window)
    assert (found.scale_min >= window[0] * (1 - 1e-9)).all()
    assert (found.scale_max <= window[1] * (1 + 1e-9)).all()
    free = estimate(rough, ["likelihood"])
    assert float(found.standard_error[0]) > 1.5 * float(free.standard_error[0])
    assert float(found.ci_low[0]) < 0.7 < float(found.ci_high[0])
    with pytest.raises(InvalidInput, match="scales: expected a window that meets the lengths of the surface"):
        estimate(rough, NAMES, scales=(1.0, 2.0))
    empty = estimate(rough, NAMES, scales=(1.05e-4, 1.3e-4))
    assert np.isnan(empty.hurst).all()
    assert set(json.loads(empty.hurst.attrs["comment"])) == set(NAMES)


@pytest.mark.parametrize("method", ["variogram", "madogram", "second_variogram"])
def test_lags_are_fitted_as_far_as_they_were_asked_for(rough, method):
    """Farther than the curve goes by itself."""
    extent = min(n * 1e-4 for n in rough.shape)
    longest = {"variogram": 0.8, "madogram": 0.8, "second_variogram": 0.4}[method] * extent
    found = fc.dimensions.estimate(rough, method, scales=(0.1 * extent, longest))
    assert 0.85 * longest < float(found.scale_max[0]) <= longest * (1 + 1e-9)


def test_a_stack_is_its_members():
    stack = fc.surfaces.fbm((40, 40), 1e-3, hurst=0.5, rms_increment=1e-5, members=3, rng=30)
    found = estimate(stack, ["default", "variogram"])
    assert found.hurst.dims == ("member", "method")
    np.testing.assert_array_equal(found.hurst[2], estimate(stack[2], ["default", "variogram"]).hurst)
    assert "member" in found.coords


@pytest.mark.parametrize("hurst", [0.25, 0.75])
def test_profiles(hurst):
    profile = fc.surfaces.fbm(900, 1e-4, hurst=hurst, rms_increment=1e-6, rng=31)
    found = estimate(profile, ["default", *NAMES])
    np.testing.assert_allclose(found.fractal_dimension, 2.0 - found.hurst)
    assert float(found.ci_low[0]) < hurst < float(found.ci_high[0])
    assert abs(float(found.hurst[0]) - hurst) < 4 * 0.7 / 30
    assert float(found.rms_increment[0]) == pytest.approx(1e-6, rel=0.1)
    gapped = profile.where(np.random.default_rng(1).random(900) > 0.2)
    assert float(one(gapped).hurst) == pytest.approx(hurst, abs=0.1)
    tilted = profile.copy(data=profile.values + 1e-5 * np.arange(900))
    np.testing.assert_allclose(one(tilted).hurst, found.hurst[0], atol=1e-4)


def test_a_periodic_face_with_gaps_has_no_interval_and_says_why():
    for shape in (256, (32, 40)):
        face = fc.surfaces.spectral(shape, 1e-3, hurst=0.6, rms_height=1e-5, short_cutoff=4e-3, rng=35)
        torn = one(face.where(face.x != face.x[7]))
        assert np.isfinite(float(torn.hurst))
        assert np.isnan([float(torn[name]) for name in ("standard_error", "ci_low", "ci_high")]).all()
        assert "fill" in json.loads(torn.ci_low.attrs["reason"])["default"]


def test_periodic_profile():
    profile = fc.surfaces.spectral(2048, 1e-3, hurst=0.6, rms_height=1e-5, rng=32)
    found = one(profile)
    assert float(found.ci_low) < 0.6 < float(found.ci_high)


def test_white_noise_is_the_limit_zero():
    found = estimate(surface(np.random.default_rng(33).standard_normal((64, 64))), HONEST)
    assert (found.hurst < 0.02).all()
    assert (found.ci_low == 0.0).all()
    assert (found.ci_high < 0.05).all()


def test_planes_and_smooth_caps_are_the_limit_one():
    y = np.arange(24.0)
    found = estimate(surface(np.add.outer(0.03 * y, 0.1 * y)), NAMES)
    np.testing.assert_allclose(found.hurst, 1.0, rtol=1e-12)
    assert np.isnan(found.ci_low).all()
    assert "plane" in json.loads(found.hurst.attrs["comment"])["likelihood"]
    cap = estimate(surface(np.sqrt(2000 - np.add.outer((y - 12) ** 2, (y - 12) ** 2))), HONEST)
    np.testing.assert_array_equal(cap.hurst, 1.0)
    assert (cap.fitted_hurst > 1.3).all()
    assert "smoother than a fractal" in cap.hurst.attrs["comment"]


@pytest.mark.parametrize("shape", [(40, 36), (60,)])
def test_a_plane_far_from_zero_is_a_plane(shape):
    """Its heights are rounded to 1e-7 m."""
    heights = np.sum(np.indices(shape).T * np.array([0.1, 0.03])[: len(shape)], axis=-1).T + 1e9
    face = fc.surfaces.from_array(heights, 1e-4)
    found = fc.dimensions.estimate(face, ["likelihood", "increments", "second_variogram", "roughness_length"])
    assert (found.hurst == 1.0).all()
    assert found.ci_low.isnull().all()


def test_constant_heights_have_no_exponent_but_a_covering_of_dimension_two():
    found = estimate(surface(np.full((16, 16), 1e6)), NAMES)
    covers = found.method.isin(["cube_counts", "covering"]).values
    assert (found.fractal_dimension.values[covers] == 2.0).all()
    assert np.isnan(found.hurst.values[~covers]).all()
    assert "constant" in json.loads(found.hurst.attrs["comment"])["likelihood"]


def test_corrugations_are_sent_to_profiles():
    found = estimate(surface(np.tile(np.sin(0.7 * np.arange(40)), (40, 1))))
    assert np.isnan(found.hurst).all()
    assert "profile" in found.hurst.attrs["comment"]


@pytest.mark.parametrize("shape", [(5, 5), (7, 11), (4, 9), (4, 200), (31, 37)])
def test_small_and_prime_faces_give_an_interval_or_a_reason(shape):
    face = surface(np.random.default_rng(34).standard_normal(shape).cumsum(0).cumsum(1))
    found = estimate(face, [name for name in NAMES if name != "roughness_length"])
    notes = json.loads(found.hurst.attrs["comment"])
    for name, hurst in zip(found.method.values, found.hurst.values, strict=True):
        assert np.isfinite(hurst) or notes[name]
    low, high = float(found.ci_low[0]), float(found.ci_high[0])
    if np.isnan(low):  # twice summed noise may be smoother than any fractal
        assert json.loads(found.ci_low.attrs["reason"])["likelihood"]
        assert float(found.fitted_hurst[0]) > 1.0
    else:
        assert 0.0 <= low <= float(found.hurst[0]) <= high <= 1.0


def test_one_spike_and_quantised_heights():
    spike = np.zeros((20, 20))
    spike[7, 9] = 1.0
    assert float(one(surface(spike)).hurst) < 0.05
    face = fc.surfaces.fbm((64, 64), 1e-3, hurst=0.7, rms_increment=1e-4, rng=35)
    steps = face.copy(data=5e-5 * np.rint(face.values / 5e-5))
    assert 0.5 < float(one(steps).hurst) < 0.75
    assert float(one(steps, noise=True).hurst) == pytest.approx(0.7, abs=0.15)


def test_bad_input_is_told_all_at_once(rough):
    with pytest.raises(ValueError, match=r"methods: .*'defalt'") as told:
        estimate(rough, ["defalt"], scales=(2.0, 1.0), noise="yes")
    assert "3 problems" in str(told.value)
    for text, bad in {
        "at least one name": lambda: estimate(rough, []),
        "nothing but NaN": lambda: estimate(rough * np.nan),
        "infinite": lambda: estimate(rough.where(rough > 0, np.inf)),
        "uniform spacing": lambda: estimate(rough.assign_coords(x=rough.x**2)),
        "at least 4 points": lambda: estimate(surface(np.eye(3))),
        "at least 25 observed points": lambda: estimate(surface(np.eye(4))),
        "see fractalcontact.surfaces.fill": lambda: estimate(holes(rough), "spectrum"),
        "a DataArray of heights": lambda: estimate(rough.values),
        "'m'": lambda: estimate(rough.assign_attrs(units="um")),
    }.items():
        with pytest.raises(ValueError, match=text):
            bad()


def test_the_room_loads_nothing_heavy():
    import subprocess
    import sys

    code = (
        "import sys, fractalcontact.dimensions as d; d.methods();"
        "print(sorted(set(sys.modules) & {'numba', 'xarray', 'matplotlib', 'skimage', 'dask', 'netCDF4'}))"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "[]"


@pytest.mark.parametrize("factor", [2.0**530, 2.0**-530])
def test_heights_whose_squares_are_no_numbers(rough, factor):
    """Exponents know no unit; the curves, which are in m2 and m4, refuse."""
    far = rough.copy(data=rough.values * factor)
    unitless = [name for name in NAMES if name != "covering"]
    here, there = estimate(rough, unitless), estimate(far, unitless)
    np.testing.assert_array_equal(here.hurst, there.hurst)
    np.testing.assert_array_equal(here.rms_increment * factor, there.rms_increment)
    assert np.isfinite(estimate(far, "covering").hurst).all()
    for curve in ("spectrum", "variogram", "second_variogram", "cube_counts", "roughness_length"):
        with pytest.raises(InvalidInput, match="whose squares are numbers"):
            getattr(fc.dimensions, curve)(far)
