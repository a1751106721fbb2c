"""Hardness: bounded dense minimisation, hysteresis, plastic work, residual heights."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput

MODULUS = 1e9


def rough_surface(n=32, periodic=True):
    rough = fc.surfaces.spectral((n, n), 1e-4, hurst=0.8, rms_height=1e-5, rng=1)
    return rough if periodic else fc.surfaces.from_array(rough.values, 1e-4)


def love(n, spacing):
    """Displacement (m) of the centre of each cell under 1 Pa on another (Love 1929), E* = MODULUS."""
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
def test_pressure_bounded_and_force_carried(boundary, pressure):
    result = fc.contact.press(
        rough_surface(),
        contact_modulus=MODULUS,
        nominal_pressure=pressure,
        hardness=1e7,
        boundary=boundary,
        keep=("state", "pressure", "gap"),
    )
    assert bool(result["converged"].all())
    np.testing.assert_allclose(float(result["pressure"].mean()), pressure, rtol=1e-9)
    assert float(result["pressure"].max()) <= 1e7
    yielded = result["state"] == 2
    np.testing.assert_array_equal(yielded, result["pressure"] >= 1e7)
    assert float(result["gap"].where(result["state"] == 1, 0.0).max()) < 1e-6 * 1e-5
    assert (result["pressure"].where(result["state"] == 0, 0.0) == 0).all()


def test_matches_bounded_least_squares():
    n, closure, cap = 10, 2.5e-5, 6e7
    rough = rough_surface(n, periodic=False)
    gap = float(rough.max()) - rough.values.ravel()
    matrix = love(n, 1e-4)
    factor = np.linalg.cholesky(matrix)  # min |L^T p - L^-1 (closure - gap)|
    target = np.linalg.solve(factor, closure - gap)
    exact = lsq_linear(factor.T, target, bounds=(0.0, cap), tol=1e-15, method="bvls").x.reshape(n, n)
    result = fc.contact.press(
        rough,
        contact_modulus=MODULUS,
        closure=closure,
        influence="square",
        hardness=cap,
        tolerance=1e-12,
        keep=("state", "pressure"),
    )
    assert (exact >= cap).sum() > 2
    np.testing.assert_allclose(result["pressure"][0], exact, atol=1e-6 * cap)


def test_very_high_hardness_changes_nothing():
    options = {"contact_modulus": MODULUS, "nominal_pressure": [1e6, 5e6, 1e6], "keep": ("state", "pressure")}
    free = fc.contact.press(rough_surface(), **options)
    capped = fc.contact.press(rough_surface(), hardness=1e15, **options)
    np.testing.assert_allclose(capped["pressure"], free["pressure"], atol=1e-4 * 1e7)
    assert (capped["plastic_work"] == 0).all()
    low = fc.contact.press(rough_surface(), hardness=1e7, tolerance=1e-12, **options)
    assert (low["contact_fraction"] > free["contact_fraction"]).all()


def test_elastic_path_is_reversible():
    path = np.array([1e5, 1e6, 5e6, 1e6, 1e5])
    options = {"contact_modulus": MODULUS, "tolerance": 1e-12}
    result = fc.contact.press(rough_surface(), nominal_pressure=path, **options)
    for name in ("closure", "elastic_energy", "mean_gap"):
        np.testing.assert_allclose(result[name][::-1], result[name], rtol=1e-9)
    np.testing.assert_array_equal(result["state"][::-1], result["state"])
    assert "plastic_work" not in result


@pytest.mark.parametrize("boundary", ["periodic", "free"])
def test_hysteresis_after_yielding(boundary):
    path = np.array([1e6, 3e6, 5e6, 3e6, 1e6, 0.0, 1e6, 3e6, 5e6])
    maps = ("state", "pressure", "gap", "residual_height")
    options = {"contact_modulus": MODULUS, "boundary": boundary, "hardness": 1e7, "keep": maps}
    result = fc.contact.press(rough_surface(), nominal_pressure=path, tolerance=1e-12, **options)
    closure = result["closure"].values
    assert closure[3] > 1.01 * closure[1]  # hysteresis: more closure for the same force
    assert closure[4] > 1.05 * closure[0]
    assert closure[5] > 0  # what is left of it without force
    np.testing.assert_allclose(closure[6:], closure[4:1:-1], rtol=1e-9)
    np.testing.assert_allclose(result["pressure"][8], result["pressure"][2], atol=1e-7 * 1e7)
    work = result["plastic_work"].values
    assert (np.diff(work[:3]) > 0).all()
    np.testing.assert_allclose(work[2:], work[2], rtol=1e-9)
    assert (result["state"][3:7] < 2).all()


@pytest.mark.parametrize("boundary", ["periodic", "free"])
def test_growing_load_independent_of_steps(boundary):
    options = {"contact_modulus": MODULUS, "boundary": boundary, "hardness": 2e7, "tolerance": 1e-11}
    many = fc.contact.press(rough_surface(), nominal_pressure=np.linspace(0, 1.3e7, 14), **options)
    one = fc.contact.press(rough_surface(), nominal_pressure=1.3e7, **options)
    for name in ("closure", "plastic_work", "elastic_energy", "contact_fraction"):
        assert float(many[name][-1]) == pytest.approx(float(one[name][0]), rel=1e-9)
    np.testing.assert_array_equal(many["state"][-1], one["state"][0])


@pytest.mark.parametrize("boundary", ["periodic", "free"])
def test_residual_height(boundary):
    """Pressed again from its residual height, an unloaded surface answers as it does along the path."""
    options = {"contact_modulus": MODULUS, "boundary": boundary, "tolerance": 1e-12}
    maps = {"hardness": 1e7, "keep": ("state", "residual_height", "pressure")}
    result = fc.contact.press(rough_surface(), nominal_pressure=[5e6, 2e6], **options, **maps)
    left = rough_surface().copy(data=result["residual_height"].values[1])
    lowered = (rough_surface() - left).values
    assert lowered.min() == 0.0
    assert (lowered[result["state"].values[0] != 2] == 0).all()
    assert 0 < lowered.max() < float(result["closure"][0])
    again = fc.contact.press(left, nominal_pressure=2e6, keep=("pressure",), **options)
    np.testing.assert_allclose(again["pressure"][0], result["pressure"][1], atol=1e-7 * 1e7)
    offset = float(rough_surface().max() - left.max())
    assert float(again["closure"][0]) + offset == pytest.approx(float(result["closure"][1]), rel=1e-9)


def test_energy_balance_with_yielding():
    """Along a fine path the work of the force is the elastic energy and what the indentation takes."""
    closure = np.linspace(0.0, 2.5e-5, 60)
    path = np.concatenate([closure, closure[:-16:-1]])
    result = fc.contact.press(rough_surface(), contact_modulus=MODULUS, closure=path, hardness=3e7, keep=())
    force = result["normal_force"].values
    work = np.concatenate([[0.0], np.cumsum(np.diff(path) * (force[1:] + force[:-1]) / 2)])
    stored = (result["elastic_energy"] + result["plastic_work"]).values
    np.testing.assert_allclose(work, stored, atol=2e-3 * work.max())
    assert float(result["plastic_work"][-1]) > 0.1 * work.max()


@pytest.mark.parametrize("boundary", ["periodic", "free"])
def test_flat_surface_yields_at_hardness(boundary):
    flat = fc.surfaces.from_array(np.zeros((16, 16)), 1e-4, periodic=boundary == "periodic")
    options = {"contact_modulus": MODULUS, "hardness": 1e7, "keep": ("pressure", "state", "residual_height")}
    most = 1e7 * 256e-8
    closed = fc.contact.press(flat, closure=[1e-3, 2e-3, 1e-3], **options)
    np.testing.assert_allclose(closed["normal_force"], [most, most, 0.0], rtol=1e-12)
    assert (closed["state"][:2] == 2).all()
    pressed = fc.contact.press(flat, normal_force=[0.3 * most, 0.97 * most], **options)
    np.testing.assert_allclose(
        pressed["pressure"].sum(("y", "x")) * 1e-8, pressed["normal_force"], rtol=1e-12
    )
    assert float(pressed["pressure"].max()) <= 1e7
    if boundary == "periodic":
        np.testing.assert_allclose(closed["residual_height"][1], -2e-3, rtol=1e-15)
        assert (pressed["closure"] == 0).all()


def test_ball_yields_from_centre():
    """Yield begins at the greatest pressure of Hertz, 2 E*/pi sqrt(d/R); far beyond it all is at the cap."""
    n, radius, spacing = 81, 1.0, 1e-3
    x = (np.arange(n) - n // 2) * spacing
    ball = fc.surfaces.from_array(-(x**2 + x[:, None] ** 2) / (2 * radius), spacing)
    depth = (20 * spacing) ** 2 / radius
    greatest = 2 * MODULUS / np.pi * np.sqrt(depth / radius)
    options = {"contact_modulus": MODULUS, "influence": "square", "keep": ("state", "pressure")}
    below = fc.contact.press(ball, closure=depth, hardness=1.02 * greatest, **options)
    assert not (below["state"] == 2).any()
    above = fc.contact.press(ball, closure=depth, hardness=0.9 * greatest, **options)
    yielded = np.argwhere((above["state"] == 2).values[0]) - n // 2
    assert 0 < np.hypot(*yielded.T).max() < 12
    soft = fc.contact.press(ball, closure=depth, hardness=0.002 * greatest, **options)
    cut = np.pi * 2 * depth * radius  # where the flat cuts through the ball
    assert float(soft["contact_area"][0]) == pytest.approx(cut, rel=0.02)
    assert float(soft["normal_force"][0]) == pytest.approx(0.002 * greatest * cut, rel=0.02)


def test_load_above_hardness_is_refused():
    """It is named as it was given, in its own unit."""
    surface = rough_surface()
    with pytest.raises(InvalidInput, match=r"nominal_pressure: .*hardness, 1e\+07 Pa, got 1\.01e\+07 Pa"):
        fc.contact.press(surface, contact_modulus=MODULUS, nominal_pressure=1.01e7, hardness=1e7)
    area = float(fc.contact.press(surface, contact_modulus=MODULUS, closure=0)["nominal_area"])
    with pytest.raises(InvalidInput, match="normal_force: .*hardness times area"):
        fc.contact.press(surface, contact_modulus=MODULUS, normal_force=1.01e7 * area, hardness=1e7)
