"""Empirical criteria at worked values."""

import numpy as np
import pytest

import fractalcontact as fc


def test_barton_choubey_strength():
    joint = {"roughness": 10, "wall_strength": 30e6, "residual_angle": 26}
    strength = fc.joints.barton_choubey_strength(0.744e6, **joint)
    assert strength == pytest.approx(0.67121e6, rel=1e-5)
    assert np.degrees(np.arctan(strength / 0.744e6)) == pytest.approx(42.0555, abs=1e-4)
    strengths = fc.joints.barton_choubey_strength(np.array([[0.744e6, 30e6]]), **joint)
    np.testing.assert_allclose(strengths, [[strength, 30e6 * np.tan(np.radians(26))]])


def test_barton_choubey_gives_no_negative_strength():
    joint = {"roughness": 20, "wall_strength": 100e6, "residual_angle": 30}
    # 90 degrees where log10(JCS / sigma) = 60 / 20
    assert fc.joints.barton_choubey_strength(1.01e5, **joint) > 0
    with pytest.raises(ValueError, match=r"nominal_pressure: expected above 1e\+05 Pa, where"):
        fc.joints.barton_choubey_strength([1e6, 1e3], **joint)


def test_scaled_constants_decrease_with_length():
    sample = fc.joints.barton_bandis_scaled(10, 50e6, 0.1)
    assert sample.roughness == pytest.approx(10)
    assert sample.wall_strength == pytest.approx(50e6)
    assert sample.peak_shear == pytest.approx(0.914e-3, rel=1e-3)  # 0.2 mm times 100^0.33
    longer = fc.joints.barton_bandis_scaled(10, 50e6, 1.0)
    assert longer.roughness == pytest.approx(10 * 10**-0.2)
    assert longer.wall_strength == pytest.approx(50e6 * 10**-0.3)


def test_size_effect_of_doubling():
    factors = fc.joints.size_effect(2.0, contact_dimension=1.66, roughness_dimension=1.94)
    np.testing.assert_allclose(factors, [0.790, 0.824, 1.580], atol=5e-4)
    # a contact of dimension 2 has no size effect
    plain = fc.joints.size_effect(7.0, contact_dimension=2.0)
    assert plain.strength == plain.friction == 1.0


def test_size_effect_keeps_the_force_per_fractal_measure():
    # F = sigma* L^D, so the nominal pressure F / L^2 changes by scale^(D - 2)
    dimension, star = 1.4, 3.0
    small, large = (star * length**dimension / length**2 for length in (0.1, 0.7))
    assert large / small == pytest.approx(fc.joints.size_effect(7.0, contact_dimension=dimension).strength)


def test_friction_angles_of_concrete():
    angles = {name: np.degrees(np.arctan(value)) for name, value in fc.joints.PARK_PAULAY.items()}
    assert angles["monolithic"] == pytest.approx(54.46, abs=0.01)
    assert angles["against hardened concrete"] == pytest.approx(45.0)


def test_invalid_arguments_are_refused():
    with pytest.raises(ValueError, match=r"(?s)nominal_pressure.*roughness.*residual_angle"):
        fc.joints.barton_choubey_strength(0.0, roughness=30, wall_strength=1e6, residual_angle=100)
    with pytest.raises(ValueError, match="range of the fit"):
        fc.joints.bandis_constants(0.0, 1e6, 1e-3)
    with pytest.raises(ValueError, match="contact_dimension"):
        fc.joints.size_effect(2.0, contact_dimension=2.5)
    with pytest.raises(ValueError, match="length"):
        fc.joints.barton_bandis_scaled(10, 1e6, -1.0)
    with pytest.raises(ValueError, match="initial_stiffness"):
        fc.joints.bandis_closure(1.0, initial_stiffness=0.0, greatest_closure=1.0)


def test_self_weight_strength_grows_with_size():
    small, large = fc.joints.self_weight_strength(
        np.array([10.0, 100.0]), unit_weight=24e3, friction_angle=45
    )
    assert small == pytest.approx(240e3)
    assert large / small == pytest.approx(10.0)
    with pytest.raises(ValueError, match="unit_weight"):
        fc.joints.self_weight_strength(1.0, unit_weight=-1, friction_angle=45)
