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
# the same where few of the missing points have an observed neighbour: the exponent then changes by at most
# 0.02 standard errors; beside many small gaps and for H = 0.95 it would change by 0.18
_ROUGH, _SOLID = 1e-5, 0.05
_CELL = 4  # points along an edge of the cells of a large gap
_DEPTH = 4  # cells of missing points around those that count as deep
_MANY = 1 << 16  # deep points from which on they are interpolated from cells
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
        self._plane = _Plane(observed)
        deep = _Deep(observed, spacing)
        self._deep = deep if deep.number > _MANY else None
        self._near = _Harmonic(observed if self._deep is None else observed | deep.points, spacing)

    def __call__(self, heights: Array) -> Array:
        """Fill a surface from its observed points; what stands at the others does not count."""
        filled = np.where(self.observed, heights, 0.0)
        self._plane.remove(filled)
        if self._deep is not None:
            self._deep.fill(filled)
        self._near.fill(filled)
        return filled

    def transpose(self, heights: Array) -> Array:
        """Apply the transpose: zero where no point was observed."""
        values = heights.copy()
        self._near.collect(values)
        if self._deep is not None:
            self._deep.collect(values)
        self._plane.remove(values)
        return values


class _Harmonic:
    """Harmonic interpolation over the missing points, in place, and its transpose."""

    def __init__(self, observed: Array, spacing: tuple[float, float]) -> None:
        self._missing = ~observed
        self._outer = _to_observed(observed, spacing)
        missing = self._outer.shape[0]
        is_direct = missing <= _DIRECT or max(spacing) > _SQUARE * min(spacing)
        self._solve: Any = None
        if missing and is_direct:
            self._solve = _Elimination(observed, spacing)
        elif missing:
            edge = np.count_nonzero(np.diff(self._outer.indptr))
            self._solve = _Multigrid(observed, spacing, _TOLERANCE if edge > _SOLID * missing else _ROUGH)

    def fill(self, heights: Array) -> None:
        """Interpolate; the heights of the missing points are zero before."""
        if self._solve is not None:
            heights[self._missing] = self._solve(self._outer @ heights.ravel())

    def collect(self, heights: Array) -> None:
        """Apply the transpose, which leaves zero at the missing points."""
        if self._solve is not None:
            solved = self._solve(heights[self._missing])
            heights[self._missing] = 0.0
            heights.ravel()[:] += self._outer.T @ solved


class _Deep:
    """Interpolation over the missing points far from all observed ones, on cells of four by four points.

    A harmonic surface is smooth there: it is that of the means of cells, between their centres linear. So a
    large gap has an eighth of the unknowns.

    Attributes
    ----------
    points : ndarray of bool
    number : int
    """

    def __init__(self, observed: Array, spacing: tuple[float, float]) -> None:
        from scipy.ndimage import minimum_filter

        self._observed = observed
        self._starts = [np.arange(0, n, _CELL) for n in observed.shape]
        self._count = self._sums(observed.astype(np.int32))
        cells = minimum_filter(self._count == 0, 2 * _DEPTH + 1, mode="nearest")
        self.points = cells.repeat(_CELL, axis=0).repeat(_CELL, axis=1)[
            : observed.shape[0], : observed.shape[1]
        ]
        self.number = int(np.count_nonzero(self.points))
        if self.number <= _MANY:
            return
        self._cells = _Harmonic(self._count > 0, spacing)
        self._box = tuple(
            slice(*np.flatnonzero(self.points.any(axis=1 - axis))[[0, -1]] + [0, 1]) for axis in (0, 1)
        )
        self._inside = self.points[self._box]
        self._weights = [_linear(n)[box] for n, box in zip(observed.shape, self._box, strict=True)]

    def fill(self, heights: Array) -> None:
        """Interpolate at the deep points; the heights of all missing points are zero before."""
        cells = self._sums(heights) / np.maximum(self._count, 1)
        self._cells.fill(cells)
        along_y, along_x = self._weights
        heights[self._box] += self._inside * (along_x @ (along_y @ cells).T).T

    def collect(self, heights: Array) -> None:
        """Apply the transpose, which leaves zero at the deep points."""
        along_y, along_x = self._weights
        cells = along_y.T @ (along_x.T @ (self._inside * heights[self._box]).T).T
        self._cells.collect(cells)
        cells /= np.maximum(self._count, 1)
        heights[self.points] = 0.0
        ny, nx = heights.shape
        heights += self._observed * cells.repeat(_CELL, axis=0).repeat(_CELL, axis=1)[:ny, :nx]

    def _sums(self, values: Array) -> Array:
        """Sum over the points of each cell."""
        return np.add.reduceat(np.add.reduceat(values, self._starts[0], axis=0), self._starts[1], axis=1)


def _linear(n: int) -> Any:
    """Return the weights of the cells along an axis of n points in linear interpolation: (points, cells)."""
    from scipy.sparse import csr_array

    first = np.arange(0, n, _CELL)
    centre = 0.5 * (first + np.minimum(first + _CELL, n) - 1.0)
    point = np.arange(n)
    place = np.interp(point, centre, np.arange(centre.size))
    below = np.minimum(place.astype(int), centre.size - 2)
    share = place - below
    entries = np.concatenate([1.0 - share, share]), (np.tile(point, 2), np.concatenate([below, below + 1]))
    return csr_array(entries, shape=(n, centre.size))


class _Plane:
    """The plane of least squares through the observed points, by sums over rows and columns.

    A plane is (1, y, x) with y and x from their mean over the observed points.
    """

    def __init__(self, observed: Array) -> None:
        rows, columns = observed.sum(axis=1), observed.sum(axis=0)
        self._observed = observed
        self._y, self._x = (np.linspace(-1.0, 1.0, n) for n in observed.shape)
        self._y -= np.sum(rows * self._y) / rows.sum()
        self._x -= np.sum(columns * self._x) / rows.sum()
        across = np.sum(self._y * (observed @ self._x))
        gram = [
            [rows.sum(), 0.0, 0.0],
            [0.0, np.sum(rows * self._y**2), across],
            [0.0, across, np.sum(columns * self._x**2)],
        ]
        self._inverse = np.linalg.pinv(np.array(gram, dtype=float))

    def remove(self, heights: Array) -> None:
        """Subtract the plane from heights that are zero where nothing was observed."""
        along_y, along_x = heights.sum(axis=1), heights.sum(axis=0)
        level, slope_y, slope_x = self._inverse @ [
            along_y.sum(),
            np.sum(along_y * self._y),
            np.sum(along_x * self._x),
        ]
        heights -= (level + slope_y * self._y)[:, None]
        heights -= slope_x * self._x
        heights *= self._observed


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
    """Return the weights of the observed neighbours of the missing points: (missing, ny * nx)."""
    from scipy.sparse import csr_array

    flat = observed.ravel()
    rows, columns, weights = [], [], []
    for weight, has, neighbour in _pairs(observed, spacing):
        is_outer = flat[neighbour]
        rows.append(has[is_outer])
        columns.append(neighbour[is_outer])
        weights.append(np.full(rows[-1].size, weight))
    entries = np.concatenate(weights), (np.concatenate(rows), np.concatenate(columns))
    return csr_array(entries, shape=(flat.size - int(np.count_nonzero(flat)), flat.size))


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

    def __init__(self, observed: Array, spacing: tuple[float, float], tolerance: float) -> None:
        self._tolerance = tolerance
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

        return aggregate_gradients(right, self._starts, self._levels, self._tolerance, _MOST_STEPS)


def _numbered(places: tuple[Array, ...], shape: tuple[int, ...], first: int) -> Array:
    """Number places of a lattice from `first`; 0 elsewhere, and in a frame of one point."""
    number = np.zeros(tuple(n + 2 for n in shape), dtype=np.int32)
    number[tuple(p + 1 for p in places)] = np.arange(first, first + places[0].size, dtype=np.int32)
    return number


def _neighbours(number: Array, places: tuple[Array, ...]) -> tuple[list[Array], list[Array]]:
    """Return the numbers of the next and of the previous place along y and x."""
    y, x = (p + 1 for p in places)
    return [number[y + 1, x], number[y, x + 1]], [number[y - 1, x], number[y, x - 1]]
