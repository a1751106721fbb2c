"""The scenes of many scans: one for each file, or pair of files, that the patterns of a scene stand for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from itertools import takewhile
from pathlib import Path
from typing import Any

from fractalcontact.base.files import files_of, is_pattern
from fractalcontact.base.validation import NONE, Problems, Words
from fractalcontact.scenes._overview import folder_of
from fractalcontact.scenes._scene import Scene


def has_scans(scene: Scene) -> bool:
    """Return whether a scene reads several files: a pattern or a list."""
    reads = (scene.table(name).get("read") for name in ("surface", "upper"))
    return any(isinstance(read, list) or is_pattern(read, scene.folder) for read in reads)


def scans_of(scene: Scene) -> dict[str, Scene]:
    """Return the scene of every scan by its name; empty for a scene of one surface.

    A scan is called as its file, or, of files in several folders, as the path from the folder they share; a
    pair of faces as what the wildcards of both patterns stand for.

    Raises
    ------
    InvalidInput
        No file has such a name, or lower and upper faces do not match; the error lists them.
    """
    if not has_scans(scene):
        return {}
    reads = {name: scene.table(name)["read"] for name in ("surface", "upper") if "read" in scene.table(name)}
    with Problems(f"scene {scene.name}") as problems:
        problems.require("surface" in reads, "surface.read", "a lower face for every upper one", NONE)
    with problems:
        files = {name: _files(read, name, scene.folder, problems) for name, read in reads.items()}
        if len(files) == 2 and all(files.values()):
            _check_pairs(reads, files, problems)
        is_named_by_file = isinstance(reads["surface"], list) or len(files) == 1
        names = _names(list(files["surface"].values())) if is_named_by_file else list(files["surface"])
        twice = sorted({name for name in names if names.count(name) > 1})
        problems.require(not twice, "surface.read", "each file once", Words(f"{', '.join(twice)} again"))
    pairs = zip(*(each.values() for each in files.values()), strict=True)
    tables = [
        {name: {**scene.table(name), "read": file} for name, file in zip(files, pair, strict=True)}
        for pair in pairs
    ]
    return {
        name: replace(
            scene, name=folder_of(name), tables={**scene.tables, "title": name, **own}, checked=None
        )
        for name, own in zip(names, tables, strict=True)
    }


def _files(read: Any, place: str, folder: Path, problems: Problems) -> dict[str, str]:
    """Return the files of a pattern by what its wildcards stand for, those of a list by their number."""
    if not is_pattern(read, folder):
        files = read if isinstance(read, list) else [read]
        return {str(number): str(file) for number, file in enumerate(files)}
    found = files_of(read, folder)
    problems.require(bool(found), f"{place}.read", "a pattern with files", Words(f"{read!r} without any"))
    return found


def _check_pairs(
    reads: Mapping[str, Any], files: Mapping[str, Mapping[str, str]], problems: Problems
) -> None:
    """Note the faces that have no other one."""
    lower, upper = files["surface"], files["upper"]
    lonely = [f"{lower[key]} has no upper face" for key in lower if key not in upper]
    lonely += [f"{upper[key]} has no lower face" for key in upper if key not in lower]
    if lonely:
        expected = f"an upper face for every lower one ({reads['surface']} and {reads['upper']})"
        problems.add("upper.read", expected, Words("; ".join(lonely)))


def _names(files: list[str]) -> list[str]:
    """Return the names of files from the folder that they share."""
    parts = [Path(file).parts for file in files]
    same = takewhile(lambda each: len(set(each)) == 1, zip(*(each[:-1] for each in parts), strict=False))
    shared = len(list(same))
    return ["/".join(each[shared:]) for each in parts]
