"""Cyclic shear of teeth, whose stress and work are known."""

import numpy as np
import pytest

import fractalcontact as fc


def test_stress_out_and_back_on_teeth(teeth):
    result = fc.joints.cyclic_shear(teeth, [0, 5e-3, -5.5e-3, 0], nominal_pressure=[1e6, 2e6])
    np.testing.assert_allclose(
        result.shear.values[[0, 5, 6, 17, 18, -1]], [0, 5e-3, 5e-3, -5.5e-3, -5.5e-3, 0]
    )
    up, down = np.tan(np.radians([40, 20]))
    stress = result.shear_stress.values[:, 0]
    np.testing.assert_allclose(stress[1:6], 1e6 * up)
    np.testing.assert_allclose(stress[6:11], -1e6 * down)
    np.testing.assert_allclose(stress[12:18], -1e6 * up)
    np.testing.assert_allclose(stress[18:24], 1e6 * down)
    np.testing.assert_allclose(result.shear_stress.values[:, 1], 2 * stress)
    assert result.slip[-1] == pytest.approx(21e-3)
    # where two flanks meet the slope through the neighbours is that of neither flank
    closed = 1e6 * (up + down) * 10.5e-3
    assert result.frictional_work.values[-1, 0] == pytest.approx(closed, rel=0.01)


def test_direction_reverses_the_cycle(teeth):
    there = fc.joints.cyclic_shear(teeth, [0, 4e-3], nominal_pressure=1e6)
    back = fc.joints.cyclic_shear(teeth, [0, -4e-3], direction="W", nominal_pressure=1e6)
    # the start has two neighbours in the second path, and one in the first
    np.testing.assert_allclose(there.shear_stress[1:], -back.shear_stress[1:])
    np.testing.assert_allclose(there.friction_angle[1:], back.friction_angle[1:])


def test_without_pressure_only_angles(teeth):
    result = fc.joints.cyclic_shear(teeth, [1e-3, 4e-3, 2e-3])
    assert "shear_stress" not in result
    np.testing.assert_allclose(result.friction_angle, [40.0] * 4 + [20.0] * 3)


def test_locked_faces_have_no_stress(teeth):
    result = fc.joints.cyclic_shear(teeth, [0, 4e-3], nominal_pressure=1e6, basic_friction_angle=85)
    assert np.isnan(result.shear_stress.values[1:]).all()
    assert "90 degrees" in result.shear_stress.attrs["reason"]
    strength = fc.joints.friction(teeth, nominal_pressure=1e6, basic_friction_angle=85)
    assert np.isnan(strength.peak_shear_strength).all()
    assert np.isnan(strength.peak_strength_shear).all()
    assert "90 degrees" in strength.peak_shear_strength.attrs["reason"]


def test_invalid_paths_are_refused(teeth):
    for path, match in (
        ([0.0], "at least two positions"),
        ([0.0, 1e-3, 1e-3], "each different from"),
        ([0.0, 9e-3], "positions from 0 to 0.008 m"),
    ):
        with pytest.raises(ValueError, match=match):
            fc.joints.cyclic_shear(teeth, path)
    with pytest.raises(ValueError, match="the azimuth 180"):
        fc.joints.cyclic_shear(teeth.sel(direction=["E"]), [0.0, 1e-3, -1e-3])
    with pytest.raises(ValueError, match="dilatancy.shear: expected at least two shears, ascending"):
        fc.joints.cyclic_shear(teeth.isel(shear=[2, 1]), [0.0, 1e-3])
