"""Shear stress and dilatancy of a joint against shear displacement."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from fractalcontact.plotting import _style
from fractalcontact.plotting._inputs import result_of
from fractalcontact.plotting._units import label_axis, name_of, scale_of, shown_in

if TYPE_CHECKING:
    from fractalcontact.plotting._style import AxesArray, Panels
    from fractalcontact.plotting._units import Units

SHOWN = ("shear_stress", "dilatancy")
BESIDE: dict[str, Any] = {"lw": 1.0, "ls": "--"}  # curves to compare with


@_style.checked
def shear_curve(
    result: Any, *, beside: Any | None = None, units: Units | None = None, axes: Panels | None = None
) -> AxesArray:
    r"""Draw shear stress and dilatancy against shear displacement, one curve per normal stress.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.joints.direct_shear` or `fractalcontact.joints.shear_curve`.
    beside : Dataset or node of a DataTree, optional
        Such a result to draw dashed, in the colours of the same normal stresses.
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
        A variable is missing.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 5e-4, hurst=0.8, rms_increment=1e-4, rng=1)
    >>> result = fc.joints.shear_curve(
    ...     surface, [0, 1e-3, 5e-3], nominal_pressure=1e6, wall_strength=6e7, residual_friction_angle=30
    ... )
    >>> print(fc.plotting.shear_curve(result)[0].get_ylabel())
    shear stress $\tau$ (MPa)
    """
    result = shown_in(result, units, "shear_curve")
    data = [_read(result)] + ([] if beside is None else [_read(beside)])
    shown = _style.panel_row(axes, 2, (_style.WIDTH, 3.1), sharex=True)
    every = np.concatenate([each["nominal_pressure"].values for each in data])
    pressures, places = np.unique(every, return_inverse=True)  # NaN, which equals no key, has a place too
    colours = _style.sequence_colours(pressures.size)
    of_test, of_other = np.split(places, [data[0].sizes["nominal_pressure"]])
    displacements = np.concatenate([each["shear_displacement"].values.ravel() for each in data])
    along = scale_of(data[0]["shear_displacement"], displacements)
    stress = scale_of(data[0]["nominal_pressure"], pressures)
    for ax, name in zip(shown, SHOWN, strict=True):
        across = scale_of(data[0][name], np.concatenate([each[name].values.ravel() for each in data]))
        for each, own, style in zip(data, (of_test, of_other), ({}, BESIDE), strict=False):
            for i, pressure in enumerate(each["nominal_pressure"].values.tolist()):
                x = np.broadcast_to(each["shear_displacement"].values, each[name].shape)[i]
                label = f"{each.attrs.get('title', name)}, normal stress {stress.text(pressure)}"
                ax.plot(along(x), across(each[name].values[i]), color=colours[own[i]], label=label, **style)
        label_axis(ax.yaxis, name_of(data[0][name]), across)
        label_axis(ax.xaxis, name_of(data[0]["shear_displacement"]), along)
    labels = [f"{value:.3g}" for value in stress(pressures)]
    entries = [_style.legend_line(text, color=each) for text, each in zip(labels, colours, strict=True)]
    if beside is not None:
        entries += [
            _style.legend_line(each.attrs.get("title", ""), **style)
            for each, style in zip(data, ({}, BESIDE), strict=True)
        ]
    _style.side_legend(shown[1], entries, title=f"normal stress\n({stress.unit})")
    return shown


def _read(result: Any) -> xr.Dataset:
    names = (*SHOWN, "shear_displacement", "nominal_pressure")
    data = result_of(result, "shear_curve", names, ("nominal_pressure",))
    along = (data["shear_displacement"], data["nominal_pressure"])
    data = data.assign({name: xr.broadcast(data[name], *along)[0] for name in SHOWN})
    return data.transpose("nominal_pressure", ..., missing_dims="ignore")
