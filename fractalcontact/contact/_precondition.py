"""The preconditioner: nearly the pressure on a set of nodes that makes a given settlement there.

The inverse of the half-space is |q|/2. On a set of nodes that is not the whole plane the exact inverse is

    min over extensions E of g to the outside:  E' (|q|/2) E,

and taking zero outside (the plain |q| preconditioner) makes a jump at every edge of the set, which costs
most of the iterations of a rough contact. Here the settlement is extended smoothly: outside it takes the
mean of the settlement on the set, weighted by a kernel that falls with the cube of the distance as the
kernel of |q| does (a Poisson kernel, modes exp(-a |q|)), and fading far from the set:

    E g = g on the set,     E g = G g / (G 1 + FADE) outside.

Any extension gives a symmetric positive preconditioner that is no smaller than the exact inverse, so that
conjugate gradients are safe with it. G need not be exact, and is applied to bins of some four by four nodes:
it costs a sixteenth of a transform.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base import fft
from fractalcontact.base.threads import in_bands
from fractalcontact.contact import _kernels
from fractalcontact.contact._operator import Wavenumbers
from fractalcontact.contact._scaling import Body

Array = np.ndarray[Any, np.dtype[Any]]

BIN = 4  # nodes along the edge of a bin, for equal spacings
REACH = 0.65  # decay length of the kernel, in bins
FADE = 0.04
MARGIN = 8  # a free body has n/MARGIN more nodes for the extension beyond its edges


class Preconditioner:
    """Extension, |q|/2, and the transpose of the extension, on the plane of a body."""

    def __init__(self, body: Body, kind: Any, wavenumbers: Wavenumbers | None = None) -> None:
        self.rows, self.columns = (bin_edge(body, axis) for axis in (0, 1))
        self.plane = body.shape
        if not body.periodic:
            self.plane = (wider(body.shape[0], self.rows), wider(body.shape[1], self.columns))
        self.bins = (-(-self.plane[0] // self.rows), -(-self.plane[1] // self.columns))
        self.wavenumbers = wavenumbers or Wavenumbers(self.plane, body.spacing)
        edge = (self.rows * body.spacing[0], self.columns * body.spacing[1])
        q = np.hypot(
            fft.wavenumbers(self.bins[0], edge[0])[:, None],
            fft.wavenumbers(self.bins[1], edge[1], real=True)[None, :],
        )
        self.smooth = np.exp(-REACH * np.sqrt(edge[0] * edge[1]) * q).astype(kind)
        q[0, 0] = np.inf
        self.compliance = (2.0 / q).astype(kind) if body.periodic else None
        self.self_compliance = float(np.sqrt(body.spacing[0] * body.spacing[1])) / 2
        extent = np.sqrt(self.plane[0] * body.spacing[0] * self.plane[1] * body.spacing[1])
        # of a flat block under a rigid flat; a periodic body has no stiffness of its own for the mean
        self.mean_stiffness = 1.0 / float(extent)
        self.mask = np.zeros(self.plane, dtype=np.bool_)
        self.sums, self.counts = (np.zeros(self.bins, dtype=kind) for _ in range(2))
        self.kind = kind
        self.transforms = 0

    def spread(self, bins: Array) -> Array:
        """Apply the kernel to the bins."""
        modes = fft.rfft2(bins)
        modes *= self.smooth
        return fft.irfft2(modes, self.bins, overwrite=True)

    def apply(self, x: Array) -> tuple[Array, Array]:
        """Turn the gap x on the set, its sums and counts over the bins, into the pressure.

        Returns the plane (x is used up) and, over the bins, what is to be added to it on the set.
        """
        self.transforms += 1
        cells = self.kind(self.rows * self.columns)
        weight = 1 / (np.maximum(self.spread(self.counts), 0) + self.kind(FADE) * cells)
        inside = self.spread(self.sums)
        inside *= weight
        size = self.plane[0] * self.plane[1]
        grid = (self.rows, self.columns, self.mask)
        in_bands(_kernels.extend, self.bins[0], size, *grid, inside, x)
        pressed = self.wavenumbers.apply(x, 0.5, invert=False, mean=self.mean_stiffness, out=x)
        in_bands(_kernels.collect, self.bins[0], size, *grid, pressed, self.sums)
        weight *= self.sums
        return pressed, self.spread(weight)

    def mean_settlement(self) -> float:
        """Sum, over the set, of the settlement under unit pressure on the set, roughly (periodic bodies)."""
        if self.compliance is None:
            return float("inf")
        modes = fft.rfft2(self.counts)
        modes *= self.compliance
        settled = fft.irfft2(modes, self.bins, overwrite=True) / (self.rows * self.columns)
        count = float(self.counts.sum())
        size = self.plane[0] * self.plane[1]
        alone = self.self_compliance * count * (1.0 - count / size)
        return float(np.sum(np.sum(self.counts * settled, axis=1), dtype=np.float64)) + alone

    def whole(self, gap: Array) -> Array:
        """Precondition a gap that is free on the whole of the body."""
        ny, nx = gap.shape
        self.mask[:ny, :nx] = True
        x = np.zeros(self.plane, dtype=self.kind)
        x[:ny, :nx] = gap
        full = np.zeros((self.bins[0] * self.rows, self.bins[1] * self.columns), dtype=self.kind)
        shape = (self.bins[0], self.rows, self.bins[1], self.columns)
        full[:ny, :nx] = gap
        self.sums[...] = full.reshape(shape).sum(axis=(1, 3))
        full[:ny, :nx] = 1
        self.counts[...] = full.reshape(shape).sum(axis=(1, 3))
        pressed, extra = self.apply(x)
        spread = np.repeat(np.repeat(extra, self.rows, axis=0), self.columns, axis=1)
        return np.asarray(pressed[:ny, :nx] + spread[:ny, :nx])


def bin_edge(body: Body, axis: int) -> int:
    """Nodes along the edge of a bin: a power of two, near square, and not too few bins."""
    mean = float(np.sqrt(body.spacing[0] * body.spacing[1]))
    wanted = min(2 * BIN, round(BIN * mean / body.spacing[axis]), body.shape[axis] // 8)
    return 1 << (max(1, wanted).bit_length() - 1)


def wider(n: int, edge: int) -> int:
    """Length of the plane of a free body: room for the extension, whole bins, fast transforms."""
    bins = -(-(n + max(n // MARGIN, 2 * edge)) // edge)
    while fft.fast_length(bins * edge) != bins * edge:
        bins += 1
    return bins * edge
