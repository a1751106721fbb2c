"""Decorators that compile loops with Numba; no other module calls `numba.njit`.

Kernels are plain loops over arrays, compiled at the first call and cached on disk. They follow IEEE rules
(no fast-math unless the decorator sets it; a division by zero gives infinity or NaN). A sum that must not
depend on the number of threads is done by rows in the kernel, then serially over the rows. Arrays of zeros
are made outside of kernels: `numpy.zeros` and `numpy.full` in a kernel take .3 s to compile.

Files of compiled kernels cannot end a run: damaged ones are replaced, unwritable ones are left out. Numba has
no option for this, and a wrapper around a kernel would keep kernels from calling each other, so the private
cache of a kernel is changed here. Where a version of Numba has no such cache, nothing is changed.
"""

from __future__ import annotations

import hashlib
import pickle
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba.core import caching

F = TypeVar("F", bound=Callable[..., Any])

# no kernel is called from C, so the entry point for C is not compiled
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}

_DIGEST = hashlib.sha256().digest_size  # bytes


def kernel(function: F) -> F:
    """Compile a serial loop; it releases the global interpreter lock while it runs."""
    return _compile(function)


def inner_kernel(function: F) -> F:
    """Compile a serial loop that other kernels call, and Python does not: it compiles faster."""
    return _compile(function, no_cpython_wrapper=True)


def sum_kernel(function: F) -> F:
    """Compile a serial loop whose sums over a row may be vectorised, which is several times as fast.

    The compiler chooses the order of the sums; it is the same in every call, for any number of threads, where
    they are summed in local variables (in an array it depends on the places of the arrays). The arrays must
    be finite.
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
    _protect(compiled)
    return compiled


def _protect(compiled: Any) -> None:
    """Let a kernel run whatever state its files are in.

    Numba reads the files in the first call and lets every error end it, in every later run too; a damaged
    file may even end the process, if it still looks like machine code. It writes them in the same call and
    lets an OSError (disk full, quota) end it, hours into a run, although the kernel is ready in memory.
    """
    cache = getattr(compiled, "_cache", None)
    if cache is None or not isinstance(getattr(cache, "_cache_file", None), caching.IndexDataCacheFile):
        return
    load, save = cache.load_overload, cache.save_overload
    cache._cache_file.__class__ = _CheckedFiles

    def load_if_intact(*arguments: Any) -> Any:
        try:
            return load(*arguments)
        except Exception:  # whatever a damaged file raises; the kernel is compiled and saved anew
            with suppress(OSError):
                cache.flush()
            return None

    def save_if_possible(*arguments: Any) -> None:
        with suppress(OSError):
            save(*arguments)

    cache.load_overload, cache.save_overload = load_if_intact, save_if_possible


class _CheckedFiles(caching.IndexDataCacheFile):  # type: ignore[misc]
    """Index and code of a kernel, each with a checksum; nothing is unpickled without it.

    Code states its key, too: two processes that compile the same kernel for different types at a time may
    choose the same file.
    """

    def save(self, key: Any, data: Any) -> None:
        super().save(key, (key, data))

    def load(self, key: Any) -> Any:
        stored_key, data = super().load(key) or (None, None)
        return data if stored_key == key else None

    def _dump(self, content: Any) -> bytes:
        data: bytes = super()._dump(content)
        return data + hashlib.sha256(data).digest()

    def _load_data(self, name: str) -> Any:
        return _verified(Path(self._data_path(name)).read_bytes())

    def _load_index(self) -> dict[Any, str]:
        try:
            content = Path(self._index_path).read_bytes()
        except FileNotFoundError:
            return {}
        version = pickle.dumps(self._version, protocol=-1)
        if not content.startswith(version):  # another version of Numba, or damaged
            return {}
        stamp, names = _verified(content[len(version) :])
        return names if stamp == self._source_stamp else {}


def _verified(content: bytes) -> Any:
    """Return the object in some bytes; raise ValueError if they are not what was written."""
    data, digest = content[:-_DIGEST], content[-_DIGEST:]
    if hashlib.sha256(data).digest() != digest:
        raise ValueError("the checksum of a compiled kernel differs")
    return pickle.loads(data)
