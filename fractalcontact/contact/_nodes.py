"""The fast method for few nodes: a contact of up to some thousand candidates, without any transform.

A rough free body that is lightly pressed touches at a few dozen nodes scattered over the whole face. Then
sums over pairs of nodes are cheaper than transforms of planes, by two orders of magnitude for some ten nodes.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.threads import in_bands
from fractalcontact.contact import _kernels
from fractalcontact.contact._operator import Wavenumbers
from fractalcontact.contact._scaling import Body

Array = np.ndarray[Any, np.dtype[Any]]


class PairSum:
    """Sums a table of influence over pairs of nodes (iy, ix)."""

    def __init__(self, table: Array, iy: Array, ix: Array) -> None:
        self.table, self.iy, self.ix = table, iy, ix
        self.every = np.arange(iy.size)
        self.transforms = 0

    def apply(self, value: Array, out: Array | None = None) -> Array:  # noqa: ARG002
        """Sum over all nodes of table[distance] times value, for every node."""
        return self.sum(value, self.every)

    def sum(self, value: Array, wanted: Array) -> Array:
        """Sum for the nodes `wanted` (indices); zero for the others."""
        flat = value.reshape(-1)
        sources = np.flatnonzero(flat)
        out = np.zeros_like(flat)
        nodes = (self.iy, self.ix, wanted, sources, flat[sources])
        in_bands(_kernels.pair_sum, wanted.size, wanted.size * sources.size, self.table, *nodes, out)
        return out.reshape(value.shape)


class NodePreconditioner:
    """|q|/2 between the nodes of a set, without extension: contacts this small are nearly separate."""

    def __init__(self, table: Array, iy: Array, ix: Array) -> None:
        self.pairs = PairSum(table, iy, ix)
        self.rows, self.columns, self.bins = 1, iy.size, (1, 1)
        self.plane = (1, int(iy.size))
        self.mask = np.zeros(self.plane, dtype=np.bool_)
        self.sums, self.counts, self.nothing = (np.zeros(self.bins) for _ in range(3))
        self.transforms = 0

    def apply(self, x: Array) -> tuple[Array, Array]:
        """Pressure for the gap x on the set in mask."""
        return self.pairs.sum(x, np.flatnonzero(self.mask)), self.nothing

    def mean_settlement(self) -> float:
        """Infinite: the mean needs no help."""
        return float("inf")


def stiffness_table(body: Body) -> Array:
    """Kernel of |q|/2 in space, at offsets (i, j) up to the shape of the body."""
    ny, nx = body.shape
    plane = (2 * ny, 2 * nx)
    impulse = np.zeros(plane)
    impulse[0, 0] = 1.0
    extent = float(np.sqrt(ny * body.spacing[0] * nx * body.spacing[1]))
    waves = Wavenumbers(plane, body.spacing)
    return np.ascontiguousarray(waves.apply(impulse, 0.5, invert=False, mean=1.0 / extent)[:ny, :nx])
