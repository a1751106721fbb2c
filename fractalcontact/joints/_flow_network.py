"""Flow between the cells of a joint: links, clusters of open cells, and the pressure in every cell.

The flux between two cells passes their half-cells in series, so a link takes the harmonic mean: exact for
layers across or along the flow. Where four cells of different conductivity meet, that mean forces the flow
through the corner and is too low. There it is raised to the closed-form conductivity of the four cells as a
periodic pattern (Mortola and Steffe 1985; Craster and Obnosov 2001). Of the two corners at the ends of a link
the one with the greater gain counts, because the flow gathers there. Layers stay exact, and so do patterns of
single cells.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base.labelled import check_leading
from fractalcontact.base.numbers import Array
from fractalcontact.base.validation import Problems

REMEDY = "fill the faces with fractalcontact.surfaces.fill, or close what is unknown with gap.fillna(0)"


def check_gap(problems: Problems, gap: Any, taken: Collection[str]) -> bool:
    """Check for an opening without NaN, and for leading dims that are not called as the results."""
    if not problems.surface("gap", gap, finite=False, leading=True, smallest=1):
        return False
    check_leading(gap, taken, problems, "gap")
    if not problems.finite("gap", gap, remedy=REMEDY):
        return False
    below = int(np.count_nonzero(np.asarray(gap.values, dtype=np.float64).max(axis=(-2, -1)) < 0))
    expected = "an opening, zero in contact (not heights, nor lower - upper)"
    return problems.require(below == 0, "gap", expected, f"{below} planes that are below zero everywhere")


def narrow_cells(gap: Array, smallest: float = 1e-3) -> Array:
    """Return which open cells are too narrow to conduct: open by less than a share of the mean opening.

    One carries 1e-9 of the flow of the mean, and is lost in the rounding of greater links beside it. In 600
    drawn gaps with openings over 1 to 11 decades the pressures were wrong by up to .003 of their range,
    against .7 with 1e-4, 6 with 1e-5 and 1e76 with 0. Of rough faces that `press` closed up to where the flow
    stops, the flow is the same to 7 digits.
    """
    mean = np.maximum(gap, 0.0).mean(axis=(-2, -1), keepdims=True)
    return np.asarray((gap > 0) & (gap < smallest * mean))


def conducting(gap: Array) -> Array:
    """Return the opening of the cells that conduct, 0 for all others."""
    return np.where((gap > 0) & ~narrow_cells(gap), gap, 0.0)


@dataclass(frozen=True)
class Network:
    """Conductances of the links between cells i and j, and the axis of each (0 for y).

    `jump` is the pressure drop across a link beyond that of its cells: 1 where a link closes a period along
    the flow of a plane that repeats, else 0. Links that close a period have `closes`.
    """

    i: Array
    j: Array
    conductance: Array
    axis: Array
    closes: Array
    jump: Array
    shape: tuple[int, int]


@dataclass(frozen=True)
class Held:
    """Conductance of each cell to pressures that are held, the same times them, and times their squares."""

    conductance: Array
    inflow: Array
    energy: Array

    def add(self, place: Any, conductance: Array, pressure: float) -> None:
        """Hold the cells at a place at a pressure, through a conductance each."""
        self.conductance[place] += conductance
        self.inflow[place] += conductance * pressure
        self.energy[place] += conductance * pressure**2


def nothing_held(shape: tuple[int, ...]) -> Held:
    """Return that no pressure is held yet."""
    return Held(np.zeros(shape), np.zeros(shape), np.zeros(shape))


def line_of(axis: int, place: int) -> tuple[Any, Any]:
    """Return the index of a line of cells across an axis."""
    return (place, slice(None)) if axis == 0 else (slice(None), place)


def edge_conductance(cells: Array, ratio: float, axis: int, place: int) -> Array:
    """Return the conductances from the cells of an edge line to that edge, half a cell away."""
    return np.asarray(2.0 * (ratio if axis == 1 else 1.0 / ratio) * cells[line_of(axis, place)])


def link_network(cells: Array, ratio: float, wraps: tuple[bool, bool]) -> Network:
    """Return the links of cells of given conductivity; `ratio` is the spacing of y over that of x."""
    links = []
    number = np.arange(cells.size).reshape(cells.shape)
    for axis, conductances in enumerate(_link_conductances(cells, wraps)):
        n = conductances.shape[axis]
        closes = np.broadcast_to(_across(np.arange(n) == cells.shape[axis] - 1, axis), conductances.shape)
        first = np.take(number, np.arange(n), axis)
        second = np.take(np.roll(number, -1, axis), np.arange(n), axis)
        scaled = conductances * (ratio if axis == 1 else 1.0 / ratio)
        links.append([part.ravel()[scaled.ravel() > 0] for part in (first, second, scaled, closes)])
    axis_of = np.repeat([0, 1], [links[0][0].size, links[1][0].size])
    i, j, conductance, closes = (np.concatenate(parts) for parts in zip(*links, strict=True))
    shape = (cells.shape[0], cells.shape[1])
    return Network(i, j, conductance, axis_of, closes, np.zeros(conductance.size), shape)


def _across(values: Array, axis: int) -> Array:
    return values[:, None] if axis == 0 else values[None, :]


def _link_conductances(cells: Array, wraps: tuple[bool, bool]) -> tuple[Array, Array]:
    """Return the conductances of the links to the next row and to the next column.

    There is one link fewer than rows, or columns, unless that axis wraps.
    """
    ny, nx = cells.shape
    padded = np.pad(cells, ((1, 1), (0, 0)), mode="wrap" if wraps[0] else "edge")
    padded = np.pad(padded, ((0, 0), (1, 1)), mode="wrap" if wraps[1] else "edge")
    a, b, c, d = padded[:-1, :-1], padded[:-1, 1:], padded[1:, 1:], padded[1:, :-1]
    gain_x, gain_y = _corner_gain(a, b, c, d), _corner_gain(a, d, c, b)
    along_x = _series(padded[1:-1, 1:-1], padded[1:-1, 2:]) * np.maximum(gain_x[:-1, 1:], gain_x[1:, 1:])
    along_y = _series(padded[1:-1, 1:-1], padded[2:, 1:-1]) * np.maximum(gain_y[1:, :-1], gain_y[1:, 1:])
    return along_y[: ny if wraps[0] else ny - 1], along_x[:, : nx if wraps[1] else nx - 1]


def _series(a: Array, b: Array) -> Array:
    """Return the harmonic mean, zero where one of the two is closed."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where((a > 0) & (b > 0), 2.0 * a * b / (a + b), 0.0)


def _corner_gain(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Return the conductivity along a-b of the periodic pattern a b / d c, over that of its separate rows.

    Craster and Obnosov (2001): the square of the first is (abc + abd + acd + bcd) (a + d)(b + c) over
    (a + b + c + d)(a + b)(c + d).
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        triples = a * b * (c + d) + c * d * (a + b)
        pattern = np.sqrt(triples / (a + b + c + d) * ((a + d) * (b + c)) / ((a + b) * (c + d)))
        gain = pattern / (0.5 * (_series(a, b) + _series(d, c)))
    # separate rows conduct least, so a gain below one is rounding; it is undefined where a row is closed
    return np.where(np.isfinite(gain), np.maximum(gain, 1.0), 1.0)


def _clusters(network: Network, chosen: Array | slice = slice(None)) -> Array:
    """Label the clusters of cells (4 neighbours) that the chosen links join."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    size = network.shape[0] * network.shape[1]
    pairs = network.i[chosen], network.j[chosen]
    graph = coo_array((np.ones(pairs[0].size, np.int8), pairs), shape=(size, size))
    return np.asarray(connected_components(graph.tocsr(), directed=False)[1])


def spanning_cells(network: Network, axis: int, ends: Sequence[Array]) -> Array:
    """Return which cells belong to an open cluster that reaches from end to end along an axis."""
    labels = _clusters(network)
    cells = labels.reshape(network.shape)
    first, last = (cells[line_of(axis, place)][end > 0] for place, end in zip((0, -1), ends, strict=True))
    return np.isin(labels, np.intersect1d(first, last))


def held_cells(network: Network, held: Held) -> Array:
    """Return which cells belong to an open cluster that reaches a cell whose pressure is held."""
    labels = _clusters(network)
    return np.isin(labels, labels[held.conductance.ravel() > 0])


def winding_cells(network: Network) -> Array:
    """Return which cells belong to an open cluster that meets its own image one or more periods away."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import breadth_first_order, connected_components

    closing = network.jump > 0
    labels = _clusters(network, ~closing)
    tail, head = labels[network.i[closing]], labels[network.j[closing]]
    count = int(labels.max()) + 1
    graph = coo_array((np.ones(tail.size, np.int32), (tail, head)), shape=(count, count)).tocsr()
    group = connected_components(graph, directed=False)[1]
    # count the periods along a spanning tree of each group; a link that disagrees closes a winding loop
    period = np.zeros(count, dtype=np.int64)
    links = set(zip(tail.tolist(), head.tolist(), strict=True))
    for root in np.unique(group[tail], return_index=True)[1]:
        order, parent = breadth_first_order(graph, tail[root], directed=False)
        for node in order[1:]:
            forward = (int(parent[node]), int(node)) in links
            period[node] = period[parent[node]] + (1 if forward else -1)
    winding = group[tail[period[head] - period[tail] != 1]]
    return np.isin(group[labels], winding)


def dissipation(network: Network, pressure: Array, inside: Array, held: Held) -> float:
    """Return the dissipation inside clusters at any pressure.

    At the solution under a unit drop it is the flow, with an error of second order in that of the pressure.
    """
    p, chosen = pressure.ravel(), inside[network.i]
    drop = p[network.i[chosen]] - p[network.j[chosen]] + network.jump[chosen]
    ends = held.conductance.ravel() * p**2 - 2.0 * held.inflow.ravel() * p + held.energy.ravel()
    return float((network.conductance[chosen] * drop**2).sum() + ends[inside].sum())


def even_gradient(shape: tuple[int, int], axis: int) -> Array:
    """Return the pressure that falls evenly from 1 to 0 along an axis."""
    n = shape[axis]
    return np.broadcast_to(_across(1.0 - (np.arange(n) + 0.5) / n, axis), shape)


def least_flow(network: Network, axis: int, inside: Array, ends: Sequence[Array]) -> float:
    """Return the flow of the lines of cells along an axis side by side, under a unit pressure drop.

    Without the links across, the flow is less: cutting links never raises it (Rayleigh). `ends` are the
    conductances of each line to its two ends, none of a plane that repeats.
    """
    chosen = (network.axis == axis) & inside[network.i]
    line = np.unravel_index(network.i[chosen], network.shape)[1 - axis]
    count = network.shape[1 - axis]
    resistance = np.bincount(line, 1.0 / network.conductance[chosen], count)
    resistance = resistance.astype(float)  # also without links
    crosses = np.bincount(line, minlength=count) == network.shape[axis] - (len(ends) > 0)
    for end in ends:
        crosses &= end > 0
        resistance[crosses] += 1.0 / end[crosses]
    return float((1.0 / resistance[crosses]).sum())


def cell_flows(network: Network, pressure: Array, inside: Array, axis: int, ends: Sequence[Array]) -> Array:
    """Return the flow through each cell along y and x, the mean of its two faces, for a drop of 1."""
    p, chosen = pressure.ravel(), inside[network.i]
    half = 0.5 * network.conductance * (p[network.i] - p[network.j] + network.jump) * chosen
    flows = np.empty((2, *network.shape))
    for each in (0, 1):
        part = half * (network.axis == each)
        through = np.bincount(network.i, part, p.size) + np.bincount(network.j, part, p.size)
        flows[each] = through.reshape(network.shape)
    crossed = inside.reshape(network.shape)
    for place, end, held in zip((0, -1), ends, (1.0, 0.0), strict=False):
        line = line_of(axis, place)
        flows[axis][line] += 0.5 * end * np.abs(held - pressure[line]) * crossed[line]
    return flows
