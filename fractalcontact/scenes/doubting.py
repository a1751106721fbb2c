"""Numbers that are possible, and hardly meant: a modulus, a height or a spacing in another unit."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.errors import ScaleWarning
from fractalcontact.scenes.given import contact_options, steps
from fractalcontact.scenes.scene import Scene

if TYPE_CHECKING:
    import xarray as xr

STEEP = 3.0  # rms slope: cracks, grounds and grinds are below 1
SOFT = 0.3  # mean pressure over the contact modulus, at which strains are no longer small
DEEP = 0.5  # closure over the edge of what is pressed


def warn(told: Iterable[str]) -> None:
    """Warn of each thing that is hardly meant."""
    for line in told:
        warnings.warn(line, ScaleWarning, stacklevel=3)


def of_the_given(scene: Scene, face: xr.DataArray) -> Iterator[str]:
    """Yield what is hardly meant in a scene and its face."""
    spacing = steps(face)
    squares = [np.nanmean((np.diff(face.values, axis=axis) / spacing[axis]) ** 2) for axis in (0, 1)]
    slope = float(np.sqrt(np.sum(squares)))
    if slope > STEEP:
        yield f"surface: an rms slope of {slope:.3g}; are heights and spacing in the same unit?"
    edges = [size * step for size, step in zip(face.shape, spacing, strict=True)]
    if scene.wanted("contact"):
        options = contact_options(scene)
        yield from _pressures("contact", options, float(np.prod(edges)), float(options["contact_modulus"]))
    material = scene.table("material")
    if scene.wanted("joints") and {"young", "poisson"} <= set(material):
        modulus = 0.5 * material["young"] / (1.0 - material["poisson"] ** 2)  # of two bodies alike
        area = float(np.prod(np.broadcast_to(scene.table("joint").get("block", edges), 2)))
        for name in ("closure", "elastic_dilatancy"):
            given = scene.options("joint", name, ("normal_force", "nominal_pressure"))
            yield from _pressures(f"joint.{name}", given, area, modulus)


def _pressures(place: str, given: Any, area: float, modulus: float) -> Iterator[str]:
    for key, scale in (("normal_force", area), ("nominal_pressure", 1.0)):
        if given.get(key) is not None:
            highest = float(np.max(given[key])) / scale
            if highest > SOFT * modulus:
                yield (
                    f"{place}: {key} makes a mean pressure of {highest:.3g} Pa on a contact modulus of "
                    f"{modulus:.3g} Pa; is one of them in another unit?"
                )


def of_the_found(name: str, result: xr.Dataset, edge: float) -> Iterator[str]:
    """Yield what is hardly meant in a closure law; `edge` is that of what is pressed, m."""
    if "closure" in result and np.isfinite(result["closure"].values).any():
        deepest = float(np.nanmax(result["closure"].values))
        if deepest > DEEP * edge:
            yield f"{name}: a closure of {deepest:.3g} m of a body {edge:.3g} m wide; is the modulus in Pa?"
