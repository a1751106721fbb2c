"""Validation: all problems of a call in one error, and conversions of valid values."""

import pickle

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.numbers import float_array
from fractalcontact.base.validation import Problems, given_option, word_tuple


def problems_of(check):
    """Return the lines that one check adds."""
    problems = Problems("somewhere")
    assert check(problems) is (not problems.messages)
    return problems.messages


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


def test_every_problem_is_listed():
    with pytest.raises(InvalidInput) as caught, Problems("somewhere") as problems:
        problems.number("young", -3.0, above=0)
        problems.choice("method", "quick", ("fast", "elimination"))
        problems.integer("members", 0, at_least=1)
        problems.numbers("shear", [0.0, np.nan], at_least=0)
        problems.exactly_one(closure=None, normal_force=None)
    text = str(caught.value)
    assert len(caught.value.problems) == 5
    assert "somewhere: 5 problems" in text
    words = ("young", "> 0", "-3.0", "'quick'", "'elimination'", "members", "shear", "nan")
    for part in (*words, "closure / normal_force"):
        assert part in text


def test_valid_call_has_no_problem():
    with Problems("somewhere") as problems:
        assert problems.number("a", 2, above=0, below=3)
        assert problems.numbers("b", [1, 2])
        assert problems.choices("c", ["x", "y", "x"], ("x", "y"))
        assert problems.exactly_one(p=None, q=1)
    np.testing.assert_array_equal(float_array([1, 2]), [1.0, 2.0])
    assert word_tuple(["x", "y", "x"]) == ("x", "y")
    assert given_option(p=None, q=1) == ("q", 1)


@pytest.mark.parametrize("value", [True, "3", None, [1, 2], 1j, np.nan, np.inf, [], [[1.0]]])
def test_one_finite_number_is_required(value):
    with pytest.raises(InvalidInput), Problems("somewhere") as problems:
        problems.number("a", value)


@pytest.mark.parametrize(
    ("bounds", "inside", "outside"),
    [
        ({"above": 0}, 1e-300, 0.0),
        ({"at_least": 0}, 0.0, -1e-300),
        ({"below": 1}, 0.999, 1.0),
        ({"at_most": 1}, 1, 1.1),
    ],
)
def test_bounds_hold_at_their_ends(bounds, inside, outside):
    with Problems("somewhere") as problems:
        problems.number("a", inside, **bounds)
    with pytest.raises(InvalidInput), Problems("somewhere") as problems:
        problems.number("a", outside, **bounds)


def test_problems_raised_inside_are_added_to_those_before():
    with pytest.raises(InvalidInput) as caught, Problems("outer") as problems:
        problems.add("a", "x", "y")
        raise InvalidInput("inner", ["b: expected c, got d"])
    assert caught.value.problems == ("a: expected x, got 'y'", "b: expected c, got d")


def test_other_exceptions_pass_through():
    with pytest.raises(ZeroDivisionError), Problems("outer") as problems:
        problems.add("a", "x", "y")
        raise ZeroDivisionError


def test_ragged_sequences_are_refused():
    with pytest.raises(InvalidInput) as caught, Problems("somewhere") as problems:
        problems.number("young", [1.0, [2.0]])
        problems.numbers("loads", [1.0, [2.0]])
        problems.choices("keep", ["gap", ["state"]], ("gap", "state"))
    text = "\n".join(caught.value.problems)
    assert all(f"{name}: expected" in text for name in ("young", "loads", "keep"))


def test_checks_read_the_arguments_of_the_call():
    arguments = {"lag": -1.0, "method": "quick", "keep": None, "spacing": [1.0, 2.0]}
    with pytest.raises(InvalidInput) as caught, Problems("f", arguments=arguments) as problems:
        assert not problems.number("lag", above=0)
        assert problems.number("lag", 2.0, above=0)  # another value
        problems.choice("method", among=("fast", "slow"))
        assert problems.choices("keep", among=("state",), optional=True)
        assert problems.numbers("spacing", above=0)
        problems.require(False, "spacing", "one number")
        assert problems.given.spacing == [1.0, 2.0]
    assert [line.split(":")[0] for line in caught.value.problems] == ["lag", "method", "spacing"]
    assert "got -1.0" in caught.value.problems[0]
    assert "got [1.0, 2.0]" in caught.value.problems[2]


def test_folder_in_place_of_a_file_is_named_one(tmp_path):
    problems = Problems("here")
    assert not problems.file("path", tmp_path)
    assert problems.messages == [f"path: expected an existing file, got the folder {tmp_path.name!r}"]
    assert not problems.file("path", tmp_path / "none.nc")
    assert problems.messages[1] == "path: expected an existing file, got 'none.nc'"


def test_problems_in_the_body_of_a_function_name_it():
    face = fc.surfaces.from_array(np.zeros((20, 20)), 1e-4)
    with pytest.raises(InvalidInput, match="overlapping faces") as caught:
        fc.joints.register(face, face)
    assert caught.value.where == "fractalcontact.joints.register"
    assert pickle.loads(pickle.dumps(caught.value)).where == caught.value.where
