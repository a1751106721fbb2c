"""Random problems, checked against the conditions of contact computed independently of the solver.

`pytest -m slow tests/contact/test_press_random_problems.py` runs all of them.
"""

import re
from dataclasses import replace

import numpy as np
import pytest
from contact.cases import displacement_under, draw, judge

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.resources import limit

pytestmark = pytest.mark.filterwarnings("ignore::fractalcontact.base.errors.ConvergenceWarning")
ROUNDED = 1  # stop_reason: the tolerance is beyond what rounding leaves


def verdict(case):
    """What is wrong with the result of a case; a step that stopped at rounding has said why."""
    result = case.press()
    excused = {step for step, why in enumerate(result["stop_reason"].values) if why == ROUNDED}
    return [line for line in judge(case, result) if int(line.split()[1][:-1]) not in excused], len(excused)


# each kind of heights four times, or six
@pytest.mark.parametrize(
    "tens", [pytest.param(tens, marks=[] if tens < 80 else pytest.mark.slow) for tens in range(0, 120, 20)]
)
def test_small_random_problems(tens):
    wrong = {seed: verdict(draw(seed, largest=40))[0] for seed in range(tens, tens + 20)}
    assert {seed: lines for seed, lines in wrong.items() if lines} == {}


HARD = {
    (1187, 128): "a light load far below the hardness",
    (1248, 256): "nodes that change places at one level of the objective",
    (13773, 40): "a flat surface saturated twice",
    (16954, 40): "a force of so many nodes at the hardness and none between",
    (50925, 512): "a body four thousand times longer than wide",
}


@pytest.mark.parametrize(("seed", "largest"), HARD)
def test_hard_problems(seed, largest):
    assert verdict(draw(seed, largest)) == ([], 0), HARD[seed, largest]


@pytest.mark.slow
@pytest.mark.parametrize("hundred", range(10))
def test_large_random_problems(hundred):
    wrong, excused = {}, 0
    for seed in range(1000 + 70 * hundred, 1070 + 70 * hundred):
        lines, rounded = verdict(draw(seed, largest=512))
        excused += rounded > 0
        if lines:
            wrong[seed] = lines
    assert wrong == {}
    assert excused <= 3


def test_judge_detects_errors():
    rough = (case for case in map(draw, range(60)) if "rough" in case.name)
    case = next(case for case in rough if case.options["tolerance"] < 1e-7)
    result = case.press()
    assert judge(case, result) == []
    for name in ("pressure", "gap", "closure", "normal_force", "elastic_energy"):
        spoilt = result.copy(deep=True)
        spoilt[name] = spoilt[name] * (1 + 1e-3)
        assert judge(case, spoilt), name


@pytest.mark.parametrize("seed", range(200, 224))
def test_random_problems_in_binary_units(seed):
    case = draw(seed, largest=64)
    metre, pascal = 2.0**-13, 2.0**11
    scale = {
        "closure": metre,
        "normal_force": pascal * metre**2,
        "nominal_pressure": pascal,
        "hardness": pascal,
        "contact_modulus": pascal,
    }
    scaled = {name: case.options[name] * factor for name, factor in scale.items() if name in case.options}
    options = case.options | scaled
    spacing = (case.spacing[0] * metre, case.spacing[1] * metre)
    other = replace(case, heights=case.heights * metre, spacing=spacing, options=options)
    ours, theirs = case.press(), other.press()
    np.testing.assert_array_equal(ours["pressure"] * pascal, theirs["pressure"])
    np.testing.assert_array_equal(ours["gap"] * metre, theirs["gap"])
    np.testing.assert_array_equal(ours["closure"] * metre, theirs["closure"])
    with limit(1):
        np.testing.assert_array_equal(case.press()["pressure"], ours["pressure"])


@pytest.mark.parametrize("seed", range(300, 324))
def test_elimination_matches_fast_on_random_problems(seed):
    case = draw(seed, largest=16)
    case.options.pop("hardness", None)
    case.options["tolerance"] = 1e-12
    fast = case.press()
    paper = case.press(method="elimination")
    sure = fast["stop_reason"].values == 0
    np.testing.assert_allclose(paper["normal_force"][sure], fast["normal_force"][sure], rtol=1e-10)
    for step in np.flatnonzero(sure):
        one, other = fast.isel(step=step), paper.isel(step=step)
        at_rounding = (one["pressure"] <= 1e-10 * one["pressure"].max()) & (
            one["gap"] <= 1e-10 * max(float(one["gap"].max()), float(one["closure"]))
        )
        np.testing.assert_array_equal(one["state"].where(~at_rounding), other["state"].where(~at_rounding))


@pytest.mark.parametrize("seed", range(400, 416))
def test_random_path_steps_match_single_solves(seed):
    case = draw(seed, largest=96)
    case.options.pop("hardness", None)
    control = next(name for name in ("closure", "normal_force", "nominal_pressure") if name in case.options)
    path = case.options[control].max() * np.array([0.03, 0.3, 1.0, 0.31, 1e-3, 1.0])
    tolerance = 1e-10
    along = case.press(**{control: path, "tolerance": tolerance})
    for step in (1, 3, 5):
        alone = case.press(**{control: path[step], "tolerance": tolerance})
        scale = float(alone["pressure"].max())
        p, q = along["pressure"].values[step], alone["pressure"].values[0]
        assert np.abs(p - q).max() <= 1e-4 * scale
        radius = float(along["disc_radius"]) if "disc_radius" in along else 0.0
        energy = np.sum((p - q) * displacement_under(case, p - q, radius))
        work = np.sum(q * displacement_under(case, q, radius))
        assert energy <= 4 * tolerance * work + 1e-13 * scale * np.abs(p).sum()
        assert float(along["normal_force"][step]) == pytest.approx(float(alone["normal_force"][0]), rel=1e-6)


def test_residual_bounds_pressure_error():
    """The energy of the error is within its bound; the relative error is about the residual."""
    ratios = []
    for seed in range(500, 520):
        case = draw(seed, largest=40)
        case.options.pop("hardness", None)
        control = next(
            name for name in ("closure", "normal_force", "nominal_pressure") if name in case.options
        )
        load = {control: case.options[control].max()}
        exact = case.press(**load, tolerance=1e-13)
        radius, q = float(exact.get("disc_radius", 0.0)), exact["pressure"].values[0]
        for tolerance in (0.3, 1e-2, 1e-4, 1e-6):
            result = case.press(**load, tolerance=tolerance)
            p, residual = result["pressure"].values[0], float(result["residual"][0])
            if residual < 1e-12:
                continue
            local = p.mean() * np.sqrt(np.prod(case.spacing)) / case.options["contact_modulus"]
            scale = max(np.sum(p * displacement_under(case, p, radius)) / p.sum(), local)
            energy = np.sum((p - q) * displacement_under(case, p - q, radius))
            assert energy <= residual * scale * max(p.sum(), q.sum()) * (1 + 1e-9)
            if residual < 1e-3:
                ratios.append(np.linalg.norm(p - q) / np.linalg.norm(q) / residual)
    assert len(ratios) > 15
    assert np.median(ratios) < 3
    assert max(ratios) < 50


@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize("control", ["closure", "normal_force", "nominal_pressure"])
@pytest.mark.parametrize("hardness", [None, 1e6])
def test_extreme_loads_are_solved_or_refused(periodic, control, hardness):
    surface = fc.surfaces.from_array(
        1e-6 * np.random.default_rng(3).normal(size=(100, 100)), 1e-4, periodic=periodic
    )
    refused = {}
    for value in (5e-324, 1e-300, 1e-200, 1e-100, 1e-60, 1e-40, 1e-25, 1e25, 1e40, 1e60, 1e100, 1e200, 1e308):
        try:
            result = fc.contact.press(
                surface, contact_modulus=1e9, hardness=hardness, keep=("pressure",), **{control: value}
            )
        except InvalidInput as error:
            refused[value] = str(error)
            continue
        if int(result["stop_reason"][0]) == 5:
            assert periodic
            assert control == "closure"
            continue
        assert float(result["normal_force"][0]) == pytest.approx(
            float(result["pressure"].sum()) * 1e-8, rel=1e-9
        )
        assert float(result[control][0]) == pytest.approx(value, rel=1e-13)
    for value, words in refused.items():
        assert re.search(f"{control}: expected (0 or between|a (force|pressure) of at most)", words)
        assert not 1e-60 <= value <= 1e60 or "hardness" in words
