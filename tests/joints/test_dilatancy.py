"""Dilatancy: rigid, under a normal force, and against a spring."""

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc

MATERIAL = {"young": 30e9, "poisson": 0.2}
E, NU = 30e9, 0.2


def slow_rigid(lower, upper, crack, shift):
    (ay, ax), (by, bx) = crack.layout.start, crack.layout.cells
    highest = -np.inf
    for i in range(ay, ay + by):
        for j in range(ax, ax + bx):
            highest = max(highest, lower[i + shift[0], j + shift[1]] - upper[i, j])
    return highest


def test_rigid_dilatancy_equals_a_slow_maximum(make_face, rough):
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
def test_rigid_dilatancy_of_a_sawtooth(make_face, angle):
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
def test_rigid_dilatancy_of_a_sinusoid(make_face, periodic):
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


def test_mean_slope_is_that_of_the_least_squares_plane(make_face, rough):
    heights = rough((24, 30), 3)
    heights[:4, :5] = np.nan
    face = make_face(heights, (2.0, 0.5))
    result = fc.joints.dilatancy(fc.joints.Crack(face, block=(20, 5), **MATERIAL), shear=0.0)
    y, x = np.meshgrid(face.y, face.x, indexing="ij")
    seen = np.isfinite(heights)
    design = np.stack([np.ones(seen.sum()), y[seen], x[seen]], axis=1)
    slopes = np.linalg.lstsq(design, heights[seen], rcond=None)[0][1:]
    np.testing.assert_allclose(result.mean_slope, [slopes[1], slopes[0], -slopes[1], -slopes[0]], rtol=1e-10)


def test_periodic_face_never_sinks(make_face, rough):
    crack = fc.joints.Crack(make_face(rough((32, 32), 4), periodic=True), **MATERIAL)
    result = fc.joints.dilatancy(crack, shear=np.arange(0, 32, 2.5), direction=(0, 33, "S"))
    assert (result.rigid_dilatancy >= 0).all()
    assert (result.mean_slope == 0).all()
    assert list(result.direction.values) == ["E", "33", "S"]


def test_no_dilatancy_at_zero_shear(make_face, rough):
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


def test_missing_heights_in_the_path_are_refused(make_face, rough):
    heights = rough((30, 30), 5)
    heights[15, 24] = np.nan
    crack = fc.joints.Crack(make_face(heights), block=10, **MATERIAL)
    fc.joints.dilatancy(crack, shear=[0, 4.0], direction=("E", "N"))
    with pytest.raises(ValueError, match=r"1 missing at a shear of 5 m towards E"):
        fc.joints.dilatancy(crack, shear=[0, 4.0, 5.0], direction="E")


def test_units_change_only_exponents(make_face, rough):
    heights = rough((20, 22), 7)
    crack = fc.joints.Crack(make_face(heights), block=10.0, **MATERIAL)
    scaled = fc.joints.Crack(make_face(heights * 2.0**40, 2.0**-20), block=10 * 2.0**-20, **MATERIAL)
    result = fc.joints.dilatancy(crack, shear=[0, 1, 2.5])
    result_scaled = fc.joints.dilatancy(scaled, shear=np.array([0, 1, 2.5]) * 2.0**-20)
    np.testing.assert_array_equal(result.rigid_dilatancy * 2.0**40, result_scaled.rigid_dilatancy.values)
    np.testing.assert_array_equal(result.plateau_dilatancy * 2.0**40, result_scaled.plateau_dilatancy.values)


def test_orderings_of_the_paper(crack):
    cells = np.array([1, 2, 4, 8, 14, 20])
    result = fc.joints.dilatancy(crack, shear=cells * 8e-5, normal_force=[100.0, 1e3, 3e3])
    over_directions = result.mean("direction")
    area = over_directions.contact_fraction.sel(step=2).values
    # the contact shrinks as the faces decorrelate, and then levels
    assert area[0] > area[1] > area[2] > area[3]
    assert area[5] > 0.6 * area[3]
    # the interface gets more compliant
    assert (np.diff(over_directions.interface_closure.sel(step=2)[:4]) > 0).all()
    # area and closure grow along the path, area nearly in proportion to the force
    assert (result.interface_closure.diff("step") > 0).all()
    assert (result.contact_fraction.diff("step") > 0).all()
    growth = np.log(
        over_directions.contact_fraction.sel(step=2) / over_directions.contact_fraction.sel(step=0)
    )
    assert (np.abs(growth / np.log(3e3 / 100) - 1) < 0.2).all()


def test_dilatancy_decreases_with_force(crack):
    shear = np.arange(0, 5) * 8e-5
    result = fc.joints.dilatancy(crack, shear=shear, direction=("E", "S"), normal_force=[10.0, 100.0, 1e3])
    lifted = result.rigid_dilatancy.expand_dims(step=1, axis=-1)
    curves = np.concatenate([lifted.values, result.dilatancy.values], axis=-1)
    assert (np.diff(curves[:, 1:], axis=-1) < 0).all()
    np.testing.assert_allclose(curves[:, 0], 0.0, atol=1e-20)
    assert result.dilatancy.dims == ("direction", "shear", "step")
    assert result.normal_force.dims == ("step",)
    np.testing.assert_allclose(result.nominal_pressure * crack.nominal_area, result.normal_force, rtol=1e-12)


def test_dilatancy_and_closure_agree(crack):
    both = {"shear": [8e-5, 2e-4], "normal_force": [10.0, 1e3]}
    opening = fc.joints.dilatancy(crack, direction="S", keep=("state",), **both)
    closing = fc.joints.closure(crack, direction="S", keep=("state",), **both)
    expected = opening.rigid_dilatancy.values[0][:, None] - closing.interface_closure.values
    np.testing.assert_array_equal(opening.dilatancy[0], expected)
    np.testing.assert_array_equal(opening.state[0], closing.state)
    assert opening.state.dims == ("direction", "shear", "step", "y", "x")
    assert opening.state.dtype == np.int8


def test_what_the_closure_has_pressed_is_not_pressed_again(crack):
    closing = fc.joints.closure(crack, shear=[8e-5, 2e-4], direction="S", normal_force=[10.0, 100.0, 1e3])
    both = {"shear": [0.0, 8e-5, 2e-4], "direction": ["S", "E"], "normal_force": [10.0, 1e3]}
    alone = fc.joints.dilatancy(crack, **both)
    shared = fc.joints.dilatancy(crack, pressed=closing, **both)
    towards = {"shear": [8e-5, 2e-4], "direction": "S"}
    held = closing.interface_closure.isel(step=[0, 2])
    np.testing.assert_array_equal(shared.interface_closure.sel(towards), held)
    np.testing.assert_array_equal(shared.sel(direction="E").dilatancy, alone.sel(direction="E").dilatancy)
    np.testing.assert_allclose(shared.dilatancy, alone.dilatancy, rtol=1e-6, atol=1e-15)
    assert shared.sizes == alone.sizes
    assert set(shared.variables) == set(alone.variables)
    marked = closing.copy()
    marked["interface_closure"] = closing.interface_closure + 1.0
    taken = fc.joints.dilatancy(crack, pressed=marked, **both).interface_closure > 0.5
    assert taken.sel(towards).all()
    assert taken.sum() == 4  # not shear 0 towards S, nor what is towards E
    other = both | {"normal_force": [20.0]}  # a force it does not hold
    assert not (fc.joints.dilatancy(crack, pressed=marked, **other).interface_closure > 0.5).any()


def test_closure_with_a_hardness_is_shared_along_the_same_path_alone(crack):
    path = {"normal_force": [10.0, 100.0, 1e3], "hardness": 1e9}
    closing = fc.joints.closure(crack, shear=[8e-5], direction="S", **path)
    assert closing.plastic_work[0, -1] > 0
    given = {"shear": [8e-5], "direction": "S"}
    alone = fc.joints.dilatancy(crack, **given, **path)
    marked = closing.assign(interface_closure=closing.interface_closure + 1.0)
    shared = fc.joints.dilatancy(crack, pressed=marked, **given, **path)
    np.testing.assert_allclose(shared.interface_closure, alone.interface_closure + 1.0, rtol=1e-12)
    np.testing.assert_allclose(shared.plastic_work, alone.plastic_work, rtol=1e-12)
    start, other = ({**path, "normal_force": forces} for forces in ([10.0, 100.0], [10.0, 1e3]))
    assert (fc.joints.dilatancy(crack, pressed=marked, **given, **start).interface_closure > 0.5).all()
    assert (fc.joints.dilatancy(crack, pressed=marked, **given, **other).interface_closure < 0.5).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tolerance": 1e-6}, "one with another tolerance"),
        ({"bulk": "uniform_pressure"}, "one with another bulk"),
        ({"keep": ("state",)}, "nothing beside `keep`"),
        ({"normal_stiffness": 1e9}, "nothing beside `normal_stiffness`"),
        ({"hardness": 1e9}, "one with another hardness"),
        ({"pressed": xr.Dataset()}, "a result of `joints.closure`"),
        ({"pressed": 3.0}, "a result of `joints.closure`"),
        ({"normal_force": None}, "nothing without a force"),
    ],
)
def test_another_closure_is_refused(crack, change, message):
    given = {"shear": [8e-5], "direction": "S", "normal_force": [10.0]}
    closing = fc.joints.closure(crack, **given)
    with pytest.raises(ValueError, match=message):
        fc.joints.dilatancy(crack, **{"pressed": closing, **given, **change})


@pytest.mark.parametrize("lazy", [False, True])
def test_closure_of_another_crack_is_refused(crack, lazy):
    given = {"shear": [8e-5], "direction": "S", "normal_force": [10.0]}
    faces = [factor * crack.lower for factor in (1, 2)]
    if lazy:
        pytest.importorskip("dask")
        faces = [face.chunk() for face in faces]
    own, other = (fc.joints.Crack(face, young=E, poisson=NU, block=crack.block) for face in faces)
    assert fc.joints.dilatancy(own, pressed=fc.joints.closure(own, **given), **given).sizes["shear"] == 1
    with pytest.raises(ValueError, match="one with another crack"):
        fc.joints.dilatancy(own, pressed=fc.joints.closure(other, **given), **given)


def test_unmated_faces(make_face, rough):
    lower = 1e-5 * rough((40, 40), 1)
    upper = lower + 3e-6 * rough((40, 40), 2)
    crack = fc.joints.Crack(make_face(lower, 1e-4), make_face(upper, 1e-4), young=E, poisson=NU, block=2e-3)
    result = fc.joints.dilatancy(crack, shear=[0.0, 1e-4], direction="E", normal_force=[10.0])
    inside = crack.layout.slices
    assert result.initial_offset == pytest.approx((lower - upper)[inside].max())
    assert (result.rigid_dilatancy.sel(shear=0) == 0).all()
    assert (result.interface_closure.sel(shear=0) > 0).all()
    np.testing.assert_array_equal(result.dilatancy.sel(shear=0), -result.interface_closure.sel(shear=0))


def test_round_trip_through_a_file(crack, tmp_path):
    result = fc.joints.dilatancy(
        crack, shear=[0.0, 8e-5], normal_force=[10.0, 1e3], direction="E", keep=("state",)
    )
    fc.save(result, tmp_path / "dilatancy.nc")
    back = fc.open(tmp_path / "dilatancy.nc")
    for name, variable in result.variables.items():
        np.testing.assert_array_equal(back[name].values, variable.values)
        assert back[name].attrs.get("units") == variable.attrs.get("units")


@pytest.mark.parametrize(("shape", "spacing", "block"), [((41, 57), (8e-5, 5e-5), (1.2e-3, 1.4e-3))])
def test_unequal_spacings_and_rectangular_blocks(make_face, rough, shape, spacing, block):
    crack = fc.joints.Crack(make_face(2e-5 * rough(shape, 7), spacing), young=E, poisson=NU, block=block)
    opening = fc.joints.dilatancy(crack, shear=[0.0, 1e-4, 4e-4], direction=("N", 200), normal_force=[1, 50])
    np.testing.assert_allclose(opening.dilatancy.sel(shear=0.0), 0.0, atol=1e-18)
    assert (opening.dilatancy[:, 1:] < opening.rigid_dilatancy[:, 1:]).all()
    assert (opening.dilatancy[:, 1:, 0] > opening.dilatancy[:, 1:, 1]).all()
    closing = fc.joints.closure(crack, shear=0.0, normal_force=[10.0])
    assert abs(closing.interface_closure.item()) <= 1e-15 * closing.closure.item()
    assert closing.contact_fraction.item() == 1


@pytest.fixture(scope="module")
def spring_crack(make_face, rough):
    heights = 2e-5 * rough((64, 64), 8)
    return fc.joints.Crack(make_face(heights, 8e-5), young=3e10, poisson=0.2, block=32 * 8e-5)


def test_force_balances_the_spring(spring_crack):
    k, shear = 1e11, np.arange(5) * 8e-5
    result = fc.joints.dilatancy(
        spring_crack, shear=shear, direction="E", normal_force=[20.0, 200.0], normal_stiffness=k
    )
    opened = result.dilatancy - result.dilatancy.sel(shear=0.0)
    expected = [20.0, 200.0] + k * spring_crack.nominal_area * opened
    np.testing.assert_allclose(result.normal_force, expected, rtol=3e-6)
    np.testing.assert_allclose(result.initial_force, [20.0, 200.0])
    # the state is that of the same force held constant
    force = float(result.normal_force[0, 3, 0])
    alone = fc.joints.dilatancy(spring_crack, shear=shear[3], direction="E", normal_force=force)
    assert alone.dilatancy.item() == pytest.approx(float(result.dilatancy[0, 3, 0]), abs=1e-12)


def test_stiffer_spring_opens_less(spring_crack):
    options = {"shear": [0.0, 8e-5, 4e-4], "direction": "E", "normal_force": 20.0}
    constant = fc.joints.dilatancy(spring_crack, **options).dilatancy.values[0, :, 0]
    soft, stiff, rigid = (
        fc.joints.dilatancy(spring_crack, normal_stiffness=k, **options).dilatancy.values[0, :, 0]
        for k in (1e3, 1e11, 1e17)
    )
    np.testing.assert_allclose(soft, constant, atol=1e-12)
    assert (stiff[1:] < constant[1:]).all()
    # in full contact a stiffer spring closes the faces no further
    assert (rigid[1:] < stiff[1:]).all()
    assert (rigid[1:] > 0).all()


def test_falling_plane_loses_its_force(make_face):
    x = np.arange(60) * 8e-5
    face = make_face(np.broadcast_to(0.1 * x, (20, 60)), 8e-5)
    crack = fc.joints.Crack(face, block=(10 * 8e-5, 20 * 8e-5), young=3e10, poisson=0.2)
    result = fc.joints.dilatancy(
        crack, shear=[0.0, 8e-5, 8e-4], direction="W", normal_force=1.0, normal_stiffness=1e10
    )
    exact = np.maximum(1.0 - 1e10 * crack.nominal_area * 0.1 * np.array([0.0, 8e-5, 8e-4]), 0.0)
    np.testing.assert_allclose(result.normal_force.values[0, :, 0], exact, rtol=1e-6)


@pytest.mark.parametrize("stiffness", [1e10, 1e20])
def test_spring_without_a_first_force_is_one_with_a_small_one(stiffness):
    face = fc.surfaces.fbm((60, 60), 1e-4, hurst=0.8, rms_increment=5e-6, rng=1)
    crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=4e-3)
    options = {"shear": [1e-4, 3e-4], "direction": "E", "normal_stiffness": stiffness}
    none, small = (fc.joints.dilatancy(crack, normal_force=n, **options) for n in (0.0, 1e-6))
    np.testing.assert_allclose(none["normal_force"], small["normal_force"], rtol=1e-6, atol=2e-6)


def test_spring_beyond_the_faces_is_refused(spring_crack):
    """The force that this spring would need bends the block by more than its digits leave of the faces.

    At 1e28 N/m3 it had a dilatancy that was a tenth too small, at 1e30 one of -40 um or an error, as rounding
    of the processor decided.
    """
    stiff = fc.joints.dilatancy(
        spring_crack, shear=3e-4, direction="E", normal_force=1.0, normal_stiffness=1e20
    )
    assert float(stiff["dilatancy"].squeeze()) == pytest.approx(1.542e-6, rel=1e-3)
    for stiffness in (1e28, 1e30, 1e35):
        with pytest.raises(
            ValueError, match=r"normal_stiffness: .* the faces can balance \(at a shear of 0.0003"
        ):
            fc.joints.dilatancy(
                spring_crack, shear=3e-4, direction="E", normal_force=1.0, normal_stiffness=stiffness
            )


def test_spring_needs_a_force(spring_crack):
    with pytest.raises(ValueError, match="normal_stiffness: expected nothing without a force"):
        fc.joints.dilatancy(spring_crack, shear=0.0, normal_stiffness=1.0)
    with pytest.raises(ValueError, match="normal_stiffness"):
        fc.joints.dilatancy(spring_crack, shear=0.0, normal_force=1.0, normal_stiffness=-1.0)
