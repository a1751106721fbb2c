"""Contact problems that lose their digits or never end: solved all the same, or stopped and told."""

import numpy as np
import pytest
from contact.cases import Case, judge

import fractalcontact as fc
from fractalcontact.base.errors import ConvergenceWarning
from fractalcontact.contact import _constrained_cg


def spikes(seed, shape, share, height):
    rng = np.random.default_rng(seed)
    return (rng.random(shape) < share) * rng.random(shape) * height


def spikes_107():
    rng = np.random.default_rng([107, 19])
    shape = int(rng.integers(16, 129)), int(rng.integers(16, 129))
    rng.random(5)  # what the other numbers of the case were drawn with
    return (rng.random(shape) < 0.005) * rng.random(shape) * 5.4e-4


def ball(shape, spacing, radius):
    y, x = ((np.arange(n) - (n - 1) / 2) * spacing for n in shape)
    return -(y[:, None] ** 2 + x**2) / (2 * radius)


def cauchy(seed, shape):
    return np.random.default_rng(seed).standard_cauchy(shape) * 1e-6


def levels(seed, shape, share, height):
    return (np.random.default_rng(seed).random(shape) < share) * height


# heights (m), spacing (m), periodic, E* (Pa), nominal pressure (Pa), hardness over it
CASES = {
    "spikes, spacings 1 to 855, free": (
        spikes(1, (34, 55), 0.02, 5e-3), (4.8e-3, 5.612e-6), False, 1e9, 0.31, 1.6,
    ),
    "spikes, spacings 1 to 1000, periodic": (
        spikes(2, (42, 52), 0.02, 5e-3), (5e-6, 5e-3), True, 1e9, 1.1, 40.0,
    ),
    "spikes, spacings 1 to 476, periodic, of more than 1000 pairs": (
        spikes(8, (160, 160), 0.0015, 6.2e-5), (3.3e-6, 1.57e-3), True, 3.7e8, 0.09, 40.0,
    ),
    "spikes, spacings 1 to 1000, periodic, of forty iterations without progress": (
        spikes_107(), (1.4452577381206096e-06, 1.4452577381206096e-03), True, 912272163.2286087,
        7059.614688657333, 40.0,
    ),
    "two levels, hardness twice the pressure, free": (
        levels(3, (49, 26), 0.1, 3.6e-4), (1e-4, 1e-4), False, 1e9, 7.8, 2.0,
    ),
    "two levels, hardness twice the pressure": (
        levels(4, (30, 50), 0.1, 3.9e-4), (1e-4, 1e-4), True, 1e9, 7.3, 2.0,
    ),
    "ball 1024 x 16, near its hardness": (
        ball((1024, 16), 7e-4, 5.0), (7e-4, 7e-4), False, 3.4e10, 212.2, 1.14,
    ),
    "ball 16 x 1024": (ball((16, 1024), 1e-5, 1e-2), (1e-5, 1e-5), False, 1e11, 1e8, None),
    "Cauchy-distributed heights at 1e15 Pa": (
        cauchy(5, (64, 64)), (1e-5, 1e-5), True, 1e11, 1e15, None,
    ),
    "Cauchy-distributed heights that yield": (
        cauchy(6, (48, 64)), (1e-5, 1e-5), False, 1e11, 1e2, 1.5,
    ),
}  # fmt: skip


def case(name):
    heights, spacing, periodic, modulus, pressure, hardness = CASES[name]
    influence = "spectral" if periodic else "square"
    options = {"contact_modulus": modulus, "influence": influence, "tolerance": 1e-8}
    options["nominal_pressure"] = np.array([pressure])
    if hardness is not None:
        options["hardness"] = hardness * pressure
    return Case(name, heights, spacing, periodic, options)


def pressed(hard):
    surface = fc.surfaces.from_array(hard.heights, hard.spacing, periodic=hard.periodic)
    return fc.contact.press(surface, **hard.options, keep=("state", "pressure", "gap"))


@pytest.mark.parametrize("name", CASES)
def test_hard_case_converges_and_passes_an_independent_judge(name):
    hard = case(name)
    assert judge(hard, pressed(hard)) == []


def test_force_of_a_plane_between_yielded_spikes_is_shared_as_without_them():
    # the spikes carry hardness times area; the plane carries the rest, uniformly, as if they were not there
    heights = np.zeros((40, 40))
    heights[5, 7] = heights[30, 22] = 1e-3
    surface = fc.surfaces.from_array(heights, 1e-4, periodic=True)
    pressure, hardness = 1.0, 3.0
    result = fc.contact.press(
        surface, contact_modulus=1e9, nominal_pressure=pressure, hardness=hardness, keep=("pressure",)
    )
    assert bool(result["converged"][0])
    found = result["pressure"].values[0]
    assert (found[heights > 0] == hardness).all()
    assert found[heights == 0].sum() == pytest.approx(1600 * pressure - 2 * hardness, rel=1e-9)
    assert found[0, 39] == pytest.approx((1600 * pressure - 2 * hardness) / 1598, rel=0.01)


def test_work_is_bounded_and_told(monkeypatch):
    monkeypatch.setattr(_constrained_cg, "MAX_ITERATIONS", 3)
    surface = fc.surfaces.spectral((64, 64), 1e-5, hurst=0.7, rms_slope=0.1, rng=1)
    told = r"step 1: iteration_limit after \d+ pairs of transforms"
    with pytest.warns(ConvergenceWarning, match=told):
        result = fc.contact.press(
            surface, contact_modulus=1e9, nominal_pressure=[0.0, 1e6], keep=("pressure", "displacement")
        )
    assert result["converged"].values.tolist() == [True, False]
    meanings = result["stop_reason"].flag_meanings.split()
    assert [meanings[flag] for flag in result["stop_reason"].values] == ["converged", "iteration_limit"]
    assert float(result["residual"][1]) > 1e-8
    np.testing.assert_allclose(result["pressure"][1].mean(), 1e6, rtol=1e-12)  # the force is kept
    assert int(result["iterations"][1]) == 3
    # the closure is that of the pressure returned, not of the one before the last step
    pressure, displacement = result["pressure"].values[1], result["displacement"].values[1]
    level = displacement + surface.values.max() - surface.values
    assert float(result["closure"][1]) == pytest.approx((pressure * level).sum() / pressure.sum(), rel=1e-10)
