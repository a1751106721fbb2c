"""Maps for other programs: what was written is read back with its place, spacing, units and names."""

import sys
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import tifffile
from study import command_here

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput, MissingExtra

SPACING = (1e-4, 2e-4)  # y, x
MAPS = ("state", "pressure", "gap")


@pytest.fixture(scope="module")
def closure():
    face = fc.surfaces.fbm((24, 32), SPACING, hurst=0.8, rms_increment=1e-6, rng=1)
    crack = fc.joints.Crack(face, young=3e10, poisson=0.2, block=(1.6e-3, 3.2e-3))
    return fc.joints.closure(crack, shear=[0, 2e-4], normal_force=[10, 20, 30], keep=MAPS)


def read_image_data(path):
    """Return origin, spacing, extent and arrays of VTK image data with raw appended data, by its format."""
    head, _, data = path.read_bytes().partition(b'<AppendedData encoding="raw">')
    data = data[data.index(b"_") + 1 :]
    image = ET.fromstring(head + b"</VTKFile>").find("ImageData")
    numbers = {name: [float(n) for n in words.split()] for name, words in image.attrib.items()}
    shape = [int(n) + 1 for n in numbers["WholeExtent"][1::2]]
    arrays = {}
    for each in image.iter("DataArray"):
        start, dtype = int(each.get("offset")), np.dtype(each.get("type").lower()).newbyteorder("<")
        size = int.from_bytes(data[start : start + 8], "little")
        values = np.frombuffer(data[start + 8 : start + 8 + size], dtype)
        arrays[each.get("Name")] = values.reshape(shape[::-1])[0]  # x runs first, then y
    return numbers["Origin"], numbers["Spacing"], arrays


def test_image_data_has_values_places_and_units(closure, tmp_path):
    pytest.importorskip("pyevtk")
    files = fc.scenes.export(closure, tmp_path)
    assert len(files) == 6
    for shear, step in np.ndindex(2, 3):
        path = tmp_path / f"result_shear{shear:03d}_step{step:03d}.vti"
        assert path in files
        origin, spacing, arrays = read_image_data(path)
        np.testing.assert_allclose(origin[:2], [closure.x[0], closure.y[0]], rtol=1e-12)
        np.testing.assert_allclose(spacing[:2], SPACING[::-1], rtol=1e-12)
        plane = closure.isel(shear=shear, step=step)
        for name, variable in (("state", "state"), ("pressure (Pa)", "pressure"), ("gap (m)", "gap")):
            np.testing.assert_array_equal(arrays[name], plane[variable])


def test_stack_has_values_spacing_units_and_loads(closure, tmp_path):
    files = fc.scenes.export(closure, tmp_path, to="tiff")
    assert [path.name for path in files] == [f"result_{name}.tif" for name in MAPS]
    with tifffile.TiffFile(tmp_path / "result_pressure.tif") as file:
        planes, words, tags = file.asarray(), file.imagej_metadata, file.pages[0].tags
    pressure = closure.pressure.values.reshape(6, 16, 16)
    np.testing.assert_allclose(planes, pressure[:, ::-1], rtol=1e-6)
    assert words["unit"] == "um"
    assert words["Info"].startswith("pressure (Pa)")
    across, up = (np.divide(*tags[f"{axis}Resolution"].value) for axis in "XY")
    np.testing.assert_allclose([1 / across, 1 / up], [200, 100])  # um
    assert "shear (m) = 0.0002" in words["Labels"][3]
    assert "normal_force (N) = 10" in words["Labels"][3]
    states = tifffile.imread(tmp_path / "result_state.tif")
    assert states.dtype == np.uint8
    np.testing.assert_array_equal(states, closure.state.values.reshape(6, 16, 16)[:, ::-1])


def test_heights_in_a_picture_are_read_again(tmp_path):
    surface = fc.surfaces.fbm((24, 32), SPACING, hurst=0.8, rms_increment=1e-6, rng=1)
    (path,) = fc.scenes.export(surface, tmp_path, to="tiff")
    again = fc.surfaces.read(path, spacing=SPACING)
    np.testing.assert_allclose(again, surface, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(again.x, surface.x)


def test_command_writes_the_maps_of_a_study(closure, tmp_path):
    result = fc.save(closure, tmp_path / "result.nc")
    done = command_here("export", result, "--to", "tiff")
    assert done.returncode == 0, done.stderr
    assert sorted(path.name for path in (tmp_path / "maps").iterdir()) == sorted(
        f"result_{name}.tif" for name in MAPS
    )
    again = command_here("export", result, "--to", "tiff")
    assert again.returncode == 2
    assert "files of these names" in again.stderr
    assert command_here("export", result, "--to", "tiff", "--force").returncode == 0
    single = fc.save(closure[["gap"]], tmp_path / "gap.nc")
    done = command_here("export", single, "--to", "tiff", "--force")
    assert done.stdout.endswith("maps: 1 file, result_gap.tif\n")


def test_curves_alone_are_refused(closure, tmp_path):
    with pytest.raises(InvalidInput, match="maps over y and x"):
        fc.scenes.export(closure[["contact_fraction"]], tmp_path / "new", to="tiff")
    assert not (tmp_path / "new").exists()


def test_missing_library_is_named(closure, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyevtk", None)  # as where it is not installed
    with pytest.raises(MissingExtra, match=r"fractalcontact\[vtk\]"):
        fc.scenes.export(closure, tmp_path)
