"""Evolution of a set along a path of load or shear: the signature of each state, and the changes between.

Its events are those of the lineage: which island of one state overlaps which island of the next.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from scipy.ndimage import binary_erosion

from fractalcontact.base.compass import read_direction
from fractalcontact.base.grid import Grid
from fractalcontact.base.provenance import differing
from fractalcontact.base.resources import thread_count
from fractalcontact.base.results import public_result
from fractalcontact.base.study import joined_references, provenance_of
from fractalcontact.base.validation import Problems, word_tuple
from fractalcontact.domains import _masks, _signature
from fractalcontact.domains._connected_components import Components, check_connected, label_planes
from fractalcontact.domains._describe import MEASURES, measure_planes, sources, updated
from fractalcontact.domains._masks import Array, Planes, check_window, read_planes

SOURCE = joined_references(_signature.SOURCE, "Hausdorff, Mengenlehre (1927)")
LOADS = ("normal_force", "nominal_pressure", "closure")
EVENTS = ("births", "deaths", "merges", "splits", "absorbed", "fragments")
CHANGES = (*EVENTS, "overlap", "chance_overlap", "overlap_beyond_chance", "hausdorff_distance")
RETURN_NAMES = ("return_step", "hysteresis", "coverage_change")
OF_SIGNATURE = ("mask", "window", "along", "connectivity", "periodic", "valid")  # its arguments


def _check(problems: Problems) -> None:
    check_path(problems)
    check_window(problems, has_mask=not problems.messages)
    problems.choices("include", among=MEASURES)
    _check_signature(problems)


def _check_signature(problems: Problems) -> None:
    """Check that `signature`, if any, is that of this mask with these options."""
    given = problems.given
    if given.signature is None:
        return
    entry = provenance_of(given.signature) if isinstance(given.signature, xr.Dataset) else {}
    is_signature = entry.get("call") == "fractalcontact.domains.signature"
    expected = "a result of `domains.signature` for the same mask and options"
    if problems.require(is_signature, "signature", expected) and isinstance(given.mask, xr.DataArray):
        others = differing(entry, {name: getattr(given, name) for name in OF_SIGNATURE})
        problems.require(not others, "signature", expected, f"one with another {', '.join(others)}")


@public_result(title="Evolution of a set", check=_check)
def evolution(
    mask: xr.DataArray,
    *,
    include: str | Sequence[str] = (),
    along: str | None = None,
    window: Any = None,
    frame: str = "upper",
    connectivity: int = 1,
    periodic: bool | None = None,
    valid: xr.DataArray | None = None,
    signature: xr.Dataset | None = None,
) -> xr.Dataset:
    """How a contact domain changes along a path: the signature of each state, and the changes between states.

    Every state is compared with the one before it along the path (the steps of a load path, a shear
    displacement ...); the other leading dims are separate paths. One window of lengths serves all states.

    Parameters
    ----------
    mask : DataArray, dims (..., y, x)
        Boolean, or integer flags where contact means value > 0.
    include : str or sequence of str
        Further measures, out of "islands", "percolation", "box_dimension", "minkowski_dimension",
        "correlation_dimension", "boundary_dimension", "lacunarity".
    along, frame, connectivity, periodic, valid
        See `lineage`.
    window : (low, high), optional
        See `signature`.
    signature : Dataset, optional
        The result of `signature` for the same mask and options, if there is one; else it is computed.

    Returns
    -------
    Dataset
        The variables of `signature`, and of each state after the first: `births`, islands that share no cell
        with the set before; `deaths`, islands of the set before that share none with this one; `merges`,
        islands that overlap several before, and `absorbed`, how many these are less one each; `splits`,
        islands before that overlap several now, and `fragments` alike, so that `n_islands` is that before
        + births - deaths - absorbed + fragments; `overlap`, common over united area; `chance_overlap`, that
        of two sets placed at random; `overlap_beyond_chance`, the share of the rest; `hausdorff_distance`
        (m), the largest distance from a cell of one set to the other set. If the path carries a load
        (`normal_force`, `nominal_pressure` or `closure`) that reverses, the set is compared with that at the
        same load on the opposite branch before: `return_step`, its index on the path; `hysteresis`, 1 less
        common over united area; `coverage_change`. And what `include` names, see `describe`.

    Raises
    ------
    InvalidInput
        The mask has no leading dim, `include` holds an unknown word, or another argument is not as described.

    Notes
    -----
    Changes are NaN at the first state of a path. Along `shear` the counts of islands are NaN where the block
    travels further than the larger spot of the two states: islands then overlap by chance. The overlap of
    two empty states is NaN, and so is the distance from or to an empty one.

    Examples
    --------
    >>> import numpy as np, xarray as xr, fractalcontact as fc
    >>> cells = np.array([[[1, 0, 0, 1]], [[1, 1, 1, 1]]])
    >>> result = fc.domains.evolution(xr.DataArray(cells, dims=("step", "y", "x")))
    >>> float(result.merges[1]), float(result.overlap[1])
    (1.0, 0.5)
    """
    wanted = word_tuple(include)
    planes = read_planes(mask, valid=valid, periodic=periodic)
    components = label_planes(planes, connectivity)
    path = Path.of(planes, along, frame)
    result = measure_planes(planes, wanted, components, connectivity)
    if signature is None:
        signature = _signature.analyse(planes, components, window=window, along=along)
    signature = signature.drop_vars("run_time", errors="ignore")
    changes = _changes(planes, components, path, signature["spot_size"].values.reshape(-1))
    result = updated([result, signature, changes, _returns(planes, path)])
    return result.assign_attrs(references=joined_references(SOURCE, *([sources(wanted)] if wanted else [])))


def _changes(planes: Planes, components: Sequence[Components], path: Path, spots: Array) -> xr.Dataset:
    """Return how every state differs from the one before it along the path; `spots` are their sizes."""
    rows = np.full((planes.count, len(CHANGES)), np.nan)
    for k in np.flatnonzero(path.before >= 0):
        rows[k] = _change(planes, components, path, int(k))
    with np.errstate(invalid="ignore"):
        too_far = np.abs(path.travel) > np.fmax(spots, spots[path.before])
    rows[too_far, : len(EVENTS)] = np.nan
    comments = dict.fromkeys(CHANGES, f"NaN at the first state along {path.dim}, which has none before it")
    reasons = dict.fromkeys(EVENTS, "the block travels further than a spot") if too_far.any() else {}
    if np.isnan(rows[path.before >= 0, len(EVENTS) :]).any():
        reasons |= dict.fromkeys(CHANGES[len(EVENTS) : -1], "both sets are empty")
        reasons["hausdorff_distance"] = "a set is empty"
    comments |= {name: f"{comments[name]}, and where {reason}" for name, reason in reasons.items()}
    return _labelled_rows(planes, rows, comments)


def _labelled_rows(planes: Planes, rows: Array, comments: dict[str, str]) -> xr.Dataset:
    """Return a row of numbers for each plane, (planes, names), with the comment of each name."""
    variables = {name: planes.variable(values) for name, values in zip(comments, rows.T, strict=True)}
    return planes.dataset(variables, notes={name: {"comment": text} for name, text in comments.items()})


def _change(planes: Planes, components: Sequence[Components], path: Path, k: int) -> list[float]:
    """Return the `CHANGES` of the plane k from the one before it."""
    before, after = path.facing(planes.cells[path.before[k]], planes.cells[k], k)
    events = path.overlaps(components, k).event_counts
    overlap, chance = area_overlap(before, after), _chance_overlap(*planes.coverage[[path.before[k], k]])
    beyond = (overlap - chance) / (1.0 - chance) if chance < 1.0 else np.nan
    distance = hausdorff_distance(before, after, planes.grid)
    return [*(float(events[name]) for name in EVENTS), overlap, chance, beyond, distance]


def _chance_overlap(first: float, second: float) -> float:
    """Return the expected overlap of two sets of these coverages, one of them placed at random."""
    united = first + second - first * second
    return float(first * second / united) if united > 0 else float("nan")


def _returns(planes: Planes, path: Path) -> xr.Dataset:
    """Compare every plane with that at the same load on the opposite branch before, if there are loads."""
    loads = [name for name in LOADS if name in planes.coords and path.dim in planes.coords[name].dims]
    if not loads:
        return xr.Dataset()
    values = planes.spread(planes.coords[loads[0]])
    rows = np.full((planes.count, len(RETURN_NAMES)), np.nan)
    for states in path.states:
        for state, earlier in zip(states, same_load_steps(values[states]), strict=True):
            if earlier >= 0:
                before, after = planes.cells[states[earlier]], planes.cells[state]
                change = planes.coverage[state] - planes.coverage[states[earlier]]
                rows[state] = earlier, 1.0 - area_overlap(before, after), change
    reason = f"NaN where the path has not come back to the same {loads[0]}, or both sets are empty"
    return _labelled_rows(planes, rows, dict.fromkeys(RETURN_NAMES, reason))


def same_load_steps(loads: Array) -> Array:
    """Return for each step the last one before it, on the opposite branch, with the same load.

    -1 where there is none. Loads are the same if they differ by less than 1e-6 of the largest.
    """
    steps = np.full(loads.size, -1, np.int64)
    branch = np.sign(np.diff(loads))  # from each step to the next: loading or unloading
    limit = 1e-6 * np.nanmax(np.abs(loads), initial=0.0)  # rounding of a path that comes back
    for step in range(2, loads.size):
        # a turning point belongs to both branches
        opposite = branch[:step] == -branch[step - 1]
        opposite[1:] |= opposite[:-1]
        same = opposite & (np.abs(loads[:step] - loads[step]) <= limit)
        if branch[step - 1] != 0 and same.any():
            steps[step] = np.flatnonzero(same)[-1]
    return steps


def area_overlap(before: Array, after: Array) -> float:
    """Return the common over the united area; NaN if both are empty."""
    united = int(np.count_nonzero(before | after))
    return int(np.count_nonzero(before & after)) / united if united else float("nan")


def hausdorff_distance(before: Array, after: Array, grid: Grid) -> float:
    """Return the largest distance (m) from a cell of one set to the other set; NaN if one is empty."""
    if not before.any() or not after.any():
        return float("nan")
    return max(_directed_distance(before, after, grid), _directed_distance(after, before, grid))


def _directed_distance(start: Array, goal: Array, grid: Grid) -> float:
    """Largest distance from a cell of `start` to the nearest of `goal`, between centres."""
    from scipy.spatial import cKDTree  # loads slowly

    outside = (start > 0) & (goal == 0)
    if not outside.any():
        return 0.0
    box = [
        n * spacing if wraps else 0.0
        for n, spacing, wraps in zip(grid.shape, grid.spacing, grid.periodic, strict=True)
    ]
    rim = (goal > 0) & ~binary_erosion(goal > 0)  # the nearest cell is among those beside an open one
    tree = cKDTree(_positions(rim, grid), boxsize=box)
    distance, _ = tree.query(_positions(outside, grid), workers=thread_count())
    return float(distance.max())


def _positions(cells: Array, grid: Grid) -> Array:
    return np.asarray(np.argwhere(cells) * np.array(grid.spacing))


LINEAGE_SOURCE = "Rosenfeld and Pfaltz, J. ACM 13:471 (1966) (connected components)"
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


@public_result(
    title="Lineage of islands", references=LINEAGE_SOURCE, achieved_error="exact", check=check_path
)
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
        way between them, to whole cells; only those that both states cover.
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
    first = components[0]
    of_itself = event_table(island_overlaps(first, first, first.map, first.map))
    empty = {name: values[:0] for name, values in of_itself.items()}
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
        direction = planes.coords.get("azimuth", planes.coords.get("direction", xr.Variable((), "E")))
        units = np.array([read_direction(word).unit for word in planes.spread(direction).tolist()])
        cells = FRAMES[frame] * travel[:, None] * units / np.array(planes.grid.spacing)
        return cls(along, states, before, travel, np.rint(cells).astype(np.int64), planes.grid.periodic)

    def overlaps(self, components: Sequence[Components], k: int) -> Overlaps:
        """Return which islands of the state before the plane k share cells with those of k, in one frame."""
        before, after = components[self.before[k]], components[k]
        return island_overlaps(before, after, *self.facing(before.map, after.map, k))

    def facing(self, before: Array, after: Array, k: int) -> tuple[Array, Array]:
        """Return maps of the state before and of the state k at the same places of their frame.

        Along a free axis these are the places that both states cover, as far as the block has not left them.
        """
        of_before, of_after = [slice(None)] * 2, [slice(None)] * 2
        for axis, (offset, wraps) in enumerate(zip(self.offsets[k].tolist(), self.periodic, strict=True)):
            if wraps:
                after = np.roll(after, offset, axis)
                continue
            n = after.shape[axis]
            ahead, behind = min(max(offset, 0), n), min(max(-offset, 0), n)
            of_before[axis], of_after[axis] = slice(ahead, n - behind), slice(behind, n - ahead)
        return before[tuple(of_before)], after[tuple(of_after)]


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


def island_overlaps(before: Components, after: Components, old: Array, new: Array) -> Overlaps:
    """Return which islands of two states share cells; `old` and `new` are their maps in one frame."""
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
