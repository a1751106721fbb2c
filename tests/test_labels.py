"""Every public function that returns labelled data: labels of the schema, a compliant file, a round trip."""

import importlib

import netCDF4
import numpy as np
import pytest
import skimage as ski
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.schema import QUANTITIES
from fractalcontact.scenes import contents

SUBPACKAGES = ("surfaces", "dimensions", "contact", "domains", "joints")
# these return an object, a number or a table of words, not labelled data
UNLABELLED = {
    "joints.Crack",
    "joints.PARK_PAULAY",
    "joints.bandis_aperture",
    "joints.bandis_closure",
    "joints.bandis_constants",
    "joints.barton_bandis_scaled",
    "joints.barton_choubey_strength",
    "joints.hydraulic_aperture",
    "joints.self_weight_strength",
    "joints.size_effect",
    "contact.ContactOptions",
    "contact.LoadPath",
    "contact.effective_modulus",
    "contact.effective_poisson",
    "contact.flat_stiffness",
    "dimensions.methods",
    "surfaces.SelfAffine",
}


def rough(n=40):
    return fc.surfaces.fbm((n, n), 1e-4, hurst=0.7, rms_increment=5e-6, rng=11)


def cloud():
    return np.random.default_rng(13).random((200, 3)) * [1.0, 1.0, 0.1]


def periodic(n=40):
    return fc.surfaces.spectral((n, n), 1e-4, hurst=0.8, rms_height=1e-5, rng=12)


def crack():
    return fc.joints.Crack(rough(), young=30e9, poisson=0.2, block=2e-3)


def pressed():
    return fc.contact.press(
        periodic(), contact_modulus=1e9, nominal_pressure=[1e6, 1e7], keep=("state", "pressure", "gap")
    )


def state():
    return pressed()["state"]


def gap():
    return pressed()["gap"]


def slid():
    return fc.joints.dilatancy(crack(), shear=[0.0, 1e-4, 2e-4, 3e-4], normal_force=[1.0, 10.0])


CALLS = {
    "surfaces.fbm": rough,
    "surfaces.spectral": periodic,
    "surfaces.midpoint": lambda: fc.surfaces.midpoint((20, 20), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1),
    "surfaces.weierstrass": lambda: fc.surfaces.weierstrass(
        (20, 20), 1e-4, hurst=0.7, rms_height=1e-6, rng=1
    ),
    "surfaces.from_array": lambda: fc.surfaces.from_array(np.eye(5), 1e-3),
    "surfaces.fit_plane": lambda: fc.surfaces.fit_plane(cloud()),
    "surfaces.from_points": lambda: fc.surfaces.from_points(cloud()),
    "surfaces.sample": lambda: fc.surfaces.sample("concrete_crack"),
    "surfaces.level": lambda: fc.surfaces.level(rough()),
    "surfaces.gaussian_filter": lambda: fc.surfaces.gaussian_filter(rough(), 8e-4),
    "surfaces.texture": lambda: fc.surfaces.texture(rough()),
    "surfaces.fill": lambda: fc.surfaces.fill(rough().where(rough().x > 2e-4)),
    "surfaces.despike": lambda: fc.surfaces.despike(rough()),
    "surfaces.describe": lambda: fc.surfaces.describe(rough()),
    "dimensions.estimate": lambda: fc.dimensions.estimate(rough(), list(fc.dimensions.methods())),
    "dimensions.spectrum": lambda: fc.dimensions.spectrum(periodic()),
    "dimensions.hurst_map": lambda: fc.dimensions.hurst_map(rough(), 1.6e-3),
    "dimensions.waves": lambda: fc.dimensions.waves(rough()),
    "dimensions.height_lacunarity": lambda: fc.dimensions.height_lacunarity(rough()),
    "dimensions.higuchi": lambda: fc.dimensions.higuchi(rough()[0]),
    "dimensions.detrended_fluctuation": lambda: fc.dimensions.detrended_fluctuation(rough()[0]),
    "dimensions.divider": lambda: fc.dimensions.divider(rough()[0]),
    "contact.press": pressed,
    "contact.partial_slip": lambda: fc.contact.partial_slip(
        periodic(),
        contact_modulus=1e9,
        poisson=0.2,
        friction_coefficient=0.5,
        nominal_pressure=1e6,
        tangential_force=[2.0, 4.0, -2.0],
        keep=("slip_state", "traction_x", "traction_y", "slip_x", "slip_y"),
    ),
    "contact.theories": lambda: fc.contact.theories(
        periodic(), contact_modulus=1e9, nominal_pressure=[1e6, 1e7]
    ),
    "joints.delta_surface": lambda: fc.joints.delta_surface(crack(), [1e-4, 2e-4], "W"),
    "joints.area_dimension": lambda: fc.joints.area_dimension(
        crack(), shear=[1e-4], factors=[1, 2], normal_force=[1.0, 10.0]
    ),
    "joints.self_weight": lambda: fc.joints.self_weight(
        crack(), structure_size=[1.0, 10.0], unit_weight=24e3, shear=[1e-4, 2e-4]
    ),
    "joints.closure": lambda: fc.joints.closure(
        crack(), shear=[1e-4], normal_force=[1.0, 10.0], keep=("state",)
    ),
    "joints.closure_laws": lambda: fc.joints.closure_laws(
        fc.joints.closure(crack(), shear=[1e-4], normal_force=[1.0, 3.0, 10.0, 30.0]), seating_pressure=1e5
    ),
    "joints.cyclic_shear": lambda: fc.joints.cyclic_shear(
        slid().sel(direction=["E", "W"]), [0.0, 3e-4, -3e-4, 0.0]
    ),
    "joints.delta_dimension": lambda: fc.joints.delta_dimension(crack(), shear=[1e-4, 2e-4]),
    "joints.dilatancy": slid,
    "joints.direct_shear": lambda: fc.joints.direct_shear(
        crack(), 2e-4, nominal_pressure=[1e6, 1e7], hardness=1e9, keep=("residual_lower", "residual_upper")
    ),
    "joints.directional_roughness": lambda: fc.joints.directional_roughness(rough()),
    "joints.friction": lambda: fc.joints.friction(slid()),
    "joints.partial_slip": lambda: fc.joints.partial_slip(
        crack(),
        shear=[0.0, 1e-4],
        normal_force=10.0,
        tangential_force=[0.0, 3.0, -3.0],
        keep=("slip_state", "traction_x", "traction_y", "slip_x", "slip_y"),
    ),
    "joints.register": lambda: fc.joints.register(rough(), rough() + 1e-5),
    "joints.roughness_coefficient": lambda: fc.joints.roughness_coefficient(rough(), lag=4e-4),
    "joints.shear_curve": lambda: fc.joints.shear_curve(
        rough(), [0, 1e-3], nominal_pressure=[1e5, 1e6], wall_strength=1e8, residual_friction_angle=30
    ),
    "joints.strength_envelope": lambda: fc.joints.strength_envelope(
        rough(), nominal_pressure=[1e5, 1e6], wall_strength=1e8, basic_friction_angle=30
    ),
    "joints.transmissivity": lambda: fc.joints.transmissivity(gap(), keep=("pressure", "flux")),
    "joints.uplift": lambda: fc.joints.uplift(
        gap(), upstream_pressure=1e5, drains=[(1e-3, 2e-3)], total_stress=2e6
    ),
    "joints.decorrelation_length": lambda: fc.joints.decorrelation_length(crack()),
    "domains.area_dimension": lambda: fc.domains.area_dimension(
        [state(), state().isel(x=slice(None, None, 2), y=slice(None, None, 2))]
    ),
    "domains.generalised_dimensions": lambda: fc.domains.generalised_dimensions(state(), q=[0, 1, 2]),
}


def public_functions():
    """Yield every public function that returns labelled data, as subpackage.function."""
    for subpackage in SUBPACKAGES:
        module = importlib.import_module(f"fractalcontact.{subpackage}")
        for name in module.__all__:
            if f"{subpackage}.{name}" not in UNLABELLED:
                yield f"{subpackage}.{name}"


def image_file(folder):
    ski.io.imsave(folder / "mask.png", np.uint8(255 * np.eye(9)), check_contrast=False)
    return folder / "mask.png"


def result_of(name, tmp_path):
    if name == "domains.read_mask":
        return fc.domains.read_mask(image_file(tmp_path), 1e-4)
    if name in CALLS:
        return CALLS[name]()
    if name == "surfaces.read":
        return fc.surfaces.read(fc.save(rough(), tmp_path / "surface.nc"))
    if name == "surfaces.read_points":
        np.savetxt(tmp_path / "points.xyz", cloud())
        return fc.surfaces.read_points(tmp_path / "points.xyz")
    subpackage, function = name.split(".")
    make_input = {"dimensions": rough, "domains": state}.get(subpackage)
    assert make_input is not None, f"add a call of {name} to CALLS"
    return getattr(getattr(fc, subpackage), function)(make_input())


def header(path):
    """Return all that a flat file states of its dimensions and variables, as text: NaN is not itself."""

    def attributes(item):
        return sorted((name, repr(item.getncattr(name))) for name in item.ncattrs())

    with netCDF4.Dataset(path) as file:
        dimensions = [(name, len(dim), dim.isunlimited()) for name, dim in file.dimensions.items()]
        variables = {
            name: (str(variable.dtype), variable.dimensions, attributes(variable))
            for name, variable in file.variables.items()
        }
        return attributes(file), sorted(dimensions), variables


@pytest.mark.parametrize("name", list(public_functions()))
def test_labels_file_and_round_trip(name, tmp_path, compliance):
    result = result_of(name, tmp_path)
    assert isinstance(result, (xr.Dataset, xr.DataArray)), f"{name} returns a {type(result).__name__}"
    dataset = result if isinstance(result, xr.Dataset) else result.to_dataset(name=result.name)
    for key, variable in dataset.variables.items():
        quantity = QUANTITIES[key]
        # scales of a mask are in cells, those of a surface in metres
        units = "1" if name.startswith("domains.") and key in ("scale_min", "scale_max") else quantity.units
        assert variable.attrs.get("units") == units, (name, key)
        assert variable.attrs["long_name"], (name, key)
        if variable.ndim >= 2 and {"y", "x"} <= set(variable.dims):
            assert variable.dims[-2:] == ("y", "x"), (name, key)
    assert "provenance" in result.attrs, name
    path = fc.save(result, tmp_path / "result.nc")
    assert compliance(path) == [], name
    description = contents(path)
    assert "run time" in description, name
    error_labels = ("achieved error ", "residual:", "error:", "low:", "misfit:")
    assert any(label in description for label in error_labels), name
    xr.testing.assert_identical(fc.open(path), result)
    if isinstance(result, xr.Dataset):
        result.to_netcdf(tmp_path / "plain.nc")
        # the same header and values: the checker, which takes most of the time, would find the same
        assert header(tmp_path / "plain.nc") == header(path) or compliance(tmp_path / "plain.nc") == [], name


def test_no_variable_has_the_name_of_an_xarray_method():
    assert "load" not in QUANTITIES
