"""Flow between the cells of a joint: links, clusters of open cells, and the pressure in every cell.

The flux between two cells passes their half-cells in series, so a link takes the harmonic mean: exact for
layers across or along the flow. Where four cells of different conductivity meet, that mean forces the flow
through the corner and is too low. There it is raised to the closed-form conductivity of the four cells as a
periodic pattern (Mortola and Steffe 1985; Craster and Obnosov 2001). Of the two corners at the ends of a link
the one with the greater gain counts, because the flow gathers there. Layers stay exact, and so do patterns of
single cells.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base.coords import check_leading
from fractalcontact.base.validation import Problems

Array = np.ndarray[Any, np.dtype[Any]]

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


@dataclass(frozen=True)
class Network:
    """Conductances of the links between cells i and j, and of the first and last column to the two ends.

    `jump` is the pressure drop across a link beyond that of its cells: 1 where the link closes a period along
    the flow, else 0. `along` tells the links along the flow from those across.
    """

    i: Array
    j: Array
    conductance: Array
    jump: Array
    along: Array
    inlet: Array
    outlet: Array
    shape: tuple[int, int]


@dataclass(frozen=True)
class Held:
    """Conductance of each cell to pressures that are held, the same times them, and times their squares."""

    conductance: Array
    inflow: Array
    energy: Array


def held_ends(network: Network) -> Held:
    """Hold the pressure 1 at the first end and 0 at the last one."""
    conductance, inflow = np.zeros(network.shape), np.zeros(network.shape)
    conductance[:, 0] += network.inlet
    conductance[:, -1] += network.outlet
    inflow[:, 0] = network.inlet
    return Held(conductance, inflow, inflow)


def link_network(cells: Array, ratio: float, wraps: tuple[bool, bool]) -> Network:
    ny, nx = cells.shape
    along, across = _link_conductances(cells, wraps)
    number = np.arange(ny * nx).reshape(ny, nx)
    right = np.roll(number, -1, axis=1)[:, : along.shape[1]]
    below = np.roll(number, -1, axis=0)[: across.shape[0]]
    i = np.concatenate([number[:, : along.shape[1]].ravel(), number[: across.shape[0]].ravel()])
    j = np.concatenate([right.ravel(), below.ravel()])
    conductance = np.concatenate([(along * ratio).ravel(), (across / ratio).ravel()])
    jump = np.zeros(conductance.size)
    jump[: along.size] = np.broadcast_to(np.arange(along.shape[1]) == nx - 1, along.shape).ravel()
    is_open = conductance > 0
    ends = np.zeros((ny, 2)) if wraps[1] else 2.0 * ratio * cells[:, [0, -1]]
    is_along = np.arange(conductance.size)[is_open] < along.size
    i, j, conductance, jump = i[is_open], j[is_open], conductance[is_open], jump[is_open]
    return Network(i, j, conductance, jump, is_along, ends[:, 0], ends[:, 1], (ny, nx))


def _link_conductances(cells: Array, wraps: tuple[bool, bool]) -> tuple[Array, Array]:
    """Return the conductances of the links to the next column and to the next row.

    There is one link fewer than columns, or rows, unless that axis wraps.
    """
    ny, nx = cells.shape
    padded = np.pad(cells, ((1, 1), (0, 0)), mode="wrap" if wraps[0] else "edge")
    padded = np.pad(padded, ((0, 0), (1, 1)), mode="wrap" if wraps[1] else "edge")
    a, b, c, d = padded[:-1, :-1], padded[:-1, 1:], padded[1:, 1:], padded[1:, :-1]
    gain_x, gain_y = _corner_gain(a, b, c, d), _corner_gain(a, d, c, b)
    along = _series(padded[1:-1, 1:-1], padded[1:-1, 2:]) * np.maximum(gain_x[:-1, 1:], gain_x[1:, 1:])
    across = _series(padded[1:-1, 1:-1], padded[2:, 1:-1]) * np.maximum(gain_y[1:, :-1], gain_y[1:, 1:])
    return along[:, : nx if wraps[1] else nx - 1], across[: ny if wraps[0] and ny > 1 else ny - 1]


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


def _clusters(network: Network, chosen: Array) -> Array:
    """Label the clusters of cells (4 neighbours) that the chosen links join."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    size = network.shape[0] * network.shape[1]
    pairs = network.i[chosen], network.j[chosen]
    graph = coo_array((np.ones(pairs[0].size, np.int8), pairs), shape=(size, size))
    return np.asarray(connected_components(graph.tocsr(), directed=False)[1])


def spanning_cells(network: Network) -> Array:
    """Return which cells belong to an open cluster that reaches from end to end."""
    labels = _clusters(network, np.ones(network.i.size, bool)).reshape(network.shape)
    both = np.intersect1d(labels[network.inlet > 0, 0], labels[network.outlet > 0, -1])
    return np.isin(labels.ravel(), both)


def held_cells(network: Network, held: Held) -> Array:
    """Return which cells belong to an open cluster that reaches a cell whose pressure is held."""
    labels = _clusters(network, np.ones(network.i.size, bool))
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


def dissipation(network: Network, pressure: Array, percolating: Array) -> float:
    """Return the flow under a unit pressure drop, computed as its dissipation.

    The error of the dissipation is of second order in that of the pressure.
    """
    p = pressure.ravel()
    inside = percolating[network.i]
    drop = p[network.i[inside]] - p[network.j[inside]] + network.jump[inside]
    plane = percolating.reshape(network.shape)
    power = network.conductance[inside] * drop**2
    inlet = network.inlet[plane[:, 0]] * (1.0 - pressure[plane[:, 0], 0]) ** 2
    outlet = network.outlet[plane[:, -1]] * pressure[plane[:, -1], -1] ** 2
    return float(power.sum() + inlet.sum() + outlet.sum())


def cell_flows(network: Network, pressure: Array, inside: Array) -> tuple[Array, Array]:
    """Return the flow through each cell along and across, the mean of its two faces, for a drop of 1."""
    p, chosen = pressure.ravel(), inside[network.i]
    drop = p[network.i] - p[network.j] + network.jump
    half = 0.5 * network.conductance * drop * chosen
    parts = []
    for part in (half * network.along, half * ~network.along):
        flow: Array = np.bincount(network.i, part, p.size) + np.bincount(network.j, part, p.size)
        parts.append(flow.reshape(network.shape))
    along, across = parts
    plane = inside.reshape(network.shape)
    along[:, 0] += 0.5 * network.inlet * (1.0 - pressure[:, 0]) * plane[:, 0]
    along[:, -1] += 0.5 * network.outlet * pressure[:, -1] * plane[:, -1]
    return along, across
