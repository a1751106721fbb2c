"""Files: formats, orientation, units, gaps, corruption, scale, and provenance."""

import gzip
import io
import json
import re
import struct
import sys
import warnings

import numpy as np
import pytest
import scipy.io
import xarray as xr

import fractalcontact as fc
from fractalcontact.base import resources
from fractalcontact.base.errors import MissingExtra, ScaleWarning, UnreadableFile

HEIGHTS = np.arange(12.0).reshape(3, 4) * 1e-6


def provenance(surface):
    return json.loads(surface.attrs["provenance"])


def test_npy_needs_its_spacing(tmp_path):
    np.save(tmp_path / "a.npy", HEIGHTS)
    surface = fc.surfaces.read(tmp_path / "a.npy", spacing=(2e-5, 1e-5))
    np.testing.assert_array_equal(surface.values, HEIGHTS)
    assert provenance(surface)["parameters"]["path"] == "a.npy"
    with pytest.raises(UnreadableFile, match="spacing"):
        fc.surfaces.read(tmp_path / "a.npy")


def test_image_is_flipped(tmp_path):
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


@pytest.mark.parametrize("name", ["scan.csv", "scan.xyz", "scan.opd"])
def test_an_empty_file_is_called_empty(tmp_path, name):
    (tmp_path / name).write_bytes(b"")
    with pytest.raises(UnreadableFile, match=f"empty file '{name}'"):
        fc.surfaces.read(tmp_path / name, units="mm")


def test_empty_cells_are_missing(tmp_path):
    (tmp_path / "a.csv").write_text("1,,3\n4,5,\n")
    surface = fc.surfaces.read(tmp_path / "a.csv", spacing=1.0)
    np.testing.assert_array_equal(surface.values, [[1, np.nan, 3], [4, 5, np.nan]])


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("1,2,3\n4,abc,6\n7,8,9\n", "line 2, column 2: expected a number, got 'abc'"),
        ("left,right\n1,2\n3,4\n", "line 1, column 1: expected a number, got 'left'"),
        ("# made by hand\n1 2 3\n4 5\n6 7 8\n", "line 3 has 2 values, line 2 has 3"),
        ("1;2,5,1;3\n4;5;6\n", "line 1, column 2: .* a decimal comma"),
        ("1,2\n3,4 um\n", "line 2, column 2: expected a number, got '4 um'"),
        ("1,2\n3,1_0\n", "line 2, column 2"),
        ("1,2\n3,-\n", "line 2, column 2"),
        ("1,2\n3,inf\n", "1 infinite"),
        ("1,2,3\n", "a grid of heights"),
        ("1\n2\n3\n", "a grid of heights"),
        ("", "got the empty file"),
        ("# nothing\n", "no numbers in it"),
    ],
)
@pytest.mark.parametrize("units", [None, "um"])
def test_invalid_table_names_its_cell(tmp_path, text, problem, units):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(UnreadableFile, match=problem) as caught:
        fc.surfaces.read(tmp_path / "a.csv", spacing=1.0, units=units)
    assert "reader" not in str(caught.value)


@pytest.mark.parametrize("spacing", [1e-5, None])
@pytest.mark.parametrize("header", ["", "# made by hand\n", "height map\nmade by hand\n"])
def test_one_wrong_row_is_found_quickly(tmp_path, monkeypatch, header, spacing):
    """The reader of lists of points tries 600 times to skip rows: 40 s for 512 x 512 points."""
    xyz = pytest.importorskip("SurfaceTopography.IO.XYZ")
    tried = []
    monkeypatch.setattr(xyz.XYZReader, "_read", lambda reader: tried.append(reader))
    rows = [",".join(["0.5"] * 20) for _ in range(600)]
    rows[400] = rows[400].replace("0.5", "O.5", 1)
    (tmp_path / "a.csv").write_text(header + "\n".join(rows))
    with pytest.raises(UnreadableFile) as caught:
        fc.surfaces.read(tmp_path / "a.csv", spacing=spacing)
    assert tried == []
    if not header.startswith("height"):
        assert "column 1: expected a number, got 'O.5'" in str(caught.value)


def test_text_in_another_encoding_is_called_no_table(tmp_path):
    """Spreadsheets write the micro sign as one byte, and no reader of instruments knows such a file."""
    pytest.importorskip("SurfaceTopography")
    (tmp_path / "a.csv").write_bytes("x [µm];y [µm];z [µm]\n0;0;1\n1;0;2\n0;1;3\n1;1;4\n".encode("latin-1"))
    with pytest.raises(UnreadableFile, match=r"not a table of numbers \(it is not text: byte 3 is not UTF-8"):
        fc.surfaces.read(tmp_path / "a.csv")


def packed(path):
    """Write three million zeros in few bytes, in the format of the name."""
    zeros = np.zeros((1500, 2000))
    if path.suffix == ".gz":
        content = io.BytesIO()
        np.save(content, zeros)
        path.write_bytes(gzip.compress(content.getvalue()))
    elif path.suffix == ".npz":
        np.savez_compressed(path, height=zeros)
    elif path.suffix == ".mat":
        scipy.io.savemat(path, {"height": zeros}, do_compression=True)
    elif path.suffix == ".h5":
        with pytest.importorskip("h5py").File(path, "w") as file:
            file.create_dataset("height", zeros.shape, "f8", chunks=(100, 100), compression="gzip")
    else:
        surface = fc.surfaces.from_array(zeros, 1e-5)
        surface.encoding = {"zlib": True, "complevel": 9}
        fc.save(surface, path)
    assert path.stat().st_size < 100_000
    return path


@pytest.mark.parametrize("name", ["a.npy.gz", "a.npz", "a.mat", "a.h5", "a.nc"])
def test_file_that_fills_the_memory_is_refused(tmp_path, monkeypatch, name):
    """7.8 MB unpacked to 5.6 GB; here the limit is a megabyte, and the file unpacks to 23."""
    path = packed(tmp_path / name)
    if name == "a.npy.gz":
        assert fc.surfaces.read(path, spacing=1e-5).shape == (1500, 2000)
    monkeypatch.setattr(resources, "SMALL_FILE", 1 << 20)
    with pytest.raises(UnreadableFile, match=r"expected at most \d+ MiB when unpacked") as caught:
        fc.surfaces.read(path, spacing=1e-5)
    assert str(caught.value).count("problem") == 1
    if name == "a.nc":
        with pytest.raises(UnreadableFile, match=r"expected at most \d+ MiB when unpacked"):
            fc.open(path)


def test_missing_marks_quotes_and_trailing_separators(tmp_path):
    (tmp_path / "a.csv").write_text('"1", NA ,null,\n--,"nan",6,\n')
    surface = fc.surfaces.read(tmp_path / "a.csv", spacing=1.0)
    np.testing.assert_array_equal(surface.values, [[1, np.nan, np.nan], [np.nan, np.nan, 6]])


@pytest.mark.parametrize(("mark", "text"), [(";", "1,5;2,5\n3;4,25\n"), (" ", "1,5 2,5\n3 4,25\n")])
def test_decimal_commas(tmp_path, mark, text):
    (tmp_path / "a.csv").write_text(text)
    surface = fc.surfaces.read(tmp_path / "a.csv", spacing=1.0)
    np.testing.assert_array_equal(surface.values, [[1.5, 2.5], [3.0, 4.25]])


@pytest.mark.parametrize("columns", [2, 3])
@pytest.mark.parametrize("suffix", ["csv", "npy", "dat.gz"])
def test_list_of_points_is_never_a_grid(tmp_path, columns, suffix):
    """Two or three columns are points, with `spacing` or without, in text and in arrays."""
    points = np.random.default_rng(0).random((500, columns)) * (
        [1.0, 0.1] if columns == 2 else [1.0, 1.0, 0.1]
    )
    path = tmp_path / f"points.{suffix}"
    if suffix == "npy":
        np.save(path, points)
    else:
        np.savetxt(path, points, delimiter=",")  # also packs
    for spacing in (None, 0.05):
        surface = fc.surfaces.read(path, spacing=spacing, plane=None if suffix == "npy" else "xy")
        assert surface.ndim == columns - 1
        assert max(surface.shape) < (100 if columns == 3 else 700)
        assert float(surface.finest_scale) > 0


def test_wide_table_that_may_be_points_is_refused(tmp_path):
    rows = np.random.default_rng(0).random((400, 6))
    np.savetxt(tmp_path / "cloud.txt", rows)
    with pytest.raises(UnreadableFile, match="columns"):
        fc.surfaces.read(tmp_path / "cloud.txt", spacing=1.0)
    surface = fc.surfaces.read(tmp_path / "cloud.txt", spacing=0.1, columns=[0, 1, 2], plane="xy")
    assert surface.shape == (10, 10)


def test_netcdf_round_trip(tmp_path):
    surface = fc.surfaces.spectral((6, 8), (1e-6, 2e-6), hurst=0.5, rms_height=1e-7, rng=1)
    fc.save(surface, tmp_path / "a.nc")
    again = fc.surfaces.read(tmp_path / "a.nc")
    np.testing.assert_array_equal(again.values, surface.values)
    xr.testing.assert_equal(again.x, surface.x)
    assert again.x.attrs["period"] == surface.x.attrs["period"]
    assert provenance(again)["before"]["call"] == "fractalcontact.surfaces.spectral"


def test_other_netcdf_is_transposed_and_converted(tmp_path):
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


def test_spacing_of_a_netcdf_file_leaves_its_periodic_axes(tmp_path):
    fc.save(fc.surfaces.from_array(HEIGHTS, 1e-5, periodic=True), tmp_path / "a.nc")
    surface = fc.surfaces.read(tmp_path / "a.nc", spacing=(2e-5, 3e-5))
    assert surface.y.attrs["period"] == pytest.approx(6e-5)
    assert surface.x.attrs["period"] == pytest.approx(12e-5)
    fc.save(fc.surfaces.from_array(HEIGHTS, 1e-5), tmp_path / "free.nc")
    assert "period" not in fc.surfaces.read(tmp_path / "free.nc", spacing=2e-5).x.attrs


@pytest.mark.parametrize("name", ["a.npy", "a.nc", "a.sur", "a.csv", "a.di.gz"])
def test_damaged_files_are_refused(tmp_path, name):
    pytest.importorskip("SurfaceTopography")
    (tmp_path / name).write_bytes(b"\x93NUMPY not really a surface" * 3)
    with pytest.raises(UnreadableFile, match=name.split(".")[1]):
        fc.surfaces.read(tmp_path / name, spacing=1.0)


def test_missing_file(tmp_path):
    with pytest.raises(UnreadableFile) as caught:
        fc.surfaces.read(tmp_path / "nowhere.nc", units="ell", first_row="left")
    assert len(caught.value.problems) >= 3
    assert str(tmp_path) not in str(caught.value)


def test_instrument_file_without_its_reader(tmp_path, monkeypatch):
    (tmp_path / "a.sur").write_bytes(b"DIGITAL SURF")
    monkeypatch.setitem(sys.modules, "SurfaceTopography", None)
    import importlib.util

    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MissingExtra, match=r"fractalcontact\[io\]"):
        fc.surfaces.read(tmp_path / "a.sur")


def test_implausible_scale_warns(tmp_path):
    np.save(tmp_path / "a.npy", HEIGHTS * 1e6)
    with pytest.warns(ScaleWarning, match="ratio"):
        fc.surfaces.read(tmp_path / "a.npy", spacing=1e-6)
    np.save(tmp_path / "flat.npy", np.zeros((3, 4)))
    fc.surfaces.read(tmp_path / "flat.npy", spacing=1e-6)


@pytest.mark.parametrize("missing", [-9999, 9999, 0])
@pytest.mark.parametrize("form", ["csv", "xyz"])
def test_number_for_missing_heights_is_named(tmp_path, missing, form):
    """Any number that several cells hold far from all other heights; in the unit of the file."""
    heights = 50.0 + 0.1 * np.random.default_rng(1).random((20, 30))
    heights[3:7, 5:9] = missing
    y, x = np.indices(heights.shape)
    table = heights if form == "csv" else np.stack([x.ravel(), y.ravel(), heights.ravel()], axis=1)
    np.savetxt(tmp_path / f"scan.{form}", table, delimiter=",")
    spacing = {"spacing": 1e-3} if form == "csv" else {}
    with warnings.catch_warnings(record=True) as caught:  # the range of the heights warns as well
        warnings.simplefilter("always")
        fc.surfaces.read(tmp_path / f"scan.{form}", units="mm", **spacing)
    words = " ".join(str(each.message) for each in caught)
    assert re.search(f"16 (cells|points) hold {missing}, far from .*missing heights.*write nan", words)


def test_clipped_heights_steps_and_spikes_are_not_missing(tmp_path):
    rough = np.random.default_rng(1).normal(size=(40, 40))
    spiked = rough.copy()
    spiked[5, 5] = -999.0
    steps = np.where(np.arange(40) < 20, 0.0, 100.0) * np.ones((40, 1))
    for name, heights in (("clipped", np.clip(rough, -1, 1)), ("spiked", spiked), ("steps", steps)):
        np.save(tmp_path / f"{name}.npy", heights)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            fc.surfaces.read(tmp_path / f"{name}.npy", spacing=1e-3, units="um")
        assert "missing heights" not in str([str(each.message) for each in caught])


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
    image = np.load(measured / "afm_10um_di3.npy")  # the first row is the top
    np.testing.assert_allclose(surface.values, image[::-1], rtol=1e-15)
    reference = fc.surfaces.read(measured / "afm_10um_di3.npy", spacing=3.90625e-8, first_row="top")
    np.testing.assert_allclose(surface.values, reference.values, rtol=1e-15)


TEXT = "# Channel: Height\n# Width: 4 um\n# Height: 3 um\n# Value units: nm\n"


def test_first_row_of_an_instrument_file_is_the_top(tmp_path):
    pytest.importorskip("SurfaceTopography")
    (tmp_path / "a.asc").write_text(TEXT + "1 2 3 4\n5 6 7 8\n9 10 11 13\n")
    default, bottom, top = (
        fc.surfaces.read(tmp_path / "a.asc", first_row=row) for row in (None, "bottom", "top")
    )
    assert default.sel(y=default.y.max()).values == pytest.approx([1e-9, 2e-9, 3e-9, 4e-9])
    np.testing.assert_array_equal(default.values, top.values)
    np.testing.assert_array_equal(bottom.values, top.values[::-1])
    np.testing.assert_array_equal(bottom.y, top.y)
    spaced = fc.surfaces.read(tmp_path / "a.asc", spacing=2e-6)  # replaces the spacing alone
    np.testing.assert_array_equal(spaced.values, default.values)
    assert float(spaced.x[1] - spaced.x[0]) == pytest.approx(2e-6)
    assert provenance(top)["parameters"]["first_row"] == "top"
    assert (provenance(default)["first_row"], provenance(bottom)["first_row"]) == ("top", "bottom")


@pytest.mark.parametrize(("suffix", "row_of_largest_y"), [("gwy", [5.0, 1.0, 1.0]), ("x3p", [2.0, 2.0, 3.0])])
def test_first_row_by_format(tmp_path, suffix, row_of_largest_y):
    """Gwyddion has the top of the map first; rows of X3P (ISO 25178-72) ascend with y."""
    topography = pytest.importorskip("SurfaceTopography").Topography
    rows = np.array([[5.0, 1.0, 1.0], [2.0, 2.0, 3.0]])
    heights = topography(np.ascontiguousarray(1e-7 * rows.T), (3e-6, 2e-6), unit="m", info={})
    getattr(heights, f"to_{suffix}")(str(tmp_path / f"a.{suffix}"))
    surface = fc.surfaces.read(tmp_path / f"a.{suffix}", units="m")
    assert 1e7 * surface[-1].values == pytest.approx(row_of_largest_y)
    assert surface.y[-1] > surface.y[0]


MARKED = np.array([[5.0, 1.0, 1.0], [2.0, 2.0, 3.0]])  # um, the first row first in the file


def _sdf():
    head = {"ManufacID": "x", "CreateDate": "010120200000", "ModDate": "010120200000", "NumPoints": 3}
    head |= {"NumProfiles": 2, "Xscale": 1e-6, "Yscale": 1e-6, "Zscale": 1e-6, "Zresolution": -1}
    head |= {"Compression": 0, "DataType": 7, "CheckType": 0}
    lines = ["aISO-1.0", *(f"{key} = {value}" for key, value in head.items()), "*"]
    return "\n".join([*lines, *(" ".join(map(str, row)) for row in MARKED), "*", ""]).encode()


def _bcr():
    head = {"fileformat": "bcrf", "xpixels": 3, "ypixels": 2, "xlength": 3, "ylength": 2, "intelmode": 1}
    head |= {"xunit": "um", "yunit": "um", "zunit": "um"}
    text = "".join(f"{key} = {value}\n" for key, value in head.items())
    return text.ljust(2048).encode() + MARKED.astype("<f4").tobytes()


def _os3d():
    texts = b"".join(struct.pack("<i", len(text)) + text for text in (b"marked", b"20200101120000"))
    head = struct.pack("<iidddd", 3, 2, 1.0, 1.0, 0.0, 0.0)
    return b"OmniSurf3D" + struct.pack("<ii", 1, 1) + texts + head + MARKED.astype("<f4").tobytes() + b"\0"


@pytest.mark.parametrize("made", [_sdf, _bcr, _os3d])
def test_first_row_of_written_files_is_the_top(tmp_path, made):
    pytest.importorskip("SurfaceTopography")
    path = tmp_path / f"a.{made.__name__[1:]}"
    path.write_bytes(made())
    surface = fc.surfaces.read(path)
    assert 1e6 * surface[-1].values == pytest.approx(MARKED[0], rel=1e-6)
    assert 1e6 * surface[0].values == pytest.approx(MARKED[1], rel=1e-6)
    assert [float(surface[axis][1] - surface[axis][0]) for axis in "yx"] == pytest.approx([1e-6, 1e-6])


def test_azimuth_of_grooves_in_an_instrument_file(tmp_path):
    pytest.importorskip("SurfaceTopography")
    y, x = np.indices((48, 48))
    up = (47 - y) * np.sin(np.radians(30)) + x * np.cos(np.radians(30))  # as the image shows it
    across = up * 2 * np.pi / 6 + 0.05 * np.random.default_rng(1).standard_normal((48, 48))
    rows = "\n".join(" ".join(f"{v:.6f}" for v in row) for row in 9 * np.cos(across))
    (tmp_path / "a.asc").write_text(TEXT.replace("4 um", "48 um").replace("3 um", "48 um") + rows)
    surface = fc.surfaces.read(tmp_path / "a.asc")
    power = np.abs(np.fft.rfft2(surface.values - surface.values.mean())) ** 2
    row, column = np.unravel_index(power.argmax(), power.shape)
    azimuth = np.degrees(np.arctan2(np.fft.fftfreq(48)[row], np.fft.rfftfreq(48)[column]))
    assert azimuth == pytest.approx(30, abs=4)  # of the waves; -30 if the map were upside down


def test_rows_of_points_and_arrays_are_not_flipped(tmp_path):
    pytest.importorskip("SurfaceTopography")
    points = [f"{x} {y} {10 * y + x}" for y in range(4) for x in range(5)]
    (tmp_path / "a.xyz").write_text("\n".join(points))
    surface = fc.surfaces.read(tmp_path / "a.xyz", units="um", spacing=1e-6)
    np.testing.assert_allclose(surface.values[0], np.arange(5) * 1e-6)
    np.save(tmp_path / "a.npy", HEIGHTS)
    np.testing.assert_array_equal(fc.surfaces.read(tmp_path / "a.npy", spacing=1e-6).values, HEIGHTS)


def test_options_without_effect_are_refused(tmp_path):
    """A map that its user takes for flipped would be the mirror image of what was asked for."""
    (tmp_path / "a.xyz").write_text("\n".join(f"{k % 5} {k // 5} {k}" for k in range(20)))
    np.savetxt(tmp_path / "a.csv", HEIGHTS)
    np.save(tmp_path / "a.npy", HEIGHTS)
    np.savez(tmp_path / "a.npz", height=HEIGHTS, x=np.arange(4.0), y=np.arange(3.0))
    for name, option, spacing in [
        ("a.xyz", {"channel": 1}, None),
        ("a.xyz", {"first_row": "top"}, None),
        ("a.csv", {"channel": 1}, 1.0),
        ("a.npy", {"channel": "height"}, 1.0),
        ("a.npz", {"first_row": "top"}, None),
    ]:
        with pytest.raises(UnreadableFile, match=f"{next(iter(option))}: expected"):
            fc.surfaces.read(tmp_path / name, units="um", spacing=spacing, **option)


def test_netcdf_is_never_flipped(tmp_path):
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


def test_unit_other_than_that_of_the_file_warns(measured):
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
    np.testing.assert_allclose(surface.values[-1], first * 2.91818e-8, rtol=1e-12)


def test_corrupt_file_has_a_short_message(measured):
    pytest.importorskip("SurfaceTopography")
    with pytest.raises(UnreadableFile, match="corrupt") as caught:
        fc.surfaces.read(measured / "instruments" / "di_corrupted.di")
    assert "not large enough" in str(caught.value)
    assert len(str(caught.value)) < 300


def test_microscope_field_of_160_m_warns_and_spacing_corrects_it(measured):
    pytest.importorskip("SurfaceTopography")
    path = measured / "instruments" / "nms-1.nms"
    with pytest.warns(ScaleWarning, match="160 m wide.*ratio"):
        wide = fc.surfaces.read(path)
    assert wide.shape == (512, 512)
    corrected = fc.surfaces.read(path, spacing=160e-6 / 512)
    assert float(corrected.x[-1]) < 160e-6
    assert float(corrected.max() - corrected.min()) == pytest.approx(3.318e-6, rel=1e-3)


@pytest.mark.parametrize("side", ["a", "b"])
def test_measured_crack_faces(measured, side):
    surface = fc.surfaces.read(measured / f"freiberg_gneiss_side_{side}.npy", spacing=3e-4)
    assert int(surface.isnull().sum()) == {"a": 9, "b": 18}[side]
    expected = json.loads((measured / f"freiberg_gneiss_side_{side}.json").read_text())["check"]["rms_plane"]
    assert float(fc.surfaces.level(surface).std()) == pytest.approx(expected, rel=0.01)
    assert int(fc.surfaces.fill(surface).filled_points) == {"a": 9, "b": 18}[side]


def test_spacing_of_a_profile_is_one_length(tmp_path):
    profile = fc.surfaces.from_array(HEIGHTS[0], 1e-5)
    fc.save(profile, tmp_path / "profile.nc")
    with pytest.raises(UnreadableFile, match="spacing: expected one length"):
        fc.surfaces.read(tmp_path / "profile.nc", spacing=(1e-5, 1e-5))


def test_netcdf_with_a_provenance_of_another_origin(tmp_path):
    surface = fc.surfaces.from_array(HEIGHTS, 1e-5)
    surface.attrs["provenance"] = "scanned by hand"
    surface.to_netcdf(tmp_path / "a.nc")
    np.testing.assert_array_equal(fc.surfaces.read(tmp_path / "a.nc").values, HEIGHTS)


MAP = 1e-3 * np.random.default_rng(8).normal(size=(12, 20))


def test_npz_is_read_like_npy(tmp_path):
    """The same array in either file gives the same surface."""
    np.save(tmp_path / "a.npy", MAP)
    np.savez(tmp_path / "a.npz", MAP)
    one, other = (
        fc.surfaces.read(tmp_path / f"a{end}", spacing=1e-4, units="mm") for end in (".npy", ".npz")
    )
    np.testing.assert_array_equal(one, other)
    np.testing.assert_array_equal(one, MAP / 1e3)
    top = fc.surfaces.read(tmp_path / "a.npz", spacing=1e-4, first_row="top")
    np.testing.assert_array_equal(top, MAP[::-1])


@pytest.mark.parametrize("end", ["", ".gz"])
@pytest.mark.parametrize(("name", "other"), [("npz", "npy"), ("npy", "npz")])
def test_numpy_file_under_the_name_of_the_other_format_is_refused(tmp_path, name, other, end):
    content = io.BytesIO()
    (np.save if other == "npy" else np.savez)(content, MAP)
    path = tmp_path / f"a.{name}{end}"
    path.write_bytes(gzip.compress(content.getvalue()) if end else content.getvalue())
    message = f"'{path.name}' is corrupt (expected an {name} file, got an {other} file)"
    with pytest.raises(UnreadableFile, match=re.escape(message)):
        fc.surfaces.read(path, spacing=1e-4)


@pytest.mark.parametrize("sign", [1, -1])
def test_coordinates_of_an_npz(tmp_path, sign):
    """Coordinates x and y give the spacing, in the unit of the heights; descending ones are turned round."""
    y, x = np.arange(12)[::sign] * 0.2, np.arange(20) * 0.1
    np.savez(tmp_path / "a.npz", x=x, y=y, z=MAP, mask=MAP > 0)
    surface = fc.surfaces.read(tmp_path / "a.npz", units="mm")
    np.testing.assert_allclose(np.diff(surface.x), 1e-4)
    np.testing.assert_allclose(np.diff(surface.y), 2e-4)
    np.testing.assert_array_equal(surface, MAP[::sign] / 1e3)


@pytest.mark.parametrize(
    ("arrays", "options", "problem"),
    [
        ({"z": MAP}, {}, "spacing"),
        ({"a": MAP, "b": MAP}, {"spacing": 1e-4}, "one of 'a', 'b'"),
        ({"a": MAP > 0}, {"spacing": 1e-4}, "an array of heights"),
        ({"z": MAP, "y": np.arange(12.0), "x": np.arange(20.0) ** 2}, {}, "x: expected evenly"),
    ],
)
def test_npz_that_cannot_be_a_surface(tmp_path, arrays, options, problem):
    np.savez(tmp_path / "a.npz", **arrays)
    with pytest.raises(UnreadableFile, match=problem):
        fc.surfaces.read(tmp_path / "a.npz", **options)


@pytest.mark.parametrize("shape", [(8, 3), (3, 8), (6, 2)])
def test_narrow_map_of_an_npz_is_no_list_of_points(tmp_path, shape):
    heights = 1e-4 * np.random.default_rng(1).random(shape)
    y, x = (np.arange(n) * step for n, step in zip(shape, (2e-3, 1e-3), strict=True))
    np.savez(tmp_path / "a.npz", height=heights, x=x, y=y)
    surface = fc.surfaces.read(tmp_path / "a.npz")
    np.testing.assert_array_equal(surface, heights)
    assert float(surface.y[1] - surface.y[0]) == pytest.approx(2e-3)
    np.savez(tmp_path / "a.npz", height=heights.T, x=x, y=y)
    with pytest.raises(UnreadableFile, match=r"height: expected dims \(y, x\)"):
        fc.surfaces.read(tmp_path / "a.npz")


def test_damaged_npz(tmp_path):
    (tmp_path / "a.npz").write_bytes(b"PK" + bytes(100))
    with pytest.raises(UnreadableFile, match="corrupt"):
        fc.surfaces.read(tmp_path / "a.npz", spacing=1e-4)


def test_inches_are_a_unit_of_length(tmp_path):
    np.save(tmp_path / "scan.npy", 1e-3 * np.arange(16.0).reshape(4, 4))
    for unit in ("inch", "in"):
        read = fc.surfaces.read(tmp_path / "scan.npy", spacing=1e-3, units=unit)
        np.testing.assert_allclose(read.values[1], 25.4e-6 * np.arange(4.0, 8.0), rtol=1e-14)


def write_arrays(path, arrays):
    """Write arrays by name in the format of the path."""
    if path.suffix == ".mat":
        pytest.importorskip("SurfaceTopography")
        scipy.io.savemat(path, arrays)
    elif path.suffix == ".h5":
        pytest.importorskip("SurfaceTopography")
        with pytest.importorskip("h5py").File(path, "w") as file:
            file.update(arrays)
    else:
        np.savez(path, **arrays)


@pytest.mark.parametrize("suffix", [".mat", ".h5", ".npz"])
def test_heights_among_other_arrays(tmp_path, suffix):
    """The first array may be a step, or a coordinate at each cell."""
    path, heights = tmp_path / f"a{suffix}", np.random.default_rng(1).random((4, 6))
    write_arrays(path, {"dx": 0.1, "t": np.arange(6.0), "z": heights})
    np.testing.assert_array_equal(fc.surfaces.read(path, spacing=1.0), heights)
    y, x = np.indices(heights.shape, float)
    write_arrays(path, {"X": x, "Y": y, "Z": heights})
    with pytest.raises(UnreadableFile, match="channel: expected one of 'X', 'Y', 'Z' in .*, got none"):
        fc.surfaces.read(path, spacing=1.0)
    np.testing.assert_array_equal(fc.surfaces.read(path, spacing=1.0, channel="Z"), heights)
    write_arrays(path, {"X": x, "Y": y, "height": heights})
    np.testing.assert_array_equal(fc.surfaces.read(path, spacing=1.0), heights)


def test_raster_of_one_row_is_refused(tmp_path):
    pytest.importorskip("rasterio")
    (tmp_path / "a.asc").write_text("ncols 4\nnrows 1\nxllcorner 0\nyllcorner 0\ncellsize 1\n1 2 3 4\n")
    with pytest.raises(UnreadableFile, match=r"at least 2 points along each axis, got \[1, 4\]"):
        fc.surfaces.read(tmp_path / "a.asc")


@pytest.mark.parametrize("has_library", [True, False])
def test_table_without_spacing_says_so_with_and_without_the_extra(tmp_path, monkeypatch, has_library):
    if has_library:
        pytest.importorskip("SurfaceTopography")
    else:
        monkeypatch.setattr("importlib.util.find_spec", lambda name, *_: None)
    np.savetxt(tmp_path / "heights.csv", np.random.default_rng(1).random((6, 20)), delimiter=",")
    with pytest.raises(UnreadableFile) as raised:
        fc.surfaces.read(tmp_path / "heights.csv")
    assert list(raised.value.problems) == [
        "spacing: expected the spacing in metres (on the command line `--spacing 0.3mm`), for 'heights.csv' "
        "as a table of heights, got None"
    ]


@pytest.mark.parametrize("corner", ["", "nan"])
def test_coordinates_beside_a_table_are_not_heights(tmp_path, corner):
    """Spreadsheets and pandas write them; read as heights they would exceed all others."""
    heights = np.random.default_rng(1).normal(size=(5, 6))
    rows = [[corner, *map(str, 0.3 * np.arange(6))]]
    rows += [[str(0.3 * k), *map(str, row)] for k, row in enumerate(heights)]
    (tmp_path / "map.csv").write_text("\n".join(map(",".join, rows)))
    with pytest.raises(UnreadableFile, match="coordinates in the first row and column"):
        fc.surfaces.read(tmp_path / "map.csv", spacing=3e-4, units="mm")
    rows[0][3] = "0.8"  # heights, one of them missing
    (tmp_path / "map.csv").write_text("\n".join(map(",".join, rows)))
    assert fc.surfaces.read(tmp_path / "map.csv", spacing=3e-4, units="mm").shape == (6, 7)
