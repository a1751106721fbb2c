"""Coulomb friction under a given pressure, with the tangential displacements of both directions coupled.

At the nodes in contact the traction q = (q_x, q_y) minimises

    f(q) = q K q / 2 + q s0,    |q| <= mu p,    sum q = Q,                                         (1)

s0 the slip before the step. That is one implicit step of Coulomb's law: with the displacement delta of the
upper body, the multiplier of the sum, the gradient g = K q + s0 - delta is zero where the surfaces stick, and
-g, the slip in this step and before, is parallel to q where they slip. The minimum is unique.

Each iteration takes a projected step along the gradient, which finds the nodes that slip, and a step of
Newton's method for these (Bertsekas 1982): a sticking node is free, a slipping one moves along its circle,
whose curvature adds the multiplier |g|/|q|. The system is solved by preconditioned conjugate gradients.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base import fft

Array = np.ndarray[Any, np.dtype[Any]]

MAX_ITERATIONS = 60
MAX_INNER = 60
AT_BOUND = 1e-12  # relative distance from the circle at which a node is on it
FORCING = 0.2  # reduction of the residual of the Newton system in each iteration
STIFFNESS_FORCING = 0.001  # the same for the stiffness, whose error is its square
BIN, DECAY, FADE = 4, 0.65, 0.04  # of the extension, as in `_preconditioner`
STIFF = 1.0  # spacings over the modulus: a node of more curvature is left out of the extension
OWN = 1.1  # displacement of a node under unit traction on itself alone, roughly


class TangentialOperator:
    """Periodic bodies: displacement (2, ny, nx) from traction, on the nodes in contact.

    For a contact modulus of 1 the modes are 2/|k| along the wave vector k and 2/((1 - nu)|k|) across it.
    """

    def __init__(self, contact: Array, spacing: tuple[float, float], poisson: float) -> None:
        self.shape = (contact.shape[0], contact.shape[1])
        self.nodes, self.spacing = np.flatnonzero(contact), spacing
        ky = fft.wavenumbers(self.shape[0], spacing[0])[:, None]
        kx = fft.wavenumbers(self.shape[1], spacing[1], real=True)[None, :]
        k2 = kx**2 + ky**2
        k2[0, 0] = 1.0
        product = kx * ky
        for axis, n in enumerate(self.shape):  # the highest mode has no sign: no coupling there
            if n % 2 == 0:
                product[(slice(None), -1) if axis else (n // 2, slice(None))] = 0.0
        excess = poisson / (1 - poisson)
        k = np.sqrt(k2)
        self.symbol = (
            2 / k * (1 + excess * ky**2 / k2),
            2 / k * (1 + excess * kx**2 / k2),
            -2 / k * excess * product / k2,
        )
        determinant = self.symbol[0] * self.symbol[1] - self.symbol[2] ** 2
        self.inverse = (
            self.symbol[1] / determinant,
            self.symbol[0] / determinant,
            -self.symbol[2] / determinant,
        )
        for table in self.symbol:
            table[0, 0] = 0.0
        extent = float(np.sqrt(self.shape[0] * spacing[0] * self.shape[1] * spacing[1]))
        for table, mean in zip(self.inverse, (1 / extent, 1 / extent, 0.0), strict=True):
            table[0, 0] = mean
        self.transforms = 0

    def apply(self, q: Array) -> Array:
        """Return the displacement (2, nodes) under a traction (2, nodes), without its mean on the plane."""
        planes = np.zeros((2, self.shape[0] * self.shape[1]))
        planes[:, self.nodes] = q
        u = self.multiply(planes.reshape(2, *self.shape), self.symbol)
        return np.asarray(u.reshape(2, -1)[:, self.nodes])

    def multiply(self, planes: Array, symbol: tuple[Array, Array, Array]) -> Array:
        """Return planes (2, ny, nx) with their modes times a symbol (xx, yy, xy)."""
        self.transforms += 2
        x, y = (fft.rfft2(plane) for plane in planes)
        xx, yy, xy = symbol
        return np.stack([fft.irfft2(xx * x + xy * y, self.shape), fft.irfft2(xy * x + yy * y, self.shape)])


@dataclass
class CoulombState:
    """A step: traction, displacement of the surface, gradient (2, nodes), displacement of the upper body."""

    q: Array
    u: Array
    g: Array
    displacement: Array
    residual: float
    iterations: int
    converged: bool

    @property
    def slip(self) -> Array:
        """Slip since the start of the path."""
        return self.displacement[:, None] - self.u


def coulomb_step(
    operator: TangentialOperator,
    bound: Array,
    slip: Array,
    force: Array,
    start: Array,
    scale: float,
    tolerance: float,
) -> CoulombState:
    """Minimise (1) from `start`; the residual is the duality gap over `scale`."""
    q = project(start, bound, force)
    u = operator.apply(q)
    length = 1.0  # of the gradient step, adapted
    for iteration in range(MAX_ITERATIONS + 1):
        delta = multiplier(q, u + slip, bound)
        g = u + slip - delta[:, None]
        residual = float(np.sum(g * q) + np.sum(bound * np.hypot(*g))) / scale
        if residual <= tolerance or iteration == MAX_ITERATIONS:
            break
        q, u, length = gradient_step(operator, q, u, g, bound, force, length)
        delta = multiplier(q, u + slip, bound)
        q, u = newton_step(operator, q, u, slip, u + slip - delta[:, None], bound, force)
    return CoulombState(q, u, g, delta, residual, iteration, residual <= tolerance)


def multiplier(q: Array, v: Array, bound: Array) -> Array:
    """Return the displacement of the upper body: that of the sticking nodes, weighted by their bound."""
    free = np.hypot(*q) < bound * (1 - AT_BOUND)
    if free.any():
        return np.asarray((v[:, free] * bound[free]).sum(1) / bound[free].sum())
    return np.asarray(v.mean(1))


def project(y: Array, bound: Array, force: Array) -> Array:
    """Return the nearest traction with |q| <= bound and the sum `force`: clip(y + c), c after Newton."""
    c = np.zeros(2)
    value, q, jacobian = _clipped(y, c, bound, force)
    goal = 1e-15 * max(float(np.abs(force).max()), float(bound.sum()))
    for _ in range(100):
        miss = q.sum(1) - force
        if np.abs(miss).max() <= goal:
            break
        jacobian[0, 0] += 1e-12 * bound.size
        jacobian[1, 1] += 1e-12 * bound.size
        move = -np.linalg.solve(jacobian, miss)
        step = 1.0
        while True:
            trial = _clipped(y, c + step * move, bound, force)
            falls = trial[0] <= value + 1e-4 * step * float(miss @ move)
            # near the root rounding hides the fall of the potential, not that of its gradient
            if falls or np.hypot(*(trial[1].sum(1) - force)) < np.hypot(*miss) / 2 or step < 1e-10:
                break
            step /= 2
        if step < 1e-10:
            break
        c = c + step * move
        value, q, jacobian = trial
    return q


def _clipped(y: Array, c: Array, bound: Array, force: Array) -> tuple[float, Array, Array]:
    """Return the potential whose gradient is sum clip(y + c) - force, the clipped traction, the Jacobian."""
    z = y + c[:, None]
    size = np.hypot(*z)
    outside = size > bound
    factor = np.where(outside, bound / np.where(outside, size, 1.0), 1.0)
    potential = np.where(outside, bound * size - bound**2 / 2, size**2 / 2).sum() - float(c @ force)
    unit = z / np.where(size > 0, size, 1.0) * outside
    jacobian = np.diag([factor.sum()] * 2) - _products(factor * unit, unit)
    return float(potential), z * factor, jacobian


def _products(a: Array, b: Array) -> Array:
    """Return a b^T, summed by numpy: the bits of a library product may depend on the number of threads."""
    return np.array([[np.sum(row * column) for column in b] for row in a])


def gradient_step(
    operator: TangentialOperator,
    q: Array,
    u: Array,
    g: Array,
    bound: Array,
    force: Array,
    length: float,
) -> tuple[Array, Array, float]:
    """Take a projected step along -g with the length that minimises (1) along it, if it falls."""
    t = project(q - length * g, bound, force) - q
    slope = float(np.sum(t * g))
    if not slope < 0:
        return q, u, length
    ut = operator.apply(t)
    curvature = float(np.sum(t * ut))
    best = -slope / curvature if curvature > 0 else 1.0
    share = min(best, 1.0)
    return q + share * t, u + share * ut, length * min(max(best, 0.2), 4.0)


def newton_step(
    operator: TangentialOperator, q: Array, u: Array, slip: Array, g: Array, bound: Array, force: Array
) -> tuple[Array, Array]:
    """Take a Newton step on the sticking nodes and along the circles of the slipping ones."""
    unit, curvature = face(q, g, bound)
    preconditioner = TangentialPreconditioner(operator, unit, curvature)
    tangent = TangentSpace(unit)
    d = conjugate_gradients(operator, preconditioner, tangent, curvature, -g, FORCING)
    value = float(np.sum(q * (u / 2 + slip)))
    step = 1.0
    for _ in range(6):
        trial = project(q + step * d, bound, force)
        ut = operator.apply(trial)
        if float(np.sum(trial * (ut / 2 + slip))) <= value + 1e-15 * abs(value):
            return trial, ut
        step /= 4
    return q, u


def face(q: Array, g: Array, bound: Array) -> tuple[Array, Array]:
    """Return the direction of the traction at the slipping nodes, zero at the others, and the curvature."""
    size = np.hypot(*q)
    outward = -np.sum(g * q, axis=0)
    slips = (size >= bound * (1 - AT_BOUND)) & (outward >= 0)
    size = np.where(size > 0, size, 1.0)
    return np.where(slips, q / size, 0.0), np.where(slips, outward / size**2, 0.0)


def stiffness(operator: TangentialOperator, state: CoulombState, bound: Array, unit: Array) -> float:
    """Return the increment of force along `unit` over that of displacement, scaled: without force across."""
    direction, curvature = face(state.q, state.g, bound)
    preconditioner = TangentialPreconditioner(operator, direction, curvature)
    tangent = TangentSpace(direction, zero_sum=False)
    forces = np.empty((2, 2))
    for axis in (0, 1):
        right = np.zeros_like(state.q)
        right[axis] = 1.0
        d = conjugate_gradients(operator, preconditioner, tangent, curvature, right, STIFFNESS_FORCING)
        forces[:, axis] = d.sum(1)
    return float(1 / (unit @ np.linalg.solve((forces + forces.T) / 2, unit)))


class TangentialPreconditioner:
    """The inverse of the operator between smooth extensions of the displacement (see `_preconditioner`).

    Each component has its set of free nodes. Outside of it the displacement is extended by its mean over the
    set, weighted by a Poisson kernel. Slipping nodes that curvature makes stiff are left out: they have the
    inverse of their own stiffness. Without that the iterations were five times as many.
    """

    def __init__(self, operator: TangentialOperator, unit: Array, curvature: Array) -> None:
        self.operator = operator
        free = (unit**2 < 0.5) & (curvature < STIFF)
        self.diagonal = np.where(curvature < STIFF, 0.0, 1 / (curvature + OWN))
        shape, self.nodes = operator.shape, operator.nodes
        self.edges = tuple(1 << (max(1, min(BIN, n // 8)).bit_length() - 1) for n in shape)
        self.padded = tuple(-(-n // edge) * edge for n, edge in zip(shape, self.edges, strict=True))
        self.bins = tuple(n // edge for n, edge in zip(self.padded, self.edges, strict=True))
        spacing = (operator.spacing[0] * self.edges[0], operator.spacing[1] * self.edges[1])
        k = np.hypot(
            fft.wavenumbers(self.bins[0], spacing[0])[:, None],
            fft.wavenumbers(self.bins[1], spacing[1], real=True)[None, :],
        )
        self.kernel = np.exp(-DECAY * np.sqrt(spacing[0] * spacing[1]) * k)
        self.free = np.zeros((2, shape[0] * shape[1]), dtype=bool)
        self.free[:, self.nodes] = free
        self.free = self.free.reshape(2, *shape)
        counts = [self.smooth(self.sum_bins(plane.astype(np.float64))) for plane in self.free]
        cells = self.edges[0] * self.edges[1]
        self.weights = [1 / (np.maximum(count, 0) + FADE * cells) for count in counts]

    def sum_bins(self, plane: Array) -> Array:
        """Sum a plane over the bins."""
        padded = np.zeros(self.padded)
        padded[: plane.shape[0], : plane.shape[1]] = plane
        blocks = padded.reshape(self.bins[0], self.edges[0], self.bins[1], self.edges[1])
        return np.asarray(blocks.sum(axis=(1, 3)))

    def spread(self, bins: Array) -> Array:
        """Give every node the value of its bin."""
        wide = np.repeat(np.repeat(bins, self.edges[0], axis=0), self.edges[1], axis=1)
        return np.asarray(wide[: self.operator.shape[0], : self.operator.shape[1]])

    def smooth(self, bins: Array) -> Array:
        """Apply the Poisson kernel."""
        return fft.irfft2(fft.rfft2(bins) * self.kernel, self.bins)

    def apply(self, r: Array) -> Array:
        """Return nearly the traction (2, nodes) that causes the displacement r."""
        planes = np.zeros((2, self.operator.shape[0] * self.operator.shape[1]))
        planes[:, self.nodes] = r
        planes = planes.reshape(2, *self.operator.shape)
        wide = []
        for plane, free, weight in zip(planes, self.free, self.weights, strict=True):
            inside = np.where(free, plane, 0.0)
            outside = self.spread(weight * self.smooth(self.sum_bins(inside)))
            wide.append(np.where(free, plane, outside))
        q = self.operator.multiply(np.stack(wide), self.operator.inverse)
        out = []
        for plane, free, weight in zip(q, self.free, self.weights, strict=True):
            back = self.spread(self.smooth(weight * self.sum_bins(np.where(free, 0.0, plane))))
            out.append(np.where(free, plane + back, 0.0).reshape(-1)[self.nodes])
        return np.asarray(np.stack(out) + self.diagonal * r)


class TangentSpace:
    """Changes of traction normal to `unit` at the slipping nodes; their sum is zero with `zero_sum`."""

    def __init__(self, unit: Array, *, zero_sum: bool = True) -> None:
        self.unit = unit
        gram = np.eye(2) * unit.shape[1] - _products(unit, unit)
        self.inverse = np.linalg.pinv(gram) if zero_sum else np.zeros((2, 2))

    def project(self, v: Array) -> Array:
        """Return the nearest change in the space."""
        v = v - self.unit * np.sum(self.unit * v, axis=0)
        c = (self.inverse @ v.sum(1))[:, None]
        return np.asarray(v - (c - self.unit * np.sum(self.unit * c, axis=0)))


def conjugate_gradients(
    operator: TangentialOperator,
    preconditioner: TangentialPreconditioner,
    tangent: TangentSpace,
    curvature: Array,
    right: Array,
    forcing: float,
) -> Array:
    """Solve (K + curvature) d = right in the tangent space, loosely."""
    d = np.zeros_like(right)
    r = tangent.project(right)
    z = tangent.project(preconditioner.apply(r))
    t, rz = z.copy(), float(np.sum(r * z))
    goal = forcing**2 * rz
    for _ in range(MAX_INNER):
        if not rz > goal or rz <= 0:
            break
        ht = tangent.project(operator.apply(t) + curvature * t)
        tau = rz / float(np.sum(t * ht))
        d += tau * t
        r -= tau * ht
        z = tangent.project(preconditioner.apply(r))
        rz, old = float(np.sum(r * z)), rz
        t = z + rz / old * t
    return d
