"""Filling of gaps: planes are exact, bending energy is least, periodic edges are continued."""

import json

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput


def rough(shape=(40, 50), spacing=(1e-3, 2e-3), seed=3, **options):
    return fc.surfaces.fbm(shape, spacing, hurst=0.7, rms_increment=1e-5, rng=seed, **options)


def with_gaps(surface, fraction=0.1, seed=0):
    missing = np.random.default_rng(seed).random(surface.shape) < fraction
    return surface.where(~missing)


def _metres(array):
    array.attrs = {"units": "m"}
    return array


def test_observed_points_are_kept_and_filled_ones_counted():
    surface = with_gaps(rough())
    filled = fc.surfaces.fill(surface)
    observed = surface.notnull().values
    np.testing.assert_array_equal(filled.values[observed], surface.values[observed])
    assert not filled.isnull().any()
    assert int(filled.filled_points) == np.count_nonzero(~observed)
    assert json.loads(filled.attrs["provenance"])["filled_points"] == np.count_nonzero(~observed)
    assert filled.filled_points.attrs["units"] == "1"


def test_plane_is_continued_exactly():
    zero = rough() * 0.0
    plane = _metres(zero + 3.0 * zero.x - 7.0 * zero.y)
    holed = plane.copy(deep=True)
    holed.values[10:22, 5:20] = np.nan
    holed.values[30, 30] = np.nan
    np.testing.assert_allclose(fc.surfaces.fill(holed).values, plane.values, atol=1e-13)


def test_large_gap_in_a_plane_is_filled_to_rounding():
    zero = fc.surfaces.from_array(np.zeros((170, 170)), 1.0)
    plane = _metres(zero + 3.0 * zero.x - 7.0 * zero.y)
    holed = plane.copy(deep=True)
    holed.values[10:160, 10:160] = np.nan
    np.testing.assert_allclose(fc.surfaces.fill(holed, at_most=0.8).values, plane.values, atol=1e-10)


def bending_energy(heights):
    along = np.diff(heights, 2, axis=1) / 0.25
    across = np.diff(heights, 2, axis=0)
    mixed = np.diff(np.diff(heights, axis=0), axis=1) / 0.5
    return np.sum(along**2) + np.sum(across**2) + 2 * np.sum(mixed**2)


def slope_energy(heights):
    return np.sum(np.diff(heights, axis=1) ** 2) / 0.25 + np.sum(np.diff(heights, axis=0) ** 2)


def is_least(energy, filled, place):
    moves = [np.zeros_like(filled) for _ in range(2)]
    moves[0][place], moves[1][place] = -1e-7, 1e-7
    return all(energy(filled + move) > energy(filled) for move in moves)


def test_bending_energy_is_minimal_or_slopes_are():
    # with every difference written out, and every filled point moved up and down
    surface = with_gaps(rough((7, 8), (1.0, 0.5)), 0.2, seed=2)
    filled = fc.surfaces.fill(surface).values
    places = [tuple(place) for place in np.argwhere(np.isnan(surface.values))]
    bending = [is_least(bending_energy, filled, place) for place in places]
    slopes = [is_least(slope_energy, filled, place) for place in places]
    assert all(one or other for one, other in zip(bending, slopes, strict=True))
    assert sum(bending) > len(places) / 2


def rims(surface, wraps):
    """Lowest and highest observed height beside the gap of each missing point, by a search of its own."""
    missing = np.isnan(surface.values)
    shape, low, high = surface.shape, np.zeros(surface.shape), np.zeros(surface.shape)
    for start in map(tuple, np.argwhere(missing)):
        found, waiting, rim = {start}, [start], []
        while waiting:
            y, x = waiting.pop()
            for dy, dx in np.ndindex(3, 3):
                place = (y + dy - 1, x + dx - 1)
                if wraps:
                    place = (place[0] % shape[0], place[1] % shape[1])
                if not (0 <= place[0] < shape[0] and 0 <= place[1] < shape[1]) or place in found:
                    continue
                found.add(place)
                waiting.append(place) if missing[place] else rim.append(surface.values[place])
        low[start], high[start] = min(rim), max(rim)
    return low, high


@pytest.mark.parametrize("periodic", [False, True])
@pytest.mark.parametrize(("fraction", "patch"), [(0.1, 1), (0.3, 1), (0.08, 4)])
def test_no_filled_height_exceeds_its_rim(fraction, patch, periodic):
    make = fc.surfaces.fbm if not periodic else fc.surfaces.spectral
    size = {"rms_height": 1e-5} if periodic else {"rms_increment": 1e-5}
    surface = make((32, 36), 1e-3, hurst=0.7, rng=3, **size) + 1.0
    small = np.random.default_rng(5).random((32 // patch, 36 // patch)) < fraction
    holed = surface.where(~np.kron(small, np.ones((patch, patch), bool)))
    holed.values[0, :5] = holed.values[-3:, -2:] = np.nan
    filled, missing = fc.surfaces.fill(holed, at_most=0.5).values, np.isnan(holed.values)
    low, high = rims(holed, periodic)
    assert (filled[missing] >= low[missing]).all()
    assert (filled[missing] <= high[missing]).all()


def test_periodic_surface_is_continued_across_its_edge():
    surface = fc.surfaces.spectral((32, 32), 1.0, hurst=0.8, rms_height=1.0, short_cutoff=8.0, rng=2)
    holed = surface.copy(deep=True)
    holed.values[12:16, :2] = np.nan
    holed.values[12:16, -2:] = np.nan
    rolled = holed.roll(x=16, roll_coords=False)
    np.testing.assert_allclose(
        fc.surfaces.fill(holed).roll(x=16, roll_coords=False).values,
        fc.surfaces.fill(rolled).values,
        atol=1e-12,
    )
    assert np.abs(fc.surfaces.fill(holed).values - surface.values).max() < 0.15


def test_error_is_below_one_increment():
    surface = fc.surfaces.level(rough((64, 64), 1e-3))
    filled = fc.surfaces.fill(with_gaps(surface))
    wrong = filled.values - surface.values
    wrong = wrong[wrong != 0]
    assert np.sqrt(np.mean(wrong**2)) < 1e-5  # less than one increment
    assert float(surface.std()) > 3e-5


def test_complete_surface_is_unchanged():
    surface = rough()
    filled = fc.surfaces.fill(surface)
    np.testing.assert_array_equal(filled.values, surface.values)
    assert int(filled.filled_points) == 0


def test_members_and_profile():
    stack = with_gaps(rough(members=2))
    filled = fc.surfaces.fill(stack)
    assert filled.filled_points.dims == ("member",)
    np.testing.assert_array_equal(filled.values[1], fc.surfaces.fill(stack.isel(member=1, drop=True)).values)
    profile = fc.surfaces.from_array([0.0, 1.0, np.nan, 3.0, np.nan], 1.0)
    np.testing.assert_allclose(
        fc.surfaces.fill(profile, at_most=0.5).values, [0, 1, 13 / 6, 3, 3], atol=1e-14
    )


@pytest.mark.parametrize(
    ("heights", "at_most", "problem"),
    [
        (np.full((4, 4), np.nan), 1.0, "span a plane"),
        (np.where(np.arange(16).reshape(4, 4) < 8, np.nan, 1.0), 0.25, "at most 25 %"),
        (np.where(np.arange(16).reshape(4, 4) < 12, np.nan, 1.0), 1.0, "span a plane"),
        (np.array([[0.0, np.nan, np.inf]] * 3), 1.0, "infinite"),
    ],
)
def test_gaps_that_cannot_be_filled_are_refused(heights, at_most, problem):
    surface = fc.surfaces.from_array(np.zeros(heights.shape), 1.0).copy(data=heights)
    with pytest.raises(InvalidInput, match=problem):
        fc.surfaces.fill(surface, at_most=at_most)


def test_units_by_powers_of_two_change_no_bit():
    surface = with_gaps(rough())
    scaled = surface.copy(data=surface.values * 2.0**60).assign_coords(
        x=surface.x.values * 2.0**-20, y=surface.y.values * 2.0**-20
    )
    np.testing.assert_array_equal(fc.surfaces.fill(scaled).values, fc.surfaces.fill(surface).values * 2.0**60)
