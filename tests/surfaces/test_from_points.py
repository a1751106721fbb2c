"""Points gridded as a surface: exact planes, gaps, lattices, meshes, profiles, and the dimension after it."""

import itertools
import json

import numpy as np
import pytest
from counting import at_least
from scipy.interpolate import LinearNDInterpolator

import fractalcontact as fc
from fractalcontact.base.errors import FractalContactWarning, InvalidInput

RNG = np.random.default_rng(5)


def provenance(surface):
    return json.loads(surface.attrs["provenance"])


def scattered(count=3000, side=1.0):
    return RNG.uniform(0.0, side, (count, 2))


def test_heights_are_linear_between_points():
    """The heights are those of SciPy's interpolation in the same triangulation."""
    flat = scattered(500)
    z = RNG.normal(size=500)
    surface = fc.surfaces.from_points(np.c_[flat, z], 0.02, plane="xy", largest_gap=10.0)
    cells = np.stack(np.meshgrid(surface.x, surface.y), axis=-1)
    expected = LinearNDInterpolator(flat, z)(cells)
    np.testing.assert_allclose(surface.values, expected, atol=1e-10)
    assert surface.sizes["x"] == 50
    assert np.isnan(expected).any()


@pytest.mark.parametrize("units", ["m", "mm", "um"])
def test_units_scale_lengths_and_heights(units):
    flat = scattered(400)
    points = np.c_[flat, 0.1 * np.sin(9.0 * flat[:, 0])]
    factor = {"m": 1.0, "mm": 1e-3, "um": 1e-6}[units]
    surface = fc.surfaces.from_points(points, units=units, plane="xy")
    metres = fc.surfaces.from_points(points, plane="xy")
    np.testing.assert_allclose(surface.values, factor * metres.values, rtol=1e-9)
    np.testing.assert_allclose(surface.x, factor * metres.x, rtol=1e-9)
    assert float(surface.finest_scale) == pytest.approx(factor * float(metres.finest_scale))


@pytest.mark.parametrize("normal", [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.3, -0.2, 0.9], [0.6, 0.8, 0.0]])
def test_plane_of_any_tilt_is_flat(normal):
    """Points of a plane have height zero whatever its tilt; a vertical one is no exception."""
    normal = np.array(normal) / np.linalg.norm(normal)
    axes = np.linalg.svd(normal[None])[2][1:]
    points = scattered(800) @ axes + [50.0, -20.0, 3.0]
    surface = fc.surfaces.from_points(points)
    assert float(np.nanmax(np.abs(surface))) < 1e-12
    rotation = np.array(provenance(surface)["rotation_matrix"])
    np.testing.assert_allclose(np.abs(rotation[2] @ normal), 1.0, atol=1e-12)


def test_bump_of_a_tilted_plane_keeps_its_height():
    """A paraboloid above a tilted plane has its height along the normal."""
    flat = scattered(20000) - 0.5
    local = np.c_[flat, 0.05 - 0.2 * (flat**2).sum(axis=1)]
    c, s = np.cos(0.5), np.sin(0.5)
    tilted = local @ np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])
    surface = fc.surfaces.from_points(tilted, 0.02)
    relief = float(surface.max() - surface.min())
    assert relief == pytest.approx(0.1, abs=0.006)  # the corners are not cells
    x, y = surface.x - surface.x.mean(), surface.y - surface.y.mean()
    curved = surface + 0.2 * (x**2 + y**2)
    assert float(curved.std()) < 2e-3


def test_second_face_in_the_plane_of_the_first():
    """Two faces of a joint in one plane keep their distance; each in its own does not."""
    flat = scattered(4000)
    lower = np.c_[flat, 0.2 * flat[:, 0]]
    upper = np.c_[scattered(4000), np.zeros(4000)]
    upper[:, 2] = 0.2 * upper[:, 0] + 0.03
    first = fc.surfaces.from_points(lower, 0.05)
    for frame in (first, fc.surfaces.fit_plane(lower)):
        second = fc.surfaces.from_points(upper, 0.05, plane=frame)
        gap = (second - first).values
        np.testing.assert_allclose(gap[np.isfinite(gap)], 0.03 / np.hypot(1.0, 0.2), atol=1e-12)
        assert np.isfinite(gap).mean() > 0.8


def test_cells_without_support_are_missing():
    """A hole in the cloud stays a hole, unless the largest gap is set to bridge it."""
    flat = scattered(4000)
    flat = flat[np.hypot(*(flat - 0.5).T) > 0.2]
    points = np.c_[flat, flat[:, 0]]
    surface = fc.surfaces.from_points(points, plane="xy")
    hole = np.hypot(surface.x - 0.5, surface.y - 0.5).transpose("y", "x")
    assert bool(surface.where(hole < 0.15).isnull().all())
    around = surface.where((hole > 0.25) & (hole < 0.45)).count() / ((hole > 0.25) & (hole < 0.45)).sum()
    assert float(around) > 0.99
    bridged = fc.surfaces.from_points(points, plane="xy", largest_gap=1.0)
    inside = np.hypot(bridged.x - 0.5, bridged.y - 0.5).transpose("y", "x") < 0.15
    assert not bool(bridged.where(inside, 0.0).isnull().any())
    assert provenance(surface)["missing_points"] == int(surface.isnull().sum())


def test_points_on_a_grid_are_not_interpolated():
    """Shuffled rows of a uniform grid give its heights bit for bit, without a finest scale."""
    y, x = np.meshgrid(np.arange(30) * 0.5, np.arange(40) * 0.25, indexing="ij")
    z = RNG.normal(size=x.shape)
    rows = RNG.permutation(np.c_[x.ravel(), y.ravel(), z.ravel()])
    surface = fc.surfaces.from_points(rows, units="mm")
    np.testing.assert_array_equal(surface.values, z / 1e3)
    np.testing.assert_allclose(surface.x, x[0] / 1e3)
    assert "finest_scale" not in surface.coords
    gaps = fc.surfaces.from_points(rows[: int(0.7 * len(rows))], units="mm")
    assert int(gaps.isnull().sum()) == len(rows) - int(0.7 * len(rows))


def test_rounded_positions_of_a_grid():
    """A step of a third, written with two decimals, is still a uniform grid."""
    y, x = np.meshgrid(np.arange(20) / 3.0, np.arange(25) / 3.0, indexing="ij")
    surface = fc.surfaces.from_points(np.c_[x.ravel().round(2), y.ravel().round(2), (x * y).ravel()])
    np.testing.assert_allclose(surface.values, x * y)


def test_duplicate_points_and_missing_rows():
    flat = scattered(600)
    points = np.c_[flat, flat[:, 1]]
    repeated = np.r_[points, points[:200], np.full((5, 3), np.nan)]
    surface = fc.surfaces.from_points(repeated, 0.05, plane="xy")
    np.testing.assert_allclose(surface, fc.surfaces.from_points(points, 0.05, plane="xy"), atol=1e-12)


def test_heights_at_one_position_are_averaged():
    """Two scans of the same positions have their mean, in whatever order they come."""
    flat = scattered(600)
    low, high = (np.c_[flat, flat[:, 1] + offset] for offset in (0.0, 0.5))
    expected = fc.surfaces.from_points(low, 0.05, plane="xy").values + 0.25
    for repeated in (np.r_[low, high], np.r_[high, low]):
        surface = fc.surfaces.from_points(repeated, 0.05, plane="xy")
        np.testing.assert_allclose(surface.values, expected, atol=1e-12)


def test_positions_that_lost_their_digits_warn():
    """In 32-bit numbers, positions 5e5 m from the origin are multiples of 31 mm."""
    points = np.c_[scattered(4000), 1e-3 * np.sin(np.arange(4000))]
    far = (points + np.array([5e5, 5e5, 0.0])).astype(np.float32)
    with pytest.warns(FractalContactWarning, match="points are at .* positions of a grid"):
        fc.surfaces.from_points(far)
    exact = fc.surfaces.from_points(points + np.array([5e5, 5e5, 0.0]))  # no warning
    assert float(exact.x[1] - exact.x[0]) < 0.02
    nodes = np.c_[np.indices((5, 6)).reshape(2, -1).T, np.arange(30.0)]
    fc.surfaces.from_points(np.repeat(nodes, 6, axis=0))  # the corners of a mesh: no warning


def test_mesh_uses_its_own_triangles():
    """A roof of two rectangles has its ridge, which the triangulation of the corners would not find."""
    points = [[0, 0, 0], [4, 0, 0], [0, 2, 1], [4, 2, 1], [0, 4, 0], [4, 4, 0]]
    triangles = [[0, 1, 3], [0, 3, 2], [2, 3, 5], [2, 5, 4]]
    surface = fc.surfaces.from_points(points, 0.25, triangles=triangles, plane="xy")
    roof = 1.0 - np.abs(surface.y - 2.0) / 2.0
    np.testing.assert_allclose(surface, np.broadcast_to(roof.values[:, None], surface.shape), atol=1e-12)
    # without one of its triangles the mesh has a hole
    open_roof = fc.surfaces.from_points(points, 0.25, triangles=triangles[:3], plane="xy")
    assert 0.2 < float(open_roof.isnull().mean()) < 0.3


def test_overhang_of_a_mesh_is_reported():
    """Of a folded sheet the top is taken, and the share of area that faces down is stated."""
    points = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 0, 0.5], [1, 2, 0.5]]
    folded = [[0, 1, 2], [0, 2, 3], [2, 1, 4], [2, 4, 5]]  # the last two return above the first
    surface = fc.surfaces.from_points(points, 0.25, triangles=folded, plane="xy")
    assert provenance(surface)["overhang_share"] == pytest.approx(1 / 3)
    beyond = surface.where(surface.x > 1.0, drop=True)
    np.testing.assert_allclose(beyond, np.broadcast_to((2.0 - beyond.x) / 2.0, beyond.shape), atol=1e-12)


def test_profile_as_measured_and_interpolated():
    """Uniform positions are taken as they are; others are interpolated, long gaps left open."""
    x = np.arange(200) * 1e-3
    z = np.sin(40.0 * x)
    order = RNG.permutation(200)
    surface = fc.surfaces.from_points(np.c_[x, z][order])
    assert surface.dims == ("x",)
    np.testing.assert_array_equal(surface.values, z)
    uneven = np.sort(RNG.uniform(0.0, 0.2, 400))
    uneven = uneven[(uneven < 0.1) | (uneven > 0.12)]
    surface = fc.surfaces.from_points(np.c_[uneven, np.sin(40.0 * uneven)], plane="xy")
    inside = (surface.x > 0.102) & (surface.x < 0.118)
    assert bool(surface.where(inside, drop=True).isnull().all())
    error = (surface - np.sin(40.0 * surface.x)).where(~inside)
    assert float(np.nanmax(np.abs(error))) < 1e-2
    assert float(surface.finest_scale) > 8 * 0.5e-3


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        ({"spacing": 1e-4}, "at least .* a tenth of the distance"),
        ({"spacing": 1.9}, "less than half of the extent"),
        ({"spacing": -1.0}, "spacing"),
        ({"largest_gap": 1e-9}, "largest_gap"),
        ({"plane": "up"}, "plane"),
        ({"plane": fc.surfaces.from_array(np.eye(4), 1.0)}, "plane"),
        ({"units": "ell"}, "units"),
        ({"triangles": [[0, 1]]}, "triangles"),
        ({"triangles": [[0, 1, 400]]}, "from 0 to 399"),
    ],
)
def test_wrong_options(options, problem):
    points = np.c_[scattered(400), np.zeros(400)]
    with pytest.raises(InvalidInput, match=problem):
        fc.surfaces.from_points(points, **options)


def measured_points(arrangement, hurst, seed, points=96, lattice=4):
    """Return points of an exact fractional Brownian surface, at nodes of a lattice four times as fine."""
    n = points * lattice
    heights = fc.surfaces.fbm((n, n), 1e-4, hurst=hurst, rms_increment=3e-5, rng=seed).values
    rng = np.random.default_rng(seed)
    if arrangement == "jittered":
        row, column = np.meshgrid(np.arange(points) * lattice, np.arange(points) * lattice, indexing="ij")
        row, column = (index + rng.integers(0, lattice, index.shape) for index in (row, column))
    else:
        row, column = np.unravel_index(rng.choice(n * n, points**2, replace=False), (n, n))
    row, column = row.ravel(), column.ravel()
    if arrangement == "gap":
        keep = np.hypot(row - 0.4 * n, column - 0.6 * n) > 0.1 * n
        row, column = row[keep], column[keep]
    return np.c_[column * 1e-4, row * 1e-4, heights[row, column]]


ARRANGED = list(itertools.product(["jittered", "random", "gap"], [0.3, 0.5, 0.7, 0.9]))


@pytest.mark.parametrize(
    ("arrangement", "hurst"),
    # each arrangement and each exponent at least once
    [
        pytest.param(*case, marks=[] if n in (0, 5, 7, 10) else pytest.mark.slow)
        for n, case in enumerate(ARRANGED)
    ],
)
def test_interval_of_gridded_points_holds_the_truth(arrangement, hurst):
    """Whatever the spacing of the cells, the interval holds the exponent that the points have."""

    def holds(seed, factor):
        points = measured_points(arrangement, hurst, seed)
        surface = fc.surfaces.from_points(points, factor * 4e-4, plane="xy")
        result = fc.dimensions.estimate(surface).isel(method=0)
        assert float(result.scale_min) >= 0.99 * float(surface.finest_scale)
        assert float(result.ci_high - result.ci_low) < 0.8
        return result.ci_low <= hurst <= result.ci_high

    # of intervals of 95 %; each factor at least once
    assert at_least(3, (holds(*case) for case in ((1, 1.0), (3, 0.5), (4, 2.5), (2, 1.0))))


@pytest.mark.parametrize("seed", [3, 8])
def test_a_hole_changes_the_exponent_little(seed):
    """A hole of 3 % of the area takes few waves away, and its filling adds none; steps lowered H by 0.23."""
    whole, holed = (
        fc.dimensions.estimate(fc.surfaces.from_points(measured_points(kind, 0.9, seed), plane="xy"))
        for kind in ("random", "gap")
    )
    assert float(abs(whole.hurst - holed.hurst)[0]) < 0.08


def test_without_the_finest_scale_the_dimension_is_wrong():
    """Gridding at half the distance of the points makes a smooth surface: the reason for the window."""
    surface = fc.surfaces.from_points(measured_points("random", 0.7, 1), 2e-4, plane="xy")
    result = fc.dimensions.estimate(surface.drop_vars("finest_scale"), "increments")
    assert float(result.fractal_dimension[0]) < 2.1
    resolved = fc.dimensions.estimate(surface, ["likelihood", "increments", "variogram"])
    np.testing.assert_array_less(2.1, resolved.fractal_dimension)
    np.testing.assert_array_less(0.99 * float(surface.finest_scale), resolved.scale_min)


def test_directions_of_a_fine_grid_are_those_of_its_points():
    """Few waves of an isotropic cloud are resolved by its points; those of the gridding do not count."""
    surface = fc.surfaces.from_points(measured_points("random", 0.5, 5), 2e-4, plane="xy")
    resolved = fc.dimensions.directions(surface)
    every = fc.dimensions.directions(surface.drop_vars("finest_scale"))
    for result in (resolved, every):
        assert float(result["isotropy_p_value"]) > 0.01
    assert ((resolved["ci_low"] < 0.5) & (resolved["ci_high"] > 0.5)).all()
    assert (resolved["ci_high"] - resolved["ci_low"]).min() > 0.5
    assert np.isnan(every["ci_low"]).all()
    assert "on lines between" in every["ci_low"].attrs["reason"]


@pytest.mark.parametrize(
    ("hurst", "seeds"),
    [(0.7, 3), pytest.param(0.7, 16, marks=pytest.mark.slow), pytest.param(0.3, 16, marks=pytest.mark.slow)],
)
def test_interval_of_a_gridded_profile(hurst, seeds):

    def holds(seed):
        profile = fc.surfaces.fbm(2048, 1e-5, hurst=hurst, rms_increment=3e-6, rng=seed)
        chosen = np.sort(np.random.default_rng(seed).choice(2048, 512, replace=False))
        points = np.c_[profile.x.values[chosen], profile.values[chosen]]
        gridded = fc.surfaces.from_points(points, plane="xy")
        result = fc.dimensions.estimate(gridded).isel(method=0)
        return result.ci_low <= hurst <= result.ci_high

    # of intervals of 95 %
    assert at_least(seeds - 1 - seeds // 16, map(holds, range(100, 100 + seeds)))


def test_scales_asked_for_below_the_resolved_ones_widen_the_interval():
    surface = fc.surfaces.from_points(measured_points("random", 0.5, 1), 4e-4, plane="xy")
    fine = fc.dimensions.estimate(surface, scales=(float(surface.finest_scale) / 3.0, 1.0)).isel(method=0)
    assert float(fine.ci_low) <= 0.5 <= float(fine.ci_high)
    assert "gridded from points" in str(fine.note.values)


@pytest.mark.parametrize("tilt", [0.0, 0.2])
def test_second_face_on_the_cells_of_the_first(tilt):
    """Without a spacing, a surface given as the plane gives its cells too, also after filling."""
    lower = np.c_[scattered(4000), np.zeros(4000)]
    upper = np.c_[scattered(5000, 1.3) - 0.1, np.zeros(5000)]
    for points, height in ((lower, 0.0), (upper, 0.03)):
        points[:, 2] = tilt * points[:, 0] + height
    first = fc.surfaces.fill(fc.surfaces.from_points(lower, 0.05, plane="fit" if tilt else "xy"))
    second = fc.surfaces.from_points(upper, plane=first)
    np.testing.assert_array_equal(second.x, first.x)
    np.testing.assert_array_equal(second.y, first.y)
    np.testing.assert_allclose(second - first, 0.03 / np.hypot(1.0, tilt), atol=1e-12)


def test_second_lattice_on_the_cells_of_the_first():
    """Points on a uniform grid stay as they are; cells beyond them are missing."""
    y, x = np.meshgrid(np.arange(30.0), np.arange(40.0), indexing="ij")
    z = RNG.normal(size=x.shape)
    first = fc.surfaces.from_points(np.c_[x.ravel(), y.ravel(), z.ravel()])
    part = (x >= 5) & (y <= 20)
    second = fc.surfaces.from_points(np.c_[x[part], y[part], 1.0 + z[part]], plane=first)
    np.testing.assert_array_equal(second.where(part, 0.0), np.where(part, 1.0 + z, 0.0))
    assert int(second.isnull().sum()) == int((~part).sum())
    assert "finest_scale" not in second.coords


def test_second_profile_on_the_positions_of_the_first():
    x = np.sort(np.random.default_rng(2).uniform(0.0, 0.2, 400))
    first = fc.surfaces.from_points(np.c_[x, np.sin(40.0 * x)], plane="xy")
    second = fc.surfaces.from_points(np.c_[x[100:], 1.0 + np.sin(40.0 * x[100:])], plane=first)
    np.testing.assert_array_equal(second.x, first.x)
    inside = (first.x > x[100]).values
    difference = (second - first).values
    same = np.isfinite(difference)
    np.testing.assert_allclose(difference[same], 1.0, atol=1e-12)
    assert same.sum() > 0.6 * first.size
    assert np.isnan(second.values[~inside]).all()
