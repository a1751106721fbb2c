"""The curves against closed forms and against loops written here."""

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.results import provenance_of
from fractalcontact.base.schema import QUANTITIES

CURVES = (
    "spectrum",
    "variogram",
    "madogram",
    "second_variogram",
    "roughness_length",
    "variation",
    "cube_counts",
    "covering",
)


def surface(heights, spacing=1e-3, periodic=False):
    return fc.surfaces.from_array(np.asarray(heights, float), spacing, periodic=periodic)


@pytest.fixture(scope="module")
def rough():
    return fc.surfaces.fbm((48, 40), (2e-3, 1e-3), hurst=0.6, rms_increment=1e-4, rng=1)


def pairs(heights, spacing, periodic, longest):
    """Distance, squared increment of every pair of points within reach, by loops over lags."""
    ny, nx = heights.shape
    found = {}
    for dy in range(-ny + 1, ny):
        for dx in range(-nx + 1, nx):
            h = np.hypot(dy * spacing[0], dx * spacing[1])
            if not 0 < h <= longest or (dy, dx) < (0, 0):
                continue
            moved = np.roll(heights, (-dy, -dx), axis=(0, 1))
            keep = np.ones(heights.shape, dtype=bool)
            if not periodic:
                keep[max(ny - dy, 0) :], keep[: max(-dy, 0)] = False, False
                keep[:, max(nx - dx, 0) :], keep[:, : max(-dx, 0)] = False, False
            d = (moved - heights)[keep]
            d = d[np.isfinite(d)]
            key = round(h / max(spacing), 9)
            total, number = found.get(key, (0.0, 0))
            found[key] = (total + np.sum(d**2), number + d.size)
    return found


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize("longest", [2.5e-3, None])
def test_variogram_is_the_mean_over_pairs(periodic, longest):
    rng = np.random.default_rng(2)
    heights = rng.standard_normal((20, 17)).cumsum(axis=0)
    heights[rng.random(heights.shape) < 0.1] = np.nan
    spacing = (1e-3, 5e-4)
    curve = fc.dimensions.variogram(surface(heights, spacing, periodic), max_lag=longest)
    assert float(curve.lag.max()) <= (longest or 0.5 * min(20e-3, 8.5e-3)) * (1 + 1e-9)
    direct = pairs(heights, spacing, periodic, min(float(curve.lag.max()), 4e-3) * 1.0001)
    for lag in curve.lag.values[curve.lag.values <= 4e-3]:
        total, number = direct[round(lag / 1e-3, 9)]
        at = curve.sel(lag=lag)
        assert float(at.variogram) == pytest.approx(0.5 * total / number, rel=1e-11)
        assert int(at.pair_count) == number


def test_one_pass_and_transforms_agree(rough):
    whole = fc.dimensions.variogram(rough)
    short = fc.dimensions.variogram(rough, max_lag=6e-3)
    same = whole.sel(lag=short.lag.values, method="nearest", tolerance=1e-9)
    np.testing.assert_allclose(same.variogram, short.variogram, rtol=1e-10)
    np.testing.assert_array_equal(same.pair_count, short.pair_count)


def test_variogram_of_a_plane_wave_and_of_a_plane():
    n, k = 64, 5
    x = np.arange(n) / n
    wave = surface(np.tile(np.cos(2 * np.pi * k * x), (n, 1)), 1.0 / n, periodic=True)
    curve = fc.dimensions.variogram(wave, max_lag=1.0 / n)
    # the lag of one spacing stands for (1, 0) and (0, 1), and along the crests nothing changes
    assert float(curve.variogram[0]) == pytest.approx(0.25 * (1 - np.cos(2 * np.pi * k / n)), rel=1e-12)
    y = np.arange(30)
    plane = fc.dimensions.variogram(surface(np.add.outer(0.2 * y, 0.1 * y), 1.0), max_lag=1.0)
    assert float(plane.variogram[0]) == pytest.approx(0.25 * (0.04 + 0.01), rel=1e-12)
    tilted = fc.dimensions.variogram(surface(np.add.outer(0.0 * y, 0.1 * y), 1.0))
    np.testing.assert_allclose(tilted.local_slope[:3], 2.0, atol=0.35)


def test_mirror_leaves_the_variogram_and_the_spectrum(rough):
    for name in ("variogram", "spectrum"):
        one = getattr(fc.dimensions, name)(rough)
        other = getattr(fc.dimensions, name)(rough.copy(data=rough.values[:, ::-1]))
        value = next(iter(one.data_vars))
        np.testing.assert_allclose(other[value], one[value], rtol=1e-9)


@pytest.mark.parametrize("name", ["madogram", "second_variogram"])
@pytest.mark.parametrize("periodic", [False, True])
def test_increments_along_the_axes(name, periodic):
    rng = np.random.default_rng(3)
    heights = rng.standard_normal((33, 41))
    heights[rng.random(heights.shape) < 0.05] = np.nan
    curve = getattr(fc.dimensions, name)(surface(heights, 1e-3, periodic))
    order = 2 if name == "second_variogram" else 1
    for lag in (1, 2, 3):
        values = []
        for axis in (0, 1):
            d = heights
            for _ in range(order):
                n = d.shape[axis]
                moved = np.roll(d, -lag, axis)
                d = moved - d if periodic else (moved - d).take(range(n - lag), axis)
            values.append(d[np.isfinite(d)])
        values = np.concatenate(values)
        expected = np.mean(values**2) if order == 2 else 0.5 * np.mean(np.abs(values))
        at = curve.sel(lag=lag * 1e-3, method="nearest")
        assert float(at[name]) == pytest.approx(expected, rel=1e-12)
        assert int(at.pair_count) == values.size


@pytest.mark.parametrize("name", ["variogram", "madogram", "second_variogram"])
def test_no_lag_of_a_periodic_profile_is_longer_than_half_its_period(name):
    face = fc.surfaces.spectral(60, 1e-3, hurst=0.6, rms_height=1e-5, rng=3)
    curve = getattr(fc.dimensions, name)(face, max_lag=0.05)
    assert 0.02 < float(curve.lag.max()) <= 0.03 * (1 + 1e-9)


def test_lags_along_the_long_side_of_a_slender_face():
    heights = np.random.default_rng(5).standard_normal((6, 80)).cumsum(axis=1)
    curve = fc.dimensions.variogram(surface(heights), max_lag=0.06)
    assert float(curve.lag.max()) > 0.059
    squares, number = 0.0, 0
    for dy in range(6):
        for dx in range(-79, 80):
            if 0 < np.hypot(dx, dy) <= 60 and (dy > 0 or dx > 0):
                here = heights[dy:, max(dx, 0) : 80 + min(dx, 0)]
                there = heights[: 6 - dy, max(-dx, 0) : 80 - max(dx, 0)]
                squares, number = squares + np.sum((here - there) ** 2), number + here.size
    assert int(curve.pair_count.sum()) == number
    assert float((2 * curve.variogram * curve.pair_count).sum()) == pytest.approx(squares, rel=1e-10)


def test_second_differences_see_no_plane(rough):
    tilted = rough + 0.3 * rough.x - 0.2 * rough.y
    tilted.attrs = rough.attrs
    one, other = fc.dimensions.second_variogram(rough), fc.dimensions.second_variogram(tilted)
    np.testing.assert_allclose(other.second_variogram, one.second_variogram, rtol=1e-8)


def test_spectrum_carries_the_mean_square():
    """Parseval: the sum over all modes is the mean square of the tapered heights."""
    face = fc.surfaces.spectral((64, 48), (2e-3, 1e-3), hurst=0.7, rms_height=1e-5, short_cutoff=6e-3, rng=4)
    curve = fc.dimensions.spectrum(face)
    total = float((curve.power_spectral_density * curve.mode_count).sum()) / (64 * 2e-3 * 48 * 1e-3)
    assert total == pytest.approx(1e-10, rel=1e-12)


@pytest.mark.parametrize(
    ("shape", "spacing"), [((12, 120), (1.0, 1.0)), ((60, 8), (1.0, 3.0)), ((31, 8), (5.0, 1.0))]
)
def test_slender_faces_lose_none_of_their_longest_waves(shape, spacing):
    face = fc.surfaces.spectral(shape, spacing, hurst=0.7, rms_height=1e-3, rng=4)
    curve = fc.dimensions.spectrum(face)
    full = np.hypot(*np.meshgrid(*(np.fft.fftfreq(n, s) for n, s in zip(shape, spacing, strict=True))))
    inside = (full > 0) & (full <= 0.5 / max(spacing) * (1 + 1e-9))
    assert int(curve.mode_count.sum()) == np.count_nonzero(inside)
    assert float(curve.wavenumber[0]) == pytest.approx(2 * np.pi * full[full > 0].min(), rel=1e-9)
    power = np.abs(np.fft.fft2(face.values)).T ** 2 / np.prod(shape) ** 2
    total = float((curve.power_spectral_density * curve.mode_count).sum())
    assert total / np.prod(shape) / np.prod(spacing) == pytest.approx(power[inside].sum(), rel=1e-12)


def test_spectrum_of_one_wave():
    n, k, amplitude = 64, 6, 3e-6
    wave = amplitude * np.cos(2 * np.pi * k * np.arange(n) / n)
    curve = fc.dimensions.spectrum(surface(np.tile(wave, (n, 1)), 1e-3, periodic=True))
    area = (n * 1e-3) ** 2
    total = float((curve.power_spectral_density * curve.mode_count).sum()) / area
    assert total == pytest.approx(0.5 * amplitude**2, rel=1e-12)
    top = int(np.argmax(curve.power_spectral_density.values))
    assert float(curve.wavenumber[top]) == pytest.approx(2 * np.pi * k / (n * 1e-3), rel=0.02)
    assert float(curve.wavelength[top]) == pytest.approx(n * 1e-3 / k, rel=0.02)
    assert float(curve.wavenumber.max()) <= np.pi / 1e-3 * (1 + 1e-9)


def test_spectrum_of_a_profile_and_its_slope():
    face = fc.surfaces.spectral(4096, 1e-3, hurst=0.4, rms_height=1e-5, rng=5)
    curve = fc.dimensions.spectrum(face)
    assert float((curve.profile_power_spectral_density * curve.mode_count).sum()) / 4.096 == pytest.approx(
        1e-10
    )
    assert float(curve.local_slope[200:].median()) == pytest.approx(-1.8, abs=0.2)


def test_free_faces_are_tapered_and_levelled(rough):
    tilted = rough.copy(data=rough.values + 0.5 * np.arange(40) * 1e-3)
    one, other = fc.dimensions.spectrum(rough), fc.dimensions.spectrum(tilted)
    np.testing.assert_allclose(other.power_spectral_density, one.power_spectral_density, rtol=1e-8)
    bare = fc.dimensions.spectrum(rough, window=None)
    assert not np.allclose(bare.power_spectral_density, one.power_spectral_density, rtol=0.1, atol=0)


def test_tiles_average_the_spectra_of_the_parts():
    face = fc.surfaces.fbm((96, 64), 1e-3, hurst=0.5, rms_increment=1e-5, rng=6)
    found = fc.dimensions.spectrum(face, tile=32)
    parts = [
        fc.dimensions.spectrum(face[j : j + 32, i : i + 32]).power_spectral_density
        for j in range(0, 65, 16)
        for i in range(0, 33, 16)
    ]
    np.testing.assert_allclose(found.power_spectral_density, np.mean(parts, axis=0), rtol=1e-10)


def test_roughness_is_the_rms_about_a_plane(rough):
    found = fc.dimensions.roughness_length(rough)
    # windows of 4 spacings of y: 4 x 8 points, overlapping by half
    columns = np.stack([np.ones((4, 8)), *np.indices((4, 8))]).reshape(3, -1).T
    values = []
    for j in range(0, 48 - 3, 2):
        for i in range(0, 40 - 7, 4):
            part = rough.values[j : j + 4, i : i + 8].ravel()
            rest = part - columns @ np.linalg.lstsq(columns, part, rcond=None)[0]
            values.append(np.sqrt(np.mean(rest**2)))
    assert float(found.window_size[0]) == pytest.approx(8e-3)
    assert float(found.roughness[0]) == pytest.approx(np.mean(values), rel=1e-10)
    assert int(found.pair_count[0]) == len(values)


@pytest.mark.parametrize(
    ("shape", "spacing"), [((24, 17), (1e-3, 1e-3)), ((13, 40), (2e-3, 1e-3)), ((1, 50), (1.0, 1e-3))]
)
def test_variation_is_the_mean_range_over_stretches(shape, spacing):
    rng = np.random.default_rng(9)
    heights = rng.standard_normal(shape).cumsum(axis=1)
    heights[rng.random(shape) < 0.05] = np.nan
    profile = shape[0] == 1
    found = fc.dimensions.variation(
        surface(heights[0] if profile else heights, spacing[-1 if profile else slice(None)])
    )
    assert found.window_size.size >= 3
    for size, value, number in zip(found.window_size, found.variation, found.pair_count, strict=True):
        ranges = []
        for lines, step in ((heights, spacing[1]), (heights.T, spacing[0])):
            length = round(float(size) / step)
            for line in lines if len(lines[0]) > 1 else ():
                parts = [line[i : i + length + 1] for i in range(line.size - length)]
                ranges += [np.ptp(part) for part in parts if np.isfinite(part).all()]
        assert int(number) == len(ranges)
        assert float(value) == pytest.approx(np.mean(ranges), rel=1e-12)
    once, pairs_of = (
        fc.dimensions.madogram(surface(heights[0], 1e-3)),
        fc.dimensions.variation(surface(heights[0], 1e-3)),
    )
    assert float(pairs_of.variation[0]) == pytest.approx(2.0 * float(once.madogram[0]), rel=1e-12)


def test_cube_counts_of_flat_faces_are_those_of_a_plane():
    found = fc.dimensions.cube_counts(surface(np.full((33, 33), 7.0), 1.0))
    np.testing.assert_allclose(found.cube_count, (32.0 / found.cube_size) ** 2, rtol=1e-12)
    np.testing.assert_allclose(found.local_slope, -2.0, rtol=1e-12)


def test_cube_counts_against_placed_grids():
    """The mean over positions is the limit of counting cubes of grids at many positions."""
    rng = np.random.default_rng(7)
    heights = rng.standard_normal((13, 13))
    found = fc.dimensions.cube_counts(surface(heights, 1.0), vertical_scale=1.0)
    edge, shifts = 2, np.linspace(0, 2, 400, endpoint=False) + 1e-3
    counts = []
    for j in range(11):
        for i in range(11):
            window = heights[j : j + 3, i : i + 3]
            counts.append(
                [
                    np.floor((window.max() + s) / edge) - np.floor((window.min() + s) / edge) + 1
                    for s in shifts
                ]
            )
    at = float(found.cube_count.sel(cube_size=2.0))
    assert at == pytest.approx(np.mean(counts) * 144 / edge**2, rel=5e-3)


def test_cube_counts_depend_on_the_unit_of_height_and_say_so(rough):
    natural = fc.dimensions.cube_counts(rough, vertical_scale=1.0)
    grown = fc.dimensions.cube_counts(rough, vertical_scale=1000.0)
    assert float(natural.local_slope[-2]) == pytest.approx(-2.0, abs=0.06)
    assert float(grown.local_slope[-2]) < -2.25
    ranged = fc.dimensions.cube_counts(rough)
    span = float(np.ptp(rough.values))
    extent = np.sqrt(47 * 2e-3 * 39 * 1e-3)
    assert float(ranged.vertical_scale) == pytest.approx(extent / span, rel=1e-12)
    np.testing.assert_array_equal(ranged.cube_count, fc.dimensions.cube_counts(rough * 4.0).cube_count)


def test_covering_of_planes_is_exact():
    flat = fc.dimensions.covering(surface(np.full((20, 20), 3.0)))
    assert (flat.covering_area == 400e-6).all()
    assert (flat.local_slope == 0.0).all()
    y = np.arange(20) * 1e-3
    tilted = fc.dimensions.covering(surface(np.add.outer(0.75 * y, y)))
    np.testing.assert_allclose(tilted.covering_area, 400e-6 * np.sqrt(1 + 0.75**2 + 1), rtol=1e-12)


def test_covering_of_a_roof():
    """Ridges one spacing wide: all area at that edge, none at twice the edge."""
    roof = np.tile(np.where(np.arange(33) % 2, 1.0, 0.0), (33, 1))
    found = fc.dimensions.covering(surface(roof, 1.0), vertical_scale=2.0)
    # two triangles carry the slope 2; the apex splits the other two
    expected = 0.5 * np.sqrt(1 + 4) + 0.5 * np.sqrt(1 + 4)
    assert float(found.covering_area[0]) == pytest.approx(33**2 * expected, rel=1e-12)
    assert float(found.covering_area[1]) == pytest.approx(33**2, rel=1e-12)


def test_covering_of_a_profile_is_a_length():
    zigzag = fc.surfaces.from_array(np.where(np.arange(65) % 2, 1.0, 0.0), 1.0)
    found = fc.dimensions.covering(zigzag)
    np.testing.assert_allclose(found.covering_length[:2], [65 * np.sqrt(2.0), 65.0], rtol=1e-12)


@pytest.mark.parametrize("name", CURVES)
def test_units_of_powers_of_two_change_no_bit(rough, name):
    if name == "covering":
        pytest.skip("the area in natural scale depends on the unit of height")
    curve = getattr(fc.dimensions, name)
    one, other = curve(rough), curve(rough * 2.0**-30)
    value = next(iter(one.data_vars))
    power = {"cube_counts": 0, "madogram": 1, "roughness_length": 1, "variation": 1}.get(name, 2)
    np.testing.assert_array_equal(one[value] * 2.0 ** (-30 * power), other[value])
    np.testing.assert_array_equal(one.local_slope.isnull(), other.local_slope.isnull())


@pytest.mark.parametrize("name", CURVES)
def test_stacks_are_stacks_of_single_results(name):
    stack = fc.surfaces.fbm((24, 20), 1e-3, hurst=0.5, rms_increment=1e-5, members=3, rng=8)
    curve = getattr(fc.dimensions, name)
    whole, one = curve(stack), curve(stack.isel(member=1))
    for key in one.data_vars:
        if key != "run_time":
            assert whole[key].dims[: -1 if one[key].ndim else None] == ("member",)
            np.testing.assert_array_equal(whole[key].isel(member=1), one[key])


@pytest.mark.parametrize("name", CURVES)
def test_labels_and_files(rough, name, tmp_path):
    curve = getattr(fc.dimensions, name)(rough)
    for key, variable in curve.variables.items():
        assert variable.attrs["units"] == QUANTITIES[key].units
    assert provenance_of(curve)["periodic_axes"] == "none"
    xr.testing.assert_identical(fc.open(fc.save(curve, tmp_path / "curve.nc")), curve)


def test_a_surface_out_of_memory_gives_the_same_short_lags(rough, monkeypatch):
    pytest.importorskip("dask")
    monkeypatch.setattr("fractalcontact.dimensions._surface_input.SLAB", 400)
    lazy = rough.chunk({"y": 7})
    for name in ("variogram", "madogram", "second_variogram"):
        curve = getattr(fc.dimensions, name)
        one, other = curve(rough, max_lag=8e-3), curve(lazy, max_lag=8e-3)
        np.testing.assert_allclose(other[name], one[name], rtol=1e-12)
        assert (other.pair_count == one.pair_count).all()
    tiles = [fc.dimensions.spectrum(s, tile=16).power_spectral_density for s in (rough, lazy)]
    np.testing.assert_allclose(tiles[1], tiles[0], rtol=1e-9)
    found = [fc.dimensions.estimate(s, "increments").hurst.values for s in (rough, lazy)]
    np.testing.assert_array_equal(*found)


def test_bad_input_is_told_all_at_once(rough):
    with pytest.raises(ValueError, match=r"window.*\n.*tile") as told:
        fc.dimensions.spectrum(rough, window="boxcar", tile=4)
    assert "2 problems" in str(told.value)
    with pytest.raises(ValueError, match=r"surface: expected finite values.*fill"):
        fc.dimensions.spectrum(rough.where(rough > rough.mean()))
    with pytest.raises(ValueError, match="max_lag: expected at least one spacing"):
        fc.dimensions.variogram(rough, max_lag=1e-5)
    with pytest.raises(ValueError, match="uniform spacing"):
        fc.dimensions.variogram(rough.assign_coords(x=rough.x**2))
    with pytest.raises(ValueError, match="vertical_scale"):
        fc.dimensions.covering(rough, vertical_scale=-1.0)
    with pytest.raises(ValueError, match="nothing but NaN"):
        fc.dimensions.madogram(rough * np.nan)
    with pytest.raises(ValueError, match="infinite"):
        fc.dimensions.cube_counts(rough.where(rough.x > 5e-3, np.inf))


@pytest.mark.parametrize("steps", [(1.0, 1.0), (2.0, 1.0)])
@pytest.mark.parametrize("hurst", [0.2, 0.8])
def test_expected_roughness_of_a_window(hurst, steps):
    """The mean square about a plane, over exact surfaces of the size of a window."""
    from fractalcontact.dimensions._roughness_length import expected_roughness

    shape = (5, 8)
    faces = fc.surfaces.fbm(
        shape, steps, hurst=hurst, rms_increment=1.0, lag=1.0, members=4000, rng=40
    ).values
    y, x = np.mgrid[: shape[0], : shape[1]]
    plane = np.linalg.qr(np.stack([np.ones(x.size), x.ravel(), y.ravel()], axis=1))[0]
    flat = faces.reshape(len(faces), -1)
    rest = flat - (flat @ plane) @ plane.T
    found = np.sqrt(np.mean(rest**2))
    assert expected_roughness(np.array([shape]), steps, hurst)[0] == pytest.approx(found, rel=0.015)


@pytest.mark.parametrize("hurst", [0.2, 0.5, 0.8])
def test_roughness_length_knows_how_few_points_a_window_has(hurst):
    faces = fc.surfaces.fbm((96, 96), 1e-4, hurst=hurst, rms_increment=1e-6, members=12, rng=41)
    found = fc.dimensions.estimate(faces, "roughness_length").hurst
    assert float(found.mean()) == pytest.approx(hurst, abs=0.03)


def test_the_values_of_a_spectrum_scatter_as_is_told():
    profiles = fc.surfaces.spectral(
        256, 1e-3, hurst=0.7, rms_height=1e-5, normalise="expectation", members=400, rng=4
    )
    curve = fc.dimensions.spectrum(profiles)
    values = curve.profile_power_spectral_density
    ratio = values.std("member") / values.mean("member") / np.sqrt(2 / curve.mode_count)
    assert float(ratio.mean()) == pytest.approx(1.0, abs=0.03)
    assert "sqrt(2 / mode_count)" in curve.attrs["provenance"]
