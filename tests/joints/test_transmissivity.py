"""Transmissivity against closed forms, a slow assembly, and invariances."""

import sys
from collections import deque

import numpy as np
import pytest
import xarray as xr
from scipy import sparse
from scipy.sparse.linalg import splu

import fractalcontact as fc
from fractalcontact.base.resources import Plane, bytes_on
from fractalcontact.joints import _network_pressure

# relative amplitude, hydraulic over mean aperture across and along the crests
SINUSOIDS = [(0.3, 0.910952, 1.043114), (0.6, 0.652413, 1.154800)]


def test_transmissivity_of_a_pressed_crack(crack):
    pressed = fc.joints.closure(crack, shear=[8e-5, 4e-4], normal_force=[10.0, 1e3], keep=("gap", "state"))
    flow = fc.joints.transmissivity(pressed.gap)
    assert flow.transmissivity.dims == ("shear", "step", "axis")
    assert (flow.transmissivity.diff("step") < 0).all()
    np.testing.assert_allclose(flow.open_fraction, 1 - (pressed.state > 0).mean(("y", "x")))
    np.testing.assert_allclose(flow.aperture, pressed.mean_gap, rtol=1e-9)
    # no plane conducts more than its cells side by side
    most = (pressed.gap**3).mean(("y", "x")) / 12
    assert (flow.transmissivity <= most).all()
    assert flow.percolates.all()


def flow(make_face, gap, spacing=1.0, *, periodic=False, **options):
    return fc.joints.transmissivity(make_face(gap, spacing, periodic=periodic), **options)


@pytest.mark.parametrize(
    ("shape", "periodic"),
    [((3, 3), False), ((7, 5), False), ((64, 31), False), ((7, 5), True), ((1, 1), True), ((1, 6), True)],
)
def test_parallel_plates_are_exact(make_face, shape, periodic):
    result = flow(make_face, np.full(shape, 2e-4), (1e-3, 3e-3), periodic=periodic, viscosity=1e-3)
    np.testing.assert_allclose(result.transmissivity, (2e-4) ** 3 / 12, rtol=1e-13)
    np.testing.assert_allclose(result.hydraulic_aperture, 2e-4, rtol=1e-13)
    np.testing.assert_allclose(result.flow_conductance, (2e-4) ** 3 / 12e-3, rtol=1e-13)
    assert result.percolates.all()
    assert result.open_fraction == 1
    assert result.aperture == pytest.approx(2e-4)


@pytest.mark.parametrize("periodic", [True, False])
@pytest.mark.parametrize(("amplitude", "across", "along"), SINUSOIDS)
def test_sinusoidal_aperture(make_face, amplitude, across, along, periodic):
    x = (np.arange(64) + 0.5) / 64
    gap = np.broadcast_to(1e-4 * (1 + amplitude * np.cos(2 * np.pi * x)), (40, 64))
    result = flow(make_face, gap, 1e-3, periodic=periodic)
    np.testing.assert_allclose(result.hydraulic_aperture.sel(axis="x"), across * 1e-4, rtol=2e-6)
    np.testing.assert_allclose(result.hydraulic_aperture.sel(axis="y"), along * 1e-4, rtol=2e-6)
    exact = (1 - amplitude**2) ** 2.5 / (1 + amplitude**2 / 2)
    np.testing.assert_allclose(result.transmissivity.sel(axis="x") * 12, exact * 1e-12, rtol=1e-10)


def test_layers_are_exact(make_face):
    gap = np.cbrt(np.repeat([1.0, 10.0, 3.0], 4))
    result = flow(make_face, np.broadcast_to(gap, (5, 12)), (1.0, 7.0))
    assert 12 * result.transmissivity.sel(axis="x") == pytest.approx(3 / (1 + 1 / 10 + 1 / 3), rel=1e-12)
    assert 12 * result.transmissivity.sel(axis="y") == pytest.approx(14 / 3, rel=1e-12)


def checkerboard(squares, cells, ratio):
    pattern = np.indices((squares * cells, squares * cells)) // cells
    return np.cbrt(np.where(pattern.sum(axis=0) % 2, ratio, 1.0))


@pytest.mark.parametrize("periodic", [True, False])
def test_checkerboard_conducts_the_geometric_mean(make_face, periodic):
    result = flow(make_face, checkerboard(2, 64, 10.0), periodic=periodic)
    np.testing.assert_allclose(12 * result.transmissivity, np.sqrt(10.0), rtol=0.01)


@pytest.mark.parametrize("ratio", [2.0, 10.0, 1e4])
def test_checkerboard_error(make_face, ratio):
    errors = []
    for cells in (1, 2, 8, 32):
        result = flow(make_face, checkerboard(2, cells, ratio), periodic=True, axis="x")
        errors.append(12 * result.transmissivity.item() / np.sqrt(ratio) - 1)
    np.testing.assert_allclose(errors[:2], 0, atol=1e-11)
    assert -0.02 < errors[2] < errors[3] < 0


def test_four_phase_checkerboard(make_face):
    k = np.array([[1.0, 5.0], [2.0, 30.0]])
    (a, b), (d, c) = k
    result = flow(make_face, np.cbrt(k), periodic=True)
    mean = (a * b * c + a * b * d + a * c * d + b * c * d) / (a + b + c + d)
    along_x = np.sqrt(mean * (a + d) * (b + c) / ((a + b) * (c + d)))
    # the product of the conductivities along x and y is the mean of the triples
    np.testing.assert_allclose(12 * result.transmissivity, [along_x, mean / along_x], rtol=1e-12)


def gain(a, b, c, d):
    rows = series(a, b) / 2 + series(d, c) / 2
    if min(a + b, c + d) == 0 or rows == 0:
        return 1.0
    triples = (a * b * c + a * b * d + a * c * d + b * c * d) / (a + b + c + d)
    return max(np.sqrt(triples * (a + d) * (b + c) / (a + b) / (c + d)) / rows, 1.0)


def series(a, b):
    return 2 * a * b / (a + b) if a > 0 and b > 0 else 0.0


def slow_conductivity(k, ratio):
    """Free plane along x, dense, assembled cell by cell."""
    ny, nx = k.shape
    at = lambda i, j: k[min(max(i, 0), ny - 1), min(max(j, 0), nx - 1)]  # noqa: E731
    size = ny * nx
    matrix, source = np.zeros((size, size)), np.zeros(size)
    for i in range(ny):
        for j in range(nx):
            here = i * nx + j
            if j + 1 < nx:
                up = gain(at(i - 1, j), at(i - 1, j + 1), at(i, j + 1), at(i, j))
                down = gain(at(i, j), at(i, j + 1), at(i + 1, j + 1), at(i + 1, j))
                add(matrix, here, here + 1, ratio * series(k[i, j], k[i, j + 1]) * max(up, down))
            if i + 1 < ny:
                left = gain(at(i, j - 1), at(i + 1, j - 1), at(i + 1, j), at(i, j))
                right = gain(at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1))
                add(matrix, here, here + nx, series(k[i, j], k[i + 1, j]) * max(left, right) / ratio)
            if j == 0:
                matrix[here, here] += 2 * ratio * k[i, j]
                source[here] += 2 * ratio * k[i, j]
            if j == nx - 1:
                matrix[here, here] += 2 * ratio * k[i, j]
    p = np.linalg.lstsq(matrix, source, rcond=1e-14)[0].reshape(ny, nx)
    return float((2 * ratio * k[:, 0] * (1 - p[:, 0])).sum()) * nx / ny / ratio


def add(matrix, a, b, link):
    matrix[a, a] += link
    matrix[b, b] += link
    matrix[a, b] -= link
    matrix[b, a] -= link


@pytest.mark.parametrize("seed", range(5))
def test_equals_a_dense_assembly(make_face, seed):
    rng = np.random.default_rng(seed)
    gap = rng.random((9, 7)) - 0.2 * (seed % 3)
    result = flow(make_face, gap, (1.0, 1.5))
    k = np.maximum(gap, 0.0) ** 3
    expected = [slow_conductivity(k, 1 / 1.5), slow_conductivity(k.T, 1.5)]
    np.testing.assert_allclose(12 * result.transmissivity, expected, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize("seed", range(3))
def test_tiling_a_periodic_plane_changes_nothing(make_face, seed):
    gap = np.random.default_rng(seed).random((6, 8)) - 0.1
    single = flow(make_face, gap, periodic=True)
    many = flow(make_face, np.tile(gap, (3, 2)), periodic=True)
    np.testing.assert_allclose(single.transmissivity, many.transmissivity, rtol=1e-9)
    # many periods between fixed pressures approach the periodic value
    between = flow(make_face, np.tile(gap, (1, 60)), periodic=(True, False), axis="x")
    np.testing.assert_allclose(between.transmissivity, single.transmissivity.sel(axis=["x"]), rtol=0.02)


@pytest.mark.parametrize("seed", range(3))
def test_rotated_and_mirrored_planes(make_face, seed):
    gap = np.random.default_rng(seed).random((12, 9)) - 0.15
    plain = flow(make_face, gap, (2.0, 1.0)).transmissivity.values
    turned = flow(make_face, np.rot90(gap), (1.0, 2.0)).transmissivity.values
    mirrored = flow(make_face, gap[::-1, ::-1], (2.0, 1.0)).transmissivity.values
    np.testing.assert_allclose(turned, plain[::-1], rtol=1e-10)
    np.testing.assert_allclose(mirrored, plain, rtol=1e-10)


def test_opening_a_cell_never_lowers_the_flow(make_face):
    rng = np.random.default_rng(1)
    gap = rng.random((15, 15)) - 0.2
    before = flow(make_face, gap, axis="x").transmissivity.item()
    for _ in range(20):
        i, j = rng.integers(0, 15, 2)
        gap[i, j] += 0.5
        after = flow(make_face, gap, axis="x").transmissivity.item()
        assert after >= before * (1 - 1e-9)
        before = after


def test_wall_of_contact_stops_the_flow(make_face):
    gap = np.ones((8, 9))
    gap[:, 4] = 0.0
    gap[3, 4] = -1.0
    for periodic in (True, False):
        result = flow(make_face, gap, periodic=periodic)
        assert result.transmissivity.sel(axis="x") == 0
        assert result.hydraulic_aperture.sel(axis="x") == 0
        assert not result.percolates.sel(axis="x")
        assert result.percolates.sel(axis="y")
        np.testing.assert_allclose(12 * result.transmissivity.sel(axis="y"), 8 / 9, rtol=1e-12)


def test_cells_that_share_a_corner_are_not_connected(make_face):
    assert not flow(make_face, np.eye(6)).percolates.any()
    assert not flow(make_face, np.zeros((5, 5))).percolates.any()
    assert flow(make_face, np.zeros((5, 5))).open_fraction == 0


def slow_winding(cells):
    """Walk on the unrolled plane: does some cell reach its own image along x?"""
    ny, nx = cells.shape
    for start in zip(*np.nonzero(cells), strict=True):
        seen, queue = {start: 0}, deque([(*start, 0)])
        while queue:
            i, j, turn = queue.popleft()
            for di, dj in ((0, 1), (0, -1), (1, 0), (-1, 0)):
                a, b = (i + di) % ny, j + dj
                there, b = turn + b // nx, b % nx
                if not cells[a, b]:
                    continue
                if (a, b) not in seen:
                    seen[a, b] = there
                    queue.append((a, b, there))
                elif seen[a, b] != there:
                    return True
    return False


def test_percolation_on_a_torus_is_winding(make_face):
    rng = np.random.default_rng(3)
    seen = set()
    for _ in range(30):
        gap = (rng.random((6, 7)) < 0.6).astype(float)
        result = flow(make_face, gap, periodic=True)
        expected = [slow_winding(gap > 0), slow_winding(gap.T > 0)]
        np.testing.assert_array_equal(result.percolates, expected)
        np.testing.assert_array_equal(result.transmissivity > 0, expected)
        seen.update(expected)
    assert seen == {True, False}


def test_spiral_winds_along_both_axes(make_face):
    # a diagonal band one cell wide winds around both axes before it meets itself
    gap = np.eye(6) + np.roll(np.eye(6), 1, axis=1)
    result = flow(make_face, gap, periodic=True)
    assert result.percolates.all()
    assert not flow(make_face, gap, periodic=(False, True)).percolates.sel(axis="x")


def test_periodic_plane_can_be_declared_free(make_face):
    gap = np.random.default_rng(0).random((6, 7)) + 0.1
    free = flow(make_face, gap)
    called = fc.joints.transmissivity(make_face(gap, periodic=True), periodic=False)
    np.testing.assert_array_equal(called.transmissivity, free.transmissivity)
    with pytest.raises(ValueError, match="periodic"):
        fc.joints.transmissivity(make_face(gap), periodic=True)


def test_units_change_only_exponents(make_face):
    gap = np.random.default_rng(0).random((12, 13)) - 0.1
    metres = flow(make_face, gap).transmissivity.values
    two = flow(make_face, gap * 2.0**-40, 2.0**-20).transmissivity.values
    np.testing.assert_array_equal(metres * 2.0**-120, two)
    large = flow(make_face, gap * 2.0**60).transmissivity.values
    np.testing.assert_array_equal(metres * 2.0**180, large)


def test_leading_dims_and_labels(make_face):
    planes = np.random.default_rng(0).random((2, 3, 6, 5)) - 0.3
    plane = make_face(planes[0, 0], 2.0)
    stack = xr.DataArray(
        planes,
        dims=("shear", "step", "y", "x"),
        coords={"x": plane.x, "y": plane.y, "shear": [0.0, 1.0], "normal_force": ("step", [1.0, 2.0, 3.0])},
    )
    result = fc.joints.transmissivity(stack, axis=("y", "x"))
    assert result.transmissivity.dims == ("shear", "step", "axis")
    assert result.open_fraction.dims == ("shear", "step")
    alone = fc.joints.transmissivity(make_face(planes[1, 2], 2.0))
    for axis in ("x", "y"):
        assert result.transmissivity.sel(axis=axis)[1, 2] == alone.transmissivity.sel(axis=axis)
    assert "normal_force" in result.coords
    assert result.transmissivity.attrs["units"] == "m3"
    assert result.hydraulic_aperture.attrs["units"] == "m"


def side_by_side(gap, count, *, periodic):
    """Return count x count copies of a gap, or mirror images of each other, which conduct as much as one."""
    if periodic:
        return np.tile(gap, (count, count))
    row = np.hstack([gap[:, :: 1 - 2 * (i % 2)] for i in range(count)])
    return np.vstack([row[:: 1 - 2 * (i % 2)] for i in range(count)])


@pytest.mark.parametrize(
    ("periodic", "contrast", "library"),
    [
        (True, None, "pyamg"),
        pytest.param(False, 10.0, "pyamg", marks=pytest.mark.slow),
        pytest.param(True, None, "none", marks=pytest.mark.slow),
    ],
)
def test_multigrid_of_many_cells_and_elimination_of_few_agree(
    make_face, rough, monkeypatch, periodic, contrast, library
):
    """Multigrid takes more than 300 000 open cells, where it is installed."""
    if library == "none":
        monkeypatch.setitem(sys.modules, "pyamg", None)
    else:
        pytest.importorskip(library)
    gap = np.maximum(rough((96, 96), 0) + 0.5, 0.0)
    if contrast is not None:
        gap = np.cbrt(np.where(np.random.default_rng(5).random(gap.shape) < 0.45, 1.0, contrast))
    small = fc.joints.transmissivity(make_face(gap, periodic=periodic), axis="x")
    count = 7 if contrast is None else 6  # a third of the cells are closed without the contrast
    many = make_face(side_by_side(gap, count, periodic=periodic), periodic=periodic)
    assert (many > 0).sum() > 3.1e5
    large = fc.joints.transmissivity(many, axis="x")
    np.testing.assert_allclose(large.transmissivity, small.transmissivity, rtol=2e-8)
    assert large.residual.max() <= 1e-6
    assert (large.residual.max() > 1e-10) == (library == "pyamg")  # iterated, or eliminated


def test_invalid_arguments_are_refused(make_face):
    gap = np.ones((5, 5))
    gap[1, 1] = np.nan
    with pytest.raises(ValueError, match="fill"):
        flow(make_face, gap)
    with pytest.raises(ValueError, match=r"(?s)axis.*viscosity"):
        flow(make_face, np.ones((5, 5)), axis="z", viscosity=0.0)


@pytest.mark.benchmark
def test_million_cells_in_ten_seconds(make_face, rough):
    heights = rough((1024, 1024), 0)
    for closed in (0.0, 0.2, 0.35):
        gap = heights - np.quantile(heights, closed) if closed else heights - heights.min() + 0.1
        result = flow(make_face, gap)
        assert result.run_time < 10
        assert (result.residual <= 1e-6).all()


def test_overlaps_count_as_contact(make_face):
    gap = np.full((6, 8), 1e-4)
    gap[2, 3], gap[4, 4] = -1e-5, -1e-18
    result = fc.joints.transmissivity(make_face(gap))
    assert result.overlap_fraction == pytest.approx(1 / 48)
    closed = np.where(gap < 0, 0.0, gap)
    np.testing.assert_allclose(
        result.transmissivity, fc.joints.transmissivity(make_face(closed)).transmissivity, rtol=1e-12
    )
    with pytest.raises(ValueError, match="gap: expected an opening.*1 planes that are below zero everywhere"):
        fc.joints.transmissivity(make_face(np.full((6, 8), -1e-4)))
    shut = fc.joints.transmissivity(make_face(np.zeros((6, 8))))
    assert (shut.transmissivity == 0).all()
    assert not shut.percolates.any()
    assert shut.overlap_fraction == 0


def test_transmissivity_over_load_and_shear(make_face, rough):
    face = make_face(2e-6 * rough((40, 40), 9), 8e-5)
    crack = fc.joints.Crack(face, young=3e10, poisson=0.2, block=20 * 8e-5)
    closing = fc.joints.closure(
        crack, shear=[8e-5, 3.2e-4], direction=["E", "N"], normal_force=[0.1, 3.0, 1e3], keep=("gap",)
    )
    flow = fc.joints.transmissivity(closing.gap)
    assert flow.hydraulic_aperture.dims == ("direction", "shear", "step", "axis")
    assert flow.normal_force.dims == ("step",)
    assert (flow.hydraulic_aperture.diff("step") <= 0).all()
    np.testing.assert_allclose(flow.aperture, closing.mean_gap, rtol=1e-9, atol=1e-20)
    # no plane conducts more than its cells side by side
    most = (closing.gap**3).mean(("y", "x")) ** (1 / 3)
    assert (flow.hydraulic_aperture <= most * (1 + 1e-9)).all()
    assert not flow.percolates.isel(step=-1).all()
    assert (flow.hydraulic_aperture.where(~flow.percolates, 0.0) == 0).all()


@pytest.mark.parametrize("wraps", [(False, False), (True, False), (False, True), (True, True)])
@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (2, 40), (33, 7), (40, 40)])
def test_order_of_elimination_takes_every_cell_once(shape, wraps):
    order = _network_pressure.nested_dissection(shape, wraps)
    assert sorted(order.tolist()) == list(range(shape[0] * shape[1]))


@pytest.mark.parametrize("wraps", [(False, False), (True, True)])
def test_order_of_elimination_fills_in_little(wraps):
    """The bound of George (1973), 31/4 n^2 log2(n) for n x n cells; row by row it would be n^3."""
    n = 48
    order = _network_pressure.nested_dissection((n, n), wraps)
    line = sparse.diags_array([1.0, 1.0], offsets=[-1, 1], shape=(n, n)).tolil()
    line[0, -1] = line[-1, 0] = float(wraps[0])
    links = sparse.kron(line, sparse.eye_array(n)) + sparse.kron(sparse.eye_array(n), line)
    matrix = (5.0 * sparse.eye_array(n * n) - links).tocsc()[order][:, order]
    filled = splu(
        matrix.tocsc(), permc_spec="NATURAL", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    ).L.nnz
    assert filled < 31 / 4 * n**2 * np.log2(n) / (1 if wraps[0] else 2)


@pytest.mark.parametrize("periodic", [True, False])
def test_flux_conserves_mass_and_its_mean_is_the_transmissivity(make_face, rough, periodic):
    gap = np.maximum(rough((13, 20), seed=3) + 1.5, 0.0)
    result = flow(make_face, gap, (1.0, 3.0), periodic=periodic, keep=("pressure", "flux"))
    for axis, other in (("x", "y"), ("y", "x")):
        one = result.sel(axis=axis)
        assert one.percolates
        through = one[f"flux_{axis}"].sum(other)
        np.testing.assert_allclose(through, one.transmissivity * one.sizes[other], rtol=1e-9)
        assert (one.flux_x.where(one.relative_pressure.isnull(), 0.0) == 0).all()


def test_pressure_and_flux_of_layers_in_series(make_face):
    gap = np.broadcast_to(np.cbrt([1.0, 1.0, 3.0, 3.0]), (3, 4))
    result = flow(make_face, gap, (1.0, 5.0), keep=("pressure", "flux"))
    # resistances 1, 1, 1/3, 1/3 of 8/3 in all, to the centre of each cell
    exact = 1 - np.array([0.5, 1.5, 2 + 1 / 6, 2 + 1 / 2]) / (8 / 3)
    np.testing.assert_allclose(result.relative_pressure.sel(axis="x"), np.tile(exact, (3, 1)), rtol=1e-12)
    np.testing.assert_allclose(result.flux_x.sel(axis="x"), 1.5 / 12, rtol=1e-12)
    np.testing.assert_allclose(result.flux_y.sel(axis="y"), gap**3 / 12, rtol=1e-12)
    np.testing.assert_allclose(result.flux_y.sel(axis="x"), 0.0, atol=1e-15)
    assert "flux_x" not in flow(make_face, gap, keep="pressure")


def test_unmeasured_apertures_are_told_what_to_do(make_face):
    gap = np.ones((4, 4))
    gap[1, 2] = np.nan
    with pytest.raises(ValueError, match=r"gap\.fillna\(0\)"):
        flow(make_face, gap)


@pytest.mark.parametrize(("cells", "planes", "least", "most"), [(256, 1, 1450, 1900), (600, 2, 650, 750)])
def test_stated_memory_is_that_of_the_solver_in_use(cells, planes, least, most):
    """As measured for each cell: elimination takes more than multigrid, which solves the large planes."""
    pytest.importorskip("pyamg")
    for function in (fc.joints.transmissivity, fc.joints.uplift):
        stated = bytes_on(function.memory, Plane((cells, cells), planes=planes), {})
        assert least <= stated / cells**2 <= most
