"""Mean gap, stiffness and pressures: the curves are the values of the result in the unit of the label."""

import math

import numpy as np
import pytest
import xarray as xr
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
    return fc.contact.press(surface, include=["stiffness", "pressure_distribution"], **LOADS)


@pytest.fixture(scope="module")
def theory(surface):
    return fc.contact.theories(surface, **LOADS)


def values(ax):
    return [(np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)) for line in ax.lines]


def test_mean_gap_beside_theories(pressed, theory):
    ax = plotting.path(pressed, "mean_gap", against="nominal_pressure", theory=theory)
    assert ax.get_ylabel() == "mean gap (µm)"
    curves = values(ax)
    np.testing.assert_allclose(curves[0][1], pressed["mean_gap"] * 1e6)
    np.testing.assert_allclose(curves[1][1], theory["mean_gap"].sel(theory="persson") * 1e6)
    named = [text.get_text() for legend in ax.artists for text in legend.get_texts()]
    assert "Persson" in named
    assert "Hertz" not in named  # gives no gap
    render(ax.figure)


def test_point_without_a_neighbour_is_marked(pressed, theory):
    """A theory that holds at one load alone has no line that shows it."""
    first = np.arange(3) == 0
    alone = theory.assign(mean_gap=theory["mean_gap"].where(xr.DataArray(first, dims="step")))
    for result, marker in ((theory, ""), (alone, ".")):
        (line,) = (
            line
            for line in plotting.path(pressed, "mean_gap", theory=result).lines
            if line.get_label() == "Persson"
        )
        assert line.get_marker() == marker
    assert line.get_markevery() == [0]


def test_stiffness_in_the_unit_of_practice(pressed, theory):
    ax = plotting.path(pressed, "contact_stiffness", against="nominal_pressure", theory=theory)
    curves = values(ax)
    np.testing.assert_allclose(curves[0][0], pressed["nominal_pressure"] / 1e6)
    np.testing.assert_allclose(curves[0][1], pressed["contact_stiffness"] / 1e9)
    np.testing.assert_allclose(curves[1][1], theory["interface_stiffness"].sel(theory="persson") / 1e9)
    render(ax.figure)


def test_stiffness_of_closure_laws(surface):
    crack = fc.joints.Crack(surface, young=1e9, poisson=0.2)
    closed = fc.joints.closure(crack, shear=[5e-5, 1e-4], nominal_pressure=[1e5, 1e6, 3e6, 1e7])
    laws = fc.joints.closure_laws(closed)
    curves = values(plotting.path(laws, "stiffness", against="nominal_pressure"))
    assert len(curves) == 2
    np.testing.assert_allclose(curves[1][1], laws["stiffness"].isel(shear=1) / 1e9)


def test_distribution_adds_up(pressed, theory):
    ax = plotting.plot(pressed, "pressure_distribution", theory=theory)
    curves = values(ax)
    for i, (pressure, density) in enumerate(curves[::2]):
        width = pressure[1] - pressure[0]
        assert density.sum() * width == pytest.approx(float(pressed["contact_fraction"][i]))
        first, last = ax.collections[i].get_segments()  # outer halves of the classes at both ends
        np.testing.assert_allclose(first, [[0.0, density[0]], [pressure[0], density[0]]])
        end = float(pressed["maximum_pressure"][i]) / 1e6
        np.testing.assert_allclose(last, [[pressure[-1], density[-1]], [end, density[-1]]])
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
    assert plotting.path(pressed, "mean_gap", against="normal_force", ax=ax) is ax
    assert holds(drawn(ax), pressed["normal_force"], pressed["mean_gap"])


def test_missing_variables_are_named(pressed):
    with pytest.raises(InvalidInput, match="result: expected the variable 'area_share'"):
        plotting.plot(pressed[["residual"]], "pressure_distribution")
    with pytest.raises(InvalidInput, match="result: expected the variable 'mean_gap'"):
        plotting.path(pressed[["residual"]], "mean_gap")
    with pytest.raises(InvalidInput, match="against: expected a variable of every step"):
        plotting.path(pressed, "mean_gap", against="pressure_class")


def test_variables_of_several_units_are_refused(pressed):
    with pytest.raises(InvalidInput, match="variable: expected variables of one unit, got m, 1"):
        plotting.path(pressed, ["mean_gap", "contact_fraction"])


def test_any_variables_against_shear_with_an_interval():
    shear = np.array([1e-4, 2e-4, 4e-4])
    path = xr.Dataset(
        {
            name: (("shear", "step"), np.multiply.outer(shear, factors))
            for name, factors in (
                ("spot", [1.0, 2.0]),
                ("reach", [3.0, 4.0]),
                ("spot_low", [0.5, 1.0]),
                ("spot_high", [2.0, 3.0]),
            )
        },
        {"shear": ("shear", shear, {"units": "m"}), "normal_force": ("step", [10.0, 20.0], {"units": "N"})},
    )
    ax = plotting.path(path, ["spot", "reach"], against="shear")
    assert ax.get_xlabel() == "shear displacement $v$ (µm)"
    for name in ("spot", "reach"):
        for step in range(2):
            assert any(np.allclose(y, path[name][:, step]) for _, y in values(ax))
    named = plotting.curves(ax)["curve"].unique().tolist()
    assert named == [f"{name}, normal force F = {load} N" for name in ("spot", "reach") for load in (10, 20)]
    alone = plotting.path(path.isel(step=0), "spot")  # a single curve has its band
    (band,) = alone.collections
    ends = band.get_paths()[0].vertices[:, 1]
    assert (ends.min(), ends.max()) == pytest.approx((0.5e-4, 8e-4))
    render(ax)
    render(alone)


@pytest.mark.parametrize("chosen", [0, slice(0)])
def test_distribution_without_classes_is_refused(chosen, pressed):
    with pytest.raises(InvalidInput, match="pressure_class"):
        plotting.plot(pressed.isel(pressure_class=chosen), "pressure_distribution")


def test_distribution_of_one_class_is_drawn(pressed):
    ((pressure, _), *_) = values(plotting.plot(pressed.isel(pressure_class=[-1]), "pressure_distribution"))
    greatest = float(pressed["maximum_pressure"][0]) * float(pressed["pressure_class"][-1])
    assert pressure == pytest.approx([greatest / 1e6])
