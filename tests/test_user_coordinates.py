"""Inputs with coordinates and attributes of the user's own, through every subpackage."""

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.schema import QUANTITIES

N = 24
SHEAR = [0.0, 1e-4, 2e-4]


def rough(**options):
    return fc.surfaces.fbm((N, N), 1e-4, hurst=0.7, rms_increment=5e-6, rng=11, **options)


def with_user_coords(surface):
    """Return a surface with coordinates of any name and dtype, some of them names of results."""
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


def annotated(dataset):
    """Return a joint result with coordinates added by the user."""
    dataset = dataset.assign_coords(sample="A1", who=("shear", np.arange(dataset.sizes["shear"])))
    dataset.attrs["provenance"] = "typed in"
    return dataset


def crack(surface):
    return fc.joints.Crack(surface, young=3e10, poisson=0.2, block=1.2e-3)


def sheared(surface, **options):
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
        annotated(fc.joints.closure(crack(z), shear=SHEAR, normal_force=[1.0, 2.0, 3.0]))
    ),
    "friction": lambda z: fc.joints.friction(annotated(sheared(z, normal_force=[1.0]))),
    "partial_slip": lambda z: fc.joints.partial_slip(
        crack(z), shear=SHEAR, normal_force=1.0, tangential_force=[0.3, -0.3], keep=("slip_state",)
    ),
    "register": lambda z: fc.joints.register(z, z + 1e-5),
    "roughness_coefficient": fc.joints.roughness_coefficient,
    "strength_envelope": lambda z: fc.joints.strength_envelope(
        z, nominal_pressure=1e6, wall_strength=1e8, basic_friction_angle=30
    ),
    "direct_shear": lambda z: fc.joints.direct_shear(
        crack(z), 1e-4, nominal_pressure=1e6, hardness=1e9, keep=("residual_lower",)
    ),
    "shear_curve": lambda z: fc.joints.shear_curve(
        z, [0, 1e-3], nominal_pressure=1e6, wall_strength=1e8, residual_friction_angle=30
    ),
    "directional_roughness": fc.joints.directional_roughness,
    "transmissivity": lambda z: fc.joints.transmissivity(z - z.min()),
    "uplift": lambda z: fc.joints.uplift(z - z.min(), upstream_pressure=1e5),
}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_unknown_coordinates_change_nothing(name, tmp_path):
    plain = FUNCTIONS[name](rough())
    result = FUNCTIONS[name](with_user_coords(rough()))
    assert set(result.coords) <= set(QUANTITIES)
    assert result.sizes == plain.sizes
    if isinstance(result, xr.Dataset):
        assert set(result.data_vars) == set(plain.data_vars)
        times = [key for key in result.data_vars if "time" in key]
        xr.testing.assert_equal(result.drop_vars(times).reset_coords(drop=True),
                                plain.drop_vars(times).reset_coords(drop=True))  # fmt: skip
    else:
        np.testing.assert_array_equal(result.values, plain.values)
    assert "operator" not in result.attrs
    fc.save(result, tmp_path / "result.nc")


@pytest.mark.parametrize(
    "name", ["describe", "level", "fill", "estimate", "variogram", "transmissivity", "uplift"]
)
def test_coordinate_of_a_user_dim_is_kept(name, tmp_path):
    stack = (
        rough(members=2).rename(member="depth").assign_coords(depth=[0.5, 2.0], owner=("depth", ["p", "q"]))
    )
    stack["depth"].attrs.update(units="km", history="somewhere")
    result = FUNCTIONS[name](stack)
    assert result.depth.attrs == {"units": "km", "long_name": "depth"}
    assert result.depth.values.tolist() == [0.5, 2.0]
    assert "owner" not in result.coords
    xr.testing.assert_identical(fc.open(fc.save(result, tmp_path / "stack.nc")), result)


@pytest.mark.parametrize(
    "name", ["describe", "level", "fill", "estimate", "variogram", "transmissivity", "uplift"]
)
def test_multi_index_is_dropped(name):
    stack = rough(members=4).rename(member="case").drop_vars("case")
    stack = stack.assign_coords(a=("case", [0, 0, 1, 1]), b=("case", [0, 1, 0, 1])).set_index(case=["a", "b"])
    result = FUNCTIONS[name](stack)
    assert result.sizes["case"] == 4
    assert not {"case", "a", "b"} & set(result.coords)


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
        ("uplift", "diagram"),
    ],
)
def test_dim_named_like_a_result_is_refused(name, dim):
    with pytest.raises(
        ValueError, match=rf"dims: expected leading dims not called as the results are, {dim}"
    ):
        FUNCTIONS[name](rough(members=2).rename(member=dim))


def test_attributes_that_no_file_holds_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"height.operator: expected text, a number or a list of them"):
        fc.save(with_user_coords(rough()), tmp_path / "face.nc")
    assert list(tmp_path.iterdir()) == []
