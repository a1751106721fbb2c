"""Laws of closure, roughness coefficients and size effects against closed forms and other sources."""

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc


def law(pressure, closure):
    return xr.Dataset(
        {"interface_closure": ("step", np.asarray(closure, float))},
        coords={"step": np.arange(len(pressure)), "nominal_pressure": ("step", np.asarray(pressure, float))},
    )


def test_an_exponential_joint_gives_its_constants_and_stiffness_on_any_steps():
    p = np.array([1e4, 3e4, 4e4, 2e5, 9e5])
    found = fc.joints.closure_laws(law(p, 3e-6 * np.log(p / 2e3)))
    assert found.closure_length == pytest.approx(3e-6, rel=1e-12)
    assert found.reference_pressure == pytest.approx(2e3, rel=1e-10)
    assert found.exponential_misfit < 1e-18
    assert found.hyperbolic_misfit > 1e-7
    np.testing.assert_allclose(found.stiffness, p / 3e-6, rtol=1e-10)


def test_a_hyperbolic_joint_gives_its_constants_in_the_words_of_bandis():
    p = np.geomspace(1e5, 3e7, 12)
    constants = {"initial_stiffness": 20.35e9, "greatest_closure": 0.136871e-3}
    found = fc.joints.closure_laws(law(p, fc.joints.bandis_closure(p, **constants)))
    for name, value in constants.items():
        assert found[name] == pytest.approx(value, rel=1e-6)
    assert found.hyperbolic_misfit < 1e-12
    assert found.exponential_misfit > 1e-6


def test_a_straight_line_has_no_greatest_closure():
    p = np.linspace(1e5, 1e6, 6)
    found = fc.joints.closure_laws(law(p, p / 5e10))
    assert np.isinf(found.greatest_closure)
    assert found.initial_stiffness == pytest.approx(5e10, rel=1e-5)


def test_only_the_first_loading_is_fitted_and_every_branch_has_its_stiffness():
    p = np.array([0.0, 1e4, 4e4, 2e5, 5e4, 1e4, 1e5])
    w = 3e-6 * np.log(np.maximum(p, 1.0) / 2e3)
    w[4:6] = w[3] + 1e-6 * np.log(p[4:6] / p[3])  # unloading is stiffer
    found = fc.joints.closure_laws(law(p, w))
    assert found.closure_length == pytest.approx(3e-6, rel=1e-12)
    assert np.isnan(found.stiffness[0])
    np.testing.assert_allclose(found.stiffness[1:4], p[1:4] / 3e-6, rtol=1e-10)
    np.testing.assert_allclose(found.stiffness[4:6], p[4:6] / 1e-6, rtol=1e-10)
    assert "no force" in found.stiffness.attrs["reason"]


def test_mated_faces_have_no_law_and_say_so(make_face):
    crack = fc.joints.Crack(make_face(np.zeros((8, 8)), 1e-4), young=1e9, poisson=0.2)
    found = fc.joints.closure_laws(fc.joints.closure(crack, shear=0.0, normal_force=[1.0, 2.0, 4.0]))
    assert np.isnan(found.closure_length).all()
    assert "does not close" in found.closure_length.attrs["reason"]


@pytest.mark.parametrize("seed", [1, 2])
def test_self_affine_faces_close_by_the_logarithm_with_the_known_length(seed):
    # separation over rms height: 0.38 to 0.52 at reduced pressures of 0.01 to 0.1
    # the delta-surface of two faces that know nothing of each other is one of twice the variance
    options = {"hurst": 0.8, "long_cutoff": 64e-6, "short_cutoff": 4e-6}
    lower, upper = (
        fc.surfaces.spectral((256, 256), 1e-6, rms_height=1e-7, rng=100 * seed + i, **options) for i in (0, 1)
    )
    crack = fc.joints.Crack(lower, upper, young=1e9, poisson=0.0)
    delta = fc.joints.delta_surface(crack, 0.0)
    slope = float(fc.surfaces.describe(delta).rms_slope)
    pressure = crack.contact_modulus * slope * np.geomspace(0.01, 0.1, 6)
    closing = fc.joints.closure(crack, shear=0.0, nominal_pressure=pressure)
    found = fc.joints.closure_laws(closing)
    assert 0.38 < float(found.closure_length[0]) / float(delta.std()) < 0.52
    assert found.exponential_misfit[0] < 0.1 * float(delta.std())


def test_laws_say_what_is_wrong():
    with pytest.raises(ValueError, match=r"Dataset of fractalcontact.joints.closure, got 'int'"):
        fc.joints.closure_laws(3)
    with pytest.raises(ValueError, match="no interface_closure"):
        fc.joints.closure_laws(xr.Dataset())


# the roughness coefficient


@pytest.mark.parametrize(("direction", "share"), [("E", 1.0), ("W", 1.0), ("NE", 0.5)])
def test_a_sawtooth_has_the_slope_of_its_teeth(make_face, direction, share):
    s = 1.27e-3
    tooth = 0.25 * s * np.abs((np.arange(60) + 10) % 20 - 10)
    face = make_face(np.broadcast_to(tooth, (60, 60)), s)
    found = fc.joints.roughness_coefficient(face, direction=direction)
    z2 = 0.25 * (1.0 if share == 1.0 else np.sqrt(0.5))
    assert found.profile_slope.item() == pytest.approx(z2, rel=0.02)
    expected = 32.2 + 32.47 * np.log10(found.profile_slope.item())
    assert found.roughness_coefficient.item() == pytest.approx(expected, rel=1e-12)
    flat = fc.joints.roughness_coefficient(face, direction="N")
    assert flat.profile_slope < 1e-12
    assert np.isnan(flat.roughness_coefficient)
    assert 1e3 * found.lag.item() == pytest.approx(1.27 if share == 1.0 else 1.796, rel=1e-3)


def test_a_coefficient_outside_the_scale_is_missing_with_its_reason(make_face, rough):
    face = make_face(1e-2 * rough((40, 40), 1), 1e-4)
    found = fc.joints.roughness_coefficient(face)
    assert np.isnan(found.roughness_coefficient).all()
    assert "standard profiles" in found.roughness_coefficient.attrs["reason"]
    assert (found.profile_slope > 0.5).all()


def test_gaps_are_left_out_and_faults_named(make_face, rough):
    heights = 1e-4 * rough((40, 40), 1)
    heights[3:8, 5:20] = np.nan
    assert np.isfinite(fc.joints.roughness_coefficient(make_face(heights, 1e-4)).profile_slope).all()
    with pytest.raises(ValueError, match=r"heights 1 m apart towards E"):
        fc.joints.roughness_coefficient(make_face(heights, 1e-4), lag=1.0)


# size


def test_friction_under_self_weight_grows_with_the_size():
    small, large = fc.joints.self_weight_strength(
        np.array([10.0, 100.0]), unit_weight=24e3, friction_angle=45
    )
    assert small == pytest.approx(240e3)
    assert large / small == pytest.approx(10.0)
    with pytest.raises(ValueError, match="unit_weight"):
        fc.joints.self_weight_strength(1.0, unit_weight=-1, friction_angle=45)
