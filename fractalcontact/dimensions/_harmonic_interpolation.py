"""Harmonic interpolation of the missing points of a surface, after a plane is removed, and its transpose.

The equations of large gaps are solved by conjugate gradients, with a multigrid cycle on aggregates of two by
two points as the preconditioner (Braess 1995, Computing 55): the work is proportional to the missing points,
that of an elimination grows faster. Where spacings differ, or few points are missing, they are eliminated.
"""

from __future__ import annotations

from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[Any]]

_DIRECT = 1 << 15  # missing points up to which elimination is as fast
_SQUARE = 1.5  # ratio of the spacings up to which aggregates of two by two points converge fast
_TOLERANCE = 1e-9  # of the residual over that of zero heights
_COUPLED = 0.5  # share of the diagonal in couplings below which a coarser level is of no use
_FEW = 8  # unknowns of the coarsest level
_MOST_STEPS = 200


class Filling:
    """Removal of a plane and harmonic interpolation over the missing points, and its transpose.

    Parameters
    ----------
    observed : ndarray of bool, shape (ny, nx)
    spacing : (dy, dx)
        A neighbour has the weight of the inverse square of its distance.
    """

    def __init__(self, observed: Array, spacing: tuple[float, float]) -> None:
        self.observed = observed
        self._plane = _orthonormal_plane(observed)
        self._outer = _to_observed(observed, spacing)
        missing = self._outer.shape[0]
        is_direct = missing <= _DIRECT or max(spacing) > _SQUARE * min(spacing)
        self._solve: Any = None
        if missing:
            self._solve = _Elimination(observed, spacing) if is_direct else _Multigrid(observed, spacing)

    def __call__(self, values: Array) -> Array:
        """Fill a surface from its observed points: shape (points,) to (ny, nx)."""
        values = self._without_plane(values)
        heights = np.zeros(self.observed.shape)
        heights[self.observed] = values
        if self._solve is not None:
            heights[~self.observed] = self._solve(self._outer @ values)
        return heights

    def transpose(self, heights: Array) -> Array:
        """Apply the transpose: shape (ny, nx) to (points,)."""
        values = heights[self.observed]
        if self._solve is not None:
            values = values + self._outer.T @ self._solve(heights[~self.observed])
        return self._without_plane(values)

    def _without_plane(self, values: Array) -> Array:
        """Subtract the plane of least squares; `einsum` starts no threads of a linear algebra library."""
        rest = values.copy()
        for row in self._plane:
            rest -= row * np.einsum("i,i", values, row)
        return rest


def _orthonormal_plane(observed: Array) -> Array:
    """Return orthonormal functions that span the planes over the observed points: (3, points)."""
    y, x = (np.linspace(-1.0, 1.0, n) for n in observed.shape)
    rows = np.stack([np.broadcast_to(line, observed.shape)[observed] for line in (1.0, x, y[:, None])])
    for _ in range(2):  # twice is enough (Kahan)
        for k, row in enumerate(rows):
            for other in rows[:k]:
                row -= other * np.einsum("i,i", row, other)
            norm = float(np.sqrt(np.einsum("i,i", row, row)))
            row /= norm if norm > 0.0 else 1.0
    return rows


def _pairs(observed: Array, spacing: tuple[float, float]) -> Any:
    """Yield weight, the missing points of an axis and sense that have a neighbour, and the neighbours."""
    closest = min(spacing)
    index = np.flatnonzero(~observed)
    y, x = np.divmod(index, observed.shape[1])
    for step, place, size, distance in (
        (observed.shape[1], y, observed.shape[0], spacing[0]),
        (1, x, observed.shape[1], spacing[1]),
    ):
        for sense in (-1, 1):
            has = np.flatnonzero((place + sense >= 0) & (place + sense < size))
            yield (closest / distance) ** 2, has, index[has] + sense * step


def _to_observed(observed: Array, spacing: tuple[float, float]) -> Any:
    """Return the weights of the observed neighbours of the missing points: (missing, points)."""
    from scipy.sparse import csr_array

    flat = observed.ravel()
    number = np.cumsum(flat, dtype=np.int32) - 1
    rows, columns, weights = [], [], []
    for weight, has, neighbour in _pairs(observed, spacing):
        is_outer = flat[neighbour]
        rows.append(has[is_outer])
        columns.append(number[neighbour[is_outer]])
        weights.append(np.full(rows[-1].size, weight))
    points = int(number[-1]) + 1
    entries = np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))
    return csr_array(entries, shape=(flat.size - points, points))


def _diagonal(observed: Array, spacing: tuple[float, float]) -> Array:
    """Return the sum of the weights of the neighbours of each missing point."""
    diagonal = np.zeros(int((~observed).sum()))
    for weight, has, _ in _pairs(observed, spacing):
        diagonal[has] += weight
    return diagonal


class _Elimination:
    """The graph Laplacian of the missing points, factored."""

    def __init__(self, observed: Array, spacing: tuple[float, float]) -> None:
        from scipy.sparse import csc_array
        from scipy.sparse.linalg import splu

        flat = observed.ravel()
        number = np.cumsum(~flat) - 1
        diagonal = _diagonal(observed, spacing)
        rows, columns, weights = [np.arange(diagonal.size)], [np.arange(diagonal.size)], [diagonal]
        for weight, has, neighbour in _pairs(observed, spacing):
            is_inner = ~flat[neighbour]
            rows.append(has[is_inner])
            columns.append(number[neighbour[is_inner]])
            weights.append(np.full(rows[-1].size, -weight))
        entries = np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))
        matrix = csc_array(entries, shape=(diagonal.size, diagonal.size))
        # a Laplacian is symmetric and positive: ordering its own graph, without pivots, is fastest
        order = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
        self._factors = splu(matrix, **order)

    def __call__(self, right: Array) -> Array:
        return np.asarray(self._factors.solve(right))


class _Multigrid:
    """The graph Laplacian of the missing points, on levels of aggregates of two by two.

    The unknowns of all levels are numbered together from 1; 0 stands for no neighbour.
    """

    def __init__(self, observed: Array, spacing: tuple[float, float]) -> None:
        places = np.nonzero(~observed)
        shape: tuple[int, ...] = observed.shape
        weights = [(min(spacing) / d) ** 2 for d in spacing]
        number = _numbered(places, shape, 1)
        after, before = _neighbours(number, places)
        couplings = [np.where(a > 0, w, 0.0) for a, w in zip(after, weights, strict=True)]
        diagonal = _diagonal(observed, spacing)
        starts, levels = [1, 1 + diagonal.size], []
        while True:
            part: list[Array] = [*after, *before, *couplings, diagonal]
            total = 2.0 * float(sum(c.sum() for c in couplings))
            if diagonal.size <= _FEW or total < _COUPLED * float(diagonal.sum()):
                levels.append([*part, np.zeros(diagonal.size, dtype=np.int32)])
                break
            shape = tuple((n + 1) // 2 for n in shape)
            is_aggregate = np.zeros(shape, dtype=bool)
            halves = tuple(p // 2 for p in places)
            is_aggregate[halves] = True
            places = np.nonzero(is_aggregate)
            first = starts[-1]
            number = _numbered(places, shape, first)
            aggregate = number[tuple(h + 1 for h in halves)]
            levels.append([*part, aggregate])
            size = places[0].size
            own = aggregate - first
            coarse: Array = np.bincount(own, diagonal, size)
            crossing = []
            for neighbour, coupling in zip(after, couplings, strict=True):
                there = aggregate[np.maximum(neighbour - starts[-2], 0)]
                is_inside = (neighbour > 0) & (there == aggregate)
                coarse -= 2.0 * np.bincount(own[is_inside], coupling[is_inside], size)
                is_crossing = (neighbour > 0) & (there != aggregate)
                crossing.append(np.bincount(own[is_crossing], coupling[is_crossing], size))
            after, before = _neighbours(number, places)
            couplings, diagonal = crossing, coarse
            starts.append(first + size)
        none = [0, 0, 0, 0, 0.0, 0.0, 1.0, 0]
        self._levels = tuple(
            np.concatenate([np.array([first], dtype=part[0].dtype), *part])
            for first, *part in zip(none, *levels, strict=True)
        )
        self._starts = np.array(starts)

    def __call__(self, right: Array) -> Array:
        from fractalcontact.dimensions._kernels import aggregate_gradients

        return aggregate_gradients(right, self._starts, self._levels, _TOLERANCE, _MOST_STEPS)


def _numbered(places: tuple[Array, ...], shape: tuple[int, ...], first: int) -> Array:
    """Number places of a lattice from `first`; 0 elsewhere, and in a frame of one point."""
    number = np.zeros(tuple(n + 2 for n in shape), dtype=np.int32)
    number[tuple(p + 1 for p in places)] = np.arange(first, first + places[0].size, dtype=np.int32)
    return number


def _neighbours(number: Array, places: tuple[Array, ...]) -> tuple[list[Array], list[Array]]:
    """Return the numbers of the next and of the previous place along y and x."""
    y, x = (p + 1 for p in places)
    return [number[y + 1, x], number[y, x + 1]], [number[y - 1, x], number[y, x - 1]]
