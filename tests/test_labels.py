"""Every public function that returns labelled data: labels of the schema, a compliant file, a round trip."""

import json

import calls
import netCDF4
import pytest
import xarray as xr
from calls import CALLS, function_of, labelled_functions, rough

import fractalcontact as fc
from fractalcontact.base.file_contents import file_contents
from fractalcontact.base.schema import QUANTITIES

SLIP_MAPS = ("slip_state", "traction_x", "traction_y", "slip_x", "slip_y")
# maps and further results, which have labels of their own
MORE = {
    "dimensions.estimate": {"methods": list(fc.dimensions.methods())},
    "contact.press": {"keep": ("state", "pressure", "gap")},
    "contact.partial_slip": {"tangential_force": [0.01, 0.02, -0.01], "keep": SLIP_MAPS},
    "joints.closure": {"keep": ("state",)},
    "joints.direct_shear": {"keep": ("residual_lower", "residual_upper")},
    "joints.partial_slip": {"keep": SLIP_MAPS},
    "joints.strength_envelope": {"length": 1.0},
    "joints.transmissivity": {"keep": ("pressure", "flux")},
    "joints.uplift": {"total_stress": 2e6},
}


def result_of(name):
    """Return the result of a call with all that it may return."""
    return function_of(name)(**(CALLS[name]() | MORE[name])) if name in MORE else calls.result_of(name)


def stack():
    return function_of("surfaces.fbm")(**(CALLS["surfaces.fbm"]() | {"members": 2}))


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


# results of other dims
OTHERS = {
    "members": ("surfaces.spectral", {"members": 2}),
    "description of members": ("surfaces.describe", {"surface": stack}),
    "a plane": ("surfaces.describe", {"surface": lambda: 0.0 * rough().assign_attrs(units="m")}),
    "one position": ("joints.delta_surface", {"shear": 1e-4, "direction": 30.0}),
    "angles and forces": ("joints.dilatancy", {"direction": ["E", 30.0], "normal_force": [1.0, 50.0],
                                               "keep": ("state",)}),
    "a spring": ("joints.dilatancy", {"direction": ["E", "W"], "normal_force": [1.0, 50.0],
                                      "normal_stiffness": 1e10}),
    "imposed closures": ("joints.closure", {"normal_force": None, "closure": [1e-6, 2e-6],
                                            "keep": ("state", "gap", "pressure")}),
    "rigid faces": ("joints.friction", {"dilatancy": lambda: calls.result_of("joints.dilatancy")}),
}  # fmt: skip


@pytest.mark.parametrize("name", [*labelled_functions(), *OTHERS])
def test_labels_file_and_round_trip(name, tmp_path, compliance):
    if name in OTHERS:
        name, changes = OTHERS[name]
        changes = {key: value() if callable(value) else value for key, value in changes.items()}
        result = function_of(name)(**(CALLS[name]() | changes))
    else:
        result = result_of(name)
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
    called = json.loads(result.attrs["provenance"])["call"]
    assert called == f"fractalcontact.{name}"
    assert "/" not in result.attrs["history"].split()[-1]
    path = fc.save(result, tmp_path / "result.nc")
    assert compliance(path) == [], name
    description = file_contents(path)
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
