"""The joint as a conduit: how wide it is for the fluid that leaks through it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.plotting import _style
from fractalcontact.plotting._paths import load_of, shear_words
from fractalcontact.plotting._reading import result_of, table, words
from fractalcontact.plotting._units import axis_label, scale_for, scale_of
from fractalcontact.plotting.lacunar import FEW, wide_axis

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FLOW_LINES = ("-", (0, (4, 2)))
MEAN: dict[str, Any] = {"lw": 1.0, "ls": ":"}


@_style.styled
def hydraulic_aperture(result: Any, *, ax: Axes | None = None) -> Figure:
    """Draw the hydraulic aperture against load, one curve for each shear and each direction of the flow.

    Where contacts bar the way from side to side the aperture is zero. The mechanical aperture, the mean
    opening, is drawn thin and dotted beside it where it is known.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.joints.transmissivity`: hydraulic_aperture (m) over (shear, step, axis), or
        over some of them, and aperture (m) over (shear, step). With a single step it is drawn against shear.
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
    data = result_of(result, "hydraulic_aperture", ("hydraulic_aperture",), ("shear", "step", "axis"))
    by_shear = data.sizes["step"] == 1 and "shear" in data.coords
    over, dim = ("step", "shear") if by_shear else ("shear", "step")
    against = "shear" if by_shear else load_of(data) or "step"
    aperture = table(data, "hydraulic_aperture", (over, dim, "axis"))
    known = against in data.variables
    places = (
        table(data, against, (over, dim))
        if known
        else np.tile(np.arange(aperture.shape[1]), (len(aperture), 1))
    )
    along = scale_of(data[against]) if known else scale_for("", 1.0)
    across = scale_of(data["hydraulic_aperture"])
    opening = table(data, "aperture", (over, dim)) if "aperture" in data else None
    colours = _style.family(len(aperture))
    for i, colour in enumerate(colours):
        for j in range(aperture.shape[2]):
            ax.plot(along(places[i]), across(aperture[i, :, j]), color=colour, ls=FLOW_LINES[j % 2],
                    marker="o" if aperture.shape[1] <= FEW else "")  # fmt: skip
        if opening is not None:
            ax.plot(along(places[i]), across(opening[i]), color=colour, **MEAN)
    wide_axis(ax, places)
    if np.nanmax(aperture, initial=0.0) > 0:
        ax.set_ylim(bottom=0)
    ax.set_xlabel(axis_label(data[against], along) if known else against)
    ax.set_ylabel(axis_label(data["hydraulic_aperture"], across))
    title, texts = ("", []) if by_shear else shear_words(data)
    shown = _style.chosen(len(texts), _style.LONGEST_KEY)
    if texts:
        _style.beside(ax, [_style.line_entry(texts[i], color=colours[i]) for i in shown], title=title)
    flows = words(data["axis"]) if "axis" in data.coords else []
    if flows:
        entries = [_style.line_entry(f"along {word}", ls=FLOW_LINES[j % 2]) for j, word in enumerate(flows)]
        if opening is not None:
            entries.append(_style.line_entry("mean opening", **MEAN))
        _style.beside(ax, entries, title="flow", low=True)
    return figure
