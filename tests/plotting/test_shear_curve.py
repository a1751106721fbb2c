"""Shear stress and dilatancy of one joint, by test and by criterion."""

import numpy as np
import pytest
from plotting_figures import drawn, figure_of, holds, render

import fractalcontact as fc
from fractalcontact import plotting


@pytest.fixture(scope="module")
def face():
    return fc.surfaces.fbm((48, 48), 2e-4, hurst=0.8, rms_increment=3e-5, rng=2)


@pytest.fixture(scope="module")
def test_result(face):
    crack = fc.joints.Crack(face, young=3e10, poisson=0.2, block=5e-3, basic_friction_angle=30)
    return fc.joints.direct_shear(crack, [6e-4, 0], nominal_pressure=[2e6, 2e7], hardness=3e8)


@pytest.fixture(scope="module")
def criterion(face):
    displacement = np.linspace(0, 1e-3, 30)
    return fc.joints.shear_curve(
        face, displacement, nominal_pressure=[2e6, 5e6], wall_strength=1e8, residual_friction_angle=30
    )


def test_curves_are_the_values(test_result):
    figure = figure_of(plotting.plot(test_result, "shear_curve"))
    for ax, name in zip(figure.axes, ("shear_stress", "dilatancy"), strict=True):
        for i in range(2):
            one = test_result.isel(nominal_pressure=i)
            assert holds(drawn(ax), one.shear_displacement, one[name])
    render(figure)


def test_a_criterion_beside_a_test_shares_colours_and_units(test_result, criterion):
    figure = figure_of(plotting.plot(test_result, "shear_curve", beside=criterion))
    stress = figure.axes[0]
    dashed = [line for line in stress.lines if line.get_linestyle() == "--"]
    assert len(dashed) == 2
    solid = next(line for line in stress.lines if line.get_linestyle() == "-")
    assert solid.get_color() == dashed[0].get_color()  # both at 2 MPa
    assert holds(drawn(stress), criterion.shear_displacement, criterion.shear_stress.isel(nominal_pressure=1))
    assert stress.get_ylabel().endswith("(MPa)")
    assert figure.axes[1].get_xlabel() == "shear displacement (mm)"
    render(figure)


def test_an_unknown_normal_stress_has_its_own_colour(test_result, criterion):
    unknown = test_result.assign_coords(nominal_pressure=[2e6, np.nan])
    unknown.nominal_pressure.attrs = test_result.nominal_pressure.attrs
    for result in (unknown, unknown.isel(nominal_pressure=[1]), unknown.isel(nominal_pressure=[1, 1])):
        stress = figure_of(plotting.plot(result, "shear_curve", beside=criterion)).axes[0]
        assert len(stress.lines) == result.sizes["nominal_pressure"] + 2
        for i in range(result.sizes["nominal_pressure"]):
            one = result.isel(nominal_pressure=i)
            assert holds(drawn(stress), one.shear_displacement, one.shear_stress)
        assert (
            stress.lines[result.sizes["nominal_pressure"] - 1].get_label().endswith("normal stress = - MPa")
        )
    first, second, beside, _ = (
        figure_of(plotting.plot(unknown, "shear_curve", beside=criterion)).axes[0].lines
    )
    assert first.get_color() == beside.get_color() != second.get_color()


def test_peaks_are_points_on_the_envelope(face, test_result):
    envelope = fc.joints.strength_envelope(
        face, nominal_pressure=[1e6, 3e7], wall_strength=1e8, basic_friction_angle=30
    )
    ax = plotting.strength_envelope(envelope, tests=test_result)
    points = next(line for line in ax.lines if line.get_marker() == "o")
    np.testing.assert_allclose(points.get_xdata(), [2, 20])
    np.testing.assert_allclose(points.get_ydata(), test_result.peak_shear_strength / 1e6)
