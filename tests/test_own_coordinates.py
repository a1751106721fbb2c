"""Faces that carry coordinates and attributes of the user's own, through every room."""

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.schema import QUANTITIES

N = 24
SHEAR = [0.0, 1e-4, 2e-4]


def face(**options):
    return fc.surfaces.fbm((N, N), 1e-4, hurst=0.7, rms_increment=5e-6, rng=11, **options)


def strange(surface):
    """Return a surface with coordinates of any name and kind, some of them names of results."""
    surface = surface.assign_coords(
        sample="A1",
        when=np.datetime64("2020-01-01", "ns"),
        mask_id=(("y", "x"), np.arange(N * N).reshape(N, N)),
        lon=("x", np.arange(N) * 2.0),
        label=(("y", "x"), np.zeros((N, N))),
        **dict.fromkeys(
            ("hurst", "rms_height", "contact_area", "closure", "aperture", "local_slope", "run_time"), 1.0
        ),
        **dict.fromkeys(("island", "box_size", "lag", "wavenumber", "axis", "method", "azimuth"), 2),
    )
    surface.attrs.update(operator={"name": 1}, provenance="scanned by hand", _FillValue=-1.0, scale_factor=2)
    return surface


def told(dataset):
    """Return what a joint gave, with coordinates put on by its reader."""
    dataset = dataset.assign_coords(sample="A1", who=("shear", np.arange(dataset.sizes["shear"])))
    dataset.attrs["provenance"] = "typed in"
    return dataset


def crack(surface):
    return fc.joints.Crack(surface, young=3e10, poisson=0.2, block=1.2e-3)


def slid(surface, **options):
    return fc.joints.dilatancy(crack(surface), shear=SHEAR, direction=["E", "W"], **options)


FUNCTIONS = {
    "describe": fc.surfaces.describe,
    "level": fc.surfaces.level,
    "fill": lambda z: fc.surfaces.fill(z.where(z.x > 2e-4)),
    "despike": fc.surfaces.despike,
    "estimate": lambda z: fc.dimensions.estimate(z, ["likelihood", "increments"]),
    "directions": fc.dimensions.directions,
    "spectrum": fc.dimensions.spectrum,
    "variogram": fc.dimensions.variogram,
    "cube_counts": fc.dimensions.cube_counts,
    "press": lambda z: fc.contact.press(z, contact_modulus=1e10, closure=1e-5, keep=("state", "gap")),
    "islands": lambda z: fc.domains.islands(z > z.mean()),
    "masks": lambda z: fc.domains.describe(z > z.mean()),
    "delta_surface": lambda z: fc.joints.delta_surface(crack(z), SHEAR),
    "closure": lambda z: fc.joints.closure(crack(z), shear=SHEAR, normal_force=[1.0], keep=("state",)),
    "laws": lambda z: fc.joints.closure_laws(
        told(fc.joints.closure(crack(z), shear=SHEAR, normal_force=[1.0, 2.0, 3.0]))
    ),
    "friction": lambda z: fc.joints.friction(told(slid(z, normal_force=[1.0]))),
    "cyclic_shear": lambda z: fc.joints.cyclic_shear(told(slid(z)), [0.0, 1e-4, -1e-4]),
    "register": lambda z: fc.joints.register(z, z + 1e-5),
    "roughness_coefficient": fc.joints.roughness_coefficient,
    "transmissivity": lambda z: fc.joints.transmissivity(z - z.min()),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_what_the_house_does_not_know_changes_nothing(name, tmp_path):
    plain = FUNCTIONS[name](face())
    found = FUNCTIONS[name](strange(face()))
    assert set(found.coords) <= set(QUANTITIES)
    assert found.sizes == plain.sizes
    if isinstance(found, xr.Dataset):
        assert set(found.data_vars) == set(plain.data_vars)
        times = [key for key in found.data_vars if "time" in key]
        xr.testing.assert_equal(found.drop_vars(times).reset_coords(drop=True),
                                plain.drop_vars(times).reset_coords(drop=True))  # fmt: skip
    else:
        np.testing.assert_array_equal(found.values, plain.values)
    assert "operator" not in found.attrs
    fc.save(found, tmp_path / "found.nc")


@pytest.mark.parametrize("name", ["describe", "level", "fill", "estimate", "variogram", "transmissivity"])
def test_the_coordinate_of_an_own_dim_stays(name, tmp_path):
    stack = (
        face(members=2).rename(member="depth").assign_coords(depth=[0.5, 2.0], owner=("depth", ["p", "q"]))
    )
    stack["depth"].attrs.update(units="km", history="somewhere")
    found = FUNCTIONS[name](stack)
    assert found.depth.attrs == {"units": "km", "long_name": "depth"}
    assert found.depth.values.tolist() == [0.5, 2.0]
    assert "owner" not in found.coords
    xr.testing.assert_identical(fc.open(fc.save(found, tmp_path / "stack.nc")), found)


@pytest.mark.parametrize("name", ["describe", "level", "fill", "estimate", "variogram", "transmissivity"])
def test_an_index_of_several_levels_is_left_out(name):
    stack = face(members=4).rename(member="case").drop_vars("case")
    stack = stack.assign_coords(a=("case", [0, 0, 1, 1]), b=("case", [0, 1, 0, 1])).set_index(case=["a", "b"])
    found = FUNCTIONS[name](stack)
    assert found.sizes["case"] == 4
    assert not {"case", "a", "b"} & set(found.coords)


@pytest.mark.parametrize(
    ("name", "dim"),
    [
        ("describe", "rms_height"),
        ("estimate", "method"),
        ("estimate", "hurst"),
        ("directions", "azimuth"),
        ("spectrum", "wavenumber"),
        ("variogram", "lag"),
        ("cube_counts", "vertical_scale"),
        ("transmissivity", "axis"),
    ],
)
def test_a_dim_called_as_a_result_is_refused(name, dim):
    with pytest.raises(
        ValueError, match=rf"dims: expected leading dims not called as the results are, {dim}"
    ):
        FUNCTIONS[name](face(members=2).rename(member=dim))


def test_what_no_file_holds_is_told(tmp_path):
    with pytest.raises(ValueError, match=r"result: expected names, values and attributes that a NetCDF"):
        fc.save(strange(face()), tmp_path / "face.nc")
    assert list(tmp_path.iterdir()) == []
