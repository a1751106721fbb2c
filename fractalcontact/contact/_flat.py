"""The flat block: two mating faces of the extent of the block, pressed together.

Its pressure under a unit force is solved once for each geometry and kept, since the bulk part of the closure
of every face of that extent needs it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from fractalcontact.contact._precondition import Preconditioner
from fractalcontact.contact._scaling import Body, serial_mean, serial_sum

Array = np.ndarray[Any, np.dtype[Any]]

GREATEST_ITERATIONS = 500
TARGET = 1e-14  # spread of the settlement over its mean at which the solve stops


@dataclass(frozen=True)
class FlatBlock:
    """Flat faces of a body: scaled pressures that add up to 1, the closure they need, and how well."""

    pressure: Array
    settlement: Array
    compliance: float
    iterations: int
    transforms: int
    residual: float


@lru_cache(maxsize=4)
def flat_block(body: Body) -> FlatBlock:
    """Solve K p = const, sum p = 1, by preconditioned conjugate gradients on the whole plane."""
    size = body.shape[0] * body.shape[1]
    p = np.full(body.shape, 1.0 / size)
    if body.periodic:
        return FlatBlock(p, np.zeros(body.shape), 0.0, 0, 0, 0.0)
    operator, precondition = body.operator(), Preconditioner(body, np.float64)
    u = operator.apply(p)
    t, product, best = np.zeros_like(p), 0.0, (np.inf, p, u)
    iteration = 0
    while iteration < GREATEST_ITERATIONS:
        closure = serial_sum(p * u) / serial_sum(p)
        g = u - closure
        error = float(np.abs(g).max()) / closure
        if error < best[0]:
            best = (error, p, u)
        if error <= TARGET or error > 1e3 * best[0]:
            break
        g -= serial_mean(g)
        z = precondition.whole(g)
        z -= serial_mean(z)
        previous, product = product, serial_sum(g * z)
        t = z + (product / previous) * t if previous > 0 else z
        r = operator.apply(t)
        step = serial_sum(g * t) / serial_sum(t * r)
        p, u = p - step * t, u - step * r
        iteration += 1
    error, p, _ = best
    p = p / serial_sum(p)
    u = operator.apply(p)
    compliance = serial_sum(p * u)
    error = float(np.abs(u - compliance).max()) / compliance
    return FlatBlock(p, u, compliance, iteration, operator.transforms, error)


@lru_cache(maxsize=16)
def uniform_compliance(body: Body) -> float:
    """Mean settlement under uniform pressure that adds up to 1."""
    if body.periodic:
        return 0.0
    return serial_mean(body.operator().apply(np.full(body.shape, 1.0 / (body.shape[0] * body.shape[1]))))
