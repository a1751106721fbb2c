"""One page that describes a joint: numbers, strength, stiffness, aperture, flow and limits of validity.

`scenes.datasheet` draws it with rows of its tables, so the module is public inside the package.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.compass import direction_text, read_directions
from fractalcontact.base.grid import read_grid
from fractalcontact.base.study import group_of, provenance_of
from fractalcontact.base.units import Scale, quantity_text
from fractalcontact.plotting import _style
from fractalcontact.plotting._inputs import quantity, words
from fractalcontact.plotting._line_panel import LinePanel
from fractalcontact.plotting._paths import PATH, by_shear
from fractalcontact.plotting._strength import shear_curve, strength_envelope
from fractalcontact.plotting._style import Axes, AxesArray, Figure
from fractalcontact.plotting._units import Quantity

A4 = (8.27, 11.69)  # inches
MOST_LIMITS = 22  # lines: a quarter of the page
FLOW = Scale(1.0, "m³")  # transmissivities span decades: no prefix suits them all
# what a consultant has to answer for, with its symbol and its unit
INPUTS = {
    "young": ("E", "Pa"),
    "poisson": ("ν", ""),
    "basic_friction_angle": ("φb", ""),
    "residual_friction_angle": ("φr", ""),
    "cohesion": ("c", "Pa"),
    "wall_strength": ("JCS", "Pa"),
    "hardness": ("hardness", "Pa"),
}
GROUPS = (
    "strength_envelope", "direct_shear", "shear_curve", "closure", "closure_laws", "transmissivity",
    "roughness_coefficient", "directional_roughness", "uplift",
)  # fmt: skip


def draw_page(
    tree: xr.DataTree, numbers: Sequence[str], notes: Sequence[str], figure: Figure | None
) -> dict[str, Axes]:
    """Draw the page of a study, with numbers beside the strength and notes at its end; return its panels.

    It has strength, stiffness, aperture and flow against the normal stress, where the study has such groups.
    """
    import matplotlib.style

    groups = {name: group_of(tree, f"joints/{name}") for name in GROUPS}
    envelope, tests, curve = (groups[name] for name in ("strength_envelope", "direct_shear", "shear_curve"))
    panels: dict[str, Axes] = {}
    is_sheared = tests is not None or curve is not None
    title = str(tree.attrs.get("title") or tree.name or "joint")
    facts = "\n".join([_source(tree), *_input_lines(groups)])
    limits = list(_limits(groups, notes))[:MOST_LIMITS]
    # title, strength, shear test (no room without one), stiffness and flow, limits; of a line of 6 points .14
    ratios = (0.95, max(3.0, 0.14 * len(numbers)), 2.7 if is_sheared else 0.05, 2.5, 0.4 + 0.14 * len(limits))
    page = _style.new_figure(A4) if figure is None else figure
    with matplotlib.style.context(_style.STYLE):  # the text of the page fits at one size only
        page.set_size_inches(A4)
        page.set_layout_engine("constrained", w_pad=0.07, h_pad=0.07)
        page.set_facecolor("white")
        parts: Any = page.subfigures(len(ratios), 1, height_ratios=ratios)
        parts[0].text(0.03, 0.8, title, size=13, weight="bold", va="center")
        parts[0].text(0.03, 0.58, facts, size=7.5, color=_style.grey(), va="top", linespacing=1.4)
        left, right = parts[1].subfigures(1, 2, width_ratios=(1.0, 1.05))  # of a line of 74 characters
        left.text(0.06, 0.96, "\n".join(numbers), size=6.0, family="monospace", va="top", linespacing=1.4)
        if envelope is not None:
            panels["strength"] = right.add_subplot()
            _style.style_axes(panels["strength"])
            strength_envelope(envelope, tests=tests, ax=panels["strength"])
        if is_sheared:
            beside = curve if tests is not None else None
            curves = shear_curve(curve if tests is None else tests, beside=beside, axes=parts[2])
            panels |= zip(("shear stress", "dilatancy"), curves, strict=True)
        flows = _flow_panels(parts[3], groups)
        panels |= zip(("normal stiffness", "mean gap", "transmissivity"), flows, strict=True)
        parts[4].text(0.03, 1.0, "Limits of validity", size=9, weight="bold", va="top")
        parts[4].text(0.03, 1.0, "\n".join(["", "", *limits]), size=6.0, va="top", linespacing=1.4)
    return panels


def _source(tree: xr.DataTree) -> str:
    """Return where the faces come from: size and spacing of the heights, and the version."""
    heights = group_of(tree, "surfaces")
    version = str(tree.attrs.get("source", "fractalcontact"))
    if heights is None or "height" not in heights:
        return version
    grid = read_grid(heights["height"])
    edges = " x ".join(quantity_text(side, "m") for side in grid.extent)
    apart = " x ".join(dict.fromkeys(quantity_text(step, "m") for step in grid.spacing))
    return f"face of {edges}, {apart} apart; {version}"


def _input_lines(groups: dict[str, xr.Dataset | None]) -> Iterator[str]:
    """Yield what was scanned, and the constants of the material and the direction that were assumed."""
    stated: dict[str, Any] = {}
    for name in ("closure", "direct_shear", "shear_curve", "strength_envelope"):
        data = groups[name]
        stated |= {} if data is None else provenance_of(data).get("parameters", {})
    crack = stated.get("crack")
    if isinstance(crack, dict):
        stated = crack | stated
        spacing = [side / n for side, n in zip(crack["block"], crack["block_cells"], strict=True)]  # y, x
        counts = [crack["lower"]["dims"][dim] for dim in ("y", "x")]
        edges = " x ".join(quantity_text(n * step, "m") for n, step in zip(counts, spacing, strict=True))
        apart = " x ".join(dict.fromkeys(quantity_text(step, "m") for step in spacing))
        faces = "mated copy above" if crack["upper"] == "mated" else "both faces scanned"
        sides = " x ".join(quantity_text(side, "m") for side in crack["block"])
        yield f"face of {edges}, heights {apart} apart, {faces}; block of {sides}"
    texts = []
    for key, (symbol, units) in INPUTS.items():
        values = np.ravel(stated[key] if stated.get(key) is not None else [])
        if values.size:
            shown = ", ".join(quantity_text(float(v), units) if units else f"{float(v):g}" for v in values)
            texts.append(f"{symbol} {shown}{'°' if key.endswith('angle') else ''}")
    if "direction" in stated:
        names = [direction_text(direction.name) for direction in read_directions(stated["direction"])]
        texts.append(f"shear towards {', '.join(names)}")
    if texts:
        yield "assumed: " + "; ".join(texts)


def _flow_panels(figure: Any, groups: dict[str, xr.Dataset | None]) -> AxesArray:
    """Draw normal stiffness, aperture and transmissivity against the normal stress, one curve per shear."""
    axes: AxesArray = _style.panel_row(figure, 3, A4)
    last = None
    shown = {"stiffness": "closure_laws", "mean_gap": "closure", "transmissivity": "transmissivity"}
    for ax, (name, group) in zip(axes, shown.items(), strict=True):
        data = groups[group]
        if data is not None and "nominal_pressure" in data.variables:
            last = _draw_flow(ax, data, name)
        else:
            ax.set_axis_off()  # a blank place, not a panel without a curve
    if last is not None:
        last.draw_legends(ax=axes[2])
    return axes


def _draw_flow(ax: Axes, data: xr.Dataset, name: str) -> LinePanel:
    """Draw a quantity against the normal stress; of a flow each axis in its line."""
    data = data.expand_dims([dim for dim in ("axis", *PATH) if dim not in data.dims])
    pressure = quantity(data, "nominal_pressure", PATH, "normal stress")
    values = quantity(data, name, ("axis", *PATH))
    if name == "transmissivity":
        values = Quantity(values.values, FLOW, name)
    panel = LinePanel(ax, data, pressure, values, PATH, by_shear(data), points=_style.MAX_MARKED_POINTS)
    names = [f"along {word}" for word in words(data["axis"])] if "axis" in data.coords else []
    for i, rows in enumerate(values.values):
        kind, line = (names[i], _style.LINES[i % 2]) if names else (values.name, "-")
        panel.curves(kind, rows, key=kind if names else "", ls=line, ms=3.0)
    panel.finish(log="xy", legend=False)
    ax.set_title(values.scale.label(values.name))
    ax.set_ylabel("")
    return panel


def _limits(groups: dict[str, xr.Dataset | None], notes: Sequence[str]) -> Iterator[str]:
    """Yield lines: the notes, and what the results say of themselves."""
    texts = dict.fromkeys(notes)
    for name, data in groups.items():
        for variable in () if data is None else data.drop_vars("bulk_closure", errors="ignore").values():
            comment = str(variable.attrs.get("comment", ""))
            if comment and not comment.startswith(("NaN", "outside the range of the criterion")):
                quantity = str(variable.attrs.get("long_name", name.replace("_", " ")))
                texts[f"{quantity}: {comment}"] = None
    if groups["direct_shear"] is not None:
        texts["direct shear: one hardness, no gouge, no cohesion; no asperity smaller than the spacing"] = (
            None
        )
    for text in texts:
        yield from textwrap.wrap(f"- {text}", 178, subsequent_indent="  ")  # the page, in 6 points
