"""Results to NetCDF-4 and back.

A file is written under a temporary name in its own folder and renamed when it is complete, so that a run
killed at any moment leaves no half file under the final name; the next save in the folder removes what a
killed one left.
"""

from __future__ import annotations

import contextlib
import os
import platform
import shutil
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fractalcontact.base.errors import InvalidInput, UnreadableFile
from fractalcontact.base.schema import CONVENTIONS, encoded

if TYPE_CHECKING:
    import xarray as xr

PARTIAL = ".partial"
LEAST_ROOM = 1 << 16  # bytes: a disk with less is full
_KIND = "fractalcontact_kind"
_GLOBAL = ("Conventions", "title", "institution", "source", "history", "references", "comment", "provenance")


def save(result: xr.DataArray | xr.Dataset | xr.DataTree, path: str | os.PathLike[str]) -> Path:
    """Write a result as NetCDF-4 and return the path.

    Parameters
    ----------
    result : DataArray, Dataset or DataTree
        As given by any public function. A DataTree becomes a file with groups.
    path : path-like
        Ends in `.nc`; its folder is made if need be; an existing file is replaced only when the new one
        is complete.

    Raises
    ------
    InvalidInput
        `result` is not labelled data or holds what no NetCDF file can (an attribute that is a dict, for
        one), the name does not end in `.nc`, or the folder cannot be written.
    """
    import xarray as xr

    target = Path(path)
    where = "fractalcontact.save"
    if target.suffix != ".nc":
        raise InvalidInput(where, [f"path: expected a name that ends in '.nc', got {target.name!r}"])
    if not isinstance(result, (xr.DataArray, xr.Dataset, xr.DataTree)):
        expected = "a DataArray, Dataset or DataTree"
        raise InvalidInput(where, [f"result: expected {expected}, got {type(result).__name__}"])
    temporary = unfinished(target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        clear_partial(target.parent)
        _as_file(result).to_netcdf(temporary, engine="netcdf4", format="NETCDF4")
        temporary.replace(target)
    except (TypeError, ValueError) as error:
        expected = "names, values and attributes that a NetCDF file can hold"
        raise InvalidInput(where, [f"result: expected {expected}, got: {error}"]) from error
    except (OSError, RuntimeError) as error:  # the library tells a full disk as a RuntimeError
        reason = _why_not(target.parent, error)
        raise InvalidInput(where, [f"path: {target.name!r} cannot be written here: {reason}"]) from error
    finally:
        temporary.unlink(missing_ok=True) if target.parent.is_dir() else None
    return target


def open(path: str | os.PathLike[str]) -> Any:
    """Read a NetCDF file that `save` wrote, whole, and close it.

    Returns
    -------
    DataArray, Dataset or DataTree
        What was saved; for a file of another origin a DataTree if it has groups, else a Dataset.

    Raises
    ------
    UnreadableFile
        The file does not exist, is truncated, or is not NetCDF.
    """
    import xarray as xr

    source = Path(path)
    where = "fractalcontact.open"
    if not source.is_file():
        raise UnreadableFile(where, [f"path: expected an existing file, got {source.name!r}"])
    try:
        with xr.open_datatree(source, engine="netcdf4") as tree:
            tree.load()
    except Exception as error:
        raise UnreadableFile(where, [f"path: {source.name!r} is not a complete NetCDF file"]) from error
    for node in tree.subtree:
        node.dataset = encoded(_with_words(node.to_dataset(inherit=False)))
    kind = tree.attrs.get(_KIND, "DataTree" if tree.children else "Dataset")
    if kind == "DataTree":
        return tree
    dataset = tree.to_dataset()
    dataset.attrs.pop(_KIND, None)
    if kind == "Dataset":
        return dataset
    array = dataset[kind]
    array.attrs.update({key: dataset.attrs[key] for key in _GLOBAL if key in dataset.attrs})
    return array


@dataclass(frozen=True)
class Outline:
    """What a group of a file holds: attributes, sizes and attributes of each variable, some numbers."""

    attrs: dict[str, Any]
    variables: dict[str, tuple[dict[str, int], dict[str, Any]]]
    numbers: dict[str, Any]


def outline(path: str | os.PathLike[str], read: Callable[[str], bool]) -> dict[str, Outline]:
    """Return what a NetCDF file holds, group by group, and the numbers of the variables that `read` picks.

    Raises
    ------
    UnreadableFile
        The file does not exist, is truncated, or is not NetCDF.
    """
    import netCDF4

    source = Path(path)
    where = "fractalcontact.open"
    if not source.is_file():
        raise UnreadableFile(where, [f"path: expected an existing file, got {source.name!r}"])
    found: dict[str, Outline] = {}

    def walk(group: Any, place: str) -> None:
        found[place or "/"] = Outline(
            dict(group.__dict__),
            {
                str(name): (_sizes(variable), dict(variable.__dict__))
                for name, variable in group.variables.items()
            },
            {
                str(name): variable[...]
                for name, variable in group.variables.items()
                if getattr(variable.dtype, "kind", "O") in "biuf" and read(str(name))
            },
        )
        for name, child in group.groups.items():
            walk(child, f"{place}/{name}")

    try:
        with netCDF4.Dataset(source) as file:
            walk(file, "")
    except (OSError, RuntimeError) as error:
        raise UnreadableFile(where, [f"path: {source.name!r} is not a complete NetCDF file"]) from error
    return found


def _sizes(variable: Any) -> dict[str, int]:
    """Return dims and lengths; the characters of words are no dim."""
    sizes = dict(zip(variable.dimensions, map(int, variable.shape), strict=True))
    return {
        dim: size for dim, size in sizes.items() if not (variable.dtype == "S1" and dim.startswith("string"))
    }


def _why_not(folder: Path, error: Exception) -> str:
    """Return why a file could not be written, in the words of the system where it gives any."""
    with contextlib.suppress(OSError):
        if shutil.disk_usage(folder).free < LEAST_ROOM:
            return "no space left on the device"
    reason = getattr(error, "strerror", None) or str(error)
    return reason if isinstance(error, OSError) else f"the file could not be completed ({reason})"


def _with_words(dataset: xr.Dataset) -> xr.Dataset:
    """Return the dataset with its words as fixed-width strings, as they were before they were written."""
    words = {
        name: variable.astype(str)
        for name, variable in dataset.variables.items()
        if variable.dtype == object and all(isinstance(one, str) for one in variable.values.flat)
    }
    return dataset.assign_coords(
        {name: value for name, value in words.items() if name in dataset.coords}
    ).assign({name: value for name, value in words.items() if name in dataset.data_vars})


def as_dataset(array: xr.DataArray) -> xr.Dataset:
    """Return a Dataset of one variable; what is said of the whole moves to the Dataset's attributes."""
    name = "values" if array.name is None else str(array.name)
    dataset = array.rename(name).to_dataset()
    dataset[name].attrs = {key: value for key, value in array.attrs.items() if key not in _GLOBAL}
    dataset[name].encoding = dict(array.encoding)
    dataset.attrs = {key: array.attrs[key] for key in _GLOBAL if key in array.attrs}
    return dataset


def unfinished(target: Path) -> Path:
    """Return the name under which this process writes a file until it is complete."""
    return target.with_name(f".{target.name}.{_machine()}.{os.getpid()}{PARTIAL}")


def clear_partial(folder: Path) -> None:
    """Remove the temporary files of runs on this machine that are no longer alive."""
    for leftover in folder.glob(f".*.{_machine()}.*{PARTIAL}"):
        number = leftover.name.removesuffix(PARTIAL).rpartition(".")[2]
        if number.isdigit() and int(number) != os.getpid() and not _alive(int(number)):
            leftover.unlink(missing_ok=True)


def _machine() -> str:
    """Return the name of this machine: others that see the same folder number their processes alike."""
    return "".join(letter for letter in platform.node() if letter.isalnum() or letter == "-") or "here"


def _alive(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OSError):
        return True
    return True


def _as_file(result: xr.DataArray | xr.Dataset | xr.DataTree) -> xr.Dataset | xr.DataTree:
    """Return what is written: global attributes lifted out of a DataArray, Conventions always there."""
    import xarray as xr

    data = _marked(result) if isinstance(result, xr.DataArray) else result.copy(deep=False)
    data.attrs = {"Conventions": CONVENTIONS} | data.attrs
    return data


def _marked(array: xr.DataArray) -> xr.Dataset:
    """Return the array in a Dataset that tells `open` to give it back alone."""
    dataset = as_dataset(array)
    dataset.attrs[_KIND] = next(iter(dataset.data_vars))
    return dataset
