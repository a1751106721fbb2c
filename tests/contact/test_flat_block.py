"""Flat surfaces and the stiffness of the flat block."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput

MODULUS = 2e9


@pytest.mark.parametrize("options", [{}, {"influence": "square"}, {"disc_radius": "inscribed"}])
@pytest.mark.parametrize(("shape", "spacing"), [((32, 48), 1e-3), ((33, 20), (1e-3, 7e-4))])
def test_flat_surface_closes_by_force_over_stiffness(shape, spacing, options):
    flat = fc.surfaces.from_array(np.full(shape, 0.7), spacing)
    forces = [0.0, 1.0, 3e4]
    result = fc.contact.press(flat, contact_modulus=MODULUS, normal_force=forces, keep=("gap",), **options)
    stiffness = fc.contact.flat_stiffness(shape, spacing, contact_modulus=MODULUS, **options)
    np.testing.assert_allclose(result["closure"], np.array(forces) / stiffness, rtol=1e-13)
    assert (result["gap"] == 0).all()
    assert bool(result["converged"].all())
    closed = fc.contact.press(flat, contact_modulus=MODULUS, closure=1e-6, **options)
    assert float(closed["normal_force"][0]) == pytest.approx(1e-6 * stiffness, rel=1e-15)


def test_square_block_stiffness_converges():
    error = []
    for n in (32, 64, 128):
        stiffness = fc.contact.flat_stiffness((n, n), 1.0 / n, contact_modulus=1.0)
        error.append(stiffness / 1.15230 - 1)
    assert abs(error[-1]) < 5e-3
    assert error[0] / error[1] == pytest.approx(2.0, abs=0.1)  # first order: the edge is singular


def test_uniform_loading_matches_love():
    stiffness = fc.contact.flat_stiffness((128, 128), 1 / 128, contact_modulus=1.0, loading="uniform")
    assert stiffness == pytest.approx(1 / 0.9464020, rel=2e-4)


def test_periodic_flat_stiffness_is_infinite():
    assert fc.contact.flat_stiffness((8, 8), 1.0, contact_modulus=1.0, boundary="periodic") == np.inf
    flat = fc.surfaces.from_array(np.zeros((8, 8)), 1.0, periodic=True)
    result = fc.contact.press(flat, contact_modulus=1.0, nominal_pressure=0.3, keep=("pressure",))
    assert float(result["closure"][0]) == 0.0
    np.testing.assert_allclose(result["pressure"], 0.3, rtol=1e-14)


def test_nearly_flat_surface_closes_as_flat():
    n, stiffness = 64, fc.contact.flat_stiffness((64, 64), 1e-3, contact_modulus=MODULUS)
    heights = 1e-15 * np.random.default_rng(0).random((n, n))
    surface = fc.surfaces.from_array(heights, 1e-3)
    result = fc.contact.press(surface, contact_modulus=MODULUS, normal_force=1e3)
    assert bool(result["converged"].all())
    assert float(result["closure"][0]) == pytest.approx(1e3 / stiffness, rel=1e-8)


@pytest.mark.parametrize("shape", [5, None, (3,), ((3, 3), (3, 3)), (3.0, 4.0), (2, 3), "ab"])
def test_flat_stiffness_refuses_bad_shape(shape):
    with pytest.raises(InvalidInput, match="shape"):
        fc.contact.flat_stiffness(shape, 1.0, contact_modulus=1.0)


def test_flat_stiffness_lists_all_problems():
    with pytest.raises(InvalidInput) as caught:
        fc.contact.flat_stiffness((2, 9, 4), -1.0, contact_modulus=0.0, boundary="open")
    for word in ("shape", "spacing", "contact_modulus", "boundary"):
        assert word in str(caught.value)
