"""Uplift against closed forms, the diagrams of guidelines, and invariances."""

import numpy as np
import pytest
import xarray as xr
from scipy.optimize import brentq

import fractalcontact as fc
from fractalcontact.base.errors import ConvergenceWarning

HEAD = 490.5e3  # Pa, 50 m of water


def uplift(make_face, gap, spacing=1.0, *, periodic=False, **options):
    return fc.joints.uplift(
        make_face(gap, spacing, periodic=periodic), **{"upstream_pressure": HEAD} | options
    )


def test_linear_diagram_of_a_dam_of_40_m(make_face):
    result = uplift(make_face, np.full((3, 40), 1e-4), (1 / 3, 1.0))  # 50 m of water, a strip of 1 m
    np.testing.assert_allclose(result.uplift_force, 9.81e6, rtol=1e-9)
    np.testing.assert_allclose(result.uplift_arm, 40 / 3, rtol=1e-9)
    np.testing.assert_allclose(result.mean_uplift, HEAD / 2, rtol=1e-9)
    assert result.diagram.values.tolist() == ["joint", "linear"]
    assert result.wet_fraction == 1
    assert result.isolated_fraction == 0


def test_bilinear_diagram_with_a_third_at_the_drains(make_face):
    """Drains in the middle of their cells, where the flow has them too."""
    line = [(4.05, y) for y in (0.5, 1.5, 2.5)]
    result = uplift(make_face, np.full((3, 400), 1e-4), (1.0, 0.1), drains=line, drain_pressure=HEAD / 3)
    for name in ("uplift_force", "uplift_arm"):
        joint, bilinear = (result[name].sel(diagram=diagram) for diagram in ("joint", "bilinear"))
        np.testing.assert_allclose(joint, bilinear, rtol=1e-4)


@pytest.mark.parametrize(
    ("share", "force", "arm"),
    [
        (1 / 3, 433.3333, 5022.2222 / 433.3333),  # USBR: a third of the difference, 16.67 m of water
        (0.5 * 36 / 40, 550.0, 6733.3333 / 550.0),  # USACE: half of 50 m (40 - 4)/40, 22.5 m of water
    ],
)
@pytest.mark.parametrize("upstream", ["W", "E", "N"])
@pytest.mark.parametrize("cells", [400, 37])
def test_diagrams_of_guidelines_by_hand(make_face, share, force, arm, upstream, cells):
    """50 m of water, a base of 40 m, drains at 4 m: force per metre, and its arm, by two trapezia.

    The diagram breaks at the drains, not at the middle of their cell. `force` is in metres of water.
    """
    spacing = 40 / cells
    gap, steps = np.full((3, cells), 1e-4), (1.0, spacing)
    at = (4.0 if upstream == "W" else 36.0, 1.0)
    if upstream == "N":
        gap, steps, at = gap.T, steps[::-1], at[::-1]
    result = uplift(make_face, gap, steps, drains=at, drain_share=share, upstream=upstream)
    bilinear = result.sel(diagram="bilinear")
    np.testing.assert_allclose(bilinear.uplift_force / 3, 9.81e3 * force, rtol=1e-7)
    np.testing.assert_allclose(bilinear.uplift_arm, arm, rtol=1e-7)
    profile = bilinear.uplift_profile.values
    np.testing.assert_allclose(profile.sum() * spacing, 9.81e3 * force, rtol=1e-7)


def test_lines_inside_the_plane(make_face):
    """A crack open up to 10.5 m, and tailwater from 30.5 m on: full head, a line, nothing."""
    result = uplift(make_face, np.full((2, 40), 1e-4), upstream=("x", 10.5), downstream=["x", 30.2])
    per_metre = result.uplift_force / 2
    np.testing.assert_allclose(per_metre.sel(diagram="linear"), HEAD * (10.5 + 10.0), rtol=1e-12)
    np.testing.assert_allclose(per_metre.sel(diagram="joint"), HEAD * (10.5 + 10.0), rtol=1e-6)
    centre = (10.5 * 5.25 + 10.0 * (10.5 + 20 / 3)) / 20.5
    np.testing.assert_allclose(result.uplift_x, centre, rtol=1e-3)
    np.testing.assert_allclose(result.uplift_arm, centre - 10.5, atol=0.01)
    np.testing.assert_allclose(result.uplift_y, 1.0, rtol=1e-12)
    back = uplift(make_face, np.full((2, 40), 1e-4), upstream=("x", 30.2), downstream=("x", 10.5))
    np.testing.assert_allclose(back.fluid_pressure, HEAD - result.fluid_pressure, atol=1e-4)


def test_two_edges_that_meet(make_face, rough):
    """From west to south: the plane mirrored at its diagonal swaps both sides."""
    gap = np.maximum(rough((12, 12), seed=4) + 1.5, 0.0) * 1e-4
    gap = gap + gap.T
    result = uplift(make_face, gap, upstream="W", downstream="S")
    p = result.fluid_pressure / HEAD
    wet = np.isfinite(p.values)
    assert wet.sum() > 100
    np.testing.assert_allclose((p.values + p.values.T)[wet], 1.0, rtol=1e-9)
    assert result.diagram.values.tolist() == ["joint"]
    assert "x" in result.uplift_profile.dims


def test_periodic_sides_are_joined(make_face, rough):
    gap = np.maximum(rough((12, 16), seed=4) + 1.2, 0.0) * 1e-4
    plain = uplift(make_face, gap, upstream="S", periodic=True).fluid_pressure
    rolled = uplift(make_face, np.roll(gap, 5, axis=1), upstream="S", periodic=True).fluid_pressure
    np.testing.assert_allclose(rolled, np.roll(plain, 5, axis=1), rtol=1e-9)


def on_path(surface, gaps, stresses):
    return xr.concat([surface(gap, 1.0) for gap in gaps], "step").assign_coords(
        nominal_pressure=("step", stresses)
    )


def test_balance_with_the_closure_of_two_halves(make_face):
    """Each half closes with the logarithm of the stress; the fixed point is that of one equation."""
    total, stresses = 800e3, np.geomspace(1e5, 1e6, 4)

    def apertures(stress):
        decades = np.log10(stress / 1e5)
        return 1e-4 * (3 - 1.5 * decades), 1e-4 * (2 - 0.4 * decades)  # upstream closes faster

    def excess(stress):
        upper, lower = apertures(stress)
        middle = upper**3 / (upper**3 + lower**3)  # two plates in series
        return stress + HEAD * (1 + 2 * middle) / 4 - total

    exact = brentq(excess, 1e5, 1e6)
    gaps = [np.repeat(apertures(stress), 10) * np.ones((2, 1)) for stress in stresses]
    result = fc.joints.uplift(on_path(make_face, gaps, stresses), upstream_pressure=HEAD, total_stress=total)
    assert result.converged
    np.testing.assert_allclose(result.effective_stress, exact, rtol=1e-8)
    joint = result.mean_uplift.sel(diagram="joint")
    np.testing.assert_allclose(result.effective_stress + joint, total, rtol=1e-8)
    assert abs(float(joint) / HEAD - 0.5) > 0.02  # not that of even plates
    assert "step" not in result.dims
    assert "nominal_pressure" not in result.coords


def test_balance_on_the_path_of_a_rough_joint(make_face, rough):
    """The gap pressed at the effective stress itself gives the uplift that was found between two steps."""
    face = make_face(2e-5 * rough((32, 32), seed=2), 1e-4)
    crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=2.4e-3)
    stresses = np.geomspace(2e5, 3.2e6, 9)
    path = fc.joints.closure(crack, shear=2e-4, nominal_pressure=stresses, keep="gap").gap
    result = fc.joints.uplift(path, upstream_pressure=1e6, total_stress=1.5e6).squeeze()
    stress = float(result.effective_stress)
    pressed = fc.joints.closure(crack, shear=2e-4, nominal_pressure=stress, keep="gap").gap
    dry = fc.joints.uplift(pressed, upstream_pressure=1e6).squeeze()
    both = stress + float(dry.mean_uplift.sel(diagram="joint"))
    np.testing.assert_allclose(both, 1.5e6, rtol=2e-3)
    assert stress < 1.3e6


@pytest.mark.parametrize(("total", "sign"), [(5e6, -1), (2e5, 1)])
def test_a_total_stress_off_the_path_is_reported(make_face, total, sign):
    stresses = np.array([1e5, 2e5, 4e5])
    gaps = [np.full((2, 10), gap) for gap in (3e-4, 2e-4, 1e-4)]
    with pytest.warns(ConvergenceWarning, match="no effective stress on the path"):
        result = fc.joints.uplift(
            on_path(make_face, gaps, stresses), upstream_pressure=HEAD, total_stress=total
        )
    assert not result.converged
    assert np.isnan(result.effective_stress)
    assert np.sign(result.balance_error) == sign
    assert np.isnan(result.uplift_force.sel(diagram="joint"))
    np.testing.assert_allclose(result.mean_uplift.sel(diagram="linear"), HEAD / 2, rtol=1e-12)


def test_an_opening_that_does_not_converge_is_reported(make_face):
    rng = np.random.default_rng(0)  # openings over five decades: the water closes and opens bottlenecks
    gap = 10.0 ** rng.uniform(-8, -3, (10, 12))
    gap[rng.random(gap.shape) < 0.2] = 0
    options = {"normal_stiffness": 1e10, "drains": [(5.0, 3.0)]}
    gaps = xr.concat([make_face(gap, 1.0), make_face(np.full(gap.shape, 1e-4), 1.0)], "step")
    with pytest.warns(ConvergenceWarning, match="step 0: opening and flow did not come to balance"):
        result = fc.joints.uplift(gaps, upstream_pressure=490e3, **options)
    assert result.converged.values.tolist() == [False, True]


def test_open_crack_carries_the_full_head(make_face):
    gap = np.where(np.arange(40) < 10, 1e-2, 1e-5) * np.ones((2, 1))
    result = uplift(make_face, gap)
    np.testing.assert_allclose(result.uplift_force.sel(diagram="joint") / 2, 12.2625e6, rtol=1e-6)


def test_step_in_aperture(make_face):
    gap = np.repeat([2e-4, 1e-4], 10) * np.ones((2, 1))
    profile = uplift(make_face, gap).uplift_profile.sel(diagram="joint") / HEAD
    middle = 0.5 * (
        profile[9] + 0.5 * (profile[9] - profile[8]) + profile[10] - 0.5 * (profile[11] - profile[10])
    )
    np.testing.assert_allclose(middle, 8 / 9, rtol=1e-12)


@pytest.mark.parametrize(("ratio", "mean"), [(1.5, 0.596923), (2, 0.653333), (3, 0.71), (10, 0.777858)])
def test_water_opens_a_smooth_joint(make_face, ratio, mean):
    """The aperture w0 + c p: its fourth power is linear along the flow."""
    stiffness = HEAD / ((ratio - 1) * 1e-4)
    result = uplift(make_face, np.full((2, 800), 1e-4), 0.05, normal_stiffness=stiffness)
    np.testing.assert_allclose(
        result.mean_uplift.sel(diagram="joint") / HEAD, mean, atol=2e-6 if ratio < 10 else 1e-4
    )
    along = (np.arange(800) + 0.5) / 800
    exact = ((ratio**4 + (1 - ratio**4) * along) ** 0.25 - 1) / (ratio - 1)
    upper = slice(0, 760)  # at the lower edge the aperture halves within a few cells
    np.testing.assert_allclose(result.fluid_pressure[0, upper] / HEAD, exact[upper], atol=5e-4)


def test_tailwater_adds_its_pressure(make_face, rough):
    gap = np.maximum(rough((12, 16), seed=4) + 1.5, 0.0) * 1e-4
    dry = uplift(make_face, gap)
    both = uplift(make_face, gap, upstream_pressure=HEAD + 1e5, downstream_pressure=1e5)
    np.testing.assert_allclose(both.fluid_pressure, dry.fluid_pressure + 1e5, rtol=1e-9)


@pytest.mark.parametrize(("edge", "turn"), [("E", lambda g: g[:, ::-1]), ("S", lambda g: g.T),
                                            ("N", lambda g: g.T[::-1])])  # fmt: skip
def test_every_edge_is_the_same_plane_turned(make_face, rough, edge, turn):
    gap = np.maximum(rough((12, 16), seed=4) + 1.2, 0.0) * 1e-4
    west = uplift(make_face, gap)
    other = uplift(make_face, turn(gap), upstream=edge)
    np.testing.assert_allclose(other.fluid_pressure, turn(west.fluid_pressure.values), rtol=1e-9)
    np.testing.assert_allclose(other.uplift_arm, west.uplift_arm, rtol=1e-9)
    np.testing.assert_allclose(other.uplift_force, west.uplift_force, rtol=1e-9)


def test_pressure_agrees_with_the_transmissivity(make_face, rough):
    gap = np.maximum(rough((12, 16), seed=4) + 1.5, 0.0) * 1e-4
    flow = fc.joints.transmissivity(make_face(gap, 1.0), axis="x", keep="pressure")
    through = flow.relative_pressure.squeeze("axis")
    pressure = uplift(make_face, gap).fluid_pressure / HEAD
    assert through.notnull().any()
    np.testing.assert_allclose(pressure.where(through.notnull()), through, rtol=1e-9)


def test_water_behind_a_barrier_stands_at_full_head(make_face):
    gap = np.full((5, 9), 1e-4)
    gap[:, 4] = 0.0  # contact from side to side
    gap[1:4, 6:9] = 0.0
    gap[2, 7] = 1e-4  # a pocket that no water reaches
    result = uplift(make_face, gap, downstream_pressure=1e5)
    pressure = result.fluid_pressure.values
    np.testing.assert_allclose(pressure[:, :4], HEAD, rtol=1e-12)
    np.testing.assert_allclose(pressure[:, 5], 1e5, rtol=1e-12)
    assert np.isnan(pressure[:, 4]).all()
    assert np.isnan(pressure[2, 7])
    np.testing.assert_allclose(result.isolated_fraction, 1 / 45)
    np.testing.assert_allclose(
        result.uplift_force.sel(diagram="joint"), np.nansum(pressure), rtol=1e-12
    )  # cells of 1 m2; contact carries none
    behind = uplift(make_face, np.where(np.arange(9) == 4, 0.0, 1e-4) * np.ones((5, 1)))
    arm = behind.uplift_arm.sel(diagram="joint")
    np.testing.assert_allclose(arm, 2.0, rtol=1e-12)  # full head on four cells of 1 m


def test_one_drain_is_a_well_of_a_fifth_of_the_spacing(make_face):
    """The closed form of a well in the middle of a long strip between two edges of the same head."""
    n = 41
    result = uplift(make_face, np.full((161, n), 1e-4), drains=[(20.5, 80.5)],
                    downstream_pressure=HEAD * (1 - 1e-9), drain_pressure=0.0)  # fmt: skip
    distance = np.arange(5, 18)
    exact = 1 - np.log(np.tan(np.pi * distance / (2 * n))) / np.log(np.tan(np.pi * 0.2 / (2 * n)))
    np.testing.assert_allclose(result.fluid_pressure[80, 20 + distance] / HEAD, exact, atol=2e-3)


def test_drain_of_a_diameter_holds_all_its_cells(make_face):
    result = uplift(make_face, np.full((21, 21), 1e-4), drains=[(10.5, 10.5)], drain_diameter=4.1)
    held = np.abs(result.fluid_pressure.values) < 1e-5 * HEAD
    y, x = np.indices((21, 21)) - 10
    np.testing.assert_array_equal(held, np.hypot(y, x) <= 2.05)


def test_a_wide_drain_goes_on_across_a_periodic_edge(make_face):
    options = {"drain_diameter": 7.0, "periodic": True}
    forces = [
        uplift(make_face, np.full((40, 30), 1e-4), drains=[(15.5, y)], **options).uplift_force.values[0]
        for y in (20.5, 0.5, 39.5)
    ]
    np.testing.assert_allclose(forces, forces[0], rtol=1e-9)


def test_a_wide_drain_ends_at_the_edge_that_water_enters(make_face):
    """Along the flow nothing is periodic: a drain beside the upstream edge is not also downstream."""
    gap = np.full((20, 30), 1e-4)
    free = uplift(make_face, gap, drains=[(0.5, 10.5)], drain_diameter=7.0, periodic=(True, False))
    periodic = uplift(make_face, gap, drains=[(0.5, 10.5)], drain_diameter=7.0, periodic=True)
    np.testing.assert_allclose(periodic.fluid_pressure, free.fluid_pressure, rtol=1e-9)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"drains": [(5.0, 99.0)]}, "drains: expected points"),
        ({"drains": [1.0, 2.0, 3.0]}, "drains: expected points"),
        ({"downstream_pressure": 2 * HEAD}, "less than upstream_pressure"),
        ({"upstream": "NE"}, "upstream"),
        ({"upstream": ("x", 99.0)}, "upstream: expected a line inside"),
        ({"upstream": ("z", 1.0)}, "upstream: expected 'W'"),
        ({"downstream": "W"}, "downstream: expected another edge"),
        ({"total_stress": 1e6}, "whose nominal_pressure rises"),
        ({"total_stress": 1e6, "normal_stiffness": 1e9}, "expected one of them"),
    ],
)
def test_wrong_arguments_are_named(make_face, options, message):
    with pytest.raises(ValueError, match=message):
        uplift(make_face, np.full((9, 9), 1e-4), **options)


def test_unmeasured_apertures_are_told_what_to_do(make_face):
    gap = np.ones((4, 4))
    gap[1, 2] = np.nan
    with pytest.raises(ValueError, match=r"gap\.fillna\(0\)"):
        uplift(make_face, gap)
