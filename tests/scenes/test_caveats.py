"""Caveats below the summary: each appears where it holds, and only there."""

import json
import warnings

import numpy as np
import pytest
import xarray as xr
from study import SOUND

import fractalcontact as fc
from fractalcontact.base.errors import InvalidInput, SmallStrainWarning

PERIODIC = fc.surfaces.spectral(
    (128, 128), 1e-5, hurst=0.8, rolloff=3e-4, short_cutoff=1e-4, rms_slope=0.05, rng=1
)
GRID_NOISE = fc.surfaces.spectral((64, 64), 1e-5, hurst=0.3, rms_slope=0.2, rng=1)


def study(pressed, path="contact", **material):
    """Return the tree of a study with one pressed group."""
    tree = xr.DataTree.from_dict({path: pressed})
    tree.attrs["provenance"] = json.dumps({"parameters": {"scene": {"material": material}}})
    return tree


def text(tree):
    return " ".join(fc.scenes.summary(tree).split())


@pytest.fixture(scope="module")
def rough():
    return fc.contact.press(GRID_NOISE, contact_modulus=1e9, nominal_pressure=[1e5, 1e6, 1e7])


@pytest.fixture(scope="module")
def smooth():
    return fc.contact.press(PERIODIC, contact_modulus=1e9, nominal_pressure=[5e6, 2e7])


def test_unresolved_spots_at_every_load(rough):
    cells = fc.domains.islands(rough.state.isel(step=-1)).cells
    assert "not resolved at any load" in text(study(rough))
    assert f"(median island {float(np.median(cells)):.2g} cells, 30 needed)" in text(study(rough))
    excess = float((rough.contact_fraction / rough.corrected_contact_fraction).max() - 1)
    assert f"counted areas are up to {100 * excess:.2g} % above the corrected ones" in text(study(rough))


def test_many_small_spots_are_not_resolved_by_their_sum(rough):
    assert (rough.state.values[-1] > 0).sum() > 300
    assert "not resolved" in text(study(rough.isel(step=[-1])))


def test_resolved_spots_have_no_caveat(smooth):
    assert np.median(fc.domains.islands(smooth.state.isel(step=0)).cells) > 30
    assert "not resolved" not in text(study(smooth))


@pytest.mark.parametrize("shift", [0, 16])
def test_a_contact_across_a_periodic_edge_is_one_island(shift):
    """One bump has 73 cells in contact: cut by the edges its four parts have 13 to 24 each."""
    y, x = np.mgrid[:32, :32] - 16.0
    bump = np.roll(-1e-8 * np.minimum(x**2 + y**2, 200.0), (shift, shift), (0, 1))
    surface = fc.surfaces.from_array(bump, 1e-5, periodic=True)
    pressed = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=3e5)
    assert float(fc.domains.islands(pressed.state).cells.max()) > 30
    assert "not resolved" not in text(study(pressed))


def test_resolution_is_stated_without_the_maps(rough, smooth):
    assert "not resolved at any load" in text(study(rough.drop_vars("state")))
    assert "from their perimeter" in text(study(rough.drop_vars("state")))
    assert "not resolved" not in text(study(smooth.drop_vars("state")))


def test_yield_pressure_of_the_stated_material_is_used(rough):
    true = rough.nominal_pressure / rough.contact_fraction / 1e9
    caveats = text(study(rough, yield_pressure=[1e6, 2e7]))
    assert f"true mean pressure is {float(true.min()):.3g} to {float(true.max()):.3g} GPa" in caveats
    assert "yields at 0.001 to 0.02 GPa" in caveats
    assert "concrete" not in caveats


def test_yield_makes_areas_and_closures_greater(rough):
    hard = fc.contact.press(GRID_NOISE, contact_modulus=1e9, nominal_pressure=[1e5, 1e6, 1e7], hardness=2e7)
    assert (hard.contact_fraction > 1.4 * rough.contact_fraction).all()
    assert (hard.closure > 1.2 * rough.closure).all()
    assert "and so are closures under a load" in text(study(rough, yield_pressure=2e7))
    assert "closures under a load" not in text(study(hard, yield_pressure=2e7))


def test_factor_of_yield_is_not_rounded_to_one(rough):
    highest = float((rough.nominal_pressure / rough.contact_fraction).max())
    assert "too small, by a factor of up to 1.03, and" in text(study(rough, yield_pressure=highest / 1.03))
    assert "yields" not in text(study(rough, yield_pressure=highest * (1 - 1e-12)))


def test_states_with_large_islands_are_not_counted_as_unresolved():
    """A mated joint that was not sheared touches everywhere, in one island; sheared in a few cells."""
    crack = fc.joints.Crack(GRID_NOISE, young=1e9, poisson=0.2, block=3.2e-4)
    pressed = fc.joints.closure(crack, shear=[0.0, 1e-4], nominal_pressure=[1e4, 1e5], keep=["state"])
    cells = [np.median(fc.domains.islands(state).cells) for state in pressed.state.values[1] > 0]
    words = f"not resolved in 2 of 4 states (median island {cells[1]:.2g} cell"
    assert words in text(study(pressed, "joints/closure"))


def test_no_yield_without_a_stated_material_or_below_it(rough):
    assert "yields" not in text(study(rough))
    assert "yields" not in text(study(rough, yield_pressure=[1e12, 2e12]))


def test_no_caveat_of_yield_where_a_hardness_is_given():
    hard = fc.contact.press(GRID_NOISE, contact_modulus=1e9, nominal_pressure=1e6, hardness=5e7)
    assert "yields" not in text(study(hard, yield_pressure=[1e6, 2e7]))


@pytest.mark.parametrize(("slope", "is_told"), [(0.2, False), (0.5, True)])
def test_steep_slopes_are_told_without_figures(slope, is_told):
    surface = fc.surfaces.spectral((64, 64), 1e-5, hurst=0.8, rms_slope=slope, rng=1)
    pressed = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=1e5, keep=())
    assert ("contact: the surface has an rms slope of up to" in text(study(pressed))) == is_told
    assert ("strains are not small" in text(study(pressed))) == is_told


def test_study_tells_steep_slopes_once_and_does_not_warn(tmp_path):
    steep = SOUND.replace("rms_increment = 4e-6", "rms_increment = 1e-4")
    (tmp_path / "study.toml").write_text(steep, encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("error", SmallStrainWarning)
        tree = fc.scenes.run(tmp_path / "study.toml", progress=False)
    assert text(tree).count("the delta-surface has an rms slope of up to") == 1


def test_yield_pressure_of_a_scene_is_checked(tmp_path):
    wrong = SOUND.replace("poisson = 0.2", "poisson = 0.2\nyield_pressure = [-1.0, 1e9]")
    (tmp_path / "study.toml").write_text(wrong, encoding="utf-8")
    with pytest.raises(InvalidInput, match=r"material\.yield_pressure"):
        fc.scenes.load(tmp_path / "study.toml")


@pytest.mark.parametrize(("angle", "stated"), [(30.0, True), (5.0, False)])
def test_strength_beyond_the_material_is_stated(angle, stated):
    teeth = np.tan(np.radians(58.0)) * 1e-4 * np.arange(60.0) * np.ones((12, 1))
    crack = fc.joints.Crack(
        fc.surfaces.from_array(teeth, 1e-4), young=30e9, poisson=0.2, block=1.2e-3, basic_friction_angle=angle
    )
    climb = fc.joints.dilatancy(crack, shear=[0.0, 2e-4, 4e-4], direction="E")
    friction = fc.joints.friction(climb, nominal_pressure=2e7)  # 20 MPa tan(88 degree) = 573 MPa
    words = text(study(friction, "joints/friction", yield_pressure=[1e8, 1e9]))
    assert ("peak shear strength is up to 0.573 GPa, and the material yields at 100 MPa" in words) == stated
    assert "asperities" not in text(study(friction, "joints/friction"))


def test_cells_are_those_of_the_states_that_are_not_resolved():
    single, disc = np.zeros((64, 64)), np.zeros((64, 64))
    single[::16, ::16] = 1.0
    x = np.arange(64) - 31.5
    disc[np.hypot(x, x[:, None]) < 20] = 1.0
    faces = [fc.surfaces.from_array(1e-6 * heights, 1e-5) for heights in (single, disc)]
    pressed = [
        fc.contact.press(face, contact_modulus=1e12, nominal_pressure=1e3, influence="square")
        for face in faces
    ]
    both = xr.concat([each.reset_coords("closure") for each in pressed], "shear", data_vars="all")
    words = text(study(both))
    assert "not resolved in 1 of 2 states (median island 1 cell, " in words


def test_dimension_without_interval_has_its_reason():
    surface = fc.surfaces.fbm((64, 64), 1e-5, hurst=0.6, rms_increment=1e-7, rng=4)
    enlarged = surface.copy(data=np.repeat(surface.values[::2], 2, axis=0))
    for heights, stated in ((enlarged, True), (surface, False)):
        estimates = fc.dimensions.estimate(heights, ["default"])
        reason = str(estimates.reason.values[0])
        assert bool(reason) == stated
        words = text(xr.DataTree.from_dict({"dimensions": estimates}))
        assert (f"D has no interval: {' '.join(reason.split())}." in words) == stated
        assert ("D has no interval" in words) == stated
