"""Validation: every problem of a call in one error, and the one path of every public result."""

import json

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.results import public_name, public_result
from fractalcontact.base.validation import (
    Problems,
    float_array,
    given_option,
    word_tuple,
)


def problems_of(check):
    """Return the lines that one check adds."""
    problems = Problems("somewhere")
    assert check(problems) is (not problems.found)
    return problems.found


@pytest.mark.parametrize(
    ("value", "bounds"),
    [(1.0, {"above": 0}), (np.float32(2), {"at_most": 2}), (0, {"at_least": 0}), (None, {"optional": True})],
)
def test_valid_numbers_pass(value, bounds):
    assert problems_of(lambda p: p.number("n", value, **bounds)) == []


@pytest.mark.parametrize(
    "value", [None, "1", True, np.nan, np.inf, [1.0], 1j, object(), 10**400, {}, [1, [2]]]
)
def test_wrong_numbers_are_named(value):
    (line,) = problems_of(lambda p: p.number("modulus", value, above=0))
    assert line.startswith("modulus: expected ")
    assert ", got " in line


@pytest.mark.parametrize("value", [[], [[1.0]], [1.0, np.nan], "x", [1.0, [2.0]], [0.0]])
def test_wrong_sequences_of_numbers_are_named(value):
    (line,) = problems_of(lambda p: p.numbers("loads", value, above=0))
    assert line.startswith("loads: expected ")


@pytest.mark.parametrize("value", [0, 11, 1.0, True, "1", None, 10**30])
def test_wrong_integers_are_named(value):
    assert len(problems_of(lambda p: p.integer("members", value, at_least=1, at_most=10))) == 1


def test_near_words_are_suggested():
    (line,) = problems_of(lambda p: p.choice("method", "fsat", ("fast", "elimination")))
    assert "did you mean 'fast'?" in line
    assert len(problems_of(lambda p: p.choices("keep", ["gap", "stat", 3], ("state", "gap")))) == 2
    assert len(problems_of(lambda p: p.choices("keep", ["gap", ["state"]], ("state", "gap")))) >= 1


def test_exactly_one_option():
    assert problems_of(lambda p: p.exactly_one(force=1.0, closure=None)) == []
    assert len(problems_of(lambda p: p.exactly_one(force=None, closure=None))) == 1
    assert len(problems_of(lambda p: p.exactly_one(force=1.0, closure=0.0))) == 1
    assert given_option(force=None, closure=0.0) == ("closure", 0.0)


def test_all_problems_are_raised_together():
    with pytest.raises(InvalidInput) as caught, Problems("somewhere") as problems:
        problems.number("a", -1, above=0)
        with problems.collect("options: "):
            raise InvalidInput("options", ["b: wrong", "c: wrong"])
        problems.boolean("d", "yes")
    assert caught.value.where == "somewhere"
    assert [line.partition(":")[0] for line in caught.value.problems] == ["a", "options", "options", "d"]


def test_conversions_after_the_checks():
    assert float_array(2).tolist() == [2.0]
    assert word_tuple("gap") == ("gap",)
    assert word_tuple(["gap", "state", "gap"]) == ("gap", "state")
    assert word_tuple(None) == ()


def test_surface_and_periodicity_are_checked():
    surface = fc.surfaces.from_array(np.eye(5), 1e-3)
    assert problems_of(lambda p: p.surface("surface", surface)) == []
    assert len(problems_of(lambda p: p.surface("surface", surface.to_dataset(name="height")))) == 1
    assert len(problems_of(lambda p: p.surface("surface", surface.where(surface < 1)))) == 1


def _check_mean(problems, data, *, scale):
    problems.number("scale", scale, above=0)


@public_result(title="Mean height", references="Nobody (2000)", achieved_error="exact", check=_check_mean)
def mean(data, *, scale=1.0):
    """Mean of the data."""
    value = xr.Dataset({"mean_height": ((), scale * float(data.mean()), {"comment": "of all points"})})
    value.attrs["points"] = data.size
    return value


def test_a_public_result_is_labelled_timed_and_documented():
    found = mean(fc.surfaces.from_array(np.eye(4), 1e-3), scale=2.0)
    provenance = json.loads(found.attrs["provenance"])
    assert found["mean_height"].attrs["units"] == "m"
    assert found["mean_height"].attrs["comment"] == "of all points"
    assert found.attrs["references"] == "Nobody (2000)"
    assert found.attrs["title"] == "Mean height"
    assert provenance["parameters"]["scale"] == 2.0
    assert provenance["points"] == 16
    assert provenance["achieved_error"] == "exact"
    assert provenance["run_time"] == float(found["run_time"]) > 0
    assert "points" not in found.attrs


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
