"""Minkowski dimension: the dilated area cell by cell, distance transforms, mirrored edges."""

import numpy as np
import pytest
from domains.sets import as_mask, random_null
from scipy.ndimage import distance_transform_edt

import fractalcontact as fc

WRAPS = [(False, False), (True, False), (True, True)]


def dilated_area(cells, radii, spacing=(1.0, 1.0), wraps=(False, False), valid=None):
    """Return the area in cells within each radius, by the public function."""
    mask = as_mask(cells, spacing, wraps)
    observed = None if valid is None else as_mask(valid, spacing, wraps)
    result = fc.domains.minkowski_dimension(mask, radii=radii, valid=observed)
    assert result.radius.values == pytest.approx(radii)
    return result.grown_fraction.values * (np.size(cells) if valid is None else np.sum(valid))


def axis_distance(a, b, n, spacing, wrap):
    """Return the distance of two cells along one axis."""
    cells = abs(a - b)
    return spacing * (np.minimum(cells, n - cells) if wrap else cells)


@pytest.mark.parametrize("wraps", WRAPS)
def test_area_matches_distances_cell_by_cell(wraps):
    rng = np.random.default_rng(1)
    ny, nx, spacing = 19, 23, (2.0, 0.5)  # side 1
    radii = np.array([0.5, 1.3, 2.0, 3.7])
    margin = [0 if wrap else 9 for wrap in wraps]  # so far from a free edge no mirror image counts
    for _ in range(4):
        cells = np.zeros((ny, nx), np.uint8)
        inner = cells[margin[0] : ny - margin[0], margin[1] : nx - margin[1]]
        inner[:] = rng.random(inner.shape) < 0.2
        inner[0, 0] = 1
        expected = np.zeros(radii.size)
        y, x = np.nonzero(cells)
        for i in range(ny):
            for j in range(nx):
                along_y = axis_distance(i, y, ny, 2.0, wraps[0])
                distance = np.hypot(along_y, axis_distance(j, x, nx, 0.5, wraps[1])).min()
                expected += np.clip(radii - distance + 0.5, 0, 1)
        assert dilated_area(cells, radii, spacing, wraps) == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize("ratio", [1.0, 1.5, 2.0])
def test_nearest_cells_do_not_depend_on_the_unit(ratio):
    cells = np.random.default_rng(0).random((60, 80)) < 0.03  # many cells have several nearest ones
    mask, radii = cells.astype(np.uint8), np.array([1.0, 2.0, 4.0, 8.0])
    expected = dilated_area(mask, radii, (1.0, ratio))
    for spacing in (1e-9, 3e-4, 1e-3, 0.7, 1e6):
        area = dilated_area(mask, radii, (spacing, spacing * ratio))
        assert area == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("ratio", [1.5, 2e5])  # of the spacings; offsets beyond 2^14 rows are stored as int32
def test_area_matches_the_distance_transform(ratio):
    n = 128
    cells = random_null(n, 90, np.random.default_rng(4))
    spacing = np.array([1.0, ratio]) / np.sqrt(ratio)  # in sides of a square with the area of a cell
    distance = distance_transform_edt(np.tile(~cells, (3, 3)), sampling=spacing)[n : 2 * n, n : 2 * n]
    radii = np.array([0.5, 1.0, 1.7, 4.0, 9.3, 30.0, 60.0])
    assert ratio < 2 or radii[-1] / spacing[0] > 2**14
    expected = [np.clip(r - distance + 0.5, 0, 1).sum() for r in radii]
    area = dilated_area(cells, radii, tuple(spacing), (True, True))
    assert area == pytest.approx(expected, rel=1e-12)


def test_area_is_invariant_under_mirrors_and_transposition():
    rng = np.random.default_rng(5)
    radii = np.array([0.5, 1.0, 2.5, 4.0, 7.0])
    for spacing in ((1.0, 1.0), (1.5, 1.0)):
        cells, valid = (rng.random((31, 40)) < share for share in (0.03, 0.9))
        cells &= valid
        expected = dilated_area(cells, radii, spacing, (False, True), valid)
        for step in ((-1, 1), (1, -1), (-1, -1)):
            mirrored = [plane[:: step[0], :: step[1]] for plane in (cells, valid)]
            area = dilated_area(mirrored[0], radii, spacing, (False, True), mirrored[1])
            assert np.array_equal(area, expected)
        area = dilated_area(cells.T, radii, spacing[::-1], (True, False), valid.T)
        assert area == pytest.approx(expected, rel=1e-14)


def test_area_beyond_a_free_edge_is_the_mirror_image():
    cross = np.zeros((41, 41), np.uint8)
    cross[20] = cross[:, 20] = 1
    radii = np.array([0.5, 1.0, 2.5, 4.0])
    row = np.zeros((21, 41), np.uint8)
    row[0] = 1
    assert dilated_area(row, radii) == pytest.approx(41 * 2 * radii, rel=1e-14)
    assert np.all(dilated_area(cross, radii) <= 2 * 41 * 2 * radii)


def test_all_invalid_arguments_are_reported():
    with pytest.raises(ValueError, match=r"radii: expected a finite number >= 0.5 and <= 9") as caught:
        fc.domains.minkowski_dimension(as_mask(np.ones((5, 9))), radii=[0.1], periodic=True)
    assert "periodic" in str(caught.value)
