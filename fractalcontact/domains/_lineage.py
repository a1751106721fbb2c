"""What becomes of islands from one plane to the next; arrays in and out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from fractalcontact.base.grid import Grid
from fractalcontact.base.threads import thread_count
from fractalcontact.domains._labels import Labels
from fractalcontact.domains._masks import Array


def events(before: Labels, after: Labels) -> tuple[int, int, int, int]:
    """Return births, deaths, merges and splits, from the cells that both planes share."""
    old, new = before.map, after.map
    both = (old > 0) & (new > 0)
    meetings = np.unique(old[both].astype(np.int64) * (after.count + 1) + new[both])
    ancestors = np.bincount(meetings % (after.count + 1), minlength=after.count + 1)[1:]
    heirs = np.bincount(meetings // (after.count + 1), minlength=before.count + 1)[1:]
    counts = (ancestors == 0, heirs == 0, ancestors > 1, heirs > 1)
    births, deaths, merges, splits = (int(np.count_nonzero(each)) for each in counts)
    return births, deaths, merges, splits


def overlap(before: Array, after: Array) -> float:
    """Return the common over the united area; NaN if both are empty."""
    united = int(np.count_nonzero(before | after))
    return int(np.count_nonzero(before & after)) / united if united else float("nan")


def hausdorff(before: Array, after: Array, grid: Grid) -> float:
    """Return the largest distance (m) from a cell of one set to the other set; NaN if one is empty."""
    if not before.any() or not after.any():
        return float("nan")
    return max(_reach(before, after, grid), _reach(after, before, grid))


def _reach(start: Array, goal: Array, grid: Grid) -> float:
    """Largest distance from a cell of `start` to the nearest of `goal`, between centres."""
    outside = (start > 0) & (goal == 0)
    if not outside.any():
        return 0.0
    box = [
        n * spacing if wraps else 0.0
        for n, spacing, wraps in zip(grid.shape, grid.spacing, grid.periodic, strict=True)
    ]
    tree = cKDTree(_points(_rim(goal, grid.periodic), grid), boxsize=box)
    distance, _ = tree.query(_points(outside, grid), workers=thread_count())
    return float(distance.max())


def _points(cells: Array, grid: Grid) -> Array:
    return np.asarray(np.argwhere(cells) * np.array(grid.spacing))


def _rim(cells: Array, periodic: Sequence[bool]) -> Array:
    """Cells of the set with an open neighbour or on a free edge: the nearest one is among them."""
    inner = cells > 0
    rim = np.zeros_like(inner)
    for axis, wraps in enumerate(periodic):
        for step in (1, -1):
            beside = np.roll(inner, step, axis)
            if not wraps:
                edge = [slice(None), slice(None)]
                edge[axis] = slice(0, 1) if step == 1 else slice(-1, None)
                beside[tuple(edge)] = False
            rim |= inner & ~beside
    return rim
