"""Map and area distribution of islands."""

import numpy as np
import plotting_synthetic as synthetic
import pytest
import xarray as xr
from matplotlib.cbook import STEP_LOOKUP_MAP
from plotting_figures import OPEN, colours

import fractalcontact as fc
from fractalcontact import plotting
from fractalcontact.base.schema import label


def test_map_and_area_distribution():
    state = synthetic.closure(synthetic.delta(synthetic.heights())).state.isel(shear=0, step=-1)
    result = synthetic.islands(state)
    map_, areas = plotting.islands(result)
    image = colours(map_)
    assert np.array_equal(np.all(image == OPEN, axis=-1), result.label.values == 0)
    assert map_.get_title(loc="left") == f"{int(result.n_islands)} islands"
    shown = np.asarray(areas.lines[0].get_xdata()) * 1e-6
    assert shown == pytest.approx(np.sort(result.area.values)[::-1])
    assert np.array_equal(areas.lines[0].get_ydata(), np.arange(1, result.sizes["island"] + 1))
    assert areas.get_xscale() == "log" or np.unique(result.area).size == 1
    assert areas.get_yscale() == "log"


def test_several_masks():
    state = synthetic.closure(synthetic.delta(synthetic.heights())).state.isel(shear=0)
    parts = [synthetic.islands(state.isel(step=step)) for step in (3, 4)]
    areas = np.concatenate([part.area.values for part in parts])
    step = np.repeat([3, 4], [part.sizes["island"] for part in parts])
    data = {
        "label": (("step", "y", "x"), np.array([part.label.values for part in parts])),
        "area": ("island", areas),
    }
    coords = {"island_step": ("island", step), "y": state.y, "x": state.x, "step": [3, 4]}
    coords["normal_force"] = ("step", [1e4, 3e4])
    both = label(xr.Dataset(data, coords=coords))
    map_, curves = plotting.islands(both)
    assert np.array_equal(np.all(colours(map_) == OPEN, axis=-1), parts[1].label.values == 0)
    for line, part in zip(curves.lines, parts, strict=True):
        assert np.asarray(line.get_xdata()) * 1e-6 == pytest.approx(np.sort(part.area.values)[::-1])
    assert legend_of(curves) == ["10", "30"]
    assert map_.get_title(loc="left").endswith("\n$F$ = 30 kN")


def legend_of(ax):
    return [text.get_text() for legend in ax.artists for text in legend.get_texts()]


def test_every_curve_and_the_map_name_their_shear_and_load():
    result = fc.domains.islands(synthetic.closure(synthetic.delta(synthetic.heights())).state, keep=["label"])
    map_, curves = plotting.islands(result)
    names = legend_of(curves)
    assert len(names) == len(set(names)) == len(curves.lines) == 8
    assert all(name.startswith("$v$ = ") and name.endswith(" kN") for name in names)
    assert map_.get_title(loc="left").partition("\n")[2] == names[-1] == "$v$ = 8 mm, $F$ = 30 kN"
    assert [line.get_label() for line in curves.lines] == [f"islands, {name}" for name in names]


@pytest.mark.parametrize("dims", [("step",), ("member", "step"), ("member",)])
def test_masks_without_loads_are_numbered(dims):
    cells = np.random.default_rng(1).random((*range(2, 2 + len(dims)), 16, 16)) > 0.8
    centres = {dim: (dim, 1e-4 * (np.arange(16) + 0.5), {"units": "m"}) for dim in ("y", "x")}
    mask = xr.DataArray(cells, centres, dims=(*dims, "y", "x"))
    map_, curves = plotting.islands(fc.domains.islands(mask, keep=["label"]))
    names = legend_of(curves)
    assert len(set(names) - {"step"}) == len(curves.lines) == np.prod(cells.shape[:-2])
    last = ", ".join(f"{dim} {size - 1}" for dim, size in zip(dims, cells.shape, strict=False))
    assert map_.get_title(loc="left").partition("\n")[2] == last


def test_the_number_between_two_areas_is_that_of_the_larger_island():
    mask = np.zeros((20, 20), dtype=bool)
    mask[1:11, 1:11] = mask[15, 15] = True  # islands of 100 and 1 cells
    centres = 1e-3 * np.arange(20)
    result = fc.domains.islands(xr.DataArray(mask, {"y": centres, "x": centres}, ("y", "x")))
    line = plotting.islands(result)[1].lines[0]
    areas, numbers = STEP_LOOKUP_MAP[line.get_drawstyle()](*line.get_data())
    is_level = np.diff(areas) < 0.0
    assert numbers[:-1][is_level].tolist() == numbers[1:][is_level].tolist() == [1]


def test_masks_without_coordinates_are_drawn_in_cells():
    cells = np.random.default_rng(2).random((3, 32, 32)) > np.array([0.95, 0.9, 2.0])[:, None, None]
    mask = xr.DataArray(cells, dims=("step", "y", "x"))
    result = fc.domains.islands(mask)
    assert result.largest_island.attrs["comment"] == "in cells; NaN where the set is empty"
    map_, areas = plotting.islands(result)
    assert areas.get_xlabel() == "island area (cells)"
    assert map_.get_xlabel() == "$x$ (cells)"
    np.testing.assert_array_equal(
        areas.lines[0].get_xdata(), np.sort(result.cells[result.island_step == 0])[::-1]
    )
    for figure, of_mask in (
        (plotting.signature, fc.domains.signature),
        (plotting.lacunarity, fc.domains.lacunarity),
        (plotting.signature, fc.domains.box_counts),
    ):
        (ax,) = figure(of_mask(mask))
        assert ax.get_xlabel() == "box size (cells)"
    evolution = fc.domains.evolution(mask)
    assert plotting.evolution(evolution)[0].get_xlabel() == "step"
    assert plotting.path(evolution, "hausdorff_distance").get_ylabel().endswith("(cells)")
    assert plotting.box_dimension(fc.domains.box_dimension(mask))[0].get_xlabel() == "coverage (%)"
