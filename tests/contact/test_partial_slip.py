"""Partial slip: Cattaneo's ball, a dense reference, full slip, nested stick sets, rotation, bad input."""

import json
from itertools import pairwise

import numpy as np
import pytest
from scipy.optimize import brentq, lsq_linear
from slip_cases import (
    ALL,
    COMPLIANCE,
    CONTACT_RADIUS,
    FORCE,
    FRICTION,
    LIMIT,
    MODULUS,
    POISSON,
    ball,
    loop_energy,
    mindlin_displacement,
    rough,
    sheared,
)

import fractalcontact as fc
from fractalcontact.base.errors import AnisotropyWarning, InvalidInput


def sheared_ball(cells, shares, keep=()):
    return fc.contact.partial_slip(
        ball(cells),
        contact_modulus=MODULUS,
        poisson=POISSON,
        friction_coefficient=FRICTION,
        normal_force=FORCE,
        tangential_force=LIMIT * np.asarray(shares),
        keep=keep,
    )


def test_cattaneo_mindlin_ball():
    shares = np.array([0.2, 0.5, 0.8])
    result = sheared_ball(30, shares, keep=("traction_x",))
    np.testing.assert_allclose(result["tangential_displacement"], mindlin_displacement(shares), rtol=1e-3)
    radius = np.sqrt(result["stick_area"].values / np.pi)
    np.testing.assert_allclose(radius, CONTACT_RADIUS * (1 - shares) ** (1 / 3), rtol=1e-2)
    stiffness = 8 * CONTACT_RADIUS / COMPLIANCE * (1 - shares) ** (1 / 3)
    np.testing.assert_allclose(result["tangential_stiffness"], stiffness, rtol=1e-2)
    r = np.hypot(result["x"] - result["x"].mean(), result["y"] - result["y"].mean())
    for step, share in enumerate(shares):
        stick = CONTACT_RADIUS * (1 - share) ** (1 / 3)
        shape = np.sqrt(np.maximum(CONTACT_RADIUS**2 - r**2, 0)) - np.sqrt(np.maximum(stick**2 - r**2, 0))
        exact = 3 * LIMIT / (2 * np.pi * CONTACT_RADIUS**3) * shape
        error = abs(result["traction_x"][step] - exact) / float(exact.max())
        assert float(error.where(r < CONTACT_RADIUS).mean()) < 5e-3
        smooth = (abs(r - stick) > CONTACT_RADIUS / 15) & (abs(r - CONTACT_RADIUS) > CONTACT_RADIUS / 15)
        assert float(error.where(smooth).max()) < 1e-2  # the slope is infinite at both edges


def test_ball_converges():
    coarse, fine = (sheared_ball(cells, [0.5, -0.5, 0.5]) for cells in (12, 48))
    errors = []
    for result in (coarse, fine):
        energy = result["dissipated_energy"].values
        errors.append(abs((energy[2] - energy[0]) / loop_energy(0.5) - 1))
    assert errors[1] < 1e-3 < errors[0] < 3e-2
    exact = mindlin_displacement(0.5)
    one, four = (abs(float(r["tangential_displacement"][0]) / exact - 1) for r in (coarse, fine))
    assert four < one


@pytest.mark.parametrize("share", [0.2, 0.5, 1.0])
def test_hysteresis_loop_of_ball(share):
    reversal = np.concatenate([np.linspace(share, -share, 9), np.linspace(-share, share, 9)])
    result = sheared_ball(30, reversal)
    top, change = mindlin_displacement(share), share - reversal
    unloading = top - 2 * mindlin_displacement(change / 2)
    reloading = -top + 2 * mindlin_displacement((share + reversal) / 2)
    exact = np.where(np.arange(18) < 9, unloading, reloading)
    np.testing.assert_allclose(result["tangential_displacement"], exact, atol=2e-3 * top)
    energy = result["dissipated_energy"].values
    assert energy[-1] - energy[0] == pytest.approx(loop_energy(share), rel=1e-2)
    assert (np.diff(energy) >= 0).all()


def dense_operator(surface, modulus, radius):
    """Return K of rigid circular plates, node by node."""
    y, x = np.meshgrid(surface["y"], surface["x"], indexing="ij")
    y, x = y.ravel(), x.ravel()
    distance = np.hypot(y[:, None] - y, x[:, None] - x)
    with np.errstate(divide="ignore"):
        table = np.arcsin(np.minimum(radius / distance, 1)) / (np.pi * radius * modulus)
    np.fill_diagonal(table, 1 / (2 * radius * modulus))
    return table


def dense_increment(operator, traction, bound, change):
    """Return the nodal forces after a step of Coulomb friction in one direction, by least elastic work.

    Minimise dq K dq / 2 with |q + dq| <= bound and sum dq = change; the displacement is the multiplier.
    """
    root = np.linalg.cholesky(operator).T
    right = np.linalg.solve(root.T, np.ones(bound.size))

    def under(displacement):
        limits = (-bound - traction, bound - traction)
        return lsq_linear(root, right * displacement, limits, method="bvls", tol=1e-14).x

    reach = 20 * abs(change) * operator.max()
    displacement = brentq(lambda d: under(d).sum() - change, -reach, reach, xtol=1e-12 * reach)
    return traction + under(displacement), displacement


def test_dense_reference_without_poisson_effect():
    """At nu = 0 the superposition is exact: loading, reversal, an inner loop, and beyond it."""
    surface = rough(16, periodic=False)
    forces = np.array([0.25, 0.05, 0.15, -0.2, 0.3])
    result = sheared(surface, forces, poisson=0.0, normal_force=1.0, tolerance=1e-11)
    pressed = fc.contact.press(
        surface, contact_modulus=MODULUS, normal_force=1.0, keep=("pressure",), tolerance=1e-11
    )
    force = pressed["pressure"].values.ravel() * 1e-10
    contact = force > 0
    operator = dense_operator(surface, MODULUS, float(result["disc_radius"]))[contact][:, contact]
    traction, displacement, last = np.zeros(contact.sum()), 0.0, 0.0
    for step, target in enumerate(forces):
        traction, moved = dense_increment(operator, traction, FRICTION * force[contact], target - last)
        displacement, last = displacement + moved, target
        found = result["traction_x"][step].values.ravel()[contact] * 1e-10
        np.testing.assert_allclose(found, traction, atol=1e-6 * FRICTION * force.max())
        assert float(result["tangential_displacement"][step]) == pytest.approx(displacement, rel=1e-6)
        sticks = result["slip_state"][step].values.ravel()[contact] == 1
        np.testing.assert_array_equal(sticks, abs(traction) < FRICTION * force[contact] * (1 - 1e-9))


@pytest.mark.parametrize("periodic", [True, False])
def test_full_slip_is_friction_times_pressure(periodic):
    surface = rough(periodic=periodic)
    result = sheared(surface, [FRICTION, -FRICTION], normal_force=1.0)
    pressed = fc.contact.press(surface, contact_modulus=MODULUS, normal_force=1.0, keep=("pressure",))
    pressure = pressed["pressure"][0].values
    np.testing.assert_allclose(result["traction_x"][0], FRICTION * pressure, rtol=1e-12)
    np.testing.assert_allclose(
        result["traction_x"][1], -FRICTION * pressure, atol=1e-14 * FRICTION * pressure.max()
    )
    assert not result["stick_area"].any()
    np.testing.assert_array_equal(result["tangential_stiffness"], 0)
    np.testing.assert_array_equal(result["slip_state"][0], 2 * (pressure > 0))


@pytest.mark.parametrize("periodic", [True, False])
def test_stick_set_is_contact_at_reduced_force(periodic):
    surface, shares = rough(64, periodic=periodic), np.array([0.0, 0.1, 0.4, 0.7, 0.95])
    result = sheared(surface, FRICTION * shares, tolerance=1e-11)
    pressed = fc.contact.press(
        surface, contact_modulus=MODULUS, normal_force=1 - shares, keep=("state",), tolerance=1e-11
    )
    stick = result["slip_state"].values == 1
    np.testing.assert_array_equal(stick, pressed["state"].values == 1)
    np.testing.assert_array_equal(result["slip_state"].values > 0, np.broadcast_to(stick[0], stick.shape))
    for before, after in pairwise(stick):
        assert not (after & ~before).any()
        assert after.sum() < before.sum()
    np.testing.assert_allclose(result["stick_area"], stick.sum((1, 2)) * 1e-10)
    np.testing.assert_allclose(result["stick_area"] + result["slip_area"], result["contact_area"])
    np.testing.assert_allclose(result["contact_area"], pressed["contact_area"][0])


def test_traction_is_admissible():
    """The sum is the force; |q| <= mu p; where it slips q = mu p and the slip is towards the force."""
    surface = rough(64)
    result = sheared(surface, [0.1, 0.3], tolerance=1e-11)
    pressed = fc.contact.press(
        surface, contact_modulus=MODULUS, normal_force=1.0, keep=("pressure",), tolerance=1e-11
    )
    bound = FRICTION * pressed["pressure"][0]
    slack = 1e-7 * float(bound.max())
    traction, slips = result["traction_x"], result["slip_state"] == 2
    np.testing.assert_allclose(traction.sum(("y", "x")) * 1e-10, [0.1, 0.3], rtol=1e-9)
    assert float(traction.min()) > -slack
    assert float((traction - bound).max()) < slack
    assert float(abs(traction - bound).where(slips).max()) < slack
    assert float(result["slip_x"].where(slips).min()) > 0
    assert not result["slip_x"].where(~slips, 0).any()


def test_work_is_stored_or_dissipated():
    """The area of a closed loop of force and displacement is what its slip dissipates."""
    forces = np.concatenate([np.linspace(0, 0.32, 24), np.linspace(0.32, -0.2, 41)[1:]])
    forces = np.concatenate([forces, np.linspace(-0.2, 0.32, 41)[1:]])
    result = sheared(rough(), forces, keep=(), tolerance=1e-10)
    displacement = result["tangential_displacement"].values[23:]
    force, energy = forces[23:], result["dissipated_energy"].values
    area = np.sum(np.diff(displacement) * (force[1:] + force[:-1]) / 2)
    assert energy[-1] - energy[23] == pytest.approx(area, rel=5e-3)
    assert (np.diff(energy) >= 0).all()
    assert energy[-1] > energy[23]


def test_stiffness_is_slope_of_the_path():
    forces = 0.2 + 1e-5 * np.array([-1, 0, 1])  # less than unloads a node
    result = sheared(rough(), forces, keep=(), tolerance=1e-12)
    slope = 2e-5 / float(np.diff(result["tangential_displacement"].values[[0, 2]])[0])
    assert float(result["tangential_stiffness"][1]) == pytest.approx(slope, rel=1e-4)


def test_closed_inner_loops_are_forgotten():
    straight = sheared(rough(), [0.1, 0.3, -0.25], tolerance=1e-11)
    path = [0.1, 0.2, 0.1, 0.15, 0.05, 0.2, 0.3, 0.0, 0.2, -0.1, 0.0, -0.25]
    loops = sheared(rough(), path, tolerance=1e-11)
    for name in ("traction_x", "slip_x", "tangential_displacement", "slip_state"):
        scale = float(abs(straight[name]).max())
        np.testing.assert_allclose(loops[name][-1], straight[name][-1], atol=1e-8 * scale)
    assert float(loops["dissipated_energy"][-1]) > float(straight["dissipated_energy"][-1])


def test_stiffness_at_the_end_of_a_loop_is_that_of_a_further_step():
    """Up to there the stick set is that of the loop; beyond, the path goes on as without it."""
    result = sheared(rough(), [0.3, 0.1, 0.3, 0.1 + 0.2, 0.3 + 1e-5, -0.3, 0.3], keep=(), tolerance=1e-10)
    stiffness, stuck = result["tangential_stiffness"].values, result["stick_area"].values
    np.testing.assert_allclose(stiffness[[2, 3, 4, 6]], stiffness[0], rtol=1e-3)
    assert stiffness[1] > 1.01 * stiffness[0]
    assert stuck[1] == stuck[2] > stuck[0]


@pytest.mark.parametrize("method", ["superposition", "full"])
def test_a_pause_of_the_force_changes_nothing(method):
    result = sheared(rough(), [0.3, 0.3, -0.2, -0.2, -0.2], method=method)
    for name in ("tangential_displacement", "tangential_stiffness", "dissipated_energy", "stick_area", *ALL):
        values = result[name].values
        np.testing.assert_array_equal(values[[1, 3, 4]], values[[0, 2, 2]])
    assert not result["iterations"].values[[1, 3, 4]].any()


def test_cycles_repeat():
    result = sheared(rough(), [0.3, -0.3] * 4, keep=("traction_x",))
    energy = np.diff(result["dissipated_energy"].values)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-12)
    np.testing.assert_allclose(result["traction_x"][6], result["traction_x"][0], rtol=1e-12)
    assert np.count_nonzero(result["iterations"]) == 1  # -0.3 and 0.3 use the same two normal solutions


def test_rotation_of_surface_and_force():
    surface = rough(periodic=False)
    turned = fc.surfaces.from_array(np.rot90(surface.values, -1), 1e-5)  # row 0 is the south edge
    one = sheared(surface, [0.2, -0.1], direction=30.0, tolerance=1e-11)
    other = sheared(turned, [0.2, -0.1], direction=120.0, tolerance=1e-11)
    for name in ("tangential_displacement", "dissipated_energy", "tangential_stiffness"):
        np.testing.assert_allclose(other[name], one[name], rtol=1e-6)
    np.testing.assert_array_equal(other["slip_state"], np.rot90(one["slip_state"].values, -1, axes=(1, 2)))
    scale = 1e-8 * float(abs(one["traction_x"]).max())
    x, y = (np.rot90(one[name].values, -1, axes=(1, 2)) for name in ("traction_x", "traction_y"))
    np.testing.assert_allclose(other["traction_x"], -y, atol=scale)
    np.testing.assert_allclose(other["traction_y"], x, atol=scale)


@pytest.mark.parametrize(
    ("direction", "name", "sign"), [(0, "x", 1), ("N", "y", 1), (180, "x", -1), (-90, "y", -1)]
)
def test_force_along_an_axis(direction, name, sign):
    result = sheared(rough(), 0.1, direction=direction)
    other = {"x": "y", "y": "x"}[name]
    assert not result[f"traction_{other}"].any()
    assert float(result[f"traction_{name}"].sum()) * 1e-10 == pytest.approx(sign * 0.1)


def test_loads_given_three_ways():
    surface = rough()
    area = 48**2 * 1e-10
    force = sheared(surface, 0.2, keep=(), tolerance=1e-11)
    pressure = sheared(surface, 0.2, keep=(), tolerance=1e-11, nominal_pressure=1 / area)
    closure = sheared(surface, 0.2, keep=(), tolerance=1e-11, closure=float(force["closure"]))
    for other in (pressure, closure):
        for name in ("tangential_displacement", "dissipated_energy", "normal_force", "closure"):
            assert float(other[name].squeeze()) == pytest.approx(float(force[name].squeeze()), rel=1e-6)


@pytest.mark.filterwarnings("ignore::fractalcontact.base.errors.AnisotropyWarning")  # of this surface at .5
def test_stiffness_ratio_of_stuck_contact():
    """k_t / k_n = 2 (1 - nu)/(2 - nu)."""
    surface = rough()
    pressed = fc.contact.press(
        surface, contact_modulus=MODULUS, normal_force=[0.999, 1.001], keep=(), tolerance=1e-12
    )
    normal = 0.002 / float(np.diff(pressed["closure"].values)[0])
    for poisson in (0.0, 0.3, 0.5):
        stuck = sheared(surface, 0.0, keep=(), poisson=poisson)
        exact = normal * 2 * (1 - poisson) / (2 - poisson)
        assert float(stuck["tangential_stiffness"][0]) == pytest.approx(exact, rel=2e-3)


def test_no_tangential_force():
    result = sheared(rough(), [0.0, 0.0])
    for name in ("traction_x", "traction_y", "slip_x", "slip_y", "tangential_displacement", "slip_area"):
        assert not result[name].any()
    assert not result["dissipated_energy"].any()
    assert (result["stick_area"] == result["contact_area"]).all()


def test_no_load_at_all():
    result = sheared(rough(), 0.0, normal_force=0.0)
    assert not result["slip_state"].any()
    assert float(result["tangential_displacement"][0]) == 0
    assert float(result["tangential_stiffness"][0]) == 0


@pytest.mark.parametrize("periodic", [True, False])
def test_flat_surface_sticks_until_it_slides(periodic):
    flat = fc.surfaces.from_array(np.zeros((12, 12)), 1e-5, periodic=periodic)
    result = sheared(flat, [0.2, 0.399, 0.4])
    np.testing.assert_array_equal(result["slip_state"][:, 5, 5], [1, 1, 2])
    area = 144e-10
    np.testing.assert_allclose(result["stick_area"], [area, area, 0])
    if periodic:  # the mean displacement of a periodic body is a rigid motion
        np.testing.assert_allclose(result["traction_x"][0], 0.2 / area)
        assert not result["tangential_displacement"].any()
        assert np.isnan(result["tangential_stiffness"][:2]).all()
        assert "rigid bodies" in result["tangential_stiffness"].attrs["reason"]
    else:
        stiffness = fc.contact.flat_stiffness((12, 12), 1e-5, contact_modulus=MODULUS)
        ratio = (2 - POISSON) / (2 - 2 * POISSON)
        np.testing.assert_allclose(result["tangential_stiffness"][0], stiffness / ratio, rtol=1e-6)
        np.testing.assert_allclose(result["tangential_displacement"][0], 0.2 * ratio / stiffness, rtol=1e-6)


@pytest.mark.parametrize("method", ["superposition", "full"])
def test_full_contact_of_a_periodic_rough_surface_has_no_bounded_stiffness(method):
    """A soft body under a load that closes every gap: found by the fuzzers as an infinite number."""
    surface = fc.surfaces.spectral((16, 16), 1e-4, hurst=0.5, rms_height=1e-6, rng=1)
    bodies = {"contact_modulus": 2.0, "poisson": 0.2, "friction_coefficient": 0.5, "nominal_pressure": 1e4}
    forces = [0.001, 0.01]
    result = fc.contact.partial_slip(surface, tangential_force=forces, method=method, **bodies)
    np.testing.assert_allclose(result["contact_area"], result["nominal_area"])
    assert np.isnan(result["tangential_stiffness"]).all()
    assert "rigid bodies" in result["tangential_stiffness"].attrs["reason"]


def test_one_node_in_contact():
    heights = np.zeros((9, 9))
    heights[4, 4] = 1.0
    result = sheared(fc.surfaces.from_array(heights, 1e-5), [0.3, 0.4])
    np.testing.assert_array_equal(result["slip_state"].values.reshape(2, -1).sum(1), [1, 2])
    stiffness = 2 * MODULUS * float(result["disc_radius"]) * (2 - 2 * POISSON) / (2 - POISSON)
    np.testing.assert_allclose(result["tangential_displacement"], np.array([0.3, 0.4]) / stiffness)
    assert float(result["tangential_stiffness"][0]) == pytest.approx(stiffness)
    assert float(result["traction_x"][0, 4, 4]) == pytest.approx(0.3e10)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"friction_coefficient": 0.0}, "friction_coefficient"),
        ({"friction_coefficient": -0.1}, "friction_coefficient"),
        ({"friction_coefficient": np.nan}, "friction_coefficient"),
        ({"poisson": 0.6}, "poisson"),
        ({"direction": np.nan}, "direction"),
        ({"method": "fast"}, "method"),
        ({"keep": ("state",)}, "keep"),
        ({"normal_force": [1.0, 2.0]}, "the normal load is constant"),
        ({"normal_force": 1.0, "closure": 1e-6}, "exactly one"),
        ({"tangential_force": [0.1, np.nan]}, "tangential_force"),
        ({"tangential_force": []}, "tangential_force"),
        ({"tangential_force": [0.1, -0.5]}, "0.4 N, where sliding begins"),
        ({"normal_force": 0.0, "tangential_force": 0.1}, "sliding begins"),
    ],
)
def test_bad_input(wrong, message):
    given = {"forces": 0.1} | {("forces" if k == "tangential_force" else k): v for k, v in wrong.items()}
    with pytest.raises(InvalidInput, match=message):
        sheared(rough(12), given.pop("forces"), **given)


def test_bad_input_with_imposed_closure():
    surface = rough(12)
    closure = 0.2 * float(surface.max() - surface.mean())
    with pytest.raises(InvalidInput, match="sliding begins"):
        sheared(surface, 1e3, closure=closure)
    with pytest.raises(InvalidInput, match="mean plane"):
        sheared(surface, 1e-3, closure=2 * float(surface.max() - surface.mean()))


def test_surface_with_gaps_is_refused():
    with pytest.raises(InvalidInput, match="surface"):
        sheared(rough(12).where(rough(12).x > 2e-5), 0.1)


@pytest.mark.parametrize(
    ("poisson", "periodic"),
    [
        (0.2, True),
        (0.5, True),
        (0.2, False),
        pytest.param(0.5, False, marks=pytest.mark.slow),
    ],
)
def test_bound_of_the_superposition_under_a_lay(poisson, periodic):
    """Across ridges the displacement is lambda times too great, along them 1 - nu/2 times the true one."""
    x = 1e-5 * np.arange(128)
    ridges = 1e-5 * np.cos(2 * np.pi * x / 64e-5) * np.ones((8 if periodic else 128, 1))
    surface = fc.surfaces.from_array(ridges, 1e-5, periodic=periodic)
    given = {"poisson": poisson, "keep": (), "normal_force": 5e5 * ridges.size * 1e-10}
    force = 0.1 * FRICTION * given["normal_force"]
    bounds = {"E": (2 - poisson) / (2 - 2 * poisson), "N": 1 - poisson / 2}
    for direction, bound in bounds.items():
        with pytest.warns(AnisotropyWarning, match="use method='full'"):
            simple = sheared(surface, force, direction=direction, **given)
        chosen = sheared(surface, force, direction=direction, method=None, **given)
        full = sheared(surface, force, direction=direction, method="full", **given)
        ratio = float(simple["tangential_displacement"][0] / full["tangential_displacement"][0])
        np.testing.assert_array_equal(chosen["tangential_displacement"], full["tangential_displacement"])
        assert json.loads(chosen.attrs["provenance"])["method"] == "full"
        error = float(simple["superposition_error"])
        if periodic:
            assert ratio == pytest.approx(bound, rel=1e-6)
            assert error == pytest.approx(bound - 1, rel=1e-6)
        else:  # ridges of finite length are between
            assert min(bound, 1) < ratio < max(bound, 1)
            assert error == pytest.approx(ratio - 1, abs=0.25 * abs(bound - 1))


@pytest.mark.parametrize("poisson", [0.0, 0.2])
def test_superposition_is_the_choice_without_a_lay(poisson):
    for surface in (ball(12), rough(64)):
        chosen = sheared(surface, [0.1, -0.1], method=None, poisson=poisson, keep=())
        simple = sheared(surface, [0.1, -0.1], poisson=poisson, keep=())
        assert json.loads(chosen.attrs["provenance"])["method"] == "superposition"
        np.testing.assert_array_equal(chosen["tangential_displacement"], simple["tangential_displacement"])
        assert abs(float(chosen["superposition_error"])) < (0.03 if poisson else 1e-15)
    assert float(sheared(ball(12), 0.1, keep=())["superposition_error"]) == pytest.approx(0, abs=1e-3)
