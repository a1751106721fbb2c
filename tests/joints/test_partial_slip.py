"""Partial slip of a joint: that of its delta-surface, stiffness against theory, cycles, bad input."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import AnisotropyWarning, InvalidInput

FORCE, FRICTION = 200.0, 0.7


def crack(n=64, poisson=0.2, periodic=False, **options):
    face = fc.surfaces.fbm((n, n), 1e-4, hurst=0.8, rms_increment=2e-6, rng=1)
    if periodic:
        face = fc.surfaces.spectral((n, n), 1e-4, hurst=0.8, rms_slope=0.05, short_cutoff=8e-4, rng=3)
        return fc.joints.Crack(face, young=30e9, poisson=poisson, **options)
    return fc.joints.Crack(face, young=30e9, poisson=poisson, block=4.8e-3, **options)


def pushed(forces, joint=None, **options):
    given = {"shear": 3e-4, "friction_coefficient": FRICTION}
    if not {"closure", "nominal_pressure"} & options.keys():
        given["normal_force"] = FORCE
    return fc.joints.partial_slip(joint or crack(), tangential_force=forces, **(given | options))


@pytest.mark.parametrize("method", ["superposition", "full"])
@pytest.mark.parametrize("direction", ["E", "N", 200.0])
def test_is_that_of_the_delta_surface(method, direction):
    joint, forces = crack(), [20.0, 100.0, -60.0]
    result = pushed(forces, joint, direction=direction, method=method, keep=("slip_state", "traction_x"))
    surface = fc.joints.delta_surface(joint, 3e-4, direction)
    alone = fc.contact.partial_slip(
        fc.surfaces.from_array(surface.values, 1e-4),
        contact_modulus=joint.contact_modulus,
        poisson=0.2,
        friction_coefficient=FRICTION,
        normal_force=FORCE,
        tangential_force=forces,
        direction=direction,
        method=method,
        keep=("slip_state", "traction_x"),
    )
    np.testing.assert_array_equal(result["slip_state"][0], alone["slip_state"])
    scale = float(abs(alone["traction_x"]).max())
    np.testing.assert_allclose(result["traction_x"][0], alone["traction_x"], atol=1e-6 * scale)
    for name in ("tangential_displacement", "tangential_stiffness", "dissipated_energy", "stick_area"):
        np.testing.assert_allclose(result[name][0], alone[name], rtol=1e-5)
    assert float(result["sliding_force"][0]) == pytest.approx(FRICTION * FORCE)


@pytest.mark.parametrize(("method", "error"), [("superposition", 1e-9), ("full", 0.04)])
@pytest.mark.parametrize("poisson", [0.0, 0.2, 0.4])
def test_stiffness_ratio_before_any_slip(method, error, poisson):
    """K_s/K_n = 2 (1 - nu)/(2 - nu); K_n is the limit of the difference of two near loads."""
    joint = crack(96, poisson, periodic=True)
    force = 1e6 * joint.nominal_area
    result = pushed([0.0, 0.5 * FRICTION * force], joint, normal_force=force, method=method)
    ratio = 2 * (1 - poisson) / (2 - poisson)
    assert float(result["stuck_ratio"]) == pytest.approx(ratio)
    assert float(result["stiffness_ratio"][0, 0]) == pytest.approx(ratio, rel=error)
    assert float(result["stiffness_ratio"][0, 1]) < 0.9 * ratio  # softer once the edges slip
    load = np.array([1 - 1e-5, 1 + 1e-5]) * force
    pressed = fc.joints.closure(joint, shear=3e-4, normal_force=load, tolerance=1e-13)
    change = float(np.diff(pressed["interface_closure"].values.ravel())[0])
    stiffness = 2e-5 * force / change / joint.nominal_area
    assert float(result["interface_stiffness"][0]) == pytest.approx(stiffness, rel=2e-4)
    assert result["shear_stiffness"][0, 0] == pytest.approx(
        float(result["stiffness_ratio"][0, 0]) * stiffness, rel=2e-4
    )


@pytest.mark.parametrize("method", ["superposition", "full"])
def test_block_is_subtracted_from_both_stiffnesses(method):
    """A mated joint is as stiff as the block alone: the interface is rigid."""
    result = pushed([0.0, 50.0], shear=0.0, method=method)
    for name in ("shear_stiffness", "interface_stiffness", "stiffness_ratio"):
        assert np.isnan(result[name]).all()
        assert "mated" in result[name].attrs["reason"]
    assert not result["slip_area"].any()
    block = fc.contact.flat_stiffness((48, 48), 1e-4, contact_modulus=crack().contact_modulus)
    np.testing.assert_allclose(result["tangential_stiffness"], block * 1.6 / 1.8, rtol=0.02)


def test_cycles_of_an_earthquake():
    """Every cycle of the same amplitude dissipates the same; a greater one more than in proportion."""
    cycles = np.array([0.3, -0.3, 0.3, -0.3, 0.6, -0.6, 0.6]) * FRICTION * FORCE
    result = pushed(cycles)
    energy = np.diff(result["dissipated_energy"].values[0])
    assert energy[0] == pytest.approx(energy[1], rel=1e-9)
    assert energy[1] == pytest.approx(energy[2], rel=1e-9)
    assert energy[5] == pytest.approx(energy[4], rel=1e-9)
    assert energy[5] > 4 * energy[0]
    displacement = result["tangential_displacement"].values[0]
    assert displacement[1] == pytest.approx(-displacement[0], rel=1e-9)


def test_several_shears_and_loads_given_three_ways():
    shears = [1e-4, 3e-4]
    joint = crack()
    result = pushed([0.0, 60.0], joint, shear=shears, keep=("slip_state",))
    assert result["slip_state"].shape == (2, 2, 48, 48)
    one = pushed([0.0, 60.0], joint, shear=3e-4)
    np.testing.assert_allclose(result["shear_stiffness"][1], one["shear_stiffness"][0])
    pressure = pushed([0.0, 60.0], joint, nominal_pressure=FORCE / joint.nominal_area)
    np.testing.assert_allclose(pressure["shear_stiffness"], one["shear_stiffness"], rtol=1e-6)
    closure = pushed([0.0, 60.0], joint, closure=float(one["closure"][0]))
    np.testing.assert_allclose(closure["shear_stiffness"], one["shear_stiffness"], rtol=1e-4)
    assert float(closure["normal_force"][0]) == pytest.approx(FORCE, rel=1e-6)


def test_friction_is_that_of_the_crack():
    joint = crack(basic_friction_angle=30.0)
    result = fc.joints.partial_slip(joint, shear=3e-4, normal_force=FORCE, tangential_force=0.0)
    assert float(result["friction_coefficient"]) == pytest.approx(np.tan(np.pi / 6))
    assert float(result["sliding_force"][0]) == pytest.approx(FORCE * np.tan(np.pi / 6))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"tangential_force": [10.0, -200.0]}, "at most friction times normal force, 140 N, where sliding"),
        ({"normal_force": [10.0, 20.0]}, "the normal load is constant"),
        ({"normal_force": None}, "exactly one"),
        ({"friction_coefficient": 0.0}, "friction_coefficient"),
        ({"shear": 1.0}, "shear"),
        ({"direction": ["E", "W"]}, "direction"),
        ({"method": "fast"}, "method"),
        ({"keep": ("state",)}, "keep"),
        ({"closure": 1e-7, "normal_force": None, "tangential_force": 1e6}, "at a shear of 0.0003 m"),
    ],
)
def test_bad_input(wrong, message):
    given = {"shear": 3e-4, "normal_force": FORCE, "tangential_force": 1.0, "friction_coefficient": FRICTION}
    with pytest.raises(InvalidInput, match=message):
        fc.joints.partial_slip(crack(), **(given | wrong))


@pytest.mark.parametrize("load", [{}, {"closure": 1e-6}])
def test_crack_without_friction_needs_a_coefficient(load):
    with pytest.raises(InvalidInput, match="basic_friction_angle"):
        pushed(0.0, crack(basic_friction_angle=0.0), friction_coefficient=None, **load)


def test_ridged_faces_are_solved_fully():
    """Sheared ridges touch along lines: by superposition the stiffness is off by lambda, and it says so."""
    x = np.arange(64) * 1e-4
    ridges = 2e-5 * (np.cos(2 * np.pi * x / 32e-4) + 0.3 * np.cos(2 * np.pi * x / 16e-4)) * np.ones((8, 1))
    joint = fc.joints.Crack(fc.surfaces.from_array(ridges, 1e-4, periodic=True), young=30e9, poisson=0.4)
    force = 2e6 * joint.nominal_area
    given = {"joint": joint, "shear": [3e-4, 6e-4], "normal_force": force}
    chosen = pushed(0.2 * FRICTION * force, **given)
    full = pushed(0.2 * FRICTION * force, method="full", **given)
    np.testing.assert_array_equal(chosen["slip_method"], 1)
    np.testing.assert_array_equal(chosen["tangential_displacement"], full["tangential_displacement"])
    with pytest.warns(AnisotropyWarning, match="use method='full'"):
        simple = pushed(0.2 * FRICTION * force, method="superposition", **given)
    np.testing.assert_allclose(simple["superposition_error"], 1.6 / 1.2 - 1, rtol=1e-6)
    ratio = simple["tangential_displacement"] / full["tangential_displacement"]
    np.testing.assert_allclose(ratio, 1.6 / 1.2, rtol=1e-5)
    np.testing.assert_array_equal(simple["slip_method"], 0)
