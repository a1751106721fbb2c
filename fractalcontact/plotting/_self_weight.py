"""Shear strength of a joint against the size of the structure above it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.plotting import _style
from fractalcontact.plotting._directions import direction_styles
from fractalcontact.plotting._inputs import result_of, table
from fractalcontact.plotting._paths import curve_name, shear_words
from fractalcontact.plotting._units import label_axis, name_of, scale_of, shown_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fractalcontact.plotting._units import Units

SHEAR_LINES: tuple[Any, ...] = ("-", (0, (4, 2)), (0, (1, 1.2)))
CONSTANT: dict[str, Any] = {"color": "0.6", "lw": 0.8, "ls": "-."}


@_style.checked
def self_weight(result: Any, *, units: Units | None = None, ax: Axes | None = None) -> Axes:
    """Draw the shear strength of a joint under self-weight against the size of the structure.

    One colour for each direction of sliding, one line style for each shear. A grey line is the strength for
    the basic friction angle alone, which grows as the size. Curves are missing where the faces lock.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.joints.self_weight`.
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
    >>> face = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.8, rms_increment=5e-6, rng=1)
    >>> crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=3.2e-3)
    >>> strength = fc.joints.self_weight(crack, structure_size=[10, 100], unit_weight=24e3, shear=1e-3)
    >>> ax = fc.plotting.self_weight(strength)
    >>> print(ax.get_xlabel(), ax.get_xscale(), ax.get_yscale())
    size of the structure (m) log log
    """
    result = shown_in(result, units, "self_weight")
    ax = _style.axes_or_new(ax)
    names = ("shear_strength", "structure_size", "nominal_pressure", "basic_friction_angle", "shear")
    data = result_of(result, "self_weight", names, ("direction", "shear", "structure_size"))
    along, across = scale_of(data["structure_size"]), scale_of(data["shear_strength"])
    strength = table(data, "shear_strength", ("direction", "shear", "structure_size"))
    sizes = along(data["structure_size"].values)
    directions = [(name, style | {"ls": "-"}) for name, style in direction_styles(data)]
    shears = shear_words(data)
    for i, (direction, style) in enumerate(directions):
        for j in range(strength.shape[1]):
            name = curve_name(direction or "shear strength", shears, j)
            line = style | {"ls": SHEAR_LINES[j % len(SHEAR_LINES)], "label": name}
            ax.plot(sizes, across(strength[i, j]), **line)
    angle = np.radians(table(data, "basic_friction_angle", ()))
    basic = table(data, "nominal_pressure", ("structure_size",)) * np.tan(angle)
    ax.plot(sizes, across(basic), label="basic angle alone", **CONSTANT)
    _style.log_scale(ax, x=sizes, y=basic)
    _style.plain_ticks(ax)
    label_axis(ax.xaxis, "size of the structure", along)
    label_axis(ax.yaxis, name_of(data["shear_strength"]), across)
    entries = [_style.legend_line(name, **style) for name, style in directions]
    _style.side_legend(ax, entries, title="block slides")
    title, labels = shears
    shown = [
        _style.legend_line(label, ls=SHEAR_LINES[j % len(SHEAR_LINES)]) for j, label in enumerate(labels)
    ]
    constant = _style.legend_line("basic angle\nalone", **CONSTANT)
    _style.side_legend(ax, [*shown, constant], title=title, low=True)
    return ax
