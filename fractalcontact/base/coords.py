"""What of the coordinates of an input a result keeps.

A user's array may carry coordinates of any name: of the specimen, the operator, the scanner's own frame.
Those along the leading dims stay with the result, because they tell its planes apart; of the others only
names that the house knows are kept.
"""

from __future__ import annotations

from collections.abc import Collection, Hashable
from typing import TYPE_CHECKING

from fractalcontact.base.schema import QUANTITIES

if TYPE_CHECKING:
    import xarray as xr

    from fractalcontact.base.validation import Problems


def leading_coords(
    array: xr.DataArray | xr.Dataset, outer: Collection[Hashable], taken: Collection[str] = ()
) -> dict[str, xr.Variable]:
    """Return the coordinates of the dims `outer`, and the known ones that live on these alone.

    Names in `taken` are left out, because the result has values of its own under them, and so is `run_time`;
    an index of several levels is left out because no file holds it.
    """
    import xarray as xr

    levels = _levels(array)
    return {
        str(name): xr.Variable(coordinate.dims, coordinate.values, coordinate.attrs)
        for name, coordinate in array.coords.variables.items()
        if set(coordinate.dims) <= set(outer)
        and (name in outer or name in QUANTITIES)
        and not (name in outer and name in levels)
        and name not in taken
        and name != "run_time"
    }


def familiar(array: xr.DataArray) -> xr.DataArray:
    """Return an array without the coordinates that the house does not know, but for those of its dims."""
    levels = _levels(array)
    strange = [
        name for name in array.coords if name in levels or not (name in QUANTITIES or name in array.dims)
    ]
    return array.drop_vars(strange)


def check_leading(
    array: xr.DataArray, taken: Collection[str], problems: Problems, argument: str = "surface"
) -> None:
    """Refuse leading dims that bear the name of a dim or of a variable of the result."""
    both = [str(dim) for dim in getattr(array, "dims", ()) if dim in taken]
    if both:
        names = ", ".join(both)
        problems.add(f"{argument}.dims", f"leading dims not called as the results are, {names}", array.dims)


def _levels(array: xr.DataArray | xr.Dataset) -> set[Hashable]:
    """Return the names that belong to an index of several levels, that of the index included."""
    from xarray.indexes import PandasMultiIndex

    return {name for name, index in array.xindexes.items() if isinstance(index, PandasMultiIndex)}
