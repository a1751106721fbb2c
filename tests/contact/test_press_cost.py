"""Cost of a solution: transforms, memory, windows; and bits independent of threads and units."""

import itertools
import json
import tracemalloc

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base import fft, resources
from fractalcontact.base.resources import limit
from fractalcontact.contact import _window_solver
from fractalcontact.contact._constrained_cg import ConstrainedCG

MODULUS = 2.0**30


def rough(n, periodic=True, seed=3):
    cutoffs = {"long_cutoff": n / 4 * 1e-4, "short_cutoff": 4e-4}
    surface = fc.surfaces.spectral((n, n), 1e-4, hurst=0.8, rms_slope=0.1, rng=seed, **cutoffs)
    return surface if periodic else fc.surfaces.from_array(surface.values, 1e-4)


def press(surface, **options):
    return fc.contact.press(surface, contact_modulus=MODULUS, **{"keep": (), "tolerance": 1e-6, **options})


def same_bits(ours, theirs, exponents):
    for name, exponent in exponents.items():
        np.testing.assert_array_equal(
            np.ldexp(ours[name].values, exponent), theirs[name].values, err_msg=name
        )


@pytest.fixture(params=["ducc0", "scipy"])
def library(request, monkeypatch):
    monkeypatch.setenv("FRACTALCONTACT_FFT", request.param)
    if fft.library() != request.param:
        pytest.skip(f"{request.param} is not installed")
    return request.param


LIBRARIES, BOUNDARIES = ("ducc0", "scipy"), ("periodic", "free")
CONTROLS = ("nominal_pressure", "closure", "hardness")
# a quarter of all combinations: any two values of two of the four are together in one of them
FAST = [
    (
        LIBRARIES[i],
        bool((i + (control == "closure")) % 2),
        BOUNDARIES[(i + (control == "hardness")) % 2],
        control,
    )
    for i, control in itertools.product((0, 1), CONTROLS)
]
COMBINED = itertools.product(LIBRARIES, (True, False), BOUNDARIES, CONTROLS)


@pytest.mark.parametrize(
    ("library", "single", "boundary", "control"),
    [pytest.param(*each, marks=[] if each in FAST else pytest.mark.slow) for each in COMBINED],
    indirect=["library"],
)
def test_bits_independent_of_units_and_threads(library, monkeypatch, single, boundary, control):
    monkeypatch.setattr(_window_solver, "SINGLE_FROM", 0 if single else 10**9)
    monkeypatch.setattr(resources, "SHARE", 1000)  # so that small passes are shared among threads too
    monkeypatch.setattr(fft, "SMALL", 1000)
    surface, keep = rough(64), ("state", "pressure", "gap", "displacement")
    force = control != "closure"
    path = (
        {"nominal_pressure": MODULUS * np.array([1e-3, 4e-3, 2e-3])} if force else {"closure": [2e-5, 3e-5]}
    )
    cap = {"hardness": 0.05 * MODULUS} if control == "hardness" else {}
    with limit(1):
        ours = press(surface, boundary=boundary, keep=keep, **path, **cap)
    for count in (2, 3):
        with limit(count):
            same_bits(
                ours, press(surface, boundary=boundary, keep=keep, **path, **cap), dict.fromkeys(keep, 0)
            )
    # heights and spacing in units 2^7 as long, the modulus in units 2^-9 as great, so pressures too
    other = fc.surfaces.from_array(surface.values * 2.0**-7, 1e-4 * 2.0**-7, periodic=True)
    scaled = {name: np.multiply(v, 2.0**9 if force else 2.0**-7) for name, v in path.items()}
    capped = {name: value * 2.0**9 for name, value in cap.items()}
    result = fc.contact.press(
        other,
        contact_modulus=MODULUS * 2.0**9,
        boundary=boundary,
        tolerance=1e-6,
        keep=keep,
        **scaled,
        **capped,
    )
    lengths, pressures = dict.fromkeys(("gap", "displacement", "closure"), -7), {"pressure": 9, "state": 0}
    same_bits(
        ours, result, {**lengths, **pressures, "iterations": 0, "residual": 0, "elastic_energy": 9 - 21}
    )


def test_bits_independent_of_earlier_calls():
    first = press(rough(96), nominal_pressure=MODULUS * 1e-3, keep=("pressure",))
    press(rough(96, periodic=False, seed=4), closure=1e-5)
    again = press(rough(96), nominal_pressure=MODULUS * 1e-3, keep=("pressure",))
    same_bits(first, again, {"pressure": 0, "closure": 0})


@pytest.mark.parametrize("share", [0.001, 0.01, 0.03])
def test_transforms_hardly_grow_with_grid(share):
    sizes = (128, 256, 512)
    pairs = [
        np.mean(
            [
                press(rough(n, seed=seed), nominal_pressure=share * MODULUS)["transforms"].item()
                for seed in (1, 2)
            ]
        )
        for n in sizes
    ]
    assert np.polyfit(np.log(sizes), np.log(pairs), 1)[0] < 0.35
    assert max(pairs) < 40


@pytest.mark.parametrize("periodic", [True, False])
def test_path_takes_few_transforms(periodic):
    path = MODULUS * np.geomspace(5e-4, 5e-2, 12)
    result = press(rough(128, periodic), nominal_pressure=np.concatenate([path, path[::-1]]))
    assert bool(result["converged"].all())
    assert float(result["transforms"].mean()) < 40
    assert int(result["transforms"].max()) < 60


def test_memory_below_eight_arrays():
    surface = rough(640)
    press(rough(400), nominal_pressure=MODULUS * 1e-2)  # compiled
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        result = press(surface, nominal_pressure=MODULUS * 1e-2)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert bool(result["converged"].all())
    assert (peak - before) / surface.values.nbytes < 8


@pytest.fixture
def grids(monkeypatch):
    """Return the shapes of the grids that are solved on, in turn."""
    seen, original = [], ConstrainedCG.solve

    def solve(self, *arguments, **options):
        seen.append(self.h.shape)
        return original(self, *arguments, **options)

    monkeypatch.setattr(ConstrainedCG, "solve", solve)
    return seen


@pytest.mark.parametrize("summit", [(40, 50), (150, 170), (187, 12)])
def test_free_contact_uses_window(grids, summit):
    y, x = np.ogrid[:200, :200]
    ball = -((y - summit[0]) ** 2 + (x - summit[1]) ** 2) * 1e-10 / 2
    surface = fc.surfaces.from_array(ball + 1e-9 * rough(200).values, 1e-5)
    closure = (20 * 1e-5) ** 2
    result = press(surface, closure=closure, keep=("state",))
    assert bool(result["converged"].all())
    assert "window (1 steps)" in result.attrs["provenance"]
    ny, nx = grids[-1]
    assert ny * nx < 0.15 * surface.size
    touched = np.argwhere(result["state"].values[0] > 0)
    assert (np.ptp(touched, axis=0) < (ny, nx)).all()
    forced = press(surface, normal_force=result["normal_force"].values, keep=("state",))
    assert grids[-1][0] * grids[-1][1] < 0.15 * surface.size
    np.testing.assert_array_equal(forced["state"], result["state"])


def test_whole_plane_for_periodic_and_full_contact(grids):
    press(rough(128, periodic=False), nominal_pressure=MODULUS)
    assert grids[-1] == (128, 128)
    grids.clear()
    press(rough(64), nominal_pressure=[MODULUS * 1e-4, MODULUS])
    assert set(grids) == {(64, 64)}


@pytest.mark.parametrize("influence", ["disc", "square"])
def test_pair_sums_only_for_light_contact(grids, influence):
    surface = rough(96, periodic=False)
    result = press(surface, nominal_pressure=MODULUS, influence=influence)
    assert min(shape[0] for shape in grids) > 1
    least = float(result["normal_force"][0]) / (MODULUS * np.hypot(*(n * 1e-4 for n in surface.shape)))
    assert float(result["closure"][0]) > least  # closure of a round flat punch of that diameter
    light = press(surface, nominal_pressure=MODULUS * 1e-7, influence=influence)
    assert grids[-1][0] == 1
    assert bool(light["converged"].all())


def test_provenance_names_the_solver_of_each_step():
    def solvers(surface, **options):
        return json.loads(press(surface, **options).attrs["provenance"])["solver"]

    free, loads = rough(48, periodic=False), MODULUS * np.array([0.0, 1e-6, 2e-6])
    assert solvers(free, nominal_pressure=loads) == "closed_form (1 steps), node_pairs (2 steps)"
    assert solvers(free, nominal_pressure=loads[1:], method="elimination") == "elimination (2 steps)"
    assert solvers(rough(48), nominal_pressure=loads[1:]) == "whole_plane (2 steps)"
