"""The folder of a study: recognised by what the package wrote in it; anything else is never touched.

A result file states the scene that it is from, a report and a figure the program that wrote them.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fractalcontact.base.errors import FractalContactError, UnreadableFile
from fractalcontact.base.file_contents import read_headers
from fractalcontact.base.files import PARTIAL_RESULT, RESULT, WHERE, output_folder
from fractalcontact.base.signals import Stopped
from fractalcontact.base.study import scene_of
from fractalcontact.base.validation import Problems, Words
from fractalcontact.scenes._checkpoint import FOLDER
from fractalcontact.scenes._scene import Scene

REPORT, DATASHEET, TABLES, CSV = "report.html", "datasheet.pdf", "tables", "scans.csv"
GENERATOR = 'name="generator" content="fractalcontact'  # of a report, in its head
SOFTWARE = "fractalcontact"  # of a figure, as its metadata say
REMEDY = "choose another folder, or --force to overwrite"


@contextmanager
def results_folder(out: str | os.PathLike[str] | None, scene: Scene, *, force: bool) -> Iterator[Path | None]:
    """Provide the folder of a study; a new one is removed again if the study fails before a part is kept.

    Raises
    ------
    InvalidInput
        Unless with `force`: the folder has the results of another study, or files of others under the names
        of those that the study writes.
    """
    if out is None:
        yield None
        return
    with Problems(WHERE) as problems:
        is_path = problems.path("out", out, what="the path of a folder")
        if is_path and not force and Path(out).is_dir():
            _check(Path(out), scene, problems)
    is_new = not Path(out).exists()
    folder = output_folder(out)
    try:
        yield folder
    except FractalContactError as error:
        kept = any(folder.glob(f"**/{FOLDER}/*.npz")) or any(folder.glob(f"**/{RESULT}"))
        if is_new and not kept and not isinstance(error, Stopped):
            shutil.rmtree(folder, ignore_errors=True)
        raise


def _check(folder: Path, scene: Scene, problems: Problems) -> None:
    """Note files of others, and results of another study."""
    foreign = [path.name for path in sorted(folder.iterdir()) if is_foreign(path)]
    if foreign:
        got = Words(f"{folder.name!r} with {', '.join(foreign)}")
        problems.add("out", f"a folder without files of others under these names ({REMEDY})", got)
        return
    own = _identity({"title": scene.name, **scene.tables})
    for name in (RESULT, PARTIAL_RESULT):
        other = _scene_of(folder / name)
        if other is not None and _identity(other) != own:
            got = Words(f"{folder.name!r} with those of {other.get('title', 'another one')!r}")
            problems.add("out", f"a folder without results of another study ({REMEDY})", got)
            return


def is_foreign(path: Path) -> bool:
    """Return whether a file has a name that a study writes, and was not written by this package."""
    if path.name in (RESULT, PARTIAL_RESULT):
        return _scene_of(path) is None
    if path.name == REPORT:
        return not is_report(path)
    if path.name in (TABLES, DATASHEET, CSV):
        return _scene_of(path.with_name(RESULT)) is None
    return path.suffix == ".png" and not is_figure(path)


def is_report(path: Path) -> bool:
    """Return whether a file is a report of this package."""
    with path.open("rb") as file:
        return GENERATOR.encode() in file.read(1000)  # bytes that hold its head


def is_figure(path: Path) -> bool:
    """Return whether a picture is a figure of this package."""
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(path) as picture:
            return str(picture.info.get("Software", "")).startswith(SOFTWARE)
    except (UnidentifiedImageError, OSError):
        return False


def remove_old_figures(folder: Path, drawn: Sequence[Path]) -> None:
    """Remove the figures of an earlier run that the study no longer draws."""
    for path in folder.glob("*.png"):
        if path not in drawn and is_figure(path):
            path.unlink()


def _scene_of(path: Path) -> dict[str, Any] | None:
    """Return the tables of the scene that a result file is from; None for any other file."""
    if not path.is_file():
        return None
    try:
        root = read_headers(path, lambda _: False)["/"]
    except UnreadableFile:
        return None
    scene = scene_of(root)
    return {"title": root.attrs.get("title")} | scene if scene else None


def _identity(tables: Mapping[str, Any]) -> list[Any]:
    """Return what makes two runs the same study: the title and the sources of the surfaces."""
    sources = [
        _source(table.get(key))
        for table in (tables.get("surface", {}), tables.get("upper", {}))
        for key in ("read", "sample", "generate")
    ]
    return [tables.get("title"), *sources]


def _source(value: Any) -> str:
    """Return the name of a file, or of the folder of a list of scans, which may grow."""
    return Path(str(value[0])).parent.name if isinstance(value, list) and value else Path(str(value)).name
