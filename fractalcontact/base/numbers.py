"""Numbers among the arguments of a user: what counts as one, and arrays of them."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]
# lengths that differ by less are one length, so that a window given as a decimal loses no point
ROUNDED = 1.0 + 1e-9


def is_real(value: Any) -> bool:
    """Return whether a value is one real number; a truth value or a time difference is none."""
    real = isinstance(value, (int, float, np.integer, np.floating))
    return real and not isinstance(value, (bool, np.timedelta64))


def as_array(value: Any) -> Array | None:
    """Return an array of the value's own type; None where NumPy makes none of it."""
    if type(value).__module__.startswith("xarray") and not hasattr(value, "dtype"):  # a Dataset or DataTree
        return None
    try:
        return np.asarray(value)
    except Exception:  # rows of unequal length, or whatever the conversion of a foreign object raises
        return None


def number_of_axes(value: Any) -> int | None:
    """Return the number of axes, 0 for a scalar; None for a ragged sequence, or for no array at all."""
    values = as_array(value)
    return None if values is None else values.ndim


def number_of_entries(value: Any) -> int | None:
    """Return the number of entries of a sequence or array; None where it has no length."""
    try:
        return len(value)
    except Exception:
        return None


def real_numbers(value: Any) -> Array | None:
    """Return real numbers as an array of at least one axis, None for anything else.

    Words, dates, time differences, truth values and masked entries are none, though NumPy converts them.
    """
    values = as_array(value)
    if values is None or np.ma.is_masked(value):
        return None
    if values.dtype.kind == "O" and all(type(item) in (int, float) for item in values.flat):
        with suppress(OverflowError):  # integers beyond 64 bits
            return np.atleast_1d(values.astype(np.float64))
    return float_array(values) if values.dtype.kind in "iuf" else None


def python_number(value: Any) -> Any:
    """Return one number of NumPy or xarray as one of Python, whose arithmetic does not overflow."""
    has_no_axes = getattr(value, "ndim", None) == 0 and getattr(value, "dtype", np.dtype("O")).kind in "iuf"
    return value.item() if has_no_axes and not np.ma.is_masked(value) else value


def is_within(values: Any, low: Any, high: Any) -> Any:
    """Return which values lie between two positive ends, but for rounding."""
    return (values >= low / ROUNDED) & (values <= high * ROUNDED)


def nearest_whole(values: Any) -> Array:
    """Return the nearest whole numbers, of halves the even ones; a rounding error decides no half."""
    return np.asarray(np.rint(np.round(values, 9)), dtype=np.int64)


def spread_indices(count: int, most: int) -> list[int]:
    """Return at most `most` of the indices 0 ... count - 1, evenly spread and including both ends."""
    return sorted({round(float(i)) for i in np.linspace(0, count - 1, min(count, most))})


def turning_points(path: Array) -> Array:
    """Return the indices of a path at which it begins, turns back, and ends; a pause is no turn.

    Examples
    --------
    >>> turning_points(np.array([0.0, 1.0, 1.0, 3.0, 2.0])).tolist()
    [0, 3, 4]
    """
    ways = np.sign(np.diff(path))
    moves = np.flatnonzero(ways)
    turns = moves[1:][ways[moves[1:]] != ways[moves[:-1]]]
    return np.array([0, *turns.tolist(), path.size - 1])


def power_of_two(value: float) -> float:
    """Return the power of two next above a value, by which a division loses no digit; 1 for zero."""
    return math.ldexp(1.0, math.frexp(value)[1]) if value > 0 else 1.0


def float_array(value: Any) -> Array:
    """Return one or several numbers that passed `Problems.numbers` as a 1-D float64 array."""
    return np.atleast_1d(np.asarray(value, dtype=np.float64))
