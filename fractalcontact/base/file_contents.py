"""The contents of a result file: its headers, and as text groups, variables, achieved errors and run times.

Nothing here needs xarray, so that the command starts fast.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fractalcontact.base.errors import UnreadableFile
from fractalcontact.base.files import DAMAGED, NETCDF_LOCK, require_checksum
from fractalcontact.base.study import provenance_of
from fractalcontact.base.tables import note, table
from fractalcontact.base.validation import Problems, reading

SHARED = "parts that ran at the same time are each counted in full, so that all stages exceed the total"
REMARKS = ("note", "reason")  # string variables over `method`


@dataclass(frozen=True)
class Header:
    """Header of a group: its attributes, sizes and attributes of each variable, and some values."""

    attrs: dict[str, Any]
    variables: dict[str, tuple[dict[str, int], dict[str, Any]]]
    values: dict[str, Any]


def read_headers(path: str | os.PathLike[str], read: Callable[[str], bool]) -> dict[str, Header]:
    """Return the header of every group of a file, with the values of the variables selected by `read`.

    Raises
    ------
    UnreadableFile
        The file does not exist, is truncated or damaged, or is not NetCDF.
    """
    import netCDF4  # loads slowly

    where = "fractalcontact.open"
    with Problems(where, UnreadableFile) as problems:
        problems.file("path", path)
    source = Path(path)
    with reading(where, source):
        require_checksum(where, source)
    try:
        with NETCDF_LOCK, netCDF4.Dataset(source) as file:
            return {group.path: _header(group, read) for group in groups_in(file)}
    except (OSError, RuntimeError, ValueError) as error:  # the last for names that are not UTF-8
        raise UnreadableFile(where, [f"path: {source.name!r} {DAMAGED}"]) from error


def groups_in(group: Any) -> Iterator[Any]:
    """Yield a group of a NetCDF file and all groups in it."""
    yield group
    for child in group.groups.values():
        yield from groups_in(child)


def _header(group: Any, read: Callable[[str], bool]) -> Header:
    variables = {str(name): variable for name, variable in group.variables.items()}
    return Header(
        dict(group.__dict__),
        {name: (_sizes(variable), dict(variable.__dict__)) for name, variable in variables.items()},
        {
            name: variable[...]
            for name, variable in variables.items()
            if getattr(variable.dtype, "kind", "O") in "biufOS" and read(name)
        },
    )


def _sizes(variable: Any) -> dict[str, int]:
    """Return dims and lengths, without the dim of the characters of a string."""
    sizes = dict(zip(variable.dimensions, map(int, variable.shape), strict=True))
    return {
        dim: size for dim, size in sizes.items() if not (variable.dtype == "S1" and dim.startswith("string"))
    }


def file_contents(path: str | os.PathLike[str]) -> str:
    """Return the contents of a result file: groups and variables, then the stages with errors and run times.

    Raises
    ------
    UnreadableFile
        There is no such file, or it is not complete.
    """
    groups = read_headers(path, _is_achieved)
    root = groups["/"]
    keys = ("title", "source", "completeness")
    lines = [str(root.attrs[key]) for key in keys if key in root.attrs]
    for place, group in groups.items():
        if group.variables:
            lines += ["", place, *_variable_lines(group), *_reason_lines(group), *_achieved_lines(group)]
    for place, group in groups.items():
        if place == "/" or not root.attrs.get("provenance"):
            rows = stage_rows(group)
            lines += ["", table(rows) if len(rows) > 1 else ", ".join(rows[0])] if rows else []
    return "\n".join(lines)


def stage_rows(result: Any) -> list[tuple[str, ...]]:
    """Return the stages of a study as rows below a head: run time, achieved accuracy, and an earlier origin.

    `result` has the attributes of the root of a study, or of a single result, whose call is the only row.
    """
    entry = provenance_of(result)
    stages = entry.get("stages", {})
    if not stages or not _are_stages(stages):
        call = _single_call(entry)
        return [(call,)] if call else []
    rows: list[tuple[str, ...]] = [("stage", "run time (s)", "achieved")]
    for name, facts in stages.items():
        achieved = {key: value for key, value in facts.items() if key not in ("run_time", "origin")}
        origin = "" if facts.get("origin") == "computed" else f" ({facts.get('origin')})"
        rows.append((name, f"{facts['run_time']:.2f}", ", ".join(_phrases(achieved)) + origin))
    together = sum(facts["run_time"] for facts in stages.values())
    total = entry.get("run_time", together)
    if "run_time" in entry:  # workers share the stages, and take time to start
        rows.append(("all stages", f"{together:.2f}", SHARED if together > total else ""))
    rows.append(("total", f"{total:.2f}", ""))
    return rows


def remarks(methods: Sequence[str], texts: Any) -> list[tuple[str, str]]:
    """Return each of the texts (..., methods) once behind the methods that have it, without empty ones."""
    methods_of: dict[str, dict[str, None]] = {}
    for row in np.reshape(np.asarray(texts, dtype=str), (-1, len(methods))):
        for method, text in zip(methods, row, strict=True):
            methods_of.setdefault(text, {})[method] = None
    return [(", ".join(names), text) for text, names in methods_of.items() if text]


def _are_stages(stages: Any) -> bool:
    """Return whether an entry has the form of the stages of a study; other packages use the same name."""
    return isinstance(stages, dict) and all(
        isinstance(facts, dict) and isinstance(facts.get("run_time"), (int, float))
        for facts in stages.values()
    )


_NOT_ACHIEVED = ("parameters", "version", "fft", "threads", "random", "file_sha256", "merged", "stages")


def _single_call(entry: dict[str, Any]) -> str:
    """Return the call of a single result with its run time and its achieved errors."""
    facts = {key: value for key, value in entry.items() if key not in _NOT_ACHIEVED and value is not None}
    earlier = facts.pop("before", None)  # the calls that made the input, the last one first
    while isinstance(earlier, dict):
        facts["after"] = f"{facts.get('after', '')} {earlier.get('call', '')}".strip()
        earlier = earlier.get("before")
    return ", ".join(f"{key.replace('_', ' ')} {_short(value)}" for key, value in facts.items())


def _short(value: Any) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def _phrases(facts: dict[str, Any]) -> Iterable[str]:
    for key, value in facts.items():
        word = key.replace("_", " ")
        if isinstance(value, list):
            yield f"{word} " + " ".join("-" if v is None or v != v else f"{v:.4f}" for v in value)
        elif isinstance(value, bool):
            yield word if value else f"not {word}"
        elif key == "error":
            yield str(value)
        else:
            yield f"{word} {value:.2g}" if isinstance(value, float) else f"{word} {value}"


def _variable_lines(group: Header) -> Iterable[str]:
    """Yield name, dims, long name and units of every variable, in columns."""
    rows: list[tuple[str, ...]] = [("variable", "dims", "meaning")]
    for name, (sizes, attributes) in group.variables.items():
        dims = ", ".join(f"{dim} {size}" for dim, size in sizes.items())
        units = attributes.get("units", "")
        unit = "" if units in ("", "1") else f" [{units}]"
        rows.append((name, f"({dims})" if dims else "", f"{attributes.get('long_name', '')}{unit}"))
    yield table(rows)


def _is_achieved(name: str) -> bool:
    ends = ("_error", "_low", "_high", "misfit")
    return name in ("run_time", "residual", "converged", "method", *REMARKS) or name.endswith(ends)


def _achieved_lines(group: Header) -> Iterable[str]:
    """Yield the achieved errors of a group and its run time, each from the smallest to the largest."""
    for name, numbers in group.values.items():
        if np.asarray(numbers).dtype.kind not in "biuf":
            continue
        values: np.ndarray[Any, Any] = np.ravel(np.ma.filled(np.ma.asarray(numbers, dtype=float), np.nan))
        finite = values[np.isfinite(values)]
        word = name.replace("_", " ")
        if name == "converged":
            yield f"    converged: {int(finite.sum())} of {values.size}"
        elif finite.size == 0:
            yield f"    {word}: not available"
        elif name == "run_time":
            yield f"    {word}: {finite.sum():.3g} s"
        else:
            ends = dict.fromkeys(f"{value:.3g}" for value in (finite.min(), finite.max()))
            units = group.variables[name][1].get("units", "")
            unit = "" if units in ("", "1") else f" {units}"
            yield f"    {word}: {' ... '.join(ends)}{unit}"


def _reason_lines(group: Header) -> Iterable[str]:
    """Yield the remarks on single methods."""
    order = [str(name) for name in group.values.get("method", ())]
    for key in REMARKS if order else ():
        for concerned, remark in remarks(order, group.values.get(key, [])):
            yield note(f"{concerned}: {remark}", indent=4)
