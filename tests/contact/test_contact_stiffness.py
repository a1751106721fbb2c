"""Stiffness, conductance and distribution of pressures from `press`: Hertz, Holm, Barber, Persson."""

import math

import numpy as np
import pytest

import fractalcontact as fc

MODULUS = 1e9
SPACING = 1e-4
X = SPACING * np.arange(-40, 41)
SQUARE = X**2 + X[:, None] ** 2


def ball(radius=1.0, roughness=0.0):
    noise = roughness * np.random.default_rng(5).random(SQUARE.shape)
    return fc.surfaces.from_array(-SQUARE / (2 * radius) - noise, SPACING)


def wavy(shape=(64, 64), **options):
    given = {"hurst": 0.8, "rms_slope": 0.1, "short_cutoff": 8e-4, "rolloff": 3.2e-3, "rng": 3}
    return fc.surfaces.spectral(shape, SPACING, **(given | options))


def press(surface, **options):
    return fc.contact.press(surface, contact_modulus=MODULUS, **options)


def total(pressed, name):
    return pressed[name].values * float(pressed["nominal_area"])


def test_ball_has_the_stiffness_of_hertz_and_the_conductance_of_holm():
    closure = np.array([1e-6, 2e-6, 4e-6])
    pressed = press(ball(), closure=closure, include=["stiffness"])
    radius = np.sqrt(closure)  # of the contact, in closed form, for a ball of radius 1 m
    np.testing.assert_allclose(total(pressed, "contact_stiffness"), 2 * radius * MODULUS, rtol=0.02)
    resistivities = 2e-8 + 5e-8
    conductance = total(pressed, "relative_conductance") * 2 / resistivities
    np.testing.assert_allclose(conductance, 4 * radius / resistivities, rtol=0.02)  # Holm


@pytest.mark.parametrize("method", ["fast", "elimination"])
@pytest.mark.parametrize("periodic", [True, False])
def test_stiffness_is_the_derivative_of_the_force_by_the_closure(periodic, method):
    heights = wavy((32, 32)).values
    surface = fc.surfaces.from_array(heights, SPACING, periodic=periodic)
    top = heights.max() - heights.mean()
    step = 1e-5 * top
    middle = 0.6 * top
    options = {"closure": [middle - step, middle, middle + step], "method": method, "tolerance": 1e-11}
    pressed = press(surface, include="stiffness", **options)
    force = pressed["nominal_pressure"].values
    slope = (force[2] - force[0]) / (2 * step)
    assert float(pressed["contact_stiffness"][1]) == pytest.approx(slope, rel=2e-4)


def test_stiffness_of_unloading_where_cells_have_yielded():
    surface = wavy((32, 32))
    options = {"hardness": 0.06 * MODULUS, "tolerance": 1e-10, "include": "stiffness"}
    pressed = press(surface, nominal_pressure=[1e7, 1e7 - 1e3], **options)
    assert int((press(surface, nominal_pressure=1e7, hardness=0.06 * MODULUS)["state"] == 2).sum()) > 20
    secant = 1e3 / float(pressed["closure"][0] - pressed["closure"][1])
    assert float(pressed["contact_stiffness"][0]) == pytest.approx(secant, rel=2e-3)


def test_bounds_of_barber():
    """The force on a rough ball lies between those on the balls through its highest and its lowest heights.

    As the force is a convex function of the closure, so does its slope lie between those of the chords that
    just reach the two curves (Barber 2003, section 4).
    """
    roughness, closure = 2e-7, 3e-6
    rough = ball(roughness=roughness)
    pressed = press(rough, closure=closure, include="stiffness")
    start = roughness - float((rough.values + SQUARE / 2).max() + roughness)  # depth of the highest point
    force, stiffness = float(pressed["normal_force"][0]), float(total(pressed, "contact_stiffness")[0])

    def highest(w):
        return 4 / 3 * MODULUS * np.maximum(w + start, 0.0) ** 1.5

    def lowest(w):
        return 4 / 3 * MODULUS * np.maximum(w + start - roughness, 0.0) ** 1.5

    below, above = np.linspace(0, 0.999 * closure, 500), np.linspace(1.001 * closure, 9 * closure, 3000)
    assert lowest(closure) * 0.99 < force < highest(closure) * 1.01
    least = np.max((force - highest(below)) / (closure - below))
    most = np.min((highest(above) - force) / (above - closure))
    assert least < stiffness < most
    assert least > 0.6 * stiffness  # the bounds bind
    assert most < 1.6 * stiffness


def test_complete_contact_and_no_contact():
    surface = wavy()
    pressed = press(surface, nominal_pressure=[0.0, 1e7, 1e9], include=["stiffness", "pressure_distribution"])
    stiffness = pressed["contact_stiffness"].values
    assert stiffness[0] == 0
    assert stiffness[1] > 0
    assert np.isnan(stiffness[2])
    assert "complete contact" in pressed["contact_stiffness"].attrs["reason"]
    assert float(pressed["maximum_pressure"][0]) == 0
    assert not pressed["area_share"][0].any()


def test_distribution_on_a_ball_is_that_of_hertz():
    """Area with less than x p0: pi a^2 x^2 of the contact; load: x^3."""
    pressed = press(ball(), closure=4e-6, include="pressure_distribution").isel(step=0)
    assert float(pressed["maximum_pressure"]) == pytest.approx(2 * MODULUS * 2e-3 / math.pi, rel=0.01)
    upper = pressed["pressure_class"].values + 0.01
    area = pressed["area_share"].cumsum().values * float(pressed["nominal_area"])
    # 126 of the 1257 cells are at the edge
    np.testing.assert_allclose(area, math.pi * 4e-6 * upper**2, atol=0.03 * math.pi * 4e-6)
    np.testing.assert_allclose(pressed["load_share"].cumsum(), upper**3, atol=0.02)


def test_distribution_in_complete_contact_is_that_of_persson():
    """A Gaussian surface: the pressure is Gaussian about its mean, with the spread E* g/2."""
    surface = wavy((128, 128), rolloff=1.6e-3)
    slope = math.sqrt(2 * float(fc.contact.theories(surface, contact_modulus=1.0, nominal_pressure=1.0).m2))
    spread, mean = MODULUS * slope / 2, 6 * MODULUS * slope / 2
    pressed = press(surface, nominal_pressure=mean, include="pressure_distribution").isel(step=0)
    assert float(pressed["contact_fraction"]) == 1
    pressure = pressed["pressure_class"].values * float(pressed["maximum_pressure"])
    share = pressed["area_share"].values
    assert share @ pressure == pytest.approx(mean, rel=1e-3)
    assert math.sqrt(share @ (pressure - mean) ** 2) == pytest.approx(spread, rel=0.01)
    edges = pressure + 0.5 * (pressure[1] - pressure[0])
    gaussian = np.array([0.5 * math.erfc((mean - p) / (math.sqrt(2) * spread)) for p in edges])
    np.testing.assert_allclose(np.cumsum(share), gaussian, atol=0.03)


def test_distribution_adds_up_to_the_nominal_pressure_and_the_contact():
    pressed = press(wavy(), nominal_pressure=[1e6, 1e7], include="pressure_distribution", keep="pressure")
    area, classes = pressed["area_share"], pressed["pressure_class"]
    np.testing.assert_allclose(area.sum("pressure_class"), pressed["contact_fraction"], rtol=1e-12)
    np.testing.assert_allclose(pressed["load_share"].sum("pressure_class"), 1.0, rtol=1e-12)
    middle = (area * classes).sum("pressure_class") * pressed["maximum_pressure"]
    bound = 0.01 * pressed["maximum_pressure"] * pressed["contact_fraction"]  # half a class
    assert (np.abs(middle - pressed["nominal_pressure"]) < bound).all()
    np.testing.assert_array_equal(pressed["maximum_pressure"], pressed["pressure"].max(("y", "x")))


def test_nothing_more_is_computed_unless_asked_for():
    surface = wavy()
    plain, more = (press(surface, nominal_pressure=[1e6, 1e7], include=also) for also in ((), ["stiffness"]))
    assert not {"contact_stiffness", "maximum_pressure", "pressure_class"} & set(plain.variables)
    for name in ("closure", "contact_fraction", "transforms", "iterations"):
        np.testing.assert_array_equal(plain[name], more[name])


def test_unknown_word_is_refused():
    with pytest.raises(ValueError, match="include: expected any of"):
        press(wavy(), nominal_pressure=1e6, include="stifness")
