"""Direct shear with wear: teeth by hand, balances, symmetry, invariance and limits."""

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.errors import SmallStrainWarning
from fractalcontact.base.study import end_of_first_leg

FRICTION = 30.0
MU = np.tan(np.radians(FRICTION))
HALF = 10  # cells of a flank
SLOPE = 0.3


@pytest.fixture(scope="module")
def teeth(make_face):
    """Mated teeth, two periods of 20 cells, all but rigid, that wrap."""
    x, spacing = np.arange(4 * HALF), 1e-3
    tooth = np.abs((x + HALF) % (2 * HALF) - HALF) * spacing * SLOPE
    face = make_face(np.broadcast_to(tooth, (4, x.size)), spacing, periodic=True)
    return fc.joints.Crack(face, young=1e14, poisson=0.0, basic_friction_angle=FRICTION)


@pytest.fixture(scope="module")
def rough_crack(make_face, rough):
    """A block of 24 x 24 cells on a face of 40 x 40."""
    face = make_face(2e-5 * rough((40, 40), 5), 1e-4)
    return fc.joints.Crack(face, young=3e10, poisson=0.2, block=24e-4, basic_friction_angle=FRICTION)


@pytest.fixture(scope="module")
def there_and_back(rough_crack):
    return sheared(rough_crack, [5e-4, 0.0], [2e6, 2e7])


def sheared(crack, path, pressure=5e6, **options):
    options = {"hardness": 2e8} | options
    result = fc.joints.direct_shear(crack, path, nominal_pressure=pressure, **options)
    return result.transpose("nominal_pressure", ...)


def test_teeth_climb_until_their_flanks_yield(teeth):
    # k cells from the mated position 2 (HALF - k + 1) of 4 HALF cells bear; the load is N/(1 - mu SLOPE)
    hardness, share = 1e8, 0.2
    test = sheared(teeth, 8e-3, share * hardness, hardness=hardness).isel(nominal_pressure=0)
    angle = FRICTION + np.degrees(np.arctan(SLOPE))
    bearing = (HALF - np.arange(1, 9) + 1) / (2 * HALF)
    climbs = bearing > share / (1 - MU * SLOPE)
    assert climbs.tolist() == [True] * 6 + [False] * 2  # 0.25 > 0.2419 > 0.2
    stepwise = test.friction_angle.values[2:]
    np.testing.assert_allclose(stepwise[climbs], angle, rtol=1e-4)
    assert (stepwise[~climbs] < angle - 1).all()
    np.testing.assert_allclose(test.dilatancy.values[2:][climbs], SLOPE * 1e-3 * np.arange(1, 7), rtol=1e-3)
    assert test.wear_depth.values[7] == pytest.approx(0, abs=1e-9)
    assert test.wear_depth.values[8] > 1e-6


def test_work_of_wear_is_hardness_times_volume(rough_crack, there_and_back):
    test = there_and_back
    volume = test.wear_depth * rough_crack.nominal_area
    np.testing.assert_allclose(test.plastic_work, 2e8 * volume, rtol=1e-9)
    assert (test.wear_depth.values[:, -1] > 0).all()
    assert (np.diff(test.wear_depth.values, axis=1) >= 0).all()


def test_shear_dissipates_at_least_friction_and_wear(rough_crack, there_and_back):
    # T dv - N dz is the heat of friction P mu (1 + d^2) dv and the work of wear, if no elastic energy changed
    test = there_and_back
    slip = np.diff(test.shear.values)
    work = np.cumsum(test.shear_stress.values[:, 1:] * slip, axis=1)
    lift = test.nominal_pressure.values[:, None] * test.dilatancy.values[:, 1:]
    wear = (test.plastic_work.values[:, 1:] - test.plastic_work.values[:, :1]) / rough_crack.nominal_area
    friction = 0.9 * MU * test.nominal_pressure.values[:, None] * np.cumsum(np.abs(slip))
    assert (work - lift >= friction + wear - 1e-9).all()


def test_residual_faces_have_lost_the_worn_volume(rough_crack):
    test = sheared(rough_crack, 5e-4, 2e7, keep=("residual_lower", "residual_upper")).isel(nominal_pressure=0)
    face = rough_crack.lower
    lower, upper = face - test.residual_lower, test.residual_upper - face
    assert lower.min() > -1e-15
    assert upper.min() > -1e-15
    assert float(lower.sum()) == pytest.approx(float(upper.sum()))
    depth = float((lower + upper).sum()) * 1e-8 / rough_crack.nominal_area
    assert depth == pytest.approx(float(test.wear_depth[-1]))
    # a new test may start from them: what has been worn off is no longer there
    worn = fc.joints.Crack(
        test.residual_lower, test.residual_upper, young=3e10, poisson=0.2, block=24e-4,
        basic_friction_angle=FRICTION,
    )  # fmt: skip
    again = sheared(worn, 5e-4, 2e7)
    assert again.wear_depth[0, -1] < 0.7 * test.wear_depth[-1]
    assert again.peak_friction_angle[0] < test.peak_friction_angle


def test_friction_falls_with_the_pressure(rough_crack):
    test = sheared(rough_crack, 5e-4, [1e6, 4e6, 1.6e7, 6.4e7])
    angles = test.peak_friction_angle.values
    assert (np.diff(angles) < -1).all()
    assert angles[-1] > FRICTION
    assert (np.diff(test.dilatancy.values[:, -1]) < 0).all()
    np.testing.assert_allclose(
        test.normal_stress, test.nominal_pressure.broadcast_like(test.normal_stress), rtol=2e-3
    )


def test_rigid_faces_come_to_the_sum_over_the_heights(make_face, rough):
    # all but rigid: the block rests on the highest sigma/H of the delta-surface, at its first step
    face = make_face(2e-5 * rough((32, 32), 7), 1e-4, periodic=True)
    crack = fc.joints.Crack(face, young=1e14, poisson=0.0, basic_friction_angle=0.0)
    cells = 128
    test = sheared(crack, 1e-4, 1e8 * cells / 1024, hardness=1e8).isel(nominal_pressure=0)
    delta = np.sort((np.roll(face.values, -1, axis=1) - face.values).ravel())[::-1]
    height, bearing = float(test.dilatancy[-1]), delta[:cells]
    assert delta[cells] <= height <= delta[cells - 1]
    # without friction the stress is pressure times the mean slope of what bears
    assert float(test.shear_stress[-1]) == pytest.approx(1e8 / 1024 * bearing.sum() / 1e-4, rel=1e-3)


def test_units_do_not_matter(rough_crack):
    scaled = fc.joints.Crack(
        rough_crack.lower.assign_coords(x=rough_crack.lower.x * 1e3, y=rough_crack.lower.y * 1e3) * 1e3,
        young=3e10 * 1e-6, poisson=0.2, block=2.4, basic_friction_angle=FRICTION,
    )  # fmt: skip
    one, other = sheared(rough_crack, 3e-4), sheared(scaled, 0.3, 5.0, hardness=200.0)
    for name, factor in (
        ("shear_stress", 1e-6),
        ("dilatancy", 1e3),
        ("wear_depth", 1e3),
        ("friction_angle", 1),
    ):
        np.testing.assert_allclose(other[name], factor * one[name], rtol=1e-4, atol=1e-9)


def test_directions_of_a_turned_face_agree(rough_crack):
    face = rough_crack.lower
    turned = face.copy(data=face.values.T.copy())
    crack = fc.joints.Crack(turned, young=3e10, poisson=0.2, block=24e-4, basic_friction_angle=FRICTION)
    east, north = sheared(rough_crack, 3e-4), sheared(crack, 3e-4, direction="N")
    np.testing.assert_allclose(north.shear_stress, east.shear_stress, rtol=1e-4)


def test_cycle_reverses_the_stress_and_wears_the_peak(rough_crack):
    test = sheared(rough_crack, [4e-4, -4e-4, 4e-4], 1e7).isel(nominal_pressure=0)
    assert test.shear.values[[0, 1, 5, 6, -1]].tolist() == pytest.approx([0, 0, 4e-4, 4e-4, 4e-4])
    stress = test.shear_stress.values
    assert stress[0] == 0
    assert stress[5] > 0 > stress[6]
    np.testing.assert_allclose(test.shear_displacement, test.shear + stress / float(test.shear_stiffness))
    first = stress[2:6].max()
    second = stress[-4:].max()
    assert 0 < second < first


def test_a_direction_that_is_rounded_stays_on_the_grid(make_face, rough):
    """It is off whole cells by less than 1e-6 a step, which adds up along the path."""
    crack = fc.joints.Crack(make_face(2e-5 * rough((40, 40), 5), 1e-4), young=3e10, poisson=0.2, block=8e-4)
    angle, path = np.degrees(np.arctan(0.5)), 8 * np.hypot(1, 2) * 1e-4
    exact, rounded = (sheared(crack, path, direction=azimuth) for azimuth in (angle, angle - 1e-5))
    np.testing.assert_allclose(rounded.shear_stress, exact.shear_stress, rtol=1e-5)


def test_a_stop_on_the_way_changes_nothing(rough_crack):
    straight = sheared(rough_crack, [4e-4, 0.0], 2e7)
    stopped = sheared(rough_crack, [1e-4, 4e-4, 3e-4, 0.0], 2e7)
    xr.testing.assert_identical(*(test.drop_attrs().drop_vars("run_time") for test in (stopped, straight)))
    assert end_of_first_leg(stopped) == end_of_first_leg(straight) == "400 µm"


@pytest.mark.parametrize("hardness", [1e24, 1e30])
def test_any_hardness_beyond_reach_means_no_wear(make_face, rough, hardness):
    """The load on the contacts falls as the block turns back, whatever the hardness."""
    face = make_face(5e-6 * rough((16, 16), 5), 1e-4, periodic=True)
    crack = fc.joints.Crack(face, face * 0.9, young=1e9, poisson=0.25, basic_friction_angle=FRICTION)
    hard = sheared(crack, [2e-4, 0], 2e6, hardness=hardness)
    assert (hard.wear_depth == 0).all()
    softer = sheared(crack, [2e-4, 0], 2e6, hardness=1e20)
    np.testing.assert_allclose(hard.shear_stress, softer.shear_stress, rtol=1e-9)


@pytest.mark.parametrize(
    ("young", "hardness", "locks"), [(3e10, 1e9, False), (1e18, 1e18, False), (1e22, 1e24, True)]
)
def test_normal_stress_is_met_on_slopes_that_lock(make_face, young, hardness, locks):
    """Flanks of slope 2, beyond 90 degrees less the friction angle: all but rigid ones lock the block."""
    x = np.arange(40) % 20
    steep = make_face(
        np.where(x < 5, 2.0 * x, (20 - x) * 2 / 3) * 1e-4 * np.ones((8, 1)), 1e-4, periodic=True
    )
    crack = fc.joints.Crack(steep, young=young, poisson=0.2, basic_friction_angle=FRICTION)
    with pytest.warns(SmallStrainWarning):
        test = sheared(crack, 3e-4, 1e6, hardness=hardness).isel(nominal_pressure=0)
    is_known = np.isfinite(test.normal_stress.values)
    assert is_known.tolist() == [True] + [not locks] * 4
    np.testing.assert_allclose(test.normal_stress.values[is_known], 1e6, rtol=1e-3)
    assert ("locks" in test.shear_stress.attrs.get("reason", "")) == locks


def test_a_distance_below_a_cell_is_one_cell(rough_crack):
    test = sheared(rough_crack, 4e-4, 1e6, distance=1e-5).isel(nominal_pressure=0)
    assert test.peak_distance == pytest.approx(1e-4)
    assert test.peak_shear_strength == pytest.approx(test.shear_stress.values.max(), rel=1e-9)
    assert test.residual_shear_strength == pytest.approx(test.shear_stress.values[-1], rel=1e-9)


def test_a_joint_that_locks_on_its_way_has_no_strength(make_face):
    """It slides on a flat face for four cells, and meets a wall of slope 3 that it cannot climb."""
    x = np.arange(60)
    lower = np.clip(x - 30, 0, 3) * 3e-4
    upper = np.where(x >= 28, 9e-4, 0.0)
    faces = (make_face(np.tile(face, (8, 1)), 1e-4, periodic=(True, False)) for face in (lower, upper))
    crack = fc.joints.Crack(*faces, young=1e22, poisson=0.2, block=(8e-4, 4e-3), basic_friction_angle=35)
    test = sheared(crack, 9e-4, 1e5, hardness=1e24).isel(nominal_pressure=0)
    assert np.isfinite(test.shear_stress.values).tolist() == [True] * 5 + [False] * 6
    for name in ("peak_shear_strength", "peak_friction_angle", "residual_shear_strength"):
        assert np.isnan(test[name])
        assert "locks" in test[name].attrs["reason"]
    before = sheared(crack, 3e-4, 1e5, hardness=1e24)
    np.testing.assert_allclose(before.peak_friction_angle, 35, rtol=1e-6)


def test_spring(rough_crack):
    stiffness = 1e11
    test = sheared(rough_crack, 4e-4, [1e6, 1e7], normal_stiffness=stiffness)
    expected = test.nominal_pressure + stiffness * test.dilatancy
    later = slice(2, None)  # the first points are those before and at the start
    np.testing.assert_allclose(test.normal_stress[:, later], expected[:, later], rtol=3e-3)
    free = sheared(rough_crack, 4e-4, [1e6, 1e7])
    assert (test.dilatancy[:, -1] < free.dilatancy[:, -1]).all()
    assert (test.shear_stress[:, -1] > free.shear_stress[:, -1]).all()


def test_smooth_faces_have_the_basic_friction(make_face):
    flat = make_face(np.zeros((12, 12)), 1e-3, periodic=True)
    crack = fc.joints.Crack(flat, young=3e10, poisson=0.2, basic_friction_angle=FRICTION)
    test = sheared(crack, 3e-3)
    np.testing.assert_allclose(test.friction_angle[0, 1:], FRICTION, rtol=1e-6)
    assert np.isnan(test.shear_stiffness).all()
    assert "compliance" in test.shear_stiffness.attrs["reason"]


def test_elastic_stiffness_of_the_shear_is_that_of_mindlin(rough_crack):
    test = sheared(rough_crack, 1e-4, 5e6, keep=("residual_lower", "residual_upper")).isel(nominal_pressure=0)
    worn = fc.joints.Crack(test.residual_lower, test.residual_upper, young=3e10, poisson=0.2, block=24e-4)
    closed = fc.joints.closure(worn, shear=1e-4, nominal_pressure=[2.5e6, 5e6]).interface_closure.values[0]
    normal = 2.5e6 / (closed[1] - closed[0])
    # 2 (1 - nu)/(2 - nu) = 8/9; the load on the contacts differs from the pressure by friction on the slope
    assert float(test.shear_stiffness) == pytest.approx(8 / 9 * normal, rel=0.4)
    given = sheared(rough_crack, 1e-4, 5e6, shear_stiffness=1e12)
    np.testing.assert_allclose(given.shear_displacement - given.shear, given.shear_stress / 1e12)


def test_slopes_beyond_small_strains_are_reported(make_face, rough):
    steep = fc.joints.Crack(make_face(1e-3 * rough((24, 24), 2), 1e-4), young=3e10, poisson=0.2, block=12e-4)
    with pytest.warns(SmallStrainWarning, match="direct_shear: the delta-surface"):
        sheared(steep, 1e-4)


def test_diagonal_path_stays_on_the_grid(rough_crack):
    step = 1e-4 * np.sqrt(2)
    test = sheared(rough_crack, 2 * step, direction="NE")
    np.testing.assert_allclose(test.shear, [0, 0, step, 2 * step])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"path": 1.5e-4}, "multiples of 0.0001 m"),
        ({"path": [1.5e-4, 0.0]}, r"got \[0.00015, 0.0\]$"),
        ({"path": 5e-3}, "edge of the face"),
        ({"path": [2e-4, 2e-4]}, "other than the one before"),
        ({"path": 0.0}, "other than the one before"),
        ({"pressure": 3e8}, "less than the hardness"),
        ({"hardness": 0.0}, "hardness"),
        ({"direction": 10.0}, "comes back onto the grid"),
        ({"keep": "gap"}, "residual_lower"),
    ],
)
def test_wrong_arguments_are_named(rough_crack, change, message):
    with pytest.raises(ValueError, match=message) as caught:
        sheared(rough_crack, **({"path": 1e-4} | change))
    assert len(caught.value.problems) == 1


def test_missing_heights_are_refused(make_face):
    face = make_face(np.zeros((12, 12)), 1e-3)
    face[0, 0] = np.nan
    crack = fc.joints.Crack(face, young=1e10, poisson=0.2, block=6e-3)
    with pytest.raises(ValueError, match="crack.lower.*fill"):
        sheared(crack, 1e-3)


def test_strength_over_a_distance_hardly_depends_on_the_spacing():
    fine = fc.surfaces.spectral((96, 96), 1e-4, hurst=0.8, rms_slope=0.35, long_cutoff=9.6e-3, rng=8)
    coarse = fine.isel(x=slice(None, None, 2), y=slice(None, None, 2)).drop_attrs()
    angles = []
    for face in (fine.drop_attrs(), coarse):
        for dim in ("x", "y"):
            face = face.assign_coords({dim: face[dim].drop_attrs()})
        crack = fc.joints.Crack(face, young=3e10, poisson=0.2, block=6e-3, basic_friction_angle=FRICTION)
        test = sheared(crack, 8e-4, 3e6, hardness=1e8, distance=8e-4)
        angles.append(float(test.peak_friction_angle[0]))
    # twice the spacing halves the number of steps and quarters the cells
    assert angles[1] == pytest.approx(angles[0], abs=2)
    assert min(angles) > FRICTION + 8


def test_a_result_of_one_pressure_is_that_of_several(rough_crack):
    several, one = sheared(rough_crack, 2e-4, [2e6, 1e7]), sheared(rough_crack, 2e-4, 1e7)
    xr.testing.assert_equal(several.shear_stress.isel(nominal_pressure=[1]), one.shear_stress)


@pytest.mark.slow
def test_measured_joint_is_near_the_criterion_of_barton_at_high_stress(measured):
    faces = []
    for side in "ab":
        scan = fc.surfaces.read(measured / f"freiberg_gneiss_side_{side}.npy", spacing=3e-4)
        faces.append(fc.surfaces.fill(fc.surfaces.despike(scan)))
    upper = fc.joints.register(*faces)["height"]
    crack = fc.joints.Crack(faces[0], upper, young=60e9, poisson=0.2, block=0.045, basic_friction_angle=30)
    test = fc.joints.direct_shear(crack, 1.8e-3, nominal_pressure=16e6, hardness=150e6)
    barton = fc.joints.strength_envelope(
        faces[0],
        nominal_pressure=16e6,
        wall_strength=150e6,
        basic_friction_angle=30,
        criterion="barton_choubey",
    )
    assert float(test.peak_friction_angle[0]) == pytest.approx(float(barton.friction_angle[0, 0]), abs=2)
