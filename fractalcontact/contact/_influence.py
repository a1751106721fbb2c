"""Influence coefficients: the displacement of one node under a unit force on another.

Everything here is for a contact modulus of 1: force (N) times coefficient (1/m) over E* (Pa) is the
displacement (m). Sources: Boussinesq (1885); Love (1929, Phil. Trans. A 228:377) for the rectangle; Sneddon
(1946) for the plate; the lattice sums are those of Epstein (1903), summed after Ewald (1921).
"""

from __future__ import annotations

from functools import cache, lru_cache

import numpy as np

from fractalcontact.base.numbers import Array

DISC_RADII = ("second_order", "inscribed", "equal_area")


def disc_coefficients(shape: tuple[int, int], spacing: tuple[float, float], radius: float) -> Array:
    """Return the displacement at node (i, j) under a unit force on a rigid circular plate at (0, 0).

    It is that of the surface at the point of the node, at the distance r from the centre of the plate: for
    a radius a it is asin(a/r)/(pi a), and 1/(2a) on the plate itself. Shape (ny, nx), 1/m for a modulus of 1.
    """
    distance = np.hypot(np.arange(shape[0])[:, None] * spacing[0], np.arange(shape[1])[None, :] * spacing[1])
    distance[0, 0] = 1.0
    table = np.arcsin(np.minimum(radius / distance, 1.0)) / (np.pi * radius)
    table[0, 0] = 0.5 / radius
    return np.asarray(table)


def square_coefficients(shape: tuple[int, int], spacing: tuple[float, float]) -> Array:
    """Return the displacement at node (i, j) under a unit force spread evenly over the cell of (0, 0).

    Shape (ny, nx), 1/m for a modulus of 1. Near cells by the closed form, far ones by Gauss quadrature,
    because the closed form loses digits with the square of the distance.
    """
    from fractalcontact.base.resources import in_bands
    from fractalcontact.contact._kernels import love_table

    table = np.empty(shape)
    in_bands(love_table, shape[0], table.size, table, *spacing, *_gauss_rules())
    return table


@cache
def _gauss_rules() -> tuple[Array, Array, Array]:
    """Return orders of Gauss quadrature with their nodes and weights on a unit interval, a row each.

    In two directions beyond 100, 30, 10 and 4 cells, where the closed form loses digits; in one direction of
    the strip that is integrated in closed form along the other, for the cells between.
    """
    orders = (3, 4, 6, 10, 16)  # the least that leave rounding, see `love_table`
    nodes = np.zeros((len(orders), max(orders)))
    weights = np.zeros_like(nodes)
    for row, order in enumerate(orders):
        x, w = np.polynomial.legendre.leggauss(order)  # takes as long as the table of 64 x 64 nodes
        nodes[row, :order], weights[row, :order] = x / 2, w / 2
    return np.array(orders), nodes, weights


def disc_radius(choice: str, spacing: tuple[float, float]) -> float:
    """Return the radius of the plate in the unit of `spacing`, by name."""
    if choice == "inscribed":
        return min(spacing) / 2
    mean = float(np.sqrt(spacing[0]) * np.sqrt(spacing[1]))
    if choice == "equal_area":
        return mean / float(np.sqrt(np.pi))
    return second_order_radius(max(spacing) / min(spacing)) * mean


@lru_cache
def second_order_radius(ratio: float) -> float:
    """Return the radius, over the root of the cell area, that makes the plates second-order accurate.

    It is the smaller root of a lattice sum: under uniform pressure the plates are displaced as much as the
    half-space is.
    """
    if ratio == 1.0:  # the usual case: the root that is found below, to the last digit but one
        return 0.4365941077293225
    from scipy.optimize import brentq

    smallest = 1.0 / np.sqrt(ratio)
    # the sum falls from +inf to its least value somewhere below the touching of two plates; 15 and 281 trials
    # gave the radius to 2e-15, a start at .1 too, one at .5 misses it
    trial = np.linspace(0.3, 1.0, 141) * smallest
    excess = np.array([local_excess(float(a), ratio) for a in trial])
    first = int(np.argmax(excess < 0))
    if not excess[first] < 0:
        raise ValueError(f"no second-order radius for a spacing ratio of {ratio:g}")
    ends = trial[first - 1], trial[first]
    # to rounding: the default tolerances leave 4e-13
    return float(brentq(local_excess, *ends, args=(ratio,), xtol=1e-16, rtol=1e-15))


def local_excess(
    radius: float,
    ratio: float,
    near: int = 12,  # 8 and 20 give the same radius to 3e-16
    terms: int = 6,  # 5 give it to 2e-16, 4 to 4e-14
) -> float:
    """Return the displacement under unit pressure beyond that of the half-space; cell area and modulus 1.

    Cells up to `near` away are summed one by one, the tail by lattice sums of `terms` powers.
    """
    distance = _lattice(ratio, near)
    tail = 0.0
    coefficient = 1.0  # of x^(2k+1) in asin x
    for k in range(1, terms + 1):
        coefficient *= (2 * k - 1) ** 2 / (2.0 * k * (2 * k + 1))
        far = epstein_zeta(2 * k + 1, ratio) - float(np.sum(distance ** -(2.0 * k + 1)))
        tail += coefficient * radius ** (2 * k) * far
    cells = float(np.sum(np.arcsin(np.minimum(radius / distance, 1.0)) / radius - 1.0 / distance))
    return 0.5 / radius + (epstein_zeta(1, ratio) + cells + tail) / np.pi


@lru_cache
def epstein_zeta(power: int, ratio: float) -> float:
    """Sum r^-power over a rectangular lattice of cell area 1 without its origin; odd `power`.

    For power 1 the integral over the plane is subtracted from the sum.
    """
    from scipy.special import gamma

    x = np.pi * _lattice(ratio, 8) ** 2  # of 4, 5, 6, 8 and 12 cells all gave the same bits
    direct = np.sum(_upper_gamma(power, x) * x ** (-power / 2))
    dual = np.sum(_upper_gamma(2 - power, x) * x ** (power / 2 - 1))
    total = direct + dual - 2.0 / power - 2.0 / (2 - power)
    return float(total * np.pi ** (power / 2) / gamma(power / 2))


def _lattice(ratio: float, cells: int) -> Array:
    """Return the distances of the nodes of a lattice of cell area 1 from the origin, without the origin."""
    index = np.arange(-cells, cells + 1)
    distance = np.hypot(index[:, None] * np.sqrt(ratio), index[None, :] / np.sqrt(ratio)).ravel()
    return np.asarray(distance[distance > 0])


def _upper_gamma(twice: int, x: Array) -> Array:
    """Return the upper incomplete gamma function of half an odd integer, twice/2, which may be negative."""
    from scipy.special import erfc

    value, order = np.sqrt(np.pi) * erfc(np.sqrt(x)), 0.5
    while 2 * order < twice:
        value, order = order * value + x**order * np.exp(-x), order + 1
    while 2 * order > twice:
        order -= 1
        value = (value - x**order * np.exp(-x)) / order
    return np.asarray(value)
