"""The panel of curves under all figures with lines: labelled axes, named curves, bands, flags and legends."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.numbers import Array, spread_indices, turning_points
from fractalcontact.plotting import _style
from fractalcontact.plotting._inputs import quantity, table
from fractalcontact.plotting._style import Axes
from fractalcontact.plotting._units import Quantity

Styles = Sequence[dict[str, Any]]
LETTER_NAME = "letter of a marked point"
BAND_OPACITY = 0.14  # of an interval under its curve: five on top of each other hide half of what is below


@dataclass(frozen=True)
class Family:
    """The curves of a panel: what distinguishes them, and the label and style of each.

    `name` and `unit` belong to labels that are numbers, as in `shear v = 0.4 mm`.
    """

    styles: Styles
    labels: Sequence[str] = ()
    name: str = ""
    unit: str = ""
    heading: str = ""

    @property
    def title(self) -> str:
        """The title of the legend."""
        return self.heading or (f"{self.name} ({self.unit})" if self.unit else self.name)

    def curve(self, what: str, number: int = 0) -> str:
        """Return the name of a curve: what it shows, and which of the family it is."""
        if not self.labels:
            return what
        label = f"{self.name} = {self.labels[number]}" if self.name else self.labels[number]
        return ", ".join(filter(None, (what, f"{label} {self.unit}".rstrip())))

    def legend(self) -> list[Any]:
        """Return the entries of the legend, thinned out where they are many."""
        shown = spread_indices(len(self.labels), _style.MAX_LEGEND_ENTRIES)
        return [_style.legend_line(self.labels[i], **self.styles[i]) for i in shown]


def ordered(labels: Sequence[str], name: str = "", unit: str = "", count: int | None = None) -> Family:
    """Return a family with colours in order, dark to light."""
    colours = _style.sequence_colours(len(labels) if count is None else count)
    return Family([{"color": colour} for colour in colours], labels, name, unit)


def distinct(labels: Sequence[str], heading: str = "") -> Family:
    """Return a family whose colours have no order."""
    return Family([_style.distinct_style(i) for i in range(len(labels))], labels, heading=heading)


class LinePanel:
    """Axes with the quantities x and y, on which the curves of a family are drawn in their units.

    All values are SI; `points` is the most points of a curve that are marked. Variables of `data` are drawn
    by their names: they are read over `dims`, that of the family and that along the curves. `x_name` and
    `y_name` replace the names that they have on the axes. The Axes are new ones for None.
    """

    def __init__(
        self,
        ax: Axes | None,
        data: xr.Dataset,
        x: str | Quantity,
        y: str | Quantity,
        dims: Sequence[Hashable] = (),
        family: Family | None = None,
        *,
        x_name: str = "",
        y_name: str = "",
        points: int = 1,
    ) -> None:
        names = ((x, x_name), (y, y_name))
        self.x, self.y = (quantity(data, v, dims, name) if isinstance(v, str) else v for v, name in names)
        self.ax: Axes = _style.axes_or_new(ax)
        self.data, self.dims, self.points = data, dims, points
        self.family = ordered((), count=1) if family is None else family
        self.entries: list[Any] = []  # of the legend of the kinds of curves
        self.drawn: list[tuple[Array, Array]] = []
        self.x.label(self.ax.xaxis)
        self.y.label(self.ax.yaxis)

    def values(self, name: str) -> Array:
        """Return a variable of the result, one row for each of the family."""
        return table(self.data, name, self.dims)

    def interval(self, name: str) -> tuple[Array, ...]:
        """Return the lower and the upper ends of a variable of the result; none where it has no interval."""
        ends = (f"{name}_low", f"{name}_high")
        return tuple(map(self.values, ends)) if set(ends) <= self.data.variables.keys() else ()

    def curves(self, what: str, y: Any = None, x: Any = None, *, key: str = "", **style: Any) -> None:
        """Draw one curve for each of the family: y has its rows, x has them or is common.

        Each is a variable by its name, or an array; by default those of the axes. A `key` is the entry of
        this kind of curve in the legend.
        """
        x, y = (own.values if v is None else self.values(v) if isinstance(v, str) else v
                for v, own in ((x, self.x), (y, self.y)))  # fmt: skip
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        for number, own in enumerate(self.family.styles):
            self.line(self.family.curve(what, number), x[number], y[number], **(own | style))
        self.key(key, **style)

    def line(self, name: str, x: Any, y: Any, *, key: str = "", **style: Any) -> None:
        """Draw one curve."""
        x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
        appearance = {"marker": "o" if x.size <= self.points else ""} | style
        if not appearance["marker"]:
            appearance |= _isolated_points(x, y)
        self.ax.plot(self.x.scale(x), self.y.scale(y), label=name, **appearance)
        self.drawn.append((x, y))
        self.key(key, **style)

    def flagged(self, name: str, x: Any, y: Any, reliable: Array, **style: Any) -> None:
        """Draw points: filled ones where they are reliable, hollow ones elsewhere."""
        hollow = {"mec": style["color"], "mfc": self.ax.get_facecolor()}
        for shown, fill in ((reliable, {}), (~reliable, hollow)):
            points = self.x.scale(np.asarray(x)[shown]), self.y.scale(np.asarray(y)[shown])
            self.ax.plot(*points, label=name, **({"marker": "o", "ls": ""} | style | fill))

    def band(self, name: str, x: Any, low: Any, high: Any, colour: Any, alpha: float = BAND_OPACITY) -> None:
        """Fill between the ends of intervals; an outline without a point would set the limits of the axes.

        Each leg of a path that turns back has a band: an outline run through to and fro fills nothing.
        """
        if not np.isfinite(np.add(low, high)).any():
            return
        across, lower, upper = np.broadcast_arrays(self.x.scale(x), self.y.scale(low), self.y.scale(high))
        for leg in legs(across):
            ends = lower[leg], upper[leg]
            self.ax.fill_between(across[leg], *ends, color=colour, alpha=alpha, lw=0, label=name)

    def bars(self, name: str, x: Any, low: Any, high: Any, **style: Any) -> None:
        """Draw intervals as vertical bars."""
        self.ax.vlines(self.x.scale(x), self.y.scale(low), self.y.scale(high), label=name, **style)

    def level(self, y: float, *, key: str = "", **style: Any) -> None:
        """Draw a horizontal line of reference."""
        self.ax.axhline(float(self.y.scale(y)), **style)
        self.key(key, **style)

    def place(self, x: float, *, key: str = "", **style: Any) -> None:
        """Draw a vertical line of reference."""
        self.ax.axvline(float(self.x.scale(x)), **style)
        self.key(key, **style)

    def mark(self, x: Any, y: Any, colour: Any, first: int = 0, size: float = 14.0) -> None:
        """Mark points of a curve with letters in circles of `size` points, from letter number `first` on.

        A letter is centred on its point, so that none covers another curve, or above it where another is.
        """
        ax, x, y = self.ax, self.x.scale(x), self.y.scale(y)
        ax.plot(x, y, "o", color=colour, ms=3, zorder=4, clip_on=False)
        to_points = ax.transData + ax.figure.dpi_scale_trans.inverted()
        letters: list[Any] = [text for text in ax.texts if text.get_gid() == LETTER_NAME]
        placed = [tuple(np.array(text.xyann) + 72 * to_points.transform(text.xy)) for text in letters]
        for number, (a, b) in enumerate(zip(x, y, strict=True), first):
            if not (np.isfinite(a) and np.isfinite(b)):
                continue
            point, lift = 72 * to_points.transform((a, b)), 0.0
            while any(math.hypot(point[0] - x0, point[1] + lift - y0) < size for x0, y0 in placed):
                lift += size
            placed.append((point[0], point[1] + lift))
            circle = {"boxstyle": "circle,pad=0.25", "fc": ax.get_facecolor(), "ec": colour, "lw": 1.2}
            leader = {"arrowstyle": "-", "color": colour} if lift else None
            text = ax.annotate(_style.letter(number), (a, b), (0.0, lift), textcoords="offset points",
                               size=size / 2, weight="bold", ha="center", va="center_baseline", zorder=5,
                               annotation_clip=False, bbox=circle, arrowprops=leader)  # fmt: skip
            text.set_gid(LETTER_NAME)
            text.set_in_layout(bool(lift))  # one above its point may reach beyond the axes

    def key(self, label: str, **style: Any) -> None:
        """Add an entry to the legend of the kinds of curves, on lines of its width; none without a label.

        Its 24 characters are 1.35 inches in the size of legends, a quarter of a panel with its legend.
        """
        if label:
            text = label if "$" in label else textwrap.fill(label, 24)  # symbols are shorter than written
            self.entries.append(_style.legend_line(text, **style))

    def area_key(self, label: str, **style: Any) -> None:
        """Add the entry of a filled area."""
        from matplotlib.patches import Patch

        self.entries.append(Patch(lw=0, label=label, **style))

    def finish(
        self, *, log: str = "", zero: str = "", title: str = "", legend: bool = True, empty: str = "no values"
    ) -> Axes:
        """Set the scales of the axes and put the legends beside them.

        `log` and `zero` name the axes that are logarithmic, or start at zero, where the values allow it.
        """
        x, y = (np.concatenate([pair[i].ravel() for pair in self.drawn] or [np.empty(0)]) for i in (0, 1))
        for axis, values, set_scale in (("x", x, self.ax.set_xscale), ("y", y, self.ax.set_yscale)):
            if axis in log and np.unique(values[values > 0]).size > 1:  # one value gives it no limits
                set_scale("log")
        if "x" in zero and _reaches_up_from_zero(x):
            self.ax.set_xlim(left=0)
        if "y" in zero and _reaches_up_from_zero(y):
            self.ax.set_ylim(bottom=0)
        _style.plain_ticks(self.ax)
        if not np.isfinite(self.y.values if self.y.values.size else y).any():
            _style.write_in_empty_axes(self.ax, empty)
        if legend:
            self.draw_legends(title)
        return self.ax

    def draw_legends(self, title: str = "", ax: Axes | None = None) -> None:
        """Put the legends of the family, and of the kinds of curves below it, beside these or other axes."""
        own = self.family.legend()
        _style.side_legend(ax or self.ax, own, title=self.family.title)
        _style.side_legend(ax or self.ax, self.entries, title=title, low=bool(own))


def legs(x: Array) -> list[slice]:
    """Return the parts of a path between the points at which it turns back, which both have."""
    return [slice(first, last + 1) for first, last in pairwise(turning_points(x).tolist())]


def _isolated_points(x: Array, y: Array) -> dict[str, Any]:
    """Return the style that marks the points without a neighbour, through which no line goes."""
    finite = np.pad(np.isfinite(x + y), 1)
    places = np.flatnonzero(finite[1:-1] & ~finite[:-2] & ~finite[2:])
    return {"marker": ".", "markevery": places.tolist()} if places.size else {}


def _reaches_up_from_zero(values: Array) -> bool:
    shown = values[np.isfinite(values)]
    return bool(shown.size and shown.min() >= 0 and shown.max() > 0)
