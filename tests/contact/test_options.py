"""Options and load paths: valid ones, their keywords, and what is refused, with all problems at once."""

import dataclasses
import json

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.grid import read_grid
from fractalcontact.contact.solver import ContactOptions, LoadPath, solve

MODULUS = 1e9


def rough(n=24):
    return fc.surfaces.spectral((n, n), 1e-4, hurst=0.8, rms_height=1e-5, rng=1)


def free(n=24):
    return fc.surfaces.from_array(rough(n).values, 1e-4)


def test_solver_on_arrays_is_press():
    given = {"influence": "square", "tolerance": 1e-10, "hardness": 5e8}
    labelled = fc.contact.press(
        free(), contact_modulus=MODULUS, nominal_pressure=[1e6, 2e6], include="stiffness", **given
    )
    load = LoadPath("nominal_pressure", [1e6, 2e6])
    pressed = solve(
        free().values,
        read_grid(free()),
        MODULUS,
        ContactOptions(**given),
        load,
        keep=("state",),
        include=("stiffness",),
    )
    for name in ("closure", "contact_stiffness", "plastic_work", "contact_fraction"):
        np.testing.assert_array_equal(pressed.columns[name], labelled[name])
    np.testing.assert_array_equal(pressed.maps["state"], labelled["state"])


def test_options_are_frozen_and_comparable():
    options = ContactOptions(tolerance=1e-6)
    assert options == ContactOptions(tolerance=1e-6)
    assert hash(options) != hash(ContactOptions())
    with pytest.raises(dataclasses.FrozenInstanceError):
        options.tolerance = 1.0


def test_options_list_all_problems():
    with pytest.raises(InvalidInput) as caught:
        ContactOptions("open", "disk", -1.0, 0.0, 2.0, "slow")
    for word in ("boundary", "did you mean 'disc'", "disc_radius", "hardness", "tolerance", "method"):
        assert word in str(caught.value)
    with pytest.raises(InvalidInput, match="hardness: expected None with method='elimination'"):
        ContactOptions(hardness=1e6, method="elimination")


@pytest.mark.parametrize("values", [-1.0, np.nan, [], "x", None, [[1.0]]])
def test_load_path_refuses_bad_values(values):
    with pytest.raises(InvalidInput, match="closure"):
        LoadPath("closure", values)


def test_load_path_among_arguments():
    path = LoadPath.among({"closure": None, "normal_force": np.array([1.0, 2.0]), "hardness": 2.0})
    assert path == LoadPath("normal_force", [1, 2])
    for loads in ({"closure": None, "normal_force": None}, {"closure": 1.0, "normal_force": 2.0}):
        with pytest.raises(InvalidInput, match="closure / normal_force: expected exactly one"):
            LoadPath.among(loads)


def test_nominal_pressure_becomes_force():
    control, values = LoadPath("nominal_pressure", [1.0, 4.0]).solver_values(2.5)
    assert control == "normal_force"
    np.testing.assert_array_equal(values, [2.5, 10.0])
    assert LoadPath("closure", 1.0).solver_values(2.5)[0] == "closure"


def test_validate_raises_as_the_call_does():
    fc.contact.press.validate(free(), contact_modulus=MODULUS, closure=1e-6)
    with pytest.raises(InvalidInput, match="influence"):
        fc.contact.press.validate(rough(), contact_modulus=MODULUS, closure=1e-6, influence="square")


@pytest.mark.parametrize(
    ("factor", "modulus", "product"),
    [(1e-95, 1e-200, r"modulus .* = .*e-29\d Pa"), (1e95, 1e200, r"modulus .* = .*e\+29\d Pa")],
)
def test_extreme_heights_are_refused(factor, modulus, product):
    surface = fc.surfaces.from_array(factor * np.eye(8), 1e-3)
    with pytest.raises(InvalidInput, match=f"surface / contact_modulus: .* double.* got {product}"):
        fc.contact.press(surface, contact_modulus=modulus, closure=0.1 * factor)


@pytest.mark.parametrize(
    ("radius", "ratio"),
    [("equal_area", 1.0), ("inscribed", 3.0), ("second_order", 3.0), ("equal_area", 3.0), (0.5e-3, 1.0)],
)
def test_plate_radius_is_checked(radius, ratio):
    surface = fc.surfaces.from_array(np.eye(8), (1e-3, 1e-3 * ratio))
    if (ratio == 1.0 and radius == "equal_area") or radius == "inscribed":
        assert bool(
            fc.contact.press(surface, contact_modulus=1.0, closure=0.1, disc_radius=radius)["converged"].all()
        )
        return
    with pytest.raises(InvalidInput, match="square|disc_radius"):
        fc.contact.press(surface, contact_modulus=1.0, closure=0.1, disc_radius=radius)


def test_mixed_periodicity_needs_free_boundary():
    heights = 1e-6 * np.random.default_rng(1).normal(size=(9, 12))
    surface = fc.surfaces.from_array(heights, (1e-4, 2e-4), periodic=True)
    crop = surface.isel(x=slice(0, 8))
    with pytest.raises(InvalidInput, match="'free'"):
        fc.contact.press(crop, contact_modulus=1e9, nominal_pressure=1e5)
    result = fc.contact.press(crop, contact_modulus=1e9, nominal_pressure=1e5, boundary="free")
    assert json.loads(result.attrs["provenance"])["boundary"] == "free"


def test_bad_surfaces_are_refused():
    good = np.zeros((5, 5))
    bad = good.copy()
    bad[2, 2] = np.nan
    for heights, word in ((bad, "fill"), (good[:2], "at least 3")):
        with pytest.raises(InvalidInput, match=word):
            fc.contact.press(fc.surfaces.from_array(heights, 1.0), contact_modulus=1.0, closure=0.1)
    with pytest.raises(InvalidInput, match="DataArray"):
        fc.contact.press(good, contact_modulus=1.0, closure=0.1)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"contact_modulus": -1, "closure": 1e-6, "normal_force": 2.0}, ("contact_modulus", "exactly one")),
        ({"contact_modulus": 1e9}, ("exactly one",)),
        ({"contact_modulus": 1e9, "closure": -1e-6}, ("closure",)),
        ({"contact_modulus": 1e9, "closure": np.nan}, ("closure",)),
        (
            {"contact_modulus": 1e9, "closure": 1e-6, "boundary": "periodic", "influence": "disc"},
            ("spectral",),
        ),
        (
            {"contact_modulus": 1e9, "closure": 1e-6, "method": "slow", "tolerance": 2.0},
            ("method", "tolerance"),
        ),
        ({"contact_modulus": 1e9, "closure": 1e-6, "keep": ("colour",)}, ("colour",)),
    ],
)
def test_all_problems_are_listed(options, words):
    with pytest.raises(InvalidInput) as caught:
        fc.contact.press(rough(16), **options)
    for word in words:
        assert word in str(caught.value)


def test_unknown_boundary_is_one_problem():
    with pytest.raises(InvalidInput, match="1 problem\n") as caught:
        fc.contact.press(free(), contact_modulus=MODULUS, closure=1e-6, boundary="Free")
    assert "'free', 'periodic'" in str(caught.value)


def test_free_surface_refuses_periodic_boundary():
    with pytest.raises(InvalidInput, match="periodic"):
        fc.contact.press(free(), contact_modulus=MODULUS, closure=1e-6, boundary="periodic")
