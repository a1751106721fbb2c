"""Description of a set: it repeats the results of the single functions."""

import numpy as np
import pytest
from domains.sets import as_mask, level_set

import fractalcontact as fc


def test_description_repeats_the_single_functions():
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
    for name in ("box_dimension", "null_dimension", "differs_from_random"):
        assert np.array_equal(result[name], boxes[name], equal_nan=True)
    assert np.array_equal(result.boundary_dimension_low, edge.ci_low, equal_nan=True)
    signature = fc.domains.signature(mask, connectivity=2)
    for name in ("gap_size", "domain_dimension", "signature_flag", "clustering", "integral_range_low"):
        assert np.array_equal(result[name], signature[name], equal_nan=True)
    assert not {"side", "box_size", "radius"} & set(result.dims)
    perimeter = (
        islands.perimeter.groupby(islands.island_step).sum() if "island_step" in islands.coords else None
    )
    assert perimeter is not None
    assert result.total_perimeter.values[1:] == pytest.approx(perimeter.values)
    assert np.array_equal(result.percolates, fc.domains.percolation(mask, connectivity=2).percolates)
    assert result.normal_force.values.tolist() == [0, 1, 2]
    assert "empty" in result.box_dimension.attrs["comment"]


def test_periodic_plane_may_be_declared_free():
    cells = level_set(40, 0.7, 0.4, np.random.default_rng(6))
    declared = fc.domains.describe(as_mask(cells, periodic=(True, True)), periodic=False)
    free = fc.domains.describe(as_mask(cells))
    for name in declared.data_vars:
        if name != "run_time":
            np.testing.assert_array_equal(declared[name], free[name], err_msg=name)
