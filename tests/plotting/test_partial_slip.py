"""Maps of stick and slip: every cell in its colour, the force and the share that sticks in the title."""

import numpy as np
import pytest
from plotting_figures import colours, figure_of, render

import fractalcontact as fc
from fractalcontact import plotting
from fractalcontact.base.errors import InvalidInput


@pytest.fixture(scope="module")
def sheared():
    surface = fc.surfaces.spectral((40, 56), 1e-5, hurst=0.8, rms_slope=0.1, short_cutoff=8e-5, rng=4)
    return fc.contact.partial_slip(
        surface,
        contact_modulus=1e9,
        poisson=0.2,
        friction_coefficient=0.5,
        normal_force=4.0,
        tangential_force=[0.0, 0.5, 1.0, 2.0, -0.2],
    )


def test_each_state_has_its_colour(sheared):
    step = sheared.isel(step=2)
    image = colours(plotting.plot(step, "contact_domains")[0]).reshape(-1, 3)
    flags = step["slip_state"].values.ravel()
    shown = [np.unique(image[flags == flag], axis=0) for flag in (0, 1, 2)]
    assert [len(colour) for colour in shown] == [1, 1, 1]
    light = [0.2126 * c[0][0] + 0.7152 * c[0][1] + 0.0722 * c[0][2] for c in shown]
    assert light[0] > light[2] > light[1]
    assert min(abs(np.diff(sorted(light)))) > 0.2 * max(light)  # told apart in grey as well


def test_titles_and_legend(sheared):
    figure = figure_of(plotting.plot(sheared, "contact_domains"))
    titles = [ax.get_title(loc="left") for ax in figure.axes][:5]
    share = 100 * float(sheared["stick_area"][1] / sheared["contact_area"])
    assert "0 N" in titles[0]
    assert "100 % sticks" in titles[0]
    assert f"{share:.0f} % sticks" in titles[1]
    assert "0 % sticks" in titles[3]
    assert "\N{MINUS SIGN}" in titles[4]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["open", "stick", "slip"]
    render(figure)


def test_fewer_panels_and_no_contact(sheared):
    assert sum(ax.axison for ax in plotting.plot(sheared, "contact_domains", panels=3)) == 3
    empty = sheared.isel(step=[0]).copy()
    empty["slip_state"] = empty["slip_state"] * 0
    assert "no contact" in plotting.plot(empty, "contact_domains")[0].get_title(loc="left")


def test_loops_are_the_values_of_the_result(sheared):
    left, right = plotting.plot(sheared, "slip_loops")
    x, y = left.lines[0].get_data()
    np.testing.assert_allclose(y, sheared["tangential_force"])
    assert left.get_xlabel() == "tangential displacement (µm)"
    np.testing.assert_allclose(x, 1e6 * sheared["tangential_displacement"])
    share = 100 * sheared["stick_area"] / sheared["contact_area"]
    np.testing.assert_allclose(right.lines[0].get_ydata(), share)


def test_loops_of_a_joint():
    face = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=2e-6, rng=1)
    crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=2.4e-3)
    pushed = fc.joints.partial_slip(crack, shear=[1e-4, 3e-4], normal_force=50, tangential_force=[0, 20, -20])
    figure = figure_of(plotting.plot(pushed, "slip_loops"))
    left, right = figure.axes
    assert len(left.lines) == len(right.lines) == 2
    np.testing.assert_allclose(left.lines[1].get_xdata(), 1e6 * pushed["tangential_displacement"][1])
    render(figure)


def test_bad_input(sheared):
    with pytest.raises(InvalidInput, match="stick_area"):
        plotting.plot(sheared.drop_vars("stick_area"), "slip_loops")
    with pytest.raises(InvalidInput, match="'state'"):
        plotting.plot(sheared.drop_vars("slip_state"), "contact_domains")
    with pytest.raises(InvalidInput, match="panels"):
        plotting.plot(sheared, "contact_domains", panels=0)
