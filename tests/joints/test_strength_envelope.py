"""Strength envelopes at worked values and limits."""

import inspect

import numpy as np
import pytest

import fractalcontact as fc

S = 0.508e-3
MPA = 1e6
NEEDED = {"nominal_pressure": MPA, "wall_strength": 100 * MPA, "basic_friction_angle": 30}
OPTIONAL = {
    name: {"cohesion": MPA, "length": 1.0, "tensile_strength": 5 * MPA}.get(name, 10.0)
    for name in inspect.signature(fc.joints.strength_envelope).parameters
    if name not in ("surface", "criterion", "direction", *NEEDED)
}


@pytest.fixture(scope="module")
def surface(make_face):
    """Readings of JRC = 10 after Tse and Cruden."""
    slope = 10 ** ((10 - 32.2) / 32.47)
    return make_face(slope * S * (np.arange(1000) % 2) * np.ones((4, 1)), S)


def strength(surface, criterion, pressure, **options):
    options = {"wall_strength": 100 * MPA, "basic_friction_angle": 30} | options
    result = fc.joints.strength_envelope(
        surface, nominal_pressure=np.multiply(pressure, MPA), criterion=criterion, **options
    )
    return result.shear_strength.values[0] / MPA, result.in_range.values[0]


def test_patton_is_bilinear(surface):
    # the lines meet at 20/(tan 50 - tan 30) = 32.552 MPa
    found, _ = strength(surface, "patton", [30, 32.552, 40], asperity_angle=20, cohesion=20 * MPA)
    np.testing.assert_allclose(found, [35.7526, 38.794, 43.0940], rtol=1e-4)


@pytest.mark.parametrize("ratio", [5.0, 10.0, 20.0])
def test_strength_of_the_material_is_the_parabola_of_fairhurst(surface, ratio):
    """Its vertex is the tensile strength, and it touches the circle of uniaxial compression (0 to JCS)."""
    found, _ = strength(surface, "ladanyi_archambault", [100], tensile_strength=100 * MPA / ratio)
    height = (found / 100) ** 2 / (1 + 1 / ratio)  # of tau^2 above the vertex, in units of JCS
    # tau^2 = height (sigma + 1/ratio) meets sigma (1 - sigma) in one point
    np.testing.assert_allclose((height - 1) ** 2 - 4 * height / ratio, 0, atol=1e-12)


def test_ladanyi_archambault_by_hand(surface):
    # at 10 MPa: a = 1 - 0.9^1.5 = 0.146185, v = 0.9^4 tan 20 = 0.238802, s_r = 100 (sqrt 11 - 1)/10 sqrt 2
    # = 32.7620: (10 * 0.853815 * 0.816152 + 0.146185 * 32.7620)/(1 - 0.853815 * 0.238802 * 0.577350)
    found, inside = strength(surface, "ladanyi_archambault", [10], asperity_angle=20)
    np.testing.assert_allclose(found, [13.3265], rtol=1e-4)
    assert inside.all()


def test_limits_of_ladanyi_archambault(surface):
    found, inside = strength(surface, "ladanyi_archambault", [1e-6, 100, 200], asperity_angle=20)
    # as the stress vanishes a = 1.5 sigma/JCS: the sheared share adds 1.5 * 0.2316625/(1 - tan 20 tan 30) =
    # 0.439943 to tan 50 = 1.191754; all asperities are sheared off at the wall strength
    assert found[0] / 1e-6 == pytest.approx(1.631697, rel=1e-5)
    assert found[1] == pytest.approx(100 * (np.sqrt(11) - 1) / 10 * np.sqrt(11), rel=1e-12)
    assert inside.tolist() == [True, True, False]
    # a ratio of compressive to tensile strength of 5: (sqrt 6 - 1)/5 = 0.289898 instead of 0.2316625
    tough, _ = strength(surface, "ladanyi_archambault", [1e-6], asperity_angle=20, tensile_strength=20 * MPA)
    assert tough[0] / 1e-6 == pytest.approx(1.742289, rel=1e-5)


def test_barton_choubey_and_its_limit_of_70_degrees(surface):
    # JRC 10, JCS 100, phi_r 28: tan 48 at 1 MPa; 70 degrees at 100 * 10^-4.2 = 0.00631 MPa
    found, inside = strength(
        surface, "barton_choubey", [1, 10, 0.006, 0.001, 200], residual_friction_angle=28
    )
    expected = np.array([1.11061, 10 * np.tan(np.radians(38)), 0.0164849, 0.00274748, 106.342])
    np.testing.assert_allclose(found, expected, rtol=1e-3)
    assert inside.tolist() == [True, True, False, False, False]


def test_barton_bandis_takes_the_length(surface):
    # JRC = 10 * 10^-0.2 = 6.310 and JCS = 100 * 10^-0.3 = 50.12 MPa: 28 + 6.310 * 1.7 = 38.73 degrees
    found, _ = strength(surface, "barton_bandis", [1.0], residual_friction_angle=28, length=1.0)
    np.testing.assert_allclose(found, [0.80185], rtol=1e-3)
    short, _ = strength(surface, "barton_bandis", [1.0], residual_friction_angle=28, length=0.1)
    plain, _ = strength(surface, "barton_choubey", [1.0], residual_friction_angle=28)
    assert short == pytest.approx(plain, rel=1e-12)


def of_barton(pressure, roughness, wall_strength, residual, **options):
    return fc.joints.strength_envelope(
        nominal_pressure=pressure,
        wall_strength=wall_strength,
        basic_friction_angle=residual,
        roughness_coefficient=roughness,
        **options,
    )


def test_joint_that_is_known_by_its_roughness_coefficient():
    result = of_barton([0.744e6, 30e6], 10, 30e6, 26)
    assert result.criterion.values.tolist() == ["barton_choubey"]
    expected = [0.67121e6, 30e6 * np.tan(np.radians(26))]
    np.testing.assert_allclose(result.shear_strength[0], expected, rtol=1e-5)
    assert result.friction_angle[0, 0].item() == pytest.approx(42.0555, abs=1e-4)
    assert "direction" not in result.coords
    assert "reason" in result.asperity_angle.attrs


def test_strength_is_positive_at_any_stress():
    # 90 degrees where log10(JCS / sigma) = 60 / 20, far beyond the limit of 70
    result = of_barton([1e2, 1e3, 1.01e5, 1e6], 20, 100e6, 30)
    assert (result.shear_strength > 0).all()
    assert result.friction_angle.max().item() == pytest.approx(70)
    assert not result.in_range[0, :3].any()


def test_scaled_constants_decrease_with_length():
    sample, longer = (of_barton(1e6, 10, 50e6, 30, length=length) for length in (0.1, 1.0))
    assert sample.scaled_roughness_coefficient.item() == pytest.approx(10)
    assert sample.scaled_wall_strength.item() == pytest.approx(50e6)
    assert sample.peak_displacement.item() == pytest.approx(0.914e-3, rel=1e-3)  # 0.2 mm times 100^0.33
    assert longer.scaled_roughness_coefficient.item() == pytest.approx(10 * 10**-0.2)
    assert longer.scaled_wall_strength.item() == pytest.approx(50e6 * 10**-0.3)
    # the strength at the length is that of a sample with the constants of the length
    jrc, jcs = longer.scaled_roughness_coefficient.item(), longer.scaled_wall_strength.item()
    same = of_barton(1e6, jrc, jcs, 30).shear_strength.item()
    assert longer.shear_strength.sel(criterion="barton_bandis").item() == pytest.approx(same, rel=1e-12)


def test_asperity_angle_is_enough_without_a_surface():
    result = fc.joints.strength_envelope(
        nominal_pressure=MPA, wall_strength=100 * MPA, basic_friction_angle=30, asperity_angle=20, cohesion=0
    )
    assert result.criterion.values.tolist() == ["patton", "ladanyi_archambault"]


def test_default_criteria_are_those_with_their_arguments(surface):
    assert fc.joints.strength_envelope(surface, **NEEDED).criterion.values.tolist() == [
        "ladanyi_archambault",
        "barton_choubey",
        "xia",
    ]
    given = {"cohesion": MPA, "length": 1.0, "residual_friction_angle": 30}
    result = fc.joints.strength_envelope(surface, **NEEDED, **given)
    assert result.sizes == {"criterion": 6, "nominal_pressure": 1}
    assert (result.shear_strength > 0.999 * MPA * np.tan(np.radians(30))).all()
    tangent = np.tan(np.radians(result.friction_angle)) * result.nominal_pressure
    np.testing.assert_allclose(tangent, result.shear_strength)
    assert all(len(text) > 10 for text in result.assumption.values)


@pytest.mark.parametrize("missing", [None, *OPTIONAL])
def test_every_criterion_whose_arguments_are_given_has_a_strength(surface, missing):
    """A criterion that takes an argument and does not say that it needs it would return NaN without it."""
    given = {name: value for name, value in OPTIONAL.items() if name != missing}
    assert np.isfinite(fc.joints.strength_envelope(surface, **NEEDED, **given).shear_strength).all()


def test_xia_on_teeth_of_one_dip(make_face):
    # A0 = 1/2, C = 0, t = 5 degrees: at sigma = sigma_t 30 + 10 (1 + exp(-5/4.5)) = 43.2919 degrees
    x = np.arange(41) % 20
    gentle = make_face(np.minimum(x, 20 - x) * np.tan(np.radians(5)) * np.ones((5, 1)) * S, S)
    found, inside = strength(gentle, "xia", [5, 50, 1e-9], tensile_strength=5 * MPA)
    expected = [4.71043, 50 * np.tan(np.radians(40 + 10 * np.exp(-10 / 0.9))), 1e-9 * np.tan(np.radians(50))]
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    assert inside.tolist() == [True, False, True]


def test_grasselli_egger_on_dips_spread_evenly(make_face):
    # equal areas at all dips up to 10 degrees: C = 1, A0 = 1/2, and exp(-10/4.5) = 0.108368 at sigma_t
    dips = np.radians(np.linspace(0, 10, 400))
    arch = np.concatenate([[0], np.cumsum(np.tan(np.concatenate([dips, -dips[::-1]])))]) * S
    found, _ = strength(
        make_face(arch * np.ones((4, 1)), S), "grasselli_egger", [5, 1e-9],
        residual_friction_angle=35, tensile_strength=5 * MPA,
    )  # fmt: skip
    expected = np.tan(np.radians(35)) * np.array([5 * 1.108368, 2e-9])
    np.testing.assert_allclose(found, expected, rtol=0.01)


def test_grasselli_egger_and_xia_have_one_exponent(surface, make_face, rough):
    """C + 1 in place of C, and A0 in the denominator of both: worked from `directional_roughness`."""
    face = make_face(4e-5 * rough((48, 60), 2), 1.3e-4)
    facets = fc.joints.directional_roughness(face).isel(azimuth=0)
    theta, share, shape = (float(facets[name]) for name in ("theta_max", "area_fraction", "shape"))
    pressure, tensile = np.array([0.5, 2.0, 5.0]), 5.0
    options = {"residual_friction_angle": 28, "tensile_strength": tensile * MPA}
    found, _ = strength(face, "grasselli_egger", pressure, **options)
    decay = np.exp(-theta / (9 * share * shape) * pressure / tensile)
    np.testing.assert_allclose(found, pressure * np.tan(np.radians(28)) * (1 + decay), rtol=1e-12)
    found, _ = strength(face, "xia", pressure, **options)
    decay = np.exp(-theta / (9 * share * (shape + 1)) * pressure / tensile)
    angle = 30 + 4 * share * theta / (shape + 1) * (1 + decay)
    np.testing.assert_allclose(found, pressure * np.tan(np.radians(angle)), rtol=1e-12)


@pytest.mark.parametrize(("direction", "share"), [("E", 0.27), ("W", 0.73)])
def test_xia_is_out_of_range_far_from_one_half_of_facing_area(make_face, direction, share):
    x = np.arange(401) % 20
    teeth = make_face(np.where(x < 5, 3 * x, 20 - x) * 1e-4 * np.ones((5, 1)), 1e-3)
    even = make_face(np.minimum(x, 20 - x) * 1e-4 * np.ones((5, 1)), 1e-3)
    facets = fc.joints.directional_roughness(teeth, direction=direction)
    assert float(facets.area_fraction[0]) == pytest.approx(share, abs=0.02)
    assert strength(teeth, "xia", [1.0], direction=direction)[1].tolist() == [False]
    assert strength(even, "xia", [1.0], direction=direction)[1].tolist() == [True]


def test_xia_has_no_strength_on_a_surface_too_rough_for_it(make_face):
    x = np.arange(401) % 20
    steep = make_face(np.minimum(x, 20 - x) * S * np.ones((5, 1)), S)
    options = {"wall_strength": 100 * MPA, "basic_friction_angle": 30, "asperity_angle": 20}
    result = fc.joints.strength_envelope(steep, nominal_pressure=MPA, criterion="xia", **options)
    assert np.isnan(result.shear_strength).all()
    assert "90 degrees" in result.shear_strength.attrs["reason"]
    assert not result.in_range.any()


@pytest.mark.parametrize("criterion", ["barton_choubey", "barton_bandis", "grasselli_egger", "xia"])
def test_steep_surface_suits_criteria_without_an_asperity_angle(make_face, criterion):
    """Mean dip 45 degrees: with a friction angle of 50 degrees asperities of that angle cannot be climbed."""
    x = np.arange(401) % 20
    teeth = make_face(np.minimum(x, 20 - x) * 1e-3 * np.ones((5, 1)), 1e-3)
    options = {"nominal_pressure": 1e6, "wall_strength": 1e8, "basic_friction_angle": 50}
    options |= {"residual_friction_angle": 45, "length": 1.0}
    both = [criterion, "ladanyi_archambault"]
    with pytest.raises(ValueError, match="surface: expected a mean dip of less than 90 degrees"):
        fc.joints.strength_envelope(teeth, criterion=both, **options)
    alone = fc.joints.strength_envelope(teeth, criterion=criterion, **options)
    less = options | {"asperity_angle": 30}  # given in place of the mean dip
    same = fc.joints.strength_envelope(teeth, criterion=both, **less).sel(criterion=[criterion])
    np.testing.assert_array_equal(alone.shear_strength, same.shear_strength)
    assert alone.asperity_angle.item() == pytest.approx(45, abs=0.05)
    with pytest.raises(ValueError, match="asperity_angle: expected less than 90 degrees .*, got 95"):
        fc.joints.strength_envelope.validate(teeth, criterion=both, **options, asperity_angle=45)


def test_asperity_angle_is_the_mean_dip_towards_the_shear(make_face):
    x = np.arange(401) % 20
    teeth = make_face(np.minimum(x, (20 - x) / 3) * 1e-3 * np.ones((5, 1)), 1e-3)
    options = {"nominal_pressure": 1.0, "wall_strength": 1e12, "basic_friction_angle": 20}
    options |= {"criterion": "patton", "cohesion": 1e9}  # no asperity is sheared off
    for direction, angle in (("E", 45.0), ("W", 18.43)):
        result = fc.joints.strength_envelope(teeth, direction=direction, **options)
        assert result.asperity_angle.item() == pytest.approx(angle, abs=0.05)
        assert result.friction_angle[0].item() == pytest.approx(20 + angle, abs=0.05)
    with pytest.raises(ValueError, match="less than 90 degrees"):
        fc.joints.strength_envelope(teeth, **options | {"basic_friction_angle": 50})


@pytest.mark.parametrize(("rise", "inside"), [(7, False), (9, True), (11, True), (13, False)])
def test_xia_is_in_range_for_four_to_six_tenths_of_facing_area(make_face, rise, inside):
    x = np.arange(401) % 20
    teeth = make_face(1e-3 * np.where(x < rise, x / rise, (20 - x) / (20 - rise)) * np.ones((5, 1)), 1e-3)
    assert strength(teeth, "xia", [1.0], direction="E")[1].tolist() == [inside]


def test_barton_is_in_range_from_a_hundredth_to_three_tenths_of_the_wall_strength(surface):
    _, inside = strength(surface, "barton_choubey", [0.9, 1.1, 29, 31])
    assert inside.tolist() == [False, True, True, False]


def test_roughness_beyond_the_scale_is_out_of_range(make_face, rough):
    steep = make_face(2e-3 * rough((64, 64), 3), 1e-4)
    result = fc.joints.strength_envelope(
        steep, nominal_pressure=5e6, wall_strength=1e8, basic_friction_angle=20, asperity_angle=30
    )
    assert result.roughness_coefficient > 20
    assert "standard profiles" in result.roughness_coefficient.attrs["comment"]
    assert not result.in_range.sel(criterion="barton_choubey").any()
    assert "in_range" in result.shear_strength.attrs["comment"]


@pytest.mark.parametrize(("dip", "inside"), [(2.6, False), (2.9, True)])
@pytest.mark.parametrize("criterion", ["ladanyi_archambault", "grasselli_egger", "xia"])
def test_asperities_less_steep_than_those_of_the_standard_profiles_are_out_of_range(
    make_face, criterion, dip, inside
):
    """The regression of Tatone and Grasselli (2010) has JRC = 0 at 2.73 degrees, a mean dip of facets."""
    x = np.arange(401) % 20
    teeth = make_face(np.minimum(x, 20 - x) * np.tan(np.radians(dip)) * np.ones((5, 1)) * S, S)
    _, found = strength(teeth, criterion, [1.0], residual_friction_angle=30)
    assert found.tolist() == [inside]


def test_only_the_criterion_that_is_that_of_a_plane_is_in_range_on_a_nanometre_of_roughness(make_face, rough):
    smooth = make_face(1e-9 * rough((40, 40), 5), S)
    everything = fc.joints.strength_envelope(
        smooth, **NEEDED, cohesion=MPA, length=1.0, residual_friction_angle=30
    )
    assert everything.criterion.where(everything.in_range[:, 0], drop=True).values.tolist() == ["patton"]


def test_a_plane_has_the_basic_strength(make_face):
    plane = make_face(np.zeros((30, 30)), S)
    found, inside = strength(plane, ["barton_choubey"], [1.0, 5.0])
    np.testing.assert_allclose(found, np.tan(np.radians(30)) * np.array([1.0, 5.0]))
    assert not inside.any()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"criterion": "patton"}, "cohesion: expected a value, for criterion 'patton'"),
        ({"criterion": "barton_bandis"}, "length: expected a value"),
        ({"criterion": "grasselli_egger"}, "residual_friction_angle: expected a value"),
        ({"criterion": "barton_chubey"}, "did you mean 'barton_choubey'"),
        ({"criterion": []}, "at least one"),
        ({"nominal_pressure": 0.0}, "nominal_pressure: expected .*>= 1e-30"),
        ({"direction": "up"}, "direction"),
        ({"surface": None}, "surface: expected heights, or"),
        ({"surface": None, "criterion": "xia"}, "surface: expected a value, for criterion 'xia'"),
        ({"roughness_coefficient": 30, "wall_strength": -1}, "(?s)wall_strength.*roughness_coefficient"),
    ],
)
def test_wrong_arguments_are_named(surface, options, message):
    with pytest.raises(ValueError, match=message):
        fc.joints.strength_envelope(**{"surface": surface} | NEEDED | options)


@pytest.mark.parametrize(("dip", "angle", "is_in_range"), [(8.0, 64.0, True), (11.0, 76.0, False)])
def test_xia_ends_at_the_largest_angle_of_a_joint(make_face, dip, angle, is_in_range):
    """On teeth of a dip t, A0 = .5 and C = 0 its angle begins at the basic one plus 4 t."""
    x = np.arange(161)
    teeth = np.tan(np.radians(dip)) * 5e-4 * np.abs((x + 10) % 20 - 10) * np.ones((12, 1))
    result = fc.joints.strength_envelope(
        make_face(teeth, 5e-4),
        criterion="xia",
        nominal_pressure=[1e3],
        wall_strength=1e8,
        basic_friction_angle=32.0,
    ).squeeze()
    assert np.degrees(np.arctan(result.shear_strength / 1e3)) == pytest.approx(angle, abs=0.1)
    assert bool(result.in_range) == is_in_range
