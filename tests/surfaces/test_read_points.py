"""Lists of points, meshes and clouds: each format written by hand or by another writer, heights known."""

import gzip
import json
import struct
import sys

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base import resources
from fractalcontact.base.errors import MissingExtra, ScaleWarning, UnreadableFile

NX, NY, STEP = 12, 9, 0.5


def height(x, y):
    """Return heights of a curved surface that floats of four bytes hold exactly."""
    return 0.25 * x * y - 0.125 * x**2


X, Y = np.meshgrid(STEP * np.arange(NX), STEP * np.arange(NY))
POINTS = np.stack([X, Y, height(X, Y)], axis=-1).reshape(-1, 3)
CORNERS = np.arange(NX * NY).reshape(NY, NX)
TRIANGLES = np.concatenate(
    [
        np.stack([CORNERS[:-1, :-1], CORNERS[:-1, 1:], CORNERS[1:, 1:]], axis=-1).reshape(-1, 3),
        np.stack([CORNERS[:-1, :-1], CORNERS[1:, 1:], CORNERS[1:, :-1]], axis=-1).reshape(-1, 3),
    ]
)


def provenance(surface):
    return json.loads(surface.attrs["provenance"])


def text_lines(mark, header="", rows=POINTS):
    return header + "\n".join(mark.join(repr(float(number)) for number in row) for row in rows) + "\n"


LISTS = {
    "blank.xyz": text_lines(" "),
    "comma.csv": text_lines(",", "x,y,z\n"),
    "units.csv": text_lines(",", "X [mm],Y [mm],Z [mm]\n", 1e3 * POINTS),
    "several_units.csv": text_lines(",", "x [mm],y [cm],z [um]\n", POINTS * [1e3, 1e2, 1e6]),
    "words.csv": text_lines(",", "X position [mm],Y position [mm],Z position [mm]\n", 1e3 * POINTS),
    "bare.csv": text_lines(";", "x mm;y mm;z mm\n", 1e3 * POINTS),
    "semicolon.txt": text_lines(";", '"Z";"X";"Y"\n', POINTS[:, [2, 0, 1]]),
    "decimal.csv": text_lines(";", "x;y;z\n").replace(".", ","),
    "decimal_blanks.txt": text_lines("\t").replace(".", ","),
    "comment.txt": text_lines(" ", "# made by hand\n# x y z\n"),
    "cloud_compare.asc": text_lines(",", "//X,Y,Z,R,G,B\n", np.c_[POINTS, 9 * np.ones((NX * NY, 3))]),
    "laser.pts": text_lines(" ", f"{NX * NY}\n", np.c_[POINTS, np.ones((NX * NY, 4))]),
    "paraview.csv": text_lines(",", '"Points:0","Points:1","Points:2","p"\n', np.c_[POINTS, POINTS[:, :1]]),
    "empty_cells.csv": text_lines(",", "x,y,z\n") + "1.25,,\n,,nan\n",
}


@pytest.mark.parametrize("name", LISTS)
@pytest.mark.parametrize("packed", [False, True])
def test_lists_of_points(tmp_path, name, packed):
    """Every header, separator and decimal mark gives the same heights, on the grid of the points."""
    path = tmp_path / (name + ".gz" * packed)
    content = LISTS[name].encode()
    path.write_bytes(gzip.compress(content) if packed else content)
    surface = fc.surfaces.read(path)
    np.testing.assert_allclose(surface.values, height(X, Y), atol=1e-15)
    np.testing.assert_allclose(surface.x, X[0], atol=1e-15)
    points = fc.surfaces.read_points(path).dropna("point")
    np.testing.assert_allclose(points.position, POINTS, atol=1e-15)


def test_profile_is_an_input(tmp_path):
    x = np.arange(50) * 0.25
    (tmp_path / "trace.csv").write_text(text_lines(",", "distance [mm],height [mm]\n", np.c_[x, 0.5 * x**2]))
    surface = fc.surfaces.read(tmp_path / "trace.csv")
    assert surface.dims == ("x",)
    np.testing.assert_allclose(surface.values, 0.5 * x**2 / 1e3, rtol=1e-15)
    np.testing.assert_allclose(surface.x, x / 1e3, rtol=1e-15)


def test_units_of_columns_are_in_the_provenance(tmp_path):
    (tmp_path / "trace.csv").write_text(text_lines(",", "x [mm],z [um]\n", POINTS[:, [0, 2]] * [1e3, 1e6]))
    points = fc.surfaces.read_points(tmp_path / "trace.csv")
    np.testing.assert_allclose(points.position, POINTS[:, [0, 2]], atol=1e-15)
    provenance = json.loads(points.attrs["provenance"])
    assert (provenance["stated_unit"], provenance["stated_units"]) == ("mm", ["mm", "um"])
    for read in (fc.surfaces.read, fc.surfaces.read_points):
        with pytest.raises(
            UnreadableFile, match="units: expected None, as each column states its unit, got 'um'"
        ):
            read(tmp_path / "trace.csv", units="um")


def ply_header(kind, faces):
    lines = ["ply", f"format {kind} 1.0", "comment by hand", f"element vertex {len(POINTS)}"]
    lines += [f"property float {axis}" for axis in "xyz"]
    if faces:
        lines += [f"element face {len(TRIANGLES)}", "property list uchar int vertex_indices"]
    return "\n".join([*lines, "end_header", ""]).encode()


def ply(kind, faces=True):
    if kind == "ascii":
        rows = [" ".join(map(repr, map(float, row))) for row in POINTS]
        rows += ["3 " + " ".join(map(str, face)) for face in TRIANGLES] * faces
        return ply_header(kind, faces) + ("\n".join(rows) + "\n").encode()
    order = "<" if kind == "binary_little_endian" else ">"
    body = POINTS.astype(order + "f4").tobytes()
    if faces:
        body += b"".join(struct.pack(order + "B3i", 3, *map(int, face)) for face in TRIANGLES)
    return ply_header(kind, faces) + body


def stl(binary):
    corners = POINTS[TRIANGLES]
    if binary:
        facets = [struct.pack("<12fH", 0, 0, 1, *map(float, facet.ravel()), 0) for facet in corners]
        return b"by hand".ljust(80) + struct.pack("<I", len(facets)) + b"".join(facets)
    text = ["solid by_hand"]
    for facet in corners:
        text += ["facet normal 0 0 1", "outer loop"]
        text += [f"vertex {' '.join(map(repr, map(float, corner)))}" for corner in facet]
        text += ["endloop", "endfacet"]
    return "\n".join([*text, "endsolid by_hand", ""]).encode()


def obj():
    lines = ["# by hand", *(f"v {' '.join(map(repr, map(float, row)))}" for row in POINTS)]
    return "\n".join(
        [*lines, *(f"f {' '.join(str(k + 1) for k in face)}" for face in TRIANGLES), ""]
    ).encode()


def off():
    rows = [" ".join(map(repr, map(float, row))) for row in POINTS]
    rows += ["3 " + " ".join(map(str, face)) for face in TRIANGLES]
    return "\n".join(["OFF", f"{len(POINTS)} {len(TRIANGLES)} 0", *rows, ""]).encode()


MESHES = {
    "ascii.ply": ply("ascii"),
    "little.ply": ply("binary_little_endian"),
    "big.ply": ply("binary_big_endian"),
    "binary.stl": stl(True),
    "text.stl": stl(False),
    "mesh.obj": obj(),
    "mesh.off": off(),
}


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("packed", [False, True])
def test_meshes(tmp_path, name, packed):
    """Heights at the corners are those of the mesh; between them they are linear."""
    pytest.importorskip("trimesh")
    path = tmp_path / (name + ".gz" * packed)
    path.write_bytes(gzip.compress(MESHES[name]) if packed else MESHES[name])
    surface = fc.surfaces.read(path, spacing=STEP / 2, plane="xy")
    x, y = np.meshgrid(surface.x, surface.y)
    # at the middle of the edges of a cell, the mean of the heights at its ends
    assert float(np.abs(surface.values - height(x, y)).max()) < 0.25 * STEP**2
    corners = fc.surfaces.read_points(path)
    assert corners.sizes["triangle"] == len(TRIANGLES)
    position = corners.position.values[corners.triangles.values.ravel()]
    np.testing.assert_array_equal(np.unique(position, axis=0), np.unique(POINTS, axis=0))
    assert provenance(surface)["reader"].startswith("trimesh")
    assert provenance(surface)["overhang_share"] == 0.0


@pytest.mark.parametrize("kind", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_clouds_in_ply(tmp_path, kind):
    """A PLY file without faces is a list of points."""
    pytest.importorskip("trimesh")
    (tmp_path / "cloud.ply").write_bytes(ply(kind, faces=False))
    surface = fc.surfaces.read(tmp_path / "cloud.ply", units="mm")
    np.testing.assert_allclose(surface.values, height(X, Y) / 1e3, atol=1e-18)


def las_file(path, points, keys=()):
    laspy = pytest.importorskip("laspy")
    header = laspy.LasHeader(point_format=0, version="1.2")
    header.scales, header.offsets = [1e-3] * 3, [5e5, 4e6, 0.0]
    if keys:
        # a directory of GeoTIFF keys: four numbers for itself, and for each entry
        directory = [1, 1, 0, len(keys), *(part for key, value in keys for part in (key, 0, 1, value))]
        content = struct.pack(f"<{len(directory)}H", *directory)
        header.vlrs.append(laspy.VLR("LASF_Projection", 34735, "", content))
    cloud = laspy.LasData(header)
    cloud.x, cloud.y, cloud.z = points.T
    cloud.write(path)


@pytest.mark.parametrize("suffix", ["las", "laz"])
def test_las_and_laz(tmp_path, suffix):
    """Coordinates far from the origin keep their digits."""
    las_file(tmp_path / f"cloud.{suffix}", POINTS + np.array([5e5, 4e6, 100.0]))
    surface = fc.surfaces.read(tmp_path / f"cloud.{suffix}")
    # written in steps of 1 mm
    np.testing.assert_allclose(surface.values, height(X, Y) + 100.0, atol=1e-3)
    np.testing.assert_allclose(surface.x, X[0] + 5e5, atol=1e-6)


@pytest.mark.parametrize("columns", [(1, 1, 2), ("x", 0, "z")])
def test_one_column_for_two_coordinates_is_refused(tmp_path, columns):
    (tmp_path / "a.csv").write_text(text_lines(",", "x,y,z\n"))
    with pytest.raises(UnreadableFile, match="columns: expected a different column for each coordinate"):
        fc.surfaces.read(tmp_path / "a.csv", columns=columns)


def test_longitudes_and_latitudes_are_refused(tmp_path):
    (tmp_path / "a.csv").write_text(text_lines(",", "lon,lat,z\n"))
    with pytest.raises(UnreadableFile, match="project"):
        fc.surfaces.read(tmp_path / "a.csv", columns=[0, 1, 2])
    las_file(tmp_path / "a.las", POINTS + np.array([5e5, 4e6, 0.0]), keys=[(1024, 2)])
    with pytest.raises(UnreadableFile, match="project it to metres"):
        fc.surfaces.read(tmp_path / "a.las")


@pytest.mark.parametrize("feet", [(3076, 9003), (4099, 9002)])
def test_cloud_in_feet_is_refused(tmp_path, feet):
    """GeoTIFF keys state the units of x and y (3076) and of z (4099): EPSG 9001 is the metre."""
    far = POINTS + np.array([5e5, 4e6, 0.0])
    las_file(tmp_path / "a.las", far, keys=[(1024, 1), (3076, 9001)])
    assert provenance(fc.surfaces.read(tmp_path / "a.las"))["stated_unit"] == "m"
    las_file(tmp_path / "b.las", far, keys=[(1024, 1), feet])
    with pytest.raises(UnreadableFile, match="convert it first, got 'feet'"):
        fc.surfaces.read(tmp_path / "b.las")


@pytest.mark.parametrize(
    ("name", "library"), [("a.ply", "trimesh"), ("a.stl", "trimesh"), ("a.las", "laspy")]
)
def test_missing_library_names_the_extra(tmp_path, monkeypatch, name, library):
    import importlib.util

    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda n, *a: None if n == library else find(n, *a))
    (tmp_path / name).write_bytes(ply("ascii"))
    with pytest.raises(MissingExtra, match=r"pip install 'fractalcontact\[mesh\]'"):
        fc.surfaces.read(tmp_path / name)


def test_tables_of_points_load_no_mesh_library(tmp_path):
    (tmp_path / "a.xyz").write_text(LISTS["blank.xyz"])
    before = set(sys.modules)
    fc.surfaces.read(tmp_path / "a.xyz")
    assert not {"trimesh", "laspy", "rasterio"} & (set(sys.modules) - before)


@pytest.mark.parametrize(
    ("name", "content", "problem"),
    [
        ("a.csv", text_lines(",", "left,right,depth\n"), "columns called 'left', 'right', 'depth'"),
        ("a.csv", text_lines(",", "x [mm],y,z [um]\n"), "unit of every coordinate"),
        ("a.csv", text_lines(",", "x [mm],y [mm],z [px]\n"), "unit of length"),
        ("a.csv", text_lines(",", "x [px],y [px],z [px]\n"), "unit of length"),
        ("a.csv", text_lines(",", "x,y,z\n", np.full((6, 3), np.inf)), "line 1|infinite"),
        ("a.csv", text_lines(",", "x,y,z\n", [[1.0, 2.0, 3.0]]), "at least 4 points"),
        ("a.xyz", text_lines(" ", "", np.outer(np.arange(9.0), [1.0, 2.0, 3.0])), "span a plane"),
        ("a.xyz", text_lines(" ") + "1 2\n", "has 2 values"),
        ("a.ply", "ply\nformat ascii 1.0\nelement vertex 3\n", "a.ply"),
        ("a.stl", "not a mesh", "a.stl"),
        ("a.obj", "# nothing\n", "a.obj"),
        ("a.las", "LASF but not more", "a.las"),
    ],
)
def test_unreadable_points(tmp_path, name, content, problem):
    for library in ("trimesh", "laspy"):
        pytest.importorskip(library)
    (tmp_path / name).write_text(content)
    with pytest.raises(UnreadableFile, match=problem):
        fc.surfaces.read(tmp_path / name)


def test_points_that_look_like_millimetres_warn(tmp_path):
    (tmp_path / "a.xyz").write_text(text_lines(" ", "", 40.0 * POINTS))
    with pytest.warns(ScaleWarning, match="units='mm'"):
        fc.surfaces.read(tmp_path / "a.xyz")
    fc.surfaces.read(tmp_path / "a.xyz", units="mm")  # no warning


@pytest.mark.filterwarnings("ignore::fractalcontact.base.errors.ScaleWarning")  # both faces are flat
def test_second_file_in_the_plane_of_the_first(tmp_path):
    """Both faces of a joint, tilted alike, keep their distance in one plane."""
    rng = np.random.default_rng(4)
    for name, offset in (("lower.xyz", 0.0), ("upper.xyz", 0.02)):
        x, y = rng.uniform(0.0, 1.0, (2, 2000))
        np.savetxt(tmp_path / name, np.c_[x, y, 0.5 * x + offset])
    lower = fc.surfaces.read(tmp_path / "lower.xyz", spacing=0.05)
    upper = fc.surfaces.read(tmp_path / "upper.xyz", spacing=0.05, plane=lower)
    gap = (upper - lower).values
    np.testing.assert_allclose(gap[np.isfinite(gap)], 0.02 / np.hypot(1.0, 0.5), atol=1e-12)


def test_gzip_that_unpacks_without_bound_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(resources, "SMALL_FILE", 1 << 20)
    (tmp_path / "a.xyz.gz").write_bytes(gzip.compress(bytes(1 << 26)))
    with pytest.raises(UnreadableFile, match="MiB when unpacked"):
        fc.surfaces.read(tmp_path / "a.xyz.gz")


def test_scene_reads_a_mesh(tmp_path):
    pytest.importorskip("trimesh")
    (tmp_path / "scan.ply").write_bytes(ply("binary_little_endian"))
    (tmp_path / "study.toml").write_text(
        '[surface]\nread = "scan.ply"\nunits = "mm"\nspacing = 2.5e-4\nplane = "xy"\n'
        '[want]\nsurfaces = ["describe"]\n'
    )
    result = fc.scenes.run(fc.scenes.load(tmp_path / "study.toml"))
    expected = fc.surfaces.describe(
        fc.surfaces.read(tmp_path / "scan.ply", units="mm", spacing=2.5e-4, plane="xy")
    )
    assert float(result["surfaces"]["rms_height"]) == float(expected.rms_height)


@pytest.mark.filterwarnings("ignore::fractalcontact.base.errors.ScaleWarning")  # both faces are flat
@pytest.mark.parametrize("suffix", ["npy", "npz", "csv"])
def test_plane_and_columns_of_an_array_are_those_of_a_list(tmp_path, suffix):
    """Points of numpy files, with their numbers in front, are gridded as those of text are."""
    rng = np.random.default_rng(4)
    for name, offset in (("lower", 0.0), ("upper", 0.02)):
        x, y = rng.uniform(0.0, 1.0, (2, 2000))
        points = np.c_[np.arange(2000), x, y, 0.5 * x + offset]
        path = tmp_path / f"{name}.{suffix}"
        if suffix == "csv":
            np.savetxt(path, points, delimiter=",")
        else:
            (np.save if suffix == "npy" else np.savez)(path, points)
    options = {"spacing": 0.05, "columns": [1, 2, 3]}
    lower = fc.surfaces.read(tmp_path / f"lower.{suffix}", **options)
    upper = fc.surfaces.read(tmp_path / f"upper.{suffix}", plane=lower, **options)
    gap = (upper - lower).values
    np.testing.assert_allclose(gap[np.isfinite(gap)], 0.02 / np.hypot(1.0, 0.5), atol=1e-12)


def test_columns_and_plane_without_effect_are_refused(tmp_path):
    pytest.importorskip("trimesh")
    (tmp_path / "a.ply").write_bytes(ply("ascii"))
    for read in (fc.surfaces.read, fc.surfaces.read_points):
        with pytest.raises(UnreadableFile, match="columns: expected None for .ply"):
            read(tmp_path / "a.ply", columns=[0, 2, 1])
    np.save(tmp_path / "a.npy", np.eye(5))
    for option in ({"plane": "xy"}, {"plane": "fit"}):
        with pytest.raises(UnreadableFile, match="plane: expected None for heights"):
            fc.surfaces.read(tmp_path / "a.npy", spacing=1e-3, units="mm", **option)
