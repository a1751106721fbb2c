"""Hydraulic aperture of a joint."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.plotting import _style
from fractalcontact.plotting._inputs import result_of, table, words
from fractalcontact.plotting._paths import curve_name, load_of, shear_words
from fractalcontact.plotting._units import PLAIN, label_axis, name_of, scale_of, shown_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fractalcontact.plotting._units import Units

FLOW_LINES = ("-", (0, (4, 2)))
# broad and pale, so that it is seen where the hydraulic aperture lies on it
MEAN_LINE: dict[str, Any] = {"lw": 4.5, "alpha": 0.3, "solid_capstyle": "butt", "zorder": 1.5}


@_style.checked
def hydraulic_aperture(result: Any, *, units: Units | None = None, ax: Axes | None = None) -> Axes:
    """Draw the hydraulic aperture against load, one curve per shear displacement and flow direction.

    The aperture is zero where contacts block the flow from side to side. Broad pale lines show the
    mechanical aperture (mean gap) if the result has it.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.joints.transmissivity`: hydraulic_aperture (m) over (shear, step, axis), or
        over some of them, and aperture (m) over (shear, step). With a single step it is drawn against shear.
    units : mapping of str to str, optional
        Unit of each variable by name, `{"closure": "mm"}` if the data have it. Default: a suitable prefix.
    ax : Axes, optional
        Default: those of a new figure.

    Returns
    -------
    Axes

    Raises
    ------
    InvalidInput
        A variable is missing, or the result has a further dimension.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((16, 16), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> pressed = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=[1e5, 1e6], keep=("gap",))
    >>> ax = fc.plotting.hydraulic_aperture(fc.joints.transmissivity(pressed["gap"]))
    >>> print(ax.get_ylabel())
    hydraulic aperture (µm)
    """
    result = shown_in(result, units, "hydraulic_aperture")
    ax = _style.axes_or_new(ax)
    data = result_of(result, "hydraulic_aperture", ("hydraulic_aperture",), ("shear", "step", "axis"))
    by_shear = data.sizes["step"] == 1 and "shear" in data.coords
    over, dim = ("step", "shear") if by_shear else ("shear", "step")
    against = "shear" if by_shear else load_of(data) or "step"
    labelled = against in data.variables
    aperture = table(data, "hydraulic_aperture", (over, dim, "axis"))
    if labelled:
        x = table(data, against, (over, dim))
    else:
        x = np.tile(np.arange(aperture.shape[1]), (len(aperture), 1))
    along = scale_of(data[against]) if labelled else PLAIN
    across = scale_of(data["hydraulic_aperture"])
    mean_gap = table(data, "aperture", (over, dim)) if "aperture" in data else None
    colours = _style.sequence_colours(len(aperture))
    flows = words(data["axis"]) if "axis" in data.coords else []
    shears = ("", []) if by_shear else shear_words(data)
    for i, colour in enumerate(colours):
        for j in range(aperture.shape[2]):
            ax.plot(along(x[i]), across(aperture[i, :, j]), color=colour, ls=FLOW_LINES[j % 2],
                    marker="o" if aperture.shape[1] <= _style.MAX_MARKED_POINTS else "",
                    label=curve_name(f"along {flows[j]}" if flows else "flow", shears, i))  # fmt: skip
        if mean_gap is not None:
            name = curve_name("mean gap", shears, i)
            ax.plot(along(x[i]), across(mean_gap[i]), color=colour, label=name, **MEAN_LINE)
    _style.log_x_if_wide(ax, x)
    if np.nanmax(aperture, initial=0.0) > 0:
        ax.set_ylim(bottom=0)
    label_axis(ax.xaxis, name_of(data[against]) if labelled else against, along)
    label_axis(ax.yaxis, name_of(data["hydraulic_aperture"]), across)
    _style.sequence_legend(ax, *shears, colours)
    if flows:
        entries = [_style.legend_line(f"along {word}", ls=FLOW_LINES[j % 2]) for j, word in enumerate(flows)]
        if mean_gap is not None:
            entries.append(_style.legend_line("mean gap", **MEAN_LINE))
        _style.side_legend(ax, entries, title="flow", low=True)
    return ax
