"""The folder of a study: its results, and the finished parts by which a stopped study resumes.

It is recognised by what the package wrote in it; anything else is never touched. A result file states the
scene that it is from, a report and a figure the program that wrote them.

A part is one NumPy `.npz` file, written under a temporary name and renamed when it is complete; the
archive has a checksum of each array. It is not NetCDF: on a dask worker every access of a NetCDF file takes a
lock of the whole cluster (8 members of 128 x 128 points: 3592 acquisitions, 26.6 s instead of 9.8 s).
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import secrets
import shutil
import unicodedata
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
import xarray as xr

import fractalcontact
from fractalcontact.base import errors, files
from fractalcontact.base.file_contents import read_headers
from fractalcontact.base.provenance import with_load_indexes
from fractalcontact.base.schema import encoded
from fractalcontact.base.signals import Stopped
from fractalcontact.base.study import scene_of
from fractalcontact.base.validation import Problems, Words, writing
from fractalcontact.scenes._inputs import crack_options, locate, stage_options
from fractalcontact.scenes._scene import Scene

if TYPE_CHECKING:
    from fractalcontact.scenes._stages import Stage

REPORT, DATASHEET, TABLES, CSV = "report.html", "datasheet.pdf", "tables", "scans.csv"
SCANS = "scans"  # folder and group of the single scans
# not in the name of a NetCDF group: "/", controls, spaces at the end; a first character other than `FIRST`
ESCAPED = re.compile(r"[%/\x00-\x1f\x7f]| +\Z")
ESCAPED_ACCENTS = re.compile(rf"{ESCAPED.pattern}|[^\x00-\x7f]")
FIRST = re.compile(r"[A-Za-z0-9]|[^\x00-\x7f]")
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
    with Problems(files.WHERE) as problems:
        is_path = problems.path("out", out, what="the path of a folder")
        if is_path and not force and Path(out).is_dir():
            _check(Path(out), scene, problems)
    is_new = not Path(out).exists()
    folder = files.output_folder(out)
    try:
        yield folder
    except errors.FractalContactError as error:
        kept = any(folder.glob(f"**/{FOLDER}/*.npz")) or any(folder.glob(f"**/{files.RESULT}"))
        if is_new and not kept and not isinstance(error, Stopped):
            shutil.rmtree(folder, ignore_errors=True)
        raise


def folder_of(name: str) -> str:
    """Return the name of the folder and the group of a scan; those of two scans differ.

    What the name of a NetCDF group may not have is percent-encoded, and accents that NetCDF would compose; it
    begins with a further underscore where it does not begin with a letter or a digit.
    """
    pattern = ESCAPED if unicodedata.is_normalized("NFC", name) else ESCAPED_ACCENTS
    escaped = pattern.sub(lambda found: "".join(f"%{byte:02X}" for byte in found[0].encode()), name)
    return escaped if FIRST.match(escaped) else f"_{escaped}"


def page_of(name: str) -> str:
    """Return where the report of a scan lies, from that of all."""
    return f"{SCANS}/{folder_of(name)}/{REPORT}"


def _check(folder: Path, scene: Scene, problems: Problems) -> None:
    """Note files of others, and results of another study."""
    foreign = [path.name for path in sorted(folder.iterdir()) if is_foreign(path)]
    if foreign:
        got = Words(f"{folder.name!r} with {', '.join(foreign)}")
        problems.add("out", f"a folder without files of others under these names ({REMEDY})", got)
        return
    own = _identity({"title": scene.name, **scene.tables})
    for name in (files.RESULT, files.PARTIAL_RESULT):
        other = _scene_of(folder / name)
        if other is not None and _identity(other) != own:
            got = Words(f"{folder.name!r} with those of {other.get('title', 'another one')!r}")
            problems.add("out", f"a folder without results of another study ({REMEDY})", got)
            return


def is_foreign(path: Path) -> bool:
    """Return whether a file has a name that a study writes, and was not written by this package."""
    if path.name in (files.RESULT, files.PARTIAL_RESULT):
        return _scene_of(path) is None
    if path.name == REPORT:
        return not is_report(path)
    if path.name in (TABLES, DATASHEET, CSV):
        return _scene_of(path.with_name(files.RESULT)) is None
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
    except errors.UnreadableFile:
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


FOLDER = ".stages"
_HEADER, _ARRAY = "header", "array"
_DAMAGED = (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile)


class PartStore:
    """Results of finished parts by name, in the folder of a run; without a folder it keeps nothing."""

    def __init__(self, out: Path | None) -> None:
        self.folder = None if out is None else out.absolute() / FOLDER

    def get(self, key: str) -> xr.Dataset | None:
        """Return the result that was kept under a name; None if there is none, or a damaged one."""
        if self.folder is None or not (path := self.folder / f"{key}.npz").is_file():
            return None
        try:
            return _read_part(path)
        except _DAMAGED:
            message = f"{FOLDER}/{path.name} is damaged or of another origin; that part is computed again"
            errors.warn(message, errors.FractalContactWarning)
            return None

    def put(self, key: str, result: xr.Dataset) -> None:
        """Keep a result."""
        if self.folder is not None:
            _write_part(result, self.folder / f"{key}.npz")

    def kept(self, digests: Iterable[str]) -> dict[str, xr.Dataset]:
        """Return what was kept of the stages with these digests, by name."""
        if self.folder is None:
            return {}
        names = [path.stem for digest in digests for path in self.folder.glob(f"*.{digest}.*.npz")]
        parts = {name: self.get(name) for name in names}
        return {name: part for name, part in parts.items() if part is not None}

    def clear(self) -> None:
        """Remove all that is kept, and no file of others."""
        if self.folder is None:
            return
        with suppress(OSError):  # a file that cannot be removed, or another one in the folder
            for path in (*self.folder.glob("*.npz*"), *self.folder.glob("run-*")):  # parts, and marks of runs
                path.unlink()
            self.folder.rmdir()


class MemoryStore(PartStore):
    """The store of a worker without access to the folder: kept parts are sent to it, new ones return."""

    def __init__(self, kept: Mapping[str, xr.Dataset]) -> None:
        super().__init__(None)
        self.before: Mapping[str, xr.Dataset] = kept
        self.added: dict[str, xr.Dataset] = {}

    def get(self, key: str) -> xr.Dataset | None:
        """Return the result that was kept under a name, None if there is none."""
        return self.before.get(key)

    def put(self, key: str, result: xr.Dataset) -> None:
        """Keep a result."""
        self.added[key] = result


def _write_part(result: xr.Dataset, path: Path) -> None:
    """Write a part as JSON, which names the arrays beside it."""
    arrays: dict[str, np.ndarray[Any, Any]] = {}

    def put(value: Any) -> dict[str, str]:
        """Return in place of an array, or a number of NumPy, the name under which it is written."""
        name, values = f"array{len(arrays)}", np.asarray(value)
        arrays[name] = values.astype(str) if values.dtype == object else values
        return {_ARRAY: name}

    parts = {"data_vars": result.data_vars, "coords": result.coords}
    content: dict[str, Any] = {
        place: {name: [each.dims, each.values, each.attrs] for name, each in variables.items()}
        for place, variables in parts.items()
    }
    header = json.dumps(content | {"attrs": result.attrs}, default=put)
    with writing("fractalcontact.scenes.run", "out", path):
        path.parent.mkdir(parents=True, exist_ok=True)
        files.clear_partial(path.parent)
        with files.written_whole(path) as temporary, temporary.open("wb") as file:
            _write_arrays(file, {_HEADER: np.array(header)} | arrays)


def _write_arrays(file: IO[bytes], arrays: Mapping[str, np.ndarray[Any, Any]]) -> None:
    """Write an npz file; unlike older `np.savez`, close the archive also where the disk is full."""
    with zipfile.ZipFile(file, "w") as archive:
        for name, values in arrays.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as member:
                np.lib.format.write_array(member, values)


def _read_part(path: Path) -> xr.Dataset:
    """Return a part; raise one of `_DAMAGED` if it is not as it was written."""
    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
        arrays = {name: file[name] for name in file.files}  # the archive has a checksum of each

    def take(value: dict[str, Any]) -> Any:
        return arrays[value[_ARRAY]][()] if value.keys() == {_ARRAY} else value

    header = json.loads(str(arrays.pop(_HEADER)), object_hook=take)
    variables, coordinates = (
        {name: tuple(each) for name, each in header[place].items()} for place in ("data_vars", "coords")
    )
    return with_load_indexes(encoded(xr.Dataset(variables, coordinates, header["attrs"])))


def with_seeds(scene: Scene, store: PartStore) -> Scene:
    """Return the scene with a seed for each surface generated without one; a resumed run takes the same."""
    names = [
        name
        for name in ("surface", "upper")
        if "generate" in scene.table(name) and "rng" not in scene.table(name)
    ]
    if not names:
        return scene
    key = f"seeds.{digest_of(scene.tables)}"
    kept = store.get(key)
    if kept is None:
        # short, and unlike that of any other study
        kept = xr.Dataset(attrs={name: str(secrets.randbits(48)) for name in names})
        store.put(key, kept)
    tables = {name: {**scene.table(name), "rng": int(kept.attrs[name])} for name in names}
    return replace(scene, tables={**scene.tables, **tables})


def digest(stage: Stage, scene: Scene, digests: Mapping[str, str]) -> str:
    """Return a digest of all that can change the result of a stage, and of nothing else."""
    row = stage.row
    facts: dict[str, Any] = {
        "version": fractalcontact.__version__,
        "keep": [word for word in stage.keep if word not in stage.dropped],
        "options": stage_options(scene, row),
    }
    if row.takes == "file":
        facts["surface"] = table = scene.table("surface" if stage.name == "surfaces" else "upper")
        facts["register"] = scene.joint.register, scene.joint.turn_upper
        if "read" in table:
            file = locate(table["read"], scene.folder)
            facts["file"] = hashlib.sha256(file.read_bytes()).hexdigest()
    if row.takes == "crack":
        facts["crack"] = crack_options(scene, row)
    facts["needs"] = [digests[need] for need in stage.needs]
    return digest_of([stage.name, facts])


def digest_of(facts: Any) -> str:
    """Return a short digest of plain values."""
    text = json.dumps(facts, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]
