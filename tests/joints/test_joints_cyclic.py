"""Cyclic shear, a normal stiffness, and what locks: against sawteeth and balances that can be checked."""

import numpy as np
import pytest

import fractalcontact as fc

S, PERIOD = 1e-3, 20


@pytest.fixture(scope="module")
def teeth(make_face):
    """Teeth of 10 degrees on a basic angle of 30, slid both ways."""
    x = np.arange(200)
    tooth = np.abs((x + PERIOD / 2) % PERIOD - PERIOD / 2) * S * np.tan(np.radians(10))
    face = make_face(np.broadcast_to(tooth, (6, 200)), S)
    crack = fc.joints.Crack(face, block=(6e-3, 0.1), young=3e10, poisson=0.2, basic_friction_angle=30)
    return fc.joints.dilatancy(crack, shear=np.arange(9) * S, direction=("E", "W"))


def test_teeth_are_climbed_out_and_slid_down_back(teeth):
    found = fc.joints.cyclic_shear(teeth, [0, 5e-3, -5.5e-3, 0], nominal_pressure=[1e6, 2e6])
    np.testing.assert_allclose(
        found.shear.values[[0, 5, 6, 17, 18, -1]], [0, 5e-3, 5e-3, -5.5e-3, -5.5e-3, 0]
    )
    up, down = np.tan(np.radians([40, 20]))
    stress = found.shear_stress.values[:, 0]
    np.testing.assert_allclose(stress[1:6], 1e6 * up)
    np.testing.assert_allclose(stress[6:11], -1e6 * down)
    np.testing.assert_allclose(stress[12:18], -1e6 * up)
    np.testing.assert_allclose(stress[18:24], 1e6 * down)
    np.testing.assert_allclose(found.shear_stress.values[:, 1], 2 * stress)
    assert found.slip[-1] == pytest.approx(21e-3)
    # between the teeth the slope through two neighbours is that of neither
    closed = 1e6 * (up + down) * 10.5e-3
    assert found.frictional_work.values[-1, 0] == pytest.approx(closed, rel=0.01)


def test_direction_turns_the_cycle_round(teeth):
    there = fc.joints.cyclic_shear(teeth, [0, 4e-3], nominal_pressure=1e6)
    back = fc.joints.cyclic_shear(teeth, [0, -4e-3], direction="W", nominal_pressure=1e6)
    # at the start the one has a neighbour on either side, the other not
    np.testing.assert_allclose(there.shear_stress[1:], -back.shear_stress[1:])
    np.testing.assert_allclose(there.friction_angle[1:], back.friction_angle[1:])


def test_without_pressures_there_are_angles_only(teeth):
    found = fc.joints.cyclic_shear(teeth, [1e-3, 4e-3, 2e-3])
    assert "shear_stress" not in found
    np.testing.assert_allclose(found.friction_angle, [40.0] * 4 + [20.0] * 3)


def test_faces_that_lock_say_so(teeth):
    found = fc.joints.cyclic_shear(teeth, [0, 4e-3], nominal_pressure=1e6, basic_friction_angle=85)
    assert np.isnan(found.shear_stress.values[1:]).all()
    assert "90 degrees" in found.shear_stress.attrs["reason"]
    strength = fc.joints.friction(teeth, nominal_pressure=1e6, basic_friction_angle=85)
    assert np.isnan(strength.peak_shear_strength).all()
    assert np.isnan(strength.peak_strength_shear).all()
    assert "90 degrees" in strength.peak_shear_strength.attrs["reason"]


def test_strength_of_rigid_faces_under_given_pressures(teeth):
    found = fc.joints.friction(teeth, nominal_pressure=[1e6, 3e6])
    assert found.shear_strength.dims == ("direction", "shear", "step")
    np.testing.assert_allclose(found.shear_strength.isel(step=1), 3e6 * np.tan(np.radians(40)))


def test_paths_that_cannot_be_walked_are_named(teeth):
    for path, match in (
        ([0.0], "at least two positions"),
        ([0.0, 1e-3, 1e-3], "each other than"),
        ([0.0, 9e-3], "positions from 0 to 0.008 m"),
    ):
        with pytest.raises(ValueError, match=match):
            fc.joints.cyclic_shear(teeth, path)
    with pytest.raises(ValueError, match="the azimuth 180"):
        fc.joints.cyclic_shear(teeth.sel(direction=["E"]), [0.0, 1e-3, -1e-3])
    with pytest.raises(ValueError, match="dilatancy.shear: expected at least two shears, ascending"):
        fc.joints.cyclic_shear(teeth.isel(shear=[2, 1]), [0.0, 1e-3])


# the normal stiffness


@pytest.fixture(scope="module")
def crack(make_face, rough):
    heights = 2e-5 * rough((64, 64), 8)
    return fc.joints.Crack(make_face(heights, 8e-5), young=3e10, poisson=0.2, block=32 * 8e-5)


def test_force_and_spring_balance_at_every_shear(crack):
    k, shear = 1e11, np.arange(5) * 8e-5
    found = fc.joints.dilatancy(
        crack, shear=shear, direction="E", normal_force=[20.0, 200.0], normal_stiffness=k
    )
    opened = found.dilatancy - found.dilatancy.sel(shear=0.0)
    expected = [20.0, 200.0] + k * crack.nominal_area * opened
    np.testing.assert_allclose(found.normal_force, expected, rtol=3e-6)
    np.testing.assert_allclose(found.initial_force, [20.0, 200.0])
    # what it finds is the constant-force solution at that force
    force = float(found.normal_force[0, 3, 0])
    alone = fc.joints.dilatancy(crack, shear=shear[3], direction="E", normal_force=force)
    assert alone.dilatancy.item() == pytest.approx(float(found.dilatancy[0, 3, 0]), abs=1e-12)


def test_the_stiffer_the_spring_the_less_it_opens(crack):
    options = {"shear": [0.0, 8e-5, 4e-4], "direction": "E", "normal_force": 20.0}
    constant = fc.joints.dilatancy(crack, **options).dilatancy.values[0, :, 0]
    soft, stiff, rigid = (
        fc.joints.dilatancy(crack, normal_stiffness=k, **options).dilatancy.values[0, :, 0]
        for k in (1e3, 1e11, 1e17)
    )
    np.testing.assert_allclose(soft, constant, atol=1e-12)
    assert (stiff[1:] < constant[1:]).all()
    # faces in full contact close no further, whatever holds them
    assert (rigid[1:] < stiff[1:]).all()
    assert (rigid[1:] > 0).all()


def test_a_plane_that_falls_away_loses_its_force(make_face):
    x = np.arange(60) * 8e-5
    face = make_face(np.broadcast_to(0.1 * x, (20, 60)), 8e-5)
    crack = fc.joints.Crack(face, block=(10 * 8e-5, 20 * 8e-5), young=3e10, poisson=0.2)
    found = fc.joints.dilatancy(
        crack, shear=[0.0, 8e-5, 8e-4], direction="W", normal_force=1.0, normal_stiffness=1e10
    )
    exact = np.maximum(1.0 - 1e10 * crack.nominal_area * 0.1 * np.array([0.0, 8e-5, 8e-4]), 0.0)
    np.testing.assert_allclose(found.normal_force.values[0, :, 0], exact, rtol=1e-6)


def test_a_spring_needs_a_force(crack):
    with pytest.raises(ValueError, match="normal_stiffness: expected nothing without normal_force"):
        fc.joints.dilatancy(crack, shear=0.0, normal_stiffness=1.0)
    with pytest.raises(ValueError, match="normal_stiffness"):
        fc.joints.dilatancy(crack, shear=0.0, normal_force=1.0, normal_stiffness=-1.0)
