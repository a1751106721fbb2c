"""What stands on the axes is what stands in the Dataset, in the unit that the label names."""

import re
from itertools import pairwise

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact import plotting
from fractalcontact.base.errors import InvalidInput
from fractalcontact.plotting.roughness import CURVES

FACTORS = {
    "m": 1.0, "mm": 1e-3, "µm": 1e-6, "nm": 1e-9, "N": 1.0, "kN": 1e3, "Pa": 1.0, "MPa": 1e6, "GPa": 1e9,
    "%": 0.01, "°": 1.0, "mm²": 1e-6, "m⁴": 1.0, "rad m⁻¹": 1.0, "µm²": 1e-12,
}  # fmt: skip


def factor(label):
    """Return the SI value of the unit in brackets at the end of a label."""
    return FACTORS[re.search(r"\(([^()]*)\)$", label).group(1)]


def drawn(ax):
    """Return the curves on an axes in SI units."""
    fx, fy = factor(ax.get_xlabel()), factor(ax.get_ylabel())
    return [np.array([line.get_xdata(), line.get_ydata()], float) * [[fx], [fy]] for line in ax.lines]


def holds(curves, x, y):
    """Tell whether one of the curves goes through the points."""
    x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
    return any(c.shape[1] == x.size and np.allclose(c, [x, y], rtol=1e-12, equal_nan=True) for c in curves)


@pytest.fixture
def closed(made):
    return made.closure(made.delta(made.heights(), shears=(8e-4, 1.6e-3, 8e-3)))


def test_closure_laws_show_both_closures_of_every_shear(closed):
    curves = drawn(plotting.closure_laws(closed).axes[0])
    for v in closed.shear:
        for name in ("closure", "interface_closure"):
            assert holds(curves, closed[name].sel(shear=v), closed.normal_force)


def test_marked_points_lie_on_the_curve_of_the_chosen_shear(closed):
    ax = plotting.closure_laws(closed, shear=1.6e-3, marked=[1, 3]).axes[0]
    one = closed.sel(shear=1.6e-3).isel(step=[1, 3])
    assert holds(drawn(ax), one.interface_closure, one.normal_force)
    assert [text.get_text() for text in ax.texts] == ["A", "B"]


def test_contact_area_shows_raw_and_corrected(closed):
    curves = drawn(plotting.contact_area(closed).axes[0])
    for v in closed.shear:
        one = closed.sel(shear=v)
        assert holds(curves, one.normal_force, one.contact_fraction)
        assert holds(curves, one.normal_force, one.corrected_contact_fraction)


def test_contact_area_against_closure(closed):
    curves = drawn(plotting.contact_area(closed, against="closure").axes[0])
    assert holds(curves, closed.closure.isel(shear=0), closed.contact_fraction.isel(shear=0))


def test_rigid_dilatancy_shows_each_direction_and_its_mean_slope(made):
    opening = made.dilatancy(forces=())
    ax = plotting.rigid_dilatancy(opening).axes[0]
    for word in "ENWS":
        one = opening.sel(direction=word)
        assert holds(drawn(ax), one.shear, one.rigid_dilatancy)
        end = float(opening.shear.max())
        assert holds(drawn(ax), [0, end], [0, end * float(one.mean_slope)])


def test_elastic_dilatancy_shows_each_force_beside_the_rigid_curve(made):
    opening = made.dilatancy()
    ax = plotting.elastic_dilatancy(opening, direction="N", reach=8e-4).axes[0]
    one = opening.sel(direction="N").where(opening.shear < 8.1e-4, drop=True)
    assert holds(drawn(ax), one.shear, one.rigid_dilatancy)
    for step in range(3):
        assert holds(drawn(ax), one.shear, one.dilatancy.isel(step=step))
    assert len(ax.lines) == 4


def test_friction_shows_angle_strength_and_basic_angle(made):
    rubbed = made.friction(made.dilatancy(directions=("W",)))
    angle, strength = plotting.friction(rubbed).axes
    for step in range(3):
        one = rubbed.isel(direction=0, step=step)
        assert holds(drawn(angle), one.shear, one.friction_angle)
        assert holds(drawn(strength), one.shear, one.shear_strength)
    assert any(np.allclose(line.get_ydata(), 35.0) for line in angle.lines)


def test_friction_of_rigid_faces_has_a_curve_for_each_direction(made):
    rubbed = made.friction(made.dilatancy(forces=()))
    (ax,) = plotting.friction(rubbed).axes
    for word in "ENWS":
        one = rubbed.sel(direction=word)
        assert holds(drawn(ax), one.shear, one.friction_angle)


def test_locked_faces_end_the_axis_at_a_right_angle(made):
    rubbed = made.friction(made.dilatancy(shears=[0, 1e-4, 2e-4], directions=("W",)))
    rubbed["friction_angle"].values[0, 0] = 110.0
    angle, strength = plotting.friction(rubbed).axes
    assert angle.get_ylim()[1] == 90.0
    assert angle.get_ylim()[0] < 35.0
    assert angle.get_title(loc="left") == "block slides West, locked from 90° on"
    assert strength.get_yscale() == "linear"
    rubbed["shear_strength"].values[0, 0, 0] *= 1e-3
    assert plotting.friction(rubbed).axes[1].get_yscale() == "log"


def test_box_dimension_shows_the_dust_and_the_interval(made, closed):
    result = made.box_dimension(closed)
    by_load, by_shear = plotting.box_dimension(result).axes

    def lines(ax):
        fx = factor(ax.get_xlabel())
        return [np.array([np.asarray(line.get_xdata()) * fx, line.get_ydata()]) for line in ax.lines]

    for name in ("box_dimension", "null_dimension"):
        for v in result.shear:
            assert holds(lines(by_load), result.normal_force, result[name].sel(shear=v))
        assert holds(lines(by_shear), result.shear, result[name].isel(step=-1))
    assert not by_load.collections  # six bands on each other would tell nothing
    low, high = (result[name].isel(step=-1) for name in ("ci_low", "ci_high"))
    band = by_shear.collections[0].get_paths()[0].vertices[:, 1]
    assert band.min() == pytest.approx(float(low.min()))
    assert band.max() == pytest.approx(float(high.max()))


def test_box_dimension_at_a_chosen_force(made, closed):
    result = made.box_dimension(closed)
    ax = plotting.box_dimension(result, normal_force=1e3).axes[1]
    assert np.allclose(ax.lines[0].get_ydata(), result.box_dimension.sel(step=2))
    assert "1 kN" in ax.get_title(loc="left")


def test_box_dimension_with_a_wide_interval_or_none_is_an_open_point(made, closed):
    result = made.box_dimension(closed).isel(shear=0, step=slice(1, None)).copy(deep=True)
    result["ci_high"].values[0] += 0.6
    result["ci_low"].values[1] = np.nan
    (ax,) = plotting.box_dimension(result).axes
    _, filled, hollow, _ = ax.lines
    assert hollow.get_markerfacecolor() == "white"
    assert np.array_equal(hollow.get_ydata(), result.box_dimension.values[:2])
    assert np.array_equal(filled.get_ydata(), result.box_dimension.values[2:])
    assert len(ax.collections) == 1


def test_error_against_time_shows_what_was_measured(made):
    measured = made.accuracy()
    axes = plotting.error_against_time(measured).axes
    for left, right, (name, part) in zip(axes[::2], axes[1::2], measured.children.items(), strict=True):
        assert left.get_title(loc="left").startswith(f"{name}: sphere")
        unit = {"ms": 1e-3, "µs": 1e-6, "s": 1.0}[re.search(r"\((.*)\)", left.get_xlabel()).group(1)]
        for row, method in enumerate(part.method.values):
            one = part.to_dataset().sel({"method": method}).dropna("setting")
            best = one.isel(setting=one.on_frontier.values)
            for ax, cost, scale in ((left, "run_time", unit), (right, "memory", 1e6)):
                line, filled = ax.lines[2 * row : 2 * row + 2]
                assert np.asarray(line.get_xdata()) * scale == pytest.approx(one[cost].values)
                assert np.array_equal(line.get_ydata(), one.error.values)
                assert np.array_equal(filled.get_ydata(), best.error.values)


def test_no_two_of_many_methods_look_alike_and_equal_costs_look_equal(made):
    one = made.accuracy()["contact"].to_dataset().isel(method=[0] * 10)
    one["method"] = [f"method {k}" for k in range(10)]
    one["memory"] = one["memory"] * 0 + 1e6 * (1 + 1e-5 * np.arange(one.sizes["setting"]))
    _, right = plotting.error_against_time(one).axes
    looks = {(line.get_color(), line.get_marker()) for line in right.lines[::2]}
    assert len(looks) == 10
    low, high = right.get_xlim()
    assert high > 2 * low


def test_lacunarity_shows_every_step_and_its_dust(made, closed):
    result = made.lacunarity(closed)
    by_load, by_shear = plotting.lacunarity(result, shear=8e-3).axes
    shown = [np.asarray(line.get_ydata()) for line in by_load.lines]
    for step in range(1, 5):
        one = result.sel(shear=8e-3).isel(step=step)
        for name in ("lacunarity", "null_lacunarity"):
            assert any(np.allclose(y, one[name].transpose("box_size")) for y in shown)
    assert factor(by_load.get_xlabel()) * np.asarray(by_load.lines[0].get_xdata()) == pytest.approx(
        result.box_length.values
    )
    assert len(by_shear.lines) == 6


def test_hydraulic_aperture_shows_each_flow(made, closed):
    result = made.transmissivity(closed)
    ax = plotting.hydraulic_aperture(result).axes[0]
    for v in result.shear:
        for word in "xy":
            one = result.sel(shear=v, axis=word)
            assert holds(drawn(ax), one.normal_force, one.hydraulic_aperture)


def test_dimension_curves_show_curve_window_and_slope(made):
    curves, estimates = made.curves(), made.estimates()
    estimates["hurst"][:] = 0.78
    estimates["fractal_dimension"][:] = 2.22
    axes = plotting.dimension_curves(curves, estimates).axes
    upper, lower = axes[:3], axes[3:]
    for ax, below, (name, curve) in zip(upper, lower, curves.items(), strict=True):
        scale = next(iter(curve.dims))
        fx = factor(below.get_xlabel())
        assert np.asarray(ax.lines[0].get_xdata()) * fx == pytest.approx(curve[scale].values)
        slope = float(curve.local_slope[0])
        assert np.allclose(below.lines[1].get_ydata(), slope)
        assert f"slope {slope:.2f}" in ax.texts[0].get_text()
        line, points = (np.log([one.get_xdata(), one.get_ydata()]) for one in (ax.lines[1], ax.lines[0]))
        assert np.diff(line[1]) / np.diff(line[0]) == pytest.approx(slope)
        assert np.interp(line[0], *points) == pytest.approx(line[1])
        window = np.array([2e-4, 4e-3])
        window = np.sort(2 * np.pi / window) if scale == "wavenumber" else window
        shaded = ax.patches[0]
        assert np.array([shaded.get_x(), shaded.get_x() + shaded.get_width()]) * fx == pytest.approx(window)
        assert name.replace("_", " ") == ax.get_title(loc="left")


def test_every_curve_of_a_profile_has_its_panel_and_numbers_apart():
    profile = fc.surfaces.fbm(200, 1e-4, hurst=0.7, rms_increment=1e-5, rng=1)
    names = ("spectrum", "variogram", "roughness_length", "variation", "cube_counts", "covering")
    curves = {name: getattr(fc.dimensions, name)(profile) for name in names}
    figure = plotting.dimension_curves(curves, fc.dimensions.estimate(profile, list(names)))
    titles = {ax.get_title(loc="left") for ax in figure.axes}
    assert titles >= {name.replace("_", " ") for name in names}
    figure.draw_without_rendering()
    for ax in figure.axes:
        edge = ax.get_window_extent()
        boxes = [text.get_window_extent() for text in ax.get_xticklabels(which="both") if text.get_text()]
        shown = sorted((box.x0, box.x1) for box in boxes if edge.x0 <= 0.5 * (box.x0 + box.x1) <= edge.x1)
        assert all(left[1] < right[0] for left, right in pairwise(shown))


@pytest.mark.parametrize("hurst", [0.3, 0.8])
@pytest.mark.parametrize("name", list(CURVES))
def test_the_slope_of_each_curve_is_that_of_the_surface_it_is_measured_on(name, hurst):
    """The slopes as the books give them: 2-D spectrum -2(1 + H), counts -(3 - H), area 2 - D ..."""
    dimension = 3 - hurst
    of_surfaces = {
        "power_spectral_density": -2 * (1 + hurst),
        "profile_power_spectral_density": -(5 - 2 * (2 - hurst)),
        "second_variogram": 6 - 2 * dimension,
        "variogram": 6 - 2 * dimension,
        "madogram": 3 - dimension,
        "cube_count": -dimension,
        "roughness": 3 - dimension,
        "variation": 3 - dimension,
        "covering_area": 2 - dimension,
        "covering_length": 2 - dimension,  # one less of both, area and dimension
    }
    assert np.dot(CURVES[name], (hurst, 3.0, 1.0)) == pytest.approx(of_surfaces[name])


def test_dimensions_show_intervals_of_the_dimension_not_of_the_hurst_exponent(made):
    estimates = made.estimates()
    ax = plotting.dimensions(estimates, truth=2.22, band=(2.15, 2.29)).axes[0]
    known = estimates.isel(method=slice(0, -1))
    segments = np.array(ax.collections[0].get_segments())[:, :, 0]
    assert segments[:, 0] == pytest.approx((3 - known.ci_high).values)
    assert segments[:, 1] == pytest.approx((3 - known.ci_low).values)
    assert [t.get_text() for t in ax.get_yticklabels()] == ["default", "spectrum", "variogram", "cube counts"]


def test_a_result_that_runs_over_more_than_is_drawn_is_refused(made):
    with pytest.raises(InvalidInput, match=r"one direction; choose with \.sel or \.isel, got 4"):
        plotting.elastic_dilatancy(made.dilatancy())


def test_what_is_missing_is_named(made):
    with pytest.raises(InvalidInput, match="'closure'.*\n.*'normal_force'"):
        plotting.closure_laws(made.estimates())
    with pytest.raises(InvalidInput, match="labelled result"):
        plotting.box_dimension([1, 2, 3])
    with pytest.raises(InvalidInput, match="one of 'E', 'N', 'W', 'S', got 'Q'"):
        plotting.elastic_dilatancy(made.dilatancy(), direction="Q")


def test_a_figure_can_be_part_of_a_larger_one(made, closed):
    from matplotlib.figure import Figure

    sheet = Figure(layout="constrained")
    left, right = sheet.subplots(1, 2)
    assert plotting.closure_laws(closed, ax=left) is sheet
    assert plotting.contact_area(closed, ax=right) is sheet
    assert len(sheet.axes) == 2


def test_the_callers_settings_are_left_alone(closed):
    import matplotlib

    before = dict(matplotlib.rcParams)
    plotting.closure_laws(closed)
    assert dict(matplotlib.rcParams) == before


def test_local_slopes_show_the_level_parts_and_those_of_the_dust():
    sizes = np.array([1, 2, 4, 8])
    count = 64.0 * sizes[None, :] ** -np.array([[1.2], [1.5]])
    dust = 64.0 * sizes[None, :] ** -np.array([[0.5], [1.0]])
    result = xr.Dataset(
        {
            "local_slope": (("step", "box_size"), np.array([[1.2] * 4, [1.5] * 4])),
            "box_count": (("step", "box_size"), count),
            "null_count": (("step", "box_size"), dust),
        },
        coords={"box_size": sizes, "box_length": ("box_size", sizes * 1e-3, {"units": "m"})},
    )
    (ax,) = plotting.local_slopes(result).axes
    lines = [line.get_ydata() for line in ax.lines]
    for line, want in zip(lines, (1.2, 0.5, 1.5, 1.0), strict=True):
        assert line == pytest.approx(np.full(4, want))
    low, high = ax.get_ylim()
    assert low < 0
    assert high > 2
    steep = result.assign(local_slope=result["local_slope"] + 2.0)
    assert plotting.local_slopes(steep).axes[0].get_ylim()[1] > 3.5


def test_other_dimensions_of_a_domain_are_drawn_alike():
    result = xr.Dataset(
        {
            "minkowski_dimension": ("step", np.array([0.5, 1.5])),
            "null_dimension": ("step", np.array([0.2, 1.0])),
        },
        coords={"normal_force": ("step", np.array([1.0, 2.0]), {"units": "N"})},
    )
    (ax,) = plotting.box_dimension(result).axes
    assert ax.lines[0].get_ydata() == pytest.approx([0.5, 1.5])
    assert "inkowski" in ax.get_ylabel()
    empty = result.assign(minkowski_dimension=result["minkowski_dimension"] * np.nan)
    assert plotting.box_dimension(empty).axes[0].texts[0].get_text() == "no contact"
