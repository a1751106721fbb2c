"""Friction angle and shear strength."""

import numpy as np
import plotting_synthetic as synthetic
from plotting_figures import drawn, holds

from fractalcontact import plotting


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
