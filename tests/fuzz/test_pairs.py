"""Two faults at once: the error names both, wherever each of them alone is named."""

import inspect
import re
import warnings

import matplotlib.pyplot as plt
import numpy as np
import pytest
from calls import CALLS, REFUSED, function_of, rough
from fuzz_scenes import SCENES, toml_of
from fuzz_values import VALUES

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput

WRONG = ("object", "minus infinity", "word", "list of dicts")
WRONG_IN_SCENES = (-1, "wrong word", [], {"a": 1})


def problems_of(call):
    """Return the lines of the error of a call; none where it succeeds."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            call()
    except InvalidInput as error:
        return error.problems
    finally:
        plt.close("all")
    return ()


def names(lines, word):
    return any(re.search(rf"\b{re.escape(word)}\b", line) for line in lines)


@pytest.mark.parametrize("name", sorted(set(CALLS) - set(REFUSED)))
def test_two_wrong_arguments_are_both_named(name):
    arguments, alone = CALLS[name](), {}

    def problems(**changes):
        return problems_of(lambda: function_of(name)(**(arguments | changes)))

    for argument, parameter in inspect.signature(function_of(name)).parameters.items():
        if parameter.kind is parameter.VAR_KEYWORD:
            continue
        values = (VALUES[word]() for word in WRONG)
        wrong = (value for value in values if names(problems(**{argument: value}), argument))
        for value in wrong:
            alone[argument] = value
            break
    hidden = []
    for number, first in enumerate(alone):
        for second in list(alone)[number + 1 :]:
            lines = problems(**{first: alone[first], second: alone[second]})
            hidden += [(first, second)] if not (names(lines, first) and names(lines, second)) else []
    assert hidden == []


def places(tables):
    """Yield the path of every value of a scene."""
    for key, value in tables.items():
        if isinstance(value, dict):
            yield from ((key, *rest) for rest in places(value))
        else:
            yield (key,)


def changed(tables, place, value):
    key, *rest = place
    return tables | {key: changed(tables[key], rest, value) if rest else value}


@pytest.mark.parametrize("share", [48, pytest.param(8, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", SCENES)
def test_two_wrong_values_of_a_scene_are_both_named(tmp_path, name, share):
    """Of the pairs of a scene one in so many; all values are tried alone."""
    np.save(tmp_path / "scan.npy", rough().values * 1e6)

    def problems(tables):
        (tmp_path / "study.toml").write_text(toml_of(tables), encoding="utf-8")
        return problems_of(lambda: fc.scenes.validate(tmp_path / "study.toml"))

    alone = {}
    for place in places(SCENES[name]):
        for value in WRONG_IN_SCENES:
            if names(problems(changed(SCENES[name], place, value)), place[-1]):
                alone[place] = value
                break
    pairs = [(first, second) for n, first in enumerate(alone) for second in list(alone)[n + 1 :]]
    hidden = []
    for first, second in pairs[::share]:
        both = changed(changed(SCENES[name], first, alone[first]), second, alone[second])
        lines = problems(both)
        if not (names(lines, first[-1]) and names(lines, second[-1])):
            hidden.append((first, second))
    assert hidden == []
