"""Numbers of the summary as text: with their unit, over the members, by shear and by direction."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.schema import QUANTITIES
from fractalcontact.base.units import Scale, fixed, number, quantity_text, scale_for

Array = np.ndarray[Any, np.dtype[Any]]

WIDE_COLUMN = 1e3  # greatest ratio of the values of a column with one unit
ROUNDING = 1e-12  # a spread below it is none: the same load for every member
FRACTIONS = frozenset({"contact_fraction", "corrected_contact_fraction"})


def amount(data: Any, digits: int = 3, scale: Scale | None = None) -> str:
    """Return a value with its unit and SI prefix; of an ensemble mean and standard deviation.

    `scale` is that of a column, see `column_scale`.
    """
    name = str(data.name)
    if name in FRACTIONS:
        scale = Scale(0.01, "%")
    elif scale is None:
        scale = scale_for(_units_of(data), float(finite(data).mean()) if finite(data).size else np.nan)
    unit = f" {scale.unit}".rstrip()
    return _over_members(scale(data.values), lambda value: number(value, digits), _decimals_of, unit)


def _units_of(data: Any) -> str:
    return str(data.attrs.get("units") or QUANTITIES[str(data.name)].units or "")


def column_scale(data: Any) -> Scale | None:
    """Return one unit for a column of a table; None, each value its own, where they span three decades."""
    sizes = np.abs(finite(data))
    sizes = sizes[sizes > 0]
    if sizes.size == 0 or sizes.max() >= WIDE_COLUMN * sizes.min():
        return None
    return scale_for(_units_of(data), float(np.median(sizes)))


def plain(data: Any, decimals: int, *, sign: bool = False) -> str:
    """Return a number with so many decimals; of an ensemble mean and standard deviation."""
    return _over_members(
        data.values,
        lambda value: fixed(value, decimals, sign=sign),
        lambda _: decimals,
    )


def _over_members(
    values: Any, text: Callable[[float], str], decimals: Callable[[float], int], unit: str = ""
) -> str:
    """Return the value of all, or mean ± standard deviation with the number of members that have one.

    `text` writes a single value; `decimals` gives those of the mean and of the deviation from the deviation.
    """
    values = np.asarray(values, dtype=float)
    known = values[np.isfinite(values)]
    if known.size == 0:
        return "-"
    share = f" ({known.size} of {values.size})" if known.size < values.size else ""
    if values.ndim == 0 or float(np.ptp(known)) <= ROUNDING * float(np.abs(known).max()):
        return text(float(known[0])) + unit + share
    spread = float(np.std(known, ddof=1))
    digits, sign = decimals(spread), text(float(known.mean())).startswith("+")
    return f"{fixed(float(known.mean()), digits, sign=sign)} ± {fixed(spread, digits)}{unit}{share}"


def _decimals_of(spread: float) -> int:
    """Return the decimals that show a standard deviation with two digits."""
    return max(0, 1 - int(np.floor(np.log10(spread))))


def finite(data: Any) -> Array:
    values = np.asarray(data.values, dtype=float)
    return np.asarray(values[np.isfinite(values)])


def length(value: Any) -> str:
    """Return a length in metres with the prefix that suits it."""
    return quantity_text(value, "m")


def at_shears(data: xr.Dataset) -> Iterator[tuple[str, xr.Dataset]]:
    """Yield every shear as text with its results."""
    if "shear" not in data.coords:
        yield "", data
        return
    shears = np.atleast_1d(data["shear"].values)
    scale = scale_for("m", shears)
    for i, shear in enumerate(shears):
        yield scale.text(shear), data.isel(shear=i) if "shear" in data.dims else data


def at_directions(data: xr.Dataset) -> Iterator[tuple[str, xr.Dataset]]:
    """Yield the name of every direction with its results."""
    for direction in np.atleast_1d(data["direction"].values):
        yield str(direction), data.sel(direction=direction) if "direction" in data.dims else data
