"""Files of every format that is read, and the same files damaged."""

import functools
import gzip
import io
import tempfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import scipy.io
import skimage as ski
import xarray as xr
from calls import rough
from fuzz_faults import fault_of

import fractalcontact as fc
from fractalcontact.base.file_contents import file_contents

SHAPE = (8, 9)
HEIGHTS = np.random.default_rng(1).normal(size=SHAPE) * 1e-6
PLACES = np.indices(SHAPE)[::-1].reshape(2, -1).T * 1e-5
POINTS = np.c_[PLACES, HEIGHTS.ravel()]
TRIANGLES = np.array([corner for k in range(7) for corner in ((k, k + 1, k + 9), (k + 1, k + 10, k + 9))])


def lines(table, mark):
    return "\n".join(mark.join(f"{value:.9g}" for value in row) for row in table).encode() + b"\n"


def archive(values):
    content = io.BytesIO()
    np.savez(content, heights=values)
    return content.getvalue()


def npy(values):
    content = io.BytesIO()
    np.save(content, values)
    return content.getvalue()


def matlab():
    content = io.BytesIO()
    scipy.io.savemat(content, {"heights": HEIGHTS})
    return content.getvalue()


def hdf5():
    import h5py

    content = io.BytesIO()
    with h5py.File(content, "w") as file:
        file["heights"] = HEIGHTS
    return content.getvalue()


def ply(kind):
    header = f"ply\nformat {kind} 1.0\nelement vertex {len(POINTS)}\nproperty float x\nproperty float y\n"
    header += f"property float z\nelement face {len(TRIANGLES)}\nproperty list uchar int vertex_indices\n"
    head = (header + "end_header\n").encode()
    if kind == "ascii":
        return head + lines(POINTS, " ") + lines(np.c_[np.full(len(TRIANGLES), 3), TRIANGLES], " ")
    faces = b"".join(b"\3" + np.asarray(face, "<i4").tobytes() for face in TRIANGLES)
    return head + POINTS.astype("<f4").tobytes() + faces


def stl():
    corners = POINTS[TRIANGLES].astype("<f4")
    facets = (bytes(12) + corner.tobytes() + bytes(2) for corner in corners)
    return bytes(80) + np.uint32(len(corners)).tobytes() + b"".join(facets)


def obj():
    vertices = "".join(f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in POINTS)
    return (vertices + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in TRIANGLES)).encode()


def las(suffix):
    import laspy

    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales = [1e-8] * 3
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = POINTS.T
    with tempfile.TemporaryDirectory() as folder:
        cloud.write(Path(folder) / f"a{suffix}")
        return (Path(folder) / f"a{suffix}").read_bytes()


def raster():
    import rasterio

    with rasterio.io.MemoryFile() as file:
        size = {"height": SHAPE[0], "width": SHAPE[1], "count": 1, "dtype": "float64"}
        place = rasterio.Affine(1e-3, 0.0, 0.0, 0.0, -1e-3, 1.0)
        with file.open(driver="GTiff", transform=place, **size) as image:
            image.write(HEIGHTS, 1)
        return file.read()


def netcdf(format):
    surface = rough()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.nc"
        if format == "ours":
            fc.save(surface, path)
        else:
            surface.drop_attrs().assign_attrs(units="m").to_netcdf(path, format=format)
        return path.read_bytes()


def study():
    with tempfile.TemporaryDirectory() as folder:
        fc.scenes.run("rigid_sliding", out=folder, progress=False)
        return (Path(folder) / "result.nc").read_bytes()


def mask():
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.png"
        ski.io.imsave(path, np.uint8(255 * np.eye(9)), check_contrast=False)
        return path.read_bytes()


GRID = b"ncols 9\nnrows 8\nxllcorner 0\nyllcorner 0\ncellsize 0.00001\nNODATA_value -9999\n"
SURFER = b"DSAA\n9 8\n0 8e-5\n0 7e-5\n-1e-5 1e-5\n"
# by name: the bytes of the file, and the library that reads it, where it is optional
FILES = {
    "a.npy": (lambda: npy(HEIGHTS), None),
    "a.npz": (lambda: archive(HEIGHTS), None),
    "a.npz.gz": (lambda: gzip.compress(archive(HEIGHTS)), None),
    "a.csv": (lambda: lines(HEIGHTS, ","), None),
    "a.txt": (lambda: b"x [um]\ty [um]\tz [um]\n" + lines(POINTS * 1e6, "\t"), None),
    "b.csv": (lambda: b"x (mm);y (mm);z (mm)\n" + lines(POINTS * 1e3, ";").replace(b".", b","), None),
    "a.xyz": (lambda: lines(POINTS, " "), None),
    "a.xyz.gz": (lambda: gzip.compress(lines(POINTS, " ")), None),
    "a.pts": (lambda: f"{len(POINTS)}\n".encode() + lines(POINTS, " "), None),
    "profile.txt": (lambda: lines(np.c_[np.arange(20) * 1e-5, np.sin(np.arange(20.0)) * 1e-6], " "), None),
    "a.ply": (lambda: ply("ascii"), "trimesh"),
    "b.ply": (lambda: ply("binary_little_endian"), "trimesh"),
    "a.stl": (stl, "trimesh"),
    "a.obj": (obj, "trimesh"),
    "a.las": (lambda: las(".las"), "laspy"),
    "a.laz": (lambda: las(".laz"), "laspy"),
    "a.tif": (raster, "rasterio"),
    "a.asc": (lambda: GRID + lines(HEIGHTS, " "), "rasterio"),
    "a.grd": (lambda: SURFER + lines(HEIGHTS, " "), "rasterio"),
    "a.mat": (matlab, "SurfaceTopography"),
    "a.h5": (hdf5, "SurfaceTopography"),
    "a.nc": (lambda: netcdf("ours"), None),
    "b.nc": (lambda: netcdf("NETCDF3_CLASSIC"), None),
    "c.nc": (lambda: netcdf("NETCDF4"), None),
    "study.nc": (study, None),
    "a.png": (mask, None),
}  # fmt: skip
READERS = {
    "surfaces.read": lambda path: fc.surfaces.read(path, spacing=1e-5),
    "surfaces.read without spacing": fc.surfaces.read,
    "surfaces.read_points": fc.surfaces.read_points,
    "domains.read_mask": lambda path: fc.domains.read_mask(path, 1e-5),
    "open": lambda path: opened(path),
    "scenes.contents": file_contents,
}  # fmt: skip
WORDS = (
    b"0", b"-1", b"9999999999", b"1e308", b"nan", b"inf", b"-", b"\0", b"\n", b",", b";", b"\t", b" ",
    b"\xff", b"x", b"\xc3\xa4", b"1e400", b"0x10", b"\r\n", b"#",
)  # fmt: skip


def opened(path):
    """Read everything that a file has."""
    result = fc.open(path).load()
    result.close()
    return result if isinstance(result, xr.Dataset) else None


@functools.cache
def content(name):
    """Return the bytes of a whole file."""
    return FILES[name][0]()


def names():
    """Return the files whose libraries are installed."""
    return [name for name, (_, library) in FILES.items() if library is None or find_spec(library)]


def damaged_file(pick):
    """Return what was done, the name and the content of a file, and the function that reads it."""
    name = pick(sorted(names()))
    data, done = content(name), []
    for _ in range(pick([0, 1, 1, 1, 1, 2, 3])):
        what = pick(sorted(DAMAGE))
        done.append(what)
        data = DAMAGE[what](data, pick)
    if pick([True, False, False, False, False]):
        name = pick(sorted(FILES))
    return done, name, data, pick(sorted(READERS))


def _place(data, pick):
    """Return a place in a file, half of the time in its first part, where headers are."""
    return pick(range(max(1, min(len(data), pick([64, 512, len(data) + 1])))))


def _flipped(data, pick):
    place = _place(data, pick)
    return data[:place] + bytes(pick(range(256)) for _ in data[place : place + 1]) + data[place + 1 :]


def _inserted(data, pick):
    place = _place(data, pick)
    return data[:place] + pick(WORDS) + data[place:]


def _replaced(data, pick):
    place, word = _place(data, pick), pick(WORDS)
    return data[:place] + word + data[place + len(word) :]


def _cut_out(data, pick):
    first, size = _place(data, pick), pick([1, 2, 4, 8, 100, 1000])
    return data[:first] + data[first + size :]


def _line(data, pick):
    """Drop, repeat or replace a line of text."""
    found = data.split(b"\n")
    place = pick(range(min(len(found), 200)))
    found[place : place + 1] = pick([[], [found[place]] * 2, [pick(WORDS)], [b" ".join([found[place]] * 2)]])
    return b"\n".join(found)


def _filled(data, pick):
    first, mark = _place(data, pick), pick([b"\0", b"\xff", b"\x7f"])
    last = min(first + pick([1, 4, 8, 32]), len(data))
    return data[:first] + mark * (last - first) + data[last:]


def _spliced(data, pick):
    place = _place(data, pick)
    return data[:place] + content(pick(sorted(names())))[place:]


DAMAGE = {
    "bytes": _flipped,
    "inserted": _inserted,
    "replaced": _replaced,
    "cut out": _cut_out,
    "line": _line,
    "filled": _filled,
    "cut": lambda data, pick: data[: _place(data, pick)],
    "longer": lambda data, pick: data + pick(WORDS) * pick([1, 100]),
    "twice": lambda data, pick: data + data,
    "packed": lambda data, pick: gzip.compress(data),
    "other": lambda data, pick: content(pick(sorted(names()))),
    "spliced": _spliced,
}  # fmt: skip


def fault_of_file(name, data, reader, folder, *, seconds=20):
    """Return what is wrong with reading a file: None for a clear error or a result."""
    path = folder / name
    path.write_bytes(data)
    return fault_of(lambda: READERS[reader](path), seconds=seconds)
