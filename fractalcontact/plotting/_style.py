"""Axes and figures to draw on, and sizes, colours, line styles and legends shared by all figures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from fractalcontact.base.validation import require

if TYPE_CHECKING:
    import matplotlib.axes
    import matplotlib.figure

# names of types that are loaded only to draw
Axes: TypeAlias = "matplotlib.axes.Axes"
Figure: TypeAlias = "matplotlib.figure.Figure"
AxesArray: TypeAlias = np.ndarray[Any, np.dtype[Any]]  # of Axes
# the Axes of the panels, or a figure or subfigure in which they are made
Panels: TypeAlias = "Sequence[Axes] | AxesArray | Figure | matplotlib.figure.SubFigure"

STYLE = "fractalcontact.plotting.report"  # the style of the files that `draw` writes
# inches, of figures with text of 9 points
WIDTH = 7.2  # with several panels: A4 less margins of 13 mm
ROW = (WIDTH, 3.1)  # of panels side by side: the axes are 2.2 to 2.6 high
WIDE_ROW = (WIDTH + 0.6, 3.1)  # one beside a legend of many curves, or the bar of a map
PANEL = (5.2, 3.5)  # with one panel and its legend: the axes are 3.3 to 3.5 wide and 3 high
MAP = (4.6, 3.8)  # with one map and its colour bar: a square map has edges of 3.3
COLUMNS = 3  # of panels, at most: their axes are 1.7 wide, those of four 1.1, less than the name of an axis

# Okabe and Ito (2008): distinguishable with every kind of colour vision
ORANGE, SKY, GREEN, BLUE, RED, PURPLE = ("#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7")
COLOURS = (BLUE, RED, GREEN, PURPLE, ORANGE, SKY)
DIRECTION_COLOURS = {"E": RED, "N": GREEN, "W": BLUE, "S": ORANGE}
DIRECTION_LINES = {"E": "-", "N": "--", "W": "-", "S": "--"}
MISSING = "#D9D9D9"
OPEN_COLOUR, CONTACT_COLOUR = "#F2F0E9", "#12355B"
STATE_COLOURS = (OPEN_COLOUR, CONTACT_COLOUR, RED)  # open, contact, yielded
SLIP_COLOURS = (OPEN_COLOUR, CONTACT_COLOUR, ORANGE)  # open, stick, slip
HEIGHT_MAP, FIELD_MAP, SEQUENCE_MAP = "cividis", "viridis", "viridis"
MAX_LEGEND_ENTRIES = 8  # more do not fit beside a panel of usual height
# a curve with more points is drawn without markers: of 15 on a panel they are four widths apart, of 4 points
MAX_MARKED_POINTS = 15
MOST_DOTS = 40  # the same of dots, which are half as wide
MOST_CURVES = 6  # in a panel: more cross each other, and their nulls or theories, illegibly
# lines of the first, second ... of several kinds of curves; long dashes stay apart where curves are steep
LINES: tuple[Any, ...] = ("-", (0, (4, 2)), ":", "-.")
# what stands beside the curves of a figure is narrower than they are: nulls, references, theories
THIN = 0.9  # points, beside curves of 1.5 and a grid of .6
DASHED, DOTTED, DASH_DOTTED = ({"ls": line, "lw": THIN} for line in LINES[1:])

_for_files: ContextVar[bool] = ContextVar("figures for files", default=False)


@contextmanager
def drawn_for_files() -> Iterator[None]:
    """Within this context figures have the style of the files, and pyplot neither keeps nor shows them."""
    import matplotlib.style

    token = _for_files.set(True)
    try:
        with matplotlib.style.context(STYLE):
            yield
    finally:
        _for_files.reset(token)


def axes_or_new(ax: Axes | None, size: tuple[float, float] = PANEL, **options: Any) -> Any:
    """Return the Axes to draw on: those given, or the only ones of a new figure."""
    if ax is not None:
        return ax
    ax = new_figure(size).add_subplot(**options)
    style_axes(ax)
    return ax


def are_given(axes: Panels | None) -> bool:
    """Return True for the Axes of panels, False for None and for a figure to make them in."""
    return axes is not None and not hasattr(axes, "subplots")


def panels(
    axes: Panels | None, shape: tuple[int, int], size: tuple[float, float], **layout: Any
) -> AxesArray:
    """Return an array of the Axes to draw on, of shape (rows, columns).

    Those given are taken as they come. Otherwise they are made in the figure `axes`, or in a new one.
    """
    if are_given(axes):
        given, needed = np.ravel(np.asarray(axes, dtype=object)), shape[0] * shape[1]
        require(given.size == needed, "axes", f"{needed} Axes", f"{given.size}")
        return given.reshape(shape)
    sheet: Any = new_figure(size) if axes is None else axes
    made = np.asarray(sheet.subplots(*shape, squeeze=False, **layout))
    for ax in made.ravel():
        style_axes(ax)
    return made


def number_of_columns(count: int) -> int:
    """Return the number of columns for a number of panels."""
    return 2 if count == 4 else min(count, COLUMNS)


def panel_row(axes: Panels | None, count: int, size: tuple[float, float] = ROW, **layout: Any) -> AxesArray:
    """Return the Axes of panels side by side."""
    row: AxesArray = panels(axes, (1, count), size, **layout)[0]
    return row


def new_figure(size: tuple[float, float]) -> Any:
    """Return a figure of pyplot, which a notebook or a window shows; for files one that pyplot does not know.

    The size, in inches, is for text of 9 points, and grows with it.
    """
    import matplotlib
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    scale = max(1.0, float(matplotlib.rcParams["font.size"]) / 9.0)
    layout = ConstrainedLayoutEngine(w_pad=0.07, h_pad=0.07)
    options: dict[str, Any] = {"figsize": (scale * size[0], scale * size[1]), "layout": layout}
    if _for_files.get():
        return Figure(**options)
    from matplotlib import pyplot

    return pyplot.figure(**options)


def figure_of(axes: Any) -> Figure:
    """Return the figure that Axes, or an array of Axes, belong to."""
    figure: Figure = np.ravel(np.asarray(axes, dtype=object))[0].get_figure(root=True)
    return figure


def ink() -> Any:
    """Return the colour of text."""
    return tone(1.0)


def grey() -> Any:
    """Return the colour of notes and of lines in a legend."""
    return tone(0.75)


def pale() -> Any:
    """Return the colour of an area in the background."""
    return tone(0.11)


def tone(share: float) -> Any:
    """Return a colour between that of the axes (0) and that of the text (1), in the style of the moment."""
    import matplotlib
    from matplotlib.colors import to_hex, to_rgb

    rc = matplotlib.rcParams
    parts = zip(to_rgb(rc["axes.facecolor"]), to_rgb(rc["text.color"]), strict=True)
    red, green, blue = ((1 - share) * face + share * text for face, text in parts)
    return to_hex((red, green, blue))


def cycle() -> tuple[Any, ...]:
    """Return colours of curves without an order."""
    return (*COLOURS, ink())


def distinct_style(number: int, colours: Sequence[Any] | None = None) -> dict[str, Any]:
    """Return colour and dashes of one of several curves: each colour solid, then dashed, then dash-dotted.

    Dots are left to parts of these curves, such as those out of range.
    """
    colours = colours or cycle()
    turn, index = divmod(number, len(colours))
    solid, dashed, _, dash_dotted = LINES
    return {"color": colours[index], "ls": (solid, dashed, dash_dotted)[turn % 3]}


def style_axes(ax: Axes) -> None:
    """Keep the style of the moment, which matplotlib would look up again when the figure is rendered."""
    import matplotlib

    rc: dict[Any, Any] = matplotlib.rcParams
    for name, axis in (("xtick", ax.xaxis), ("ytick", ax.yaxis)):
        colour, text = rc[f"{name}.color"], rc[f"{name}.labelcolor"]
        axis.set_tick_params(which="both", labelsize=rc[f"{name}.labelsize"], color=colour,
                             labelcolor=colour if text == "inherit" else text)  # fmt: skip
    if rc["axes.grid"]:
        ax.grid(True, color=rc["grid.color"], linewidth=rc["grid.linewidth"])


def draw_frame(ax: Axes, colour: Any = None) -> None:
    """Draw a frame on all four sides of a map."""
    ax.grid(False)
    for spine in ax.spines.values():
        spine.set(visible=True, linewidth=0.6, color=colour or ink())


def sequence_colours(count: int) -> list[Any]:
    """Return colours for an ordered set of curves, dark to light."""
    import matplotlib

    colours = matplotlib.colormaps[SEQUENCE_MAP]
    is_light = sum(matplotlib.colors.to_rgb(matplotlib.rcParams["axes.facecolor"])) > 1.5
    # the lightest colours of the map cannot be read on white, the darkest not on black
    ends = (0.0, 0.86) if is_light else (0.3, 1.0)
    return [colours(position) for position in np.linspace(*ends, max(count, 2))[:count]]


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

    return Line2D([], [], label=label, **{"color": grey(), **style})


def letter(number: int) -> str:
    """Return A, B, C ... for points marked on a curve and shown as maps."""
    return chr(ord("A") + number) if number < 26 else str(number + 1)


def needs_log_axis(values: Any, ratio: float = 30.0) -> bool:
    """Return True for positive values of a larger ratio: on a linear axis of 3 inches 1/30 is 2.5 mm."""
    shown = np.asarray(values, dtype=float)
    shown = shown[np.isfinite(shown)]
    return bool(shown.size and shown.min() > 0 and shown.max() > ratio * shown.min())


def plain_ticks(ax: Axes) -> None:
    """Label logarithmic axes with plain numbers (0.1, 1, 10), at least two of them where possible.

    Where there is room for powers of ten alone, two small ticks stand between them, at 2 and 5: the eight of
    matplotlib took a tenth of the time of a figure. Long numbers below narrow axes stand at 1 and 3 in place
    of 1, 2 and 5.
    """
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for axis in (ax.xaxis, ax.yaxis):
        if axis.get_scale() != "log":
            continue
        low, high = sorted(ax.get_xlim() if axis is ax.xaxis else ax.get_ylim())  # of all curves so far
        narrow = high / low < 120  # two decades, with margins, have room for 1, 2 and 5 of each
        if not narrow:
            axis.set_minor_locator(LogLocator(subs=(2.0, 5.0), numticks=12))
            axis.set_minor_formatter(NullFormatter())
        if low < 1e-3 or high > 1e6:
            continue  # powers of ten are easier to read there
        steps = (1.0, 2.0, 5.0) if axis is ax.yaxis or _stand_apart(ax, low, high) else (1.0, 3.0)
        axis.set_major_locator(LogLocator(subs=steps if narrow else (1.0,), numticks=12))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())


def _stand_apart(ax: Axes, low: float, high: float) -> bool:
    """Return whether numbers at 1, 2 and 5 of each decade fit below the axes."""
    import matplotlib as mpl
    from matplotlib.font_manager import FontProperties

    points = 72 * ax.get_window_extent().width / ax.figure.dpi
    digits = max(len(f"{10.0 ** math.floor(math.log10(value)):g}".replace(".", "")) for value in (low, high))
    size = FontProperties(size=mpl.rcParams["xtick.labelsize"]).get_size_in_points()
    # a digit is .64 of the size wide, a point half of that, and so is the least space between two numbers
    return points * math.log10(2.0) / math.log10(high / low) > 0.64 * size * (digits + 1.0)


def write_in_empty_axes(ax: Axes, text: str) -> None:
    """Write a note in the middle of axes without data."""
    ax.text(0.5, 0.5, text, transform=ax.transAxes, ha="center", va="center", color=grey())
