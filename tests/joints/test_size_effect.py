"""Size effect of the strength of joints at worked values."""

import numpy as np
import pytest

import fractalcontact as fc


def test_doubling():
    factors = fc.joints.size_effect(2.0, contact_dimension=1.66, roughness_dimension=1.94)
    values = [
        factors[name].item() for name in ("strength_factor", "friction_factor", "fracture_energy_factor")
    ]
    np.testing.assert_allclose(values, [0.790, 0.824, 1.580], atol=5e-4)


def test_full_contact_has_no_size_effect():
    factors = fc.joints.size_effect([1.0, 7.0], contact_dimension=2.0)
    assert (factors.strength_factor == 1).all()
    assert (factors.friction_factor == 1).all()


def test_force_per_fractal_measure_is_kept():
    # F = sigma* L^D, so the nominal pressure F / L^2 changes by size_ratio^(D - 2)
    dimension, star = 1.4, 3.0
    small, large = (star * length**dimension / length**2 for length in (0.1, 0.7))
    factor = fc.joints.size_effect(7.0, contact_dimension=dimension).strength_factor
    assert factor.item() == pytest.approx(large / small)


def test_dimension_beyond_the_plane_is_refused():
    with pytest.raises(ValueError, match="contact_dimension"):
        fc.joints.size_effect(2.0, contact_dimension=2.5)
