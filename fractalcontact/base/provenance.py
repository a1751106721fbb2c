"""Provenance of a result: the call, its parameters, versions, threads and time, as attributes.

An array among the parameters is stated by its name, its sizes, a checksum and its own provenance, so that the
call can be made again from the provenance alone (`fractalcontact.scenes.reproduce`). No path of a folder is
written. Identical runs differ only in these attributes and in `run_time`.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path, PurePath
from typing import Any, TypeVar

import numpy as np
import xarray as xr

from fractalcontact.base import fft
from fractalcontact.base import rng as streams
from fractalcontact.base.resources import thread_count
from fractalcontact.base.schema import CONVENTIONS
from fractalcontact.base.study import MEMBER, NO_REFERENCES, entries_in

LOADS = ("closure", "normal_force", "nominal_pressure")
SHARED = "pressed"  # the argument of which every part takes what it needs: the whole is that of any part
# the arguments of a call that grow where results are joined along a dim
_ALONG: Mapping[str, tuple[str, ...]] = {
    "shear": ("shear",),
    "direction": ("direction",),
    "step": LOADS,
    "nominal_pressure": ("nominal_pressure",),
}

T = TypeVar("T", xr.Dataset, xr.DataArray)


def stamp(
    data: T,
    call: str,
    parameters: dict[str, Any],
    *,
    title: str,
    references: str = NO_REFERENCES,
    **entries: Any,
) -> T:
    """Set the global attributes of a result, in place, and return it.

    Parameters
    ----------
    data : Dataset or DataArray
    call : str
        Public name of the function, for example "fractalcontact.contact.press".
    parameters : dict
        Its arguments; labelled arrays are stated by name, sizes, checksum and their own provenance.
    title : str
        What the data are, in a few words.
    references : str
        The sources of the method.
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
        if getattr(value, "name", None) is not None:
            summary = {"name": str(value.name)} | summary
        if isinstance(getattr(value, "variable", None), xr.Variable) and isinstance(value.data, np.ndarray):
            summary["sha256"] = checksum(value.data)
        if "provenance" in value.attrs:
            summary["provenance"] = _read(value.attrs["provenance"])
        return summary
    if isinstance(value, np.ndarray):
        if value.ndim > 1 and value.size > 64:  # no small table, but a map
            return {"shape": list(value.shape), "dtype": str(value.dtype)}
        return plain(value.tolist())
    if isinstance(value, np.generic):
        return plain(value.item())
    if isinstance(value, np.random.Generator):
        return "Generator"
    if isinstance(value, np.random.SeedSequence):
        return streams.record(np.random.default_rng(value))
    if isinstance(value, PurePath):
        return value.name
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if callable(getattr(value, "summary", None)):  # an object that describes itself, as a `joints.Crack`
        return plain(value.summary())
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return value if isinstance(value, (str, int, float, bool)) or value is None else str(value)


def content(summary: Any) -> Any:
    """Return the summary of an argument without its provenance, which states run times."""
    if not isinstance(summary, dict):
        return summary
    return {name: content(value) for name, value in summary.items() if name != "provenance"}


def differing(entry: Mapping[str, Any], arguments: Mapping[str, Any]) -> list[str]:
    """Return the names of the arguments that a provenance states otherwise."""
    stated = entry.get("parameters", {})
    return [name for name in arguments if content(stated.get(name)) != content(plain(arguments[name]))]


def checksum(values: np.ndarray[Any, Any]) -> str:
    """Return the SHA-256 of `values.tobytes()`, without a copy of the whole."""
    digest = hashlib.sha256()
    rows = [values] if values.ndim < 2 or values.flags.c_contiguous else values
    for row in rows:
        digest.update(np.ascontiguousarray(row).view(np.uint8) if row.size else b"")
    return digest.hexdigest()


def file_checksum(path: Path) -> str:
    """Return the SHA-256 of the content of a file."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def with_load_indexes(result: T) -> T:
    """Return a result in which a load can be selected, ``closure.sel(normal_force=300)``.

    That is a coordinate along `step` that the call prescribed. Files hold no such index.
    """
    entry = _read(result.attrs.get("provenance", "{}"))
    parameters = entry.get("parameters", {}) if isinstance(entry, dict) else {}
    for name, coordinate in result.coords.variables.items():
        is_load = coordinate.dims == ("step",) and name != "step" and parameters.get(name) is not None
        if is_load and name not in result.xindexes:
            result = result.set_xindex(str(name))
    return result


def with_provenance(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """Return a variable of a result with the provenance of the result, as an input of the next call."""
    array = dataset[name]
    entry = dataset.attrs.get("provenance")
    return array if entry is None else array.assign_attrs(provenance=entry)


def joined(entries: Sequence[Mapping[str, Any]], dim: str) -> dict[str, Any]:
    """Return the provenance of results that are joined along a dim.

    The arguments along the dim are those of all calls, run times are added, and the residual is the worst. A
    path of load that was cut has its `sections`: each began without the solution of the step before, which
    can change the last bit. What else differs is ``{dim: [...]}``, a list with one entry for each result.
    """
    total = sum(float(entry.get("run_time", 0.0)) for entry in entries)
    result: dict[str, Any] = _joined(entries, dim, "")
    return result | ({"run_time": total} if "run_time" in result else {})


def _joined(values: Sequence[Any], dim: str, key: str) -> Any:
    first = values[0]
    if key == SHARED and all(value == first for value in values):
        return first
    if key in _ALONG.get(dim, ()) and all(isinstance(value, list) for value in values):
        return [item for value in values for item in value]
    if key == "dims" and dim in first:
        return first | {dim: sum(value[dim] for value in values)}
    if all(isinstance(value, Mapping) for value in values):
        names = dict.fromkeys(name for value in values for name in value)
        merged = {name: _joined([value.get(name) for value in values], dim, name) for name in names}
        loads = [value["parameters"][load] for value in values if "call" in value for load in load_of(value)]
        return merged | ({"sections": [len(load) for load in loads]} if dim == "step" and loads else {})
    if all(value == first for value in values):
        return first
    if key == "run_time":
        return sum(values)
    if key == "achieved_residual":
        return float(np.fmax.reduce(np.array(values, dtype=np.float64)))
    if key == "achieved_error":
        return "; ".join(dict.fromkeys(str(value) for value in values))
    return {dim: list(values)}


def load_of(entry: Mapping[str, Any]) -> list[str]:
    """Return the name of the path of load among the parameters of a call, in a list; empty without one."""
    parameters = entry.get("parameters", {})
    return [load for load in LOADS if isinstance(parameters.get(load), list)]


def member_entry(entry: Any, member: int) -> Any:
    """Return the provenance of one member of an ensemble."""
    if isinstance(entry, list):
        return [member_entry(item, member) for item in entry]
    if not isinstance(entry, dict):
        return entry
    if set(entry) == {MEMBER} and isinstance(entry[MEMBER], list):
        return entry[MEMBER][member]
    return {key: member_entry(value, member) for key, value in entry.items()}


def member_count(entry: Any, dim: str = MEMBER) -> int | None:
    """Return the number of members, or scans, that a provenance describes; None for a single result."""
    of_members = (each[dim] for each in entries_in(entry) if set(each) == {dim})
    return next((len(values) for values in of_members if isinstance(values, list)), None)


def _read(provenance: Any) -> Any:
    """Return the provenance of an input as an object; text of another origin is kept as text."""
    try:
        return json.loads(provenance)
    except (TypeError, ValueError):
        return plain(provenance)


def _version() -> str:
    import fractalcontact

    return fractalcontact.__version__
