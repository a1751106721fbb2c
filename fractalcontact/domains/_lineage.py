"""Lineage of islands: which island of one state of a path overlaps which island of the next."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.compass import read_direction
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.domains import _masks
from fractalcontact.domains._connected_components import Components, check_connected, label_planes
from fractalcontact.domains._masks import Array, Planes

SOURCE = "Rosenfeld and Pfaltz, J. ACM 13:471 (1966) (connected components)"
CONTINUATION, BIRTH, DEATH, MERGE, SPLIT, MERGE_AND_SPLIT = range(6)  # the flags of `event` in the schema
FRAMES = {"upper": 0.0, "middle": 0.5, "lower": 1.0}  # share of the travel by which the later state is moved


def check_path(problems: Problems) -> None:
    """Check a mask with a leading dim along which its states follow each other."""
    given = problems.given
    check_connected(problems)
    is_frame = problems.choice("frame", among=FRAMES)
    is_along = _masks.check_along(problems)
    if not isinstance(given.mask, xr.DataArray) or _masks.plane_shape(given.mask)[0] > given.mask.size:
        return
    expected = "at least one leading dim for the path, as in (step, y, x)"
    if not problems.require(given.mask.ndim > 2, "mask.dims", expected, "(y, x)"):
        return
    if not is_along:
        return
    dims = tuple(str(dim) for dim in given.mask.dims[:-2])
    if is_frame and given.frame != "upper":
        has_travel = (given.along or dims[-1]) == "shear" and "shear" in given.mask.coords
        problems.require(has_travel, "frame", "'upper', or a path along shear displacements in m")


@public_result(title="Lineage of islands", references=SOURCE, achieved_error="exact", check=check_path)
def lineage(
    mask: xr.DataArray,
    *,
    along: str | None = None,
    frame: str = "upper",
    connectivity: int = 1,
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
) -> xr.Dataset:
    """Table of the fate of every island: which island of one state overlaps which of the next.

    Every state is compared with the one before it along the path (the steps of a load path, a shear
    displacement ...); other leading dims are separate paths. Two islands are the same if they share cells.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x)
        Boolean, or integer flags where contact means value > 0.
    along : str, optional
        The leading dim that is the path; by default the last.
    frame : {"upper", "middle", "lower"}
        Along `shear`: compare places on the block, which is the frame of the mask, on the lower face, or half
        way between them, to whole cells.
    connectivity : {1, 2}
        1 joins cells that share a side (4 neighbours), 2 also those that share a corner (8 neighbours).
    periodic : bool, optional
        Whether islands continue across the edges; by default along periodic axes. True needs periodic axes.
    valid : DataArray of bool, dims (y, x) or those of the mask, optional
        Observed cells; the others are in no island.

    Returns
    -------
    Dataset
        Over `link`, one row for each pair of islands that overlap, each birth and each death:
        `island_before` and `island_after`, the numbers of `islands` (0: none); `common_cells`; the sizes of
        both, `cells_before` and `cells_after`; `event` (int8 flags): continuation, birth, death, merge
        (the island after overlaps several before), split (the island before overlaps several after), or
        merge_and_split. The coordinates `link_<dim>` give, for every leading dim, the later of both states.

    Raises
    ------
    InvalidInput
        The mask has no leading dim, or the mask, `along`, `frame`, `connectivity`, `periodic` or `valid` is
        not as described.

    Examples
    --------
    Two islands grow together:

    >>> import numpy as np, xarray as xr, fractalcontact as fc
    >>> cells = np.array([[[1, 0, 0, 1]], [[1, 1, 1, 1]]])
    >>> result = fc.domains.lineage(xr.DataArray(cells, dims=("step", "y", "x")))
    >>> result.island_before.values.tolist(), result.island_after.values.tolist()
    ([1, 2], [1, 1])
    >>> [result.event.flag_meanings.split()[event] for event in result.event.values]
    ['merge', 'merge']
    """
    planes = _masks.read_planes(mask, valid=valid, periodic=periodic)
    components = label_planes(planes, connectivity)
    path = Path.of(planes, along, frame)
    later = np.flatnonzero(path.before >= 0).tolist()
    tables = [event_table(path.overlaps(components, k)) for k in later]
    empty = {
        name: values[:0]
        for name, values in event_table(island_overlaps(components[0], components[0])).items()
    }
    columns = {name: np.concatenate([empty[name], *(table[name] for table in tables)]) for name in empty}
    rows = np.repeat(np.array(later, np.int64), [table["event"].size for table in tables])
    variables = {name: ("link", values) for name, values in columns.items()}
    return planes.dataset(variables, rows=("link", rows))


@dataclass(frozen=True)
class Path:
    """Which state comes before each, and how far the frame of comparison moves between them.

    `dim` is the path; `states` lists the planes of every path, (paths, states); `before` is the plane before
    each, -1 at the first. `travel` (m) is that of the block between the two, 0 along a path of loads;
    `offsets` are the rows and columns by which the later state is moved into the frame of the one before.
    """

    dim: str
    states: Array
    before: Array
    travel: Array
    offsets: Array
    periodic: tuple[bool, ...]

    @classmethod
    def of(cls, planes: Planes, along: str | None = None, frame: str = "upper") -> Path:
        """Return the path of planes along a leading dim, by default the last."""
        along = along or planes.dims[-1]
        axis = planes.dims.index(along)
        index = np.moveaxis(np.arange(planes.count).reshape(planes.shape), axis, -1)
        states = index.reshape(-1, planes.shape[axis])
        before, travel = np.full(planes.count, -1), np.zeros(planes.count)
        before[states[:, 1:]] = states[:, :-1]
        if along == "shear" and "shear" in planes.coords:
            travel[states[:, 1:]] = np.diff(planes.coords["shear"].values.astype(float))
        units = np.array([read_direction(word).unit for word in _directions(planes)])
        cells = FRAMES[frame] * travel[:, None] * units / np.array(planes.grid.spacing)
        return cls(along, states, before, travel, np.rint(cells).astype(np.int64), planes.grid.periodic)

    def overlaps(self, components: Sequence[Components], k: int) -> Overlaps:
        """Return which islands of the state before the plane k share cells with those of k, in one frame."""
        return island_overlaps(components[self.before[k]], components[k], self.moved(components[k].map, k))

    def moved(self, plane: Array, k: int) -> Array:
        """Return a map of the state k in the frame of the one before; empty where a free edge moves in."""
        for axis, (cells, wraps) in enumerate(zip(self.offsets[k].tolist(), self.periodic, strict=True)):
            if cells == 0:
                continue
            plane = np.roll(plane, cells, axis)
            if not wraps:
                lines = np.moveaxis(plane, axis, 0)
                lines[slice(None, cells) if cells > 0 else slice(cells, None)] = 0
        return plane


def _directions(planes: Planes) -> list[Any]:
    """Return the direction of sliding of every plane, a word or degrees; E where none is given."""
    direction = planes.coords.get("azimuth", planes.coords.get("direction"))
    if direction is None:
        return ["E"] * planes.count
    shape = [planes.shape[k] if dim in direction.dims else 1 for k, dim in enumerate(planes.dims)]
    return list(np.broadcast_to(direction.values.reshape(shape), planes.shape).ravel().tolist())


@dataclass(frozen=True)
class Overlaps:
    """Pairs of islands, one of each of two states, that share cells, and how many cells each pair shares."""

    before: Array
    after: Array
    cells: Array
    ancestors: Array  # number of islands before that each island after overlaps
    heirs: Array  # number of islands after that each island before overlaps
    sizes_before: Array  # cells of each island before
    sizes_after: Array

    @property
    def event_counts(self) -> dict[str, int]:
        """Births, deaths, merges and splits; the islands absorbed by merges, and the fragments of splits.

        With L links, L - absorbed islands after have an ancestor and L - fragments before have an heir. So
        the islands after are those before + births - deaths - absorbed + fragments.
        """
        return {
            "births": int(np.count_nonzero(self.ancestors == 0)),
            "deaths": int(np.count_nonzero(self.heirs == 0)),
            "merges": int(np.count_nonzero(self.ancestors > 1)),
            "splits": int(np.count_nonzero(self.heirs > 1)),
            "absorbed": int(np.maximum(self.ancestors - 1, 0).sum()),
            "fragments": int(np.maximum(self.heirs - 1, 0).sum()),
        }


def island_overlaps(before: Components, after: Components, moved: Array | None = None) -> Overlaps:
    """Return which islands of two states share cells; `moved` is the later map in another frame."""
    old, new = before.map, after.map if moved is None else moved
    before_count, after_count = before.count, after.count
    both = (old > 0) & (new > 0)
    codes = old[both].astype(np.int64) * (after_count + 1) + new[both]
    codes, cells = np.unique(codes, return_counts=True)
    island_before, island_after = codes // (after_count + 1), codes % (after_count + 1)
    ancestors = np.bincount(island_after, minlength=after_count + 1)[1:]
    heirs = np.bincount(island_before, minlength=before_count + 1)[1:]
    return Overlaps(island_before, island_after, cells, ancestors, heirs, before.sizes, after.sizes)


def event_table(overlaps: Overlaps) -> dict[str, Array]:
    """Return one row for each overlap, birth and death: island before and after (0: none), cells, event."""
    born, dead = np.flatnonzero(overlaps.ancestors == 0) + 1, np.flatnonzero(overlaps.heirs == 0) + 1
    merges = overlaps.ancestors[overlaps.after - 1] > 1
    splits = overlaps.heirs[overlaps.before - 1] > 1
    event = np.select([merges & splits, merges, splits], [MERGE_AND_SPLIT, MERGE, SPLIT], CONTINUATION)
    zero_born, zero_dead = np.zeros(born.size, np.int64), np.zeros(dead.size, np.int64)
    before = np.concatenate([overlaps.before, zero_born, dead])
    after = np.concatenate([overlaps.after, born, zero_dead])
    return {
        "island_before": before,
        "island_after": after,
        "common_cells": np.concatenate([overlaps.cells, zero_born, zero_dead]),
        "cells_before": np.append(0, overlaps.sizes_before)[before],
        "cells_after": np.append(0, overlaps.sizes_after)[after],
        "event": np.concatenate([event, zero_born + BIRTH, zero_dead + DEATH]).astype(np.int8),
    }
