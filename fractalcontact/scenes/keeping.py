"""Results of finished parts, by name, in a folder beside the result or in memory."""

from __future__ import annotations

import hashlib
import json
import shutil
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
        self.folder = None if out is None else out / FOLDER

    def get(self, key: str) -> xr.Dataset | None:
        """Return what was kept under this name, None if nothing sound was."""
        if self.folder is None or not (self.folder / f"{key}.nc").is_file():
            return None
        try:
            found: Any = netcdf.open(self.folder / f"{key}.nc")
        except InvalidInput:
            found = None
        if found is None or found.attrs.pop(_KEY, "") != key:
            told = f"{FOLDER}/{key}.nc is damaged or of another origin; that part is computed again"
            warnings.warn(told, FractalContactWarning, stacklevel=2)
            return None
        return found  # type: ignore[no-any-return]

    def put(self, key: str, result: xr.Dataset) -> None:
        """Keep a result."""
        if self.folder is not None:
            netcdf.save(result.assign_attrs({_KEY: key}), self.folder / f"{key}.nc")

    def clear(self) -> None:
        """Remove all that is kept."""
        if self.folder is not None:
            shutil.rmtree(self.folder, ignore_errors=True)


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
    text = json.dumps([stage.name, tables], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _version() -> str:
    import fractalcontact

    return fractalcontact.__version__
