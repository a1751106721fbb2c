"""Hurst exponent against wavelength, with the window of one exponent."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.plotting import _style
from fractalcontact.plotting._inputs import result_of, table
from fractalcontact.plotting._units import PLAIN, label_axis, name_of, scale_of, shown_in

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from fractalcontact.plotting._units import Units

LOWEST, HIGHEST = -1.5, 2.5  # exponents on the axis


@_style.checked
def scaling(result: Any, *, units: Units | None = None, ax: Axes | None = None) -> Axes:
    """Draw the Hurst exponent of every octave of wavelength with its interval.

    The band is the longest run of octaves with one exponent, as wide as its wavelengths and as high as the
    interval of its exponent. The range of fractals, 0 to 1, lies between the dotted lines.

    Parameters
    ----------
    result : Dataset or node of a DataTree
        From `fractalcontact.dimensions.scaling`.
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
    >>> surface = fc.surfaces.fbm((64, 64), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> ax = fc.plotting.scaling(fc.dimensions.scaling(surface))
    >>> print(ax.get_xlabel(), "|", ax.get_ylabel())
    wavelength (mm) | Hurst exponent
    """
    from matplotlib.patches import Patch

    result = shown_in(result, units, "scaling")
    ax = _style.axes_or_new(ax)
    window = ("window_hurst", "window_ci_low", "window_ci_high", "scale_min", "scale_max")
    names = ("hurst", "ci_low", "ci_high", "wavelength", *window)
    data = result_of(result, "scaling", names, ("wavelength",))
    along = scale_of(data["wavelength"])
    x = along(data["wavelength"].values)
    hurst, low, high = (table(data, name, ("wavelength",)) for name in ("hurst", "ci_low", "ci_high"))
    bars = np.maximum([hurst - low, high - hurst], 0.0)  # of an interval beside its value one end shows
    points: dict[str, Any] = {"color": _style.ink(), "marker": "o", "ms": 3.5, "lw": 1.0}
    ax.errorbar(x, hurst, bars, ls="", elinewidth=1.0, label="octave, 95 %", **points)
    entries = [_style.legend_line("octave, 95 %", **points)]
    window_hurst, bottom, top, *ends = (float(table(data, name, ())) for name in window)
    if np.isfinite(window_hurst):
        ends = [float(along(end)) for end in ends]
        ax.fill_between(ends, bottom, top, color=_style.BLUE, alpha=0.35, lw=0, label="one exponent, 95 %")
        ax.plot(ends, 2 * [window_hurst], color=_style.BLUE, lw=1.2, label="one exponent")
        entries.append(Patch(facecolor=_style.BLUE, alpha=0.35, lw=0, label="one exponent"))
    for limit in (0.0, 1.0):
        ax.axhline(limit, color=_style.grey(), lw=0.7, ls=":")
    ax.set_xscale("log")
    _style.plain_ticks(ax)
    bottom, top = np.fmin.reduce(low, initial=HIGHEST), np.fmax.reduce(high, initial=LOWEST)
    if bottom < top:
        ax.set_ylim(max(LOWEST, float(bottom) - 0.1), min(HIGHEST, float(top) + 0.1))
    label_axis(ax.xaxis, name_of(data["wavelength"]), along)
    label_axis(ax.yaxis, "Hurst exponent", PLAIN)
    _style.side_legend(ax, entries)
    return ax
