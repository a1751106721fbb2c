"""`validate` of every public function: the checks of a call, without its computation."""

import re
from time import process_time

import numpy as np
import pytest
from calls import CALLS

import fractalcontact as fc

S = 8e-5

INVALID = {
    "delta_surface": ({"shear": 1.0, "direction": "Q"}, ["direction"]),
    "closure": (
        {"shear": 1.0, "normal_force": -1.0, "keep": "gaps", "bulk": "none", "method": "slow"},
        ["at most 0.00192 m towards E", "normal_force", "keep", "bulk", "method"],
    ),
    "dilatancy": (
        {"shear": S, "normal_force": 1e9, "hardness": 1e9, "normal_stiffness": 0.0},
        ["normal_force: expected a force of at most hardness times area", "normal_stiffness"],
    ),
    "delta_dimension": ({"shear": [S, S], "window": (2.0, 1.0)}, ["shear", "window"]),
    "decorrelation_length": ({"shear": [S, 2 * S]}, ["ascending from 0"]),
}


@pytest.mark.parametrize("name", INVALID)
def test_validate_reports_all_problems_of_a_call(crack, name):
    arguments, problems = INVALID[name]
    function = getattr(fc.joints, name)
    with pytest.raises(fc.base.errors.InvalidInput) as caught:
        function.validate(crack, **arguments)
    assert caught.value.where == f"fractalcontact.joints.{name}"
    assert len(caught.value.problems) == len(problems)
    for problem in problems:
        assert problem in str(caught.value)
    with pytest.raises(fc.base.errors.InvalidInput) as called:
        function(crack, **arguments)
    assert called.value.problems == caught.value.problems


def test_validate_accepts_a_call_and_computes_nothing(crack, make_face, teeth):
    large = fc.joints.Crack(make_face(np.eye(1024), S), young=3e10, poisson=0.2, block=900 * S)
    start = process_time()
    load = {"shear": S * np.arange(9), "normal_force": [1.0, 2.0], "hardness": 1e9}
    fc.joints.closure.validate(large, keep=("gap",), **load)  # nine times 1.6 s to compute
    assert process_time() - start < 1.0
    fc.joints.dilatancy.validate(crack, shear=S, normal_force=1.0, normal_stiffness=1e9)
    fc.joints.decorrelation_length.validate(crack)
    fc.joints.friction.validate(teeth, nominal_pressure=1e6)
    face = make_face(np.zeros((20, 20)), S)
    fc.joints.register.validate(face, face)
    fc.joints.transmissivity.validate(face)
    fc.joints.roughness_coefficient.validate(face, lag=S)


@pytest.mark.parametrize(
    ("name", "argument"),
    [
        ("strength_envelope", "criterion"),
        ("roughness_coefficient", "regression"),
        ("hydraulic_aperture", "model"),
        ("friction", "form"),
        ("closure", "bulk"),
        ("closure", "keep"),
        ("partial_slip", "keep"),
        ("direct_shear", "keep"),
        ("transmissivity", "keep"),
        ("register", "turn_upper"),
    ],
)
def test_docstring_names_every_word_that_is_accepted(name, argument):
    function = getattr(fc.joints, name)
    with pytest.raises(fc.base.errors.InvalidInput) as caught:
        function.validate(**(CALLS[f"joints.{name}"]() | {argument: "nothing"}))
    message = next(line for line in caught.value.problems if line.startswith(f"{argument}: expected"))
    words = re.findall(r"'(\w+)'", message.partition(", got ")[0])
    assert len(words) > 1
    assert [word for word in words if f'"{word}"' not in function.__doc__] == []
