"""Map and area distribution of islands."""

import numpy as np
import plotting_synthetic as synthetic
import pytest
import xarray as xr
from plotting_figures import OPEN, colours

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
    assert [text.get_text() for text in curves.artists[0].get_texts()] == ["10", "30"]
