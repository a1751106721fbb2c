"""Evolution along a path: events by hand, distances against slow maps, hysteresis, completeness."""

import numpy as np
import pytest
import xarray as xr
from domains.sets import as_mask, level_set, row_path
from scipy.ndimage import distance_transform_edt

import fractalcontact as fc


def test_events_of_a_small_path():
    cells = row_path(
        "..........",
        ".#...#..#.",
        ".#..##.##.",
        ".######.#.",
        ".##..#....",
        "..........",
    )
    result = fc.domains.evolution(as_mask(cells))
    names = ("births", "deaths", "merges", "splits", "absorbed", "fragments")
    table = {name: result[name].values[1:].tolist() for name in names}
    assert table["births"] == [3, 0, 0, 0, 0]
    assert table["deaths"] == [0, 0, 0, 1, 2]
    assert table["merges"] == [0, 0, 1, 0, 0]
    assert table["splits"] == [0, 0, 0, 1, 0]
    assert table["absorbed"] == [0, 0, 1, 0, 0]
    assert table["fragments"] == [0, 0, 0, 1, 0]
    assert result.overlap.values[1:] == pytest.approx([0, 3 / 5, 4 / 8, 3 / 7, 0])
    assert all(np.isnan(result[name].values[0]) for name in table)
    assert "first state along step" in result.births.attrs["comment"]


def test_events_follow_islands_across_the_edges():
    cells = row_path("#.......#", "##.....##")
    free = fc.domains.evolution(as_mask(cells))
    wrapped = fc.domains.evolution(as_mask(cells, periodic=(False, True)))
    moved = np.roll(cells, 4, 2)
    other = fc.domains.evolution(as_mask(moved, periodic=(False, True)))
    assert free.births[1] == wrapped.births[1] == 0
    assert float(wrapped.hausdorff_distance[1]) == float(other.hausdorff_distance[1]) == pytest.approx(1e-3)


def slow_hausdorff(first, second, spacing, wraps):
    """Measure by distance maps of a plane laid out three by three."""
    reach = []
    for start, goal in ((first, second), (second, first)):
        tiles = [3 if wrap else 1 for wrap in wraps]
        distance = distance_transform_edt(~np.tile(goal, tiles), sampling=spacing)
        ny, nx = first.shape
        top, left = (ny if wraps[0] else 0), (nx if wraps[1] else 0)
        reach.append(distance[top : top + ny, left : left + nx][start].max())
    return max(reach)


@pytest.mark.parametrize("wraps", [(False, False), (True, False), (True, True)])
def test_hausdorff_distance_matches_distance_maps(wraps):
    rng = np.random.default_rng(1)
    spacing = (2e-3, 5e-3)
    for _ in range(5):
        planes = rng.random((2, 23, 17)) < rng.uniform(0.005, 0.2)
        planes[:, 3, 3] = True
        result = fc.domains.evolution(as_mask(planes, spacing, wraps))
        expected = slow_hausdorff(planes[0], planes[1], spacing, wraps)
        assert float(result.hausdorff_distance[1]) == pytest.approx(expected, rel=1e-14)


def test_overlap_of_nested_sets_is_their_area_ratio():
    planes = np.array([level_set(64, 0.8, c, np.random.default_rng(2)) for c in (0.1, 0.2, 0.4)])
    result = fc.domains.evolution(as_mask(planes))
    area = planes.sum((1, 2))
    assert result.overlap.values[1:] == pytest.approx(area[:-1] / area[1:])
    assert np.all(result.deaths.values[1:] == 0)
    assert np.all(result.splits.values[1:] == 0)


def test_the_signature_that_is_there_is_taken():
    planes = np.array([level_set(64, 0.8, c, np.random.default_rng(2)) for c in (0.1, 0.2)])
    mask, options = as_mask(planes), {"window": (4e-3, 16e-3), "connectivity": 2}
    signature = fc.domains.signature(mask, **options)
    alone, shared = (fc.domains.evolution(mask, **options, signature=each) for each in (None, signature))
    xr.testing.assert_identical(
        *(each.drop_vars("run_time").drop_attrs(deep=False) for each in (alone, shared))
    )
    marked = signature.assign(gap_size=signature["gap_size"] + 1.0)
    assert (fc.domains.evolution(mask, **options, signature=marked).gap_size == marked.gap_size).all()
    others = {"connectivity": (mask, {"window": (4e-3, 16e-3)}), "mask": (mask[::-1], options)}
    for name, (other, given) in others.items():
        with pytest.raises(ValueError, match=f"signature: expected .*, got one with another {name}$"):
            fc.domains.evolution(other, **given, signature=signature)
    with pytest.raises(ValueError, match="signature: expected a result of `domains.signature`"):
        fc.domains.evolution(mask, signature=alone)


def test_earlier_leading_dims_are_separate_paths():
    planes = np.array([[level_set(32, 0.8, c, np.random.default_rng(s)) for c in (0.1, 0.3)] for s in (3, 4)])
    result = fc.domains.evolution(as_mask(planes, dims=("direction", "shear", "y", "x")))
    assert result.births.dims == ("direction", "shear")
    assert np.isnan(result.births.values[:, 0]).all()
    for k in (0, 1):
        alone = fc.domains.evolution(as_mask(planes[k], dims=("shear", "y", "x")))
        assert float(alone.hausdorff_distance[1]) == float(result.hausdorff_distance[k, 1])


def test_empty_sets_and_missing_path():
    result = fc.domains.evolution(as_mask(np.zeros((2, 5, 5))))
    assert np.isnan(result.overlap[1])
    assert np.isnan(result.hausdorff_distance[1])
    assert result.births[1] == 0
    with pytest.raises(ValueError, match="at least one leading dim"):
        fc.domains.evolution(as_mask(np.zeros((5, 5))))


def test_distance_is_in_cells_without_coordinates():
    planes = np.stack([np.eye(4, dtype=bool), np.eye(4, dtype=bool)])
    planes[1, 0, 0], planes[1, 0, 2] = False, True
    result = fc.domains.evolution(planes)
    assert float(result.hausdorff_distance[1]) == np.sqrt(2)
    assert result.hausdorff_distance.attrs["units"] == "1"


def test_evolution_repeats_all_scalars_and_curves():
    rng = np.random.default_rng(7)
    planes = np.array(
        [[np.zeros((40, 40)), *(level_set(40, 0.7, c, rng) for c in (0.05, 0.3))] for _ in range(2)]
    )
    mask = as_mask(planes, periodic=(True, True), dims=("shear", "step", "y", "x"))
    mask = mask.assign_coords(shear=[0.0, 1e-3], normal_force=(("shear", "step"), [[0, 1.0, 2], [0, 1, 3]]))
    measures = ["islands", "percolation", "lacunarity", "box_dimension", "minkowski_dimension"]
    measures += ["correlation_dimension", "boundary_dimension"]
    result = fc.domains.evolution(mask, include=measures)
    boxes, gaps = fc.domains.box_dimension(mask), fc.domains.lacunarity(mask)
    grown, pairs = fc.domains.minkowski_dimension(mask), fc.domains.correlation_dimension(mask)
    for name, expected in {
        "box_dimension": boxes.box_dimension,
        "box_dimension_low": boxes.ci_low,
        "null_dimension": boxes.null_dimension,
        "minkowski_dimension": grown.minkowski_dimension,
        "minkowski_null_dimension": grown.null_dimension,
        "grown_fraction": grown.grown_fraction,
        "correlation_dimension_high": pairs.ci_high,
        "boundary_dimension": fc.domains.boundary_dimension(mask).boundary_dimension,
        "n_islands": fc.domains.islands(mask).n_islands,
        "percolates": fc.domains.percolation(mask).percolates,
    }.items():
        assert result[name].dims[:2] == ("shear", "step")
        assert np.array_equal(result[name], expected, equal_nan=True), name
    for name, own in (("box_local_slope", boxes), ("lacunarity", gaps), ("correlation_local_slope", pairs)):
        source = own["lacunarity" if name == "lacunarity" else "local_slope"]
        chosen = result[name].sel(box_size=own.box_size.values)
        assert np.array_equal(chosen, source, equal_nan=True), name
    assert np.isnan(result.box_count.sel(box_size=16)).all()  # beyond the window of the dimension
    assert "fitted over 1 to 9 cells" in result.box_dimension.attrs["comment"]
    assert "empty (2 planes)" in result.box_dimension.attrs["comment"]
    assert np.isnan(result.box_dimension.values[:, 0]).all()
    assert np.isfinite(result.box_dimension.values[:, 1:]).all()


def test_only_what_is_wanted_is_measured():
    planes = np.array([level_set(24, 0.7, c, np.random.default_rng(8)) for c in (0.1, 0.3)])
    result = fc.domains.evolution(as_mask(planes), include=["lacunarity"])
    assert "box_count" not in result
    assert set(result.dims) == {"step", "box_size", "side", "scale"}
    assert set(fc.domains.evolution(as_mask(planes)).dims) == {"step", "side", "scale"}
    with pytest.raises(ValueError, match="include: expected any of"):
        fc.domains.evolution(as_mask(planes), include=["gaps"])


def test_signature_of_each_state_is_there():
    planes = np.array([level_set(64, 0.7, c, np.random.default_rng(8)) for c in (0.1, 0.3)])
    mask = as_mask(planes, periodic=(True, True))
    expected = fc.domains.signature(mask, window=(4e-3, 16e-3))
    result = fc.domains.evolution(mask, window=(4e-3, 16e-3))
    for name, variable in expected.drop_vars("run_time").variables.items():
        np.testing.assert_array_equal(result[name], variable, err_msg=name)
        assert result[name].attrs["long_name"] == variable.attrs["long_name"]


def test_counts_of_islands_add_up():
    rng = np.random.default_rng(3)
    planes = rng.random((5, 40, 40)) < rng.uniform(0.1, 0.5, (5, 1, 1))
    result = fc.domains.evolution(as_mask(planes, periodic=(True, False)))
    change = result.births - result.deaths - result.absorbed + result.fragments
    np.testing.assert_array_equal(change[1:], np.diff(result.n_islands))
    assert (result.absorbed >= result.merges)[1:].all()
    assert (result.absorbed > result.merges).any()


def test_overlap_of_random_sets_is_that_by_chance():
    rng = np.random.default_rng(4)
    planes = rng.random((6, 200, 200)) < 0.2
    result = fc.domains.evolution(as_mask(planes))
    np.testing.assert_allclose(result.overlap[1:], result.chance_overlap[1:], rtol=0.08)
    np.testing.assert_allclose(result.chance_overlap[1:], 0.04 / 0.36, rtol=0.05)
    np.testing.assert_allclose(result.overlap_beyond_chance[1:], 0.0, atol=0.01)
    same = fc.domains.evolution(as_mask(planes[[0, 0]]))
    assert float(same.overlap_beyond_chance[1]) == 1.0


@pytest.mark.parametrize(("direction", "step"), [("E", (0, -4)), ("N", (-4, 0)), ("SW", (3, 3))])
@pytest.mark.parametrize("wraps", [True, False])
def test_frames_follow_either_face(direction, step, wraps):
    """A set that stays with the lower face moves backwards on the block by the travel."""
    first = np.zeros((40, 40), bool)
    first[12:24, 14:26] = True
    second = np.roll(first, step, (0, 1))
    travel = 4e-3 if direction != "SW" else 3e-3 * np.sqrt(2)
    mask = as_mask([first, second], periodic=(wraps, wraps), dims=("shear", "y", "x"))
    mask = mask.assign_coords(shear=[0.0, travel], direction=direction)
    overlaps = {
        frame: float(fc.domains.evolution(mask, frame=frame).overlap[1])
        for frame in ("upper", "middle", "lower")
    }
    assert overlaps["lower"] == 1.0
    assert overlaps["upper"] < overlaps["middle"] < 1.0
    assert fc.domains.lineage(mask, frame="lower").common_cells.values.tolist() == [144]
    with pytest.raises(ValueError, match="frame: expected 'upper', or a path along shear"):
        fc.domains.evolution(mask.drop_vars("shear"), frame="lower")


@pytest.mark.parametrize(("direction", "step"), [("E", (0, 4)), ("S", (-4, 0)), ("NE", (3, 3))])
def test_what_moves_in_or_out_at_a_free_edge_is_no_change(direction, step):
    face = level_set(64, 0.7, 0.3, np.random.default_rng(2))
    blocks = [face[8 + k * step[0] :, 8 + k * step[1] :][:40, :45] for k in range(3)]
    travel = 4e-3 if direction != "NE" else 3e-3 * np.sqrt(2)
    mask = as_mask(blocks, dims=("shear", "y", "x"))
    mask = mask.assign_coords(shear=travel * np.arange(3), direction=direction)
    result = fc.domains.evolution(mask, frame="lower")
    np.testing.assert_array_equal(result.overlap[1:], 1.0)
    np.testing.assert_array_equal(result.hausdorff_distance[1:], 0.0)
    mask[1] = face[:40, :45]  # another set: the same numbers on the way back
    result, back = (fc.domains.evolution(way, frame="lower") for way in (mask, mask.isel(shear=[2, 1, 0])))
    for name in ("overlap", "hausdorff_distance"):
        np.testing.assert_array_equal(result[name][1:], back[name][:0:-1])
    gone = mask.isel(shear=[0, 1]).assign_coords(shear=[0.0, 1.0])
    assert np.isnan(fc.domains.evolution(gone, frame="lower").overlap[1])


def test_islands_are_not_followed_over_more_than_a_spot():
    planes = np.zeros((3, 64, 64), bool)
    planes[:, 10:14, 10:14] = planes[:, 30:34, 40:44] = True
    mask = as_mask(planes, periodic=(True, True), dims=("shear", "y", "x"))
    mask = mask.assign_coords(shear=[0.0, 2e-3, 20e-3])
    result = fc.domains.evolution(mask)
    for name in ("births", "deaths", "merges", "splits", "absorbed", "fragments"):
        np.testing.assert_array_equal(result[name], [np.nan, 0, np.nan])
        assert "further than a spot" in result[name].attrs["comment"]
    assert np.isfinite(result.overlap[1:]).all()
    back = fc.domains.evolution(mask.isel(shear=slice(None, None, -1)))
    np.testing.assert_array_equal(back.births, [np.nan, np.nan, 0])


def test_along_names_the_path():
    rng = np.random.default_rng(5)
    planes = np.array([[level_set(32, 0.8, c, rng) for c in (0.1, 0.2, 0.3)] for _ in range(2)])
    mask = as_mask(planes, periodic=(True, True), dims=("shear", "step", "y", "x"))
    mask = mask.assign_coords(shear=[0.0, 1e-4])
    result = fc.domains.evolution(mask, along="shear")
    turned = fc.domains.evolution(mask.transpose("step", "shear", "y", "x"))
    for name in ("births", "absorbed", "overlap", "hausdorff_distance", "gap_size_ratio"):
        assert result[name].dims == ("shear", "step")
        np.testing.assert_array_equal(result[name], turned[name].transpose("shear", "step"))
    first, second = (fc.domains.lineage(each, along="shear") for each in (mask, turned.n_islands * 0 + mask))
    assert first.sizes == second.sizes
    with pytest.raises(ValueError, match="along: expected one of"):
        fc.domains.evolution(mask, along="member")


def test_hysteresis_of_a_cycle():
    cells = row_path("#.........", "##........", "####......", "###.......", "#.........", "###.......")
    force = [1.0, 2.0, 3.0, 2.0, 1.0, 2.0]
    mask = as_mask(cells).assign_coords(normal_force=("step", force))
    result = fc.domains.evolution(mask)
    nan = np.nan
    assert np.array_equal(result.return_step, [nan, nan, nan, 1, 0, 3], equal_nan=True)
    assert result.hysteresis.values[3:] == pytest.approx([1 / 3, 0, 0])
    assert result.coverage_change.values[3:] == pytest.approx([0.1, 0, 0])
    assert "come back to the same normal_force" in result.hysteresis.attrs["comment"]
    up = fc.domains.evolution(mask.isel(step=slice(3)))
    assert np.isnan(up.hysteresis).all()
    assert "hysteresis" not in fc.domains.evolution(as_mask(cells))


def test_elastic_contact_has_no_hysteresis():
    face = fc.surfaces.spectral((32, 32), 1e-5, hurst=0.8, rms_slope=0.1, rng=1)
    pressure = 1e10 * np.array([0.001, 0.004, 0.01, 0.004, 0.001])
    pressed = fc.contact.press(face, contact_modulus=1e10, nominal_pressure=pressure)
    result = fc.domains.evolution(pressed["state"])
    assert result.return_step.values[3:].tolist() == [1, 0]
    assert result.hysteresis.values[3:].tolist() == [0, 0]


def test_empty_planes_have_a_reason():
    planes = np.zeros((4, 9, 9), bool)
    planes[2, 3, 4] = True
    result = fc.domains.evolution(as_mask(planes))
    assert np.isnan(result.hausdorff_distance).all()
    assert result.overlap.values[1:].tolist() == pytest.approx([np.nan, 0, 0], nan_ok=True)
    assert result.hausdorff_distance.comment.endswith("and where a set is empty")
    assert result.overlap.comment.endswith("and where both sets are empty")
    assert "where" not in fc.domains.evolution(as_mask(planes[[2, 2]])).overlap.comment
