"""The numbers of the curves of a figure, as a table."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.validation import Problems
from fractalcontact.plotting._style import Axes

COLUMNS = ("panel", "curve", "x", "y", "x_axis", "y_axis")
SYMBOLS = {
    "delta": "δ", "Delta": "Δ", "Lambda": "Λ", "sigma": "σ", "tau": "τ", "theta": "θ", "mathrm": "", "bf": ""
}  # fmt: skip


def curves(axes: Any) -> Any:
    """Return the numbers of the curves drawn in a figure, as a table that can be written as CSV.

    Parameters
    ----------
    axes : Axes, or array, sequence or mapping of Axes
        As any function of `fractalcontact.plotting` returns them.

    Returns
    -------
    pandas.DataFrame
        One row for each point. The columns are the `panel` (its title, or its number), the `curve`, `x`
        and `y` as drawn, and the labels of both axes with their units. Azimuths are in degrees. A band is
        given by its outline, an interval by its ends. Maps are left out: their numbers are in the result.

    Raises
    ------
    InvalidInput
        `axes` are no Axes.

    See Also
    --------
    fractalcontact.scenes.tables : Every number of a result, not only those of one figure, in SI units.
    fractalcontact.plotting.draw : The figures of a study, with `formats=["png", "csv"]` also these tables.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-5, rng=1)
    >>> pressed = fc.contact.press(surface, contact_modulus=1e9, nominal_pressure=[1e6, 1e7])
    >>> numbers = fc.plotting.curves(fc.plotting.path(pressed, "mean_gap", against="nominal_pressure"))
    >>> numbers.to_csv(index=False).splitlines()[0]
    'panel,curve,x,y,x_axis,y_axis'
    >>> numbers[["curve", "x", "x_axis"]]
          curve     x                  x_axis
    0  mean gap   1.0  nominal pressure (MPa)
    1  mean gap  10.0  nominal pressure (MPa)
    """
    from matplotlib.axes import Axes

    panels: Mapping[Any, Any] = axes if isinstance(axes, Mapping) else {1: axes}
    if isinstance(axes, (list, tuple, np.ndarray)):
        panels = dict(enumerate(np.ravel(np.asarray(axes, dtype=object)), 1))
    with Problems("fc.plotting.curves") as problems:
        are_axes = bool(panels) and all(isinstance(ax, Axes) for ax in panels.values())
        expected = "Axes, or an array, sequence or mapping of them"
        problems.require(are_axes, "axes", expected, type(axes).__name__)
    rows = [row for name, ax in panels.items() for row in _of_panel(name, ax)]
    columns = {name: ("point", [row[i] for row in rows]) for i, name in enumerate(COLUMNS)}
    return xr.Dataset(columns).to_dataframe().reset_index(drop=True)


def _of_panel(name: Any, ax: Axes) -> Iterator[tuple[Any, ...]]:
    """Yield the rows of one panel."""
    titles = (ax.get_title(loc=place) for place in ("left", "center", "right"))
    panel = name if isinstance(name, str) else next(filter(None, map(_plain, titles)), name)
    is_polar = ax.name == "polar"
    labels = "azimuth (°)" if is_polar else _plain(ax.get_xlabel()), _plain(ax.get_ylabel())
    rows = _names_of_rows(ax)
    for curve, vertices in _labelled_points(ax):
        if curve.startswith("_"):
            continue
        x, y = np.asarray(vertices, dtype=np.float64).reshape(-1, 2).T
        points = np.stack([np.degrees(x) if is_polar else x, y], axis=1)
        for across, up in points[np.isfinite(points).all(axis=1)].tolist():
            yield panel, _plain(curve), across, rows.get(up, up), *labels


def _labelled_points(ax: Axes) -> Iterator[tuple[str, Any]]:
    """Yield the name and the points of every curve, interval and band that has a name."""
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.patches import Polygon

    for line in ax.lines:
        yield str(line.get_label()), line.get_xydata()
    for collection in ax.collections:
        if isinstance(collection, LineCollection):
            segments = [points for points in collection.get_segments() if len(points)]  # none of a NaN
            yield str(collection.get_label()), np.concatenate(segments or [np.empty((0, 2))])
        elif isinstance(collection, PolyCollection):
            for path in collection.get_paths():
                yield str(collection.get_label()), path.vertices
    for patch in ax.patches:
        if isinstance(patch, Polygon):
            yield str(patch.get_label()), patch.get_xy()


def _names_of_rows(ax: Axes) -> dict[float, str]:
    """Return what `set_yticks` was told to write at the ticks of the vertical axis, by the place."""
    from matplotlib.ticker import FixedLocator, FuncFormatter

    is_written = isinstance(ax.yaxis.get_major_formatter(), FuncFormatter)
    if not (isinstance(ax.yaxis.get_major_locator(), FixedLocator) and is_written):
        return {}
    texts = [label.get_text() for label in ax.get_yticklabels()]
    return dict(zip(map(float, ax.get_yticks()), texts, strict=False))


def _plain(text: str) -> str:
    """Return the text of a label without the signs of mathematical typesetting, on one line."""
    text = re.sub(r"\\([A-Za-z]+)", lambda match: SYMBOLS.get(match[1], match[1]), text)
    return " ".join(re.sub(r"[${}]", "", text).split())
