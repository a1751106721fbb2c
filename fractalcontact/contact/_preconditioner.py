"""Approximate inverse of the elastic operator on a set of nodes.

A wave of pressure on a half-space of modulus 1 gives 2/|q| times as much displacement (`_operator`), so that
the inverse is A = |q|/2. On a set I of nodes, without pressure on the others, O, the exact inverse is the
Schur complement S:

    S = A_II - A_IO A_OO^-1 A_OI,      g' S g = min x' A x over all x that are g on the set.

At the minimum no node of O bears a pressure. Taking zero outside (the plain |q| preconditioner) makes a jump
at every edge of the set, which costs most of the iterations of a rough contact. `ExtensionPreconditioner`
extends the displacement smoothly: outside it takes the mean of the displacement on the set, weighted by a
kernel that falls with the cube of the distance as the kernel of |q| does (a Poisson kernel, modes
exp(-a |q|)), and fading far from the set:

    E g = g on the set,     E g = G g / (G 1 + FADE) outside.

Any extension gives a symmetric positive preconditioner that is no smaller than the exact inverse, so that
conjugate gradients are safe with it. G need not be exact: it is applied to bins of some four by four nodes,
which costs a sixteenth of a transform.

It is in single precision, also for a solver in double precision, unless the stiffnesses of the modes are too
far apart (`precision_for`): an approximate inverse needs no more digits, and its transforms take half the
time.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.base.numbers import Array
from fractalcontact.base.resources import in_bands
from fractalcontact.contact._operator import KEPT, SINGLE, ModesMemory, PairSum, PeriodicOperator
from fractalcontact.contact._problem import Body

# The numbers here and of `bin_edge` and `padded_plane` are measured by the transforms of solutions at three
# loads on rough surfaces of 128 x 128 nodes (tolerance 1e-8), periodic and free, over those with these values
# (26.7 and 19.5).
DECAY = 0.65  # decay length of the kernel, in bins; .4: 1.09 1.06, 1: .96 .95
FADE = 0.04  # far from the set; .01: 1.19 1.24, .16: .93 .97


@dataclass
class FreeSet:
    """The free set I_c on the plane of a preconditioner, and sums over its bins.

    The solver owns it and writes it in the pass that selects the set (`_kernels.select_free_set`).
    """

    mask: Array  # of the plane: the free nodes
    bin_sums: Array  # of the bins: the gap on the set, summed
    bin_counts: Array  # of the bins: the number of free nodes
    weight: Array | None = None  # of the bins, see `ExtensionPreconditioner`; None where the set has changed

    @classmethod
    def empty(cls, plane: tuple[int, int], bin_shape: tuple[int, int], dtype: Any) -> FreeSet:
        """Return a set without nodes."""
        return cls(np.zeros(plane, np.bool_), np.zeros(bin_shape, dtype), np.zeros(bin_shape, dtype))


class ExtensionPreconditioner:
    """M = E' A E on the plane of a body: extension E, A = |q|/2, and the transpose of the extension."""

    def __init__(self, body: Body, memory: ModesMemory, dtype: Any) -> None:
        (self.bin_rows, self.bin_columns), self.plane_shape, self.bin_shape = bin_layout(body)
        edge = (self.bin_rows * body.spacing[0], self.bin_columns * body.spacing[1])
        tables = kept_bin_tables if body.is_small else bin_tables
        self.poisson_kernel, compliance = tables(self.bin_shape, edge, np.dtype(dtype).char)
        self.compliance = compliance if body.periodic else None
        self.bins = fft.PlaneTransform(self.bin_shape)
        # the part of the compliance of a node, 1.11 spacings, that the bins leave out. Half a spacing is a
        # choice: on random and rough sets .68 to 1.06 were exact; .25, .85 and 1.25 took .98 to .99 of the
        # transforms
        self.self_compliance = float(np.sqrt(body.spacing[0] * body.spacing[1])) / 2
        extent = np.sqrt(self.plane_shape[0] * body.spacing[0] * self.plane_shape[1] * body.spacing[1])
        # that of a flat block under a rigid flat; a periodic body has no stiffness for its mean
        self.inverse = PeriodicOperator(self.plane_shape, body.spacing, memory, 1.0 / float(extent))
        self.dtype = dtype
        self.transforms = 0

    def smooth(self, bins: Array) -> Array:
        """Apply the Poisson kernel G to the bins."""
        modes = self.bins.forward(bins)
        modes *= self.poisson_kernel
        return self.bins.backward(modes)

    def apply(self, x: Array, free_set: FreeSet) -> tuple[Array, Array]:
        """Return the pressure for the gap x on a set, whose sums over the bins are those of x.

        Returns the plane (x is overwritten) and, over the bins, what is to be added to it on the set: the
        transpose of the extension.
        """
        from fractalcontact.contact import _kernels  # here: options are validated without the compiler

        self.transforms += 1
        weight = free_set.weight
        if weight is None:
            bin_nodes = self.dtype(self.bin_rows * self.bin_columns)
            weight = 1 / (np.maximum(self.smooth(free_set.bin_counts), 0) + self.dtype(FADE) * bin_nodes)
            free_set.weight = weight
        extension = self.smooth(free_set.bin_sums)
        extension *= weight
        size = self.plane_shape[0] * self.plane_shape[1]
        grid = (self.bin_rows, self.bin_columns, free_set.mask)
        in_bands(_kernels.fill_outside, self.bin_shape[0], size, *grid, extension, x)
        pressure = self.inverse.apply(x)
        outside = extension  # the array is not needed any more
        in_bands(_kernels.sum_outside, self.bin_shape[0], size, *grid, pressure, outside)
        outside *= weight
        return pressure, self.smooth(outside)

    def summed_displacement(self, free_set: FreeSet) -> float | None:
        """Return roughly the summed displacement under unit pressure on the set; None for a free body.

        The elastic operator of a free body has its mean displacement, and needs no correction for it.
        """
        if self.compliance is None:
            return None
        counts = free_set.bin_counts
        modes = self.bins.forward(counts)
        modes *= self.compliance
        displacement = self.bins.backward(modes) / (self.bin_rows * self.bin_columns)
        count = float(counts.sum())
        size = self.plane_shape[0] * self.plane_shape[1]
        # of nodes at random it is in proportion to the share of the plane that is not in the set
        own = self.self_compliance * count * (1.0 - count / size)
        return float(np.sum(np.sum(counts * displacement, axis=1), dtype=np.float64)) + own


class NodePreconditioner:
    """|q|/2 between the nodes of a set, without extension: contacts this small are nearly separate."""

    def __init__(self, table: Array, iy: Array, ix: Array) -> None:
        self.pairs = PairSum(table, iy, ix)
        self.plane_shape = (1, int(iy.size))
        self.bin_rows, self.bin_columns, self.bin_shape = 1, int(iy.size), (1, 1)
        self.dtype, self.transforms = SINGLE, 0

    def apply(self, x: Array, free_set: FreeSet) -> tuple[Array, Array]:
        """Return the pressure for the gap x on a set; nothing is added over the bins."""
        pressure = self.pairs.sum_at(x.astype(np.float64), np.flatnonzero(free_set.mask))
        return pressure.astype(self.dtype), np.zeros(self.bin_shape, self.dtype)

    def summed_displacement(self, free_set: FreeSet) -> float | None:  # noqa: ARG002
        """Return None: the mean of a free body needs no correction."""
        return None


def precision_for(
    body: Body,
    dtype: Any,
    *,
    # 16384 x 16384 nodes have 1.2e4; 42 x 52 nodes of spacings 1 to 1000, 2.6e4, did not converge in single
    largest: float = 2e4,
) -> Any:
    """Return the type of the preconditioner: single where the softest mode stands out of its rounding.

    Single precision rounds by 1e-7 of the stiffest mode. Where that is `largest` times as stiff as the
    softest or more, the type is `dtype`.
    """
    (ny, nx), (dy, dx) = body.shape, body.spacing
    ratio = max(ny * dy, nx * dx) / 2 * float(np.hypot(1 / dy, 1 / dx))
    return SINGLE if ratio < largest else dtype


def bin_tables(bin_shape: tuple[int, int], edge: tuple[float, float], dtype: str) -> tuple[Array, Array]:
    """Return the Poisson kernel over the modes of the bins, and their compliance, 2/|q| but for the mean."""
    q = np.hypot(
        fft.wavenumbers(bin_shape[0], edge[0])[:, None],
        fft.wavenumbers(bin_shape[1], edge[1], real=True)[None, :],
    )
    poisson_kernel = np.exp(-DECAY * np.sqrt(edge[0] * edge[1]) * q).astype(dtype)
    q[0, 0] = np.inf
    return poisson_kernel, (2.0 / q).astype(dtype)


kept_bin_tables = lru_cache(maxsize=KEPT)(bin_tables)
Preconditioner = ExtensionPreconditioner | NodePreconditioner


def stiffness_table(body: Body) -> Array:
    """Return the coefficients of |q|/2 in space, at offsets (i, j) up to the shape of the body."""
    ny, nx = body.shape
    plane = (2 * ny, 2 * nx)
    impulse = np.zeros(plane)
    impulse[0, 0] = 1.0
    extent = float(np.sqrt(ny * body.spacing[0] * nx * body.spacing[1]))
    inverse = PeriodicOperator(plane, body.spacing, mean=1.0 / extent)
    return np.ascontiguousarray(inverse.apply(impulse)[:ny, :nx])


def bin_layout(body: Body) -> tuple[tuple[int, int], tuple[int, int], tuple[int, int]]:
    """Return the nodes along the edges of a bin, the nodes of the plane in bins, and the number of bins."""
    edges = bin_edge(body, 0), bin_edge(body, 1)
    ny, nx = body.shape
    if not body.periodic:
        ny, nx = padded_plane(ny, edges[0]), padded_plane(nx, edges[1])
    return edges, (ny, nx), (-(-ny // edges[0]), -(-nx // edges[1]))


def bin_edge(
    body: Body,
    axis: int,
    *,
    nodes: int = 4,  # 2 (4 times the bins): .96 .93, 8: 1.06 1.08
) -> int:
    """Return the nodes along the edge of a bin: a power of two, near square, and not too few bins."""
    mean = float(np.sqrt(body.spacing[0] * body.spacing[1]))
    # at least 8 bins along an axis; on 40 surfaces of 8 x 8 to 48 x 48 nodes 4 took 3 % more transforms, 16
    # 3 % fewer, with four times the bins
    wanted = min(2 * nodes, round(nodes * mean / body.spacing[axis]), body.shape[axis] // 8)
    return 1 << (max(1, wanted).bit_length() - 1)


def padded_plane(
    n: int,
    edge: int,
    *,
    margin: int = 8,  # 4 and 16: 1
) -> int:
    """Return the length of a free body's plane: a margin of n / margin, whole bins, fast transforms."""
    bins = -(-(n + max(n // margin, 2 * edge)) // edge)
    while fft.fast_length(bins * edge) != bins * edge:
        bins += 1
    return bins * edge
