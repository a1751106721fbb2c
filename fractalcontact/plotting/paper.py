"""The five figures of the founding paper, drawn from a saved study and from nothing else."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.plotting import _style
from fractalcontact.plotting._paths import at_shear, chosen_path, loaded_steps
from fractalcontact.plotting._reading import extent_of, nearest, result_of, words
from fractalcontact.plotting._units import amount
from fractalcontact.plotting.closing import closure_laws, contact_area
from fractalcontact.plotting.domain_maps import contact_domains, maps_height
from fractalcontact.plotting.relief import face
from fractalcontact.plotting.scheme import slide_of, sliding_scheme
from fractalcontact.plotting.sliding import direction_word, elastic_dilatancy, first_part, rigid_dilatancy

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PANELS = 6
SHOWN_SHEAR = 1 / 50  # of the edge of the block: 0.4 mm of 2 cm, whose domains the paper shows

# for each figure the groups of which it draws those that are there; the first ones are needed
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
    found: xr.Dataset | None = node.to_dataset() if getattr(node, "has_data", False) else None
    return found


def has_figure(tree: xr.DataTree, number: int) -> bool:
    """Tell whether a study has the data for one of the paper's figures."""
    parts = [group(tree, path) for path in GROUPS[number]]
    if number == 5:
        return any(part is not None for part in parts)
    wanted = {1: "height", 2: "height", 3: "closure", 4: "state"}[number]
    return all(part is not None for part in parts) and wanted in parts[0].variables  # type: ignore[union-attr]


@_style.styled
def paper_figure(tree: xr.DataTree, number: int) -> Figure:
    """Draw one of the paper's figures from a study, as computed or as read back from its file.

    Parameters
    ----------
    tree : DataTree
        From `fractalcontact.scenes.run` or `fractalcontact.open`.
    number : int
        1: the face and its delta-surface; 2: the scheme of the simulation; 3: closure laws and real contact
        area; 4: contact domains at growing force; 5: dilatancy, rigid and elastic, and the contact domains
        at growing shear.

    Returns
    -------
    Figure
        The parts of it that the study has data for.

    Raises
    ------
    InvalidInput
        There is no such figure, or the study has no data for it.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3, figures 1 to 5.
    """
    with Problems("fc.plotting.paper_figure") as problems:
        number = problems.integer("number", number, at_least=1, at_most=5)
        if not problems.found and not has_figure(tree, number):
            problems.add("tree", f"data for figure {number} in {' and '.join(GROUPS[number])}", "none")
    drawing = {1: _faces, 2: _scheme, 3: _closure, 4: _domains, 5: _dilatancy}[number]
    return drawing(tree)


def _faces(tree: xr.DataTree) -> Figure:
    delta = group(tree, "joints/delta_surface")
    if delta is None:
        return face(group(tree, "surfaces"))
    slide = slide_of(delta)
    sheet = _style.sheet(None, (_style.WIDTH + 0.8, 3.2))
    left, right = sheet.subplots(1, 2)
    face(group(tree, "surfaces"), block=slide.block, title=r"$\bf{a}$  face, with the block", ax=left)
    slid = f" {amount(slide.shear, 'm')} {direction_word(slide.name)}".rstrip()
    face(slide.block, title=rf"$\bf{{b}}$  delta-surface,{slid}", ax=right)
    return _style.root(sheet)


def _scheme(tree: xr.DataTree) -> Figure:
    upper = group(tree, "joints/faces")
    return sliding_scheme(group(tree, "surfaces"), group(tree, "joints/delta_surface"), upper=upper)


def _closure(tree: xr.DataTree) -> Figure:
    data = result_of(group(tree, "joints/closure"), "paper_figure", ("closure",), ("shear", "step"))
    sheet = _style.sheet(None, (9.4, 3.3))
    left, right = sheet.subplots(1, 2)
    shear = shown_shear(data)
    marked = loaded_steps(at_shear(data, shear), PANELS) if "state" in data else ()
    closure_laws(data, shear=shear, marked=marked, key=False, ax=left)
    contact_area(data, ax=right)
    left.set_title(r"$\bf{a}$  closure laws")
    right.set_title(r"$\bf{b}$  real contact area")
    return _style.root(sheet)


def _domains(tree: xr.DataTree) -> Figure:
    data = result_of(group(tree, "joints/closure"), "paper_figure", ("state",), ("shear", "step"))
    return contact_domains(data, shear=shown_shear(data), panels=PANELS)


def _dilatancy(tree: xr.DataTree) -> Figure:
    rigid, elastic = (group(tree, path) for path in GROUPS[5])
    curves = [drawing for part, drawing in ((rigid, _rigid), (elastic, _elastic)) if part is not None]
    closure = group(tree, "joints/closure")
    force = _last_force(closure if elastic is None else elastic)
    maps = None if closure is None or "state" not in closure or force is None else closure
    width, top, below = 9.4 if len(curves) == 2 else _style.WIDTH, 3.1, 0.0
    if maps is not None:
        data = result_of(maps, "paper_figure", ("state",), ("shear", "step"))
        path, dim = chosen_path(data, None, force, PANELS, "paper_figure")
        below = maps_height(path, path.sizes[dim], width)
    sheet = _style.sheet(None, (width, top + below))
    parts = sheet.subfigures(2, 1, height_ratios=(top, below)) if maps is not None else [sheet]
    axes = parts[0].subplots(1, len(curves), squeeze=False)[0]
    for ax, drawing, letter in zip(axes, curves, "ab", strict=False):
        ax.set_title(rf"$\bf{{{letter}}}$  {drawing(ax, tree)}")
    if maps is not None:
        contact_domains(maps, normal_force=force, panels=PANELS, figure=parts[1])
    return _style.root(sheet)


def _rigid(ax: Axes, tree: xr.DataTree) -> str:
    rigid_dilatancy(group(tree, GROUPS[5][0]), ax=ax)
    return "rigid faces"


def _elastic(ax: Axes, tree: xr.DataTree) -> str:
    elastic, closure = group(tree, GROUPS[5][1]), group(tree, "joints/closure")
    assert elastic is not None
    marked: list[float] = []
    if closure is not None and "state" in closure and "shear" in closure.coords:
        marked = closure["shear"].values.ravel().tolist()
    direction = words(elastic["direction"])[0] if "direction" in elastic.coords else None
    elastic_dilatancy(elastic, direction=direction, reach=first_part(elastic), marked=marked, ax=ax)
    return "elastic faces" + (f", block slides {direction_word(direction)}" if direction else "")


def _last_force(data: xr.Dataset | None) -> float | None:
    if data is None or "normal_force" not in data.variables:
        return None
    return float(np.nanmax(data["normal_force"].values))


def shown_shear(data: xr.Dataset) -> float | None:
    """Return the shear whose domains are shown: near a fiftieth of the block's edge."""
    if "shear" not in data.coords:
        return None
    shears = np.atleast_1d(data["shear"].values).astype(float)
    if "x" not in data.coords:
        return float(shears[shears.size // 2])
    left, right, bottom, top = extent_of(data)
    wanted = SHOWN_SHEAR * min(right - left, top - bottom)
    return float(shears[nearest(np.log(np.maximum(shears, 1e-3 * wanted)), np.log(wanted))])
