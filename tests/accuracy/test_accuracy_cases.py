"""The catalogue of extremes, run against every room; and the invariances that hold for all of it."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.accuracy.catalogue import NOT_DEFINED, REFUSED, Case
from fractalcontact.base.errors import InvalidInput

CASES = fc.accuracy.cases
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


def scaled(array, power):
    factor = 2.0**power
    axes = {}
    for dim in ("y", "x"):
        attributes = {
            key: value * factor if key == "period" else value for key, value in array[dim].attrs.items()
        }
        axes[dim] = (dim, array[dim].values * factor, attributes)
    return array.assign_coords(axes).copy(data=array.values * factor)


def numbers(result, names):
    return [np.asarray(result[name].values) for name in names if name in result]


@pytest.mark.parametrize("case", SURFACES, ids=lambda case: case.name)
@pytest.mark.parametrize("power", [-20, 13])
def test_units_by_powers_of_two_change_no_bit_but_the_exponent(case, power):
    face = case.make()
    other = scaled(face, power)
    for function, pure in (
        (fc.surfaces.describe, ("rms_slope", "skewness", "kurtosis", "nayak_parameter")),
        (fc.dimensions.estimate, ("hurst", "standard_error")),
    ):
        try:
            ours = function(face)
        except InvalidInput:
            with pytest.raises(InvalidInput):
                function(other)
            continue
        for one, two in zip(numbers(ours, pure), numbers(function(other), pure), strict=True):
            np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize("case", SURFACES, ids=lambda case: case.name)
def test_contact_does_not_depend_on_units(case):
    face = case.make()
    if not np.isfinite(face.values).all():
        pytest.skip("refused, see the catalogue")
    area = face.size * float(face.x[1] - face.x[0]) * float(face.y[1] - face.y[0])
    force = 1e-3 * 2.0**30 * area
    options = {"influence": "square", "boundary": "free", "keep": ("state", "pressure")}
    ours = fc.contact.press(face, contact_modulus=2.0**30, normal_force=force, **options)
    theirs = fc.contact.press(
        scaled(face, 7), contact_modulus=2.0**50, normal_force=force * 2.0**34, **options
    )
    np.testing.assert_array_equal(ours["state"], theirs["state"])
    np.testing.assert_array_equal(ours["pressure"] * 2.0**20, theirs["pressure"])
    np.testing.assert_array_equal(ours["closure"] * 2.0**7, theirs["closure"])


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
