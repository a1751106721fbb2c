"""`press` against closed forms, elimination, theorems and invariances."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.resources import limit

MODULUS = 1e9


def sphere(cells, radius=1.0, spacing=1e-4):
    """Return a paraboloid and the approach at which its contact radius is `cells` spacings."""
    half = int(1.3 * cells)
    x = np.arange(-half, half + 1) * spacing
    return fc.surfaces.from_array(-(x**2 + x[:, None] ** 2) / (2 * radius), spacing), (
        cells * spacing
    ) ** 2 / radius


def rough(n=48, **options):
    return fc.surfaces.spectral((n, n), 1e-4, hurst=0.8, rms_height=1e-5, rng=1, **options)


def free(n=24):
    return fc.surfaces.from_array(rough(n).values, 1e-4)


@pytest.mark.parametrize("cells", [6, 12, 25, 50])
@pytest.mark.parametrize(("influence", "bound"), [("disc", 0.06), ("square", 0.06)])
def test_hertz_force_and_energy(cells, influence, bound):
    surface, approach = sphere(cells)
    result = fc.contact.press(
        surface, contact_modulus=MODULUS, closure=approach, influence=influence, keep=()
    )
    force = 4 / 3 * MODULUS * approach**1.5
    assert float(result["normal_force"][0]) == pytest.approx(force, rel=bound / cells**2 + 2e-4)
    energy = 8 / 15 * MODULUS * approach**2.5
    assert float(result["elastic_energy"][0]) == pytest.approx(energy, rel=0.1 / cells**2 + 3e-4)


@pytest.mark.parametrize("n", [64, 256])
@pytest.mark.parametrize(
    ("share", "area", "gap"),
    [(0.05, 0.143566, 0.800213), (0.2, 0.295167, 0.478112), (0.5, 0.5, 0.153426), (0.8, 0.704833, 0.021485)],
)
def test_westergaard_area_and_gap(n, share, area, gap):
    x = np.arange(n) / n
    surface = fc.surfaces.from_array(np.broadcast_to(np.cos(2 * np.pi * x), (n, n)), 1 / n, periodic=True)
    result = fc.contact.press(surface, contact_modulus=1.0, nominal_pressure=share * np.pi, keep=())
    assert float(result["contact_fraction"][0]) == pytest.approx(area, abs=1.25 / n)
    assert float(result["mean_gap"][0]) == pytest.approx(gap, abs=1e-3)
    assert float(result["closure"][0]) == pytest.approx(1 - float(result["mean_gap"][0]), abs=1e-8)


def test_mated_square_blocks():
    flat = fc.surfaces.from_array(np.zeros((128, 128)), 1e-3 / 128)
    result = fc.contact.press(flat, contact_modulus=MODULUS, closure=1e-6, keep=())
    assert float(result["normal_force"][0]) == pytest.approx(1.15230 * MODULUS * 1e-3 * 1e-6, rel=5e-3)
    assert float(result["contact_fraction"][0]) == 1.0
    assert float(result["corrected_contact_fraction"][0]) == 1.0


@pytest.mark.parametrize("influence", ["disc", "square"])
@pytest.mark.parametrize("pressure", [1e3, 1e5, 1e6, 1e7, 1e9])
def test_elimination_matches_fast(influence, pressure):
    options = {"contact_modulus": MODULUS, "influence": influence, "tolerance": 1e-12}
    fast = fc.contact.press(free(), nominal_pressure=pressure, **options)
    paper = fc.contact.press(free(), closure=float(fast["closure"][0]), method="elimination", **options)
    np.testing.assert_array_equal(paper["state"], fast["state"])
    assert float(paper["normal_force"][0]) == pytest.approx(float(fast["normal_force"][0]), rel=1e-10)
    forced = fc.contact.press(free(), nominal_pressure=pressure, method="elimination", **options)
    assert float(forced["closure"][0]) == pytest.approx(float(fast["closure"][0]), rel=1e-10)


@pytest.mark.parametrize("shape", [(400, 8), (8, 400)])
def test_contact_along_one_row_matches_elimination(shape):
    """A box of one row, or of one column, has more candidates than sums over pairs take."""
    rows, columns = np.indices(shape)
    across = np.abs(columns - 4) if shape[0] > shape[1] else np.abs(rows - 4)
    heights = 0.3e-6 * np.random.default_rng(1).standard_normal(shape) - 50e-6 * across
    surface = fc.surfaces.from_array(heights, 1e-4)
    fast = fc.contact.press(surface, contact_modulus=15e9, closure=[1e-6, 2e-6])
    paper = fc.contact.press(surface, contact_modulus=15e9, closure=[1e-6, 2e-6], method="elimination")
    np.testing.assert_allclose(fast["normal_force"], paper["normal_force"], rtol=1e-8)


@pytest.mark.parametrize("boundary", ["periodic", "free"])
def test_controls_agree_and_path_is_reversible(boundary):
    options = {"contact_modulus": MODULUS, "boundary": boundary, "tolerance": 1e-12}
    path = [1e5, 1e6, 1e7, 1e6, 1e5]
    forced = fc.contact.press(rough(), nominal_pressure=path, **options)
    closed = fc.contact.press(rough(), closure=forced["closure"].values, **options)
    np.testing.assert_allclose(closed["nominal_pressure"], path, rtol=1e-9)
    np.testing.assert_array_equal(closed["state"], forced["state"])
    np.testing.assert_array_equal(forced["state"][0], forced["state"][4])
    np.testing.assert_allclose(forced["closure"][1], forced["closure"][3], rtol=1e-9)


@pytest.mark.parametrize("boundary", ["periodic", "free"])
def test_energy_derivative_is_force(boundary):
    closure = 2e-5 * (1 + np.array([-1e-4, 0.0, 1e-4]))
    result = fc.contact.press(
        rough(), contact_modulus=MODULUS, closure=closure, boundary=boundary, tolerance=1e-12
    )
    slope = (result["elastic_energy"][2] - result["elastic_energy"][0]) / (closure[2] - closure[0])
    assert float(slope) == pytest.approx(float(result["normal_force"][1]), rel=1e-4)


def test_contact_grows_with_closure():
    result = fc.contact.press(
        free(32), contact_modulus=MODULUS, closure=np.linspace(0, 4e-5, 9), keep=("pressure",)
    )
    pressure = result["pressure"].values
    assert (np.diff(pressure, axis=0) >= -1e-6 * pressure.max()).all()
    assert (np.diff(pressure > 0, axis=0).astype(int) >= 0).all()


@pytest.mark.parametrize("boundary", ["periodic", "free"])
def test_bits_independent_of_binary_units(boundary):
    surface = rough(96)
    small = fc.surfaces.from_array(surface.values * 2.0**-20, 1e-4 * 2.0**-20, periodic=True)
    options = {"boundary": boundary, "keep": ("pressure", "gap")}
    ours = fc.contact.press(surface, contact_modulus=2.0**30, nominal_pressure=2.0**20, **options)
    theirs = fc.contact.press(small, contact_modulus=2.0**60, nominal_pressure=2.0**50, **options)
    np.testing.assert_array_equal(ours["pressure"] * 2.0**30, theirs["pressure"])
    np.testing.assert_array_equal(ours["gap"] * 2.0**-20, theirs["gap"])
    with limit(1):
        alone = fc.contact.press(surface, contact_modulus=2.0**30, nominal_pressure=2.0**20, **options)
    np.testing.assert_array_equal(ours["pressure"], alone["pressure"])


@pytest.mark.parametrize("shape", [(3, 3), (7, 11), (31, 37), (4, 128)])
@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize("share", [1e-12, 1e-4, 0.03, 10.0])
@pytest.mark.parametrize("modulus", [1e-6, 1e15])
def test_contact_conditions_in_extreme_cases(shape, periodic, share, modulus):
    heights = 1e-6 * np.random.default_rng(5).normal(size=shape)
    surface = fc.surfaces.from_array(heights, 1e-4, periodic=periodic)
    force = share * modulus * 1e-2 * heights.size * 1e-8
    result = fc.contact.press(surface, contact_modulus=modulus, normal_force=force, keep=("pressure", "gap"))
    pressure, gap = result["pressure"].values[0], result["gap"].values[0]
    assert bool(result["converged"][0])
    assert pressure.sum() * 1e-8 == pytest.approx(force, rel=1e-9)
    assert pressure.min() >= 0
    assert gap.min() >= 0
    assert (pressure * gap == 0).all()
    assert float(result["residual"][0]) <= 1e-8


def test_unequal_spacings():
    y, x = np.mgrid[-20:21, -40:41]
    surface = fc.surfaces.from_array(-((2e-4 * y) ** 2 + (1e-4 * x) ** 2) / 2, (2e-4, 1e-4))
    result = fc.contact.press(surface, contact_modulus=MODULUS, closure=4e-6, influence="square", keep=())
    assert float(result["normal_force"][0]) == pytest.approx(4 / 3 * MODULUS * 4e-6**1.5, rel=5e-3)
    disc = fc.contact.press(surface, contact_modulus=MODULUS, closure=4e-6, keep=())
    assert float(disc["normal_force"][0]) == pytest.approx(4 / 3 * MODULUS * 4e-6**1.5, rel=5e-3)
    long = fc.surfaces.from_array(surface.values, (1e-2, 1e-4))
    with pytest.raises(InvalidInput, match="square"):
        fc.contact.press(long, contact_modulus=MODULUS, closure=4e-6)


def test_zero_closure():
    result = fc.contact.press(free(), contact_modulus=MODULUS, closure=[0.0, 1e-6], keep=("state", "gap"))
    assert float(result["normal_force"][0]) == 0.0
    assert float(result["contact_fraction"][0]) == 0.0
    np.testing.assert_allclose(result["gap"][0], free().max() - free(), atol=1e-18)
    assert float(result["normal_force"][1]) > 0
