"""Arrays and files: orientation, units, gaps, corruption, scale, and what is kept of where they come from."""

import gzip
import json
import sys

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput, MissingExtra, ScaleWarning, UnreadableFile

HEIGHTS = np.arange(12.0).reshape(3, 4) * 1e-6


def provenance(surface):
    return json.loads(surface.attrs["provenance"])


def test_an_array_becomes_a_surface():
    surface = fc.surfaces.from_array(HEIGHTS, (2e-3, 1e-3), periodic=(True, False))
    assert surface.dims == ("y", "x")
    assert surface.dtype == np.float64
    np.testing.assert_array_equal(surface.values, HEIGHTS)
    np.testing.assert_allclose(surface.y.values, [1e-3, 3e-3, 5e-3])
    np.testing.assert_allclose(surface.x.values, [0.5e-3, 1.5e-3, 2.5e-3, 3.5e-3])
    assert surface.y.attrs["period"] == pytest.approx(6e-3)
    assert "period" not in surface.x.attrs
    assert surface.attrs["units"] == surface.x.attrs["units"] == "m"


@pytest.mark.parametrize(
    ("units", "metre"),
    [("m", 1), ("mm", 1e3), ("um", 1e6), ("µm", 1e6), ("μm", 1e6), ("nm", 1e9), ("km", 1e-3)],
)
def test_heights_come_in_metres(units, metre):
    surface = fc.surfaces.from_array([[1.0, 2.0], [3.0, 5.0]], 1.0, units=units)
    np.testing.assert_allclose(surface.values, np.array([[1.0, 2.0], [3.0, 5.0]]) / metre, rtol=1e-15)


def test_missing_values_masks_and_integers():
    masked = np.ma.masked_greater(np.arange(6, dtype=np.int16).reshape(2, 3), 4)
    surface = fc.surfaces.from_array(masked, 1.0)
    assert surface.dtype == np.float64
    assert np.isnan(surface.values[1, 2])
    assert np.isnan(fc.surfaces.from_array([[1.0, np.nan], [0, 1]], 1.0).values[0, 1])


def test_profiles_members_and_labelled_arrays():
    assert fc.surfaces.from_array(np.zeros(5), 1.0).dims == ("x",)
    stack = fc.surfaces.from_array(np.zeros((2, 3, 4)), 1.0)
    assert stack.dims == ("member", "y", "x")
    shear = xr.DataArray(np.zeros((2, 3, 4)), dims=("shear", "y", "x"), coords={"shear": [0.0, 1e-3]})
    surface = fc.surfaces.from_array(shear, 1.0)
    np.testing.assert_array_equal(surface.shear.values, [0.0, 1e-3])
    assert surface.shear.attrs["units"] == "m"
    with pytest.raises(InvalidInput, match="leading dims"):
        fc.surfaces.from_array(shear.rename(shear="weather"), 1.0)


def test_a_dask_array_stays_lazy():
    dask = pytest.importorskip("dask.array")
    surface = fc.surfaces.from_array(dask.zeros((8, 8), chunks=4), 1.0, units="um")
    assert hasattr(surface.data, "dask")


def test_the_input_is_not_changed():
    heights = HEIGHTS.copy()
    surface = fc.surfaces.from_array(heights, 1.0)
    surface.values[0, 0] = 99.0
    np.testing.assert_array_equal(heights, HEIGHTS)


@pytest.mark.parametrize(
    ("heights", "options", "word"),
    [
        (np.full((3, 3), np.inf), {}, "infinite"),
        (np.zeros((3, 3), complex), {}, "real numbers"),
        (np.zeros((3, 3), bool), {}, "real numbers"),
        ("heights", {}, "real numbers"),
        ([[1.0, 2.0], [3.0]], {}, "real numbers"),
        (5.0, {}, "shape"),
        (np.zeros((2, 2, 2, 2)), {}, "shape"),
        (np.zeros((1, 5)), {}, "at least 2"),
        (np.zeros((3, 3)), {"spacing": -1.0}, "spacing"),
        (np.zeros((3, 3)), {"spacing": (1.0, 2.0, 3.0)}, "spacing"),
        (np.zeros((3, 3)), {"units": "furlong"}, "units"),
        (np.zeros((3, 3)), {"periodic": "x"}, "periodic"),
    ],
)
def test_what_is_no_surface_is_refused(heights, options, word):
    with pytest.raises(InvalidInput, match=word):
        fc.surfaces.from_array(heights, **{"spacing": 1.0, **options})


def test_npy_needs_its_spacing(tmp_path):
    np.save(tmp_path / "a.npy", HEIGHTS)
    surface = fc.surfaces.read(tmp_path / "a.npy", spacing=(2e-5, 1e-5))
    np.testing.assert_array_equal(surface.values, HEIGHTS)
    assert provenance(surface)["parameters"]["path"] == "a.npy"
    with pytest.raises(UnreadableFile, match="spacing"):
        fc.surfaces.read(tmp_path / "a.npy")


def test_an_image_is_turned_the_right_way_up(tmp_path):
    np.save(tmp_path / "a.npy", HEIGHTS)
    surface = fc.surfaces.read(tmp_path / "a.npy", spacing=1e-5, first_row="top")
    np.testing.assert_array_equal(surface.values, HEIGHTS[::-1])


@pytest.mark.parametrize("mark", [",", ";", "\t", " "])
@pytest.mark.parametrize("name", ["a.csv", "a.txt", "a.csv.gz"])
def test_tables_of_numbers(tmp_path, mark, name):
    lines = [mark.join(["1.5", "2", "nan", "4e0"]), "# a comment", mark.join(["5", "6", "7", "NaN"])]
    content = "\n".join(lines).encode()
    (tmp_path / name).write_bytes(gzip.compress(content) if name.endswith("gz") else content)
    surface = fc.surfaces.read(tmp_path / name, spacing=1e-6, units="um")
    np.testing.assert_allclose(
        surface.values, np.array([[1.5, 2, np.nan, 4], [5, 6, 7, np.nan]]) * 1e-6, rtol=1e-15
    )


def test_empty_cells_are_missing(tmp_path):
    (tmp_path / "a.csv").write_text("1,,3\n4,5,\n")
    surface = fc.surfaces.read(tmp_path / "a.csv", spacing=1.0)
    np.testing.assert_array_equal(surface.values, [[1, np.nan, 3], [4, 5, np.nan]])


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("1,2,3\n4,abc,6\n7,8,9\n", "line 2, column 2: expected a number, got 'abc'"),
        ("left,right\n1,2\n3,4\n", "line 1, column 1: expected a number, got 'left'"),
        ("# made by hand\n1 2 3\n4 5\n6 7 8\n", "line 3 has 2 values, line 2 has 3"),
        ("1;2,5;3\n4;5;6\n", "line 1, column 2: .* a decimal comma"),
        ("1,2\n3,4 um\n", "line 2, column 2: expected a number, got '4 um'"),
        ("1,2\n3,1_0\n", "line 2, column 2"),
        ("1,2\n3,-\n", "line 2, column 2"),
        ("1,2\n3,inf\n", "1 infinite"),
        ("1,2,3\n", "a grid of heights"),
        ("1\n2\n3\n", "a grid of heights"),
        ("", "no numbers in it"),
        ("# nothing\n", "no numbers in it"),
    ],
)
@pytest.mark.parametrize("units", [None, "um"])
def test_what_is_no_table_is_refused_at_its_cell(tmp_path, text, told, units):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(UnreadableFile, match=told) as caught:
        fc.surfaces.read(tmp_path / "a.csv", spacing=1.0, units=units)
    assert "reader" not in str(caught.value)


def test_missing_marks_quotes_and_marks_at_the_end_of_lines(tmp_path):
    (tmp_path / "a.csv").write_text('"1", NA ,null,\n--,"nan",6,\n')
    surface = fc.surfaces.read(tmp_path / "a.csv", spacing=1.0)
    np.testing.assert_array_equal(surface.values, [[1, np.nan, np.nan], [np.nan, np.nan, 6]])


def test_a_list_of_points_is_not_taken_for_a_grid(tmp_path):
    np.savetxt(tmp_path / "points.csv", np.random.default_rng(0).random((50, 3)), delimiter=",")
    with pytest.raises(UnreadableFile, match="x, y, z"):
        fc.surfaces.read(tmp_path / "points.csv", spacing=1.0)


def test_netcdf_comes_back_as_it_was(tmp_path):
    surface = fc.surfaces.spectral((6, 8), (1e-6, 2e-6), hurst=0.5, rms_height=1e-7, rng=1)
    fc.save(surface, tmp_path / "a.nc")
    again = fc.surfaces.read(tmp_path / "a.nc")
    np.testing.assert_array_equal(again.values, surface.values)
    xr.testing.assert_equal(again.x, surface.x)
    assert again.x.attrs["period"] == surface.x.attrs["period"]
    assert provenance(again)["before"]["call"] == "fractalcontact.surfaces.spectral"


def test_foreign_netcdf_is_turned_and_converted(tmp_path):
    heights = xr.DataArray(
        HEIGHTS.T * 1e6,
        dims=("x", "y"),
        coords={
            "x": ("x", [0.0, 1.0, 2.0, 3.0], {"units": "mm"}),
            "y": ("y", [4.0, 2.0, 0.0], {"units": "mm"}),
            "time": 3.0,
        },
        attrs={"units": "um"},
        name="z",
    )
    heights.to_dataset().to_netcdf(tmp_path / "a.nc")
    surface = fc.surfaces.read(tmp_path / "a.nc")
    assert surface.name == "height"
    np.testing.assert_allclose(surface.values, HEIGHTS[::-1], rtol=1e-15)
    np.testing.assert_allclose(surface.y.values, [0.0, 2e-3, 4e-3], rtol=1e-15)
    with pytest.warns(ScaleWarning, match="states 'um'"):
        again = fc.surfaces.read(tmp_path / "a.nc", units="mm")
    np.testing.assert_allclose(again.values, 1e3 * surface.values, rtol=1e-15)


def test_netcdf_tree_and_variable_by_name(tmp_path):
    surface = fc.surfaces.from_array(HEIGHTS, 1e-5)
    tree = xr.DataTree.from_dict(
        {"/surfaces": surface.to_dataset(name="height"), "/other": xr.Dataset({"a": 1.0})}
    )
    fc.save(tree, tmp_path / "tree.nc")
    np.testing.assert_array_equal(fc.surfaces.read(tmp_path / "tree.nc").values, HEIGHTS)
    two = xr.Dataset({"upper": surface, "lower": surface - 1e-6})
    two["upper"].attrs["units"] = two["lower"].attrs["units"] = "m"
    two.to_netcdf(tmp_path / "two.nc")
    np.testing.assert_allclose(fc.surfaces.read(tmp_path / "two.nc", channel="lower").values, HEIGHTS - 1e-6)
    with pytest.raises(UnreadableFile, match="'upper', 'lower'"):
        fc.surfaces.read(tmp_path / "two.nc")


def test_netcdf_without_units_or_grid_is_refused(tmp_path):
    plain = xr.DataArray(HEIGHTS, dims=("y", "x"), name="height")
    plain.to_dataset().to_netcdf(tmp_path / "a.nc")
    with pytest.raises(UnreadableFile) as caught:
        fc.surfaces.read(tmp_path / "a.nc")
    assert any("units" in problem for problem in caught.value.problems)
    assert any("height.x" in problem for problem in caught.value.problems)
    surface = fc.surfaces.read(tmp_path / "a.nc", units="m", spacing=1e-5)
    np.testing.assert_array_equal(surface.values, HEIGHTS)


@pytest.mark.parametrize("name", ["a.npy", "a.nc", "a.sur", "a.csv", "a.di.gz"])
def test_damaged_files_are_refused_with_a_reason(tmp_path, name):
    pytest.importorskip("SurfaceTopography")
    (tmp_path / name).write_bytes(b"\x93NUMPY not really a surface" * 3)
    with pytest.raises(UnreadableFile, match=name.split(".")[1]):
        fc.surfaces.read(tmp_path / name, spacing=1.0)


def test_a_file_that_is_not_there(tmp_path):
    with pytest.raises(UnreadableFile) as caught:
        fc.surfaces.read(tmp_path / "nowhere.nc", units="ell", first_row="left")
    assert len(caught.value.problems) >= 3
    assert str(tmp_path) not in str(caught.value)


def test_an_instrument_without_its_reader(tmp_path, monkeypatch):
    (tmp_path / "a.sur").write_bytes(b"DIGITAL SURF")
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    import importlib.util

    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MissingExtra, match=r"fractalcontact\[io\]"):
        fc.surfaces.read(tmp_path / "a.sur")


def test_an_implausible_scale_is_warned_of(tmp_path):
    np.save(tmp_path / "a.npy", HEIGHTS * 1e6)
    with pytest.warns(ScaleWarning, match="ratio"):
        fc.surfaces.read(tmp_path / "a.npy", spacing=1e-6)
    np.save(tmp_path / "flat.npy", np.zeros((3, 4)))
    fc.surfaces.read(tmp_path / "flat.npy", spacing=1e-6)


INSTRUMENTS = {
    # name: (shape, extent y and x in metres, missing points)
    "al3d-1.al3d": ((296, 200), (129.655992e-6, 87.6054e-6), 0),
    "di-3.di": ((256, 256), (1e-5, 1e-5), 0),
    "sur-3.sur": ((512, 512), (0.151319552, 0.151319552), 233009),
    "tmd-1.tmd": ((300, 300), (18.9566e-3, 18.9566e-3), 0),
}


@pytest.mark.parametrize("name", INSTRUMENTS)
def test_instrument_files(measured, name):
    pytest.importorskip("SurfaceTopography")
    shape, extent, missing = INSTRUMENTS[name]
    surface = fc.surfaces.read(measured / "instruments" / name)
    assert surface.shape == shape
    for dim, n, length in zip(("y", "x"), shape, extent, strict=True):
        axis = surface[dim].values
        assert n * (axis[-1] - axis[0]) / (n - 1) == pytest.approx(length, rel=1e-6)
        assert axis[0] == pytest.approx(length / n / 2, rel=1e-6)
    assert int(surface.isnull().sum()) == missing
    assert surface.attrs["units"] == "m"
    assert provenance(surface)["reader"].startswith("SurfaceTopography")
    assert provenance(surface)["parameters"]["path"] == name


def test_orientation_of_a_microscope_scan(measured):
    pytest.importorskip("SurfaceTopography")
    surface = fc.surfaces.read(measured / "instruments" / "di-3.di")
    known = fc.surfaces.read(measured / "afm_10um_di3.npy", spacing=3.90625e-8)
    np.testing.assert_allclose(surface.values, known.values, rtol=1e-15)
    assert np.abs(surface.values - known.values.T).max() > 1e-8


def test_an_instrument_file_is_flipped_on_request_alone(tmp_path):
    pytest.importorskip("SurfaceTopography")
    text = "# Channel: Height\n# Width: 4 um\n# Height: 3 um\n# Value units: nm\n"
    (tmp_path / "a.asc").write_text(text + "1 2 3 4\n5 6 7 8\n9 10 11 13\n")
    plain, flipped = (fc.surfaces.read(tmp_path / "a.asc", first_row=row) for row in ("bottom", "top"))
    assert plain.shape == (3, 4)
    np.testing.assert_array_equal(flipped.values, plain.values[::-1])
    np.testing.assert_array_equal(flipped.y, plain.y)
    assert provenance(flipped)["parameters"]["first_row"] == "top"


def test_netcdf_is_never_flipped_for_it_has_its_y(tmp_path):
    fc.save(fc.surfaces.from_array(HEIGHTS, 1e-5), tmp_path / "a.nc")
    with pytest.raises(UnreadableFile, match="first_row: .*NetCDF"):
        fc.surfaces.read(tmp_path / "a.nc", first_row="top")


def test_channels_of_a_microscope_scan(measured):
    pytest.importorskip("SurfaceTopography")
    path = measured / "instruments" / "di-3.di"
    by_name, by_number = fc.surfaces.read(path, channel="Height"), fc.surfaces.read(path, channel=3)
    np.testing.assert_array_equal(by_name.values, by_number.values)
    assert np.abs(by_name.values - fc.surfaces.read(path).values).max() > 0
    with pytest.raises(UnreadableFile, match=r"'ZSensor'.*'Phase'"):
        fc.surfaces.read(path, channel="Colour")
    with pytest.raises(UnreadableFile, match="unit"):
        fc.surfaces.read(path, channel="Phase")


def test_a_unit_against_that_of_the_file_is_warned_of(measured):
    pytest.importorskip("SurfaceTopography")
    with pytest.warns(ScaleWarning, match="states 'mm'"):
        surface = fc.surfaces.read(measured / "instruments" / "tmd-1.tmd", units="um")
    assert float(surface.max()) == pytest.approx(0.3509870171546936e-6)


def test_phases_need_a_unit(measured):
    pytest.importorskip("SurfaceTopography")
    path = measured / "instruments" / "matrix-4.txt.gz"
    with pytest.raises(UnreadableFile, match="rad"):
        fc.surfaces.read(path)
    surface = fc.surfaces.read(path, units="m")
    assert surface.shape == (305, 75)
    first = np.array(gzip.decompress(path.read_bytes()).decode().splitlines()[4].split(), dtype=float)
    np.testing.assert_allclose(surface.values[0], first * 2.91818e-8, rtol=1e-12)


def test_a_corrupt_file_is_refused_in_one_line(measured):
    pytest.importorskip("SurfaceTopography")
    with pytest.raises(UnreadableFile, match="corrupt") as caught:
        fc.surfaces.read(measured / "instruments" / "di_corrupted.di")
    assert "not large enough" in str(caught.value)
    assert len(str(caught.value)) < 300


def test_a_microscope_field_of_160_m_is_warned_of_and_mended_by_spacing(measured):
    pytest.importorskip("SurfaceTopography")
    path = measured / "instruments" / "nms-1.nms"
    with pytest.warns(ScaleWarning, match="160 m wide.*ratio"):
        wide = fc.surfaces.read(path)
    assert wide.shape == (512, 512)
    mended = fc.surfaces.read(path, spacing=160e-6 / 512)
    assert float(mended.x[-1]) < 160e-6
    assert float(mended.max() - mended.min()) == pytest.approx(3.318e-6, rel=1e-3)


@pytest.mark.parametrize("side", ["a", "b"])
def test_measured_crack_faces(measured, side):
    surface = fc.surfaces.read(measured / f"freiberg_gneiss_side_{side}.npy", spacing=3e-4)
    assert int(surface.isnull().sum()) == {"a": 9, "b": 18}[side]
    wanted = json.loads((measured / f"freiberg_gneiss_side_{side}.json").read_text())["check"]["rms_plane"]
    assert float(fc.surfaces.level(surface).std()) == pytest.approx(wanted, rel=0.01)
    assert int(fc.surfaces.fill(surface).filled_points) == {"a": 9, "b": 18}[side]
