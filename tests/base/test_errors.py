"""Errors: they are ValueErrors or ImportErrors, and survive pickling."""

import pickle

import pytest

from fractalcontact.base import errors
from fractalcontact.base.errors import InvalidInput, MissingExtra, UnreadableFile


def test_base_classes_and_message_of_a_missing_extra():
    assert issubclass(InvalidInput, ValueError)
    assert issubclass(UnreadableFile, ValueError)
    error = MissingExtra("reading instrument files", "SurfaceTopography", "io")
    assert isinstance(error, ImportError)
    assert "fractalcontact[io]" in str(error)


def subclasses(base):
    return [base, *(error for derived in base.__subclasses__() for error in subclasses(derived))]


ARGUMENTS = {  # the others take a message
    InvalidInput: ("somewhere", ["young: expected a number > 0, got -3", "poisson: missing"]),
    errors.TooLittleMemory: ("somewhere", ["memory: expected at most 1 GiB"]),
    UnreadableFile: ("faces.xyz", ["no heights"]),
    MissingExtra: ("a study on several workers", "dask.distributed", "dask"),
}
ERRORS = [
    error_type
    for base in (errors.FractalContactError, errors.FractalContactWarning)
    for error_type in subclasses(base)
    if error_type.__module__ == errors.__name__
]


@pytest.mark.parametrize("error_type", ERRORS)
def test_errors_survive_pickling(error_type):
    error = error_type(*ARGUMENTS.get(error_type, ("what is wrong",)))
    restored = pickle.loads(pickle.dumps(error))
    assert type(restored) is error_type
    assert str(restored) == str(error) != ""
    assert restored.args == error.args
    assert vars(restored) == vars(error)
