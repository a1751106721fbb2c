"""The crack: layout of the block, travel, validation."""

import pickle

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc

MATERIAL = {"young": 30e9, "poisson": 0.2}
E, NU = 30e9, 0.2


def test_profiles_are_refused(make_face):
    profile = xr.DataArray(np.zeros(9), dims="x", coords={"x": np.arange(9.0)}, attrs={"units": "m"})
    with pytest.raises(ValueError, match=r"lower.dims"):
        fc.joints.Crack(profile, young=E, poisson=NU)


@pytest.mark.parametrize(
    ("n", "edge", "cells", "start"), [(512, 0.02, 250, 131), (512, 0.02001, 250, 131), (9, 4e-4, 5, 2)]
)
def test_block_is_centred_on_whole_cells(make_face, n, edge, cells, start):
    crack = fc.joints.Crack(make_face(np.zeros((n, n)), 8e-5), block=edge, **MATERIAL)
    assert crack.layout.cells == (cells, cells)
    assert crack.layout.start == (start, start)
    assert crack.block == pytest.approx((cells * 8e-5,) * 2, rel=1e-12)
    assert crack.nominal_area == pytest.approx((cells * 8e-5) ** 2, rel=1e-12)


def test_block_edges_are_y_then_x(make_face):
    face = make_face(np.zeros((20, 30)), (2.0, 1.0))
    assert fc.joints.Crack(face, block=(10.0, 20.0), **MATERIAL).layout.cells == (5, 20)
    assert fc.joints.Crack(face, **MATERIAL).layout.cells == (20, 30)


def test_travel_of_the_paper_is_131_cells(make_face):
    crack = fc.joints.Crack(make_face(np.zeros((512, 512)), 8e-5), block=0.02, **MATERIAL)
    for direction in "ENWS":
        assert crack.travel(direction) == pytest.approx(131 * 8e-5, rel=1e-12)
    assert crack.travel("NE") == pytest.approx(131 * 8e-5 * np.sqrt(2), rel=1e-12)
    assert crack.travel(45) == crack.travel("NE") == crack.travel(405)


def test_odd_margin_gives_unequal_travel(make_face):
    crack = fc.joints.Crack(make_face(np.zeros((10, 10))), block=5, **MATERIAL)
    assert (crack.travel("E"), crack.travel("W")) == (3.0, 2.0)


def test_contact_modulus_of_two_equal_bodies(make_face):
    crack = fc.joints.Crack(make_face(np.zeros((4, 4))), young=30e9, poisson=0.2)
    assert crack.contact_modulus == pytest.approx(15.625e9, rel=1e-15)


def test_two_materials(make_face):
    """Concrete on rock by hand: .96/30 + .91/60 = .0471667 per GPa."""
    crack = fc.joints.Crack(make_face(np.zeros((4, 4))), young=(30e9, 60e9), poisson=(0.2, 0.3))
    assert crack.contact_modulus == pytest.approx(21.2014134e9, rel=1e-8)
    # stiffness in full stick over that under normal load (Mindlin): S = sum (2 - nu)/G, G = E/(2 (1 + nu))
    s = 1.8 * 2.4 / 30e9 + 1.7 * 2.6 / 60e9
    nu = crack.contact_poisson
    assert 2 * (1 - nu) / (2 - nu) == pytest.approx(4 / s / crack.contact_modulus, rel=1e-12)
    one = fc.joints.Crack(make_face(np.zeros((4, 4))), young=(30e9, 30e9), poisson=0.2)
    assert one.contact_modulus == pytest.approx(15.625e9, rel=1e-15)
    assert one.contact_poisson == pytest.approx(0.2, rel=1e-15)
    assert "young: 30 GPa (lower), 60 GPa (upper)" in repr(crack)
    assert "<td>30 GPa (lower), 60 GPa (upper)" in crack._repr_html_()
    with pytest.raises(ValueError, match=r"young: expected one value or \(lower, upper\)"):
        fc.joints.Crack(make_face(np.zeros((4, 4))), young=(1e9, 2e9, 3e9), poisson=0.2)


def test_rigid_faces_need_no_modulus(make_face):
    heights = 1e-5 * np.random.default_rng(1).normal(size=(12, 12))
    rigid = fc.joints.Crack(make_face(heights, 1e-3), block=6e-3)
    elastic = fc.joints.Crack(make_face(heights, 1e-3), young=30e9, poisson=0.2, block=6e-3)
    shear = [0.0, 1e-3]
    found, expected = (fc.joints.dilatancy(crack, shear=shear) for crack in (rigid, elastic))
    np.testing.assert_array_equal(found.rigid_dilatancy, expected.rigid_dilatancy)
    with pytest.raises(ValueError, match=r"crack.young: expected a value(.|\n)*crack.poisson"):
        fc.joints.closure(rigid, shear=1e-3, normal_force=1.0)


def test_incompressible_material_is_allowed(make_face):
    crack = fc.joints.Crack(make_face(np.zeros((4, 4))), young=3e6, poisson=0.5)
    assert crack.contact_modulus == pytest.approx(3e6 / (2 * (1 - 0.25)), rel=1e-15)
    with pytest.raises(ValueError, match=r"poisson: expected .* <= 0.5, got 0.51"):
        fc.joints.Crack(make_face(np.zeros((4, 4))), young=3e6, poisson=0.51)


def test_length_of_a_block_that_does_not_fit_is_reported_in_metres(make_face):
    with pytest.raises(ValueError, match=r"block: expected .* got 1 m \(1000 cells\)"):
        fc.joints.Crack(make_face(np.zeros((8, 8)), 1e-3), block=1, **MATERIAL)


def test_all_problems_are_reported_together(make_face):
    face = make_face(np.zeros((8, 8)))
    with pytest.raises(fc.base.errors.InvalidInput) as caught:
        fc.joints.Crack(
            face, make_face(np.zeros((7, 8))), young=-1, poisson=0.6, block=20.0, basic_friction_angle=95
        )
    text = str(caught.value)
    for word in ("young", "poisson", "block", "basic_friction_angle", "upper"):
        assert word in text


def test_missing_heights_refused_inside_the_block_only(make_face):
    heights = np.zeros((20, 20))
    heights[0, 0] = np.nan
    fc.joints.Crack(make_face(heights), block=10, **MATERIAL)
    heights[9, 9] = np.nan
    with pytest.raises(ValueError, match="lower inside the block.*fill"):
        fc.joints.Crack(make_face(heights), block=10, **MATERIAL)
    with pytest.raises(ValueError, match="upper inside the block.*fill"):
        fc.joints.Crack(make_face(np.zeros((20, 20))), make_face(heights), block=10, **MATERIAL)


def test_infinite_heights_are_refused(make_face):
    heights = np.zeros((20, 20))
    heights[0, 0] = -np.inf
    with pytest.raises(ValueError, match="infinite"):
        fc.joints.Crack(make_face(heights), block=10, **MATERIAL)


def test_upper_must_lie_on_the_same_grid(make_face):
    face = make_face(np.zeros((9, 9)))
    with pytest.raises(ValueError, match="upper.x"):
        fc.joints.Crack(face, make_face(np.zeros((9, 9)), origin=(0.0, 0.4)), **MATERIAL)


def test_crack_is_frozen_and_can_be_pickled(make_face, rough):
    crack = fc.joints.Crack(make_face(rough((16, 16), 0)), block=8, **MATERIAL)
    with pytest.raises(AttributeError):
        crack.young = 1.0
    twin = pickle.loads(pickle.dumps(crack))
    assert twin.layout == crack.layout
    assert twin.block == crack.block
    assert "block: 8 x 8 cells" in repr(crack)


def test_incompressible_bodies_deform(make_face, rough):
    """E/(1 - nu^2) alone counts in normal contact: nu = .5 and 3/4 E is nu = 0 and E."""
    face = make_face(1e-6 * rough((24, 24), 3), 1e-4)
    young = 1e10

    def crack(modulus, poisson):
        return fc.joints.Crack(face, young=modulus, poisson=poisson, block=1.2e-3)

    half, none = crack(0.75 * young, 0.5), crack(young, 0.0)
    options = {"shear": 2e-4, "direction": "E", "normal_force": [1.0, 10.0]}
    for function in (fc.joints.closure, fc.joints.dilatancy):
        results = [function(one, **options)["interface_closure"] for one in (half, none)]
        np.testing.assert_allclose(*results, rtol=1e-6)
    slipped = fc.joints.partial_slip(
        half, shear=2e-4, normal_force=10.0, tangential_force=[1.0, 2.0], friction_coefficient=0.6
    )
    assert bool(slipped["converged"].all())


def test_one_rigid_face(make_face, rough):
    face = make_face(1e-5 * rough((48, 48), 3), 1e-4)
    elastic = fc.joints.Crack(face, young=30e9, poisson=0.2, block=3.2e-3)
    for young in ((30e9, np.inf), (np.inf, 30e9)):
        joint = fc.joints.Crack(face, young=young, poisson=0.2, block=3.2e-3)
        assert joint.contact_modulus == pytest.approx(2 * elastic.contact_modulus, rel=1e-15)
        assert joint.contact_poisson == pytest.approx(0.2, rel=1e-15)
        assert "rigid" in repr(joint)
    # twice the stiffness: half the closure under the same force
    forces = [50.0, 100.0]
    half = fc.joints.closure(joint, shear=2e-4, normal_force=np.multiply(forces, 2))
    np.testing.assert_array_equal(
        half.closure, fc.joints.closure(elastic, shear=2e-4, normal_force=forces).closure
    )
    assert pickle.loads(pickle.dumps(joint)).young == (np.inf, 30e9)
    for young in (np.inf, (np.inf, np.inf)):
        with pytest.raises(ValueError, match="young: expected an elastic body"):
            fc.joints.Crack(face, young=young, poisson=0.2, block=3.2e-3)
    with pytest.raises(ValueError, match="young"):
        fc.joints.Crack(face, young=(-np.inf, 1e9), poisson=0.2, block=3.2e-3)


def test_directions_in_full_words():
    face = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.7, rms_increment=1e-6, rng=1)
    crack = fc.joints.Crack(face, block=1.6e-3)
    for word, letter in (("west", "W"), ("north", "N")):
        one, other = (fc.joints.dilatancy(crack, shear=[0.0, 2e-4], direction=d) for d in (word, letter))
        assert one.direction.values.tolist() == [letter]
        np.testing.assert_array_equal(one.rigid_dilatancy, other.rigid_dilatancy)
