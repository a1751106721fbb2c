"""Files of numbers: plain arrays, decimal commas, damaged archives and errors of the file system."""

import contextlib
import gzip
import io
import os
from pathlib import Path

import numpy as np
import pytest
import scipy.io
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput, UnreadableFile
from fractalcontact.base.file_contents import file_contents

HEIGHTS = np.random.default_rng(1).normal(size=(12, 17)) * 1e-6


def write_array(path, values):
    """Write an array in the format of the name."""
    content = io.BytesIO()
    if ".npz" in path.name:
        np.savez(content, heights=values)
    elif ".mat" in path.name:
        scipy.io.savemat(content, {"heights": values})
    elif ".h5" in path.name:
        with pytest.importorskip("h5py").File(content, "w") as file:
            file["heights"] = values
    else:
        np.save(content, values)
    packed = path.suffix == ".gz"
    path.write_bytes(gzip.compress(content.getvalue()) if packed else content.getvalue())
    return path


@pytest.mark.parametrize("first_row", [None, "top", "bottom"])
@pytest.mark.parametrize("name", ["a.npz", "a.mat", "a.h5", "a.npz.gz"])
def test_array_is_the_same_surface_in_every_format(tmp_path, name, first_row):
    pytest.importorskip("SurfaceTopography")
    options = {"spacing": (1e-6, 2e-6), "first_row": first_row}
    surface = fc.surfaces.read(write_array(tmp_path / name, HEIGHTS), **options)
    expected = fc.surfaces.read(write_array(tmp_path / "a.npy", HEIGHTS), **options)
    assert surface.sizes == {"y": 12, "x": 17}
    xr.testing.assert_equal(surface, expected)
    np.testing.assert_array_equal(surface, HEIGHTS[::-1] if first_row == "top" else HEIGHTS)


@pytest.mark.parametrize("name", ["a.npy", "a.npz", "a.mat", "a.h5"])
def test_infinite_heights_of_an_array_are_refused(tmp_path, name):
    pytest.importorskip("SurfaceTopography")
    values = np.where(np.arange(17) == 3, np.inf, HEIGHTS)
    with pytest.raises(UnreadableFile, match="finite heights, or NaN where missing, got 12 infinite"):
        fc.surfaces.read(write_array(tmp_path / name, values), spacing=1e-6)


@pytest.mark.parametrize(
    ("name", "content"),
    [("a.npz", "cut"), ("a.x3p", "cut"), ("a.npy", "cut"), ("a.npy", "archive"), ("a.npz", "mark")],
)
def test_damaged_archive_is_named(tmp_path, name, content):
    pytest.importorskip("SurfaceTopography")
    archive = write_array(tmp_path / "whole.npz", HEIGHTS).read_bytes()
    damaged = {"cut": archive[:-40], "mark": b"PK\x03\x04", "archive": archive}
    (tmp_path / name).write_bytes(damaged[content])
    with pytest.raises(UnreadableFile, match=f"'{name}' is corrupt"):
        fc.surfaces.read(tmp_path / name, spacing=1e-6)


def test_array_that_states_more_than_the_file_has_takes_no_memory(tmp_path):
    content = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        content, {"descr": "<f8", "fortran_order": False, "shape": (10**6, 10**6)}
    )
    (tmp_path / "a.npy").write_bytes(content.getvalue() + bytes(800))
    with pytest.raises(UnreadableFile, match="it states 8000000000000 bytes of numbers and has 800"):
        fc.surfaces.read(tmp_path / "a.npy", spacing=1e-6)


@pytest.mark.parametrize(
    "text",
    [
        "0;0;0\n0,5;1;2\n3;4,25;1\n",  # the first row has no comma
        "0\t0\t0\n0,5\t1\t2\n3\t4,25\t1\n",
        "0 0 0\n0,5 1 2\n3 4,25 1\n",
        "0;0;0;\n0,5;1;2;\n3;4,25;1;\n",
        "a;b;c\n0;0;0\n0,5;1;2\n3;4,25;1\n",
    ],
)
def test_decimal_commas_after_integers(tmp_path, text):
    (tmp_path / "a.csv").write_text(text)
    columns = [0, 1, 2]
    points = fc.surfaces.read_points(tmp_path / "a.csv", columns=columns)
    assert points["position"].values.tolist() == [[0, 0, 0], [0.5, 1, 2], [3, 4.25, 1]]


def test_points_with_decimal_commas_are_those_with_points(tmp_path):
    y, x = np.mgrid[:20, :20] * 1e-4
    table = np.column_stack([x.ravel(), y.ravel(), 1e-5 * np.sin(x.ravel() * 1e4)])
    np.savetxt(tmp_path / "a.csv", table, delimiter=";", header="x;y;z", comments="")
    (tmp_path / "b.csv").write_text((tmp_path / "a.csv").read_text().replace(".", ","))
    xr.testing.assert_equal(fc.surfaces.read(tmp_path / "a.csv"), fc.surfaces.read(tmp_path / "b.csv"))


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (
            "1,5;2,5\n1.234;4,0\n",
            "line 2: expected decimal commas as .* before, got a decimal point",
        ),
        ("1.5;2.5\n3,5;4.0\n", "line 2, column 1: expected a number, got '3,5', a decimal comma"),
        ("1,5;2\n1,234,567;4\n", "line 2, column 1: expected a number, got '1.234.567'"),
        ("1,5,2,5\n1,5,2\n", "line 2 has 3 values, line 1 has 4"),
    ],
)
def test_ambiguous_commas_are_refused(tmp_path, text, problem):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(UnreadableFile, match=problem):
        fc.surfaces.read(tmp_path / "a.csv", spacing=1.0)


READERS = {
    "read": lambda path: fc.surfaces.read(path, spacing=1.0),
    "read_points": fc.surfaces.read_points,
    "read_mask": lambda path: fc.domains.read_mask(path, 1.0),
    "open": fc.open,
    "contents": file_contents,
    "load": fc.scenes.load,
}
NAMES = {"read": "a.npy", "read_points": "a.xyz", "read_mask": "a.png", "load": "a.toml"}


@pytest.mark.parametrize("reader", READERS)
def test_error_of_the_disk_is_named(tmp_path, reader):
    """The memory of this process is a file whose first bytes cannot be read, with an error of the system."""
    path = tmp_path / NAMES.get(reader, "a.nc")
    path.symlink_to("/proc/self/mem")
    if not path.is_file():
        pytest.skip("this system has no file that always fails")
    with pytest.raises(UnreadableFile, match=path.name.split(".")[0]):
        READERS[reader](path)


@pytest.mark.parametrize("place", ["file", "folder"])
@pytest.mark.parametrize("reader", READERS)
def test_missing_permission_is_named(tmp_path, reader, place):
    folder = tmp_path / "folder"
    folder.mkdir()
    path = folder / NAMES.get(reader, "a.nc")
    path.write_bytes(b"1 2 3\n")
    with contextlib.suppress(InvalidInput):
        READERS[reader](path)  # imports its library, which another user may not read
    closed = path if place == "file" else folder
    closed.chmod(0)
    is_root = os.geteuid() == 0
    above = [part for part in (tmp_path, *tmp_path.parents) if str(part) != str(Path(part.anchor))]
    modes = {part: part.stat().st_mode for part in above}
    try:
        if is_root:  # for whom no file is closed
            for part in above:
                part.chmod(modes[part] | 0o011)
            os.seteuid(65534)
        with pytest.raises(InvalidInput, match=r"(?i)permission denied|no permission"):
            READERS[reader](path)
    finally:
        if is_root:
            os.seteuid(0)
            for part, mode in modes.items():
                part.chmod(mode)
        closed.chmod(0o700)
