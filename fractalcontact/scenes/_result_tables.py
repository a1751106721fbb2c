"""The tables of a summary: which variables of the result of a stage they show, and the text of their cells.

A `Rows` declares the table of one stage; `_stages` names it beside the function of the stage. `table_of`
makes it from the result. Screen and report render the same tables: the screen some of the columns, with the
tables of all stages over the same shears, directions or loads joined.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.compass import direction_text
from fractalcontact.base.numbers import Array, spread_indices
from fractalcontact.base.schema import units_of
from fractalcontact.base.units import Scale, fixed, number, quantity_text, scale_for, without_rounding

Remarks = Callable[[xr.DataTree, xr.Dataset], Iterable[str]]

SCAN = "scan"  # the dim of many scans
FRACTIONS = ("contact_fraction", "corrected_contact_fraction", "stick_fraction", "coverage", "largest_share")
PATHS = ("shear", "step", "nominal_pressure")  # a table without rows along one shows its last value
# head of the first column of a table, by the dim of its rows, where it is not the name of the dim
KEYS = {"direction": "toward", "structure_size": "size of the structure", "resolution": "spacing"}


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes
    ----------
    head : str
    values : str, pair of str, or function
        A variable; the ends of an interval; or a function of the state of one row, which returns an array, or
        text. A column is left out where the result does not have its variable.
    decimals : int, optional
        Of a plain number. Default: three digits, with the unit.
    screen : bool
        Whether the short summary shows it.
    """

    head: str
    values: str | tuple[str, str] | Callable[[xr.Dataset], Any]
    decimals: int | None = None
    screen: bool = True


def no_remarks(*_: object) -> Iterable[str]:
    """Return no remark."""
    return ()


@dataclass(frozen=True)
class Rows:
    """The table of a stage.

    Attributes
    ----------
    title : str
    over : tuple of str
        The dims along which it has rows, of those that the result has; "step" is the path of the load.
        Other paths of loads and shears are shown at their end: a row of a shear under the last load.
    columns : tuple of Column
    remarks : function
        What a reader of the whole table needs to know.
    first_dim : bool
        Rows along the first of the dims alone: over ("shear", "step") a row is a shear, under the last load.
    load : str
        The variable that names a step; default the nominal pressure.
    """

    title: str
    over: tuple[str, ...]
    columns: tuple[Column, ...]
    remarks: Remarks = no_remarks
    first_dim: bool = False
    load: str = "nominal_pressure"


@dataclass(frozen=True)
class ResultTable:
    """A table as text: the head and cells of the key of each row, and those of its values.

    The short summary shows the columns with the heads `on_screen`.
    """

    title: str
    key_heads: tuple[str, ...]
    keys: tuple[tuple[str, ...], ...]
    heads: tuple[str, ...]
    cells: tuple[tuple[str, ...], ...]
    on_screen: tuple[str, ...]
    remarks: tuple[str, ...] = ()

    @property
    def rows(self) -> list[tuple[str, ...]]:
        """The head and the rows."""
        body = zip(self.keys, self.cells, strict=True)
        return [(*self.key_heads, *self.heads), *((*key, *cells) for key, cells in body)]

    def beside(self, other: ResultTable) -> ResultTable:
        """Return this table with the columns of another one; a row that one of them lacks has empty cells."""
        keys = self.keys if len(self.keys) >= len(other.keys) else other.keys
        ours, theirs = (dict(zip(each.keys, each.cells, strict=True)) for each in (self, other))
        empty = [("",) * len(each.heads) for each in (self, other)]
        cells = tuple((*ours.get(key, empty[0]), *theirs.get(key, empty[1])) for key in keys)
        return replace(self, keys=keys, heads=(*self.heads, *other.heads), cells=cells)

    def selected(self, heads: Sequence[str]) -> ResultTable:
        """Return the table with these of its columns, in this order, as far as it has them."""
        places = [self.heads.index(head) for head in heads if head in self.heads]
        cells = tuple(tuple(row[i] for i in places) for row in self.cells)
        return replace(self, heads=tuple(self.heads[i] for i in places), cells=cells)

    def shortened(self, most: int) -> ResultTable:
        """Return at most so many rows, evenly spread from the first to the last."""
        if len(self.keys) <= most:
            return self
        places = spread_indices(len(self.keys), most)
        rest = f"{len(places)} of {len(self.keys)}"
        heads = (f"{self.key_heads[0]} ({rest})", *self.key_heads[1:])
        keys, cells = (tuple(rows[i] for i in places) for rows in (self.keys, self.cells))
        return replace(self, key_heads=heads, keys=keys, cells=cells)


def table_of(rows: Rows, tree: xr.DataTree, data: xr.Dataset) -> ResultTable | None:
    """Return the table of a result; None where the result has none of its columns."""
    dims = [dim for dim in rows.over if dim in data.dims]
    dims = dims[:1] if rows.first_dim else dims
    keys = dims or [dim for dim in rows.over if dim in data.coords][:1]
    others = {dim: -1 for dim in PATHS if dim in data.dims and dim not in dims}
    load_dims = data[rows.load].dims if rows.load in data.variables else ()
    # the load of a spring changes along the shear
    along = "".join(f", at the last {dim}" for dim in others if dim in load_dims)
    data = data.isel(others)
    states = [
        data.isel(dict(zip(dims, place, strict=True)))
        for place in np.ndindex(*(data.sizes[dim] for dim in dims))
    ]
    columns = {column.head: cells for column in rows.columns if (cells := _cells(column, states)) is not None}
    if not columns or not states:
        return None
    key_heads, key_cells = [], []
    for dim in keys:
        values = [_key(dim, state, data, rows) for state in states]
        key_heads.append(KEYS.get(dim, (rows.load if dim == "step" else dim).replace("_", " ")))
        key_heads[-1] += along if dim == "step" else ""
        key_cells.append(values)
    if "shear" in keys[:1] and "direction" in data.coords and data["direction"].ndim == 0:
        key_heads[0] += f" to {direction_text(data['direction'].values)}"
    has_load = {"step", "nominal_pressure"} & set(others) and "nominal_pressure" in data.coords and key_heads
    if has_load and are_one(finite(data["nominal_pressure"])):
        key_heads[0] += f", at {amount(data['nominal_pressure'])}"
    table_keys = tuple(zip(*key_cells, strict=True)) if key_cells else ((),) * len(states)
    rows_of_cells = tuple(zip(*columns.values(), strict=True))
    on_screen = tuple(column.head for column in rows.columns if column.screen and column.head in columns)
    remarks = tuple(rows.remarks(tree, data))
    return ResultTable(
        rows.title, tuple(key_heads), table_keys, tuple(columns), rows_of_cells, on_screen, remarks
    )


def _key(dim: str, state: xr.Dataset, data: xr.Dataset, rows: Rows) -> str:
    """Return the value of a dim that names a row: a length in the unit of its column, a load, or a word.

    A load that no force balances, that of a periodic body beyond full contact, has the closure in its place.
    """
    if dim == "step":
        if rows.load not in state.variables:
            return str(int(state["step"])) if "step" in state.coords else ""
        if "closure" in state.variables and not np.isfinite(state[rows.load].values).any():
            return f"closure {amount(state['closure'])}"
        return amount(state[rows.load], scale=column_scale(data[rows.load]))
    if dim not in state.coords:
        return ""
    value = state[dim]
    if value.dtype.kind not in "fiu":
        return direction_text(value.values) if dim == "direction" else str(value.values)
    return amount(value, scale=scale_for(units_of(value.name, value.attrs), data[dim].values))


def _cells(column: Column, states: Sequence[xr.Dataset]) -> list[str] | None:
    """Return the cells of a column; None where the result does not have it."""
    values = [_value(column, state) for state in states]
    if all(item is None for item in values):
        return None
    scale = _scale_of([item for item in values if isinstance(item, xr.DataArray)])
    return [cell(item, column.decimals, scale) if item is not None else "-" for item in values]


def _value(column: Column, state: xr.Dataset) -> Any:
    """Return the value of a column in the state of one row; None where the result does not have it."""
    values = column.values
    if callable(values):
        return values(state)
    if isinstance(values, str):
        return state[values] if values in state.variables else None
    ends = [state[name] for name in values if name in state.variables]
    return interval(ends[0], ends[1], column.decimals) if len(ends) == 2 else None


def _scale_of(cells: Sequence[xr.DataArray]) -> Scale | None:
    """Return one unit for the cells of a column."""
    if not cells or any(each.dtype.kind not in "fiu" for each in cells):
        return None
    together = np.concatenate([finite(each) for each in cells])
    return column_scale(xr.DataArray(together, dims="cell", name=cells[0].name, attrs=cells[0].attrs))


def cell(value: Any, decimals: int | None, scale: Scale | None = None) -> str:
    """Return a value as text: a number with so many decimals, or with its unit, see `amount`."""
    if isinstance(value, str):
        return value
    if value.dtype.kind == "b":
        return _yes_or_no(value)
    if value.dtype.kind not in "fiu":
        return str(value.values)
    return amount(value, scale=scale) if decimals is None else plain(value, decimals)


def _yes_or_no(value: xr.DataArray) -> str:
    count, size = int(value.sum()), value.size
    return f"{count} of {size}" if 0 < count < size else "yes" if count else "no"


def interval(low: xr.DataArray, high: xr.DataArray, decimals: int | None) -> str:
    """Return the ends of an interval, of an ensemble the means over members that have one; else "none"."""
    is_known = np.isfinite(low) & np.isfinite(high)
    count = int(is_known.sum())
    if not count:
        return "none"
    ends = [end.where(is_known).mean(keep_attrs=True) for end in (low, high)]
    return " to ".join(cell(end, decimals) for end in ends) + share_of(count, is_known.size)


def share_of(count: int, size: int) -> str:
    """Return how many members of an ensemble have a value, where some have none."""
    return f" ({count} of {size})" if count < size else ""


def amount(data: Any, scale: Scale | None = None) -> str:
    """Return a value with its unit and SI prefix; of an ensemble mean and standard deviation.

    `scale` is that of a column, see `column_scale`.
    """
    units = units_of(data.name, data.attrs)
    values = without_rounding(data.values, units)
    finite_values = finite(values)
    if str(data.name) in FRACTIONS:
        scale = Scale(0.01, "%")
    elif scale is None:
        scale = scale_for(units, float(finite_values.mean()) if finite_values.size else np.nan)
    unit = f" {scale.unit}".rstrip()
    return _over_members(scale(values), number, _decimals_of, unit)


def column_scale(data: Any) -> Scale | None:
    """Return one unit for a column of a table; None, each value its own, where they span three decades.

    A prefix spans so many: in the unit of the greatest value the least would have none of its digits. Lengths
    that are all zero are in millimetres.
    """
    units = units_of(data.name, data.attrs)
    sizes = np.abs(without_rounding(finite(data), units))
    sizes = sizes[sizes > 0]
    if sizes.size == 0:
        return Scale(1e-3, "mm") if units == "m" else None
    if sizes.max() >= 1e3 * sizes.min():
        return None
    return scale_for(units, float(np.median(sizes)))


def plain(data: Any, decimals: int, *, sign: bool = False) -> str:
    """Return a number with so many decimals; of an ensemble mean and standard deviation."""
    return _over_members(data.values, lambda value: fixed(value, decimals, sign=sign), lambda _: decimals)


def _over_members(
    values: Any, text: Callable[[float], str], decimals: Callable[[float], int], unit: str = ""
) -> str:
    """Return the value of all, or mean ± standard deviation with the number of members that have one.

    `text` writes a single value; `decimals` gives those of the mean and of the deviation from the deviation.
    """
    values = np.asarray(values, dtype=float)
    finite_values = finite(values)
    if finite_values.size == 0:
        return "-"
    share = share_of(finite_values.size, values.size)
    if values.ndim == 0 or are_one(finite_values):
        return text(float(finite_values[0])) + unit + share
    spread = float(np.std(finite_values, ddof=1))
    digits, sign = decimals(spread), text(float(finite_values.mean())).startswith("+")
    mean, spread = (round(value, digits) for value in (float(finite_values.mean()), spread))
    shown = max(digits, 0)  # 18 700 ± 2100 has its last digits in front of the point
    return f"{fixed(mean, shown, sign=sign)} ± {fixed(spread, shown)}{unit}{share}"


def _decimals_of(spread: float) -> int:
    """Return the decimals that show a standard deviation with two digits; -2 where they are hundreds."""
    return 1 - int(np.floor(np.log10(spread)))


def at_value(name: str, dim: str, value: Any) -> Any:
    """Return a function that takes a variable at one value of a dim; None where there is none."""

    def take(state: xr.Dataset) -> Any:
        if name not in state or dim not in state.coords or value not in state[dim].values:
            return None
        return state[name].sel({dim: value})

    return take


def finite(data: Any) -> Array:
    """Return the finite values of an array."""
    values = np.asarray(data, dtype=float)
    return np.asarray(values[np.isfinite(values)])


def are_one(values: Array) -> bool:
    """Return whether values are one but for rounding: the same load for every member, for example."""
    # a load times an area and back loses 2e-16 at each step
    return values.size > 0 and bool(np.ptp(values) <= 1e-12 * np.abs(values).max())


def length(value: Any) -> str:
    """Return a length in metres with the prefix that suits it."""
    return quantity_text(value, "m")
