"""Results of finished parts, by name, in a folder beside the result or in memory."""

from __future__ import annotations

import hashlib
import json
import secrets
import shutil
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base import netcdf, provenance
from fractalcontact.base.errors import FractalContactWarning, InvalidInput
from fractalcontact.scenes.given import contact_options, locate
from fractalcontact.scenes.scene import Scene

if TYPE_CHECKING:
    import xarray as xr

    from fractalcontact.scenes.planning import Stage

FOLDER = ".stages"
_KEY = "fractalcontact_part"


class Store:
    """Results of finished parts, in a folder (or nowhere)."""

    def __init__(self, out: Path | None) -> None:
        self.folder = None if out is None else out.absolute() / FOLDER

    def get(self, key: str) -> xr.Dataset | None:
        """Return what was kept under this name, None if nothing sound was."""
        if self.folder is None or not (self.folder / f"{key}.nc").is_file():
            return None
        try:
            found: Any = netcdf.open(self.folder / f"{key}.nc")
        except InvalidInput:
            found = None
        mark = None if found is None else found.attrs.pop(_KEY, None)
        if mark is None or mark != f"{key} {_checksum(found)}":
            told = f"{FOLDER}/{key}.nc is damaged or of another origin; that part is computed again"
            warnings.warn(told, FractalContactWarning, stacklevel=2)
            return None
        return found  # type: ignore[no-any-return]

    def put(self, key: str, result: xr.Dataset) -> None:
        """Keep a result."""
        if self.folder is not None:
            mark = f"{key} {_checksum(result)}"
            netcdf.save(result.assign_attrs({_KEY: mark}), self.folder / f"{key}.nc")

    def kept(self, digests: Iterable[str]) -> dict[str, xr.Dataset]:
        """Return what was kept of some stages, by name."""
        if self.folder is None:
            return {}
        names = (path.stem for one in digests for path in self.folder.glob(f"*.{one}.*.nc"))
        return {name: found for name in names if (found := self.get(name)) is not None}

    def clear(self) -> None:
        """Remove all that is kept."""
        if self.folder is not None:
            shutil.rmtree(self.folder, ignore_errors=True)


class Carried(Store):
    """What is kept where the folder is out of reach: sent with the work, and what was added taken back."""

    def __init__(self, kept: Mapping[str, xr.Dataset]) -> None:
        super().__init__(None)
        self.before, self.added = kept, dict[str, "xr.Dataset"]()

    def get(self, key: str) -> xr.Dataset | None:
        """Return what was kept under this name, None if nothing was."""
        return self.before.get(key)

    def put(self, key: str, result: xr.Dataset) -> None:
        """Keep a result."""
        self.added[key] = result


def seeded(scene: Scene, store: Store) -> Scene:
    """Return the scene with a seed for each face made without one: that of a run it goes on from."""
    made = [name for name in ("surface", "upper") if "generate" in scene.table(name)]
    open_ones = [name for name in made if "rng" not in scene.table(name)]
    if not open_ones:
        return scene
    key = f"seeds.{_hashed(scene.tables)}"
    kept = store.get(key)
    if kept is None:
        import xarray as xr

        kept = xr.Dataset(attrs={name: str(secrets.randbits(48)) for name in open_ones})
        store.put(key, kept)
    tables = {name: {**scene.table(name), "rng": int(kept.attrs[name])} for name in open_ones}
    return replace(scene, tables={**scene.tables, **tables})


def digest(stage: Stage, scene: Scene, digests: Mapping[str, str], dropped: tuple[str, ...]) -> str:
    """Return a name for the result: whatever could change it goes in, and nothing else."""
    room, _, name = stage.name.partition("/")
    tables: dict[str, Any] = {
        "version": provenance.plain(_version()),
        "keep": [word for word in stage.keep if word not in dropped],
    }
    if room == "surfaces" or name == "faces":
        table = scene.table("upper" if name == "faces" else "surface")
        tables["surface"] = table
        if "read" in table:
            file = locate(table["read"], scene.folder)
            tables["file"] = hashlib.sha256(file.read_bytes()).hexdigest()
    if room == "joints":
        tables["material"] = scene.table("material")
        joint = scene.table("joint")
        tables["joint"] = {
            key: joint[key] for key in joint if not isinstance(joint[key], dict) or key == name
        }
    if room == "dimensions":
        tables["dimensions"] = [scene.table("dimensions"), scene.wanted("dimensions")]
    if room == "contact":
        tables["contact"] = contact_options(scene)
    if room == "domains":
        tables["domains"] = scene.table("domains").get(name, {})
    tables["needs"] = [digests[need] for need in stage.needs]
    return _hashed([stage.name, tables])


def _hashed(facts: Any) -> str:
    text = json.dumps(facts, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _checksum(result: xr.Dataset) -> str:
    """Return a digest of all numbers and words: the file format sees no flipped bit in a small variable."""
    whole = hashlib.blake2b(digest_size=16)
    for name, variable in sorted(result.variables.items(), key=lambda item: str(item[0])):
        values = variable.values
        words = values.dtype.kind not in "biuf"
        whole.update(f"{name} {variable.dims} {variable.shape} {words}".encode())
        whole.update("\0".join(map(str, values.flat)).encode() if words else np.ascontiguousarray(values))
    return whole.hexdigest()


def _version() -> str:
    import fractalcontact

    return fractalcontact.__version__
