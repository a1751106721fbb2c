"""One word for one meaning: the arguments of all public functions."""

import importlib
import inspect

import pytest

import fractalcontact as fc

SUBPACKAGES = [name for name in fc.__all__ if name not in ("save", "open")]
# words that had the meaning of `keep`, `include` or `direction`, or of the result that a figure draws
OTHER_WORDS = {"also", "want", "table", "azimuth", "memory", "friction_angle"}
TYPES = {"keep": "str | Sequence[str]", "include": "str | Sequence[str]", "direction": "str | float"}


def arguments(subpackage):
    """Yield function, argument and annotation of all public functions of a subpackage."""
    module = importlib.import_module(f"fractalcontact.{subpackage}")
    for name in module.__all__:
        if inspect.isfunction(function := getattr(module, name)):
            for argument in inspect.signature(function).parameters.values():
                yield name, argument.name, str(argument.annotation)


@pytest.mark.parametrize("subpackage", SUBPACKAGES)
def test_an_argument_has_one_name_and_one_type(subpackage):
    for name, argument, annotation in arguments(subpackage):
        assert argument not in OTHER_WORDS, f"{subpackage}.{name}"
        assert annotation.startswith(TYPES.get(argument, "")), f"{subpackage}.{name}: {argument}"


@pytest.mark.parametrize(
    ("word", "subpackage"),
    [("box_sizes", "domains"), ("scales", "dimensions"), ("sizes", "accuracy")],
    ids=("boxes in cells", "lengths in metres", "points along an edge"),
)
def test_sizes_and_scales_are_of_one_subpackage(word, subpackage):
    having = {each for each in SUBPACKAGES for _, argument, _ in arguments(each) if argument == word}
    assert having == {subpackage}


def test_figures_take_a_result():
    """But for maps, heights, files of a study, and axes that are drawn already."""
    first = {}
    for name, argument, _ in arguments("plotting"):
        first.setdefault(name, argument)
    others = {"curves": "axes", "draw": "tree", "field": "data", "surface": "surface"}
    assert first == dict.fromkeys(first, "result") | others
