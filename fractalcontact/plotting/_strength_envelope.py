"""Shear strength against the normal stress by several criteria."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.plotting import _style
from fractalcontact.plotting._inputs import require_dims, result_of, words
from fractalcontact.plotting._units import label_axis, name_of, scale_of, shown_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fractalcontact.plotting._units import Units

OUTSIDE_LINE: dict[str, Any] = {"lw": 1.0, "ls": ":"}  # where a criterion is out of its range


@_style.checked
def strength_envelope(
    result: Any, *, tests: Any | None = None, units: Units | None = None, ax: Axes | None = None
) -> Axes:
    r"""Draw the peak shear strength against the normal stress, one curve per criterion.

    A curve is dotted where its criterion is used out of its range.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.joints.strength_envelope`.
    tests : Dataset or node of a DataTree, optional
        From `fractalcontact.joints.direct_shear`; its peak strengths are drawn as points.
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
        A variable is missing.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 5e-4, hurst=0.8, rms_increment=1e-4, rng=1)
    >>> result = fc.joints.strength_envelope(
    ...     surface, nominal_pressure=[1e6, 2e6, 4e6], wall_strength=60e6, basic_friction_angle=30
    ... )
    >>> print(fc.plotting.strength_envelope(result).get_ylabel())
    shear strength $\tau$ (MPa)
    """
    result = shown_in(result, units, "strength_envelope")
    ax = _style.axes_or_new(ax)
    data = result_of(result, "strength_envelope", ("shear_strength", "in_range", "criterion"), ("criterion",))
    for dim in ("criterion", "nominal_pressure"):
        require_dims(data, "strength_envelope", {"shear_strength": dim, "in_range": dim})
    data = data.sortby("nominal_pressure")
    pressure = data["nominal_pressure"]
    strength = data["shear_strength"].transpose("criterion", "nominal_pressure")
    in_range = data["in_range"].transpose("criterion", "nominal_pressure").values
    # one unit on both axes, so that a slope can be read as a friction coefficient
    scale = scale_of(data["shear_strength"], np.concatenate([pressure.values, strength.values.ravel()]))
    x = scale(pressure)
    entries = []
    for i, name in enumerate(words(data["criterion"])):
        colour = _style.cycle()[i % len(_style.cycle())]
        y = scale(strength.values[i])
        authors = " and ".join(part.capitalize() for part in name.split("_"))
        ax.plot(x, y, color=colour, label=authors, **OUTSIDE_LINE)
        ax.plot(x, np.where(in_range[i], y, np.nan), color=colour, label=f"{authors}, in range")
        entries.append(_style.legend_line(authors, color=colour))
    if not in_range.all():
        entries.append(_style.legend_line("out of range", **OUTSIDE_LINE))
    if tests is not None:
        names = ("peak_shear_strength", "residual_shear_strength", "nominal_pressure")
        found = result_of(tests, "strength_envelope", names, ("nominal_pressure",), "tests")
        for name, marker in (("peak_shear_strength", "o"), ("residual_shear_strength", "x")):
            style: dict[str, Any] = {"ls": "", "marker": marker, "color": _style.ink(), "zorder": 3}
            label = f"direct shear, {name.partition('_')[0]}"
            ax.plot(scale(found["nominal_pressure"]), scale(found[name]), clip_on=False, label=label, **style)
            entries.append(_style.legend_line(label, **style))
    ax.set_xlim(left=0)
    ax.set_ylim(bottom=0)
    label_axis(ax.xaxis, name_of(pressure), scale)
    label_axis(ax.yaxis, name_of(data["shear_strength"]), scale)
    _style.side_legend(ax, entries)
    return ax
