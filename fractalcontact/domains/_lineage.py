"""What becomes of islands from one plane to the next; arrays in and out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from fractalcontact.base.grid import Grid
from fractalcontact.base.threads import thread_count
from fractalcontact.domains._labels import Labels
from fractalcontact.domains._masks import Array


@dataclass(frozen=True)
class Meetings:
    """Pairs of islands, one of each of two planes, that share cells, and how many cells each pair shares."""

    before: Array
    after: Array
    cells: Array
    ancestors: Array  # number of islands before that each island after meets
    heirs: Array  # number of islands after that each island before meets

    @property
    def counts(self) -> tuple[int, int, int, int]:
        """Births, deaths, merges and splits."""
        each = (self.ancestors == 0, self.heirs == 0, self.ancestors > 1, self.heirs > 1)
        births, deaths, merges, splits = (int(np.count_nonzero(one)) for one in each)
        return births, deaths, merges, splits


def meetings(before: Labels, after: Labels) -> Meetings:
    """Find which islands of two planes share cells."""
    old, new = before.map, after.map
    both = (old > 0) & (new > 0)
    codes = old[both].astype(np.int64) * (after.count + 1) + new[both]
    codes, cells = np.unique(codes, return_counts=True)
    one, other = codes // (after.count + 1), codes % (after.count + 1)
    ancestors = np.bincount(other, minlength=after.count + 1)[1:]
    heirs = np.bincount(one, minlength=before.count + 1)[1:]
    return Meetings(one, other, cells, ancestors, heirs)


KINDS = ("continuation", "birth", "death", "merge", "split", "merge and split")


def table(before: Labels, after: Labels) -> dict[str, Array]:
    """Return one row for each meeting, birth and death: island before and after (0: none), cells, kind."""
    met = meetings(before, after)
    born, gone = np.flatnonzero(met.ancestors == 0) + 1, np.flatnonzero(met.heirs == 0) + 1
    merging, splitting = met.ancestors[met.after - 1] > 1, met.heirs[met.before - 1] > 1
    kind = np.select([merging & splitting, merging, splitting], [5, 3, 4], 0)
    blank = np.zeros(born.size, np.int64), np.zeros(gone.size, np.int64)
    return {
        "island_before": np.concatenate([met.before, blank[0], gone]),
        "island_after": np.concatenate([met.after, born, blank[1]]),
        "common_cells": np.concatenate([met.cells, *blank]),
        "event": np.concatenate([kind, blank[0] + 1, blank[1] + 2]).astype(np.int8),
    }


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


def same_load(loads: Array) -> Array:
    """Return for each step the last one before it, on the way in the other direction, with the same load.

    -1 where there is none. Loads are the same if they differ by less than 1e-6 of the largest.
    """
    found = np.full(loads.size, -1, np.int64)
    way = np.sign(np.diff(loads))  # from each step to the next
    limit = SAME * np.nanmax(np.abs(loads), initial=0.0)
    for step in range(2, loads.size):
        # a turning point belongs to both ways
        there = way[:step] == -way[step - 1]
        there[1:] |= there[:-1]
        other = there & (np.abs(loads[:step] - loads[step]) <= limit)
        if way[step - 1] != 0 and other.any():
            found[step] = np.flatnonzero(other)[-1]
    return found


SAME = 1e-6
