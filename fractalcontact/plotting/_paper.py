"""The five figures of Borri-Brunetto, Carpinteri and Chiaia (1998), drawn from a study."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from fractalcontact.base.units import quantity_text
from fractalcontact.base.validation import NONE, Problems
from fractalcontact.plotting import _style
from fractalcontact.plotting._closure import closure_laws, contact_area
from fractalcontact.plotting._contact_maps import contact_domains, maps_height
from fractalcontact.plotting._dilatancy import elastic_dilatancy, rigid_dilatancy
from fractalcontact.plotting._directions import direction_name, evenly_sampled_reach
from fractalcontact.plotting._inputs import extent_of, nearest, result_of, words
from fractalcontact.plotting._paths import at_shear, loaded_steps, select_path
from fractalcontact.plotting._shear_scheme import shear_step_of, sliding_scheme
from fractalcontact.plotting._surface import SIZE, surface
from fractalcontact.plotting._units import shown_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fractalcontact.plotting._style import AxesArray, Panels
    from fractalcontact.plotting._units import Units

PANELS = 6
SHOWN_SHEAR = 1 / 50  # of the block edge: 0.4 mm of 2 cm, the shear of the maps in the paper

# groups of each figure; `has_figure` lists which of them are required
GROUPS: dict[int, tuple[str, ...]] = {
    1: ("surfaces",),
    2: ("surfaces", "joints/delta_surface"),
    3: ("joints/closure",),
    4: ("joints/closure",),
    5: ("joints/rigid_dilatancy", "joints/elastic_dilatancy"),
}


def group(tree: xr.DataTree, path: str) -> xr.Dataset | None:
    """Return the Dataset of a group, or None where the study has none."""
    try:
        node: Any = tree[path]
    except KeyError:
        return None
    dataset: xr.Dataset | None = node.to_dataset() if getattr(node, "has_data", False) else None
    return dataset


def has_figure(tree: xr.DataTree, number: int) -> bool:
    """Return True if a study has the data for a figure of the paper."""
    parts = [group(tree, path) for path in GROUPS[number]]
    if number == 5:
        return any(part is not None for part in parts)
    needed = {1: "height", 2: "height", 3: "closure", 4: "state"}[number]
    return all(part is not None for part in parts) and needed in parts[0].variables  # type: ignore[union-attr]


@_style.checked
def paper_figure(
    tree: xr.DataTree, number: int, *, units: Units | None = None, axes: Panels | None = None
) -> AxesArray:
    """Draw one of the five figures of the 1998 paper from the data of a study.

    Parameters
    ----------
    tree : DataTree
        From `fractalcontact.scenes.run` or `fractalcontact.open`.
    number : int
        1: crack surface and delta-surface; 2: scheme of the simulation; 3: closure laws and real contact
        area; 4: contact domains for increasing force; 5: rigid and elastic dilatancy, with the contact
        domains for increasing shear.
    units : mapping of str to str, optional
        Unit of each variable by name, `{"closure": "mm"}` if the data have it. Default: a suitable prefix.
    axes : array of Axes, Figure or SubFigure, optional
        The Axes of the panels, or a figure to make them in. Default: a new figure.

    Returns
    -------
    array of Axes
        The panels that the study has data for.

    Raises
    ------
    InvalidInput
        `number` is not 1 to 5, or the study has no data for that figure.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3, figures 1 to 5.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> import xarray as xr
    >>> surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> tree = xr.DataTree.from_dict({"/surfaces": surface.to_dataset()})
    >>> (ax,) = fc.plotting.paper_figure(tree, 1)
    >>> print(ax.get_xlabel())
    $x$ (mm)
    """
    with Problems("fc.plotting.paper_figure") as problems:
        is_number = problems.integer("number", number, at_least=1, at_most=5)
        if problems.tree("tree", tree) and is_number:
            groups = " and ".join(GROUPS[number])
            problems.require(has_figure(tree, number), "tree", f"data for figure {number} in {groups}", NONE)
    drawing = {1: _surfaces, 2: _scheme, 3: _closure, 4: _domains, 5: _dilatancy}[number]
    return drawing(shown_in(tree, units, "paper_figure"), axes)


def _surfaces(tree: xr.DataTree, axes: Panels | None) -> AxesArray:
    delta = group(tree, "joints/delta_surface")
    if delta is None:
        shown = _style.panel_row(axes, 1, SIZE)
        surface(group(tree, "surfaces"), ax=shown[0])
        return shown
    step = shear_step_of(delta)
    left, right = shown = _style.panel_row(axes, 2, (_style.WIDTH + 0.8, 3.2))
    title = r"$\bf{a}$  crack surface and block"
    surface(group(tree, "surfaces"), block=step.block, title=title, ax=left)
    shear = f"$v$ = {quantity_text(step.shear, 'm')} {direction_name(step.direction)}".rstrip()
    surface(step.block, title=rf"$\bf{{b}}$  delta-surface, {shear}", ax=right)
    return shown


def _scheme(tree: xr.DataTree, axes: Panels | None) -> AxesArray:
    upper = group(tree, "joints/faces")
    return sliding_scheme(
        group(tree, "surfaces"), group(tree, "joints/delta_surface"), upper=upper, axes=axes
    )


def _closure(tree: xr.DataTree, axes: Panels | None) -> AxesArray:
    data = result_of(group(tree, "joints/closure"), "paper_figure", ("closure",), ("shear", "step"))
    left, right = shown = _style.panel_row(axes, 2, (9.4, 3.3))
    shear = shown_shear(data)
    marked = loaded_steps(at_shear(data, shear), PANELS) if "state" in data else ()
    closure_laws(data, shear=shear, marked=marked, key=False, ax=left)
    contact_area(data, ax=right)
    left.set_title(r"$\bf{a}$  closure laws")
    right.set_title(r"$\bf{b}$  real contact area")
    return shown


def _domains(tree: xr.DataTree, axes: Panels | None) -> AxesArray:
    data = result_of(group(tree, "joints/closure"), "paper_figure", ("state",), ("shear", "step"))
    return contact_domains(data, shear=shown_shear(data), panels=PANELS, axes=axes)


def _dilatancy(tree: xr.DataTree, axes: Panels | None) -> AxesArray:
    rigid, elastic = (group(tree, path) for path in GROUPS[5])
    curves = [drawing for part, drawing in ((rigid, _rigid), (elastic, _elastic)) if part is not None]
    closure = group(tree, "joints/closure")
    force = _largest_force(closure if elastic is None else elastic)
    maps = None if closure is None or "state" not in closure or force is None else closure
    width, top, below = 9.4 if len(curves) == 2 else _style.WIDTH, 3.1, 0.0
    if maps is not None:
        data = result_of(maps, "paper_figure", ("state",), ("shear", "step"))
        path, dim = select_path(data, None, force, PANELS, "paper_figure")
        below = maps_height(path, path.sizes[dim], 0.75 * width)  # a column of windows is added
    upper: Any
    lower: Any
    if not _style.are_given(axes):
        sheet: Any = _style.new_figure((width, top + below)) if axes is None else axes
        upper, lower = sheet.subfigures(2, 1, height_ratios=(top, below)) if maps is not None else (sheet, [])
    else:
        given = np.ravel(np.asarray(axes, dtype=object))
        upper, lower = given[: len(curves)], given[len(curves) :]
    shown = _style.panel_row(upper, len(curves), (width, top))
    for ax, drawing, letter in zip(shown, curves, "ab", strict=False):
        ax.set_title(rf"$\bf{{{letter}}}$  {drawing(ax, tree)}")
    if maps is None:
        return shown
    domains = contact_domains(maps, normal_force=force, panels=PANELS, axes=lower)
    return np.concatenate([shown, domains])


def _rigid(ax: Axes, tree: xr.DataTree) -> str:
    rigid_dilatancy(group(tree, GROUPS[5][0]), ax=ax)
    return "rigid surfaces"


def _elastic(ax: Axes, tree: xr.DataTree) -> str:
    elastic, closure = group(tree, GROUPS[5][1]), group(tree, "joints/closure")
    assert elastic is not None
    marked: list[float] = []
    if closure is not None and "state" in closure and "shear" in closure.coords:
        marked = closure["shear"].values.ravel().tolist()
    direction = words(elastic["direction"])[0] if "direction" in elastic.coords else None
    elastic_dilatancy(elastic, direction=direction, reach=evenly_sampled_reach(elastic), marked=marked, ax=ax)
    return "elastic bodies" + (f", block slides {direction_name(direction)}" if direction else "")


def _largest_force(data: xr.Dataset | None) -> float | None:
    if data is None or "normal_force" not in data.variables:
        return None
    return float(np.nanmax(data["normal_force"].values))


def shown_shear(data: xr.Dataset) -> float | None:
    """Return the shear of the maps: the one nearest to a fiftieth of the block edge."""
    if "shear" not in data.coords:
        return None
    shears = np.atleast_1d(data["shear"].values).astype(float)
    if "x" not in data.coords:
        return float(shears[shears.size // 2])
    left, right, bottom, top = extent_of(data)
    target = SHOWN_SHEAR * min(right - left, top - bottom)
    return float(shears[nearest(np.log(np.maximum(shears, 1e-3 * target)), np.log(target))])
