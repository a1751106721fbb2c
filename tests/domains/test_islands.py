"""Islands: hand-made planes, another library, slow graphs, invariance under periodic shifts."""

import numpy as np
import pytest
import xarray as xr
from domains.sets import as_mask, level_set
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from skimage import measure

import fractalcontact as fc


def slow_labels(cells, connectivity, wraps):
    """Number the islands through a graph of all neighbours."""
    ny, nx = cells.shape
    number = np.arange(ny * nx).reshape(ny, nx)
    steps = [(0, 1), (1, 0), (1, 1), (1, -1)][: 2 * connectivity]
    links = []
    for y, x in np.argwhere(cells):
        for down, right in steps:
            row, column = y + down, x + right
            if (
                (wraps[0] or 0 <= row < ny)
                and (wraps[1] or 0 <= column < nx)
                and cells[row % ny, column % nx]
            ):
                links.append((number[y, x], number[row % ny, column % nx]))
    links = np.array(links, int).reshape(-1, 2)
    graph = coo_matrix((np.ones(len(links)), links.T), shape=(ny * nx, ny * nx))
    return connected_components(graph, directed=False)[1].reshape(ny, nx)


@pytest.mark.parametrize("connectivity", [1, 2])
def test_free_planes_match_scikit_image(connectivity):
    rng = np.random.default_rng(1)
    for _ in range(6):
        cells = rng.random((20, 17)) < rng.random()
        result = fc.domains.islands(as_mask(cells, (2.0, 3.0)), connectivity=connectivity)
        assert int(result.n_islands) == measure.label(cells, connectivity=connectivity).max()
        assert int(result.euler_number) == measure.euler_number(cells, connectivity=connectivity)
        for region in measure.regionprops(result.label.values):
            island = result.isel(island=region.label - 1)
            assert int(island.island_label) == region.label
            assert int(island.cells) == region.area
            assert float(island.area) == 6 * region.area
            centroid = (np.array(region.centroid) + 0.5) * (2, 3)
            assert [float(island.centroid_y), float(island.centroid_x)] == pytest.approx(centroid)
            box = [float(island[name]) for name in ("y_min", "x_min", "y_max", "x_max")]
            assert box == pytest.approx(np.array(region.bbox) * (2, 3, 2, 3))


@pytest.mark.parametrize("connectivity", [1, 2])
@pytest.mark.parametrize("wraps", [(True, True), (True, False), (False, True)])
def test_periodic_planes_match_a_graph_and_their_shift(connectivity, wraps):
    rng = np.random.default_rng(2)
    for _ in range(5):
        cells = rng.random((20, 17)) < rng.uniform(0.2, 0.7)
        result = fc.domains.islands(as_mask(cells, (2.0, 3.0), wraps), connectivity=connectivity)
        slow = slow_labels(cells, connectivity, wraps)
        pairs = np.unique(np.stack([slow[cells], result.label.values[cells]]), axis=1).shape[1]
        assert pairs == int(result.n_islands) == len(np.unique(slow[cells]))
        shift = (7 * wraps[0], 5 * wraps[1])
        rolled = as_mask(np.roll(cells, shift, (0, 1)), (2.0, 3.0), wraps)
        moved = fc.domains.islands(rolled, connectivity=connectivity)
        assert int(moved.euler_number) == int(result.euler_number)
        for name in ("area", "perimeter"):
            assert np.array_equal(np.sort(result[name]), np.sort(moved[name]))
        own, shifted = (
            sorted(zip(*columns(r, where), strict=True)) for r, where in ((result, shift), (moved, (0, 0)))
        )
        assert np.array(own) == pytest.approx(np.array(shifted), nan_ok=True)


def columns(result, shift):
    """Return what a shift of the plane must not change of the islands, after shifting their centroids."""
    centre_x = np.nan_to_num((result.centroid_x.values + 3 * shift[1]) % 51, nan=-1).round(9)
    centre_y = np.nan_to_num((result.centroid_y.values + 2 * shift[0]) % 40, nan=-1).round(9)
    width, height = result.x_max - result.x_min, result.y_max - result.y_min
    return result.area.values, centre_x, centre_y, width.values, height.values


@pytest.mark.parametrize(
    ("connectivity", "wraps"),
    [
        (1, (False, True)),
        (2, (True, True)),
        *(pytest.param(connectivity, (False, False), marks=pytest.mark.slow) for connectivity in (1, 2)),
    ],
)
def test_bands_give_the_same_table(connectivity, wraps):
    """Without labels 2^22 cells are looked at at a time, here two bands; with labels the whole plane."""
    rng = np.random.default_rng(6)
    for density in (0.4, 0.6):
        coarse = rng.random((97, 26)) < density
        mask = as_mask(coarse.repeat(27, 0).repeat(67, 1), (1.0, 2.0), wraps)
        assert mask.size > 2**22
        complete = fc.domains.islands(mask, connectivity=connectivity)
        bands = fc.domains.islands(mask, connectivity=connectivity, keep=())
        assert "label" not in bands
        for name in bands.data_vars:
            if name != "run_time":
                assert np.array_equal(bands[name], complete[name], equal_nan=True), name
        small = fc.domains.percolation(as_mask(coarse, (27.0, 134.0), wraps), connectivity=connectivity)
        large = fc.domains.percolation(mask, connectivity=connectivity)
        assert np.array_equal(large.percolates, small.percolates)


TABLE = ["cells", "area", "perimeter", "centroid_x", "centroid_y", "x_min", "x_max", "y_min", "y_max"]


def test_table_has_the_wanted_columns():
    mask = as_mask(np.random.default_rng(9).random((2, 30, 20)) < 0.4, periodic=(True, False))
    complete = fc.domains.islands(mask, keep=()).drop_vars("run_time")
    none = fc.domains.islands(mask, keep=(), include=()).drop_vars("run_time")
    assert none.identical(complete.drop_dims("island").assign_attrs(none.attrs))
    for columns in (["area"], ["y_max", "cells"], ["perimeter"]):
        some = fc.domains.islands(mask, keep=(), include=columns).drop_vars("run_time")
        assert some.identical(complete.drop_vars(set(TABLE) - set(columns)).assign_attrs(some.attrs))
    with pytest.raises(ValueError, match="include: expected any of 'cells', 'area'"):
        fc.domains.islands(mask, include=["hue"])


@pytest.mark.slow
def test_of_millions_of_islands_only_the_cells_are_measured():
    cells = np.zeros((4100, 4100), bool)
    cells[::2, ::2] = True  # 2050^2 islands, more than 2^22
    mask = as_mask(cells, (1.0, 1.0), (True, True))
    few = fc.domains.islands(mask, keep=())
    assert set(few.data_vars) & set(TABLE) == {"cells", "area"}
    assert "name the columns" in few.n_islands.comment
    assert (few.cells == 1).all()
    more = fc.domains.islands(mask, keep=(), include=["perimeter"])
    assert (more.perimeter == 4).all()
    assert "comment" not in more.n_islands.attrs


def test_chunked_masks_give_the_same_results():
    pytest.importorskip("dask")
    mask = as_mask(np.random.default_rng(7).random((2, 30, 20)) < 0.4)
    valid = as_mask(np.random.default_rng(8).random((30, 20)) < 0.9)
    for function in (fc.domains.islands, fc.domains.box_dimension, fc.domains.lacunarity):
        complete = function(mask, valid=valid).drop_vars("run_time")
        chunked = function(mask.chunk(step=1, y=7, x=9), valid=valid.chunk(y=11)).drop_vars("run_time")
        assert complete.identical(chunked.assign_attrs(complete.attrs))


def test_centroid_and_box_of_an_island_across_the_edges():
    cells = np.zeros((8, 10), bool)
    cells[np.ix_([7, 0], [9, 0, 1])] = True
    result = fc.domains.islands(as_mask(cells, (1.0, 2.0), (True, True))).isel(island=0)
    assert (float(result.centroid_y), float(result.centroid_x)) == (0.0, 1.0)
    assert [float(result[n]) for n in ("y_min", "y_max", "x_min", "x_max")] == [7, 9, 18, 24]
    assert float(result.perimeter) == 2 * (2 * 1 + 3 * 2)


def test_island_that_wraps_around_has_no_centroid():
    cells = np.zeros((9, 6), bool)
    cells[4] = True
    result = fc.domains.islands(as_mask(cells, (1.0, 1.0), (True, True))).isel(island=0)
    assert np.isnan(result.centroid_x)
    assert float(result.centroid_y) == 4.5
    assert (float(result.x_min), float(result.x_max), float(result.perimeter)) == (0, 6, 12)


def test_table_of_a_stack_has_coordinates_of_the_plane():
    planes = np.zeros((2, 3, 6, 6), bool)
    planes[0, 1, 2, 2] = planes[1, 2, 0, 0] = planes[1, 2, 4, 4:6] = True
    mask = as_mask(planes, dims=("seed", "step", "y", "x")).assign_coords(
        step=[10, 20, 30], closure=("step", [1.0, 2, 3])
    )
    result = fc.domains.islands(mask)
    assert result.n_islands.values.tolist() == [[0, 1, 0], [0, 0, 2]]
    assert result.island_step.values.tolist() == [20, 30, 30]
    assert result.island_seed.values.tolist() == [0, 1, 1]
    assert result.cells.values.tolist() == [1, 1, 2]
    assert result.largest_cells.values.tolist() == [[0, 1, 0], [0, 0, 2]]
    assert float(result.mean_island_area[1, 2]) == pytest.approx(1.5e-6)
    assert np.isnan(result.largest_island[0, 0])
    assert result.closure.values.tolist() == [1, 2, 3]
    for name in ("label", "area", "island_step", "island_label"):
        assert result[name].attrs["long_name"]


def test_lengths_are_in_cells_without_coordinates():
    mask = xr.DataArray(np.eye(5, dtype=bool), dims=("y", "x"))
    result = fc.domains.islands(mask, connectivity=2)
    assert result.cells.values.tolist() == [5]
    assert result.area.values.tolist() == [5]
    assert float(result.largest_island) == 5
    for name in ("area", "largest_island", "perimeter"):
        assert result[name].attrs["units"] == "1"
        assert result[name].attrs["comment"] == "in cells"
    assert int(fc.domains.islands(mask, connectivity=1).n_islands) == 5
    assert (
        int(fc.domains.islands(xr.where(mask, 1, 0).roll(x=1), connectivity=2, periodic=True).n_islands) == 1
    )


def test_unobserved_cells_separate_islands():
    valid = np.ones((5, 5), bool)
    valid[2] = False
    assert int(fc.domains.islands(as_mask(np.ones((5, 5))), valid=as_mask(valid)).n_islands) == 2


def test_euler_number_counts_holes_and_handles():
    ring = np.ones((5, 5), bool)
    ring[2, 2] = False
    assert int(fc.domains.islands(as_mask(ring)).euler_number) == 0
    full = np.ones((5, 5), bool)
    assert int(fc.domains.islands(as_mask(full)).euler_number) == 1
    assert int(fc.domains.islands(as_mask(full, periodic=(True, True))).euler_number) == 0  # a torus


def test_largest_island_grows_with_load():
    planes = np.array([level_set(64, 0.8, c, np.random.default_rng(5)) for c in (0.05, 0.2, 0.6)])
    result = fc.domains.islands(as_mask(planes, periodic=(True, True)))
    assert np.all(np.diff(result.largest_cells.values) > 0)


def test_all_invalid_arguments_are_reported():
    with pytest.raises(ValueError) as caught:
        fc.domains.islands(as_mask(np.ones((5, 5))).astype(float), connectivity=3)
    assert "connectivity" in str(caught.value)
    assert "compare numbers first" in str(caught.value)


@pytest.mark.parametrize("share", [0.02, 0.5])
def test_sizes_are_those_of_the_map(share):
    """Few runs of equal labels, and as many as white noise has."""
    cells = np.random.default_rng(2).random((150, 170)) < share
    found = fc.domains.islands(as_mask(cells), periodic=False)
    np.testing.assert_array_equal(found.cells.values, np.bincount(found.label.values.ravel())[1:])


SHAPES = ("orientation", "eccentricity", "gyration_radius", "solidity")


@pytest.mark.parametrize("spacing", [(1e-3, 1e-3), (2e-3, 1e-3)])
def test_shapes_match_scikit_image(spacing):
    cells = level_set(80, 0.6, 0.2, np.random.default_rng(12))
    mask = as_mask(cells, spacing)
    result = fc.domains.islands(mask, connectivity=2, include=("cells", *SHAPES))
    properties = measure.regionprops(measure.label(cells, connectivity=2), spacing=spacing)
    assert result.cells.values.tolist() == [int(each.num_pixels) for each in properties]
    expected = {name: np.array([getattr(each, name) for each in properties]) for name in SHAPES[:2]}
    # an ellipse without a long axis has no orientation, and one of a single row has rounding alone across
    is_long = expected["eccentricity"] > 0.1
    difference = np.rad2deg(expected["orientation"]) - result.orientation.values
    assert np.abs((difference[is_long] + 90) % 180 - 90).max() < 1e-6
    np.testing.assert_allclose(result.eccentricity, expected["eccentricity"], atol=1e-6)
    radius = [np.sqrt(np.trace(each.inertia_tensor)) for each in properties]
    np.testing.assert_allclose(result.gyration_radius, radius, rtol=1e-9, atol=1e-12)
    solidity = [each.num_pixels / each.image_convex.sum() for each in properties]
    np.testing.assert_allclose(result.solidity, solidity, rtol=1e-12)


def test_shapes_follow_islands_across_periodic_edges():
    cells = level_set(60, 0.9, 0.1, np.random.default_rng(4))
    at_home = as_mask(cells, periodic=(True, True))
    moved = as_mask(np.roll(cells, (17, 31), (0, 1)), periodic=(True, True))
    first, second = (
        fc.domains.islands(mask, include=("cells", "perimeter", *SHAPES)) for mask in (at_home, moved)
    )
    assert fc.domains.islands(at_home, periodic=False, keep=()).n_islands > first.n_islands
    for name in ("gyration_radius", "eccentricity", "solidity"):
        np.testing.assert_allclose(np.sort(first[name]), np.sort(second[name]), rtol=1e-9, atol=1e-9)
    band = np.zeros((12, 12), bool)
    band[4:6] = True
    wrapped = fc.domains.islands(as_mask(band, periodic=(True, True)), include=SHAPES)
    assert all(np.isnan(wrapped[name]).all() for name in SHAPES)


def test_shape_of_a_tilted_ellipse():
    y, x = np.indices((201, 201)) - 100.0
    along, across = (
        x * np.cos(np.pi / 6) + y * np.sin(np.pi / 6),
        y * np.cos(np.pi / 6) - x * np.sin(np.pi / 6),
    )
    ellipse = (along / 80) ** 2 + (across / 40) ** 2 <= 1
    result = fc.domains.islands(ellipse, keep=(), include=SHAPES)
    assert float(result.orientation[0]) == pytest.approx(60.0, abs=0.5)  # from y; 30 from x
    assert float(result.eccentricity[0]) == pytest.approx(np.sqrt(3) / 2, abs=0.005)
    assert float(result.gyration_radius[0]) == pytest.approx(np.hypot(80, 40) / 2, rel=0.01)
    assert float(result.solidity[0]) > 0.97
