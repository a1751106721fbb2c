"""Islands along a path, and the description of a stack."""

import numpy as np
import pytest
import xarray as xr
from domains.sets import as_mask, level_set
from scipy.ndimage import distance_transform_edt

import fractalcontact as fc


def path(*rows):
    """Make planes of one row of cells each out of strings."""
    return np.array([[[letter == "#" for letter in row]] * 2 for row in rows])


def test_events_of_a_path_by_hand():
    cells = path(
        "..........",
        ".#...#..#.",
        ".#..##.##.",
        ".######.#.",
        ".##..#....",
        "..........",
    )
    result = fc.domains.evolution(as_mask(cells))
    table = {name: result[name].values[1:].tolist() for name in ("births", "deaths", "merges", "splits")}
    assert table["births"] == [3, 0, 0, 0, 0]
    assert table["deaths"] == [0, 0, 0, 1, 2]
    assert table["merges"] == [0, 0, 1, 0, 0]
    assert table["splits"] == [0, 0, 0, 1, 0]
    assert result.overlap.values[1:] == pytest.approx([0, 3 / 5, 4 / 8, 3 / 7, 0])
    assert all(np.isnan(result[name].values[0]) for name in table)
    assert "first plane along step" in result.births.attrs["comment"]


def test_events_follow_islands_over_the_edges():
    cells = path("#.......#", "##.....##")
    free = fc.domains.evolution(as_mask(cells))
    round_ = fc.domains.evolution(as_mask(cells, periodic=(False, True)))
    moved = np.roll(cells, 4, 2)
    other = fc.domains.evolution(as_mask(moved, periodic=(False, True)))
    assert free.births[1] == round_.births[1] == 0
    assert float(round_.hausdorff_distance[1]) == float(other.hausdorff_distance[1]) == pytest.approx(1e-3)


def slow_hausdorff(one, other, spacing, wraps):
    """Measure by distance maps of a plane laid out three by three."""
    reach = []
    for start, goal in ((one, other), (other, one)):
        tiles = [3 if wrap else 1 for wrap in wraps]
        distance = distance_transform_edt(~np.tile(goal, tiles), sampling=spacing)
        ny, nx = one.shape
        top, left = (ny if wraps[0] else 0), (nx if wraps[1] else 0)
        reach.append(distance[top : top + ny, left : left + nx][start].max())
    return max(reach)


@pytest.mark.parametrize("wraps", [(False, False), (True, False), (True, True)])
def test_hausdorff_distance_against_distance_maps(wraps):
    rng = np.random.default_rng(1)
    spacing = (2e-3, 5e-3)
    for _ in range(5):
        planes = rng.random((2, 23, 17)) < rng.uniform(0.005, 0.2)
        planes[:, 3, 3] = True
        result = fc.domains.evolution(as_mask(planes, spacing, wraps))
        want = slow_hausdorff(planes[0], planes[1], spacing, wraps)
        assert float(result.hausdorff_distance[1]) == pytest.approx(want, rel=1e-14)


def test_overlap_of_growing_sets_is_the_ratio_of_their_areas():
    planes = np.array([level_set(64, 0.8, c, np.random.default_rng(2)) for c in (0.1, 0.2, 0.4)])
    result = fc.domains.evolution(as_mask(planes))
    area = planes.sum((1, 2))
    assert result.overlap.values[1:] == pytest.approx(area[:-1] / area[1:])
    assert np.all(result.deaths.values[1:] == 0)
    assert np.all(result.splits.values[1:] == 0)


def test_several_leading_dims_are_paths_of_their_own():
    planes = np.array([[level_set(32, 0.8, c, np.random.default_rng(s)) for c in (0.1, 0.3)] for s in (3, 4)])
    result = fc.domains.evolution(as_mask(planes, dims=("direction", "shear", "y", "x")))
    assert result.births.dims == ("direction", "shear")
    assert np.isnan(result.births.values[:, 0]).all()
    for k in (0, 1):
        alone = fc.domains.evolution(as_mask(planes[k], dims=("shear", "y", "x")))
        assert float(alone.hausdorff_distance[1]) == float(result.hausdorff_distance[k, 1])


def test_empty_sets_have_no_distance_and_a_plane_alone_no_path():
    result = fc.domains.evolution(as_mask(np.zeros((2, 5, 5))))
    assert np.isnan(result.overlap[1])
    assert np.isnan(result.hausdorff_distance[1])
    assert result.births[1] == 0
    with pytest.raises(ValueError, match="at least one leading dim"):
        fc.domains.evolution(as_mask(np.zeros((5, 5))))


def test_no_metres_without_coordinates():
    planes = xr.DataArray(np.eye(4, dtype=bool)[None] * np.ones((2, 1, 1), bool), dims=("step", "y", "x"))
    result = fc.domains.evolution(planes)
    assert np.isnan(result.hausdorff_distance).all()
    assert float(result.overlap[1]) == 1


def test_description_repeats_what_the_functions_say():
    planes = np.array(
        [np.zeros((48, 48)), *(level_set(48, 0.7, c, np.random.default_rng(5)) for c in (0.1, 0.5))]
    )
    mask = as_mask(planes, (1e-3, 2e-3), (True, True)).assign_coords(normal_force=("step", [0.0, 1.0, 2.0]))
    result = fc.domains.describe(mask, connectivity=2)
    islands = fc.domains.islands(mask, connectivity=2)
    boxes, edge = fc.domains.box_dimension(mask), fc.domains.boundary_dimension(mask)
    for name in ("n_islands", "largest_island", "mean_island_area", "euler_number"):
        assert result[name].identical(islands[name]) or np.array_equal(
            result[name], islands[name], equal_nan=True
        )
    for name in ("box_dimension", "dust_dimension", "differs_from_dust"):
        assert np.array_equal(result[name], boxes[name], equal_nan=True)
    assert np.array_equal(result.boundary_dimension_low, edge.ci_low, equal_nan=True)
    gaps = fc.domains.lacunarity(mask, [8]).lacunarity[:, 0]
    assert np.array_equal(result.lacunarity, gaps, equal_nan=True)
    assert int(result.box_size) == 8
    perimeter = (
        islands.perimeter.groupby(islands.island_step).sum() if "island_step" in islands.coords else None
    )
    assert perimeter is not None
    assert result.total_perimeter.values[1:] == pytest.approx(perimeter.values)
    assert np.array_equal(result.percolates, fc.domains.percolation(mask, connectivity=2).percolates)
    assert result.normal_force.values.tolist() == [0, 1, 2]
    assert "empty" in result.box_dimension.attrs["comment"]


def test_description_may_call_a_periodic_plane_free():
    cells = level_set(40, 0.7, 0.4, np.random.default_rng(6))
    one = fc.domains.describe(as_mask(cells, periodic=(True, True)), periodic=False)
    other = fc.domains.describe(as_mask(cells))
    for name in one.data_vars:
        if name != "run_time":
            assert np.array_equal(one[name], other[name], equal_nan=True), name
