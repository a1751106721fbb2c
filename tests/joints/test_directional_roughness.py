"""Directional roughness of teeth, planes, and of a surface measured by another package."""

import numpy as np
import pytest

import fractalcontact as fc

S = 0.5e-3
MEASURES = ["area_fraction", "theta_max", "shape", "roughness_metric", "mean_dip"]


@pytest.fixture
def teeth(make_face):
    """Teeth along x that rise and fall by 30 degrees; the profile is symmetric, so its mean line is level."""
    x = np.arange(161)
    height = np.tan(np.radians(30)) * S * np.abs((x + 10) % 20 - 10)
    return make_face(np.broadcast_to(height, (12, 161)), S)


def waves():
    """Twenty-six waves towards the east, each of them skew."""
    y, x = 0.5e-3 * np.mgrid[:80, :80]
    k = np.arange(26)
    angle, length = 1.3 * np.sin(2.4 * k), 25e-3 * 0.92**k
    phase = 2 * np.pi / length * (x[..., None] * np.cos(angle) + y[..., None] * np.sin(angle)) + k**2
    return 0.2 * (length**0.8 * (np.sin(phase) - 0.35 * np.sin(2 * phase))).sum(axis=-1) / 40


def test_symmetric_teeth(teeth):
    result = fc.joints.directional_roughness(teeth, direction=[0, "W", 60, "N"])
    np.testing.assert_allclose(result.area_fraction, [0.5, 0.5, 0.5, 0.0], atol=1e-12)
    oblique = np.degrees(np.arctan(np.tan(np.radians(30)) * 0.5))
    np.testing.assert_allclose(result.theta_max, [30, 30, oblique, 0], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(result["shape"][:3], 0, atol=1e-9)
    np.testing.assert_allclose(result.roughness_metric, result.theta_max, rtol=1e-9)
    np.testing.assert_allclose(result.mean_dip, result.theta_max, rtol=1e-9)
    assert np.isnan(result["shape"][3])
    assert "faces the shear" in result["shape"].attrs["reason"]


@pytest.mark.parametrize("tilt", [0.0, 0.4])
def test_asymmetric_teeth_are_measured_from_their_mean_plane(make_face, tilt):
    x = np.arange(101)
    height = np.minimum(x % 20, (20 - x % 20) / 3.0) + tilt * x
    result = fc.joints.directional_roughness(
        make_face(np.broadcast_to(S * height, (8, 101)), S), direction=[0.0, 180.0]
    )
    plane = np.degrees(np.arctan(np.polyfit(x, height, 1)[0]))
    rise, fall = np.degrees(np.arctan([1 + tilt, 1 / 3 - tilt]))
    np.testing.assert_allclose(result.theta_max, [rise - plane, fall + plane], rtol=1e-9)
    np.testing.assert_allclose(result.roughness_metric, result.theta_max, rtol=1e-9)
    length = np.array([5, 15]) / np.cos(np.radians([rise, fall]))
    np.testing.assert_allclose(result.area_fraction, length / length.sum(), rtol=1e-9)


@pytest.mark.parametrize("slope", [0.0, 0.3])
def test_a_plane_has_no_roughness(make_face, slope):
    y, x = S * np.mgrid[:40, :50]
    result = fc.joints.directional_roughness(make_face(12.3 + slope * x - 0.7 * slope * y, S))
    assert result.sizes == {"azimuth": 72}
    for name in ("area_fraction", "theta_max", "roughness_metric", "mean_dip"):
        assert (result[name] == 0).all()
    assert np.isnan(result["shape"]).all()


def test_exact_law_gives_its_own_parameters(make_face):
    # teeth of equal width that rise and fall by the dip; their number has the density of the law, which is
    # that of area, over the area 1/cos(dip) of a facet
    shape, greatest = 2.5, np.radians(40)
    dip = np.linspace(0, greatest, 20001)
    cumulative = np.cumsum((1 - dip / greatest) ** (shape - 1) * np.cos(dip))
    dips = np.interp((np.arange(40000) + 0.5) / 40000 * cumulative[-1], cumulative, dip)
    heights = np.zeros(80001)
    heights[1::2] = S * np.tan(np.random.default_rng(1).permutation(dips))
    result = fc.joints.directional_roughness(
        make_face(np.broadcast_to(heights, (3, 80001)), S), direction=["E", "W"]
    )
    np.testing.assert_allclose(result["shape"], shape, rtol=0.03)
    np.testing.assert_allclose(result.theta_max, 40, rtol=0.02)
    np.testing.assert_allclose(result.roughness_metric, 40 / 3.5, rtol=5e-3)
    np.testing.assert_allclose(result.mean_dip, 40 / 3.5, rtol=5e-3)


# surface-roughness 0.0.3 (PyPI) on the same triangles: both diagonals of every cell of `waves`
PEER = {
    "area_fraction": [0.4914, 0.5031, 0.5001, 0.4927, 0.5086, 0.4969, 0.4999, 0.5073],
    "theta_max": [30.9673, 35.445, 39.1106, 44.9158, 40.1178, 47.8427, 44.0332, 40.196],
    "shape": [2.0086, 2.312, 2.4492, 2.9133, 2.5008, 2.9218, 2.6914, 2.784],
    "roughness_metric": [10.2929, 10.7022, 11.3391, 11.4777, 11.4598, 12.199, 11.9284, 10.6226],
    "mean_dip": [10.2968, 10.6465, 11.3044, 11.4236, 11.4782, 12.2129, 11.9136, 10.512],
}


def test_values_of_the_peer_package(make_face):
    result = fc.joints.directional_roughness(make_face(waves(), S), direction=np.arange(0, 360, 45))
    for name, expected in PEER.items():
        np.testing.assert_allclose(result[name], expected, rtol=1e-3, err_msg=name)


def test_east_and_west_differ_and_change_places_in_the_mirror(make_face):
    azimuth = np.arange(0.0, 360.0, 15.0)
    result = fc.joints.directional_roughness(make_face(waves(), S), direction=azimuth)
    metric = result.roughness_metric
    assert metric.sel(azimuth=180) > 1.1 * metric.sel(azimuth=0)
    for heights, back in ((waves()[:, ::-1], 180 - azimuth), (waves().T, 90 - azimuth)):
        mirrored = fc.joints.directional_roughness(make_face(heights, S), direction=back)
        for name in MEASURES:
            np.testing.assert_allclose(mirrored[name], result[name], rtol=1e-9, err_msg=name)


def test_opposite_fractions_add_up_to_one(make_face, rough):
    azimuth = np.arange(0.0, 180.0, 20.0)
    face = make_face(1e-4 * rough((50, 70), 4), (1e-4, 2e-4))
    there = fc.joints.directional_roughness(face, direction=azimuth).area_fraction
    back = fc.joints.directional_roughness(face, direction=azimuth + 180).area_fraction
    np.testing.assert_allclose(there.values + back.values, 1.0, rtol=1e-12)


def test_unit_of_length_and_origin_change_nothing(make_face, rough):
    heights = 1e-4 * rough((40, 40), 4)
    small = fc.joints.directional_roughness(make_face(heights, 1e-4))
    large = fc.joints.directional_roughness(make_face(1e3 * heights + 5.0, 0.1, origin=(3.0, -2.0)))
    for name in MEASURES:
        np.testing.assert_allclose(large[name], small[name], rtol=1e-6, err_msg=name)


def test_cells_beside_a_gap_are_left_out(teeth):
    holed = teeth.copy()
    holed[5:7, 40:121] = np.nan  # symmetric, so that the mean plane stays level
    result = fc.joints.directional_roughness(holed, direction=["E", "W"])
    np.testing.assert_allclose(result.area_fraction, 0.5, rtol=1e-9)
    np.testing.assert_allclose(result.roughness_metric, 30.0, rtol=1e-9)
    sparse = teeth.where(teeth.x < teeth.x[1])
    with pytest.raises(ValueError, match="four neighbouring heights"):
        fc.joints.directional_roughness(sparse)


@pytest.mark.parametrize("direction", ["up", [], np.nan, [[0.0, 90.0]], ["E", 0.0]])
def test_wrong_direction_is_refused(teeth, direction):
    with pytest.raises(ValueError, match="direction"):
        fc.joints.directional_roughness(teeth, direction=direction)


def test_words_and_degrees_are_the_same_directions(make_face):
    words = fc.joints.directional_roughness(make_face(waves(), S), direction=["NE", "W", "S"])
    degrees = fc.joints.directional_roughness(make_face(waves(), S), direction=[45, -180, 270.0])
    np.testing.assert_array_equal(words.azimuth, [45, 180, 270])
    for name in MEASURES:
        np.testing.assert_array_equal(words[name], degrees[name])


@pytest.mark.parametrize("shift", [0, 7, 20])
def test_a_periodic_wave_has_no_slope_and_faces_both_ways(make_face, shift):
    """A plane through one period of a wave has a slope; the wave has none, and goes on beyond its end."""
    cells, steepest = 80, 0.3
    wave = np.sin(2 * np.pi * (np.arange(cells) + shift) / cells) * steepest * cells * S / (2 * np.pi)
    face = make_face(np.tile(wave, (16, 1)), S, periodic=True)
    result = fc.joints.directional_roughness(face, direction=["E", "W", "N"])
    np.testing.assert_allclose(result.area_fraction, [0.5, 0.5, 0.0], atol=1e-9)
    np.testing.assert_allclose(result.theta_max[:2], np.degrees(np.arctan(steepest)), rtol=1e-3)
    slope = steepest * np.cos(np.linspace(0, np.pi / 2, 100001))
    dip = np.average(np.degrees(np.arctan(slope)), weights=np.hypot(1, slope))
    np.testing.assert_allclose(result.mean_dip[:2], dip, rtol=1e-3)


def test_a_periodic_shift_changes_nothing(make_face, rough):
    heights = 1e-4 * rough((48, 64), 3)
    faces = [make_face(np.roll(heights, shift, (0, 1)), S, periodic=True) for shift in [(0, 0), (11, 30)]]
    here, there = (fc.joints.directional_roughness(face, direction=[0, 40, 90, 180]) for face in faces)
    for name in MEASURES:
        np.testing.assert_allclose(there[name], here[name], rtol=1e-9, err_msg=name)
