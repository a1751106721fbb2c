"""Closure: limits that are exact, orderings of the paper, agreement with `press`."""

import warnings

import numpy as np
import pytest

import fractalcontact as fc
from fractalcontact.base.errors import SmallStrainWarning
from fractalcontact.base.study import provenance_of

E, NU = 30e9, 0.2
MODULUS = 15.625e9
FORCES = [1.0, 10.0, 100.0, 1e3]


@pytest.mark.parametrize("options", [{}, {"influence": "square"}, {"disc_radius": "inscribed"}])
def test_mated_faces_have_no_interface_closure(crack, options):
    result = fc.joints.closure(crack, shear=0.0, normal_force=[0.0, *FORCES, 7.0], **options)
    np.testing.assert_allclose(result.interface_closure, 0.0, atol=1e-15 * float(result.closure.max()))
    np.testing.assert_array_equal(result.contact_fraction[0, 1:], 1.0)
    by_closure = fc.joints.closure(crack, shear=0.0, closure=[1e-6, 3e-6], **options)
    np.testing.assert_allclose(by_closure.interface_closure / by_closure.closure, 0.0, atol=1e-15)


def test_bulk_closure_of_a_square(crack):
    result = fc.joints.closure(crack, shear=0.0, normal_force=[1e3])
    edge = crack.block[0]
    assert result.bulk_closure.item() == pytest.approx(1e3 / (1.15230 * MODULUS * edge), rel=0.02)
    assert "flat block" in result.bulk_closure.attrs["comment"]
    uniform = fc.joints.closure(crack, shear=0.0, normal_force=[1e3], bulk="uniform_pressure")
    assert uniform.bulk_closure / result.bulk_closure == pytest.approx(0.946402 * 1.15230, rel=0.01)
    assert "uniformly" in uniform.bulk_closure.attrs["comment"]


def test_closure_equals_pressing_the_delta_surface(crack):
    shears = [0.0, 8e-5, 2e-4]
    result = fc.joints.closure(
        crack, shear=shears, direction="N", nominal_pressure=[1e5, 1e7], keep=("state", "gap")
    )
    stiffness = fc.contact.flat_stiffness((48, 48), 8e-5, contact_modulus=MODULUS)
    for shear in shears[1:]:
        delta = fc.joints.delta_surface(crack, shear, "N")
        alone = fc.contact.press(
            delta, contact_modulus=MODULUS, nominal_pressure=[1e5, 1e7], keep=("state", "gap")
        )
        at = result.sel(shear=shear)
        for name in ("closure", "normal_force", "contact_fraction", "state", "gap"):
            np.testing.assert_array_equal(at[name], alone[name])
        np.testing.assert_allclose(
            at.interface_closure, alone.closure - alone.normal_force / stiffness, rtol=1e-9
        )
    np.testing.assert_allclose(result.normal_force / result.nominal_pressure, crack.nominal_area, rtol=1e-12)


def test_closure_and_force_control_give_the_same_law(crack):
    by_force = fc.joints.closure(crack, shear=1.6e-4, normal_force=FORCES, tolerance=1e-11)
    path = by_force.closure.values[0]
    by_closure = fc.joints.closure(crack, shear=1.6e-4, closure=path, tolerance=1e-11)
    np.testing.assert_allclose(by_closure.normal_force[0], FORCES, rtol=1e-6)
    np.testing.assert_array_equal(by_closure.contact_fraction, by_force.contact_fraction)


def test_modulus_and_force_scale_together(crack):
    stiff = fc.joints.Crack(crack.lower, young=4 * E, poisson=NU, block=crack.block)
    soft = fc.joints.closure(crack, shear=1.6e-4, normal_force=FORCES)
    hard = fc.joints.closure(stiff, shear=1.6e-4, normal_force=4 * np.array(FORCES))
    np.testing.assert_array_equal(soft.closure, hard.closure)
    np.testing.assert_array_equal(soft.interface_closure, hard.interface_closure)


def test_periodic_faces_have_no_bulk_part(make_face, rough):
    crack = fc.joints.Crack(make_face(1e-5 * rough((32, 32), 3), 1e-4, periodic=True), young=E, poisson=NU)
    result = fc.joints.closure(crack, shear=[0.0, 2e-4, 5e-3], nominal_pressure=[1e5, 1e6])
    assert (result.bulk_closure == 0).all()
    assert (result.interface_closure.sel(shear=0) == 0).all()
    delta = fc.joints.delta_surface(crack, 5e-3)
    alone = fc.contact.press(delta, contact_modulus=MODULUS, nominal_pressure=[1e5, 1e6])
    np.testing.assert_array_equal(result.closure.sel(shear=5e-3), alone.closure)


def test_block_periodic_along_one_axis_is_pressed_as_free(make_face, rough):
    face = make_face(1e-5 * rough((32, 32), 3), 1e-4, periodic=(False, True))
    crack = fc.joints.Crack(face, young=E, poisson=NU, block=(1.6e-3, 3.2e-3))
    result = fc.joints.closure(crack, shear=[4e-3], direction="E", normal_force=[10.0])
    assert result.bulk_closure.item() > 0
    assert result.converged.all()


def test_hardness_limits_the_pressure(crack):
    soft = fc.joints.closure(
        crack, shear=1.6e-4, normal_force=[1e3], hardness=2e9, keep=("pressure", "state")
    )
    hard = fc.joints.closure(crack, shear=1.6e-4, normal_force=[1e3], keep=("pressure",))
    assert soft.pressure.max() <= 2e9 * (1 + 1e-12) < hard.pressure.max()
    assert (soft.state == 2).any()
    assert soft.contact_fraction > hard.contact_fraction


def test_elastic_unloading_retraces_the_loading(crack):
    result = fc.joints.closure(crack, shear=1.6e-4, normal_force=[10.0, 1e3, 10.0], tolerance=1e-11)
    np.testing.assert_allclose(result.closure[0, 2], result.closure[0, 0], rtol=1e-6)
    assert result.step.values.tolist() == [0, 1, 2]


def test_invalid_arguments_are_refused_together(crack):
    with pytest.raises(ValueError, match="exactly one"):
        fc.joints.closure(crack, shear=0.0)
    with pytest.raises(ValueError, match="exactly one"):
        fc.joints.closure(crack, shear=0.0, closure=1e-6, normal_force=1.0)
    with pytest.raises(ValueError, match=r"(?s)shear.*normal_force.*keep.*bulk") as caught:
        fc.joints.closure(crack, shear=-1.0, normal_force=[-2.0], keep=("stat",), bulk="none")
    assert len(caught.value.problems) == 4
    with pytest.raises(ValueError, match="keep: expected nothing without a force"):
        fc.joints.dilatancy(crack, shear=0.0, keep=("state",))
    with pytest.raises(ValueError, match=r"(?s)bulk: .*hardness: .*method: expected nothing") as caught:
        fc.joints.dilatancy(crack, shear=0.0, method="fats", hardness=-1.0, bulk="none")
    assert len(caught.value.problems) == 3


def test_invalid_solver_options_are_refused(crack):
    options = {"tolerance": -1, "hardness": 0.0, "influence": "disk", "method": "slow"}
    for function in (fc.joints.closure, fc.joints.dilatancy):
        with pytest.raises(ValueError, match="(?s)influence.*hardness.*tolerance.*method") as caught:
            function(crack, shear=0.0, normal_force=1.0, **options)
        assert caught.value.where == f"fractalcontact.joints.{function.__name__}"
        assert len(caught.value.problems) == 4


def test_load_above_the_hardness_is_refused(crack):
    most = 1e9 * crack.nominal_area
    for options in ({"normal_force": 1.01 * most}, {"nominal_pressure": 1.01e9}):
        with pytest.raises(ValueError, match="at most (the hardness, 1e[+]09 Pa|hardness times area)"):
            fc.joints.closure(crack, shear=8e-5, hardness=1e9, **options)
    full = fc.joints.closure(crack, shear=8e-5, hardness=1e9, nominal_pressure=0.99e9, keep=("state",))
    assert (full.state == 2).mean() > 0.8


def test_zero_force_gives_no_contact(crack):
    result = fc.joints.closure(crack, shear=[0.0, 8e-5], normal_force=[0.0, 1.0], keep=("gap",))
    zero = result.isel(step=0)
    for name in ("closure", "interface_closure", "contact_fraction", "normal_force"):
        assert (zero[name] == 0).all(), name
    assert (zero.gap >= 0).all()


def test_closure_is_linear_beyond_full_contact(make_face, rough):
    crack = fc.joints.Crack(make_face(1e-7 * rough((32, 32), 3), 8e-5), young=E, poisson=NU, block=16 * 8e-5)
    result = fc.joints.closure(crack, shear=8e-5, normal_force=[1e5, 2e5, 3e5])
    assert (result.contact_fraction == 1).all()
    w = result.closure.values[0]
    assert (w[2] - w[1]) / (w[1] - w[0]) == pytest.approx(1.0, rel=1e-6)
    # the interface closure is then the constant elastic flattening of the relief
    np.testing.assert_allclose(result.interface_closure[0], result.interface_closure[0, 0], rtol=1e-4)


def test_undetermined_force_of_mated_periodic_faces(make_face, rough):
    crack = fc.joints.Crack(make_face(1e-6 * rough((32, 32), 3), 8e-5, periodic=True), young=E, poisson=NU)
    with pytest.warns(UserWarning, match=r"shear 0, step 1: beyond_full_contact"):
        result = fc.joints.closure(crack, shear=[0.0, 8e-5, 8e-4], closure=[0.0, 1e-7])
    assert result.normal_force.values[0, 0] == 0
    assert np.isnan(result.normal_force.values[0, 1])
    assert np.isfinite(result.normal_force.values[1:]).all()
    assert "mean plane" in result.normal_force.attrs["reason"]
    assert result.interface_closure.values[0, 1] == pytest.approx(1e-7)
    # under force control the same faces are in full contact and do not close
    forced = fc.joints.closure(crack, shear=[0.0, 8e-5], normal_force=[1.0])
    assert forced.contact_fraction.values[0, 0] == 1
    assert forced.interface_closure.values[0, 0] == 0


def test_yielding_joint_unloads_stiffer(crack):
    path = [1.0, 10.0, 100.0, 400.0, 100.0, 10.0, 1.0]
    options = {"shear": 1.6e-4, "tolerance": 1e-10}
    soft = fc.joints.closure(crack, normal_force=path, hardness=2e9, keep=("residual_height",), **options)
    elastic = fc.joints.closure(crack, normal_force=path, **options)
    loading, unloading = soft.interface_closure.values[0, :4], soft.interface_closure.values[0, :2:-1]
    assert (unloading[:3] > loading[:3] * 1.01).all()
    np.testing.assert_allclose(
        elastic.interface_closure[0, 4:], elastic.interface_closure[0, 2::-1], rtol=1e-5
    )
    assert soft.plastic_work.values[0, 3] > 0
    np.testing.assert_array_equal(soft.plastic_work[0, 4:], soft.plastic_work[0, 3])
    laws = fc.joints.closure_laws(soft).stiffness.values[0]
    assert (laws[4:] > laws[2::-1]).all()
    assert (soft.residual_height[0, -1] <= soft.residual_height[0, 0] + 1e-18).all()


def test_directions_are_independent(crack):
    both = fc.joints.closure(crack, shear=[8e-5, 1e-4], direction=["W", 30], normal_force=[10.0, 50.0])
    assert both.closure.dims == ("direction", "shear", "step")
    alone = fc.joints.closure(crack, shear=1e-4, direction=30, normal_force=[10.0, 50.0])
    np.testing.assert_array_equal(both.closure.sel(direction="30", shear=1e-4), alone.closure[0])
    assert both.interpolation_error.sel(direction="W", shear=8e-5) == 0
    assert both.interpolation_error.sel(direction="30", shear=1e-4) > 0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_closure_does_not_depend_on_the_starting_point(make_face, rough, seed):
    crack = fc.joints.Crack(
        make_face(1e-5 * rough((64, 64), seed), 8e-5), young=E, poisson=NU, block=40 * 8e-5
    )
    forces = np.array([5.0, 50.0, 500.0])
    options = {"shear": [8e-5, 4e-4], "tolerance": 1e-11}
    along = fc.joints.closure(crack, normal_force=forces, **options)
    down = fc.joints.closure(crack, normal_force=forces[::-1], **options)
    for i, force in enumerate(forces):
        alone = fc.joints.closure(crack, normal_force=force, **options).closure.values[:, 0]
        np.testing.assert_allclose(along.closure[:, i], alone, rtol=1e-9)
        np.testing.assert_allclose(down.closure[:, 2 - i], alone, rtol=1e-9)


def test_steep_delta_surfaces_warn_once():
    face = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.5, rms_increment=5e-5, rng=1)
    crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=16e-4)
    for call in (fc.joints.closure, fc.joints.dilatancy):
        with pytest.warns(SmallStrainWarning) as caught:
            result = call(crack, shear=[1e-4, 2e-4, 4e-4], normal_force=[1.0], direction=["E", "W"])
        assert len(caught) == 1
        delta = fc.joints.delta_surface(crack, 4e-4, "W").values
        square = sum(np.mean((np.diff(delta, axis=axis) / 1e-4) ** 2) for axis in (0, 1))
        assert float(result.rms_slope.sel(direction="W", shear=4e-4)) == pytest.approx(np.sqrt(square))
        assert f"up to {float(result.rms_slope.max()):.2g}" in str(caught[0].message)


def test_mated_faces_have_no_slope_and_no_warning():
    face = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.5, rms_increment=5e-5, rng=1)
    crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=16e-4)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert fc.joints.closure(crack, shear=0.0, normal_force=1.0).rms_slope.item() == 0


@pytest.mark.parametrize("load", ["closure", "normal_force", "nominal_pressure"])
def test_a_prescribed_load_can_be_selected(crack, tmp_path, load):
    values = {"closure": 1e-5, "normal_force": 300.0, "nominal_pressure": 1e6 / 7}
    path = values[load] * np.array([1.0, 2.0, 1.0])
    result = fc.joints.closure(crack, shear=[0.0, 8e-5], **{load: path})
    assert result[load].dims == ("step",)
    for stored in (result, fc.open(fc.save(result, tmp_path / "closure.nc"))):
        chosen = stored.sel(**{load: path[1]})
        np.testing.assert_array_equal(chosen.interface_closure, result.interface_closure[:, 1])
        assert stored.sel(**{load: path[0]}, shear=8e-5).step.values.tolist() == [0, 2]  # loaded and unloaded
    assert "state" in result  # as `press` returns by default
    slid = fc.joints.dilatancy(crack, shear=[0.0, 8e-5], direction="E", normal_force=[10.0, 300.0])
    np.testing.assert_array_equal(slid.dilatancy.sel(normal_force=300), slid.dilatancy[..., 1])


def test_provenance_names_the_solver_of_the_steps():
    face = fc.surfaces.fbm((48, 48), 1e-4, hurst=0.8, rms_increment=4e-6, rng=1)
    crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=2.4e-3)
    loads = {"shear": [0.0, 4e-4], "normal_force": [1.0, 10.0]}
    pressed = fc.joints.closure(crack, **loads)
    assert provenance_of(pressed)["solver"] == "closed_form (2 steps), node_pairs (2 steps)"  # mated, sheared
    dense = fc.joints.closure(crack, **loads, method="elimination")
    assert provenance_of(dense)["solver"] == "closed_form (2 steps), elimination (2 steps)"
    opened = fc.joints.dilatancy(crack, direction="E", pressed=pressed, **loads)
    assert provenance_of(opened)["solver"] == "as pressed (4 steps)"


def test_a_load_out_of_proportion_names_the_shear(crack):
    with pytest.raises(ValueError, match=r"(?s)joints\.closure.*a double.*at a shear of 0 m towards N"):
        fc.joints.closure(crack, shear=0.0, direction="N", normal_force=1e200)
