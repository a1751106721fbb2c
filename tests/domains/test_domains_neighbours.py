"""Minkowski and correlation dimensions: distances and pairs one by one, limits, gaps, coverage."""

import numpy as np
import pytest
import xarray as xr
from domains.sets import DIMENSION, as_mask, koch_raster, lattice_set, placed, random_dust
from scipy.ndimage import distance_transform_edt

import fractalcontact as fc
from fractalcontact.base.grid import Grid
from fractalcontact.domains import _correlation, _minkowski

BOTH = ("minkowski_dimension", "correlation_dimension")
WRAPS = [(False, False), (True, False), (True, True)]


def measured(name, mask, **options):
    result = getattr(fc.domains, name)(mask, **options)
    return result, result[name]


def shortest(a, b, n, spacing, wrap):
    """Distance along one axis."""
    far = abs(a - b)
    return spacing * (min(far, n - far) if wrap else far)


@pytest.mark.parametrize("wraps", WRAPS)
def test_grown_area_cell_by_cell(wraps):
    rng = np.random.default_rng(1)
    ny, nx, spacing = 19, 23, (2.0, 0.5)  # side 1
    radii = np.array([0.5, 1.3, 2.0, 3.7])
    margin = [0 if wrap else 9 for wrap in wraps]  # cells so far from a free edge need no mirror
    for _ in range(4):
        cells = np.zeros((ny, nx), np.uint8)
        inner = cells[margin[0] : ny - margin[0], margin[1] : nx - margin[1]]
        inner[:] = rng.random(inner.shape) < 0.2
        inner[0, 0] = 1
        want = np.zeros(radii.size)
        for i in range(ny):
            for j in range(nx):
                distance = min(
                    np.hypot(shortest(i, y, ny, 2.0, wraps[0]), shortest(j, x, nx, 0.5, wraps[1]))
                    for y, x in np.argwhere(cells)
                )
                want += np.clip(radii - distance + 0.5, 0, 1)
        found = _minkowski.dilated_area(cells, None, Grid((ny, nx), spacing, wraps), radii)
        assert found == pytest.approx(want, rel=1e-13)


@pytest.mark.parametrize("reach", [100, 20000])
def test_offsets_agree_with_the_distance_transform(reach):
    cells = random_dust(128, 90, np.random.default_rng(4)).astype(np.uint8)
    tiled = np.tile(cells, (3, 3)) == 0
    distance = distance_transform_edt(tiled, sampling=(1.5, 1.0))[128:256, 128:256]
    counts = _minkowski._count_offsets(cells, None, (reach, 100), (1.5, 1.0), (True, True))
    rows, columns = np.nonzero(counts)
    found = np.repeat(np.hypot(1.5 * rows, columns), counts[rows, columns])
    assert np.sort(found) == pytest.approx(np.sort(distance.ravel()), rel=1e-14)


def test_grown_area_is_the_same_however_the_plane_is_turned():
    rng = np.random.default_rng(5)
    radii = np.array([0.5, 1.0, 2.5, 4.0, 7.0])
    for spacing in ((1.0, 1.0), (1.5, 1.0)):
        cells, valid = ((rng.random((31, 40)) < share).astype(np.uint8) for share in (0.03, 0.9))
        cells &= valid
        want = _minkowski.dilated_area(cells, valid, Grid((31, 40), spacing, (False, True)), radii)
        for step in ((-1, 1), (1, -1), (-1, -1)):
            turned = [np.ascontiguousarray(plane[:: step[0], :: step[1]]) for plane in (cells, valid)]
            found = _minkowski.dilated_area(*turned, Grid((31, 40), spacing, (False, True)), radii)
            assert np.array_equal(found, want)
        tipped = [np.ascontiguousarray(plane.T) for plane in (cells, valid)]
        found = _minkowski.dilated_area(*tipped, Grid((40, 31), spacing[::-1], (True, False)), radii)
        assert found == pytest.approx(want, rel=1e-14)


def test_area_beyond_a_free_edge_is_the_mirror_image():
    whole = np.zeros((41, 41), np.uint8)
    whole[20] = whole[:, 20] = 1
    radii = np.array([0.5, 1.0, 2.5, 4.0])
    grid = Grid((41, 41), (1.0, 1.0), (False, False))
    half = Grid((21, 41), (1.0, 1.0), (False, False))
    row = np.zeros((21, 41), np.uint8)
    row[0] = 1
    assert _minkowski.dilated_area(row, None, half, radii) == pytest.approx(41 * 2 * radii, rel=1e-14)
    cross = _minkowski.dilated_area(whole, None, grid, radii)
    assert np.all(cross <= 2 * 41 * 2 * radii)


@pytest.mark.parametrize("wraps", WRAPS)
def test_mean_mass_pair_by_pair(wraps):
    rng = np.random.default_rng(2)
    ny, nx = 7, 9
    cells, valid = (
        (rng.random((ny, nx)) < 0.4).astype(np.uint8),
        (rng.random((ny, nx)) < 0.8).astype(np.uint8),
    )
    cells &= valid
    sizes = np.array([1, 2, 3, 4])
    want = np.zeros(sizes.size)
    for down in range(-2, 3):
        for right in range(-2, 3):
            pairs = seen = 0
            for i in range(ny):
                for j in range(nx):
                    y, x = i + down, j + right
                    if (not wraps[0] and not 0 <= y < ny) or (not wraps[1] and not 0 <= x < nx):
                        continue
                    seen += int(valid[i, j] & valid[y % ny, x % nx])
                    pairs += int(cells[i, j] & cells[y % ny, x % nx])
            part = np.clip((sizes + 1) / 2 - abs(down), 0, 1) * np.clip((sizes + 1) / 2 - abs(right), 0, 1)
            want += part * pairs / seen
    want *= valid.sum() / cells.sum()
    found = _correlation.mean_mass(cells, valid, Grid((ny, nx), (1.0, 1.0), wraps), sizes)
    assert found == pytest.approx(want, rel=1e-13)


@pytest.mark.parametrize("shape", [(9, 9), (27, 27), (100, 37)])
@pytest.mark.parametrize("wraps", [False, True])
def test_row_column_and_full_mask_are_exact_wherever_they_lie(shape, wraps):
    ny, nx = shape
    for y, x in ((0, 0), (ny // 2, nx // 3), (ny - 1, nx - 1)):
        planes = np.zeros((4, ny, nx), bool)
        planes[0, y, x] = planes[1, y] = planes[2, :, x] = planes[3] = True
        mask = as_mask(planes, periodic=(wraps, wraps))
        for name in BOTH:
            result, dimension = measured(name, mask)
            assert dimension.values[1:] == pytest.approx([1, 1, 2], abs=1e-12)
            assert (result.ci_high - result.ci_low).values[1:] == pytest.approx([0, 0, 0], abs=1e-12)
            assert (
                result.ci_low.values[0] <= (0.35 if name == BOTH[0] else 0) <= result.ci_high.values[0] + 0.2
            )
        assert float(measured(BOTH[1], mask)[1][0]) == 0.0


def test_mass_about_a_cell_of_a_lattice():
    cells = np.zeros((48, 48))
    cells[::4, ::4] = 1
    mass = fc.domains.correlation_dimension(as_mask(cells, periodic=(True, True)), scales=[1, 3, 7, 8, 9, 15])
    # every fourth row and column: one cell, then a part of the outline, then 3 x 3
    assert mass.mean_mass.values == pytest.approx([1, 1, 1, 4, 9, 9])


@pytest.mark.parametrize("name", BOTH)
def test_dust_beside_it_is_the_mean_of_dusts(name):
    rng = np.random.default_rng(3)
    planes = np.array([random_dust(64, 200, rng) for _ in range(200)])
    result = getattr(fc.domains, name)(as_mask(planes, periodic=(True, True)))
    curve, null = ("grown_fraction", "null_fraction") if name == BOTH[0] else ("mean_mass", "null_mass")
    values = result[curve].values
    error = values.std(0) / np.sqrt(200)
    assert np.all(np.abs(values.mean(0) - result[null].values[0]) <= 4 * error + 1e-9)
    assert float(result.null_dimension[0]) == pytest.approx(float(result[name].mean()), abs=0.03)


@pytest.mark.parametrize("name", BOTH)
def test_interval_holds_the_dimension_of_sets_placed_anywhere(name):
    rng = np.random.default_rng(4)
    for _ in range(2):
        for kind, level in (("carpet", 5), ("cantor_dust", 5), ("vicsek", 5), ("gasket", 8)):
            result = getattr(fc.domains, name)(as_mask(placed(lattice_set(kind, level), 400, rng)))
            assert float(result.ci_low) <= DIMENSION[kind] <= float(result.ci_high), kind
        result = getattr(fc.domains, name)(as_mask(koch_raster(400, rng)))
        assert float(result.ci_low) <= DIMENSION["koch"] <= float(result.ci_high)


@pytest.mark.parametrize("name", BOTH)
def test_shift_of_a_periodic_plane_and_a_mirror_change_nothing(name):
    cells = random_dust(60, 300, np.random.default_rng(5))
    want = measured(name, as_mask(cells, periodic=(True, True)))[1].item()
    for other in (np.roll(cells, (7, 50), (0, 1)), cells[::-1], cells.T):
        assert measured(name, as_mask(other, periodic=(True, True)))[1].item() == pytest.approx(
            want, rel=1e-12
        )


@pytest.mark.parametrize("name", BOTH)
def test_stack_equals_its_planes_and_empty_ones_say_why(name):
    planes = np.array([np.zeros((40, 40)), random_dust(40, 100, np.random.default_rng(6)), np.ones((40, 40))])
    result, dimension = measured(name, as_mask(planes[None], dims=("shear", "step", "y", "x")))
    assert dimension.dims == ("shear", "step")
    assert np.isnan(dimension.values[0, 0])
    assert "empty (1 planes)" in dimension.attrs["comment"]
    for k in (1, 2):
        alone = measured(name, as_mask(planes[k]))[0]
        for variable in (name, "ci_low", "null_dimension", "local_slope"):
            assert np.array_equal(alone[variable].values, result[variable].values[0, k])


@pytest.mark.parametrize("name", BOTH)
def test_gaps_shift_the_dimension_little(name):
    rng = np.random.default_rng(7)
    valid = rng.random((243, 243)) < 0.9
    valid[50:90, 100:160] = False
    carpet = as_mask(lattice_set("carpet", 5))
    whole = measured(name, carpet)[1].item()
    assert measured(name, carpet, valid=as_mask(valid))[1].item() == pytest.approx(whole, abs=0.05)
    full = measured(name, as_mask(np.ones((243, 243))), valid=as_mask(valid))[1].item()
    assert full == pytest.approx(2.0, abs=1e-12)


def test_wrong_calls_list_everything():
    with pytest.raises(ValueError, match=r"radii: expected a finite number >= 0.5 and <= 9") as caught:
        fc.domains.minkowski_dimension(as_mask(np.ones((5, 9))), radii=[0.1], periodic=True)
    assert "periodic" in str(caught.value)
    with pytest.raises(ValueError, match="integers"):
        fc.domains.correlation_dimension(as_mask(np.ones((5, 9))), scales=[1.5])


def test_one_scale_gives_no_slope():
    result, dimension = measured(
        "correlation_dimension", xr.DataArray(np.ones((1, 9), bool), dims=("y", "x"))
    )
    assert np.isnan(dimension)
    assert "no slope" in dimension.attrs["comment"]
    assert result.mean_mass.sizes["box_size"] == 1
