"""Directional roughness as a polar figure."""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.validation import Problems
from fractalcontact.plotting import _style
from fractalcontact.plotting._figure import figure
from fractalcontact.plotting._inputs import require_dims, result_of
from fractalcontact.plotting._style import Axes
from fractalcontact.plotting._units import Units, scale_of

COMPASS = ("E", "45°", "N", "135°", "W", "225°", "S", "315°")
CURVES: dict[str, tuple[str, dict[str, Any]]] = {
    "roughness_metric": ("$\\theta^*_{max}/(C+1)$", {"color": _style.BLUE, "ls": "-"}),
    "mean_dip": ("mean dip", {"color": _style.RED} | _style.DASHED),
}


@figure
def directional_roughness(result: Any, *, units: Units | None = None, ax: Axes | None = None) -> Axes:
    r"""Draw the directional roughness over the azimuth of the shear, in polar coordinates.

    The distance from the centre is an angle: the metric theta_max/(C+1), and dashed the mean apparent dip
    that faces the shear. The two coincide where the law of the area holds.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.joints.directional_roughness`.
    {shared}

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=2e-5, rng=1)
    >>> result = fc.joints.directional_roughness(surface)
    >>> ax = fc.plotting.directional_roughness(result)
    >>> [line.get_label() for line in ax.lines]
    ['$\\theta^*_{max}/(C+1)$', 'mean dip']
    """
    from matplotlib.patheffects import withStroke
    from matplotlib.ticker import MaxNLocator

    data = result_of(result, tuple(CURVES), ("azimuth",), units)
    require_dims(data, dict.fromkeys(CURVES, "azimuth"))
    polar: Any = _style.axes_or_new(ax, (_style.PANEL[0], _style.MAP[1]), projection="polar")
    with Problems("fc.plotting") as problems:
        problems.require(polar.name == "polar", "ax", "polar axes (projection='polar')", polar.name)
    azimuth = data["azimuth"].values
    order = np.argsort(azimuth % 360.0)
    if _is_full_circle(azimuth):
        order = np.append(order, order[0])
    angle = scale_of(data[next(iter(CURVES))])
    for name, (label, style) in CURVES.items():
        polar.plot(np.radians(azimuth[order]), angle(data[name].values[order]), label=label, **style)
    greatest = float(np.nan_to_num([float(angle(data[name].max())) for name in CURVES]).max())
    polar.set_ylim(0.0, 1.12 * greatest or 1.0)
    rings = np.asarray(MaxNLocator(4).tick_values(0.0, polar.get_ylim()[1]))  # labels of 4 stay apart
    polar.set_rticks(rings[(rings > 0) & (rings <= polar.get_ylim()[1])])
    polar.set_thetagrids(np.arange(0, 360, 45), COMPASS)
    polar.yaxis.set_major_formatter("{x:g}" + (angle.unit if angle.unit == "°" else f" {angle.unit}"))
    polar.yaxis.units, polar.yaxis.factor = angle.unit, angle.factor
    polar.set_rlabel_position(22.5)
    halo = withStroke(linewidth=2.0, foreground=_style.tone(0.0))  # of labels that cross a line
    for tick_label in polar.get_yticklabels():
        tick_label.set_path_effects([halo])
    _style.side_legend(polar, polar.lines)
    drawn: Axes = polar
    return drawn


def _is_full_circle(azimuth: Any) -> bool:
    """Return whether no gap between neighbouring azimuths is longer than 90 degrees."""
    angles = np.sort(np.asarray(azimuth, dtype=np.float64) % 360.0)
    gaps = np.diff(np.append(angles, angles[0] + 360.0))
    return bool(gaps.max() <= 90.0)
