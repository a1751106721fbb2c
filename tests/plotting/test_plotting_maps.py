"""Maps: every cell where it belongs, the right way up, in the right colour."""

import matplotlib
import numpy as np
import pytest

from fractalcontact import plotting
from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.schema import label
from fractalcontact.plotting import _maps, _style

OPEN, CONTACT, YIELDED = (np.array(matplotlib.colors.to_rgb(c)) for c in _style.STATE_COLOURS)


def colours(ax):
    """Return the colours of the image on an axes, first row south."""
    assert ax.images[0].origin == "lower"
    return np.asarray(ax.images[0].get_array())


def test_state_colours_tell_the_flags(made):
    closed = made.closure(made.delta(made.heights()))
    state = closed.state.isel(shear=0, step=-1).copy()
    state.values[2, 5] = 2
    result = closed.isel(shear=0, step=-1).assign(state=state)
    image = colours(plotting.contact_domains(result).axes[0])
    assert np.array_equal(np.all(image == CONTACT, axis=-1), state.values == 1)
    assert np.array_equal(np.all(image == YIELDED, axis=-1), state.values == 2)
    assert np.array_equal(np.all(image == OPEN, axis=-1), state.values == 0)


def test_maps_at_growing_load_are_those_of_the_chosen_shear(made):
    closed = made.closure(made.delta(made.heights(), shears=(8e-4, 1.6e-3, 8e-3)))
    axes = plotting.contact_domains(closed, shear=1.5e-3, panels=3).axes
    steps = [1, 3, 4]  # evenly over the closure, the unloaded step left out
    for ax, step in zip(axes, steps, strict=True):
        one = closed.sel(shear=1.6e-3).isel(step=step)
        assert np.array_equal(np.all(colours(ax) == CONTACT, axis=-1), one.state.values == 1)
        assert f"{100 * float(one.state.mean()):.2g} % in contact" in ax.get_title(loc="left")
        assert f"{float(one.normal_force) / 1e3:g} kN" in ax.get_title(loc="left")
    assert "1.6 mm" in axes[0].figure.get_suptitle()


def test_maps_at_growing_shear_are_those_of_the_chosen_force(made):
    closed = made.closure(made.delta(made.heights(), shears=(8e-4, 1.6e-3, 8e-3)))
    axes = plotting.contact_domains(closed, normal_force=9e3).axes
    assert len(axes) == 3
    for ax, v in zip(axes, closed.shear, strict=True):
        assert np.array_equal(np.all(colours(ax) == CONTACT, axis=-1), closed.state.sel(shear=v, step=3) == 1)
        assert f"{float(v) * 1e3:g} mm" in ax.get_title(loc="left")
    assert "10 kN" in axes[0].figure.get_suptitle()


def test_a_force_that_all_shears_have_is_told_though_it_stands_on_each_of_them(made):
    closed = made.closure(made.delta(made.heights(), shears=(8e-4, 1.6e-3)))
    force = closed.normal_force.values * (1 + 1e-9 * np.arange(2)[:, None])
    closed = closed.assign_coords(normal_force=(("shear", "step"), force))
    figure = plotting.contact_domains(closed, normal_force=1e4)
    assert figure.get_suptitle() == "$F$ = 10 kN"
    force[1] *= 1.5
    closed = closed.assign_coords(normal_force=(("shear", "step"), force))
    assert plotting.contact_domains(closed, normal_force=1e4).get_suptitle() == ""


def test_loads_of_a_path_share_a_unit_unless_one_is_small(made):
    closed = made.closure(made.delta(made.heights(), shears=(8e-4,)), forces=(40.0, 4e3, 2e4))
    titles = [ax.get_title(loc="left") for ax in plotting.contact_domains(closed).axes]
    for title, force in zip(titles, ("40 N", "4 kN", "20 kN"), strict=True):
        assert f"= {force}," in title


def test_one_of_shear_and_force_must_be_chosen(made):
    closed = made.closure(made.delta(made.heights()))
    with pytest.raises(InvalidInput, match="exactly one"):
        plotting.contact_domains(closed)
    with pytest.raises(InvalidInput, match="exactly one"):
        plotting.contact_domains(closed, shear=8e-3, normal_force=1e3)


def test_face_lies_at_its_coordinates_and_is_lit_from_the_north_west(made):
    import xarray as xr

    x = np.linspace(1e-3, 3e-3, 41)
    bump = np.exp(-((x - 2e-3) ** 2 + (x[:, None] - 2e-3) ** 2) / 2e-7)
    plane = label(xr.DataArray(1e-5 * bump, dims=("y", "x"), coords={"y": x, "x": x}, name="height"))
    ax = plotting.face(plane).axes[0]
    half = 0.5 * (x[1] - x[0]) * 1e3
    assert ax.images[0].get_extent() == pytest.approx([1 - half, 3 + half, 1 - half, 3 + half])
    assert ax.get_aspect() == 1.0
    light = colours(ax).sum(axis=-1)
    assert light[26, 14] > light[14, 26]  # row 26 is north of the top, column 14 west of it
    assert ax.get_xlabel() == "$x$ (mm)"


def test_colour_bar_tells_the_heights(made):
    face = made.heights()
    figure = plotting.face(face)
    bar = figure.axes[1]
    assert bar.get_ylabel() == "height (mm)"
    assert bar.get_ylim() == pytest.approx((float(face.min()) * 1e3, float(face.max()) * 1e3), rel=0.25)


def test_heights_far_beyond_all_others_are_cut(made):
    z = np.random.default_rng(0).standard_normal((60, 60))
    low, high, beyond = _maps.limits(z)
    assert (low, high, beyond) == (z.min(), z.max(), "neither")
    z[3, 4] = 1e6
    low, high, beyond = _maps.limits(z)
    assert low == z.min()
    assert high < 5
    assert beyond == "max"


def test_missing_heights_are_grey(made):
    face = made.heights().copy()
    face.values[:5, :7] = np.nan
    image = colours(plotting.face(face).axes[0])
    assert np.allclose(image[:5, :7], matplotlib.colors.to_rgb(_style.MISSING))
    assert np.isfinite(image).all()


def test_large_planes_are_averaged_before_they_are_drawn():
    plane = np.arange(16.0).reshape(4, 4)
    assert np.array_equal(_maps.thinned(plane, 2), [[2.5, 4.5], [10.5, 12.5]])
    assert _maps.thinned(plane, 4) is plane


def test_field_leaves_zero_pressure_pale(made):
    import xarray as xr

    face = made.heights()
    pressure = label(xr.DataArray(np.maximum(face.values, 0) * 1e10, coords=face.coords, name="pressure"))
    figure = plotting.field(pressure)
    image = colours(figure.axes[0])
    assert np.array_equal(np.all(image == OPEN, axis=-1), pressure.values == 0)
    assert figure.axes[1].get_ylabel() == "contact pressure (MPa)"


def test_islands_of_different_numbers_have_different_colours(made):
    state = made.closure(made.delta(made.heights())).state.isel(shear=0, step=-1)
    found = made.islands(state)
    map_, areas = plotting.islands(found).axes
    image = colours(map_)
    assert np.array_equal(np.all(image == OPEN, axis=-1), found.label.values == 0)
    assert map_.get_title(loc="left") == f"{int(found.n_islands)} islands"
    shown = np.asarray(areas.lines[0].get_xdata()) * 1e-6
    assert shown == pytest.approx(np.sort(found.area.values)[::-1])
    assert np.array_equal(areas.lines[0].get_ydata(), np.arange(1, found.sizes["island"] + 1))


def test_islands_of_several_masks_have_a_curve_each_and_the_last_is_mapped(made):
    import xarray as xr

    state = made.closure(made.delta(made.heights())).state.isel(shear=0)
    parts = [made.islands(state.isel(step=step)) for step in (3, 4)]
    areas = np.concatenate([part.area.values for part in parts])
    step = np.repeat([3, 4], [part.sizes["island"] for part in parts])
    data = {
        "label": (("step", "y", "x"), np.array([part.label.values for part in parts])),
        "area": ("island", areas),
    }
    coords = {"island_step": ("island", step), "y": state.y, "x": state.x, "step": [3, 4]}
    coords["normal_force"] = ("step", [1e4, 3e4])
    both = label(xr.Dataset(data, coords=coords))
    map_, curves = plotting.islands(both).axes
    assert np.array_equal(np.all(colours(map_) == OPEN, axis=-1), parts[1].label.values == 0)
    for line, part in zip(curves.lines, parts, strict=True):
        assert np.asarray(line.get_xdata()) * 1e-6 == pytest.approx(np.sort(part.area.values)[::-1])
    assert [text.get_text() for text in curves.artists[0].get_texts()] == ["10", "30"]


def test_scheme_is_drawn_from_the_cracks_numbers(made):
    face = made.heights()
    slid = made.delta(face, shears=(8e-3,))
    plan, cut = plotting.sliding_scheme(face, slid).axes
    start, moved = plan.patches
    assert start.get_x() - moved.get_x() == pytest.approx(8.0)  # to West
    assert start.get_y() == pytest.approx(moved.get_y())
    ground, block = (np.array([line.get_xdata(), line.get_ydata()]) for line in cut.lines[:2])
    lift = float(slid.max())
    row = face.sel(y=slid.y[slid.sizes["y"] // 2])
    assert ground[1] == pytest.approx(row.values[::-1] * 1e3)
    assert block[1] == pytest.approx((row.sel(x=slid.x).values[::-1] + lift) * 1e3)
    assert f"{lift * 1e6:.3g}" in cut.texts[-1].get_text()


def test_the_block_of_the_scheme_never_dips_into_the_face(made):
    face = made.heights()
    _, cut = plotting.sliding_scheme(face, made.delta(face)).axes
    ground, block = (np.array([line.get_xdata(), line.get_ydata()]) for line in cut.lines[:2])
    below = np.interp(block[0, 1:-1], *ground)
    assert (block[1, 1:-1] >= below - 1e-9).all()


def test_planes_without_x_and_y_are_refused(made):
    with pytest.raises(InvalidInput, match="dims"):
        plotting.face(made.estimates())
    with pytest.raises(InvalidInput, match="one shear"):
        plotting.face(made.delta(made.heights()))
