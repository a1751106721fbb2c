"""One walk over every public function: labels from the table, a clean file, the same data read back."""

import importlib

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.schema import QUANTITIES
from fractalcontact.scenes import contents

ROOMS = ("surfaces", "dimensions", "contact", "domains", "joints")
# these give no labelled data: an object, a number, a table of words, the named laws of the handbooks
UNLABELLED = {
    "joints.Crack",
    "joints.PARK_PAULAY",
    "joints.bandis_closure",
    "joints.bandis_constants",
    "joints.barton_bandis_scaled",
    "joints.barton_choubey_strength",
    "joints.self_weight_strength",
    "joints.size_effect",
    "contact.ContactOptions",
    "contact.LoadPath",
    "contact.effective_modulus",
    "contact.flat_stiffness",
    "dimensions.methods",
    "surfaces.SelfAffine",
}


def face(n=40):
    return fc.surfaces.fbm((n, n), 1e-4, hurst=0.7, rms_increment=5e-6, rng=11)


def wavy(n=40):
    return fc.surfaces.spectral((n, n), 1e-4, hurst=0.8, rms_height=1e-5, rng=12)


def crack():
    return fc.joints.Crack(face(), young=30e9, poisson=0.2, block=2e-3)


def pressed():
    return fc.contact.press(
        wavy(), contact_modulus=1e9, nominal_pressure=[1e6, 1e7], keep=("state", "pressure", "gap")
    )


def state():
    return pressed()["state"]


def gap():
    return pressed()["gap"]


def slid():
    return fc.joints.dilatancy(crack(), shear=[0.0, 1e-4, 2e-4, 3e-4], normal_force=[1.0, 10.0])


CALLS = {
    "surfaces.fbm": face,
    "surfaces.spectral": wavy,
    "surfaces.midpoint": lambda: fc.surfaces.midpoint((20, 20), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1),
    "surfaces.weierstrass": lambda: fc.surfaces.weierstrass(
        (20, 20), 1e-4, hurst=0.7, rms_height=1e-6, rng=1
    ),
    "surfaces.from_array": lambda: fc.surfaces.from_array(np.eye(5), 1e-3),
    "surfaces.sample": lambda: fc.surfaces.sample("concrete_crack"),
    "surfaces.level": lambda: fc.surfaces.level(face()),
    "surfaces.fill": lambda: fc.surfaces.fill(face().where(face().x > 2e-4)),
    "surfaces.despike": lambda: fc.surfaces.despike(face()),
    "surfaces.describe": lambda: fc.surfaces.describe(face()),
    "dimensions.estimate": lambda: fc.dimensions.estimate(face(), list(fc.dimensions.methods())),
    "dimensions.spectrum": lambda: fc.dimensions.spectrum(wavy()),
    "contact.press": pressed,
    "joints.delta_surface": lambda: fc.joints.delta_surface(crack(), [1e-4, 2e-4], "W"),
    "joints.closure": lambda: fc.joints.closure(
        crack(), shear=[1e-4], normal_force=[1.0, 10.0], keep=("state",)
    ),
    "joints.closure_laws": lambda: fc.joints.closure_laws(
        fc.joints.closure(crack(), shear=[1e-4], normal_force=[1.0, 3.0, 10.0, 30.0])
    ),
    "joints.cyclic_shear": lambda: fc.joints.cyclic_shear(
        slid().sel(direction=["E", "W"]), [0.0, 3e-4, -3e-4, 0.0]
    ),
    "joints.delta_dimension": lambda: fc.joints.delta_dimension(crack(), shear=[1e-4, 2e-4]),
    "joints.dilatancy": slid,
    "joints.friction": lambda: fc.joints.friction(slid()),
    "joints.register": lambda: fc.joints.register(face(), face() + 1e-5),
    "joints.roughness_coefficient": lambda: fc.joints.roughness_coefficient(face(), lag=4e-4),
    "joints.transmissivity": lambda: fc.joints.transmissivity(gap()),
    "joints.decorrelation_length": lambda: fc.joints.decorrelation_length(crack()),
    "domains.area_dimension": lambda: fc.domains.area_dimension(
        [state(), state().isel(x=slice(None, None, 2), y=slice(None, None, 2))]
    ),
    "domains.generalised_dimensions": lambda: fc.domains.generalised_dimensions(state(), q=[0, 1, 2]),
}


def walked():
    """Return every public function that gives labelled data, as room.function."""
    for room in ROOMS:
        module = importlib.import_module(f"fractalcontact.{room}")
        for name in module.__all__:
            if f"{room}.{name}" not in UNLABELLED:
                yield f"{room}.{name}"


def result_of(name, tmp_path):
    if name in CALLS:
        return CALLS[name]()
    room, function = name.split(".")
    if name == "surfaces.read":
        return fc.surfaces.read(fc.save(face(), tmp_path / "face.nc"))
    given = {"dimensions": face, "domains": state}.get(room)
    assert given is not None, f"tell this test how to call {name}"
    return getattr(getattr(fc, room), function)(given())


@pytest.fixture(params=list(walked()))
def result(request, tmp_path):
    return request.param, result_of(request.param, tmp_path)


def test_labels_file_and_round_trip(result, tmp_path, compliance):
    name, found = result
    if not isinstance(found, (xr.Dataset, xr.DataArray)):
        pytest.fail(f"{name} gives a {type(found).__name__}")
    dataset = found if isinstance(found, xr.Dataset) else found.to_dataset(name=found.name)
    for key, variable in dataset.variables.items():
        quantity = QUANTITIES[key]
        # scales of a mask are in cells, those of a surface in metres
        units = "1" if name.startswith("domains.") and key in ("scale_min", "scale_max") else quantity.units
        assert variable.attrs.get("units") == units, (name, key)
        assert variable.attrs["long_name"], (name, key)
        if variable.ndim >= 2 and {"y", "x"} <= set(variable.dims):
            assert variable.dims[-2:] == ("y", "x"), (name, key)
    assert "provenance" in found.attrs, name
    path = fc.save(found, tmp_path / "result.nc")
    assert compliance(path) == [], name
    told = contents(path)
    assert "run time" in told, name
    words = ("achieved error ", "residual:", "error:", "low:", "misfit:")
    assert any(word in told for word in words), name
    xr.testing.assert_identical(fc.open(path), found)
    if isinstance(found, xr.Dataset):
        found.to_netcdf(tmp_path / "plain.nc")
        assert compliance(tmp_path / "plain.nc") == [], name


def test_nothing_is_named_load():
    assert "load" not in QUANTITIES
