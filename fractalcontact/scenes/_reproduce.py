"""A stored result made again from its own provenance."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base import provenance
from fractalcontact.base.errors import FractalContactWarning, InvalidInput, warn
from fractalcontact.base.files import datasets_folder
from fractalcontact.base.study import provenance_of
from fractalcontact.base.validation import Problems, Words
from fractalcontact.scenes._parts import call, concatenate
from fractalcontact.scenes._result_tables import SCAN
from fractalcontact.scenes._stage_type import public_function

WHERE = "fractalcontact.scenes.reproduce"
PACKAGE = "fractalcontact"
SUBPACKAGES = ("surfaces", "dimensions", "contact", "domains", "joints")
CRACK = ("young", "poisson", "block", "basic_friction_angle")


def reproduce(
    result: xr.Dataset | xr.DataArray | xr.DataTree,
    *,
    folder: str | os.PathLike[str] = ".",
    member: int | None = None,
) -> xr.Dataset:
    """Make a stored result again from its own provenance.

    The provenance states the call of a public function with all its parameters, and the calls that gave its
    inputs. On the same versions of the libraries the values are equal to the last bit, but for `run_time`.

    Parameters
    ----------
    result : Dataset, DataArray, or group of a DataTree
        From a public function, or a group of a study; only its attribute `provenance` is read.
    folder : path-like
        Where the files that it was made from are now: the provenance has their names, and no folders.
    member : int, optional
        The member of an ensemble to make, from 0.

    Returns
    -------
    Dataset

    Raises
    ------
    InvalidInput
        There is no provenance of this package, an input was not made by it, or a file is missing or not the
        one that was read. Inputs that come out otherwise than stated give a FractalContactWarning.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> result = fc.scenes.run("rigid_sliding", progress=False)["joints/rigid_dilatancy"]
    >>> again = fc.scenes.reproduce(result)
    >>> bool((again["rigid_dilatancy"] == result["rigid_dilatancy"]).all())
    True
    """
    with Problems(WHERE) as problems:
        is_path = problems.path("folder", folder)
        expected = "a result with the attribute `provenance` of this package"
        problems.integer("member", member, at_least=0, optional=True)
        attributes = getattr(result, "attrs", None)
        is_result = isinstance(attributes, Mapping) and bool(provenance_of(result))
        if problems.require(is_result, "result", expected, type(result).__name__) and is_path:
            entry = provenance_of(result)
            count = provenance.member_count(entry)
            problems.integer("member", member, at_least=0, at_most=(count or 1) - 1, optional=count is None)
            scans, expected = provenance.member_count(entry, SCAN), "that of one scan, from its own result"
            problems.require(scans is None, "result", expected, Words(f"that of {scans} scans"))
    source = _Source(Path(folder))
    if count is not None and member is not None:
        entry = provenance.member_entry(entry, member)
    made = source.make(entry)
    for other in entry.get("merged", ()):  # a group that holds the results of several calls
        made = made.assign(source.make(other).data_vars)
    return made


@dataclass(frozen=True)
class _Source:
    """Makes results from their provenance, with files from one folder."""

    folder: Path

    def make(self, entry: Mapping[str, Any]) -> xr.Dataset:
        """Return the result of the call that a provenance states."""
        function = _function(entry.get("call"))
        arguments = {key: self._argument(key, value) for key, value in entry["parameters"].items()}
        if "random" in entry:
            arguments["rng"] = entry["random"]
        if "file_sha256" in entry:
            arguments["path"] = self._file(str(arguments["path"]), entry["file_sha256"])
        if "sections" not in entry:
            return call(function, **arguments)
        load = provenance.load_of(entry)[0]
        ends = np.cumsum(entry["sections"])[:-1].tolist()
        path = arguments.pop(load)
        sections = [path[start:end] for start, end in zip([0, *ends], [*ends, None], strict=True)]
        parts = [call(function, **{**arguments, load: section}) for section in sections]
        return concatenate(parts, "step")

    def _argument(self, name: str, value: Any) -> Any:
        """Return an argument from its summary in the provenance."""
        if not isinstance(value, Mapping):
            return value
        if "lower" in value and "young" in value:
            return self._crack(value)
        if "dims" in value:
            return self._input(name, value)
        if "shape" in value:
            expected = "an input that is stated in full, or made by this package"
            raise InvalidInput.of(WHERE, name, expected, f"an array of shape {value['shape']}")
        return value

    def _crack(self, summary: Mapping[str, Any]) -> Any:
        from fractalcontact.joints import Crack

        upper = None if summary["upper"] == "mated" else self._input("upper", summary["upper"])
        return Crack(self._input("lower", summary["lower"]), upper, **{key: summary[key] for key in CRACK})

    def _input(self, name: str, summary: Mapping[str, Any]) -> Any:
        """Return a labelled input, a Dataset or a DataArray, made by the call in its own provenance."""
        entry = summary.get("provenance")
        if not isinstance(entry, Mapping):
            expected = "an input with the provenance of this package"
            raise InvalidInput.of(WHERE, name, expected, f"one of sizes {summary['dims']}")
        made = self.make(entry)
        if "name" not in summary:
            return made
        if summary["name"] not in made:  # a single array that has been renamed since
            made = made.rename({next(iter(made.data_vars)): summary["name"]})
        array = provenance.with_provenance(made, summary["name"])
        stated = summary.get("sha256")
        if isinstance(stated, str) and stated != provenance.checksum(np.asarray(array.values)):
            message = (
                f"{WHERE}: {name} differs from the array of the provenance (other versions of libraries?)"
            )
            warn(message, FractalContactWarning)
        return array

    def _file(self, name: str, stated: str) -> Path:
        """Return a file that was read, from the folder or from the shipped data, if it is the same."""
        places = [path for path in (self.folder / name, datasets_folder() / name) if path.is_file()]
        for path in places:
            if provenance.file_checksum(path) == stated:
                return path
        got = "one of another content (SHA-256)" if places else "no such file"
        raise InvalidInput.of(WHERE, "folder", f"the file {name!r} that was read", got)


def _function(stated: Any) -> str:
    """Return the name of the public function that a provenance states; text of a file calls nothing else."""
    package, _, name = str(stated).partition(".")
    is_known = package == PACKAGE and name.partition(".")[0] in SUBPACKAGES and name.count(".") == 1
    if not is_known or not hasattr(public_function(name), "validate"):
        raise InvalidInput.of(WHERE, "call", "a public function that returns a result", repr(stated))
    return name
