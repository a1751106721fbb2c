"""The joint under normal force: how far it closes, and how much of it touches."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.plotting import _style
from fractalcontact.plotting._paths import shear_words
from fractalcontact.plotting._reading import nearest, result_of, table
from fractalcontact.plotting._units import axis_label, scale_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@_style.styled
def closure_laws(
    closure: Any,
    *,
    shear: float | None = None,
    marked: Sequence[int] = (),
    key: bool = True,
    ax: Axes | None = None,
) -> Figure:
    """Draw force against closure, one curve for each shear.

    The whole closure w is drawn thin, that of the interface alone, w_int = w - w_b, thick.

    Parameters
    ----------
    closure : Dataset or node of a DataTree
        From `fractalcontact.joints.closure`: closure, interface_closure (m) and normal_force (N) over
        (shear, step), or over one of them.
    shear : float, optional
        Shear (m) of the curve that gets the marked points; the nearest one is taken.
    marked : sequence of int
        Steps to be marked A, B, C ... on that curve.
    key : bool
        Name the shears beside the axes.
    ax : Axes, optional
        Draw here; otherwise on a new figure.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        A variable is missing, or the result runs over something else as well.
    """
    figure, ax = _style.canvas(ax)
    data = result_of(closure, "closure_laws", ("closure", "normal_force"), ("shear", "step"))
    own = "interface_closure" if "interface_closure" in data else "closure"
    force = table(data, "normal_force", ("shear", "step"))
    whole = table(data, "closure", ("shear", "step"))
    inner = table(data, own, ("shear", "step"))
    length, newton = scale_of(data["closure"]), scale_of(data["normal_force"])
    colours = _style.family(len(force))
    for i, colour in enumerate(colours):
        dot = "o" if force.shape[1] == 1 else ""
        if own != "closure":
            ax.plot(length(whole[i]), newton(force[i]), color=colour, lw=0.8, alpha=0.75, marker=dot)
        ax.plot(length(inner[i]), newton(force[i]), color=colour, marker=dot)
    if len(marked) and len(force):
        row = 0 if shear is None or len(force) == 1 else nearest(data["shear"], shear)
        mark(ax, length(inner[row, list(marked)]), newton(force[row, list(marked)]), colours[row])
    ax.set_xlabel(length.label("closure"))
    ax.set_ylabel(axis_label(data["normal_force"], newton))
    from_zero(ax, whole, force)
    if key:
        shear_key(ax, data, colours)
    if own != "closure":
        _style.beside(
            ax,
            [
                _style.line_entry(r"interface, $w_\mathrm{int}$"),
                _style.line_entry("whole, $w$", lw=0.8, alpha=0.75),
            ],
            title="closure",
            low=True,
        )
    return figure


@_style.styled
def contact_area(result: Any, *, against: str = "normal_force", ax: Axes | None = None) -> Figure:
    """Draw the part of the nominal area that touches, one curve for each shear.

    The corrected area is drawn thick, the raw count of cells thin and broken: a cell that is touched in a
    corner counts whole, so the count is too high.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.joints.closure` or `fractalcontact.contact.press`: contact_fraction,
        corrected_contact_fraction and normal_force (N) over (shear, step), or over one of them.
    against : str
        Variable on the x axis: normal_force, nominal_pressure or closure.
    ax : Axes, optional
        Draw here; otherwise on a new figure.

    Returns
    -------
    Figure

    Raises
    ------
    InvalidInput
        A variable is missing, or the result runs over something else as well.

    References
    ----------
    Yastrebov, Anciaux and Molinari (2017), Journal of the Mechanics and Physics of Solids 107 (correction).
    """
    figure, ax = _style.canvas(ax)
    data = result_of(result, "contact_area", ("contact_fraction", against), ("shear", "step"))
    loads = table(data, against, ("shear", "step"))
    raw = table(data, "contact_fraction", ("shear", "step"))
    scale, percent = scale_of(data[against]), scale_of(data["contact_fraction"])
    corrected = "corrected_contact_fraction" in data
    colours = _style.family(len(loads))
    dot = "o" if loads.shape[1] == 1 else ""
    for i, colour in enumerate(colours):
        look: dict[str, Any] = {"lw": 0.9, "ls": (0, (4, 2))} if corrected else {}
        ax.plot(scale(loads[i]), percent(raw[i]), color=colour, marker=dot, **look)
        if corrected:
            fraction = table(data, "corrected_contact_fraction", ("shear", "step"))[i]
            ax.plot(scale(loads[i]), percent(fraction), color=colour, marker=dot)
    ax.set_xlabel(axis_label(data[against], scale))
    ax.set_ylabel(percent.label("real contact area over nominal area"))
    from_zero(ax, loads, raw)
    shear_key(ax, data, colours)
    if corrected:
        _style.beside(
            ax,
            [
                _style.line_entry("corrected for\nthe perimeter"),
                _style.line_entry("cells in contact", lw=0.9, ls=(0, (4, 2))),
            ],
            title="area",
            low=True,
        )
    return figure


def shear_key(ax: Axes, data: xr.Dataset, colours: Sequence[Any]) -> None:
    """Name the curves by their shear; a single curve without a shear needs no name."""
    title, texts = shear_words(data)
    if texts:
        _style.key(ax, title, texts, colours)


def mark(ax: Axes, x: Any, y: Any, colour: Any, first: int = 0) -> None:
    """Mark points of a curve with letters in rings, beginning with letter number `first`.

    The letters stand on their points, so that none lies on another curve.
    """
    ax.plot(x, y, "o", mfc="white", mec=colour, mew=1.2, ms=10.5, zorder=4, clip_on=False)
    for number, (a, b) in enumerate(zip(x, y, strict=True), first):
        if np.isfinite(a) and np.isfinite(b):
            ax.annotate(_style.letter(number), (a, b), fontsize=7, weight="bold", ha="center",
                        va="center_baseline", zorder=5, annotation_clip=False)  # fmt: skip


def from_zero(ax: Axes, x: Any, y: Any) -> None:
    """Let the axes start at zero where all that is shown is positive."""
    for values, axis in ((x, "x"), (y, "y")):
        shown = np.asarray(values, dtype=float)
        shown = shown[np.isfinite(shown)]
        if shown.size and shown.min() >= 0 and shown.max() > 0:
            ax.set_xlim(left=0) if axis == "x" else ax.set_ylim(bottom=0)
