"""What a scene may say: its tables, their keys, and the words of `[want]`.

The keys of a scene are the argument names of the public functions, read from their signatures, so that each
name stands in one place.
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Mapping
from typing import Any

READING = ("read", "sample", "channel", "units", "spacing", "level", "despike", "fill")
GENERATORS = ("fbm", "spectral", "midpoint", "weierstrass")
SAMPLES = ("concrete_crack", "jacksboro_fault_dem")

MATERIAL = ("young", "poisson", "basic_friction_angle", "hardness")
LOADS = ("closure", "normal_force", "nominal_pressure")
SLIDING = ("block", "register")

# stage and the function it calls; [joint.<stage>] and [domains.<stage>] give one stage values of its own
JOINT_STAGES: Mapping[str, str] = {
    "delta_surface": "delta_surface",
    "closure": "closure",
    "rigid_dilatancy": "dilatancy",
    "elastic_dilatancy": "dilatancy",
    "friction": "friction",
    "decorrelation_length": "decorrelation_length",
    "transmissivity": "transmissivity",
}
DOMAIN_STAGES: Mapping[str, str] = {
    name: name
    for name in (
        "box_dimension",
        "box_counts",
        "minkowski_dimension",
        "correlation_dimension",
        "generalised_dimensions",
        "boundary_dimension",
        "lacunarity",
        "islands",
        "percolation",
        "describe",
        "evolution",
        "lineage",
    )
}
# arguments that the scene gives in another way: faces and maps, what to keep, the material, the bars
_GIVEN = {"surface", "crack", "mask", "valid", "gap", "dilatancy", "keep", "progress", "basic_friction_angle"}
_RIGID = ("shear", "direction")


def public(room: str, function: str) -> Callable[..., Any]:
    """Return a public function of a room, by name."""
    found: Callable[..., Any] = getattr(importlib.import_module(f"fractalcontact.{room}"), function)
    return found


def arguments(room: str, function: str) -> tuple[list[str], set[str]]:
    """Return the arguments of a public function that a scene may give, and those that it must."""
    signature = inspect.signature(public(room, function))
    known = {key: value for key, value in signature.parameters.items() if key not in _GIVEN}
    return list(known), {key for key, value in known.items() if value.default is value.empty}


def stage_keys(room: str, stage: str) -> tuple[str, ...]:
    """Return the keys that one stage of the joint or of the domains may have."""
    if stage == "rigid_dilatancy":
        return _RIGID
    function = (JOINT_STAGES if room == "joints" else DOMAIN_STAGES)[stage]
    return tuple(arguments(room, function)[0])


def joint_keys() -> tuple[str, ...]:
    """Return the keys of `[joint]`: those of all its stages, the block and whether to register the faces."""
    keys = [*SLIDING]
    for stage in JOINT_STAGES:
        keys += [key for key in stage_keys("joints", stage) if key not in keys]
    return tuple(keys)


SOLVED, ISLANDS = ("state", "pressure", "gap"), "label"  # maps of a solver; that of the islands
WANTED: Mapping[str, tuple[str, ...]] = {
    "surfaces": ("height", "describe"),
    "contact": ("press",),
    "joints": tuple(JOINT_STAGES),
    "domains": tuple(DOMAIN_STAGES),
    "keep": (*SOLVED, ISLANDS),
}
CHOICE = ("error", "budget")
TABLES = (
    "title",
    *CHOICE,
    "surface",
    "upper",
    "material",
    "contact",
    "joint",
    "dimensions",
    "domains",
    "want",
)

# bounds of the plain numbers of a scene: (above, at_least, below)
BOUNDS: Mapping[str, tuple[float | None, float | None, float | None]] = {
    "young": (0.0, None, None),
    "poisson": (-1.0, None, 0.5),
    "basic_friction_angle": (None, 0.0, 90.0),
    "hardness": (0.0, None, None),
    "contact_modulus": (0.0, None, None),
    "tolerance": (0.0, None, 1.0),
    "block": (0.0, None, None),
    "shear": (None, 0.0, None),
    "normal_force": (None, 0.0, None),
    "nominal_pressure": (None, 0.0, None),
    "closure": (None, 0.0, None),
    "smoothing": (0.0, None, None),
    "viscosity": (0.0, None, None),
    "spacing": (0.0, None, None),
}

# of those, what is one number and no path or pair
SINGLE = (
    "young",
    "poisson",
    "basic_friction_angle",
    "hardness",
    "contact_modulus",
    "tolerance",
    "smoothing",
    "viscosity",
)
