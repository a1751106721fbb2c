"""A crack that opens against a spring: the normal force grows with the dilatancy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.progress import track
from fractalcontact.joints._elastic import Load, Pressing, warn

if TYPE_CHECKING:
    from fractalcontact.joints._directions import Direction
    from fractalcontact.joints.crack import Crack

Array = np.ndarray[Any, np.dtype[Any]]

EXACT = 1e-7  # relative error of the normal force
MOST = 60  # solutions for one force


def press_sprung(
    crack: Crack,
    shears: Array,
    lifted: Array,
    towards: Direction,
    load: Load,
    stiffness: float,
    where: str,
    progress: bool,
) -> dict[str, Array]:
    """Press the crack together at every shear against a spring.

    The force on the block is N = N0 + k A (delta(N, v) - delta(N0, 0)), and never below zero. For every
    initial force N0 of `load` it is found by bisection and secants, for the closure grows with the force and
    the difference of the two sides changes its sign once.

    Parameters
    ----------
    lifted : ndarray, shape (shear,)
        Rigid dilatancy, m.
    stiffness : float
        k A, N/m.

    Returns
    -------
    dict of ndarray
        As `press_sheared`; normal_force and all that depends on it differ from shear to shear.
    """
    at_rest = Pressing(crack, 0.0, towards, load, where).along(load.values)
    settled = -at_rest["interface_closure"]
    results = []
    for shear, lift in zip(
        track(shears, progress, f"press, towards {towards.name}", unit="shear"), lifted, strict=True
    ):
        pressing = Pressing(crack, float(shear), towards, load, where)
        steps = [
            _balanced(pressing, float(first), float(lift - rest), stiffness, load.keep)
            for first, rest in zip(load.values, settled, strict=True)
        ]
        results.append({name: np.concatenate([step[name] for step in steps]) for name in steps[0]})
    found = {name: np.stack([result[name] for result in results]) for name in results[0]}
    warn(found, shears, towards, where)
    return found


def _balanced(
    pressing: Pressing, first: float, opening: float, stiffness: float, keep: Sequence[str]
) -> dict[str, Array]:
    """Press under the force at which faces and spring are in balance; `opening` is that of rigid faces."""
    from scipy.optimize import brentq

    def excess(force: float) -> float:
        inner = pressing.along(np.array([force]))["interface_closure"][0] if force > 0 else 0.0
        return float(force - first - stiffness * (opening - inner))

    if first + stiffness * opening <= 0:  # the faces sink away from the spring
        return pressing.along(np.zeros(1), keep)
    short = excess(first) if first > 0 else -stiffness * opening
    low, high = (first, first - short) if short < 0 else (0.0, first)
    if abs(short) <= EXACT * first:
        force = first
    elif low > 0:  # the closure goes with the logarithm of the force
        force = np.exp(
            brentq(lambda power: excess(np.exp(power)), np.log(low), np.log(high), xtol=EXACT, maxiter=MOST)
        )
    else:
        force = brentq(excess, low, high, xtol=EXACT * high, maxiter=MOST)
    return pressing.along(np.array([force]), keep)
