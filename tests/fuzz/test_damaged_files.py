"""Damaged files through everything that reads files: a clear error, or a result and no other file."""

import struct
import tempfile
from pathlib import Path

import pytest
from fuzz_files import FILES, READERS, content, damaged_file, fault_of_file, names

import fractalcontact as fc
from fractalcontact.base.errors import UnreadableFile

# rasterio prints an exception where it cannot decode what GDAL says of a damaged file
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")


def check(pick):
    done, name, data, reader = damaged_file(pick)
    with tempfile.TemporaryDirectory() as folder:
        found = fault_of_file(name, data, reader, Path(folder))
        stray = {path.name for path in Path(folder).iterdir()} - {name}
    assert found is None, f"{reader}({name}), {done}: {found}"
    assert not stray, f"{reader}({name}), {done}: wrote {stray}"


def test_damaged_files(draw):
    draw(check, times=100)


@pytest.mark.parametrize("name", sorted(set(FILES) - {"a.png", "study.nc", "c.nc", "a.nc"}))
def test_whole_file_is_read(tmp_path, name):
    if name not in names():
        pytest.importorskip(FILES[name][1])
    (tmp_path / name).write_bytes(content(name))
    found = [reader(tmp_path / name) for word, reader in READERS.items() if word == "surfaces.read"]
    assert found[0].size >= 10


# place and form of a number in the header of a LAS file, and one that the file cannot hold
@pytest.mark.parametrize(
    ("name", "place", "value"),
    [("a.las", 100, 2**31), ("a.laz", 100, 2**31), ("a.las", 107, 2**31), ("a.laz", 107, 2**31)],
)
def test_counts_beyond_a_point_cloud_are_refused(tmp_path, name, place, value):
    pytest.importorskip("laspy")
    data = bytearray(content(name))
    data[place : place + 4] = struct.pack("<I", value)
    (tmp_path / name).write_bytes(data)
    with pytest.raises(UnreadableFile, match="states|unpacked"):
        fc.surfaces.read(tmp_path / name)


@pytest.mark.parametrize("end", [b"', (", b"", b"((("])
def test_header_of_an_array_that_never_ends_is_refused(tmp_path, end):
    data = content("a.npy")
    size = 10 + data[8] + 256 * data[9]
    header = (data[10:40] + end).ljust(size - 11) + b"\n"
    (tmp_path / "a.npy").write_bytes(data[:10] + header + data[size:])
    with pytest.raises(UnreadableFile, match="'a.npy' is corrupt"):
        fc.surfaces.read(tmp_path / "a.npy", spacing=1e-5)


def test_chunks_beyond_a_packed_point_cloud_are_refused(tmp_path):
    pytest.importorskip("laspy")
    data = bytearray(content("a.laz"))
    (points,) = struct.unpack_from("<I", data, 96)
    (table,) = struct.unpack_from("<q", data, points)
    struct.pack_into("<I", data, table + 4, 2**32 - 1)  # the library would take 60 GB and end the process
    (tmp_path / "a.laz").write_bytes(data)
    with pytest.raises(UnreadableFile, match="4294967295 chunks"):
        fc.surfaces.read(tmp_path / "a.laz")


@pytest.mark.parametrize("reader", ["open", "scenes.contents"])
def test_names_that_are_no_words_are_refused(tmp_path, reader):
    (tmp_path / "b.nc").write_bytes(content("b.nc").replace(b"height", b"\xcdeight"))
    with pytest.raises(UnreadableFile, match="'b.nc' is damaged"):
        READERS[reader](tmp_path / "b.nc")
