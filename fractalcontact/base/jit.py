"""Decorators that compile loops with Numba; no other module calls `numba.njit`.

Kernels are plain loops over arrays, compiled at the first call and cached on disk. They follow IEEE rules
(no fast-math unless the decorator sets it; a division by zero gives infinity or NaN). A sum that must not
depend on the number of threads is done by rows in the kernel, then serially over the rows.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

from fractalcontact.base.kernel_cache import protect

F = TypeVar("F", bound=Callable[..., Any])

# no kernel is called from C, so the entry point for C is not compiled
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}


def kernel(function: F) -> F:
    """Compile a serial loop; it releases the global interpreter lock while it runs."""
    return _compile(function)


def sum_kernel(function: F) -> F:
    """Compile a serial loop whose sums over a row may be vectorised, which is several times as fast.

    The compiler chooses the order of the sums; it is the same in every call, for any number of threads. The
    arrays must be finite.
    """
    return _compile(function, fastmath={"reassoc", "nsz", "nnan"})


def gap_sum_kernel(function: F) -> F:
    """Compile a `sum_kernel` whose arrays may have NaN, which propagates to every sum that includes it."""
    return _compile(function, fastmath={"reassoc", "nsz"})


def _compile(function: F, **options: Any) -> F:
    compiled: F
    try:
        compiled = numba.njit(cache=True, **_OPTIONS, **options)(function)
    except RuntimeError:  # no cache folder can be written: the kernel is compiled in every process
        return cast("F", numba.njit(**_OPTIONS, **options)(function))
    protect(compiled)
    return compiled
