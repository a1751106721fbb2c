"""The path of every public result: validation, labels, run time, provenance."""

import inspect
import json

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput, UnreadableFile
from fractalcontact.base.results import public_name, public_result, takes_checked


def _check_mean(problems):
    problems.number("scale", above=0)


@public_result(title="Mean height", references="Nobody (2000)", achieved_error="exact", check=_check_mean)
def mean(data, *, scale=1.0):
    """Mean of the data."""
    value = xr.Dataset({"mean_height": ((), scale * float(data.mean()), {"comment": "of all points"})})
    value.attrs["points"] = data.size
    return value


def test_result_is_labelled_timed_and_documented():
    result = mean(fc.surfaces.from_array(np.eye(4), 1e-3), scale=2.0)
    provenance = json.loads(result.attrs["provenance"])
    assert result["mean_height"].attrs["units"] == "m"
    assert result["mean_height"].attrs["comment"] == "of all points"
    assert result.attrs["references"] == "Nobody (2000)"
    assert result.attrs["title"] == "Mean height"
    assert provenance["parameters"]["scale"] == 2.0
    assert provenance["points"] == 16
    assert provenance["achieved_error"] == "exact"
    assert provenance["run_time"] == float(result["run_time"]) > 0
    assert "points" not in result.attrs


def test_defaults_are_recorded():
    parameters = json.loads(mean(fc.surfaces.from_array(np.eye(4), 1e-3)).attrs["provenance"])["parameters"]
    assert parameters["scale"] == 1.0


def test_validate_checks_and_computes_nothing():
    mean.validate(None, scale=1.0)
    with pytest.raises(InvalidInput, match="scale: expected a finite number > 0"):
        mean.validate(None, scale=0)
    with pytest.raises(InvalidInput, match="scale"):
        mean(None, scale=-1)


def test_public_names_leave_out_private_modules():
    assert public_name(fc.save) == "fractalcontact.base.netcdf.save"
    assert public_name(mean).endswith("mean")


@public_result(title="Step", check=_check_mean, error=UnreadableFile)
def step(data, *, scale=None):
    """Spacing of the data, by default its own."""
    result = (data * (scale or 1.0)).rename("height")
    result.attrs = {"parameters": {"scale": 7.0, "data": "file.nc"}}
    return result


def test_recorded_parameters_can_be_replaced():
    surface = fc.surfaces.from_array(np.eye(4), 1e-3)
    entry = json.loads(step(surface, scale=2.0).attrs["provenance"])
    assert entry["parameters"] == {"scale": 7.0, "data": "file.nc"}


def test_error_type_of_the_checks():
    with pytest.raises(UnreadableFile, match="scale"):
        step(fc.surfaces.from_array(np.eye(4), 1e-3), scale=-1.0)


def test_unknown_argument_names_the_function_and_the_nearest_argument():
    with pytest.raises(
        TypeError, match=r"fractalcontact\.contact\.press: .*'closur'.*did you mean 'closure'"
    ):
        fc.contact.press(None, contact_modulus=1e9, closur=1e-6)
    with pytest.raises(TypeError, match="'modulus' is no argument .did you mean 'contact_modulus'"):
        fc.contact.press(None, modulus=1e9)
    with pytest.raises(
        TypeError, match="'E' is no argument .its arguments are surface, contact_modulus, .*spacing"
    ):
        fc.contact.press(None, E=1e9)
    with pytest.raises(TypeError, match="'spacin' is no argument .did you mean 'spacing'"):
        fc.contact.press(None, contact_modulus=1e9, spacin=1e-6)
    with pytest.raises(TypeError, match=r"fractalcontact\.contact\.press: missing .*contact_modulus"):
        fc.contact.press(None)


def _read_scale(problems):
    problems.number("scale", above=0)
    return f"read {problems.given.scale}"


@public_result(title="Scaled heights", achieved_error="exact", check=_read_scale)
@takes_checked
def scaled(checked, /, data, *, scale=1.0):
    """Heights times a number."""
    return (scale * data).rename("height").assign_attrs(seen=checked)


def test_function_takes_what_its_check_returns():
    result = scaled(fc.surfaces.from_array(np.eye(4), 1e-3), scale=2.0)
    entry = json.loads(result.attrs["provenance"])
    assert (entry["seen"], entry["parameters"]["scale"]) == ("read 2.0", 2.0)
    assert list(inspect.signature(scaled).parameters) == ["data", "scale"]
