"""Friction angle and shear strength."""

import numpy as np
import plotting_synthetic as synthetic
import pytest
from plotting_figures import drawn, holds

import fractalcontact as fc
from fractalcontact import plotting
from fractalcontact.base.errors import InvalidInput


def test_angle_strength_and_basic_angle():
    rubbed = synthetic.friction(synthetic.dilatancy(directions=("W",)))
    angle, strength = plotting.friction(rubbed)
    for step in range(3):
        expected = rubbed.isel(direction=0, step=step)
        assert holds(drawn(angle), expected.shear, expected.friction_angle)
        assert holds(drawn(strength), expected.shear, expected.shear_strength)
    assert any(np.allclose(line.get_ydata(), 35.0) for line in angle.lines)


def test_rigid_friction_curve_per_direction():
    rubbed = synthetic.friction(synthetic.dilatancy(forces=()))
    (ax,) = plotting.friction(rubbed)
    for word in "ENWS":
        expected = rubbed.sel(direction=word)
        assert holds(drawn(ax), expected.shear, expected.friction_angle)


def test_axis_ends_at_locking_angle():
    rubbed = synthetic.friction(synthetic.dilatancy(shears=[0, 1e-4, 2e-4], directions=("W",)))
    rubbed["friction_angle"].values[0, 0] = 110.0
    angle, strength = plotting.friction(rubbed)
    assert angle.get_ylim()[1] == 90.0
    assert angle.get_ylim()[0] < 35.0
    assert angle.get_title(loc="left") == "block slides West, locked above 90°"
    assert strength.get_yscale() == "linear"
    rubbed["shear_strength"].values[0, 0, 0] *= 1e-3
    assert plotting.friction(rubbed)[1].get_yscale() == "log"


def test_rigid_friction_under_several_pressures():
    face = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    crack = fc.joints.Crack(face, block=1.6e-3)
    opening = fc.joints.dilatancy(crack, shear=[0.0, 1e-4, 2e-4, 3e-4], direction=["E", "N"])
    rubbed = fc.joints.friction(opening, nominal_pressure=[1e6, 5e6])
    angle, strength = plotting.friction(rubbed, direction="N")
    expected = rubbed.sel(direction="N")
    assert holds(drawn(angle), expected.shear, expected.friction_angle)
    for step in range(2):
        assert holds(drawn(strength), expected.shear, expected.shear_strength.isel(step=step))
    with pytest.raises(ValueError, match="one direction"):
        plotting.friction(rubbed)


def test_friction_along_a_test_is_no_result_over_shear():
    face = fc.surfaces.fbm((24, 24), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=1.6e-3)
    test = fc.joints.direct_shear(crack, 2e-4, nominal_pressure=1e6, hardness=2e8)
    for kind in ("friction", "dilatancy"):
        with pytest.raises(InvalidInput, match="a result over shear, got one with shear over"):
            plotting.plot(test, kind)
