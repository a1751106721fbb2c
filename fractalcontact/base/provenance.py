"""Provenance of a result: the call, its parameters, versions, threads and time, as attributes.

No path of a home folder is written. Identical runs differ only in these attributes and in `run_time`.
"""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import PurePath
from typing import Any, TypeVar

import numpy as np
import xarray as xr

from fractalcontact.base import fft
from fractalcontact.base.schema import CONVENTIONS
from fractalcontact.base.threads import thread_count

PAPER = (
    "Borri-Brunetto, Carpinteri and Chiaia, Contact, closure and friction behaviour of rough crack concrete "
    "surfaces, FRAMCOS-3 (1998)"
)

T = TypeVar("T", xr.Dataset, xr.DataArray)


def stamp(
    data: T,
    call: str,
    parameters: dict[str, Any],
    *,
    title: str,
    references: str = PAPER,
    **entries: Any,
) -> T:
    """Set the global attributes of a result, in place, and return it.

    Parameters
    ----------
    data : Dataset or DataArray
    call : str
        Public name of the function, for example "fractalcontact.contact.press".
    parameters : dict
        Its arguments; arrays are summarised by shape and by their own provenance.
    title : str
        What the data are, in a few words.
    references : str
        The source of the method.
    **entries
        Further entries of the provenance: random stream, run time, achieved error ...
    """
    version = _version()
    entry = {
        "call": call,
        "parameters": {key: plain(value) for key, value in parameters.items() if value is not None},
        "version": version,
        "fft": fft.library(),
        "threads": thread_count(),
        **{key: plain(value) for key, value in entries.items()},
    }
    now = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    data.attrs.update(
        {
            "Conventions": CONVENTIONS,
            "title": title,
            "institution": "not stated",
            "source": f"fractalcontact {version}",
            "history": f"{now} {call}",
            "references": references,
            "comment": "x and y are positions in the plane of the surface, in metres, at cell centres",
            "provenance": json.dumps(entry),
        }
    )
    return data


def plain(value: Any) -> Any:
    """Return a summary of `value` in plain JSON types."""
    if hasattr(value, "dims") and hasattr(value, "attrs"):
        summary: dict[str, Any] = {"dims": {str(k): int(v) for k, v in value.sizes.items()}}
        if "provenance" in value.attrs:
            summary["provenance"] = _read(value.attrs["provenance"])
        return summary
    if isinstance(value, np.ndarray):
        return value.tolist() if value.size <= 64 else {"shape": list(value.shape), "dtype": str(value.dtype)}
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.random.Generator):
        return "Generator"
    if isinstance(value, PurePath):
        return value.name
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if callable(getattr(value, "summary", None)):  # an object that describes itself, as a `joints.Crack`
        return plain(value.summary())
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value if isinstance(value, (str, int, float, bool)) or value is None else str(value)


def _read(provenance: Any) -> Any:
    """Return the provenance of an input as an object; text of another origin is kept as text."""
    try:
        return json.loads(provenance)
    except (TypeError, ValueError):
        return plain(provenance)


def _version() -> str:
    import fractalcontact

    return fractalcontact.__version__
