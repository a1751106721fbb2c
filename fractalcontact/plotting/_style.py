"""The decisions of taste, in one place: sizes, colours, lines, keys."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

P = ParamSpec("P")
R = TypeVar("R")

DPI = 150
WIDTH = 7.2  # inches, of a figure with several panels
PANEL = (5.2, 3.5)  # inches, of a figure with one panel and its key

# Okabe and Ito (2008): told apart by every kind of colour vision
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
HEIGHT_MAP, FIELD_MAP, FAMILY_MAP = "cividis", "viridis", "viridis"
FAMILY_END = 0.86  # the palest end of the map cannot be read on white
LONGEST_KEY = 8
WIDE = 30.0  # ratio of the numbers on an axis beyond which it is logarithmic

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
    """Draw inside the house style, and leave the caller's settings as they were."""

    @functools.wraps(function)
    def drawn(*arguments: P.args, **options: P.kwargs) -> R:
        import matplotlib

        with matplotlib.rc_context(RC):
            return function(*arguments, **options)

    return drawn


def canvas(ax: Axes | None, size: tuple[float, float] = PANEL) -> tuple[Figure, Axes]:
    """Return the axes to draw on and the figure they are in; a new one unless given."""
    if ax is None:
        ax = sheet(None, size).add_subplot()
    dress(ax)
    return root(ax), ax


def sheet(figure: Figure | SubFigure | None, size: tuple[float, float]) -> Any:
    """Return the (sub)figure to put panels on; a new one unless given."""
    if figure is not None:
        return figure
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    return Figure(figsize=size, layout=ConstrainedLayoutEngine(w_pad=0.07, h_pad=0.07))


def root(part: Any) -> Figure:
    """Return the figure that axes or a subfigure belong to."""
    whole: Figure = part.get_figure(root=True)
    return whole


def dress(ax: Axes) -> None:
    """Fix what matplotlib would otherwise look up when the figure is rendered, outside the house style."""
    ax.tick_params(which="both", labelsize=RC["xtick.labelsize"], color=INK, labelcolor=INK)
    ax.grid(True, color=PALE, linewidth=0.6)


def boxed(ax: Axes, colour: str = INK) -> None:
    """Frame a picture on all four sides."""
    ax.grid(False)
    for spine in ax.spines.values():
        spine.set(visible=True, linewidth=0.6, color=colour)


def family(count: int) -> list[Any]:
    """Return one colour for each member of an ordered family of curves, dark to light."""
    import matplotlib

    colours = matplotlib.colormaps[FAMILY_MAP]
    return [colours(place) for place in np.linspace(0.0, FAMILY_END, max(count, 2))[:count]]


def key(ax: Axes, title: str, labels: Sequence[str], colours: Sequence[Any]) -> None:
    """Name the curves of an ordered family beside the axes; of a long family only some are named."""
    from matplotlib.lines import Line2D

    if not labels:
        return
    shown = chosen(len(labels), LONGEST_KEY)
    entries = [Line2D([], [], color=colours[i], label=labels[i]) for i in shown]
    beside(ax, entries, title=title)


def beside(ax: Axes, entries: Sequence[Any], *, title: str = "", low: bool = False) -> None:
    """Put a legend to the right of the axes, outside the data: at their top, or with `low` at their foot."""
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
    legend.set_clip_on(False)  # else the layout takes it for hidden, and leaves it no room


def line_entry(label: str, **style: Any) -> Any:
    """Return one entry of a legend that tells a kind of line."""
    from matplotlib.lines import Line2D

    return Line2D([], [], label=label, **{"color": GREY, **style})


def chosen(count: int, most: int) -> list[int]:
    """Return at most `most` of the indices 0 ... count - 1, evenly spread, ends included."""
    if count <= 0:
        return []
    return sorted({round(float(i)) for i in np.linspace(0, count - 1, min(count, most))})


def letter(number: int) -> str:
    """Return A, B, C ... for the points that are marked on a curve and shown as maps."""
    return chr(ord("A") + number) if number < 26 else str(number + 1)


def halo() -> list[Any]:
    """Return the effect that keeps words readable where they cross a line."""
    from matplotlib.patheffects import withStroke

    return [withStroke(linewidth=2.0, foreground="white")]


def log_scale(ax: Axes, *, x: Any = None, y: Any = None) -> None:
    """Set logarithmic axes, those for which there is anything positive to show."""
    for values, setter in ((x, ax.set_xscale), (y, ax.set_yscale)):
        if values is not None and np.any(np.asarray(values, dtype=float) > 0):
            setter("log")


def wide(values: Any) -> bool:
    """Tell whether positive numbers spread so widely that only a logarithmic axis shows them."""
    shown = np.asarray(values, dtype=float)
    shown = shown[np.isfinite(shown)]
    return bool(shown.size and shown.min() > 0 and shown.max() > WIDE * shown.min())


def plain_ticks(ax: Axes) -> None:
    """Write the numbers of logarithmic axes plainly (0.1, 1, 10), and more than one of them."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for axis in (ax.xaxis, ax.yaxis):
        if axis.get_scale() != "log":
            continue
        low, high = sorted(axis.get_view_interval())
        if low < 1e-3 or high > 1e6:
            continue  # powers of ten read better there
        narrow = high / low < 50
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if narrow else (1.0,), numticks=12))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())


def say(ax: Axes, text: str) -> None:
    """Write a remark in the middle of axes that have nothing to show."""
    ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", va="center", color=GREY)
