"""Pressures of a given force between zero and the hardness: projection onto the capped simplex.

The set {0 <= p <= p_max, sum p = force} is a capped simplex. The nearest point of it to a pressure q is
clip(q - shift, 0, p_max) with the one shift that gives the force (Wang and Lu 2015, arXiv:1503.01002); the
shift is found by Newton's method kept inside a bracket (Cominetti, Mascarenhas and Silva 2014, Math. Prog.
Comp. 6:151).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.numbers import Array
from fractalcontact.contact._problem import sum_by_rows


def project_onto_capped_simplex(
    q: Array,
    force: float,
    p_max: float,
    *,
    max_steps: int = 200,  # far more than the pieces that a bracketed Newton step passes; it ends at rounding
) -> Array:
    """Shift values by one amount so that, clipped to 0 .. p_max, they add up to `force`.

    The sum is piecewise linear in the shift, so that Newton's method ends after a few steps.
    """
    low, high, shift = float(q.min()) - p_max, float(q.max()), 0.0
    p = np.clip(q, 0.0, p_max)
    for _ in range(max_steps):
        excess = float(np.sum(p)) - force
        low, high = (shift, high) if excess > 0 else (low, shift)
        free = int(np.count_nonzero((p > 0) & (p < p_max)))
        newton = shift + excess / free if free else np.inf
        newton = newton if low < newton < high else 0.5 * (low + high)
        # with 0 1.9 times the transforms of 257 steps that may yield, with 1e-12 as many
        if newton == shift or abs(excess) <= 1e-15 * force:
            break
        shift = newton
        p = np.clip(q - shift, 0.0, p_max)
    # the free nodes share in proportion what rounding of the values has left
    inside = (p > 0) & (p < p_max)
    free_force = float(np.sum(p, where=inside))
    if free_force > 0:
        factor = (force - float(np.sum(p, where=~inside))) / free_force
        p[inside] = np.clip(p[inside] * factor, 0.0, p_max)
    return np.asarray(p)


def uniform_on_lowest(level: Array, force: float, p_max: float) -> Array:
    """Return an even pressure of this force on the nodes of lowest level u + h, a tenth more than needed."""
    # of 1181 steps that may yield factors of 1 to 1.03 took .84 to 1.33 times the transforms, in no order; of
    # 257 others a factor of 2 took 1.8 times as many
    count = min(level.size, max(1, int(np.ceil(1.1 * force / p_max))))
    pressure = np.zeros(level.shape)
    pressure.ravel()[np.argpartition(level.ravel(), count - 1)[:count]] = force / count
    return pressure


def scale_to_force(
    p: Array,
    level: Array,
    p_max: Any,
    force: float,
    epsilon: float,
    *,
    max_corrections: int = 50,  # each clips more nodes to p_max
) -> None:
    """Scale the pressures below p_max, in place, until they add up to `force`.

    Where none can be scaled, or the corrections do not end, the force is put on the nodes of lowest level.
    """
    for _ in range(max_corrections):
        total = sum_by_rows(p)
        if abs(total - force) <= epsilon * force:
            return
        below = p < p_max
        scalable = sum_by_rows(np.where(below, p, 0)) if p_max < np.inf else total
        if scalable <= 0 or total - scalable >= force:
            break
        factor = p.dtype.type((force - (total - scalable)) / scalable)
        np.multiply(p, factor, out=p, where=below)
        np.minimum(p, p_max, out=p)
        if p_max == np.inf:
            return
    p[...] = uniform_on_lowest(level, force, float(p_max))
