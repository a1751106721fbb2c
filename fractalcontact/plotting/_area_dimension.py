"""Contact area of a joint against the spacing of its heights."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fractalcontact.plotting import _style
from fractalcontact.plotting._inputs import result_of, table
from fractalcontact.plotting._paths import at_shear, curve_name, load_words, shear_text
from fractalcontact.plotting._units import label_axis, name_of, scale_of, shown_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fractalcontact.plotting._units import Units

CORRECTED: dict[str, Any] = {"ls": (0, (4, 2)), "marker": "s", "ms": 3.5}


@_style.checked
def area_dimension(
    result: Any, *, shear: float | None = None, units: Units | None = None, ax: Axes | None = None
) -> Axes:
    """Draw the real contact area of a joint against the spacing of its heights, one curve per load.

    Solid lines are the cells in contact, dashed lines the area corrected for their perimeter. The slope of a
    straight line would be 2 less the dimension by area.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.joints.area_dimension`.
    shear : float, optional
        Shear (m), the nearest one is drawn; None: the middle one.
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
    >>> areas = fc.joints.area_dimension(crack, shear=4e-4, nominal_pressure=[1e6, 1e7])
    >>> ax = fc.plotting.area_dimension(areas)
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    spacing (µm) | real contact area (%)
    """
    result = shown_in(result, units, "area_dimension")
    ax = _style.axes_or_new(ax)
    names = ("contact_fraction", "corrected_contact_fraction", "resolution")
    data = at_shear(result_of(result, "area_dimension", names, ("shear", "step", "resolution")), shear)
    along, across = scale_of(data["resolution"]), scale_of(data["contact_fraction"])
    counted, corrected = (table(data, name, ("step", "resolution")) for name in names[:2])
    colours = _style.sequence_colours(len(counted))
    spacing = along(data["resolution"].values)
    loads = load_words(data)
    for i, colour in enumerate(colours):
        labels = [curve_name(what, loads, i) for what in ("cells", "corrected for the perimeter")]
        ax.plot(spacing, across(counted[i]), color=colour, marker="o", label=labels[0])
        ax.plot(spacing, across(corrected[i]), color=colour, label=labels[1], **CORRECTED)
    _style.log_scale(ax, x=spacing, y=counted)
    _style.plain_ticks(ax)
    ax.set_xticks(spacing, [f"{value:g}" for value in spacing])
    ax.set_xticks([], minor=True)
    label_axis(ax.xaxis, "spacing", along)
    label_axis(ax.yaxis, name_of(data["contact_fraction"]), across)
    ax.set_title(shear_text(data))
    _style.sequence_legend(ax, *loads, colours)
    entries = [
        _style.legend_line("cells", marker="o"),
        _style.legend_line("perimeter-\ncorrected", **CORRECTED),
    ]
    _style.side_legend(ax, entries, low=True)
    return ax
