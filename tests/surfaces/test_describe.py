"""Statistics of surfaces: closed forms, gaps, units, constant surfaces, labels."""

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.schema import QUANTITIES


def wave(n=64, step=0.1, amplitude=2.0, waves=3, periodic=True):
    x = np.arange(n) * step
    heights = np.tile(5.0 + amplitude * np.sin(2 * np.pi * waves * x / (n * step)), (n, 1))
    return fc.surfaces.from_array(heights, step, periodic=periodic)


def test_one_wave_by_modes():
    statistics = fc.surfaces.describe(wave())
    k = 2 * np.pi * 3 / 6.4
    assert float(statistics.mean_height) == pytest.approx(5.0)
    assert float(statistics.rms_height) == pytest.approx(2 / np.sqrt(2))
    assert float(statistics.peak_to_valley) == pytest.approx(4.0, rel=0.01)
    assert float(statistics.rms_slope) == pytest.approx(2 * k / np.sqrt(2))
    assert float(statistics.rms_slope_x) == pytest.approx(2 * k / np.sqrt(2))
    assert float(statistics.rms_slope_y) == pytest.approx(0.0, abs=1e-12)
    assert float(statistics.rms_curvature) == pytest.approx(k**2 / np.sqrt(2))
    assert float(statistics.nayak_parameter) == pytest.approx(1.5)
    assert float(statistics.skewness) == pytest.approx(0.0, abs=1e-12)
    assert float(statistics.kurtosis) == pytest.approx(1.5)


def test_one_wave_by_differences():
    statistics = fc.surfaces.describe(wave(periodic=False))
    step, k = 0.1, 2 * np.pi * 3 / 6.4
    response = np.sin(k * step / 2) / (k * step / 2)  # response of a difference to a wave
    assert float(statistics.rms_slope_x) == pytest.approx(2 * k / np.sqrt(2) * response, rel=0.02)
    assert float(statistics.rms_curvature) == pytest.approx(k**2 / np.sqrt(2) * response**2, rel=0.05)


def test_plane():
    zero = fc.surfaces.from_array(np.zeros((20, 30)), (2.0, 0.5))
    tilted = zero + 0.3 * zero.x - 0.4 * zero.y
    tilted.attrs = {"units": "m"}
    statistics = fc.surfaces.describe(tilted)
    assert float(statistics.mean_slope_x) == pytest.approx(0.3)
    assert float(statistics.mean_slope_y) == pytest.approx(-0.4)
    assert float(statistics.rms_slope) == pytest.approx(0.5)
    assert float(statistics.rms_curvature) == pytest.approx(0.0, abs=1e-12)
    assert float(statistics.developed_area_ratio) == pytest.approx(np.sqrt(1.25))


def test_mean_curvature_of_a_paraboloid():
    x, y = np.meshgrid(np.arange(9.0), np.arange(9.0))
    statistics = fc.surfaces.describe(fc.surfaces.from_array(0.5 * 0.2 * x**2 + 0.5 * 0.6 * y**2, 1.0))
    assert float(statistics.rms_curvature) == pytest.approx(0.4)


def test_rms_slope_of_a_spectral_surface():
    surface = fc.surfaces.spectral((50, 64), (1e-6, 2e-6), hurst=0.8, rms_slope=0.1, rng=1)
    assert float(fc.surfaces.describe(surface).rms_slope) == pytest.approx(0.1, rel=1e-12)


def test_slope_of_a_brownian_surface_by_its_increments():
    surface = fc.surfaces.fbm((400, 400), 1e-3, hurst=0.5, rms_increment=2e-5, rng=1)
    statistics = fc.surfaces.describe(surface)
    assert float(statistics.rms_slope_x) == pytest.approx(0.02, rel=0.02)
    assert float(statistics.rms_slope) == pytest.approx(0.02 * np.sqrt(2), rel=0.02)


def test_against_plain_numpy_with_gaps():
    rng = np.random.default_rng(0)
    heights = rng.standard_normal((20, 30))
    heights[rng.random(heights.shape) < 0.2] = np.nan
    statistics = fc.surfaces.describe(fc.surfaces.from_array(heights, (0.5, 2.0)))
    assert int(statistics.missing_points) == np.isnan(heights).sum()
    centred = heights - np.nanmean(heights)
    assert float(statistics.rms_height) == pytest.approx(np.sqrt(np.nanmean(centred**2)))
    assert float(statistics.mean_absolute_height) == pytest.approx(np.nanmean(np.abs(centred)))
    assert float(statistics.peak_height) == pytest.approx(np.nanmax(heights) - np.nanmean(heights))
    assert float(statistics.valley_depth) == pytest.approx(np.nanmean(heights) - np.nanmin(heights))
    assert float(statistics.peak_height + statistics.valley_depth) == pytest.approx(
        float(statistics.peak_to_valley)
    )
    assert float(statistics.skewness) == pytest.approx(np.nanmean(centred**3) / np.nanmean(centred**2) ** 1.5)
    assert float(statistics.kurtosis) == pytest.approx(np.nanmean(centred**4) / np.nanmean(centred**2) ** 2)
    assert float(statistics.rms_slope_x) == pytest.approx(
        np.sqrt(np.nanmean((np.diff(heights, axis=1) / 2.0) ** 2))
    )
    assert float(statistics.rms_slope_y) == pytest.approx(
        np.sqrt(np.nanmean((np.diff(heights, axis=0) / 0.5) ** 2))
    )
    inner = heights[1:-1, 1:-1]
    laplacian = (heights[1:-1, 2:] - 2 * inner + heights[1:-1, :-2]) / 4.0
    laplacian += (heights[2:, 1:-1] - 2 * inner + heights[:-2, 1:-1]) / 0.25
    assert float(statistics.rms_curvature) == pytest.approx(0.5 * np.sqrt(np.nanmean(laplacian**2)))


def test_developed_area_by_triangles():
    rng = np.random.default_rng(5)
    heights = rng.standard_normal((7, 9))
    heights[2, 3] = np.nan
    dy, dx = 0.5, 2.0
    areas = []
    for j in range(6):
        for i in range(8):
            corners = [np.array([a * dx, b * dy, heights[j + b, i + a]]) for b in (0, 1) for a in (0, 1)]
            cuts = [(0, 1, 3), (0, 3, 2), (0, 1, 2), (1, 3, 2)]
            halves = [
                np.linalg.norm(np.cross(corners[q] - corners[p], corners[r] - corners[p])) for p, q, r in cuts
            ]
            areas.append(0.25 * sum(halves) / (dy * dx))
    statistics = fc.surfaces.describe(fc.surfaces.from_array(heights, (dy, dx)))
    assert float(statistics.developed_area_ratio) == pytest.approx(np.nanmean(areas), rel=1e-12)
    assert float(statistics.developed_area_excess) == pytest.approx(np.nanmean(areas) - 1.0, rel=1e-12)


def test_developed_area_of_small_slopes():
    heights = np.random.default_rng(5).standard_normal((40, 40))
    statistics = fc.surfaces.describe(fc.surfaces.from_array(1e-9 * heights, 1.0))
    square = np.mean(np.diff(heights, axis=0) ** 2) + np.mean(np.diff(heights, axis=1) ** 2)
    assert float(statistics.developed_area_excess) == pytest.approx(0.5e-18 * square, rel=0.05)
    assert float(statistics.developed_area_ratio) == 1.0


def test_mirrors_and_transposes():
    heights = np.random.default_rng(1).standard_normal((12, 15))
    base = fc.surfaces.describe(fc.surfaces.from_array(heights, (1.0, 2.0)))
    mirror = fc.surfaces.describe(fc.surfaces.from_array(heights[::-1], (1.0, 2.0)))
    turned = fc.surfaces.describe(fc.surfaces.from_array(heights.T, (2.0, 1.0)))
    for name in ("rms_slope", "rms_curvature", "developed_area_ratio", "nayak_parameter"):
        assert float(mirror[name]) == pytest.approx(float(base[name]), rel=1e-12)
        assert float(turned[name]) == pytest.approx(float(base[name]), rel=1e-12)
    assert float(turned.rms_slope_x) == pytest.approx(float(base.rms_slope_y), rel=1e-12)
    assert float(mirror.mean_slope_y) == pytest.approx(-float(base.mean_slope_y), rel=1e-12)


@pytest.mark.parametrize("periodic", [False, True])
def test_units_by_powers_of_two_change_no_bit(periodic):
    heights = np.random.default_rng(1).standard_normal((12, 15))
    base = fc.surfaces.describe(fc.surfaces.from_array(heights, (1.0, 1.5), periodic=periodic))
    moved = fc.surfaces.describe(
        fc.surfaces.from_array(heights * 2.0**-40, (2.0**-20, 1.5 * 2.0**-20), periodic=periodic)
    )
    for name in base.data_vars:
        if name in ("run_time", "developed_area_ratio", "developed_area_excess"):
            continue
        units = QUANTITIES[name].units
        power = {"m": -40, "m-1": 0}.get(units, -20 if "slope" in name else 0)
        assert float(moved[name]) == float(base[name]) * 2.0**power, name


def test_large_offset_changes_only_the_mean():
    heights = np.round(np.random.default_rng(1).standard_normal((12, 15)) * 64) / 64  # exact beside 1e9
    base = fc.surfaces.describe(fc.surfaces.from_array(heights, 1.0))
    lifted = fc.surfaces.describe(fc.surfaces.from_array(heights + 1e9, 1.0))
    for name in base.data_vars:
        if name not in ("run_time", "mean_height"):
            assert float(lifted[name]) == pytest.approx(float(base[name]), rel=1e-11), name
    assert float(lifted.mean_height) == pytest.approx(1e9, rel=1e-9)


def test_constant_surface_has_no_skewness():
    statistics = fc.surfaces.describe(fc.surfaces.from_array(np.full((5, 6), 3.0), 1.0))
    for name in ("skewness", "kurtosis", "nayak_parameter"):
        assert np.isnan(statistics[name])
        assert "equal" in statistics[name].attrs["reason"]
    for name in ("rms_height", "rms_slope", "rms_curvature", "peak_to_valley", "mean_slope_x"):
        assert float(statistics[name]) == 0.0
    assert float(statistics.developed_area_ratio) == 1.0
    assert "reason" not in statistics.rms_slope.attrs


def test_surface_without_points_is_nan_with_a_reason():
    statistics = fc.surfaces.describe(fc.surfaces.from_array(np.full((5, 6), np.nan), 1.0))
    for name, variable in statistics.data_vars.items():
        if name not in ("run_time", "missing_points"):
            assert np.isnan(variable), name
            assert variable.attrs["reason"] == "no point was observed"


def test_isolated_points_have_heights_but_no_slopes():
    heights = np.full((7, 7), np.nan)
    heights[::2, ::2] = np.random.default_rng(0).random((4, 4))
    statistics = fc.surfaces.describe(fc.surfaces.from_array(heights, 1.0))
    assert np.isfinite(statistics.rms_height)
    assert np.isfinite(statistics.mean_slope_x)
    for name in ("rms_slope", "rms_curvature", "developed_area_ratio"):
        assert np.isnan(statistics[name])
        assert "neighbouring" in statistics[name].attrs["reason"]


def test_members_profiles_and_labels():
    stack = fc.surfaces.fbm((8, 9), 1.0, hurst=0.5, rms_increment=1.0, rng=1, members=3)
    statistics = fc.surfaces.describe(stack)
    assert statistics.rms_height.dims == ("member",)
    single = fc.surfaces.describe(stack.isel(member=2, drop=True))
    assert float(statistics.rms_slope[2]) == float(single.rms_slope)
    for name, variable in {**statistics.data_vars, **statistics.coords}.items():
        assert variable.attrs["units"] == QUANTITIES[name].units
        assert variable.attrs["long_name"]
    profile = fc.surfaces.describe(stack.isel(member=0, y=0, drop=True))
    assert "rms_slope_y" not in profile
    assert float(profile.rms_slope) == float(profile.rms_slope_x)


def test_invalid_surfaces_are_refused():
    with pytest.raises(InvalidInput, match="DataArray"):
        fc.surfaces.describe(np.zeros((3, 3)))
    bad = fc.surfaces.from_array(np.zeros((4, 4)), 1.0).copy(data=np.full((4, 4), np.inf))
    with pytest.raises(InvalidInput, match="infinite"):
        fc.surfaces.describe(bad)


def test_stack_with_its_own_dim_name():
    stack = fc.surfaces.fbm((8, 9), 1.0, hurst=0.5, rms_increment=1.0, rng=1, members=2)
    named = stack.drop_vars("member").rename(member="specimen").assign_coords(specimen=["p", "q"])
    statistics = fc.surfaces.describe(named)
    assert statistics.rms_height.dims == ("specimen",)
    np.testing.assert_array_equal(statistics.rms_height, fc.surfaces.describe(stack).rms_height)


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("gaps", [False, True])
def test_large_surface_against_whole_arrays(periodic, gaps):
    """More points than a block of the differences; the reference takes whole arrays."""
    rng, (dy, dx) = np.random.default_rng(3), (0.5, 0.25)
    heights = rng.normal(size=(301, 170)).cumsum(axis=1)
    if gaps:
        heights[rng.random(heights.shape) < 0.01] = np.nan
    found = fc.surfaces.describe(fc.surfaces.from_array(heights, (dy, dx), periodic=periodic))
    padded = np.pad(heights, 1, mode="wrap") if periodic else np.pad(heights, 1, constant_values=np.nan)
    here, right, left = padded[1:-1, 1:-1], padded[1:-1, 2:], padded[1:-1, :-2]
    below, above, corner = padded[2:, 1:-1], padded[:-2, 1:-1], padded[2:, 2:]
    along_x, along_y = ((right - here) / dx) ** 2, ((below - here) / dy) ** 2
    along_x_below, along_y_right = ((corner - below) / dx) ** 2, ((corner - right) / dy) ** 2
    laplacian = (right - 2 * here + left) / dx**2 + (below - 2 * here + above) / dy**2
    area = sum(np.sqrt(1 + x + y) for x in (along_x, along_x_below) for y in (along_y, along_y_right)) / 4
    assert found.developed_area_ratio.item() == pytest.approx(np.nanmean(area), rel=1e-12)
    assert found.peak_to_valley.item() == pytest.approx(np.nanmax(heights) - np.nanmin(heights), rel=1e-14)
    centred = heights - np.nanmean(heights)
    for name, power in (("skewness", 3), ("kurtosis", 4)):
        expected = np.nanmean(centred**power) / np.nanmean(centred**2) ** (power / 2)
        assert found[name].item() == pytest.approx(expected, rel=1e-11, abs=1e-12)
    if gaps or not periodic:  # a complete periodic surface is differentiated by its modes
        assert found.rms_slope_x.item() == pytest.approx(np.sqrt(np.nanmean(along_x)), rel=1e-12)
        assert found.rms_slope_y.item() == pytest.approx(np.sqrt(np.nanmean(along_y)), rel=1e-12)
        assert found.rms_curvature.item() == pytest.approx(np.sqrt(np.nanmean(laplacian**2)) / 2, rel=1e-12)


@pytest.mark.parametrize("shape", [(70, 90), (3, 45, 50), (37,)])
@pytest.mark.parametrize("gap", [slice(0), slice(3, 9)])
def test_a_dask_array_has_the_statistics_of_one_in_memory(shape, gap):
    pytest.importorskip("dask")
    heights = np.random.default_rng(0).standard_normal(shape).cumsum(-1) * 1e-6 + 5.0
    heights[..., gap] = np.nan
    spacing = 1e-5 if len(shape) == 1 else (1e-5, 2e-5)
    planes = heights.reshape(-1, *shape[-2:]) if len(shape) > 1 else [heights]
    surface = xr.concat([fc.surfaces.from_array(plane, spacing) for plane in planes], "scan")
    whole = fc.surfaces.describe(surface)
    blocks = fc.surfaces.describe(surface.chunk({"x": 30, **({"y": 20} if len(shape) > 1 else {})}))
    for name in set(whole.data_vars) - {"run_time"}:
        np.testing.assert_allclose(blocks[name], whole[name], rtol=1e-9, atol=1e-12, err_msg=name)


def test_infinite_heights_of_a_dask_array_are_refused():
    da = pytest.importorskip("dask.array")
    heights = np.zeros((20, 20))
    heights[3, 4] = np.inf
    lazy = fc.surfaces.from_array(da.from_array(heights, chunks=8), 1e-5)
    with pytest.raises(InvalidInput, match="finite heights, or NaN where missing, got 1 infinite"):
        fc.surfaces.describe(lazy)


@pytest.mark.parametrize("periodic", [(True, False), (False, True)])
def test_a_dask_array_goes_on_across_its_periodic_edge(periodic):
    pytest.importorskip("dask")
    heights = np.random.default_rng(1).standard_normal((7, 96)) * 1e-6
    surface = fc.surfaces.from_array(heights, (1e-5, 2e-5), periodic=periodic)
    whole, blocks = (fc.surfaces.describe(each) for each in (surface, surface.chunk({"x": 30, "y": 3})))
    for name in set(whole.data_vars) - {"run_time"}:
        np.testing.assert_allclose(blocks[name], whole[name], rtol=1e-9, atol=1e-12, err_msg=name)
