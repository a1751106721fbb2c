"""The only place that decorates with Numba, and so the only place that decides how.

Kernels are plain loops over arrays. They are compiled on first call, kept on disk, and follow IEEE rules
(no fast-math: NaN and the order of sums mean what they say; a division by zero gives infinity or NaN,
with the compiler as without it). Sums that must not depend on the number of threads are done per row by
the kernel and added up serially, by the kernel or by its caller.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any, TypeVar, cast

import numba

from fractalcontact.base.threads import thread_count

F = TypeVar("F", bound=Callable[..., Any])

prange = numba.prange

# no kernel is called from C, so none gets the entry that C would need
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}


def _compiled(function: F, **more: Any) -> F:
    compiled: F
    try:
        compiled = numba.njit(cache=True, **_OPTIONS, **more)(function)
    except RuntimeError:  # neither the package's folder nor the user's can be written: compiled in every run
        return cast("F", numba.njit(**_OPTIONS, **more)(function))
    cache = getattr(compiled, "_cache", None)  # none where the compiler is switched off
    if cache is not None:
        cache.save_overload = _if_it_can(cache.save_overload)
    return compiled


def _if_it_can(save: Callable[..., None]) -> Callable[..., None]:
    """Return what keeps a compiled kernel; a full disk takes the next run the time of compiling, no more."""

    def kept(*compiled: Any) -> None:
        with suppress(OSError):
            save(*compiled)

    return kept


def kernel(function: F) -> F:
    """Compile a serial loop; it holds no Python lock while it runs."""
    return _compiled(function)


def sum_kernel(function: F) -> F:
    """Compile a serial loop whose sums over a row may be done in lanes: several times as fast.

    The order of the sums is then the compiler's, the same for every call and any number of threads. The
    arrays must be finite.
    """
    return _compiled(function, fastmath={"reassoc", "nsz", "nnan"})


def gap_sum_kernel(function: F) -> F:
    """Compile a `sum_kernel` whose arrays may hold NaN, which then reaches every sum that meets it."""
    return _compiled(function, fastmath={"reassoc", "nsz"})


def parallel_kernel(function: F) -> F:
    """Compile a loop whose `prange` runs on the threads of `base.threads`.

    The same source runs serially when one thread is asked for, and in plain Python when the compiler is
    switched off; the iterations of its `prange` must not share a sum.
    """
    return _compiled(function, parallel=True)


def use_threads() -> int:
    """Give Numba's parallel loops the number of threads of `base.threads`; return it."""
    threads = max(1, min(thread_count(), int(numba.config.NUMBA_NUM_THREADS)))
    numba.set_num_threads(threads)
    return threads
