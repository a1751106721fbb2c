"""The public functions that a study calls, by the names under which users call them."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable
from typing import Any

# arguments that a scene states elsewhere: surfaces, maps, what to keep, progress bars
FROM_SCENE = frozenset(
    (
        "surface",
        "crack",
        "pressed",
        "signature",
        "mask",
        "valid",
        "gap",
        "dilatancy",
        "keep",
        "progress",
    )
)
MATERIAL_ALONE = "basic_friction_angle"  # of bodies: no table of a stage gives one of its own


def public_function(name: str) -> Callable[..., Any]:
    """Return a public function by its name, "contact.press" for example."""
    subpackage, _, function = name.partition(".")
    return getattr(importlib.import_module(f"fractalcontact.{subpackage}"), function)  # type: ignore[no-any-return]


def parameters_of(function: str) -> dict[str, inspect.Parameter]:
    """Return the parameters of a public function."""
    return dict(inspect.signature(public_function(function)).parameters)


def arguments_of(function: str) -> tuple[tuple[str, ...], frozenset[str]]:
    """Return the arguments of a public function that a scene may give, and those without a default."""
    known = {key: value for key, value in parameters_of(function).items() if key not in FROM_SCENE}
    required = frozenset(key for key, value in known.items() if value.default is value.empty)
    return tuple(key for key in known if key != MATERIAL_ALONE), required
