"""Scheme of the shear simulation: the block from above, and a section along the sliding direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from fractalcontact.base.units import quantity_text
from fractalcontact.base.validation import NONE, Problems
from fractalcontact.plotting import _maps, _style
from fractalcontact.plotting._directions import direction_name
from fractalcontact.plotting._inputs import extent_of, result_of, words
from fractalcontact.plotting._surface import draw_outline, label_axes, plane_of, plane_scale
from fractalcontact.plotting._units import label_axis, scale_of, shown_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fractalcontact.plotting._style import AxesArray, Panels
    from fractalcontact.plotting._units import Units

AZIMUTHS = {"E": 0.0, "N": 90.0, "W": 180.0, "S": 270.0}
LOWER, UPPER = "#BDB8AB", "#8C9DAE"
SECTION_SHAPE = 1.9  # width over height
LABEL_WIDTH = 0.24  # of the width of the section, needed by the label of the lift
Array = np.ndarray[Any, np.dtype[Any]]


@dataclass(frozen=True)
class ShearStep:
    """A delta-surface with its shear displacement (m) and sliding direction."""

    block: xr.DataArray
    shear: float
    direction: str
    azimuth: float

    @property
    def unit(self) -> Array:
        """Unit vector (x, y) of the sliding direction."""
        return np.array([np.cos(np.deg2rad(self.azimuth)), np.sin(np.deg2rad(self.azimuth))])

    @property
    def lift(self) -> float:
        """Rise (m) of rigid surfaces: the largest height of the delta-surface."""
        heights = np.asarray(self.block.values, dtype=float)
        return float(np.nanmax(heights)) if np.isfinite(heights).any() else 0.0


@_style.checked
def sliding_scheme(
    surface: Any, delta: Any, *, upper: Any = None, units: Units | None = None, axes: Panels | None = None
) -> AxesArray:
    """Draw the sliding block from above and a section through the crack along the sliding direction.

    The section shows the given surfaces, its heights exaggerated as its title says. The block is lifted by
    the largest height of the delta-surface, as for rigid bodies. They touch at one point, which is seldom in
    the section.

    Parameters
    ----------
    surface : DataArray, Dataset or node of a DataTree
        Heights (m) of the lower surface, dims (y, x).
    delta : DataArray, Dataset or node of a DataTree
        From `fractalcontact.joints.delta_surface`, with its shear and direction. The largest of several
        shears is drawn.
    upper : DataArray, Dataset or node of a DataTree, optional
        Heights (m) of the block in the same coordinates. Default: mated, equal to `surface`.
    units : mapping of str to str, optional
        Unit of each variable by name, `{"closure": "mm"}` if the data have it. Default: a suitable prefix.
    axes : array of Axes, Figure or SubFigure, optional
        The Axes of the panels, or a figure to make them in. Default: a new figure.

    Returns
    -------
    array of Axes

    Raises
    ------
    InvalidInput
        There is no plane of heights, or no delta-surface, or a height is infinite.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> lower = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> crack = fc.joints.Crack(lower, young=30e9, poisson=0.2, block=1.6e-3)
    >>> delta = fc.joints.delta_surface(crack, shear=4e-4, direction="E")
    >>> plan, section = fc.plotting.sliding_scheme(lower, delta)
    >>> print(section.get_title())
    section along the sliding direction, East, heights × 10
    """
    surface = shown_in(surface, units, "sliding_scheme")
    lower, step = plane_of(surface, "sliding_scheme", "height", "surface"), shear_step_of(delta)
    facing = lower if upper is None else plane_of(upper, "sliding_scheme", "height", "upper")
    with Problems("fc.plotting.sliding_scheme") as problems:
        shape = lower.shape
        problems.require(min(shape) > 1, "surface", "at least two points along x and y", shape)
        problems.require(facing.shape == shape, "upper", f"the shape of surface, {shape}", facing.shape)
        given = {"surface": lower, "delta": step.block} | ({} if upper is None else {"upper": facing})
        for name, plane in given.items():
            infinite = int(np.isinf(plane.values).sum())
            problems.require(infinite == 0, name, "finite heights, or NaN", f"{infinite} infinite")
    left, right = shown = _style.panel_row(axes, 2, (_style.WIDTH + 0.8, 3.0), width_ratios=(1.0, 1.9))
    _draw_plan(left, lower, step)
    name = r"$\delta_\mathrm{r}$" if upper is None else "lift"
    times = _draw_section(right, lower, facing, step, name)
    left.set_title("plan view")
    direction = f", {direction_name(step.direction)}" if step.direction else ""
    right.set_title(f"section along the sliding direction{direction}, heights × {times:g}")
    return shown


def shear_step_of(delta: Any) -> ShearStep:
    """Return the delta-surface of the largest shear with its shear and direction."""
    data = result_of(delta, "sliding_scheme", ("height",), ("shear",), "delta")
    last = int(np.argmax(np.atleast_1d(data["shear"].values))) if "shear" in data.coords else 0
    plane = data.isel(shear=last)
    direction = words(plane["direction"])[0] if "direction" in plane.coords else ""
    azimuth = float(plane["azimuth"]) if "azimuth" in plane.coords else AZIMUTHS.get(direction, 0.0)
    shear = float(plane["shear"]) if "shear" in plane.coords else 0.0
    return ShearStep(
        plane_of(plane["height"], "sliding_scheme", "height", "delta"), shear, direction, azimuth
    )


def _draw_plan(ax: Axes, lower: xr.DataArray, step: ShearStep) -> None:
    length, extent = plane_scale(lower), extent_of(lower)
    _maps.relief(ax, np.asarray(lower.values, float), extent, length, scale_of(lower))
    left, right, bottom, top = extent_of(step.block)
    x, y = step.shear * step.unit
    draw_outline(ax, (left, right, bottom, top), length, linestyle=(0, (3, 2)))
    draw_outline(ax, (left + x, right + x, bottom + y, top + y), length, linewidth=1.6)
    centre = np.array([left + right, bottom + top]) / 2
    reach = 0.34 * min(right - left, top - bottom)
    for direction, azimuth in AZIMUTHS.items():
        _draw_direction(ax, length, centre, reach, direction, azimuth, bold=abs(azimuth - step.azimuth) < 1)
    label_axes(ax, lower, length)


def _draw_direction(
    ax: Axes, length: Any, centre: Array, reach: float, direction: str, azimuth: float, *, bold: bool
) -> None:
    unit = np.array([np.cos(np.deg2rad(azimuth)), np.sin(np.deg2rad(azimuth))])
    arrow = {
        "arrowstyle": "-|>",
        "color": "white",
        "lw": 1.8 if bold else 0.8,
        "shrinkA": 0,
        "shrinkB": 0,
    }
    ax.annotate("", tuple(length(centre + reach * unit)), tuple(length(centre)), arrowprops=arrow)
    x, y = length(centre + 1.25 * reach * unit)
    weight = "bold" if bold else "normal"
    ax.text(float(x), float(y), direction, color="white", ha="center", va="center", weight=weight)


def _draw_section(
    ax: Axes, lower: xr.DataArray, facing: xr.DataArray, step: ShearStep, lift_name: str
) -> float:
    """Draw lower surface and lifted block along the line through the centre of the block.

    Return how many times the heights are exaggerated.
    """
    ax.grid(False)
    left, right, bottom, top = extent_of(step.block)
    # through the middle cell of the block, so that a section along x or y meets cell centres
    centre = np.array([float(step.block[dim][step.block.sizes[dim] // 2]) for dim in ("x", "y")])
    position, lower_height = line_through(lower, centre, step.unit)
    _, upper_height = line_through(facing, centre, step.unit)
    x, y = centre[:, None] + step.unit[:, None] * position
    inside = (x > left) & (x < right) & (y > bottom) & (y < top)
    with Problems("fc.plotting.sliding_scheme") as problems:
        heights = [np.isfinite(values).any() for values in (lower_height, upper_height[inside])]
        problems.require(all(heights), "surface", "heights where delta lies", NONE)
    upper_height, upper_position = upper_height[inside], position[inside] + step.shear
    span = max(float(np.nanmax(lower_height) - np.nanmin(lower_height)), 1e-9 * float(np.ptp(position)))
    low = float(np.nanmin(lower_height)) - 0.5 * span
    block_top = float(np.nanmax(upper_height)) + step.lift + 0.5 * span
    top, length = block_top + 0.6 * span, float(position[-1] - position[0])
    times = _one_digit(length / (top - low) / SECTION_SHAPE)
    low = top - length / times / SECTION_SHAPE
    along, up = scale_of(lower["x"], position), scale_of(lower, (low, top))
    ax.fill_between(along(position), float(up(low)), up(lower_height), color=LOWER, lw=0)
    ax.plot(along(position), up(lower_height), color=_style.ink(), lw=0.9, label="lower face")
    block_bottom = up(upper_height + step.lift)
    ax.fill_between(along(upper_position), block_bottom, float(up(block_top)), color=UPPER, lw=0)
    ax.plot(along(upper_position), block_bottom, color=_style.ink(), lw=0.9, label="upper face")
    ax.set_xlim(float(along(position[0])), float(along(position[-1])))
    ax.set_ylim(float(up(low)), float(up(top)))
    ax.set_aspect(times * up.factor / along.factor)
    middle = (float(along(np.mean(upper_position))), float(up(block_top - 0.08 * span)))
    ax.text(*middle, "upper", ha="center", va="top", color="white")
    ax.text(0.02, 0.04, "lower", transform=ax.transAxes)
    corner = (float(position[inside][0]), float(upper_height[0]), block_top + 0.14 * span)
    _draw_dimensions(ax, (along, up), step, lift_name, corner)
    label_axis(ax.xaxis, "position along the sliding direction", along)
    label_axis(ax.yaxis, "height", up)
    return times


def _one_digit(value: float) -> float:
    """Return the largest number of one digit that is not above a value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(np.floor(value / power * (1 + 1e-9)) * power)


def _draw_dimensions(
    ax: Axes, scales: tuple[Any, Any], step: ShearStep, lift_name: str, corner: tuple[float, float, float]
) -> None:
    """Draw dimension lines of the shear above the block and of the lift at its trailing edge."""
    (along, up), (edge, foot, level) = scales, corner
    arrow: dict[str, Any] = {
        "arrowstyle": "<|-|>",
        "lw": 1.1,
        "shrinkA": 0,
        "shrinkB": 0,
        "mutation_scale": 8,
    }
    start, end = float(along(edge)), float(along(edge + step.shear))
    if step.shear > 0:
        for x, y in ((start, foot), (end, foot + step.lift)):
            ax.plot([x, x], [float(up(y)), float(up(level))], color=_style.RED, lw=0.7, ls=":")
        ax.annotate(
            "", (start, float(up(level))), (end, float(up(level))), arrowprops=arrow | {"color": _style.RED}
        )
        ax.annotate(f"$v$ = {quantity_text(step.shear, 'm')}", ((start + end) / 2, float(up(level))), (0, 4),
                    textcoords="offset points", color=_style.RED, ha="center", va="bottom")  # fmt: skip
    if step.lift > 0:
        low, high = float(up(foot)), float(up(foot + step.lift))
        low_x, high_x = ax.get_xlim()
        # the label goes over the shear if that is wide enough, else in front of the block if there is space
        needed = LABEL_WIDTH * (high_x - low_x)
        behind, front = end - start, start - low_x
        right = behind > needed or (front < needed and behind >= front)
        separator = " = " if (behind if right else front) > needed else "\n"
        ax.plot([start, end], [high, high], color=_style.BLUE, lw=0.7, ls=":")
        ax.annotate("", (start, low), (start, high), arrowprops=arrow | {"color": _style.BLUE})
        away, side = (6, "left") if right else (-6, "right")
        label = f"{lift_name}{separator}{quantity_text(step.lift, 'm')}"
        ax.annotate(label, (start, (low + high) / 2), (away, 0),
                    textcoords="offset points", color=_style.BLUE, ha=side, va="center",
                    path_effects=_style.halo())  # fmt: skip


def line_through(plane: xr.DataArray, centre: Array, unit: Array) -> tuple[Array, Array]:
    """Return positions (m, from `centre`) and heights of the nearest cells along a line through a plane."""
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
