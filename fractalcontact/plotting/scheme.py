"""The scheme of the simulation: the block on the face from above, and the crack cut along the slide."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.plotting import _maps, _style
from fractalcontact.plotting._reading import extent_of, result_of, words
from fractalcontact.plotting._units import amount, scale_for
from fractalcontact.plotting.relief import name_plane, outline, plane_of, plane_scale
from fractalcontact.plotting.sliding import direction_word

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

WINDS = {"E": 0.0, "N": 90.0, "W": 180.0, "S": 270.0}
LOWER, UPPER = "#BDB8AB", "#8C9DAE"
NEEDED = 0.16  # of the width of the cut, for a few words
Array = np.ndarray[Any, np.dtype[Any]]


@dataclass(frozen=True)
class Slide:
    """A delta-surface, the shear (m) that led to it, and the direction of the slide."""

    block: xr.DataArray
    shear: float
    name: str
    azimuth: float

    @property
    def unit(self) -> Array:
        """Unit vector (x, y) of the slide."""
        return np.array([np.cos(np.deg2rad(self.azimuth)), np.sin(np.deg2rad(self.azimuth))])

    @property
    def lift(self) -> float:
        """Separation (m) of the rigid faces: the greatest height of the delta-surface."""
        heights = np.asarray(self.block.values, dtype=float)
        return float(np.nanmax(heights)) if np.isfinite(heights).any() else 0.0


@_style.styled
def sliding_scheme(
    surface: Any, delta: Any, *, upper: Any = None, figure: Figure | SubFigure | None = None
) -> Figure:
    """Draw the block on its face, where it slides to, and a cut through the crack along the slide.

    The cut is that of the given faces themselves, its heights drawn to a larger scale than its length. The
    block is lifted as far as rigid faces force it, by the greatest height of the delta-surface: they touch
    somewhere, though seldom in the plane of the cut.

    Parameters
    ----------
    surface : DataArray, Dataset or node of a DataTree
        Heights (m) of the lower face, dims (y, x).
    delta : DataArray, Dataset or node of a DataTree
        From `fractalcontact.joints.delta_surface`, with its shear and its direction; of several shears the
        greatest is drawn.
    upper : DataArray, Dataset or node of a DataTree, optional
        Heights (m) of the block's own face in the same frame; None: mated.
    figure : Figure or SubFigure, optional
        Draw here; otherwise on a new figure.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        There is no plane of heights, or no delta-surface.
    """
    lower, slide = plane_of(surface, "sliding_scheme", "height"), slide_of(delta)
    facing = lower if upper is None else plane_of(upper, "sliding_scheme", "height")
    sheet = _style.sheet(figure, (_style.WIDTH + 0.8, 3.0))
    left, right = sheet.subplots(1, 2, width_ratios=(1.0, 1.9))
    _plan(left, lower, slide)
    _cut(right, lower, facing, slide, r"$\delta_\mathrm{r}$" if upper is None else "lift")
    left.set_title("from above")
    right.set_title(
        "cut along the slide" + (f", block slides {direction_word(slide.name)}" if slide.name else "")
    )
    return _style.root(sheet)


def slide_of(delta: Any) -> Slide:
    """Return the delta-surface of the greatest shear with its shear and its direction."""
    data = result_of(delta, "sliding_scheme", ("height",), ("shear",))
    last = int(np.argmax(np.atleast_1d(data["shear"].values))) if "shear" in data.coords else 0
    one = data.isel(shear=last)
    name = words(one["direction"])[0] if "direction" in one.coords else ""
    azimuth = float(one["azimuth"]) if "azimuth" in one.coords else WINDS.get(name, 0.0)
    shear = float(one["shear"]) if "shear" in one.coords else 0.0
    return Slide(plane_of(one["height"], "sliding_scheme", "height"), shear, name, azimuth)


def _plan(ax: Axes, lower: xr.DataArray, slide: Slide) -> None:
    length, extent = plane_scale(lower), extent_of(lower)
    _style.dress(ax)
    _maps.relief(ax, np.asarray(lower.values, float), extent, length, scale_for("m", lower.values))
    left, right, bottom, top = extent_of(slide.block)
    x, y = slide.shear * slide.unit
    outline(ax, (left, right, bottom, top), length, linestyle=(0, (3, 2)))
    outline(ax, (left + x, right + x, bottom + y, top + y), length, linewidth=1.6)
    centre = np.array([left + right, bottom + top]) / 2
    reach = 0.34 * min(right - left, top - bottom)
    for wind, azimuth in WINDS.items():
        _wind(ax, length, centre, reach, wind, azimuth, slides=abs(azimuth - slide.azimuth) < 1)
    name_plane(ax, lower, length)


def _wind(
    ax: Axes, length: Any, centre: Array, reach: float, wind: str, azimuth: float, *, slides: bool
) -> None:
    way = np.array([np.cos(np.deg2rad(azimuth)), np.sin(np.deg2rad(azimuth))])
    look = {"arrowstyle": "-|>", "color": "white", "lw": 1.8 if slides else 0.8, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", tuple(length(centre + reach * way)), tuple(length(centre)), arrowprops=look)
    x, y = length(centre + 1.25 * reach * way)
    weight = "bold" if slides else "normal"
    ax.text(float(x), float(y), wind, color="white", ha="center", va="center", weight=weight)


def _cut(ax: Axes, lower: xr.DataArray, facing: xr.DataArray, slide: Slide, lift_name: str) -> None:
    _style.dress(ax)
    ax.grid(False)
    left, right, bottom, top = extent_of(slide.block)
    # through the middle cell of the block, so that along x and y the cut meets centres of cells
    centre = np.array([float(slide.block[dim][slide.block.sizes[dim] // 2]) for dim in ("x", "y")])
    place, ground = line_through(lower, centre, slide.unit)
    _, own = line_through(facing, centre, slide.unit)
    x, y = centre[:, None] + slide.unit[:, None] * place
    inside = (x > left) & (x < right) & (y > bottom) & (y < top)
    own, moved = own[inside], place[inside] + slide.shear
    span = max(float(np.nanmax(ground) - np.nanmin(ground)), 1e-9 * float(np.ptp(place)))
    floor, roof = float(np.nanmin(ground)) - 0.5 * span, float(np.nanmax(own)) + slide.lift + 0.5 * span
    along, up = scale_for("m", place), scale_for("m", (floor, roof + 0.6 * span))
    ax.fill_between(along(place), float(up(floor)), up(ground), color=LOWER, lw=0)
    ax.plot(along(place), up(ground), color=_style.INK, lw=0.9)
    ax.fill_between(along(moved), up(own + slide.lift), float(up(roof)), color=UPPER, lw=0)
    ax.plot(along(moved), up(own + slide.lift), color=_style.INK, lw=0.9)
    ax.set_xlim(float(along(place[0])), float(along(place[-1])))
    ax.set_ylim(float(up(floor)), float(up(roof + 0.6 * span)))
    ax.text(
        float(along(np.mean(moved))),
        float(up(roof - 0.08 * span)),
        "block",
        ha="center",
        va="top",
        color="white",
    )
    ax.text(0.02, 0.04, "face", transform=ax.transAxes)
    _measure(ax, (along, up), slide, lift_name, (float(place[inside][0]), float(own[0]), roof + 0.14 * span))
    ax.set_xlabel(along.label("position along the slide"))
    ax.set_ylabel(up.label("height"))


def _measure(
    ax: Axes, scales: tuple[Any, Any], slide: Slide, lift_name: str, corner: tuple[float, float, float]
) -> None:
    """Draw the shear over the block and the lift at its trailing edge, as one measures them on a drawing."""
    (along, up), (edge, foot, level) = scales, corner
    look: dict[str, Any] = {"arrowstyle": "<|-|>", "lw": 1.1, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 8}
    start, end = float(along(edge)), float(along(edge + slide.shear))
    if slide.shear > 0:
        for x, y in ((start, foot), (end, foot + slide.lift)):
            ax.plot([x, x], [float(up(y)), float(up(level))], color=_style.RED, lw=0.7, ls=":")
        ax.annotate(
            "", (start, float(up(level))), (end, float(up(level))), arrowprops=look | {"color": _style.RED}
        )
        ax.annotate(f"$v$ = {amount(slide.shear, 'm')}", ((start + end) / 2, float(up(level))), (0, 4),
                    textcoords="offset points", color=_style.RED, ha="center", va="bottom")  # fmt: skip
    if slide.lift > 0:
        low, high = float(up(foot)), float(up(foot + slide.lift))
        low_x, high_x = ax.get_xlim()
        # the words stand over the shear if it is wide enough, else before the block if there is room
        right = end - start > NEEDED * (high_x - low_x) or start - low_x < NEEDED * (high_x - low_x)
        ax.plot([start, end], [high, high], color=_style.BLUE, lw=0.7, ls=":")
        ax.annotate("", (start, low), (start, high), arrowprops=look | {"color": _style.BLUE})
        away, side = (6, "left") if right else (-6, "right")
        ax.annotate(f"{lift_name} = {amount(slide.lift, 'm')}", (start, (low + high) / 2), (away, 0),
                    textcoords="offset points", color=_style.BLUE, ha=side, va="center",
                    path_effects=_style.halo())  # fmt: skip


def line_through(plane: xr.DataArray, centre: Array, unit: Array) -> tuple[Array, Array]:
    """Return positions (m, from the centre) and heights of the cells along a line through a plane."""
    axes = [np.asarray(plane[dim].values, dtype=float) for dim in ("x", "y")]
    steps = [float(axis[-1] - axis[0]) / (axis.size - 1) for axis in axes]
    reach = float(np.hypot(*(axis[-1] - axis[0] for axis in axes)))
    step = min(steps)
    place = np.arange(-round(reach / step), round(reach / step) + 1) * step
    column, row = (
        np.rint((middle + place * part - axis[0]) / width).astype(int)
        for middle, part, axis, width in zip(centre, unit, axes, steps, strict=True)
    )
    on = (column >= 0) & (column < axes[0].size) & (row >= 0) & (row < axes[1].size)
    return place[on], np.asarray(plane.values, dtype=float)[row[on], column[on]]
