"""Checks collect every problem and raise once; errors are ValueErrors."""

import pickle

import numpy as np
import pytest

from fractalcontact.base import errors
from fractalcontact.base.checks import Problems, rehearse
from fractalcontact.base.errors import InvalidInput, MissingExtra, UnreadableFile


def test_all_problems_are_raised_at_once():
    with pytest.raises(InvalidInput) as caught, Problems("somewhere") as problems:
        problems.number("young", -3.0, above=0)
        problems.choice("method", "quick", ("fast", "elimination"))
        problems.integer("members", 0, at_least=1)
        problems.numbers("shear", [0.0, np.nan], at_least=0)
        problems.exactly_one(closure=None, normal_force=None)
    text = str(caught.value)
    assert len(caught.value.problems) == 5
    assert "somewhere: 5 problems" in text
    for part in (
        "young",
        "> 0",
        "-3.0",
        "'quick'",
        "'elimination'",
        "members",
        "shear",
        "nan",
        "closure / normal_force",
    ):
        assert part in text


def test_a_sound_call_leaves_with_its_values():
    with Problems("somewhere") as problems:
        assert problems.number("a", 2, above=0, below=3) == 2.0
        np.testing.assert_array_equal(problems.numbers("b", [1, 2]), [1.0, 2.0])
        assert problems.choices("c", ["x", "y", "x"], ("x", "y")) == ("x", "y")
        assert problems.exactly_one(p=None, q=1) == "q"


@pytest.mark.parametrize("value", [True, "3", None, [1, 2], 1j, np.nan, np.inf, [], [[1.0]]])
def test_what_is_not_one_finite_number_is_refused(value):
    with pytest.raises(InvalidInput), Problems("somewhere") as problems:
        problems.number("a", value)


@pytest.mark.parametrize(
    ("bounds", "good", "bad"),
    [
        ({"above": 0}, 1e-300, 0.0),
        ({"at_least": 0}, 0.0, -1e-300),
        ({"below": 1}, 0.999, 1.0),
        ({"at_most": 1}, 1, 1.1),
    ],
)
def test_bounds_hold_at_their_ends(bounds, good, bad):
    with Problems("somewhere") as problems:
        problems.number("a", good, **bounds)
    with pytest.raises(InvalidInput), Problems("somewhere") as problems:
        problems.number("a", bad, **bounds)


def test_problems_of_an_inner_check_are_kept_with_those_found_before():
    with pytest.raises(InvalidInput) as caught, Problems("outer") as problems:
        problems.add("a", "x", "y")
        raise InvalidInput("inner", ["b: expected c, got d"])
    assert caught.value.problems == ("a: expected x, got 'y'", "b: expected c, got d")


def test_other_exceptions_pass_through_untouched():
    with pytest.raises(ZeroDivisionError), Problems("outer") as problems:
        problems.add("a", "x", "y")
        raise ZeroDivisionError


def test_bad_input_errors_are_value_errors_and_a_missing_extra_names_itself():
    assert issubclass(InvalidInput, ValueError)
    assert issubclass(UnreadableFile, ValueError)
    error = MissingExtra("reading instrument files", "SurfaceTopography", "io")
    assert isinstance(error, ImportError)
    assert "fractalcontact[io]" in str(error)


def test_a_sequence_of_unlike_rows_is_refused_in_words():
    with pytest.raises(InvalidInput) as caught, Problems("somewhere") as problems:
        problems.number("young", [1.0, [2.0]])
        problems.numbers("loads", [1.0, [2.0]])
        problems.choices("keep", ["gap", ["state"]], ("gap", "state"))
    told = "\n".join(caught.value.problems)
    assert all(f"{name}: expected" in told for name in ("young", "loads", "keep"))


def every_kind(base):
    return [base, *(kind for derived in base.__subclasses__() for kind in every_kind(derived))]


TOLD = {  # what the others are told is a message
    InvalidInput: ("somewhere", ["young: expected a number > 0, got -3", "poisson: missing"]),
    UnreadableFile: ("faces.xyz", ["no heights"]),
    MissingExtra: ("a study on several workers", "dask.distributed", "dask"),
}
RAISED = [
    kind
    for base in (errors.FractalContactError, errors.FractalContactWarning)
    for kind in every_kind(base)
    if kind.__module__ == errors.__name__
]


@pytest.mark.parametrize("kind", RAISED)
def test_an_error_arrives_from_another_process_as_it_was_raised(kind):
    error = kind(*TOLD.get(kind, ("what is wrong",)))
    arrived = pickle.loads(pickle.dumps(error))
    assert type(arrived) is kind
    assert str(arrived) == str(error) != ""
    assert arrived.args == error.args
    assert vars(arrived) == vars(error)


def test_a_rehearsed_call_goes_as_far_as_its_checks():
    reached = []

    def call(value):
        with Problems("call") as problems:
            with Problems("inside") as inner:
                inner.number("value", value, above=0)
            problems.number("value", value, below=10)
        reached.append(value)

    rehearse(call, 1.0)
    for wrong in (-1.0, 11.0):
        with pytest.raises(InvalidInput, match="value"):
            rehearse(call, wrong)
    assert not reached
    call(2.0)
    assert reached == [2.0]
