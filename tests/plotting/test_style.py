"""What every figure keeps to: it returns what it drew on, in the style in use, and pyplot shows it once."""

import inspect
import subprocess
import sys

import numpy as np
import plotting_synthetic as synthetic
import pytest
import xarray as xr
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from plotting_figures import figure_of

from fractalcontact import plotting
from fractalcontact.base.errors import InvalidInput

FIGURES = [name for name in plotting.__all__ if name not in ("draw", "datasheet")]


def calls(study):
    """Return for every figure of the synthetic study the function and its data."""
    closed = study["joints/closure"].to_dataset()
    opening = study["joints/elastic_dilatancy"].to_dataset()
    lower = study["surfaces"].to_dataset()
    return {
        "surface": (plotting.surface, (lower,), {}),
        "closure_laws": (plotting.closure_laws, (closed,), {"marked": (1, 2)}),
        "contact_area": (plotting.contact_area, (closed,), {}),
        "contact_domains": (plotting.contact_domains, (closed,), {"shear": 8e-4}),
        "path": (plotting.path, (closed, "contact_fraction"), {}),
        "dilatancy": (plotting.dilatancy, (opening.isel(direction=0),), {}),
        "friction": (plotting.friction, (study["joints/friction"].to_dataset().isel(direction=0),), {}),
        "hydraulic_aperture": (plotting.hydraulic_aperture, (study["joints/transmissivity"],), {}),
        "box_dimension": (plotting.box_dimension, (study["domains/box_dimension"],), {}),
        "lacunarity": (plotting.lacunarity, (study["domains/lacunarity"],), {}),
        "islands": (plotting.islands, (study["domains/islands"],), {}),
        "field": (plotting.field, (study["domains/islands"]["label"],), {}),
        "dimensions": (plotting.dimensions, (study["dimensions"],), {}),
        "dimension_curves": (plotting.dimension_curves, (study["dimensions"],), {}),
    }


NAMES = sorted(calls(synthetic.study()))


def draw(study, name, **options):
    drawing, data, more = calls(study)[name]
    return drawing(*data, **more, **options)


@pytest.mark.parametrize("name", FIGURES)
def test_takes_axes(name):
    parameters = inspect.signature(getattr(plotting, name)).parameters
    assert len({"ax", "axes"} & set(parameters)) == 1


@pytest.mark.parametrize("name", NAMES)
def test_returns_what_was_drawn_on_and_opens_one_figure(study, name):
    drawn = draw(study, name)
    assert all(isinstance(ax, Axes) and ax.has_data() for ax in np.ravel(np.array(drawn, dtype=object)))
    assert [plt.figure(number) for number in plt.get_fignums()] == [figure_of(drawn)]


@pytest.mark.parametrize("name", NAMES)
def test_draws_on_given_axes_only(study, name):
    sheet = Figure(figsize=(12, 12))
    first = np.ravel(np.array(draw(study, name), dtype=object))
    plt.close("all")
    axes = sheet.subplots(4, 3).ravel()[: first.size]
    expected = axes[0] if "ax" in inspect.signature(getattr(plotting, name)).parameters else axes
    drawn = draw(study, name, **({"ax": axes[0]} if expected is axes[0] else {"axes": axes}))
    assert np.array_equal(np.ravel(np.array(drawn, dtype=object)), np.ravel(np.array(expected, dtype=object)))
    assert plt.get_fignums() == []
    assert sheet.get_suptitle() == ""


def test_wrong_number_of_axes_is_refused(study):
    with pytest.raises(InvalidInput, match="2 Axes"):
        plotting.islands(study["domains/islands"], axes=Figure().subplots(1, 3))
    with pytest.raises(InvalidInput, match="sequence of Axes"):
        plotting.islands(study["domains/islands"], axes="left")


def texts(figure):
    """Return every text that is shown, with its place in pixels."""
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


@pytest.mark.parametrize("name", NAMES)
def test_text_is_readable_in_a_dark_style(study, name):
    with plt.style.context(["default", "dark_background"]):
        figure = figure_of(draw(study, name))
    assert to_rgb(figure.get_facecolor()) == (0, 0, 0)
    shown = [t for t in texts(figure) if not (t.axes is not None and t.axes.images)]  # not on a map
    assert shown
    for text in shown:
        if text.get_path_effects():  # outlined
            continue
        assert contrast(text.get_color(), "black") > 3, text.get_text()


@pytest.mark.parametrize("size", [9.0, 16.0])
def test_size_of_text_is_that_of_the_style(study, size):
    with plt.style.context(["default", {"font.size": size}]):
        ax = plotting.closure_laws(study["joints/closure"])
        assert ax.xaxis.label.get_size() == size
        assert ax.get_xticklabels()[0].get_size() == size
        assert ax.title.get_size() == pytest.approx(1.2 * size)
        assert ax.artists[0].get_texts()[0].get_size() == size
        assert ax.figure.get_size_inches()[0] == pytest.approx(5.2 * size / 9.0)


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
    subprocess.run([sys.executable, "-c", script], check=True, timeout=120)
