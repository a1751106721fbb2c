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


@pytest.fixture(scope="module", params=[None, 3e11], ids=["constant force", "spring"])
def smooth_joint(request):
    """Band-limited faces that wrap, small steps of shear, and T/N from the pressures of the solver.

    T is the sum over the cells of pressure times the slope of the lower face, which is exact here.
    """
    n, spacing = 64, 1e-4
    lower = fc.surfaces.spectral(
        (n, n), spacing, hurst=0.8, rms_slope=0.15, rolloff=16 * spacing, short_cutoff=16 * spacing, rng=3
    )
    crack = fc.joints.Crack(lower, young=30e9, poisson=0.2, basic_friction_angle=30)
    shear = (8 + 0.1 * np.arange(6)) * spacing
    force = np.array([2e6, 2e7]) * crack.nominal_area
    opening = fc.joints.dilatancy(
        crack, shear=shear, direction="E", normal_force=force, normal_stiffness=request.param,
        keep=("pressure",), tolerance=1e-10,
    )  # fmt: skip
    wavenumber = 2 * np.pi * np.fft.fftfreq(n, spacing)
    modes = np.fft.fft(lower.values, axis=1)
    slope = [np.fft.ifft(1j * wavenumber * np.exp(1j * wavenumber * v) * modes, axis=1).real for v in shear]
    horizontal = np.einsum("vsyx,vyx->vs", opening.pressure.values[0], np.stack(slope)) * spacing**2
    ratio = horizontal / opening.normal_force.broadcast_like(opening.dilatancy).values[0]
    return opening, ratio


def test_energy_form_is_the_force_of_the_pressures(smooth_joint):
    opening, ratio = smooth_joint
    inside = slice(1, -1)  # central differences
    energy = fc.joints.friction(opening, form="energy")
    got = np.tan(np.radians(energy.frictionless_angle.values[0]))
    np.testing.assert_allclose(got[inside], ratio[inside], rtol=0.01)
    np.testing.assert_allclose(energy.friction_angle, 30 + energy.frictionless_angle)
    kinematic = fc.joints.friction(opening)
    neglected = np.tan(np.radians(kinematic.dilatancy_angle.values[0, inside])) / ratio[inside] - 1
    assert np.abs(neglected).max() > 0.05
    np.testing.assert_array_equal(energy.dilatancy_angle, kinematic.dilatancy_angle)
    assert "dU/dv" in energy.friction_angle.attrs["comment"]
    assert '"form": "energy"' in energy.attrs["provenance"]


def test_energy_secant_is_the_mean_force(smooth_joint):
    opening, ratio = smooth_joint
    shear = opening.shear.values
    reach = float(shear[-1] - shear[0])
    result = fc.joints.friction(opening, form="energy", distance=reach, basic_friction_angle=0)
    mean = np.trapezoid(ratio, shear, axis=0) / reach
    np.testing.assert_allclose(np.tan(np.radians(result.peak_friction_angle.values[0])), mean, rtol=0.01)


def test_elastic_energy_is_kept_for_every_shear_and_step(smooth_joint):
    opening, _ = smooth_joint
    assert opening.elastic_energy.dims == ("direction", "shear", "step")
    assert (opening.elastic_energy > 0).all()


def test_energy_form_needs_elastic_faces_under_force(crack):
    with pytest.raises(ValueError, match="form: expected 'kinematic' for a dilatancy without forces"):
        fc.joints.friction(curve([0.0, 1.0], [0.0, 1.0]), form="energy")
    yielded = fc.joints.dilatancy(crack, shear=[0, 8e-5], direction="E", normal_force=1e3, hardness=1e9)
    with pytest.raises(ValueError, match="where faces yield"):
        fc.joints.friction(yielded, form="energy")
    with pytest.raises(ValueError, match="form: expected one of 'kinematic', 'energy'.*got 'elastic'"):
        fc.joints.friction(yielded, form="elastic")


def fractal_curve(step, reach=1e-3, hurst=0.6):
    """Dilatancy c v^H of mated self-affine faces, whose slope at v = 0 has no limit."""
    shear = np.arange(round(reach / step) + 1) * step
    return curve(shear, 1e-4 * (shear / 1e-3) ** hurst)


def test_peak_over_a_distance_does_not_depend_on_the_step():
    first, peaks = [], []
    for step in (1e-5, 2e-5, 4e-5, 8e-5):
        result = fc.joints.friction(fractal_curve(step), distance=1.6e-4)
        first.append(result.friction_angle.values[0, 0])
        peaks.append(float(result.peak_friction_angle[0]))
        assert float(result.peak_distance) == 1.6e-4
        assert float(result.peak_shear[0]) == 0.0
    closed = 35 + np.degrees(np.arctan(1e-4 * 0.16**0.6 / 1.6e-4))
    np.testing.assert_allclose(peaks, closed, rtol=1e-12)
    assert first[0] - first[-1] > 10  # the first slope grows with every finer step


def test_dependence_of_the_peak_on_the_distance():
    result = fc.joints.friction(fractal_curve(1e-5), distance=1.6e-4)
    np.testing.assert_allclose(result.distance, 1e-5 * 2.0 ** np.arange(7))
    slope = np.tan(np.radians(result.secant_friction_angle.values[0] - 35))
    np.testing.assert_allclose(slope, 1e-4 * (result.distance / 1e-3) ** 0.6 / result.distance)
    change = np.diff(result.secant_friction_angle.values[0])[0]
    assert f"up to {-change:.3g} degree" in result.peak_friction_angle.attrs["comment"]
    assert "no limit is reached" in result.peak_friction_angle.attrs["comment"]
    straight = fc.joints.friction(curve(np.arange(9.0), 0.1 * np.arange(9.0)), distance=4.0)
    np.testing.assert_allclose(straight.secant_friction_angle, 35 + np.degrees(np.arctan(0.1)))
    assert "no limit" not in straight.peak_friction_angle.attrs["comment"]
    two = fc.joints.friction(curve([0.0, 1.0], [0.0, 0.1]))
    assert "not known" in two.peak_friction_angle.attrs["comment"]


def test_dependence_of_a_peak_in_a_long_first_step_is_not_known():
    """Half of the distance is resolved later only, where the opening is nearly straight."""
    shears = np.array([0.0, 2.0, 3.0, 4.0, 5.0])
    coarse = fc.joints.friction(curve(shears, 0.1 * shears**0.6), distance=2.0)
    assert coarse.peak_shear.item() == 0.0
    assert "not known" in coarse.peak_friction_angle.attrs["comment"]
    fine = np.arange(6.0)
    known = fc.joints.friction(curve(fine, 0.1 * fine**0.6), distance=2.0)
    np.testing.assert_allclose(known.peak_friction_angle, coarse.peak_friction_angle)
    first, whole = (np.degrees(np.arctan(0.1 * v**0.6 / v)) for v in (1.0, 2.0))
    assert f"{first - whole:.3g} degree" in known.peak_friction_angle.attrs["comment"]


def test_peak_strength_over_distances():
    opening = fractal_curve(1e-5)
    result = fc.joints.friction(opening, distance=1.6e-4, nominal_pressure=[1e6, 2e6])
    assert result.secant_shear_strength.dims == ("direction", "distance", "step")
    tangent = np.tan(np.radians(result.secant_friction_angle.values[0]))
    np.testing.assert_allclose(result.secant_shear_strength.values[0], tangent[:, None] * [1e6, 2e6])
    at_peak = result.secant_shear_strength.sel(distance=1.6e-4)
    np.testing.assert_array_equal(result.peak_shear_strength, at_peak)


def test_default_distance_is_one_percent_of_the_block():
    opening = fractal_curve(1e-5)
    assert float(fc.joints.friction(opening).peak_distance) == pytest.approx(2e-5)  # two steps
    wide = opening.assign(nominal_area=0.02 * 0.02)
    assert float(fc.joints.friction(wide).peak_distance) == pytest.approx(2e-4)
    assert float(fc.joints.friction(wide.isel(shear=slice(11))).peak_distance) == pytest.approx(1e-4)


def test_no_peak_across_a_longer_step_of_shear():
    # the rise of 8 over the step of 10 is not resolved over a distance of 2
    opening = curve([0.0, 1.0, 2.0, 3.0, 13.0], [0.0, 0.1, 0.2, 0.3, 8.3])
    result = fc.joints.friction(opening, distance=2.0)
    np.testing.assert_allclose(result.peak_friction_angle, 35 + np.degrees(np.arctan(0.1)))
    short = fc.joints.friction(opening, distance=0.5, nominal_pressure=1e6)
    for name in ("peak_friction_angle", "peak_shear_strength", "peak_shear", "peak_strength_shear"):
        assert np.isnan(short[name]).all()
        assert "do not resolve" in short[name].attrs["reason"]
    with pytest.raises(ValueError, match="distance: expected at most the 13 m that the shears cover"):
        fc.joints.friction(opening, distance=14.0)
    assert np.isnan(fc.joints.friction(opening, distance=5e-324).peak_friction_angle).all()


def test_locked_faces_have_no_peak():
    opening = curve([0.0, 1.0, 2.0, 3.0, 4.0], [0.0, 0.1, 3.1, 3.2, 3.3])
    result = fc.joints.friction(opening, distance=2.0, nominal_pressure=1e6)
    assert result.secant_friction_angle.sel(distance=4.0).item() == pytest.approx(
        35 + np.degrees(np.arctan(3.3 / 4))
    )
    for name in ("peak_friction_angle", "peak_shear_strength", "peak_shear", "peak_strength_shear"):
        assert np.isnan(result[name]).all()
        assert "90 degrees" in result[name].attrs["reason"]


def test_peak_strength_against_a_spring_takes_the_mean_pressure():
    shear = np.arange(5.0)
    pressure = 1e6 + 2e5 * shear**2
    opening = xr.Dataset(
        {"dilatancy": (("direction", "shear", "step"), 0.2 * shear[None, :, None])},
        coords={
            "shear": shear,
            "direction": ["E"],
            "nominal_pressure": (("direction", "shear", "step"), pressure[None, :, None]),
        },
    )
    result = fc.joints.friction(opening, distance=2.0, basic_friction_angle=30)
    expected = np.trapezoid(pressure[2:], dx=1.0) / 2 * np.tan(np.radians(30) + np.arctan(0.2))
    assert result.peak_shear_strength.item() == pytest.approx(expected)
    assert result.peak_strength_shear.item() == 2.0


def test_invalid_arguments_are_refused():
    with pytest.raises(ValueError, match="dilatancy: expected a Dataset, the result of a public function"):
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
