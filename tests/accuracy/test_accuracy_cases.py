"""The catalogue of extremes, run against every room; and the invariances that hold for all of it."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import fractalcontact as fc
from fractalcontact.accuracy.catalogue import NOT_DEFINED, REFUSED, Case
from fractalcontact.accuracy.independent import in_other_units
from fractalcontact.accuracy.reporting import worst_rows

CASES = {name: case for name, case in fc.accuracy.cases.items() if not case.large}
SURFACES = [case for case in CASES.values() if case.kind == "surface"]
MASKS = [case for case in CASES.values() if case.kind == "mask"]


@pytest.mark.parametrize("name", list(CASES))
def test_no_function_is_silently_wrong(name):
    wrong = [one for one in fc.accuracy.examine(CASES[name]) if not one.ok]
    assert not wrong, "\n".join(map(str, wrong))


def test_an_examination_can_fail():
    flat = CASES["flat"]
    expected = {
        "surfaces.describe.rms_height": 1.0,
        "contact.press.contact_fraction": (0.0, 0.5),
        "contact.press.closure": NOT_DEFINED,
        "joints.dilatancy.rigid_dilatancy": REFUSED,
        "contact.press.colour": 1.0,
        "contact.paint.colour": 1.0,
    }
    found = fc.accuracy.examine(Case("wrong", "wrong on purpose", "surface", flat.make, expected))
    assert {one.name for one in found if not one.ok} == set(expected)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name, case in fc.accuracy.cases.items() if case.large])
def test_no_large_case_is_silently_wrong(name):
    wrong = [one for one in fc.accuracy.examine(fc.accuracy.cases[name]) if not one.ok]
    assert not wrong, "\n".join(map(str, wrong))


def test_the_error_is_the_distance_from_what_is_expected():
    def make():
        return xr.Dataset({"area": 3.0, "wide": 5.0, "gone": np.nan}, attrs={"reason": "told"})

    expected = {"room.call.area": 2.0, "room.call.wide": (1.0, 4.0), "room.call.gone": NOT_DEFINED}
    found = {one.name: one for one in fc.accuracy.examine(Case("by hand", "", "call", make, expected))}
    assert found["room.call.area"].error == 0.5
    assert found["room.call.wide"].error == 1.0
    assert [one.ok for one in found.values()] == [False, False, True, True]
    (_, row) = worst_rows({"by hand": list(found.values())})
    assert row[1] == "room.call.wide"
    assert row[3].startswith("FAILED")


def broken(function, name, factor):
    """Return a function whose result has one variable off by a factor."""

    def other(*arguments, **options):
        result = function(*arguments, **options)
        return result.assign({name: (result[name] * factor).assign_attrs(result[name].attrs)})

    return other


PRESSES = "n = 3", "prime", "strip", "spacings 1:100", "E* = 1e-6 Pa", "slope 10", "offset 1e9", "one spike"
BREAKS = (
    (PRESSES, "contact", "press", ("closure", "gap", "pressure")),
    (("H = 0.01", "nanometres", "islands of NaN"), "surfaces", "describe", ("rms_height",)),
    (("plane", "mountains"), "joints", "dilatancy", ("rigid_dilatancy",)),
    (("carpet", "a strip", "three by three", "a mask of one cell"), "domains", "islands", ("n_islands",)),
    (("dust", "three by three", "all but one"), "domains", "lacunarity", ("lacunarity",)),
)


@pytest.mark.parametrize(
    ("case", "room", "function", "variable"),
    [(case, *place, one) for cases, *place, variables in BREAKS for case in cases for one in variables],
)
def test_a_broken_function_is_found_out(case, room, function, variable, monkeypatch):
    house = getattr(fc, room)
    factor = 2 if variable == "n_islands" else 1.0001
    monkeypatch.setattr(house, function, broken(getattr(house, function), variable, factor))
    assert not all(one.ok for one in fc.accuracy.examine(CASES[case]))


def test_a_result_that_depends_on_units_is_found_out(monkeypatch):
    original = fc.surfaces.describe

    def absolute(surface):
        result = original(surface)
        return result.assign(rms_height=(result["rms_height"] + 1e-12).assign_attrs(units="m"))

    monkeypatch.setattr(fc.surfaces, "describe", absolute)
    wrong = {one.name for one in fc.accuracy.examine(CASES["prime"]) if not one.ok}
    assert "surfaces.describe.dependence_on_units" in wrong


def numbers(result, names):
    return [np.asarray(result[name].values) for name in names if name in result]


@pytest.mark.parametrize("case", MASKS, ids=lambda case: case.name)
def test_a_turned_mask_has_the_same_numbers(case):
    mask = case.make()
    turned = mask.transpose("x", "y").rename(x="y", y="x")
    for function, names in (
        (fc.domains.islands, ("n_islands",)),
        (fc.domains.lacunarity, ("lacunarity",)),
        (fc.domains.box_dimension, ("box_dimension", "box_count")),
    ):
        ours, theirs = (numbers(function(one), names) for one in (mask, turned))
        for one, two in zip(ours, theirs, strict=True):
            np.testing.assert_allclose(one, two, rtol=1e-12)


PRESSED = [case for case in SURFACES if np.isfinite(case.make().values).all() and case.make().size <= 4096]


@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(
    case=st.sampled_from(PRESSED),
    share=st.floats(-6.0, 0.0),
    turn=st.integers(0, 3),
    power=st.integers(-30, 30),
)
def test_a_turned_face_at_any_load_and_scale_is_pressed_alike(case, share, turn, power):
    """The closure of a face is that of the turned one, in any unit, at any load."""
    face = case.make()
    steps = [float(face[dim][1] - face[dim][0]) for dim in ("y", "x")]
    force = 10.0**share * case.modulus * steps[0] * steps[1] * face.size
    turned = fc.surfaces.from_array(
        np.rot90(face.values, turn).copy(), steps if turn % 2 == 0 else steps[::-1]
    )
    options = {"influence": "square", "boundary": "free", "keep": (), "tolerance": 1e-10}
    ours = fc.contact.press(face, contact_modulus=case.modulus, normal_force=force, **options)
    theirs = fc.contact.press(
        in_other_units(turned, power),
        contact_modulus=case.modulus,
        normal_force=force * 4.0**power,
        **options,
    )
    assert ours["converged"].all()
    assert theirs["converged"].all()
    scale = max(float(np.ptp(face.values)), ours["closure"].item())
    # beyond what the offset of the heights rounds away
    floor = 4 * np.spacing(np.abs(face.values).max())
    assert abs(theirs["closure"].item() / 2.0**power - ours["closure"].item()) <= 1e-4 * scale + floor
