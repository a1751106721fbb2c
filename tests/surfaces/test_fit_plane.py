"""Best-fit plane of points: exact planes in any orientation, thickness, and points without a plane."""

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput

RNG = np.random.default_rng(3)


def turned(normal_axis, angle):
    """Return a rotation that tilts the given axis by an angle in degrees."""
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    matrix = np.eye(3)
    i, j = normal_axis, (normal_axis + 1) % 3
    matrix[np.ix_([i, j], [i, j])] = [[c, -s], [s, c]]
    return matrix


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("angle", [0, 20, -40])
def test_plane_in_any_orientation(axis, angle):
    """The rotation is proper, its normal is the true one, and rotated points lie at height zero."""
    flat = RNG.uniform(-2.0, 3.0, (200, 3))
    flat[:, axis] = 0.0
    rotation = turned(axis, angle)
    points = flat @ rotation.T + [1e3, -5.0, 7.0]
    plane = fc.surfaces.fit_plane(points)
    matrix = plane.rotation_matrix.values
    np.testing.assert_allclose(matrix @ matrix.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(matrix) == pytest.approx(1.0)
    normal = rotation[:, axis]
    assert abs(matrix[2] @ normal) == pytest.approx(1.0, abs=1e-12)
    assert matrix[2, axis] > 0
    heights = (points - plane.centre.values) @ matrix[2]
    np.testing.assert_allclose(heights, 0.0, atol=1e-11)
    assert float(plane.rms_height) < 1e-11


def test_horizontal_cloud_keeps_its_axes():
    points = RNG.uniform(size=(100, 3)) * [1.0, 1.0, 0.0]
    np.testing.assert_allclose(fc.surfaces.fit_plane(points).rotation_matrix, np.eye(3), atol=1e-15)


def test_rms_distance_and_centre():
    """Heights of alternating sign about a plane have their amplitude as the root mean square."""
    x, y = np.meshgrid(np.arange(40.0), np.arange(30.0))
    z = 0.01 * (-1.0) ** (x + y)
    plane = fc.surfaces.fit_plane(np.stack([x, y, z], axis=-1).reshape(-1, 3), units="mm")
    assert float(plane.rms_height) == pytest.approx(1e-5, rel=1e-6)
    np.testing.assert_allclose(plane.centre, [19.5e-3, 14.5e-3, 0.0], atol=1e-15)
    assert int(plane.point_count) == 1200


def test_line_of_a_profile():
    x = np.linspace(0.0, 4.0, 50)
    plane = fc.surfaces.fit_plane(np.c_[x, 0.75 * x + 2.0])
    np.testing.assert_allclose(plane.rotation_matrix, [[0.8, 0.6], [-0.6, 0.8]], atol=1e-13)


def test_missing_rows_are_left_out():
    points = np.ma.masked_greater(RNG.uniform(size=(50, 3)) * [1.0, 1.0, 0.1], 0.95)
    complete = points[~points.mask.any(axis=1)].filled()
    again = fc.surfaces.fit_plane(points)
    np.testing.assert_array_equal(again.rotation_matrix, fc.surfaces.fit_plane(complete).rotation_matrix)


@pytest.mark.parametrize(
    ("points", "problem"),
    [
        ([[0.0, 0.0, 1.0]], "at least 4 points, got 1"),
        (np.full((6, 3), np.nan), "at least 4 points, got none"),
        (np.outer(np.arange(9.0), [1.0, 2.0, 3.0]), "span a plane"),
        (np.ones((7, 3)), "span a plane"),
        (RNG.normal(size=(300, 3)), "about a plane"),
        ([["a", "b", "c"]], "real numbers"),
        (np.ones((4, 5)), r"\(n, 3\)"),
        ([[0, 0, 1e200], [1, 0, 0], [0, 1, 0], [1, 1, 0]], "at most 1e"),
    ],
)
def test_points_without_a_plane_are_refused(points, problem):
    with pytest.raises(InvalidInput, match=problem):
        fc.surfaces.fit_plane(points)
