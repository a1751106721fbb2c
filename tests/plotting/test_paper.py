"""The figures of the 1998 paper from a study, as computed and as read from a file."""

import numpy as np
import pytest
import xarray as xr
from plotting_figures import figure_of

import fractalcontact as fc
from fractalcontact import plotting
from fractalcontact.base.errors import InvalidInput


def part(tree, *paths):
    return xr.DataTree.from_dict({f"/{path}": tree[path].to_dataset(inherit=False) for path in paths})


@pytest.mark.parametrize("number", range(1, 6))
def test_saved_study_gives_same_figure(study, tmp_path, number):
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    def pixels(tree):
        canvas = FigureCanvasAgg(figure_of(plotting.paper_figure(tree, number)))
        canvas.draw()
        return np.asarray(canvas.buffer_rgba())

    again = fc.open(fc.save(study, tmp_path / "result.nc"))
    assert np.array_equal(pixels(study), pixels(again))


def test_missing_data_is_reported(study):
    with pytest.raises(InvalidInput, match="data for figure 3 in joints/closure"):
        plotting.paper_figure(part(study, "surfaces"), 3)
    with pytest.raises(InvalidInput, match="<= 5, got 6"):
        plotting.paper_figure(study, 6)


def test_shear_near_a_fiftieth_of_the_block(study):
    # the block is 19.2 mm wide: 0.8 mm is nearer to a fiftieth of it than 1.6 or 8 mm
    figure = figure_of(plotting.paper_figure(study, 4))
    assert "0.8 mm" in figure.get_suptitle()


def test_letters_match_between_curve_and_maps(study):
    laws = plotting.paper_figure(study, 3)[0]
    maps = plotting.paper_figure(study, 4)
    on_the_curve = [text.get_text() for text in laws.texts]
    on_the_maps = [ax.get_title(loc="left")[5] for ax in maps]
    assert on_the_curve == on_the_maps == list("ABCD")
