"""Press held against closed forms, the paper's elimination, theorems and invariances."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.threads import limit

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
def test_hertz(cells, influence, bound):
    face, approach = sphere(cells)
    found = fc.contact.press(face, contact_modulus=MODULUS, closure=approach, influence=influence, keep=())
    force = 4 / 3 * MODULUS * approach**1.5
    assert float(found["normal_force"][0]) == pytest.approx(force, rel=bound / cells**2 + 2e-4)
    energy = 8 / 15 * MODULUS * approach**2.5
    assert float(found["elastic_energy"][0]) == pytest.approx(energy, rel=0.1 / cells**2 + 3e-4)


@pytest.mark.parametrize("n", [64, 256])
@pytest.mark.parametrize(
    ("share", "area", "gap"),
    [(0.05, 0.143566, 0.800213), (0.2, 0.295167, 0.478112), (0.5, 0.5, 0.153426), (0.8, 0.704833, 0.021485)],
)
def test_westergaard(n, share, area, gap):
    x = np.arange(n) / n
    face = fc.surfaces.from_array(np.broadcast_to(np.cos(2 * np.pi * x), (n, n)), 1 / n, periodic=True)
    found = fc.contact.press(face, contact_modulus=1.0, nominal_pressure=share * np.pi, keep=())
    assert float(found["contact_fraction"][0]) == pytest.approx(area, abs=1.25 / n)
    assert float(found["mean_gap"][0]) == pytest.approx(gap, abs=1e-3)
    assert float(found["closure"][0]) == pytest.approx(1 - float(found["mean_gap"][0]), abs=1e-8)


def test_two_mated_square_blocks():
    flat = fc.surfaces.from_array(np.zeros((128, 128)), 1e-3 / 128)
    found = fc.contact.press(flat, contact_modulus=MODULUS, closure=1e-6, keep=())
    assert float(found["normal_force"][0]) == pytest.approx(1.15230 * MODULUS * 1e-3 * 1e-6, rel=5e-3)
    assert float(found["contact_fraction"][0]) == 1.0
    assert float(found["corrected_contact_fraction"][0]) == 1.0


@pytest.mark.parametrize("influence", ["disc", "square"])
@pytest.mark.parametrize("pressure", [1e3, 1e5, 1e6, 1e7, 1e9])
def test_the_papers_elimination_finds_the_same_set_and_force(influence, pressure):
    options = {"contact_modulus": MODULUS, "influence": influence, "tolerance": 1e-12}
    fast = fc.contact.press(free(), nominal_pressure=pressure, **options)
    paper = fc.contact.press(free(), closure=float(fast["closure"][0]), method="elimination", **options)
    np.testing.assert_array_equal(paper["state"], fast["state"])
    assert float(paper["normal_force"][0]) == pytest.approx(float(fast["normal_force"][0]), rel=1e-10)
    forced = fc.contact.press(free(), nominal_pressure=pressure, method="elimination", **options)
    assert float(forced["closure"][0]) == pytest.approx(float(fast["closure"][0]), rel=1e-10)


@pytest.mark.parametrize("boundary", ["periodic", "free"])
def test_closure_and_force_control_give_the_same_and_a_path_comes_back(boundary):
    options = {"contact_modulus": MODULUS, "boundary": boundary, "tolerance": 1e-12}
    path = [1e5, 1e6, 1e7, 1e6, 1e5]
    forced = fc.contact.press(rough(), nominal_pressure=path, **options)
    closed = fc.contact.press(rough(), closure=forced["closure"].values, **options)
    np.testing.assert_allclose(closed["nominal_pressure"], path, rtol=1e-9)
    np.testing.assert_array_equal(closed["state"], forced["state"])
    np.testing.assert_array_equal(forced["state"][0], forced["state"][4])
    np.testing.assert_allclose(forced["closure"][1], forced["closure"][3], rtol=1e-9)


@pytest.mark.parametrize("boundary", ["periodic", "free"])
def test_the_derivative_of_the_energy_is_the_force(boundary):
    closure = 2e-5 * (1 + np.array([-1e-4, 0.0, 1e-4]))
    found = fc.contact.press(
        rough(), contact_modulus=MODULUS, closure=closure, boundary=boundary, tolerance=1e-12
    )
    slope = (found["elastic_energy"][2] - found["elastic_energy"][0]) / (closure[2] - closure[0])
    assert float(slope) == pytest.approx(float(found["normal_force"][1]), rel=1e-4)


def test_a_contact_only_grows_with_closure():
    found = fc.contact.press(
        free(32), contact_modulus=MODULUS, closure=np.linspace(0, 4e-5, 9), keep=("pressure",)
    )
    pressure = found["pressure"].values
    assert (np.diff(pressure, axis=0) >= -1e-6 * pressure.max()).all()
    assert (np.diff(pressure > 0, axis=0).astype(int) >= 0).all()


@pytest.mark.parametrize("boundary", ["periodic", "free"])
def test_units_by_powers_of_two_and_threads_change_no_bit(boundary):
    face = rough(96)
    small = fc.surfaces.from_array(face.values * 2.0**-20, 1e-4 * 2.0**-20, periodic=True)
    options = {"boundary": boundary, "keep": ("pressure", "gap")}
    ours = fc.contact.press(face, contact_modulus=2.0**30, nominal_pressure=2.0**20, **options)
    theirs = fc.contact.press(small, contact_modulus=2.0**60, nominal_pressure=2.0**50, **options)
    np.testing.assert_array_equal(ours["pressure"] * 2.0**30, theirs["pressure"])
    np.testing.assert_array_equal(ours["gap"] * 2.0**-20, theirs["gap"])
    with limit(1):
        alone = fc.contact.press(face, contact_modulus=2.0**30, nominal_pressure=2.0**20, **options)
    np.testing.assert_array_equal(ours["pressure"], alone["pressure"])


@pytest.mark.parametrize("shape", [(3, 3), (7, 11), (31, 37), (4, 128)])
@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize("share", [1e-12, 1e-4, 0.03, 10.0])
@pytest.mark.parametrize("modulus", [1e-6, 1e15])
def test_every_corner_satisfies_the_conditions_of_contact(shape, periodic, share, modulus):
    heights = 1e-6 * np.random.default_rng(5).normal(size=shape)
    face = fc.surfaces.from_array(heights, 1e-4, periodic=periodic)
    force = share * modulus * 1e-2 * heights.size * 1e-8
    found = fc.contact.press(face, contact_modulus=modulus, normal_force=force, keep=("pressure", "gap"))
    pressure, gap = found["pressure"].values[0], found["gap"].values[0]
    assert bool(found["converged"][0])
    assert pressure.sum() * 1e-8 == pytest.approx(force, rel=1e-9)
    assert pressure.min() >= 0
    assert gap.min() >= 0
    assert (pressure * gap == 0).all()
    assert float(found["residual"][0]) <= 1e-8


def test_unequal_spacings_take_square_cells():
    y, x = np.mgrid[-20:21, -40:41]
    face = fc.surfaces.from_array(-((2e-4 * y) ** 2 + (1e-4 * x) ** 2) / 2, (2e-4, 1e-4))
    found = fc.contact.press(face, contact_modulus=MODULUS, closure=4e-6, influence="square", keep=())
    assert float(found["normal_force"][0]) == pytest.approx(4 / 3 * MODULUS * 4e-6**1.5, rel=5e-3)
    disc = fc.contact.press(face, contact_modulus=MODULUS, closure=4e-6, keep=())
    assert float(disc["normal_force"][0]) == pytest.approx(4 / 3 * MODULUS * 4e-6**1.5, rel=5e-3)
    long = fc.surfaces.from_array(face.values, (1e-2, 1e-4))
    with pytest.raises(InvalidInput, match="square"):
        fc.contact.press(long, contact_modulus=MODULUS, closure=4e-6)


def test_nothing_pressed_is_nothing_touched():
    found = fc.contact.press(free(), contact_modulus=MODULUS, closure=[0.0, 1e-6], keep=("state", "gap"))
    assert float(found["normal_force"][0]) == 0.0
    assert float(found["contact_fraction"][0]) == 0.0
    np.testing.assert_allclose(found["gap"][0], free().max() - free(), atol=1e-18)
    assert float(found["normal_force"][1]) > 0


def test_effective_modulus():
    assert fc.contact.effective_modulus(30e9, 0.2) == pytest.approx(30e9 / (2 * 0.96))
    soft_and_rigid = fc.contact.effective_modulus(1e9, 0.3, 1e30, 0.3)
    assert soft_and_rigid == pytest.approx(1e9 / 0.91)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"contact_modulus": -1, "closure": 1e-6, "normal_force": 2.0}, ("contact_modulus", "exactly one")),
        ({"contact_modulus": 1e9}, ("exactly one",)),
        ({"contact_modulus": 1e9, "closure": -1e-6}, ("closure",)),
        ({"contact_modulus": 1e9, "closure": np.nan}, ("closure",)),
        (
            {"contact_modulus": 1e9, "closure": 1e-6, "boundary": "periodic", "influence": "disc"},
            ("spectral",),
        ),
        (
            {"contact_modulus": 1e9, "closure": 1e-6, "method": "slow", "tolerance": 2.0},
            ("method", "tolerance"),
        ),
        ({"contact_modulus": 1e9, "closure": 1e-6, "keep": ("colour",)}, ("colour",)),
    ],
)
def test_bad_input_is_listed(options, words):
    with pytest.raises(InvalidInput) as caught:
        fc.contact.press(rough(16), **options)
    for word in words:
        assert word in str(caught.value)


def test_a_word_that_is_no_boundary_is_one_problem():
    with pytest.raises(InvalidInput, match="1 problem\n") as caught:
        fc.contact.press(free(), contact_modulus=MODULUS, closure=1e-6, boundary="Free")
    assert "'free', 'periodic'" in str(caught.value)


def test_a_free_face_is_never_called_periodic():
    with pytest.raises(InvalidInput, match="periodic"):
        fc.contact.press(free(), contact_modulus=MODULUS, closure=1e-6, boundary="periodic")
