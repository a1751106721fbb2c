"""Rigid dilatancy and friction against closed forms."""

import numpy as np
import pytest

import fractalcontact as fc

MATERIAL = {"young": 30e9, "poisson": 0.2}


def slow_rigid(lower, upper, crack, shift):
    (ay, ax), (by, bx) = crack.layout.start, crack.layout.cells
    highest = -np.inf
    for i in range(ay, ay + by):
        for j in range(ax, ax + bx):
            highest = max(highest, lower[i + shift[0], j + shift[1]] - upper[i, j])
    return highest


def test_against_the_slow_maximum(make_face, rough):
    lower, upper = rough((30, 26), 0), rough((30, 26), 1)
    crack = fc.joints.Crack(make_face(lower), make_face(upper), block=12, **MATERIAL)
    result = fc.joints.dilatancy(crack, shear=[0, 1, 4])
    initial = slow_rigid(lower, upper, crack, (0, 0))
    assert result.initial_offset == initial
    for direction, step in {"E": (0, 1), "N": (1, 0), "W": (0, -1), "S": (-1, 0)}.items():
        for v in (0, 1, 4):
            expected = slow_rigid(lower, upper, crack, (v * step[0], v * step[1])) - initial
            assert result.rigid_dilatancy.sel(direction=direction, shear=v) == expected
    assert list(result.azimuth.values) == [0, 90, 180, 270]


@pytest.mark.parametrize("angle", [5.0, 15.0, 40.0])
def test_sawtooth_climbs_its_own_slope_up_to_half_a_wave(make_face, angle):
    s, period = 1e-3, 20
    x = np.arange(200)
    tooth = np.abs((x + period / 2) % period - period / 2) * s * np.tan(np.radians(angle))
    face = make_face(np.broadcast_to(tooth, (6, 200)), s)
    crack = fc.joints.Crack(face, block=(6e-3, 0.1), basic_friction_angle=30, **MATERIAL)
    shear = np.arange(period + 1) * s
    result = fc.joints.dilatancy(crack, shear=shear, direction=("E", "W"))
    climb = np.minimum(shear, period * s - shear) * np.tan(np.radians(angle))
    np.testing.assert_allclose(result.rigid_dilatancy, np.stack([climb, climb]), atol=1e-15)
    rising = fc.joints.friction(fc.joints.dilatancy(crack, shear=shear[: period // 2 + 1], direction="E"))
    np.testing.assert_allclose(rising.dilatancy_angle, angle, rtol=1e-12)
    np.testing.assert_allclose(rising.friction_angle, 30 + angle, rtol=1e-12)
    assert rising.peak_friction_angle.item() == pytest.approx(30 + angle)


@pytest.mark.parametrize("periodic", [True, False])
def test_sinusoid_up_to_the_sampling_of_its_crest(make_face, periodic):
    n, waves, amplitude = 240, 6, 0.7
    k = 2 * np.pi * waves / n
    face = make_face(np.broadcast_to(amplitude * np.cos(k * np.arange(n)), (4, n)), periodic=periodic)
    crack = fc.joints.Crack(face, block=None if periodic else (4, 160), **MATERIAL)
    shear = np.arange(0, 40 + (periodic * 100))
    got = fc.joints.dilatancy(crack, shear=shear, direction="E").rigid_dilatancy.values[0]
    exact = 2 * amplitude * np.abs(np.sin(k * shear / 2))
    assert (got <= exact + 1e-14).all()
    assert (got >= exact * (1 - k**2 / 8) - 1e-14).all()


def test_plane_adds_its_slope(make_face, rough):
    heights = rough((40, 40), 2)
    y, x = np.mgrid[:40, :40] * 0.5
    shear = [0.0, 1.0, 2.25, 4.5]
    plain = fc.joints.dilatancy(fc.joints.Crack(make_face(heights, 0.5), block=10, **MATERIAL), shear=shear)
    face = make_face(heights + 0.3 * x - 0.1 * y + 1e3, 0.5)
    tilted = fc.joints.dilatancy(fc.joints.Crack(face, block=10, **MATERIAL), shear=shear)
    more = tilted.rigid_dilatancy - plain.rigid_dilatancy
    for direction, slope in {"E": 0.3, "W": -0.3, "N": -0.1, "S": 0.1}.items():
        np.testing.assert_allclose(more.sel(direction=direction), slope * np.array(shear), atol=1e-12)
        added = tilted.mean_slope.sel(direction=direction) - plain.mean_slope.sel(direction=direction)
        assert added == pytest.approx(slope, abs=1e-12)
    np.testing.assert_allclose(tilted.plateau_dilatancy, plain.plateau_dilatancy, atol=1e-11)


def test_mean_slope_is_the_least_squares_plane_with_gaps(make_face, rough):
    heights = rough((24, 30), 3)
    heights[:4, :5] = np.nan
    face = make_face(heights, (2.0, 0.5))
    result = fc.joints.dilatancy(fc.joints.Crack(face, block=(20, 5), **MATERIAL), shear=0.0)
    y, x = np.meshgrid(face.y, face.x, indexing="ij")
    seen = np.isfinite(heights)
    design = np.stack([np.ones(seen.sum()), y[seen], x[seen]], axis=1)
    slopes = np.linalg.lstsq(design, heights[seen], rcond=None)[0][1:]
    np.testing.assert_allclose(result.mean_slope, [slopes[1], slopes[0], -slopes[1], -slopes[0]], rtol=1e-10)


def test_periodic_face_never_sinks_and_has_no_mean_slope(make_face, rough):
    crack = fc.joints.Crack(make_face(rough((32, 32), 4), periodic=True), **MATERIAL)
    result = fc.joints.dilatancy(crack, shear=np.arange(0, 32, 2.5), direction=(0, 33, "S"))
    assert (result.rigid_dilatancy >= 0).all()
    assert (result.mean_slope == 0).all()
    assert list(result.direction.values) == ["E", "33", "S"]


def test_zero_shear_is_exactly_zero_and_labels_are_complete(make_face, rough):
    crack = fc.joints.Crack(make_face(rough((16, 16), 5)), block=8, basic_friction_angle=31, **MATERIAL)
    result = fc.joints.dilatancy(crack, shear=[0, 1], direction="E")
    assert (result.rigid_dilatancy.sel(shear=0) == 0).all()
    assert result.basic_friction_angle == 31
    assert result.nominal_area == 64
    for variable in result.variables.values():
        assert variable.attrs["long_name"]
    assert result.rigid_dilatancy.attrs["units"] == "m"
    assert result.azimuth.attrs["units"] == "degree"
    assert "normal_force" not in result


def test_missing_heights_in_the_path_are_named(make_face, rough):
    heights = rough((30, 30), 5)
    heights[15, 24] = np.nan
    crack = fc.joints.Crack(make_face(heights), block=10, **MATERIAL)
    fc.joints.dilatancy(crack, shear=[0, 4.0], direction=("E", "N"))
    with pytest.raises(ValueError, match=r"1 missing at a shear of 5 m towards E"):
        fc.joints.dilatancy(crack, shear=[0, 4.0, 5.0], direction="E")


def test_power_of_two_units_change_only_exponents(make_face, rough):
    heights = rough((20, 22), 7)
    one = fc.joints.Crack(make_face(heights), block=10.0, **MATERIAL)
    two = fc.joints.Crack(make_face(heights * 2.0**40, 2.0**-20), block=10 * 2.0**-20, **MATERIAL)
    a = fc.joints.dilatancy(one, shear=[0, 1, 2.5])
    b = fc.joints.dilatancy(two, shear=np.array([0, 1, 2.5]) * 2.0**-20)
    np.testing.assert_array_equal(a.rigid_dilatancy * 2.0**40, b.rigid_dilatancy.values)
    np.testing.assert_array_equal(a.plateau_dilatancy * 2.0**40, b.plateau_dilatancy.values)


# friction


def curve(shear, heights, **more):
    import xarray as xr

    return xr.Dataset(
        {
            "rigid_dilatancy": (("direction", "shear"), np.atleast_2d(heights)),
            "basic_friction_angle": 35.0,
            **more,
        },
        coords={"shear": shear, "direction": ["E"]},
    )


def test_slope_through_the_neighbours_is_exact_for_a_parabola_on_unequal_steps():
    shear = np.array([0.0, 1.0, 1.5, 4.0, 4.2])
    result = fc.joints.friction(curve(shear, 0.1 * shear**2))
    np.testing.assert_allclose(np.tan(np.radians(result.dilatancy_angle.values[0, 1:-1])), 0.2 * shear[1:-1])
    np.testing.assert_allclose(result.smoothing, [1.0, 1.5, 3.0, 2.7, 0.2])


def test_smoothing_below_the_spacing_takes_both_neighbours_whatever_the_rounding():
    shear = np.arange(20) * 1e-4
    heights = 1e-4 * np.sin(3e3 * shear)
    fine = fc.joints.friction(curve(shear, heights), smoothing=1e-9, basic_friction_angle=20)
    plain = fc.joints.friction(curve(shear, heights), basic_friction_angle=20)
    np.testing.assert_allclose(fine.dilatancy_angle, plain.dilatancy_angle, rtol=1e-9)


def test_smoothing_fits_a_line_in_the_window():
    rng = np.random.default_rng(0)
    shear = np.sort(rng.random(30))
    heights = rng.random(30)
    result = fc.joints.friction(curve(shear, heights), smoothing=0.3, basic_friction_angle=20)
    for index, v in enumerate(shear):
        inside = np.abs(shear - v) <= 0.15
        if inside.sum() > 1:
            slope = np.polyfit(shear[inside], heights[inside], 1)[0]
            assert np.tan(np.radians(result.dilatancy_angle[0, index])) == pytest.approx(slope, rel=1e-6)
    np.testing.assert_allclose(result.friction_angle, 20 + result.dilatancy_angle)


def test_strength_needs_a_pressure_and_locks_at_ninety_degrees():
    import xarray as xr

    shear = np.array([0.0, 1.0, 2.0])
    forced = xr.Dataset(
        {
            "dilatancy": (("direction", "shear", "step"), np.array([[[0, 0], [0.1, 3.0], [0.2, 6.0]]])),
            "nominal_pressure": ("step", [1e6, 2e6]),
            "basic_friction_angle": 35.0,
        },
        coords={"shear": shear, "direction": ["E"]},
    )
    result = fc.joints.friction(forced)
    expected = 1e6 * np.tan(np.radians(35) + np.arctan(0.1))
    np.testing.assert_allclose(result.shear_strength.isel(step=0), expected)
    assert np.isnan(result.shear_strength.isel(step=1)).all()
    np.testing.assert_allclose(result.friction_angle.isel(step=1), 35 + np.degrees(np.arctan(3.0)))
    assert "locked" in result.shear_strength.attrs["reason"]
    assert result.peak_shear_strength.dims == ("direction", "step")
    assert result.shear_strength.attrs["units"] == "Pa"


def test_sum_of_angles_gives_the_friction_coefficient():
    # a block with a basic angle of 30 degrees on a slope of 15 degrees: coefficient 1
    shear = np.array([0.0, 1.0])
    result = fc.joints.friction(curve(shear, shear * np.tan(np.radians(15))), basic_friction_angle=30)
    np.testing.assert_allclose(np.tan(np.radians(result.friction_angle)), 1.0, rtol=1e-14)


def test_friction_says_what_is_wrong():
    with pytest.raises(ValueError, match="Dataset of fractalcontact.joints.dilatancy"):
        fc.joints.friction(3)
    with pytest.raises(ValueError, match="at least two shears"):
        fc.joints.friction(curve([1.0], [1.0]))
    with pytest.raises(ValueError, match="smoothing"):
        fc.joints.friction(curve([1.0, 2.0], [1.0, 2.0]), smoothing=-1)
    with pytest.raises(ValueError, match="basic_friction_angle"):
        fc.joints.friction(curve([1.0, 2.0], [1.0, 2.0]), basic_friction_angle=91)
