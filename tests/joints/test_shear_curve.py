"""Mobilised roughness of Barton and Bandis at published values and limits."""

import numpy as np
import pytest

import fractalcontact as fc

S = 0.508e-3
MPA = 1e6


@pytest.fixture(scope="module")
def surface(make_face):
    """Readings of JRC = 10 after Tse and Cruden."""
    slope = 10 ** ((10 - 32.2) / 32.47)
    return make_face(slope * S * (np.arange(1000) % 2) * np.ones((4, 1)), S)


def curve(surface, displacement, pressure=MPA, **options):
    options = {"wall_strength": 100 * MPA, "residual_friction_angle": 28} | options
    result = fc.joints.shear_curve(surface, displacement, nominal_pressure=pressure, **options)
    return result.transpose("nominal_pressure", ...)


def test_published_mobilisation(surface):
    # L 0.1 m, JRC 10: peak at 0.914 mm. i = 20 degrees; angles 14 28 43 48 45 42 38 at these ratios
    peak = 0.1 / 500 * 100**0.33
    result = curve(surface, peak * np.array([0, 0.15, 0.3, 0.6, 1, 2, 4, 10]))
    assert float(result.peak_displacement) == pytest.approx(0.914e-3, rel=2e-3)
    stress = result.shear_stress.values[0] / MPA
    expected = [0, 0.2493, 0.5317, 0.9325, 1.1106, 1.0, 0.9004, 0.7813]
    np.testing.assert_allclose(stress, expected, atol=2e-4)
    assert result.peak_shear_strength.item() == pytest.approx(stress.max() * MPA)
    assert curve(surface, 200 * peak).friction_angle.item() == pytest.approx(28)


def test_dilation_starts_after_three_tenths_of_the_peak(surface):
    peak = curve(surface, 0.0).peak_displacement.item()
    result = curve(surface, peak * np.linspace(0, 1, 2001), wall_strength=100 * MPA)
    dilatancy = result.dilatancy.values[0]
    assert dilatancy[600] == 0.0
    # M = 0.7 + 10/(12 * 2) = 1.11667, and 20/M = 17.91 degrees at the peak
    assert result.dilatancy_angle.values[0, -1] == pytest.approx(17.9104, rel=1e-4)
    ratios = np.linspace(0, 1, 200001)
    angle = 20 / 1.116667 * np.interp(ratios, [0, 0.3, 0.6, 1], [0, 0, 0.75, 1])
    assert dilatancy[-1] == pytest.approx(peak * np.mean(np.tan(np.radians(angle))), rel=1e-4)
    # a coarse request gives the same
    assert curve(surface, peak).dilatancy.item() == pytest.approx(dilatancy[-1], rel=1e-3)


def test_roughness_coefficient_takes_the_place_of_a_surface(surface):
    displacement = np.linspace(0, 4e-3, 9)
    own = curve(surface, displacement)
    given = curve(None, displacement, roughness_coefficient=10.0)
    np.testing.assert_allclose(given.shear_stress, own.shear_stress, rtol=1e-7)
    with pytest.raises(ValueError, match="surface: expected heights, or a roughness_coefficient"):
        curve(None, displacement)


def test_damage_coefficient_divides_the_dilation_only(surface):
    options = {"displacement": [0.5e-3, 2e-3]}
    strong, weak = (curve(surface, **options, damage_coefficient=m) for m in (1, 2))
    np.testing.assert_allclose(strong.dilatancy_angle, 2 * weak.dilatancy_angle)
    np.testing.assert_array_equal(strong.shear_stress, weak.shear_stress)


def test_damage_coefficient_is_at_least_one(surface):
    """0.7 + 10 / (12 log10(JCS / sigma)) is .87 at a hundred thousandth of the wall strength."""
    default, least = (curve(surface, 1e-3, 1e-5 * 100 * MPA, damage_coefficient=m) for m in (None, 1))
    np.testing.assert_array_equal(default.dilatancy_angle, least.dilatancy_angle)
    assert default.dilatancy_angle.item() > 10


def test_spring_raises_the_normal_stress_with_the_dilation(surface):
    stiffness = 1e9
    result = curve(surface, np.linspace(0, 4e-3, 41), [MPA, 5 * MPA], normal_stiffness=stiffness)
    expected = result.nominal_pressure + stiffness * result.dilatancy
    np.testing.assert_allclose(result.normal_stress, expected, rtol=1e-12)
    free = curve(surface, np.linspace(0, 4e-3, 41), [MPA, 5 * MPA])
    assert (result.dilatancy.values[:, -1] < free.dilatancy.values[:, -1]).all()
    assert (result.shear_stress.values[:, -1] > free.shear_stress.values[:, -1]).all()


def test_no_roughness_is_left_above_the_wall_strength(surface):
    result = curve(surface, [1e-3, 5e-3], [200 * MPA])
    np.testing.assert_allclose(result.friction_angle, 28)
    np.testing.assert_allclose(result.dilatancy, 0)
    assert not result.in_range.any()


def test_angle_is_limited_to_70_degrees(surface):
    # 28 + 10 log10(100/0.001) = 78
    peak = curve(surface, 0.0).peak_displacement.item()
    assert curve(surface, peak, 0.001 * MPA).friction_angle.item() == pytest.approx(70)


def test_a_longer_joint_is_smoother_and_peaks_later(surface):
    short, long = (curve(surface, 1e-3, length=length) for length in (0.1, 1.0))
    assert long.roughness_coefficient.item() == pytest.approx(10 * 10**-0.2, rel=1e-3)
    assert long.peak_displacement > short.peak_displacement
    assert long.peak_shear_strength < short.peak_shear_strength


def test_a_plane_slides_with_friction_alone(make_face):
    result = curve(make_face(np.zeros((30, 30)), S), [0, 1e-3])
    np.testing.assert_allclose(result.friction_angle, [[0, 28]])
    assert "JRC" in result.roughness_coefficient.attrs["comment"]


@pytest.mark.parametrize("spring", [None, 1e10])
def test_a_curve_does_not_depend_on_its_end(surface, spring):
    # 1 m is 1100 times the displacement of the peak
    ends = [curve(surface, [0.5e-3, 2e-3, end], normal_stiffness=spring) for end in (3e-3, 0.1, 1.0)]
    for name in ("dilatancy", "shear_stress", "normal_stress"):
        for longer in ends[1:]:
            np.testing.assert_allclose(longer[name][0, :2], ends[0][name][0, :2], rtol=1e-12, err_msg=name)


def test_dilation_is_the_integral_of_its_angle(surface):
    peak, damage = 0.1 / 500 * 100**0.33, 0.7 + 10 / 24
    places = np.linspace(0, 20 * peak, 2_000_001)
    share = np.interp(places / peak, [0, 0.3, 0.6, 1, 2, 4, 10, 100], [0, 0, 0.75, 1, 0.85, 0.7, 0.5, 0])
    slope = np.tan(np.radians(20 * share / damage))
    integral = np.append(0.0, np.cumsum(0.5 * (slope[1:] + slope[:-1]) * np.diff(places)))
    asked = peak * np.array([0.5, 1, 3, 8, 20])
    exact = np.interp(asked, places, integral)
    np.testing.assert_allclose(curve(surface, asked).dilatancy[0], exact, rtol=1e-3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"displacement": [1e-3, 0]}, "ascending"),
        ({"displacement": -1e-3}, "displacement"),
        ({"damage_coefficient": 3}, "damage_coefficient"),
        ({"residual_friction_angle": 70}, "residual_friction_angle"),
        ({"length": 0.05}, "length"),
        ({"pressure": 0.0}, "nominal_pressure"),
    ],
)
def test_wrong_arguments_are_named(surface, options, message):
    with pytest.raises(ValueError, match=message):
        curve(surface, **({"displacement": 1e-3} | options))
