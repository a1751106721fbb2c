"""Friction angle and shear strength from the dilatancy, against closed forms."""

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc


def curve(shear, heights, **more):
    return xr.Dataset(
        {
            "rigid_dilatancy": (("direction", "shear"), np.atleast_2d(heights)),
            "basic_friction_angle": 35.0,
            **more,
        },
        coords={"shear": shear, "direction": ["E"]},
    )


def test_neighbour_slope_is_exact_for_a_parabola():
    shear = np.array([0.0, 1.0, 1.5, 4.0, 4.2])
    result = fc.joints.friction(curve(shear, 0.1 * shear**2))
    np.testing.assert_allclose(np.tan(np.radians(result.dilatancy_angle.values[0, 1:-1])), 0.2 * shear[1:-1])
    np.testing.assert_allclose(result.smoothing, [1.0, 1.5, 3.0, 2.7, 0.2])


def test_smoothing_below_the_spacing_takes_both_neighbours():
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


def test_faces_lock_at_ninety_degrees():
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


def test_invalid_arguments_are_refused():
    with pytest.raises(ValueError, match="Dataset of fractalcontact.joints.dilatancy"):
        fc.joints.friction(3)
    with pytest.raises(ValueError, match="at least two shears"):
        fc.joints.friction(curve([1.0], [1.0]))
    with pytest.raises(ValueError, match="smoothing"):
        fc.joints.friction(curve([1.0, 2.0], [1.0, 2.0]), smoothing=-1)
    with pytest.raises(ValueError, match="basic_friction_angle"):
        fc.joints.friction(curve([1.0, 2.0], [1.0, 2.0]), basic_friction_angle=91)


def test_strength_from_the_elastic_dilatancy(crack):
    shear = np.arange(0, 6) * 8e-5
    opening = fc.joints.dilatancy(crack, shear=shear, direction="E", normal_force=[100.0, 1e3])
    result = fc.joints.friction(opening, smoothing=1.6e-4)
    assert result.shear_strength.dims == ("direction", "shear", "step")
    phi = np.radians(result.friction_angle.values)
    expected = np.where(phi < np.pi / 2, opening.nominal_pressure.values * np.tan(phi), np.nan)
    np.testing.assert_allclose(result.shear_strength, expected)
    # a larger force lowers the dilatancy angle
    assert (result.friction_angle.isel(step=1) <= result.friction_angle.isel(step=0) + 1e-9).all()


def test_strength_of_rigid_faces_under_pressure(teeth):
    result = fc.joints.friction(teeth, nominal_pressure=[1e6, 3e6])
    assert result.shear_strength.dims == ("direction", "shear", "step")
    np.testing.assert_allclose(result.shear_strength.isel(step=1), 3e6 * np.tan(np.radians(40)))
