"""The catalogue of extreme cases, run on every subpackage; and the invariances that hold for all of it."""

import numpy as np
import pytest
import xarray as xr
from extreme_cases import Case, cases
from extreme_examination import examine
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import fractalcontact as fc

CASES = {name: case for name, case in cases.items() if not case.large}
SURFACES = [case for case in CASES.values() if case.input_type == "surface"]
MASKS = [case for case in CASES.values() if case.input_type == "mask"]


def failed(case, only=""):
    return [result for result in examine(case, only) if not result.passed]


# the heights are those of "E* = 1 Pa": what does not take a modulus would see the same input again
OTHER_MODULI = "E* = 1e-6 Pa", "E* = 1e15 Pa"
TAKE_A_MODULUS = "contact.", "joints."


@pytest.mark.parametrize("name", list(CASES))
def test_case_gives_the_expected_values(name):
    parts = TAKE_A_MODULUS if name in OTHER_MODULI else ("",)
    wrong = [result for part in parts for result in failed(CASES[name], part)]
    assert not wrong, "\n".join(map(str, wrong))


def test_wrong_expectations_fail():
    flat = CASES["flat"]
    expected = {
        "surfaces.describe.rms_height": 1.0,
        "contact.press.contact_fraction": (0.0, 0.5),
        "contact.press.closure": "not defined",
        "joints.dilatancy.rigid_dilatancy": "refused",
        "contact.press.colour": 1.0,
        "contact.paint.colour": 1.0,
    }
    wrong = failed(Case("wrong", "wrong on purpose", "surface", flat.make, expected))
    assert {result.name for result in wrong} == set(expected)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, case in cases.items() if case.large])
def test_large_case_gives_the_expected_values(name):
    wrong = failed(cases[name])
    assert not wrong, "\n".join(map(str, wrong))


def test_error_is_the_distance_from_the_expected_value():
    def make():
        return xr.Dataset({"area": 3.0, "wide": 5.0, "gone": np.nan}, attrs={"reason": "given"})

    expected = {"part.call.area": 2.0, "part.call.wide": (1.0, 4.0), "part.call.gone": "not defined"}
    results = {r.name: r for r in examine(Case("by hand", "", "call", make, expected))}
    assert results["part.call.area"].error == 0.5
    assert results["part.call.wide"].error == 1.0
    assert [result.passed for result in results.values()] == [False, False, True, True]


def off_by(factor, function, variable):
    """Return a function whose result has one variable wrong by a factor."""

    def wrong(*arguments, **options):
        result = function(*arguments, **options)
        return result.assign({variable: (result[variable] * factor).assign_attrs(result[variable].attrs)})

    return wrong


PRESSES = "n = 3", "prime", "strip", "spacings 1:100", "E* = 1e-6 Pa", "slope 10", "offset 1e9", "one spike"
ISLANDS = "carpet", "a strip", "three by three", "a mask of one cell"
FAULTS = (
    (PRESSES, "contact", "press", ("closure", "gap", "pressure")),
    (("H = 0.01", "nanometres", "islands of NaN"), "surfaces", "describe", ("rms_height",)),
    (("plane", "mountains"), "joints", "dilatancy", ("rigid_dilatancy",)),
    (ISLANDS, "domains", "islands", ("n_islands",)),
    (("independent cells", "three by three", "all but one"), "domains", "lacunarity", ("lacunarity",)),
)


@pytest.mark.parametrize(
    ("case", "subpackage", "function", "variable"),
    [(case, *place, name) for cases, *place, variables in FAULTS for case in cases for name in variables],
)
def test_wrong_function_is_detected(case, subpackage, function, variable, monkeypatch):
    module = getattr(fc, subpackage)
    factor = 2 if variable == "n_islands" else 1.0001
    monkeypatch.setattr(module, function, off_by(factor, getattr(module, function), variable))
    assert failed(CASES[case], f"{subpackage}.{function}")


def test_dependence_on_units_is_detected(monkeypatch):
    original = fc.surfaces.describe

    def absolute(surface):
        result = original(surface)
        return result.assign(rms_height=(result["rms_height"] + 1e-12).assign_attrs(units="m"))

    monkeypatch.setattr(fc.surfaces, "describe", absolute)
    wrong = {result.name for result in failed(CASES["prime"], "surfaces.describe")}
    assert "surfaces.describe.dependence_on_units" in wrong


@pytest.mark.parametrize("case", MASKS, ids=lambda case: case.name)
def test_transposed_mask_has_the_same_numbers(case):
    mask = case.make()
    transposed = mask.transpose("x", "y").rename(x="y", y="x")
    for function, names in (
        (fc.domains.islands, ("n_islands",)),
        (fc.domains.lacunarity, ("lacunarity",)),
        (fc.domains.box_dimension, ("box_dimension", "box_count")),
    ):
        result, other = function(mask), function(transposed)
        for name in names:
            if name in result:
                np.testing.assert_allclose(result[name].values, other[name].values, rtol=1e-12)


PRESSED = [case for case in SURFACES if np.isfinite(case.make().values).all() and case.make().size <= 4096]


@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    case=st.sampled_from(PRESSED),
    share=st.floats(-6.0, 0.0),
    turns=st.integers(0, 3),
    power=st.integers(-30, 30),
)
def test_closure_is_independent_of_orientation_and_units(case, share, turns, power):
    """The closure of a surface is that of the surface turned by right angles, in any unit, at any load."""
    surface = case.make()
    spacing = [float(surface[dim][1] - surface[dim][0]) for dim in ("y", "x")]
    force = 10.0**share * case.modulus * spacing[0] * spacing[1] * surface.size
    turned_spacing = spacing if turns % 2 == 0 else spacing[::-1]
    turned = fc.surfaces.from_array(
        np.ldexp(np.rot90(surface.values, turns), power), [step * 2.0**power for step in turned_spacing]
    )
    options = {"influence": "square", "boundary": "free", "keep": (), "tolerance": 1e-10}
    pressed = fc.contact.press(surface, contact_modulus=case.modulus, normal_force=force, **options)
    other = fc.contact.press(turned, contact_modulus=case.modulus, normal_force=force * 4.0**power, **options)
    assert pressed["converged"].all()
    assert other["converged"].all()
    scale = max(float(np.ptp(surface.values)), pressed["closure"].item())
    # beyond what the offset of the heights rounds away
    rounding = 4 * np.spacing(np.abs(surface.values).max())
    difference = abs(other["closure"].item() / 2.0**power - pressed["closure"].item())
    assert difference <= 1e-4 * scale + rounding
