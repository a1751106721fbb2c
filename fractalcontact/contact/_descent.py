"""Conjugate gradients on the contact set (first form)."""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.contact._operator import Operator
from fractalcontact.contact._optimality import residual
from fractalcontact.contact._problem import Problem, Solution

Array = np.ndarray[Any, np.dtype[Any]]
GREATEST_ITERATIONS = 4000


class Preconditioner:
    """Roughly the pressure that makes a settlement: |q|/2 on the unpadded plane."""

    def __init__(self, shape: tuple[int, int], spacing: tuple[float, float]) -> None:
        qy = fft.wavenumbers(shape[0], spacing[0])[:, None]
        qx = fft.wavenumbers(shape[1], spacing[1], real=True)[None, :]
        self.stiffness = np.hypot(qy, qx) / 2
        self.stiffness[0, 0] = min(self.stiffness[0, 1], self.stiffness[1, 0]) / 2
        self.shape = shape
        full = np.hypot(qy, fft.wavenumbers(shape[1], spacing[1])[None, :]) / 2
        self.diagonal = float(full.mean())

    def apply(self, plane: Array) -> Array:
        """Return the pressure of a settlement."""
        modes = fft.rfft2(plane)
        modes *= self.stiffness
        return fft.irfft2(modes, self.shape, overwrite=True)


def rescale(p: Array, total: float, cap: float) -> Array:
    """Scale the pressures below the cap until the sum is `total`."""
    for _ in range(60):
        s = float(p.sum())
        if abs(s - total) <= 4e-16 * total:
            break
        free = p < cap
        below = float(p[free].sum())
        if below <= 0:
            break
        p = np.minimum(np.where(free, p * ((total - (s - below)) / below), cap), cap)
        if not np.isfinite(cap):
            break
    return p


def solve(
    problem: Problem,
    operator: Operator,
    precondition: Preconditioner,
    start: Array | None,
    *,
    total: float | None,
    closure: float | None,
    tolerance: float,
) -> Solution:
    g0, cap = problem.gap, problem.cap
    before = operator.transforms
    spacing = problem.body.spacing
    p = np.zeros(g0.shape) if start is None else start.copy()
    if p.sum() <= 0:
        if total is not None:
            p[:] = 1.0
        else:
            p[:] = np.maximum(closure - g0, 0.0) * precondition.diagonal * 0.1
    if total is not None:
        p *= total / p.sum()
        p = rescale(np.minimum(p, cap), total, cap)
    t = np.zeros_like(p)
    g_old = np.zeros_like(p)
    G_old = 0.0
    last = np.inf
    best = np.inf
    stale = 0
    monotone = False
    reason = "iteration limit"
    for iteration in range(GREATEST_ITERATIONS):
        u = operator.apply(p)
        s = float(p.sum())
        w = float((p * (u + g0)).sum() / s) if total is not None and s > 0 else closure
        if total is not None and np.isfinite(cap):
            free = (p > 0) & (p < cap)
            if free.any():
                w = float((u + g0)[free].mean())
        gap = u + g0 - w
        error = residual(p, u, gap, spacing, cap)
        if error <= tolerance:
            reason = "converged"
            break
        if error < 0.9 * best:
            best, stale = error, 0
        else:
            stale += 1
            if stale > 200:
                reason = "stagnated"
                break
        objective = float(0.5 * (p * u).sum() + (p * g0).sum() - (0.0 if total is not None else w * s))
        rise = objective > last + 1e-14 * abs(last)
        last = objective
        c = ((p > 0) & (p < cap)) | ((p == 0) & (gap < 0)) | ((p >= cap) & (gap > 0))
        n = int(c.sum())
        g = np.where(c, gap, 0.0)
        if total is not None and n:
            g = np.where(c, g - g.sum() / n, 0.0)
        z = np.where(c, precondition.apply(g), 0.0)
        if total is not None and n:
            z = np.where(c, z - z.sum() / n, 0.0)
        G = float((z * g).sum())
        beta = max(0.0, (G - float((z * g_old).sum())) / G_old) if G_old > 0 and not rise else 0.0
        t = z + beta * np.where(c, t, 0.0)
        if total is not None and n:
            t = np.where(c, t - t.sum() / n, 0.0)
        gt = float((g * t).sum())
        if gt <= 0:
            t, gt = z, G
        r = operator.apply(t)
        tr = float((t * r).sum())
        step = gt / tr if tr > 0 else 0.0
        p = np.clip(p - step * t, 0.0, cap)
        if total is not None:
            p = rescale(p, total, cap)
        g_old, G_old = g, G
    gap = u + g0 - w
    return Solution(p, u, w, float(p.sum()), iteration, operator.transforms - before, error, reason)
