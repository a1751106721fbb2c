"""What every figure keeps to: it returns what it drew on, in the style in use, and pyplot shows it once."""

import numpy as np
import pytest
import xarray as xr
from calls import CALLS, KINDS, figure_name, function_of, options_of
from copies import copied_command
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from plotting_figures import figure_of

from fractalcontact import plotting
from fractalcontact.base.errors import InvalidInput

FIGURES = list(KINDS)


def draw(name, **options):
    """Draw a kind of figure of what `CALLS` has for it."""
    name = figure_name(name)
    return function_of(name)(**CALLS[name](), **options)


def panels(drawn):
    return np.ravel(np.array(drawn, dtype=object))


@pytest.mark.parametrize("name", FIGURES)
def test_takes_axes(name):
    assert len({"ax", "axes"} & set(options_of(name))) == 1


@pytest.mark.parametrize("name", FIGURES)
def test_axes_are_returned_and_readable_in_a_dark_style(name):
    """The Axes are returned, on a new figure of pyplot or as they were given."""
    with plt.style.context(["default", "dark_background"]):
        drawn = draw(name)
        assert all(isinstance(ax, Axes) and ax.has_data() for ax in panels(drawn))
        assert [plt.figure(number) for number in plt.get_fignums()] == [figure_of(drawn)]
        _require_readable(figure_of(drawn))
    plt.close("all")
    is_polar = panels(drawn)[0].name == "polar"
    sheet = Figure(figsize=(12, 12))
    projection = {"projection": "polar" if is_polar else None}
    axes = sheet.subplots(1, panels(drawn).size, squeeze=False, subplot_kw=projection).ravel()
    is_single = "ax" in options_of(name)
    again = draw(name, **({"ax": axes[0]} if is_single else {"axes": axes}))
    assert np.array_equal(panels(again), axes)
    assert plt.get_fignums() == []
    assert sheet.get_suptitle() == ""


def test_wrong_number_of_axes_is_refused(study):
    with pytest.raises(InvalidInput, match="2 Axes"):
        plotting.islands(study["domains/islands"], axes=Figure().subplots(1, 3))
    with pytest.raises(InvalidInput, match="sequence of Axes"):
        plotting.islands(study["domains/islands"], axes="left")


def texts(figure):
    """Return every text that is shown; the labels of ticks exist once the figure is drawn."""
    figure.set_layout_engine("none")
    figure.draw_without_rendering()
    return [
        text
        for text in figure.findobj(plt.Text)
        if text.get_visible() and text.get_text().strip() and text.axes not in _maps(figure)
    ]


def _maps(figure):
    return [ax for ax in figure.axes if ax.images and not ax.texts]


def luminance(colour):
    parts = np.array(to_rgb(colour))
    return float(
        np.where(parts <= 0.03928, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4) @ (0.2126, 0.7152, 0.0722)
    )


def contrast(one, other):
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def _require_readable(figure):
    """Require text on black that contrasts with it."""
    assert to_rgb(figure.get_facecolor()) == (0, 0, 0)
    shown = [t for t in texts(figure) if not (t.axes is not None and t.axes.images)]  # not on a map
    assert shown or all(ax.images for ax in figure.axes)
    for text in shown:
        if not text.get_path_effects():  # outlined
            assert contrast(text.get_color(), "black") > 3, text.get_text()


@pytest.mark.parametrize("size", [9.0, 16.0])
def test_size_of_text_is_that_of_the_style(study, size):
    with plt.style.context(["default", {"font.size": size}]):
        ax = plotting.plot(study["joints/closure"], "closure")
        assert ax.xaxis.label.get_size() == size
        assert ax.get_xticklabels()[0].get_size() == size
        assert ax.title.get_size() == pytest.approx(1.2 * size)
        assert ax.artists[0].get_texts()[0].get_size() == size
        assert ax.figure.get_size_inches()[0] == pytest.approx(5.2 * size / 9.0)


def test_logarithmic_axes_have_small_ticks_at_two_and_five():
    lag = np.geomspace(1e-4, 1.0, 9)  # m: four decades; of the variogram nine
    curve = xr.Dataset({"variogram": ("lag", 1e-3 * lag**2.25)}, {"lag": lag})
    upper = plotting.plot(curve, "dimension_curves")[0, 0]
    for axis in (upper.xaxis, upper.yaxis):
        ticks = np.log10(axis.get_minorticklocs())
        assert set(np.round(10 ** (ticks - np.floor(ticks + 1e-9)), 6)) == {2.0, 5.0}
        assert ticks.size >= 2 * (np.ptp(np.log10(axis.get_view_interval())) - 1)


def test_no_setting_is_left_changed(study, tmp_path):
    before = dict(plt.rcParams)
    plotting.draw(xr.DataTree.from_dict({"/dimensions": study["dimensions"].to_dataset()}), tmp_path)
    plotting.dimensions(study["dimensions"])
    assert dict(plt.rcParams) == before


def test_a_notebook_shows_each_figure_once():
    """Run a cell as a notebook does: the figures that pyplot keeps are shown at its end, and closed."""
    pytest.importorskip("IPython")
    pytest.importorskip("matplotlib_inline")
    script = """
import matplotlib
matplotlib.use("module://matplotlib_inline.backend_inline")
from IPython.core.interactiveshell import InteractiveShell
shell = InteractiveShell.instance()
shown = []
import matplotlib_inline.backend_inline as inline
inline.display = lambda figure, **options: shown.append(figure)
shell.run_cell("%matplotlib inline")
result = shell.run_cell(
    "import fractalcontact as fc\\n"
    "surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)\\n"
    "fc.plotting.surface(surface)\\n"
)
result.raise_error()
inline.flush_figures()
assert len(shown) == 1, shown
assert not hasattr(result.result, "_repr_png_")
import matplotlib.pyplot as plt
assert plt.get_fignums() == []
"""
    done = copied_command(program=script)
    assert done.returncode == 0, done.stderr
