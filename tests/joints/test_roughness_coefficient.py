"""Joint roughness coefficient of profiles of known slope."""

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc

S = 0.508e-3  # the lag of the regression of Tse and Cruden


def alternating(slope, n=60):
    """Heights of a profile whose readings rise and fall by `slope` times their distance S in turn."""
    return slope * S * (np.arange(n) % 2)


def profile(heights, spacing):
    x = xr.DataArray((np.arange(len(heights)) + 0.5) * spacing, dims="x", attrs={"units": "m"})
    return xr.DataArray(heights, dims="x", coords={"x": x}, attrs={"units": "m"})


@pytest.mark.parametrize(("direction", "share"), [("E", 1.0), ("W", 1.0), ("NE", 0.5)])
def test_slope_of_a_sawtooth(make_face, direction, share):
    tooth = 0.25 * S * np.abs((np.arange(60) + 10) % 20 - 10)
    face = make_face(np.broadcast_to(tooth, (60, 60)), S)
    result = fc.joints.roughness_coefficient(face, direction=direction)
    z2 = 0.25 * (1.0 if share == 1.0 else np.sqrt(0.5))
    assert result.profile_slope.item() == pytest.approx(z2, rel=0.02)
    expected = 32.2 + 32.47 * np.log10(result.profile_slope.item())
    assert result.roughness_coefficient.item() == pytest.approx(expected, rel=1e-12)
    flat = fc.joints.roughness_coefficient(face, direction="N")
    assert flat.profile_slope < 1e-12
    assert flat.scale_position == -1
    assert 1e3 * result.lag.item() == pytest.approx(0.508 if share == 1.0 else 0.7184, rel=1e-3)


# values of the published regressions at Z2 = 0.1, 0.2, 0.3 and 0.4, computed by hand
@pytest.mark.parametrize(
    ("regression", "lag", "expected"),
    [
        ("tse_cruden", None, [-0.27, 9.50, 15.22, 19.28]),
        ("yu_vayssade", 0.25e-3, [1.52, 7.55, 13.59, 19.62]),
        ("yu_vayssade", None, [2.71, 8.89, 15.07, 21.25]),
        ("yu_vayssade", 1e-3, [4.11, 10.53, 16.96, 23.38]),
        ("tatone_grasselli", None, [2.65, 9.37, 14.81, 19.55]),
        ("tatone_grasselli", 1e-3, [3.91, 10.62, 16.48, 21.83]),
    ],
)
def test_regressions_at_their_own_intervals(make_face, regression, lag, expected):
    interval = lag or (0.508e-3 if regression == "tse_cruden" else 0.5e-3)
    coefficients = []
    for slope in (0.1, 0.2, 0.3, 0.4):
        heights = slope * interval * (np.arange(50) % 2) * np.ones((4, 1))
        face = make_face(heights, interval)
        result = fc.joints.roughness_coefficient(face, direction="E", regression=regression, lag=lag)
        assert result.regression_interval.item() == pytest.approx(interval)
        coefficients.append(result.roughness_coefficient.item())
    # the mean line of an even number of readings has a slope of 3 / (n^2 - 1) of the teeth
    np.testing.assert_allclose(coefficients, expected, atol=0.03)


def test_default_lag_is_the_sampling_interval_of_the_joint():
    # on a self-affine surface Z2 ~ lag^(H - 1): 1.27 mm instead of 0.508 mm would lower JRC by
    # 32.47 (1 - H) log10 2.5 = 3.9
    surface = fc.surfaces.fbm((512, 512), 0.127e-3, hurst=0.7, rms_increment=0.04e-3, rng=3)
    right = fc.joints.roughness_coefficient(surface)
    enlarged = fc.joints.roughness_coefficient(surface, lag=1.27e-3)
    np.testing.assert_allclose(right.lag, 0.508e-3)
    change = right.roughness_coefficient - enlarged.roughness_coefficient
    np.testing.assert_allclose(change, 32.47 * 0.3 * np.log10(2.5), atol=0.35)
    assert "sampling interval" in enlarged.roughness_coefficient.attrs["comment"]
    assert "comment" not in right.roughness_coefficient.attrs


def test_a_profile_is_a_surface_of_one_row(rough):
    heights = 1e-4 * rough((64, 256), 2)[7]
    single = fc.joints.roughness_coefficient(profile(heights, 1e-4))
    z2 = np.sqrt(np.mean((heights[5:] - heights[:-5]) ** 2)) / 5e-4
    assert single.direction.values.tolist() == ["E"]
    assert single.profile_slope.item() == pytest.approx(z2, rel=0.02)
    tilted = fc.joints.roughness_coefficient(profile(heights + 0.3 * 1e-4 * np.arange(256), 1e-4))
    assert tilted.roughness_coefficient.item() == pytest.approx(single.roughness_coefficient.item(), rel=1e-9)
    assert np.isnan(single.roughness_coefficient_low)
    assert "profiles" in single.roughness_coefficient_low.attrs["reason"]
    with pytest.raises(ValueError, match="E or W for a profile"):
        fc.joints.roughness_coefficient(profile(heights, 1e-4), direction=["E", "N"])


def test_limits_are_those_of_single_profiles(make_face):
    slopes = np.linspace(0.1, 0.3, 401)
    face = make_face(np.array([alternating(slope) for slope in slopes]), (1e-4, S))
    result = fc.joints.roughness_coefficient(face, direction="E")
    # 2.5 and 97.5 % of slopes that are evenly spread from 0.1 to 0.3
    expected = 32.2 + 32.47 * np.log10([0.105, 0.295])
    limits = result.roughness_coefficient_low.item(), result.roughness_coefficient_high.item()
    np.testing.assert_allclose(limits, expected, atol=0.05)
    assert result.profile_slope.item() == pytest.approx(np.sqrt(np.mean(slopes**2)), rel=1e-3)


def test_limits_hold_for_the_profiles_beside(make_face, rough):
    heights = 4e-5 * rough((400, 400), 5)
    every = make_face(heights[::8], (8e-4, 1e-4))
    result = fc.joints.roughness_coefficient(every, direction="E")
    low, high = result.roughness_coefficient_low.item(), result.roughness_coefficient_high.item()
    others = [
        fc.joints.roughness_coefficient(profile(row, 1e-4)).roughness_coefficient.item()
        for row in heights[4::8]
    ]
    assert np.mean([low < jrc < high for jrc in others]) > 0.8
    assert np.std(others) > 0.1 * (high - low)


def test_oblique_profiles_scatter_like_those_along_the_axes(make_face, rough):
    face = make_face(4e-5 * rough((300, 300), 8), 1e-4)
    result = fc.joints.roughness_coefficient(face, direction=["E", "N", "NE", 30.0])
    width = result.roughness_coefficient_high - result.roughness_coefficient_low
    assert (width > 0).all()
    assert width.max() < 2 * width.min()
    assert (result.roughness_coefficient_low < result.roughness_coefficient).all()
    assert (result.roughness_coefficient_high > result.roughness_coefficient).all()


def test_value_outside_the_scale_is_reported(make_face, rough):
    face = make_face(1e-2 * rough((40, 40), 1), 1e-4)
    result = fc.joints.roughness_coefficient(face)
    expected = 32.2 + 32.47 * np.log10(result.profile_slope)
    np.testing.assert_allclose(result.roughness_coefficient, expected)
    assert (result.roughness_coefficient > 20).all()
    assert (result.scale_position == 1).all()
    assert "standard profiles" in result.roughness_coefficient.attrs["comment"]
    inside = fc.joints.roughness_coefficient(make_face(alternating(0.2) * np.ones((4, 1)), S), direction="E")
    assert inside.scale_position == 0
    assert "comment" not in inside.roughness_coefficient.attrs


def test_a_plane_has_no_coefficient(make_face):
    result = fc.joints.roughness_coefficient(make_face(np.zeros((30, 30)), S))
    assert np.isnan(result.roughness_coefficient).all()
    assert "straight lines" in result.roughness_coefficient.attrs["reason"]
    assert (result.scale_position == -1).all()


def test_scale_correction(make_face):
    face = make_face(alternating(10 ** ((10 - 32.2) / 32.47), 200) * np.ones((4, 1)), S)
    result = fc.joints.roughness_coefficient(face, direction="E", length=1.0)
    assert result.roughness_coefficient.item() == pytest.approx(10, abs=0.01)
    # 10 * 10^(-0.2), as in barton_bandis_scaled
    assert result.scaled_roughness_coefficient.item() == pytest.approx(6.31, abs=0.01)
    same = fc.joints.roughness_coefficient(face, direction="E", length=0.1)
    np.testing.assert_allclose(same.scaled_roughness_coefficient, same.roughness_coefficient)
    with pytest.raises(ValueError, match=r"length: expected .*>= 0\.1"):
        fc.joints.roughness_coefficient(face, length=0.05)


def test_wrong_regression_is_refused(make_face):
    with pytest.raises(ValueError, match="did you mean 'tse_cruden'"):
        fc.joints.roughness_coefficient(make_face(np.eye(30), S), regression="tse_crudden")


def test_gaps_are_left_out(make_face, rough):
    heights = 1e-4 * rough((40, 40), 1)
    heights[3:8, 5:20] = np.nan
    assert np.isfinite(fc.joints.roughness_coefficient(make_face(heights, 1e-4)).profile_slope).all()
    with pytest.raises(ValueError, match=r"heights 1 m apart towards E"):
        fc.joints.roughness_coefficient(make_face(heights, 1e-4), lag=1.0)


@pytest.mark.parametrize("direction", ["E", "SW", 70.0])
def test_a_periodic_shift_changes_nothing(make_face, rough, direction):
    heights = 1e-4 * rough((48, 64), 3)
    faces = [make_face(np.roll(heights, shift, (0, 1)), S, periodic=True) for shift in [(0, 0), (11, 30)]]
    here, there = (fc.joints.roughness_coefficient(face, direction=direction, lag=3 * S) for face in faces)
    assert there.profile_slope.item() == pytest.approx(here.profile_slope.item(), rel=1e-12)


def test_slope_of_a_periodic_wave(make_face):
    """Its differences over one cell are those of all of its cells, the last and the first included."""
    cells = 40
    wave = 1e-3 * np.sin(2 * np.pi * np.arange(cells) / cells)
    result = fc.joints.roughness_coefficient(
        make_face(np.tile(wave, (4, 1)), S, periodic=True), direction="E"
    )
    exact = 1e-3 * 2 * np.sin(np.pi / cells) / S / np.sqrt(2)
    assert result.profile_slope.item() == pytest.approx(exact, rel=1e-12)


def test_azimuth_of_the_lag_is_stated(make_face, rough):
    face = make_face(1e-4 * rough((40, 40), 2), S)
    result = fc.joints.roughness_coefficient(face, direction=["E", "NW", 65.0])
    np.testing.assert_allclose(result.lag_azimuth, [0.0, 135.0, 90.0])
    assert "another azimuth" in result.roughness_coefficient.attrs["comment"]
    fine = fc.joints.roughness_coefficient(face, direction=["E", "NW", 65.0], lag=20 * S)
    np.testing.assert_allclose(fine.lag_azimuth, [0.0, 135.0, 65.0], atol=2.0)
    assert "another azimuth" not in fine.roughness_coefficient.attrs["comment"]
