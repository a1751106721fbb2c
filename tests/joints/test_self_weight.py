"""Strength under self-weight: a plane in closed form, and the dilatancy under the same forces."""

import numpy as np
import pytest

import fractalcontact as fc

S = 8e-5
GAMMA = 24e3


def test_plane_has_a_constant_coefficient_of_friction(make_face):
    slope = 0.1 * np.arange(40.0) * np.ones((6, 1))
    crack = fc.joints.Crack(make_face(slope), young=3e10, poisson=0.2, block=(6, 20), basic_friction_angle=30)
    result = fc.joints.self_weight(
        crack, structure_size=[10, 50, 200], unit_weight=GAMMA, shear=[2, 8], direction=["E", "W"]
    )
    for name, sign in (("E", 1), ("W", -1)):
        tangent = np.tan(np.radians(30) + sign * np.arctan(0.1))
        expected = GAMMA * np.array([10, 50, 200]) * tangent
        for strength in result.shear_strength.sel(direction=name):
            np.testing.assert_allclose(strength, expected, rtol=1e-6)
    np.testing.assert_allclose(result.strength_exponent, 1.0, atol=1e-6)
    np.testing.assert_allclose(result.nominal_pressure, GAMMA * result.structure_size)


def test_follows_from_the_dilatancy_under_the_weight(crack):
    sizes = np.array([1.0, 10.0, 100.0])
    result = fc.joints.self_weight(
        crack, structure_size=sizes, unit_weight=GAMMA, shear=10 * S, direction="W"
    )
    force = GAMMA * sizes * crack.nominal_area
    climb = fc.joints.dilatancy(crack, shear=[0.0, 10 * S], normal_force=force.tolist(), direction="W")
    opening = climb.dilatancy.isel(shear=1) - climb.dilatancy.isel(shear=0)
    expected = GAMMA * sizes * np.tan(np.radians(35) + np.arctan(opening.values.ravel() / (10 * S)))
    np.testing.assert_allclose(result.shear_strength.values.ravel(), expected, rtol=1e-6)
    slope = np.polyfit(np.log(sizes), np.log(expected), 1)[0]
    assert float(result.strength_exponent.squeeze()) == pytest.approx(slope, abs=1e-6)
    assert slope < 0.999  # larger structures close the joint


def test_two_faces_climb_from_where_the_weight_has_closed_them():
    """Two different faces are closed before they slide: that is no angle of dilatancy."""
    lower, other = (
        fc.surfaces.fbm((32, 32), 1e-4, hurst=0.7, rms_increment=2e-6, rng=seed) for seed in (1, 2)
    )
    crack = fc.joints.Crack(
        lower, lower + other, young=3e10, poisson=0.2, block=2e-3, basic_friction_angle=30
    )
    sizes = np.array([10.0, 400.0])
    result = fc.joints.self_weight(
        crack, structure_size=sizes, unit_weight=GAMMA, shear=2e-4, direction=["E", "N"]
    )
    climb = fc.joints.dilatancy(
        crack,
        shear=[0, 2e-4],
        direction=["E", "N"],
        normal_force=(GAMMA * sizes * crack.nominal_area).tolist(),
    )
    secant = fc.joints.friction(climb, distance=2e-4).peak_friction_angle
    np.testing.assert_allclose(result.friction_angle.isel(shear=0), secant, rtol=1e-9)
    np.testing.assert_allclose(result.dilatancy.isel(shear=0), climb.dilatancy.isel(shear=1), rtol=1e-9)
    assert (climb.dilatancy.isel(shear=0) < -1e-7).all()


def test_locked_faces_have_no_strength(make_face):
    slope = 2.0 * np.arange(40.0) * np.ones((6, 1))  # 63 degree
    crack = fc.joints.Crack(make_face(slope), young=3e10, poisson=0.2, block=(6, 20), basic_friction_angle=30)
    result = fc.joints.self_weight(
        crack, structure_size=[10, 50], unit_weight=GAMMA, shear=4, direction=["E", "W"]
    )
    assert np.isnan(result.shear_strength.sel(direction="E")).all()
    assert "locked" in result.shear_strength.attrs["reason"]
    assert np.isnan(result.strength_exponent.sel(direction="E")).all()
    assert (result.shear_strength.sel(direction="W") < 0).all()  # it slides down by itself
    assert "not positive" in result.strength_exponent.attrs["reason"]


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"shear": [0.0, S]}, "shear: expected .* > 0"),
        ({"shear": 1.0, "direction": "W"}, "at most 0.00192 m"),
        ({"structure_size": [10.0, 1.0]}, "ascending sizes"),
        ({"structure_size": 0.0}, "structure_size"),
        ({"unit_weight": -1.0}, "unit_weight"),
        ({"hardness": 1e6, "structure_size": 1e4}, "hardness times area"),
    ],
)
def test_wrong_arguments_are_named(crack, options, named):
    call = {"shear": S, "structure_size": 10.0, "unit_weight": GAMMA} | options
    with pytest.raises(ValueError, match=named) as caught:
        fc.joints.self_weight.validate(crack, **call)
    assert len(caught.value.problems) == 1


def test_rigid_faces_need_no_modulus(make_face):
    """On a plane of slope 0.1 loads close nothing: the strengths of elastic faces, in closed form."""
    slope = 0.1 * np.arange(40.0) * np.ones((6, 1))
    crack = fc.joints.Crack(make_face(slope), block=(6, 20), basic_friction_angle=30)
    result = fc.joints.self_weight(
        crack, structure_size=[10, 200], unit_weight=GAMMA, shear=[2, 8], direction=["E", "W"]
    )
    for name, sign in (("E", 1), ("W", -1)):
        tangent = np.tan(np.radians(30) + sign * np.arctan(0.1))
        expected = np.tile(GAMMA * np.array([10, 200]) * tangent, (2, 1))
        np.testing.assert_allclose(result.shear_strength.sel(direction=name), expected, rtol=1e-12)
    np.testing.assert_allclose(result.strength_exponent, 1.0, atol=1e-12)
    assert "rigid" in result.shear_strength.attrs["comment"]
    assert not {"converged", "residual", "rms_slope"} & set(result.variables)


def test_rigid_faces_refuse_options_of_the_solver(make_face):
    crack = fc.joints.Crack(make_face(np.zeros((6, 40))), block=(6, 20))
    with pytest.raises(ValueError, match="hardness: expected nothing without a force: rigid faces"):
        fc.joints.self_weight(
            crack, structure_size=10, unit_weight=GAMMA, shear=2, direction="E", hardness=1e8
        )


def test_one_constant_of_elasticity_alone_is_a_mistake(make_face):
    crack = fc.joints.Crack(make_face(np.zeros((6, 40))), block=(6, 20), young=1e10)
    with pytest.raises(ValueError, match=r"crack.poisson: expected a value"):
        fc.joints.self_weight(crack, structure_size=10, unit_weight=GAMMA, shear=2, direction="E")
