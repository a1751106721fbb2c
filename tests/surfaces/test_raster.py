"""Rasters in projected coordinates: GeoTIFF, ESRI ASCII and Surfer grids, written by hand or by rasterio."""

import gzip
import struct

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import MissingExtra, UnreadableFile

pytest.importorskip("rasterio")
import rasterio
from rasterio.transform import Affine

HEIGHTS = np.arange(12.0).reshape(3, 4) ** 2 / 16  # the first row is the southern one


def geotiff(path, *, crs="EPSG:32632", transform=None, heights=HEIGHTS, **options):
    transform = transform or Affine(2.0, 0.0, 5e5, 0.0, -3.0, 4e6)
    with rasterio.open(
        path, "w", driver="GTiff", height=3, width=4, count=1, dtype="float64", crs=crs, transform=transform,
        nodata=-9999.0, **options,
    ) as file:  # fmt: skip
        file.write(heights[::-1], 1)
    return path


def esri_ascii():
    head = "ncols 4\nnrows 3\nxllcorner 10.0\nyllcorner 20.0\ncellsize 2.0\nNODATA_value -9999\n"
    return (head + "\n".join(" ".join(map(str, row)) for row in HEIGHTS[::-1]) + "\n").encode()


def surfer(binary):
    """Return a Surfer 6 grid: the first row is the southern one, limits are those of the nodes."""
    if binary:
        head = struct.pack("<4s2h6d", b"DSBB", 4, 3, 0.0, 6.0, 0.0, 4.0, 0.0, 121.0)
        return head + HEIGHTS.astype("<f4").tobytes()
    rows = "\n".join(" ".join(map(str, row)) for row in HEIGHTS)
    return f"DSAA\n4 3\n0 6\n0 4\n0 121\n{rows}\n".encode()


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("suffix", ["tif", "tiff"])
def test_geotiff(tmp_path, packed, suffix):
    path = geotiff(tmp_path / f"dem.{suffix}")
    if packed:
        path = tmp_path / f"dem.{suffix}.gz"
        path.write_bytes(gzip.compress((tmp_path / f"dem.{suffix}").read_bytes()))
    surface = fc.surfaces.read(path)
    np.testing.assert_array_equal(surface.values, HEIGHTS)
    np.testing.assert_allclose(surface.x, [1.0, 3.0, 5.0, 7.0])
    np.testing.assert_allclose(surface.y, [1.5, 4.5, 7.5])
    with pytest.raises(UnreadableFile, match="first_row: expected None for a raster"):
        fc.surfaces.read(path, first_row="bottom")


def test_missing_values_units_and_feet(tmp_path):
    gapped = HEIGHTS.copy()
    gapped[1, 2] = -9999.0
    surface = fc.surfaces.read(geotiff(tmp_path / "a.tif", heights=gapped))
    assert np.isnan(surface.values[1, 2])
    assert int(surface.isnull().sum()) == 1
    # EPSG:2263 is in US survey feet
    feet = fc.surfaces.read(geotiff(tmp_path / "b.tif", crs="EPSG:2263"))
    np.testing.assert_allclose(feet.values, HEIGHTS * 1200 / 3937, rtol=1e-12)
    np.testing.assert_allclose(np.diff(feet.x), 2 * 1200 / 3937, rtol=1e-12)
    millimetres = fc.surfaces.read(tmp_path / "b.tif", units="mm", spacing=0.5)
    np.testing.assert_allclose(millimetres.values, HEIGHTS / 1e3)
    np.testing.assert_allclose(np.diff(millimetres.x), 0.5)


@pytest.mark.parametrize(
    ("crs", "unit", "factor"),
    [
        ("EPSG:32632", "mm", 1e-3),
        ("EPSG:2263", "metres", 1.0),
        ("EPSG:2263", "US survey foot", 1200 / 3937),
        ("EPSG:32632", "foot", None),
    ],
)
def test_unit_of_a_band(tmp_path, crs, unit, factor):
    """A unit that is none of a length, as feet beside a system in metres, must be given by the caller."""
    path = geotiff(tmp_path / "a.tif", crs=crs)
    with rasterio.open(path, "r+") as file:
        file.units = (unit,)
    if factor is None:
        with pytest.raises(UnreadableFile, match=f"a unit of length.*'{unit}'"):
            fc.surfaces.read(path)
        np.testing.assert_allclose(fc.surfaces.read(path, units="cm").values, HEIGHTS / 100, rtol=1e-12)
    else:
        np.testing.assert_allclose(fc.surfaces.read(path).values, factor * HEIGHTS, rtol=1e-12)


def test_heights_stored_as_scaled_numbers(tmp_path):
    """A band may state scale and offset of its numbers, as one of integers does; missing ones have none."""
    stored = 16.0 * HEIGHTS
    stored[1, 2] = -9999.0
    path = geotiff(tmp_path / "a.tif", heights=stored)
    with rasterio.open(path, "r+") as file:
        file.scales, file.offsets = (1.0 / 16.0,), (100.0,)
    expected = HEIGHTS + 100.0
    expected[1, 2] = np.nan
    np.testing.assert_array_equal(fc.surfaces.read(path).values, expected)


@pytest.mark.parametrize(
    ("name", "content", "step"),
    [("a.asc", esri_ascii(), 2.0), ("a.grd", surfer(False), 2.0), ("b.grd", surfer(True), 2.0)],
)
@pytest.mark.parametrize("packed", [False, True])
def test_gridded_text(tmp_path, name, content, step, packed):
    path = tmp_path / (name + ".gz" * packed)
    path.write_bytes(gzip.compress(content) if packed else content)
    surface = fc.surfaces.read(path)
    np.testing.assert_array_equal(surface.values, HEIGHTS)
    np.testing.assert_allclose(np.diff(surface.x), step)
    np.testing.assert_allclose(np.diff(surface.y), step)


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"crs": "EPSG:4326"}, "project it to metres"),
        ({"transform": Affine.rotation(20.0)}, "rows along x"),
        ({"crs": None, "transform": Affine.identity()}, "read_mask"),
    ],
)
@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_refused_rasters(tmp_path, options, problem):
    path = geotiff(tmp_path / "a.tif", **options)
    with pytest.raises(UnreadableFile, match=problem):
        fc.surfaces.read(path)
    with pytest.raises(UnreadableFile, match="channel"):
        fc.surfaces.read(path, channel=3)


def test_image_is_not_a_surface(tmp_path):
    ski = pytest.importorskip("skimage")
    ski.io.imsave(tmp_path / "a.png", np.eye(9, dtype=np.uint8), check_contrast=False)
    with pytest.raises(UnreadableFile, match="read_mask"):
        fc.surfaces.read(tmp_path / "a.png", spacing=1.0)


def test_truncated_and_missing_library(tmp_path, monkeypatch):
    path = geotiff(tmp_path / "a.tif")
    path.write_bytes(path.read_bytes()[:60])
    with pytest.raises(UnreadableFile, match=r"a\.tif"):
        fc.surfaces.read(path)
    import importlib.util

    find = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda n, *a: None if n == "rasterio" else find(n, *a))
    with pytest.raises(MissingExtra, match=r"fractalcontact\[geo\]"):
        fc.surfaces.read(path)
