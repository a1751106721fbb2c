"""The fast method: preconditioner, pair sums, windows, precision, paths, and what the residual bounds."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import ConvergenceWarning
from fractalcontact.contact._kernels import projected_step_sums
from fractalcontact.contact._operator import ModesMemory
from fractalcontact.contact._preconditioner import ExtensionPreconditioner, FreeSet
from fractalcontact.contact._problem import Body

MODULUS = 1e9


def rough(n=64, periodic=True, **options):
    surface = fc.surfaces.spectral((n, n), 1e-4, hurst=0.8, rms_slope=0.1, rng=3, **options)
    return surface if periodic else fc.surfaces.from_array(surface.values, 1e-4)


def press(surface, **options):
    return fc.contact.press(
        surface, contact_modulus=MODULUS, **{"keep": ("state", "pressure", "gap"), **options}
    )


def preconditioned(body, free):
    """Matrix of the preconditioner on a set."""
    precondition = ExtensionPreconditioner(body, ModesMemory(), np.float64)
    rows, columns = precondition.bin_rows, precondition.bin_columns
    nodes = np.argwhere(free)
    matrix = np.empty((len(nodes), len(nodes)))
    for k, (i, j) in enumerate(nodes):
        free_set = FreeSet.empty(precondition.plane_shape, precondition.bin_shape, np.float64)
        free_set.mask[: free.shape[0], : free.shape[1]] = free
        plane = np.zeros(precondition.plane_shape)
        plane[i, j] = 1.0
        free_set.bin_sums[i // rows, j // columns] = 1.0
        np.add.at(free_set.bin_counts, (nodes[:, 0] // rows, nodes[:, 1] // columns), 1.0)
        plane, extra = precondition.apply(plane, free_set)
        full = plane[: free.shape[0], : free.shape[1]].copy()
        full += extra[np.arange(free.shape[0])[:, None] // rows, np.arange(free.shape[1])[None, :] // columns]
        matrix[:, k] = full[free]
    return matrix


@pytest.mark.parametrize("periodic", [True, False])
def test_preconditioner_symmetric_and_bounded_below(periodic):
    shape = (24, 32)
    body = Body(shape, (1.0, 1.0), periodic, "spectral" if periodic else "disc", 0.4365941)
    free = np.random.default_rng(0).random(shape)
    free = (free + np.roll(free, 1, 0) + np.roll(free, 1, 1)) > 1.8
    matrix = preconditioned(body, free)
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-12)
    nodes = np.flatnonzero(free)
    compliance = np.empty((nodes.size, nodes.size))
    operator = body.operator()
    for k, node in enumerate(nodes):
        unit = np.zeros(shape)
        unit.ravel()[node] = 1.0
        compliance[:, k] = operator.apply(unit).ravel()[nodes]
    ones = np.ones((nodes.size, nodes.size)) / nodes.size
    zero_sum = np.eye(nodes.size) - ones  # under force control only pressures that add up to nothing move
    product = zero_sum @ matrix @ zero_sum @ compliance @ zero_sum
    values = np.sort(np.linalg.eigvals(product).real)[1:]
    assert values.min() > 0.85
    assert values.max() < 3.0


@pytest.mark.parametrize("pressure", [1e3, 1e5, 5e5])
def test_pair_sums_match_dense_systems(pressure):
    surface = rough(80, periodic=False)
    sums = press(surface, nominal_pressure=pressure, tolerance=1e-12)
    dense = press(surface, nominal_pressure=pressure, tolerance=1e-12, method="elimination")
    np.testing.assert_array_equal(sums["state"], dense["state"])
    np.testing.assert_allclose(
        sums["pressure"], dense["pressure"], atol=1e-9 * float(dense["pressure"].max())
    )
    np.testing.assert_allclose(sums["closure"], dense["closure"], rtol=1e-12)
    np.testing.assert_allclose(sums["mean_gap"], dense["mean_gap"], rtol=1e-10)


def ball(n):
    x = (np.arange(n) - n // 3) * 1e-5
    return fc.surfaces.from_array(-(x**2 + x[:, None] ** 2) / 2, 1e-5)


@pytest.mark.parametrize("control", [{"closure": [1e-9, 4e-8]}, {"normal_force": [1e-6, 0.01]}])
def test_open_surroundings_do_not_matter(control):
    """A window of the large plane is solved on, and the whole of the plane that is cut out around it."""
    inside = {"y": slice(33, 95), "x": slice(33, 95)}
    large, small = ball(192), ball(192).isel(inside)
    around = press(large, tolerance=1e-12, **control)
    cut = press(small, tolerance=1e-12, **control)
    assert (around["state"].sum(("y", "x")) == cut["state"].sum(("y", "x"))).all()
    np.testing.assert_array_equal(around["state"].isel(inside), cut["state"])
    np.testing.assert_allclose(around["normal_force"], cut["normal_force"], rtol=1e-11)
    np.testing.assert_allclose(around["closure"], cut["closure"], rtol=1e-11)
    np.testing.assert_allclose(around["gap"].isel(inside), cut["gap"], atol=1e-18)


def test_single_precision_start_same_solution():
    """A solution of 512 x 512 points or more starts in single precision; eight by eight tiles are as one."""
    tile = rough(64)
    plane = fc.surfaces.from_array(np.tile(tile.values, (8, 8)), 1e-4, periodic=True)
    double, mixed = (
        press(surface, nominal_pressure=[1e5, 1e7], tolerance=1e-12, keep=("state",))
        for surface in (tile, plane)
    )
    np.testing.assert_array_equal(mixed["state"], np.tile(double["state"], (1, 8, 8)))
    np.testing.assert_allclose(mixed["closure"], double["closure"], rtol=1e-12)


def test_path_steps_match_single_solves():
    surface, path = rough(96), [1e5, 3e5, 1e6, 1e6, 4e6, 2e5, 0.0, 1e5]
    along = press(surface, nominal_pressure=path, tolerance=1e-12)
    for step, pressure in enumerate(path):
        alone = press(surface, nominal_pressure=pressure, tolerance=1e-12)
        np.testing.assert_array_equal(along["state"][step], alone["state"][0])
        assert float(along["closure"][step]) == pytest.approx(float(alone["closure"][0]), rel=1e-11)


@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-4])
@pytest.mark.parametrize("control", ["nominal_pressure", "closure"])
def test_residual_bounds_energy_error(periodic, tolerance, control):
    surface = rough(64, periodic)
    keep = ("pressure", "displacement")
    exact = press(surface, nominal_pressure=1e6, tolerance=1e-12, keep=keep)
    given = 1e6 if control == "nominal_pressure" else float(exact["closure"][0])
    coarse = press(surface, **{control: given}, tolerance=tolerance, keep=keep)
    assert float(coarse["residual"][0]) <= tolerance
    error = {name: coarse[name] - exact[name] for name in keep}
    energy = float((error["pressure"] * error["displacement"]).sum())
    energy /= float((coarse["pressure"] * coarse["displacement"]).sum())
    assert 0 < energy <= float(coarse["residual"][0])


def test_tolerance_below_rounding_is_reported():
    with pytest.warns(ConvergenceWarning, match="step 0: rounding"):
        result = press(rough(64), nominal_pressure=1e6, tolerance=1e-30)
    assert not bool(result["converged"][0])
    assert stopped(result) == ["rounding"]
    assert float(result["residual"][0]) < 1e-11


def stopped(result):
    """Words for why the steps stopped, read as a user would."""
    flags = dict(
        zip(result["stop_reason"].flag_values, result["stop_reason"].flag_meanings.split(), strict=True)
    )
    return [flags[value] for value in result["stop_reason"].values]


@pytest.mark.parametrize("heights", ["spike", "plateaus", "quantised", "noise", "step", "offset"])
@pytest.mark.parametrize("periodic", [True, False])
def test_hard_surfaces_converge(heights, periodic):
    n, rng = 40, np.random.default_rng(2)
    base = rough(n).values
    plane = {
        "spike": np.where(np.arange(n * n).reshape(n, n) == 777, 1e-6, 0.0),
        "plateaus": np.minimum(base, 0.0),
        "quantised": np.round(base / 2e-6) * 2e-6,
        "noise": 1e-6 * rng.normal(size=(n, n)),
        "step": np.where(np.arange(n)[None, :] > n // 2, 1e-6, 0.0) * np.ones((n, 1)),
        "offset": base + 1e3,
    }[heights]
    surface = fc.surfaces.from_array(plane, 1e-4, periodic=periodic)
    # at the default of 1e-8 closures of full contact differ by 1e-10
    result = press(surface, nominal_pressure=[1.0, 1e4, 1e6, 1e8, 1e10], tolerance=1e-10)
    assert bool(result["converged"].all())
    assert (result["gap"] >= 0).all()
    assert (result["pressure"] >= 0).all()
    assert (np.diff(result["closure"]) >= -1e-12 * float(result["closure"].max())).all()


def test_full_contact_is_linear():
    surface = rough(48)
    result = press(surface, nominal_pressure=[1e9, 2e9], tolerance=1e-12)
    assert (result["contact_fraction"] == 1).all()
    np.testing.assert_allclose(np.diff(result["pressure"], axis=0), 1e9, rtol=1e-9)
    np.testing.assert_allclose(result["elastic_energy"][0], result["elastic_energy"][1], rtol=1e-9)
    np.testing.assert_allclose(result["mean_gap"], 0.0, atol=1e-18)


def test_closure_beyond_mean_plane():
    surface = rough(32)
    depth = float(surface.max() - surface.mean())
    keep = ("state", "pressure", "gap", "displacement")
    with pytest.warns(ConvergenceWarning, match="step 1: beyond_full_contact"):
        result = press(surface, closure=[0.97 * depth, 1.001 * depth, 0.97 * depth, 1e3 * depth], keep=keep)
    assert stopped(result) == ["converged", "beyond_full_contact"] * 2
    assert float(result["mean_gap"][0]) == pytest.approx(0.03 * depth, rel=1e-6)
    np.testing.assert_array_equal(np.isnan(result["normal_force"]), [False, True, False, True])
    np.testing.assert_allclose(result["closure"], np.array([0.97, 1.001, 0.97, 1e3]) * depth, rtol=1e-15)
    for name in ("normal_force", "nominal_pressure", "elastic_energy", "pressure", "displacement"):
        assert "mean plane" in result[name].attrs["reason"]
        assert bool(result[name][1].isnull().all())
    assert (result["state"][1] == 1).all()
    assert (result["gap"][1] == 0).all()
    assert float(result["contact_fraction"][1]) == 1.0
    assert float(result["normal_force"][2]) == pytest.approx(float(result["normal_force"][0]), rel=1e-7)


@pytest.mark.parametrize("share", [0.999, 0.999999, 1 - 1e-10])
def test_closure_near_mean_plane_is_full_contact(share):
    surface = rough(32)
    depth = float(surface.max() - surface.mean())
    result = press(surface, closure=share * depth)
    assert bool(result["converged"].all())
    full = press(surface, nominal_pressure=1e10)
    assert float(result["normal_force"][0]) < float(full["normal_force"][0])
    assert float(result["contact_fraction"][0]) > 0.9


def test_flat_surface_converges_only_to_the_tolerance_that_rounding_leaves():
    flat = fc.surfaces.from_array(np.zeros((24, 24)), 1e-4)
    load = {"normal_force": 1.0, "contact_modulus": 1e9}
    assert fc.contact.press(flat, **load, tolerance=1e-12).converged.all()
    with pytest.warns(ConvergenceWarning, match="step 0: rounding"):
        assert not fc.contact.press(flat, **load, tolerance=1e-16).converged.any()


def test_projection_counts_only_violations():
    pressure = np.array([[1.0, 1.0, 0.5, 0.5, 0.5, 0.5, 0.0]])
    direction = np.array([[-0.1, 0.0, -0.5, -0.6, 0.5, 0.6, 0.0]])  # beyond the cap: 0, 3; below zero: 5
    out = np.zeros((1, 8))
    projected_step_sums(0, 1, 1, pressure, direction, 1.0, 1.0, out)
    assert out[0, 0] == 3
    assert out[0, 1] == pytest.approx(4.0)
