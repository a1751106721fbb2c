"""Plausibility of a study: valid values that suggest a mistake in a unit."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.errors import ScaleWarning
from fractalcontact.base.grid import distinct
from fractalcontact.scenes._inputs import spacing_of
from fractalcontact.scenes._options import contact_modulus, stage_options, values_of
from fractalcontact.scenes._scene import Scene
from fractalcontact.scenes._stages import STAGES

if TYPE_CHECKING:
    import xarray as xr


def warn(messages: Iterable[str]) -> None:
    """Warn of every implausible value."""
    for message in messages:
        warnings.warn(message, ScaleWarning, stacklevel=3)


def _rms_slope(heights: np.ndarray[Any, Any], spacing: tuple[float, float]) -> float:
    squares = [
        np.nanmean((np.diff(heights, axis=axis) / spacing[axis]) ** 2)
        for axis in (0, 1)
        if heights.shape[axis] > 1
    ]
    return float(np.sqrt(np.sum(squares)))


def implausible_input(scene: Scene, surface: xr.DataArray) -> Iterator[str]:
    """Yield the implausible values of a scene and its surface."""
    spacing = spacing_of(surface)
    slope = _rms_slope(distinct(surface.values), spacing)
    if slope > 3.0:  # cracks, grounds and grinds are below 1
        yield f"surface: an rms slope of {slope:.3g}; are heights and spacing in the same unit?"
    edges = [size * step for size, step in zip(surface.shape, spacing, strict=True)]
    if scene.is_pressed:
        options = stage_options(scene, STAGES["contact"])
        yield from _high_pressures(
            "contact", options, float(np.prod(edges)), float(options["contact_modulus"])
        )
    material = scene.material
    stages = [
        name for name in ("closure", "area_dimension", "elastic_dilatancy") if name in scene.want.joints
    ]
    if stages and material.young is not None and material.poisson is not None:
        modulus = contact_modulus(material)
        block = edges if scene.joint.block is None else scene.joint.block
        area = float(np.prod(np.broadcast_to(block, 2)))
        for name in stages:
            loads = values_of(scene, STAGES[f"joints/{name}"])
            yield from _high_pressures(f"joint.{name}", loads, area, modulus)


def _high_pressures(place: str, loads: Mapping[str, Any], area: float, modulus: float) -> Iterator[str]:
    for key, scale in (("normal_force", area), ("nominal_pressure", 1.0)):
        if loads.get(key) is not None:
            highest = float(np.max(loads[key])) / scale
            if highest > 0.3 * modulus:  # strains are no longer small
                yield (
                    f"{place}: {key} gives a mean pressure of {highest:.3g} Pa on a contact modulus of "
                    f"{modulus:.3g} Pa; is one of them in another unit?"
                )


def implausible_result(name: str, result: xr.Dataset) -> Iterator[str]:
    """Yield the implausible values of a closure law."""
    edge = float(result["nominal_area"].max()) ** 0.5
    if "closure" in result and np.isfinite(result["closure"].values).any():
        deepest = float(np.nanmax(result["closure"].values))
        if deepest > 0.5 * edge:
            yield f"{name}: a closure of {deepest:.3g} m of a body {edge:.3g} m wide; is the modulus in Pa?"
