"""Mean gap, stiffness and pressures: the curves are the values of the result in the unit of the label."""

import math

import numpy as np
import pytest
from plotting_figures import drawn, holds, render

import fractalcontact as fc
from fractalcontact import plotting
from fractalcontact.base.errors import InvalidInput

LOADS = {"contact_modulus": 1e9, "nominal_pressure": [1e6, 1e7, 4e7]}


@pytest.fixture(scope="module")
def surface():
    return fc.surfaces.spectral((32, 32), 1e-5, hurst=0.8, rms_slope=0.1, rng=1)


@pytest.fixture(scope="module")
def pressed(surface):
    return fc.contact.press(surface, also=["stiffness", "pressure_distribution"], **LOADS)


@pytest.fixture(scope="module")
def theory(surface):
    return fc.contact.theories(surface, **LOADS)


def values(ax):
    return [(np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)) for line in ax.lines]


def test_mean_gap_beside_theories(pressed, theory):
    ax = plotting.mean_gap(pressed, theory=theory)
    assert ax.get_ylabel() == "mean gap (µm)"
    curves = values(ax)
    np.testing.assert_allclose(curves[0][1], pressed["mean_gap"] * 1e6)
    np.testing.assert_allclose(curves[1][1], theory["mean_gap"].sel(theory="persson") * 1e6)
    named = [text.get_text() for legend in ax.artists for text in legend.get_texts()]
    assert "Persson" in named
    assert "Hertz" not in named  # gives no gap
    render(ax.figure)


def test_stiffness_in_the_unit_of_practice(pressed, theory):
    ax = plotting.stiffness(pressed, theory=theory)
    curves = values(ax)
    np.testing.assert_allclose(curves[0][0], pressed["nominal_pressure"] / 1e6)
    np.testing.assert_allclose(curves[0][1], pressed["contact_stiffness"] / 1e9)
    np.testing.assert_allclose(curves[1][1], theory["interface_stiffness"].sel(theory="persson") / 1e9)
    render(ax.figure)


def test_stiffness_of_closure_laws(surface):
    crack = fc.joints.Crack(surface, young=1e9, poisson=0.2)
    closed = fc.joints.closure(crack, shear=[5e-5, 1e-4], nominal_pressure=[1e5, 1e6, 3e6, 1e7])
    laws = fc.joints.closure_laws(closed)
    curves = values(plotting.stiffness(laws))
    assert len(curves) == 2
    np.testing.assert_allclose(curves[1][1], laws["stiffness"].isel(shear=1) / 1e9)


def test_distribution_adds_up(pressed, theory):
    ax = plotting.pressure_distribution(pressed, theory=theory)
    curves = values(ax)
    for i, (pressure, density) in enumerate(curves[::2]):
        width = pressure[1] - pressure[0]
        assert density.sum() * width == pytest.approx(float(pressed["contact_fraction"][i]))
    nominal, spread = 40.0, float(theory["pressure_spread"]) / 1e6
    pressure, density = curves[-1]  # Persson: the area is erf(p/(sqrt(2) s))
    tail = 1 - math.erf((pressure[-1] + nominal) / (math.sqrt(2) * spread)) / 1
    area = np.trapezoid(density, pressure)
    assert area == pytest.approx(math.erf(nominal / (math.sqrt(2) * spread)), abs=0.02 + tail)
    render(ax.figure)


def test_curves_are_in_a_figure_of_the_user(pressed):
    from matplotlib.figure import Figure

    sheet = Figure()
    ax = sheet.add_subplot()
    assert plotting.mean_gap(pressed, against="normal_force", ax=ax) is ax
    assert holds(drawn(ax), pressed["normal_force"], pressed["mean_gap"])


@pytest.mark.parametrize("draw", [plotting.mean_gap, plotting.stiffness, plotting.pressure_distribution])
def test_missing_variables_are_named(draw, pressed):
    with pytest.raises(InvalidInput, match="result"):
        draw(pressed[["residual"]])


@pytest.mark.parametrize("chosen", [0, slice(0)])
def test_distribution_without_classes_is_refused(chosen, pressed):
    with pytest.raises(InvalidInput, match="pressure_class"):
        plotting.pressure_distribution(pressed.isel(pressure_class=chosen))


def test_distribution_of_one_class_is_drawn(pressed):
    ((pressure, _), *_) = values(plotting.pressure_distribution(pressed.isel(pressure_class=[-1])))
    greatest = float(pressed["maximum_pressure"][0]) * float(pressed["pressure_class"][-1])
    assert pressure == pytest.approx([greatest / 1e6])
