"""The surfaces of a study: read, made or generated as its tables state, and prepared."""

from __future__ import annotations

import math
import os
import re
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.files import datasets_folder
from fractalcontact.base.study import joined_references
from fractalcontact.base.units import quantity_text
from fractalcontact.scenes._functions import public_function
from fractalcontact.scenes._scene import OF_SURFACE, Scene, SurfaceTable

if TYPE_CHECKING:
    import xarray as xr

VARIABLE = re.compile(r"\$\{?(\w+)\}?")


def read_surface(table: SurfaceTable, folder: Path, lower: xr.DataArray | None = None) -> xr.DataArray:
    """Return the surface that a table describes; with `member`, this member of its ensemble alone.

    `lower` is the surface whose plane and cells an upper face with ``plane = "surface"`` takes.
    """
    from fractalcontact import surfaces

    surface: xr.DataArray
    if table.generate is not None:
        surface = public_function(f"surfaces.{table.generate}")(**generator_options(table))
    elif table.sample is not None:
        surface = surfaces.sample(table.sample)
    else:
        options = dict(table.options)
        if options.get("plane") == OF_SURFACE:
            options["plane"] = lower
        surface = surfaces.read(locate(str(table.read), folder), **options)
        if "y" not in surface.dims:
            remedy = "see fractalcontact.dimensions.estimate"
            raise InvalidInput("surface", [f"read: expected a surface, got a profile: {remedy}"])
    source, done = surface.attrs["references"], []
    if table.generate is None and (missing := int(surface.isnull().sum())):
        done.append(f"{100 * missing / surface.size:.3g} % of the points are missing")
    if table.despike:
        surface = surfaces.despike(surface)
        source = joined_references(source, surface.attrs["references"])
        done.append(f"{_points(surface['removed_points'])} removed as spikes")
    if table.fill:
        surface = surfaces.fill(surface)
        source = joined_references(source, surface.attrs["references"])
        done.append(f"{_points(surface['filled_points'])} filled in")
    if table.level is not None:
        before, tilt = rms_height(surface), math.degrees(math.atan(math.hypot(*mean_slopes(surface))))
        surface = surfaces.level(surface, table.level)
        ends = [quantity_text(height, "m") for height in (before, rms_height(surface))]
        if table.level > 0:
            done.append(f"levelled: tilt {tilt:.3g}° removed, Sq {ends[0]} before and {ends[1]} after")
    return surface.assign_attrs(references=source, **({"preparation": ", ".join(done)} if done else {}))


def _points(count: Any) -> str:
    return f"{int(count)} point" + ("s" if int(count) != 1 else "")


def rms_height(surface: xr.DataArray) -> float:
    """Return the root mean square height about the mean (m)."""
    return float(surface.std())


def mean_slopes(surface: xr.DataArray) -> tuple[float, float]:
    """Return the slopes (y, x) of the least-squares plane of the heights that are there."""
    known = np.isfinite(surface.values)
    y, x = np.meshgrid(surface["y"], surface["x"], indexing="ij")
    plane = np.stack([y[known], x[known], np.ones(int(known.sum()))], axis=-1)
    slopes = np.linalg.lstsq(plane, surface.values[known], rcond=None)[0]
    return float(slopes[0]), float(slopes[1])


def plane_share(surface: xr.DataArray) -> float:
    """Return the part of the mean square height that the mean plane carries."""
    total = rms_height(surface)
    slope_y, slope_x = mean_slopes(surface) if total > 0 else (0.0, 0.0)
    plane = slope_y * surface["y"] + slope_x * surface["x"] + 0.0 * surface
    return (rms_height(plane) / total) ** 2 if total > 0 else 0.0


def generator_options(table: SurfaceTable) -> dict[str, Any]:
    """Return the arguments of the generator of a surface, or of one member of an ensemble."""
    options = dict(table.options)
    if table.member is not None:
        options["rng"] = np.random.SeedSequence(options["rng"], spawn_key=(table.member,))
    return options


def surface_grid(
    scene: Scene, face: xr.DataArray | None = None
) -> tuple[tuple[int, int], tuple[float, float]]:
    """Return shape and spacing (y, x; m) of the surface; a generated one is not made for that.

    A surface that has been read is the `face`.
    """
    options = scene.surface.options
    if scene.surface.generate is not None:
        shape, spacing = np.broadcast_to(options["shape"], 2), np.broadcast_to(options["spacing"], 2)
        return (int(shape[0]), int(shape[1])), (float(spacing[0]), float(spacing[1]))
    # its heights do not matter: what is removed from them, or filled, leaves the grid as it is
    as_read = replace(scene.surface, despike=False, fill=False, level=None)
    surface = read_surface(as_read, scene.folder) if face is None else face
    return (surface.sizes["y"], surface.sizes["x"]), spacing_of(surface)


def spacing_of(surface: xr.DataArray) -> tuple[float, float]:
    """Return the spacing (y, x; m) of a surface."""
    y, x = (float(surface[dim][1] - surface[dim][0]) for dim in ("y", "x"))
    return y, x


def block_shape(scene: Scene, shape: tuple[int, int], spacing: tuple[float, float]) -> tuple[int, int]:
    """Return the cells (y, x) of the block of a joint: all of the surface where the scene states no block."""
    if scene.joint.block is None:
        return shape
    rows, columns = np.rint(np.broadcast_to(scene.joint.block, 2) / np.asarray(spacing))
    return int(rows), int(columns)


def locate(path: str, folder: Path) -> Path:
    """Return the file that a scene names.

    Environment variables are expanded; a relative path starts at the scene or at the shipped data.

    Raises
    ------
    InvalidInput
        A variable is not set, or there is no such file.
    """
    expanded = os.path.expandvars(path)
    if "$" in expanded:
        unset = " and ".join(VARIABLE.findall(expanded))
        remedy = f"set the environment variable {unset} to the folder that holds the file {Path(path).name}"
        raise InvalidInput("surface", [f"read: {remedy}"])
    beside = Path(os.path.normpath(folder / expanded))  # also where the folder does not exist yet
    for candidate in (beside, datasets_folder() / expanded):
        if candidate.is_file():
            return candidate
    raise InvalidInput("surface", [f"read: expected an existing file, got {path!r}"])
