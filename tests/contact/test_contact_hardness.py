"""The hardness cap: no pressure above it, the force carried, the same as a bounded dense minimisation."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput

MODULUS = 1e9


def face(n=32, periodic=True):
    rough = fc.surfaces.spectral((n, n), 1e-4, hurst=0.8, rms_height=1e-5, rng=1)
    return rough if periodic else fc.surfaces.from_array(rough.values, 1e-4)


def love(n, spacing):
    """Settlement (m) of the centre of each cell under 1 Pa on another (Love 1929), E* = MODULUS."""
    x = (np.arange(n) - np.arange(n)[:, None]) * spacing
    dy, dx = np.repeat(np.repeat(x, n, 0), n, 1), np.tile(x, (n, n))
    half, total = spacing / 2, 0.0
    for a, b in ((1, 1), (-1, -1), (1, -1), (-1, 1)):
        u, v = dx + a * half, dy + b * half
        r = np.hypot(u, v)
        total = total + a * b * (u * np.log(v + r) + v * np.log(u + r))
    return total / (np.pi * MODULUS)


@pytest.mark.parametrize("boundary", ["periodic", "free"])
@pytest.mark.parametrize("pressure", [1e5, 1e6, 3e6, 9e6, 9.99e6])
def test_the_cap_holds_and_the_force_is_carried(boundary, pressure):
    found = fc.contact.press(
        face(),
        contact_modulus=MODULUS,
        nominal_pressure=pressure,
        hardness=1e7,
        boundary=boundary,
        keep=("state", "pressure", "gap"),
    )
    assert bool(found["converged"].all())
    np.testing.assert_allclose(float(found["pressure"].mean()), pressure, rtol=1e-9)
    assert float(found["pressure"].max()) <= 1e7
    yielded = found["state"] == 2
    np.testing.assert_array_equal(yielded, found["pressure"] >= 1e7)
    assert float(found["gap"].where(found["state"] == 1, 0.0).max()) < 1e-6 * 1e-5
    assert (found["pressure"].where(found["state"] == 0, 0.0) == 0).all()


def test_agrees_with_a_bounded_dense_minimisation():
    n, closure, cap = 10, 2.5e-5, 6e7
    rough = face(n, periodic=False)
    gap = float(rough.max()) - rough.values.ravel()
    matrix = love(n, 1e-4)
    factor = np.linalg.cholesky(matrix)  # min |L^T p - L^-1 (closure - gap)|
    target = np.linalg.solve(factor, closure - gap)
    exact = lsq_linear(factor.T, target, bounds=(0.0, cap), tol=1e-15, method="bvls").x.reshape(n, n)
    found = fc.contact.press(
        rough,
        contact_modulus=MODULUS,
        closure=closure,
        influence="square",
        hardness=cap,
        tolerance=1e-12,
        keep=("state", "pressure"),
    )
    assert (exact >= cap).sum() > 2
    np.testing.assert_allclose(found["pressure"][0], exact, atol=1e-6 * cap)


def test_a_very_high_cap_changes_nothing_and_a_path_has_no_memory():
    options = {"contact_modulus": MODULUS, "nominal_pressure": [1e6, 5e6, 1e6], "keep": ("state", "pressure")}
    free = fc.contact.press(face(), **options)
    capped = fc.contact.press(face(), hardness=1e15, **options)
    np.testing.assert_allclose(capped["pressure"], free["pressure"], atol=1e-4 * 1e7)
    low = fc.contact.press(face(), hardness=1e7, tolerance=1e-12, **options)
    np.testing.assert_array_equal(low["state"][0], low["state"][2])
    assert (low["contact_fraction"] > free["contact_fraction"]).all()


def test_more_than_the_cap_can_carry_is_refused():
    with pytest.raises(InvalidInput, match="hardness"):
        fc.contact.press(face(), contact_modulus=MODULUS, nominal_pressure=1.01e7, hardness=1e7)


def test_a_step_that_leaves_the_bounds_is_seen_and_one_that_reaches_them_is_not():
    from fractalcontact.contact._kernels import survey

    pressure = np.array([[1.0, 1.0, 0.5, 0.5, 0.5, 0.5, 0.0]])
    direction = np.array([[-0.1, 0.0, -0.5, -0.6, 0.5, 0.6, 0.0]])  # beyond the cap: 0, 3; below zero: 5
    out = np.zeros((1, 8))
    survey(0, 1, 1, pressure, direction, 1.0, 1.0, out)
    assert out[0, 0] == 3
    assert out[0, 1] == pytest.approx(4.0)
    assert out[0, 2] == pytest.approx(4.0)
