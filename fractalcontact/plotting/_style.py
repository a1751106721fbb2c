"""Sizes, colours, line styles and legends shared by all figures."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import numpy as np

from fractalcontact.base.numbers import is_real, number_of_entries
from fractalcontact.base.validation import Problems, Words

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

P = ParamSpec("P")
R = TypeVar("R")

DPI = 150
WIDTH = 7.2  # inches, a figure with several panels
PANEL = (5.2, 3.5)  # inches, a figure with one panel and its legend

# Okabe and Ito (2008): distinguishable with every kind of colour vision
BLACK, ORANGE, SKY, GREEN, BLUE, RED, PURPLE = (
    "#000000",
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#0072B2",
    "#D55E00",
    "#CC79A7",
)
CYCLE = (BLUE, RED, GREEN, PURPLE, ORANGE, SKY, BLACK)
DIRECTION_COLOURS = {"E": RED, "N": GREEN, "W": BLUE, "S": ORANGE}
DIRECTION_LINES = {"E": "-", "N": "--", "W": "-", "S": "--"}
INK, GREY, PALE, MISSING = "#222222", "#6B6B6B", "#E4E4E4", "#D9D9D9"
STATE_COLOURS = ("#F2F0E9", "#12355B", RED)  # open, contact, yielded
SLIP_COLOURS = (STATE_COLOURS[0], STATE_COLOURS[1], ORANGE)  # open, stick, slip
HEIGHT_MAP, FIELD_MAP, SEQUENCE_MAP = "cividis", "viridis", "viridis"
SEQUENCE_END = 0.86  # the lightest colours of the map cannot be read on white
MAX_LEGEND_ENTRIES = 8
MAX_MARKED_POINTS = 15  # a curve with more points is drawn without markers
NULL_LINE: dict[str, Any] = {"ls": (0, (4, 2)), "lw": 0.9}  # the random null beside a measured curve
LOG_AXIS_RATIO = 30.0  # an axis is logarithmic when largest / smallest value exceeds this

RC: dict[Any, Any] = {
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.labelsize": 9.0,
    "axes.titlelocation": "left",
    "axes.titley": 1.0,  # no panel has ticks above it; looking for them takes a tenth of the time
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": PALE,
    "grid.linewidth": 0.6,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "lines.linewidth": 1.5,
    "lines.markersize": 4.0,
    "legend.frameon": False,
    "legend.fontsize": 8.0,
    "legend.title_fontsize": 8.0,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
    "savefig.dpi": DPI,
    "figure.dpi": DPI,
    "text.color": INK,
}


def styled(function: Callable[P, R]) -> Callable[P, R]:
    """Check the options by their declared types, and draw with the settings `RC`, which are restored."""
    signature = inspect.signature(function)
    where = f"fc.plotting.{function.__name__}"

    @functools.wraps(function)
    def wrapper(*arguments: P.args, **options: P.kwargs) -> R:
        import matplotlib

        with Problems(where) as problems:
            for name, value in signature.bind(*arguments, **options).arguments.items():
                _check_option(problems, name, value, str(signature.parameters[name].annotation))
        with matplotlib.rc_context(RC):
            return function(*arguments, **options)

    return wrapper


def _check_option(problems: Problems, name: str, value: Any, declared: str) -> None:
    """Check the value of an option whose annotation is one of a few; data are checked where they are read."""
    from matplotlib.axes import Axes
    from matplotlib.figure import FigureBase

    words = declared.split(" | ")
    optional = "None" in words
    if words[0] == "Axes":
        problems.require(value is None or isinstance(value, Axes), name, "an Axes, or None", value)
    elif words[0] == "Figure":
        expected = "a Figure or SubFigure, or None"
        problems.require(value is None or isinstance(value, FigureBase), name, expected, value)
    elif words[0] == "bool":
        problems.boolean(name, value)
    elif words[0] == "str":
        problems.require(isinstance(value, str) or (optional and value is None), name, "words", value)
    elif words[0] == "int":
        problems.integer(name, value, at_least=1)
    elif words[0] == "float":
        plain = is_real(value) or value is None  # a labelled number would carry its dims into the figure
        problems.number(name, value if plain else Words(type(value).__name__), optional=optional)
    elif words[0] == "Sequence[str]":
        valid = isinstance(value, (list, tuple)) and all(isinstance(word, str) for word in value)
        problems.require(valid or (optional and value is None), name, "a sequence of words", value)
    elif words[0].startswith(("Sequence[", "tuple[")) and not (optional and value is None):
        pair = words[0].startswith("tuple[")
        expected = "two numbers" if pair else "a sequence of numbers"
        size = number_of_entries(value) if isinstance(value, (list, tuple, np.ndarray)) else None
        if problems.require(size is not None and (size == 2 or not pair), name, expected, value) and size:
            problems.numbers(name, value)


def axes_or_new(ax: Axes | None, size: tuple[float, float] = PANEL) -> tuple[Figure, Axes]:
    """Return the root figure and the axes to draw on; both are new if `ax` is None."""
    if ax is None:
        ax = figure_or_new(None, size).add_subplot()
    style_axes(ax)
    return root_figure(ax), ax


def figure_or_new(figure: Figure | SubFigure | None, size: tuple[float, float]) -> Any:
    """Return the (sub)figure for the panels; a new one if `figure` is None."""
    if figure is not None:
        return figure
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    return Figure(figsize=size, layout=ConstrainedLayoutEngine(w_pad=0.07, h_pad=0.07))


def root_figure(part: Any) -> Figure:
    """Return the figure that axes or a subfigure belong to."""
    figure: Figure = part.get_figure(root=True)
    return figure


def style_axes(ax: Axes) -> None:
    """Set what matplotlib looks up only when the figure is rendered, outside the context of `RC`."""
    ax.tick_params(which="both", labelsize=RC["xtick.labelsize"], color=INK, labelcolor=INK)
    ax.grid(True, color=PALE, linewidth=0.6)


def draw_frame(ax: Axes, colour: str = INK) -> None:
    """Draw a frame on all four sides of a map."""
    ax.grid(False)
    for spine in ax.spines.values():
        spine.set(visible=True, linewidth=0.6, color=colour)


def sequence_colours(count: int) -> list[Any]:
    """Return colours for an ordered set of curves, dark to light."""
    import matplotlib

    colours = matplotlib.colormaps[SEQUENCE_MAP]
    return [colours(position) for position in np.linspace(0.0, SEQUENCE_END, max(count, 2))[:count]]


def sequence_legend(ax: Axes, title: str, labels: Sequence[str], colours: Sequence[Any]) -> None:
    """Put a legend of an ordered set of curves beside the axes; a long legend is thinned out."""
    from matplotlib.lines import Line2D

    if not labels:
        return
    shown = spread_indices(len(labels), MAX_LEGEND_ENTRIES)
    entries = [Line2D([], [], color=colours[i], label=labels[i]) for i in shown]
    side_legend(ax, entries, title=title)


def side_legend(ax: Axes, entries: Sequence[Any], *, title: str = "", low: bool = False) -> None:
    """Put a legend to the right of the axes: at the top, or at the bottom with `low`."""
    from matplotlib.legend import Legend

    if not entries:
        return
    legend = Legend(
        ax,
        list(entries),
        [entry.get_label() for entry in entries],
        title=title or None,
        loc="lower left" if low else "upper left",
        bbox_to_anchor=(1.0, 0.0 if low else 1.0),
        alignment="left",
        borderaxespad=0.3,
        handlelength=1.6,
        labelspacing=0.35,
    )
    ax.add_artist(legend)
    legend.set_clip_on(False)  # a clipped artist is ignored by the layout and would be cut off


def legend_line(label: str, **style: Any) -> Any:
    """Return a legend entry that shows a line style."""
    from matplotlib.lines import Line2D

    return Line2D([], [], label=label, **{"color": GREY, **style})


def spread_indices(count: int, most: int) -> list[int]:
    """Return at most `most` of the indices 0 ... count - 1, evenly spread and including both ends."""
    if count <= 0:
        return []
    return sorted({round(float(i)) for i in np.linspace(0, count - 1, min(count, most))})


def letter(number: int) -> str:
    """Return A, B, C ... for points marked on a curve and shown as maps."""
    return chr(ord("A") + number) if number < 26 else str(number + 1)


def halo() -> list[Any]:
    """Return a white outline that keeps text readable where it crosses a line."""
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=2.0, foreground="white")]


def log_scale(ax: Axes, *, x: Any = None, y: Any = None) -> None:
    """Make an axis logarithmic if it has any positive value to show."""
    for values, setter in ((x, ax.set_xscale), (y, ax.set_yscale)):
        if values is not None and np.any(np.asarray(values, dtype=float) > 0):
            setter("log")


def needs_log_axis(values: Any) -> bool:
    """Return True for positive values whose ratio exceeds `LOG_AXIS_RATIO`."""
    shown = np.asarray(values, dtype=float)
    shown = shown[np.isfinite(shown)]
    return bool(shown.size and shown.min() > 0 and shown.max() > LOG_AXIS_RATIO * shown.min())


def plain_ticks(ax: Axes) -> None:
    """Label logarithmic axes with plain numbers (0.1, 1, 10), at least two of them where possible."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for axis in (ax.xaxis, ax.yaxis):
        if axis.get_scale() != "log":
            continue
        low, high = sorted(axis.get_view_interval())
        if low < 1e-3 or high > 1e6:
            continue  # powers of ten are easier to read there
        narrow = high / low < 50
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if narrow else (1.0,), numticks=12))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())


def write_in_empty_axes(ax: Axes, text: str) -> None:
    """Write a note in the middle of axes without data."""
    ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", va="center", color=GREY)


def log_x_if_wide(ax: Axes, values: Any) -> None:
    """Make the x axis logarithmic where the positive values on it span more than `LOG_AXIS_RATIO`."""
    if needs_log_axis(values):
        ax.set_xscale("log")
        plain_ticks(ax)
