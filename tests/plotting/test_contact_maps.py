"""Maps of the contact state: every cell in its place, the right way up, in the right colour."""

import re

import numpy as np
import plotting_synthetic as synthetic
import pytest
import xarray as xr
from plotting_figures import CONTACT, OPEN, YIELDED, colours, figure_of, render

import fractalcontact as fc
from fractalcontact import plotting
from fractalcontact.base.errors import ConvergenceWarning, InvalidInput
from fractalcontact.base.schema import label


def test_state_colours():
    closed = synthetic.closure(synthetic.delta(synthetic.heights()))
    state = closed.state.isel(shear=0, step=-1).copy()
    state.values[2, 5] = 2
    result = closed.isel(shear=0, step=-1).assign(state=state)
    image = colours(plotting.plot(result, "contact_domains")[0])
    assert np.array_equal(np.all(image == CONTACT, axis=-1), state.values == 1)
    assert np.array_equal(np.all(image == YIELDED, axis=-1), state.values == 2)
    assert np.array_equal(np.all(image == OPEN, axis=-1), state.values == 0)


def test_load_path_at_chosen_shear():
    closed = synthetic.closure(synthetic.delta(synthetic.heights(), shears=(8e-4, 1.6e-3, 8e-3)))
    axes = plotting.plot(closed, "contact_domains", shear=1.5e-3, panels=3)
    steps = [1, 3, 4]  # evenly over the closure, the unloaded step left out
    for ax, step in zip(axes, steps, strict=True):
        expected = closed.sel(shear=1.6e-3).isel(step=step)
        assert np.array_equal(np.all(colours(ax) == CONTACT, axis=-1), expected.state.values == 1)
        assert f"{100 * float(expected.state.mean()):.2g} % in contact" in ax.get_title(loc="left")
        assert f"{float(expected.normal_force) / 1e3:g} kN" in ax.get_title(loc="left")
    assert "1.6 mm" in axes[0].figure.get_suptitle()


def test_titles_of_small_shares_stay_apart():
    state = np.zeros((4, 300, 300), np.int8)
    state[:, 0, 0] = 1  # 0.0011 %
    centres = 1e-4 * (np.arange(300) + 0.5)
    coords = {"step": np.arange(4), "y": centres, "x": centres}
    coords["normal_force"] = ("step", np.array([1.23e3, 2.34e3, 3.45e3, 4.56e3]))
    result = label(xr.Dataset({"state": (("step", "y", "x"), state)}, coords))
    for panels in (2, 3, 4):
        axes = plotting.plot(result, "contact_domains", zoom=0, panels=panels)
        render(axes)
        left, right = (ax._left_title.get_window_extent() for ax in axes[:2])
        assert "0.0011 % in contact" in axes[0].get_title(loc="left")
        assert right.x0 - left.x1 > 0.3 * axes[0].figure.dpi  # inches


def test_shear_path_at_chosen_force():
    closed = synthetic.closure(synthetic.delta(synthetic.heights(), shears=(8e-4, 1.6e-3, 8e-3)))
    axes = plotting.plot(closed, "contact_domains", normal_force=9e3)
    assert len(axes) == 3
    for ax, v in zip(axes, closed.shear, strict=True):
        assert np.array_equal(np.all(colours(ax) == CONTACT, axis=-1), closed.state.sel(shear=v, step=3) == 1)
        assert f"{float(v) * 1e3:g} mm" in ax.get_title(loc="left")
    assert "10 kN" in axes[0].figure.get_suptitle()


def test_common_force_is_written_once():
    closed = synthetic.closure(synthetic.delta(synthetic.heights(), shears=(8e-4, 1.6e-3)))
    force = closed.normal_force.values * (1 + 1e-9 * np.arange(2)[:, None])
    closed = closed.assign_coords(normal_force=(("shear", "step"), force))
    figure = figure_of(plotting.plot(closed, "contact_domains", normal_force=1e4))
    assert figure.get_suptitle() == "$F$ = 10 kN"
    force[1] *= 1.5
    closed = closed.assign_coords(normal_force=(("shear", "step"), force))
    assert figure_of(plotting.plot(closed, "contact_domains", normal_force=1e4)).get_suptitle() == ""


def test_unit_of_loads():
    closed = synthetic.closure(synthetic.delta(synthetic.heights(), shears=(8e-4,)), forces=(40.0, 4e3, 2e4))
    titles = [ax.get_title(loc="left") for ax in plotting.plot(closed, "contact_domains")]
    for title, force in zip(titles, ("0.04 kN", "4 kN", "20 kN"), strict=True):
        assert f"= {force}," in title


def test_shear_or_force_must_be_chosen():
    closed = synthetic.closure(synthetic.delta(synthetic.heights()))
    with pytest.raises(InvalidInput, match="exactly one"):
        plotting.plot(closed, "contact_domains")
    with pytest.raises(InvalidInput, match="exactly one"):
        plotting.plot(closed, "contact_domains", shear=8e-3, normal_force=1e3)


def test_mask_without_coordinates():
    mask = xr.DataArray(np.eye(12, dtype=bool), dims=("y", "x"), name="state")
    render(plotting.plot(mask, "contact_domains"))


def speckled(cells, spot):
    """Return a map of single cells in contact and one spot, 80 µm apart."""
    flags = np.zeros((cells, cells), dtype=np.int8)
    flags[::20, ::20] = 1
    flags[spot] = 1
    x = 8e-5 * (np.arange(cells) + 0.5)
    coords = {"y": x, "x": x, "normal_force": ("step", [5.0])}
    return label(xr.Dataset({"state": (("step", "y", "x"), flags[None])}, coords))


def test_dots_are_magnified_where_the_most_contacts_are():
    full, window = plotting.plot(speckled(240, np.s_[100:110, 181:191]), "contact_domains", zoom=40 * 8e-5)
    image = colours(window)
    assert image.shape == (40, 40, 3)
    assert np.all(image == CONTACT, axis=-1).sum() >= 100  # the whole spot, and some of the cells
    (frame,) = full.patches
    left, bottom = frame.get_xy()
    assert frame.get_width() == pytest.approx(3.2)
    assert left <= 181 * 0.08
    assert left + 3.2 >= 191 * 0.08
    assert bottom <= 100 * 0.08
    assert bottom + 3.2 >= 110 * 0.08
    assert "3.2 mm" in window.get_title(loc="left")
    render(full)


def test_titles_of_magnified_maps_stay_apart():
    force = ("step", 6.55 * 5.0 ** np.arange(6), {"units": "N"})
    paths = speckled(240, np.s_[100:101, 181:191]).isel(step=[0] * 6).assign_coords(normal_force=force)
    axes = plotting.plot(paths, "contact_domains")
    figure_of(axes).draw_without_rendering()
    width = axes[0].get_window_extent().width
    assert len(axes) == 8
    for ax in axes:
        titles = ax.findobj(lambda each: "$\\bf{" in getattr(each, "get_text", str)())
        assert [title.get_window_extent().width < width for title in titles] == [True]


def test_only_maps_of_small_cells_are_magnified():
    assert len(plotting.plot(speckled(240, 0), "contact_domains")) == 2
    assert len(plotting.plot(speckled(240, 0), "contact_domains", zoom=0)) == 1
    assert len(plotting.plot(speckled(24, 0), "contact_domains")) == 1


def test_states_beyond_full_contact_are_shown_by_their_closure():
    """No force is determined there: it named maps `F = nan N`, and cells that touch then never touched."""
    heights = fc.surfaces.spectral((32, 32), 1e-6, hurst=0.8, rms_slope=0.1, rng=1)
    closures = [0.3e-6, 4e-6, 5e-6]
    with pytest.warns(ConvergenceWarning):
        pressed = fc.contact.press(heights, contact_modulus=1e9, closure=closures)
    ax = plotting.plot(pressed, "first_contact")
    assert ax.figure.axes[1].get_ylabel() == "closure $w$ of first contact (µm)"
    assert not np.all(colours(ax) == OPEN, axis=-1).any()
    titles = [panel.get_title(loc="left") for panel in plotting.plot(pressed, "contact_domains")]
    assert [re.findall(r"= (\S+) µm", title)[0] for title in titles] == ["0.3", "4", "5"]
    shown = plotting.islands(fc.domains.islands(pressed["state"]))
    assert "$w$ = 5 µm" in shown[0].get_title(loc="left")
    assert plotting.path(pressed, "contact_fraction").get_xlabel() == "closure $w$ (µm)"
