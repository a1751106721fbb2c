"""Compiled loops over heights.

They are imported inside the functions that call them: a study that needs no loop does not load numba.
"""

from __future__ import annotations

import numpy as np

from fractalcontact.base.jit import gap_sum_kernel, kernel
from fractalcontact.base.numbers import Array


@gap_sum_kernel
def increment_sums(start: int, stop: int, heights: Array, stride: int, edges: Array, sums: Array) -> None:
    """Sum squared increments that start in each of the rows from start up to stop; a NaN gives NaN.

    `edges` (blocks + 1) cut the columns in which they start into blocks. The last axis of `sums` (rows,
    blocks, 12): along x the first differences over 1, 2 and 4 `stride`, then the second differences over
    1, 2 and 4 `stride`; the same six along y.
    """
    ny, nx = heights.shape
    for j in range(start, stop):
        for k in range(6):
            x, y = (0, stride << k - 3) if k > 2 else (stride << k, 0)
            once, twice = j + y, j + 2 * y
            for block in range(edges.size - 1):
                low, high = edges[block], edges[block + 1]
                # unsigned, so that numba adds no test for negative indices
                here, there, beyond = np.uint32(low), np.uint32(low + x), np.uint32(low + 2 * x)
                last = high if high < nx - 2 * x else nx - 2 * x
                double = last - low if twice < ny and last > low else 0
                last = high if high < nx - x else nx - x
                single = last - low if once < ny else 0
                first = second = 0.0
                for i in range(double):
                    u = heights[once, i + there] - heights[j, i + here]
                    v = (heights[twice, i + beyond] - heights[once, i + there]) - u
                    first += u * u
                    second += v * v
                for i in range(double, single):
                    u = heights[once, i + there] - heights[j, i + here]
                    first += u * u
                column = k if k < 3 else k + 3
                sums[j, block, column], sums[j, block, column + 3] = first, second


@gap_sum_kernel
def gapped_increment_sums(
    start: int, stop: int, heights: Array, stride: int, edges: Array, sums: Array, counts: Array
) -> None:
    """Do what `increment_sums` does without the increments that have a NaN, and count the others."""
    ny, nx = heights.shape
    for j in range(start, stop):
        for k in range(6):
            x, y = (0, stride << k - 3) if k > 2 else (stride << k, 0)
            once, twice = j + y, j + 2 * y
            column = k if k < 3 else k + 3
            for block in range(edges.size - 1):
                low, high = edges[block], edges[block + 1]
                here, there, beyond = np.uint32(low), np.uint32(low + x), np.uint32(low + 2 * x)
                last = high if high < nx - x else nx - x
                total, number = 0.0, 0
                for i in range(last - low if once < ny else 0):
                    u = heights[once, i + there] - heights[j, i + here]
                    is_known = u == u
                    total += u * u if is_known else 0.0
                    number += is_known
                sums[j, block, column], counts[j, block, column] = total, number
                last = high if high < nx - 2 * x else nx - 2 * x
                total, number = 0.0, 0
                for i in range(last - low if twice < ny else 0):
                    u = heights[once, i + there] - heights[j, i + here]
                    v = (heights[twice, i + beyond] - heights[once, i + there]) - u
                    is_known = v == v
                    total += v * v if is_known else 0.0
                    number += is_known
                sums[j, block, column + 3], counts[j, block, column + 3] = total, number


@kernel
def pair_sums(
    start: int,
    stop: int,
    heights: Array,
    columns: Array,
    lags: Array,
    measure: int,
    sums: Array,
    counts: Array,
) -> None:
    """Sum increments from the rows from start up to stop, and the columns from columns[0] up to columns[1].

    `lags` (k, 2) are steps in y (not negative) and x. `measure` 0 sums squares of first differences, 1
    their absolute values, 2 squares of second differences. `sums` and `counts` are (rows, k); an increment
    with a NaN in it is left out.
    """
    ny, nx = heights.shape
    for j in range(start, stop):
        for k in range(lags.shape[0]):
            dy, dx = lags[k, 0], lags[k, 1]
            reach = 2 if measure == 2 else 1
            total = 0.0
            number = 0
            if j + reach * dy < ny:
                first = max(columns[0], -reach * dx)
                last = min(columns[1], nx - reach * dx)
                row, on = heights[j], heights[j + dy]
                beyond = heights[j + reach * dy]
                for i in range(first, last):
                    v = on[i + dx] - row[i]
                    if measure == 2:
                        v = (beyond[i + 2 * dx] - on[i + dx]) - v
                    if v == v:
                        total += abs(v) if measure == 1 else v * v
                        number += 1
            sums[j, k] = total
            counts[j, k] = number


@kernel
def prism_sums(
    start: int,
    stop: int,
    heights: Array,
    step_y: int,
    step_x: int,
    length_y: float,
    length_x: float,
    sums: Array,
    counts: Array,
) -> None:
    """Sum area over plan area of the four triangles on every cell of step_y x step_x points, by rows.

    The apex is the mean of the corners. `sums` and `counts` are (rows,), rows = ny - step_y; a cell with a
    NaN corner is left out.
    """
    nx = heights.shape[1]
    for j in range(start, stop):
        low, high = heights[j], heights[j + step_y]
        total = 0.0
        number = 0
        for i in range(nx - step_x):
            a, b, c, d = low[i], low[i + step_x], high[i], high[i + step_x]
            south, north, west, east = (
                (b - a) / length_x,
                (d - c) / length_x,
                (c - a) / length_y,
                (d - b) / length_y,
            )
            # gradient across each triangle: from the middle of its edge to the apex
            rise = 0.5 * (west + east)
            run = 0.5 * (south + north)
            area = (
                (1.0 + south * south + rise * rise) ** 0.5
                + (1.0 + north * north + rise * rise) ** 0.5
                + (1.0 + west * west + run * run) ** 0.5
                + (1.0 + east * east + run * run) ** 0.5
            )
            if area == area:
                total += 0.25 * area
                number += 1
        sums[j] = total
        counts[j] = number


@kernel
def roughness_sums(
    start: int,
    stop: int,
    heights: Array,
    size_y: int,
    size_x: int,
    rows: Array,
    columns: Array,
    is_square: bool,
    sums: Array,
    counts: Array,
) -> None:
    """Sum the rms deviation from its own plane, or its square, over windows at `rows` and `columns`.

    From rows[start] up to rows[stop]. `sums` and `counts` are (rows.size,); a window with a NaN in it is left
    out. The rows of a band of windows are added up first: heights, their squares and moments about y.
    """
    nx = heights.shape[1]
    number = size_y * size_x
    squares_x = number * (size_x * size_x - 1.0) / 12.0
    squares_y = number * (size_y * size_y - 1.0) / 12.0
    line, square, moment = np.empty(nx), np.empty(nx), np.empty(nx)
    for r in range(start, stop):
        line[:] = 0.0
        square[:] = 0.0
        moment[:] = 0.0
        total, known = 0.0, 0
        for i in range(nx):
            if heights[rows[r], i] == heights[rows[r], i]:
                total += heights[rows[r], i]
                known += 1
        level = total / known if known else 0.0  # squares about it lose few digits
        for j in range(rows[r], rows[r] + size_y):
            y = j - rows[r] - 0.5 * (size_y - 1)
            for i in range(nx):
                v = heights[j, i] - level
                line[i] += v
                square[i] += v * v
                moment[i] += y * v
        for c in range(columns.size):
            mean = rest = along_x = along_y = 0.0
            for i in range(size_x):
                v = line[columns[c] + i]
                mean += v
                rest += square[columns[c] + i]
                along_x += v * (i - 0.5 * (size_x - 1))
                along_y += moment[columns[c] + i]
            rest -= mean * mean / number + along_x * along_x / squares_x
            if size_y > 1:
                rest -= along_y * along_y / squares_y
            if rest == rest:
                rest = max(rest, 0.0) / number
                sums[r] += rest if is_square else rest**0.5
                counts[r] += 1


@kernel
def walk(heights: Array, spacing: float, opening: float) -> tuple[float, float]:
    """Walk along every line (lines, n) with dividers; return the length, the rest included, and the steps.

    The next step ends where the straight lines between the points first leave the circle of radius `opening`
    about the last one. Lengths are in openings, and steps on one line are taken at once: no square overflows.
    """
    total, count = 0.0, 0.0
    n = heights.shape[1]
    for line in range(heights.shape[0]):
        z = heights[line]
        at_x, at_z = 0.0, z[0] / opening
        k = 1
        while k < n:
            end_x, end_z = k * spacing / opening, z[k] / opening
            if np.hypot(end_x - at_x, end_z - at_z) < 1.0:
                k += 1
                continue
            # from the point before, or from the last step if that is on the same line
            from_x, from_z = (k - 1) * spacing / opening, z[k - 1] / opening
            if at_x > from_x:
                from_x, from_z = at_x, at_z
            length = np.hypot(end_x - from_x, end_z - from_z)
            along_x, along_z = (end_x - from_x) / length, (end_z - from_z) / length
            back_x, back_z = from_x - at_x, from_z - at_z
            along = back_x * along_x + back_z * along_z
            outside = back_x * back_x + back_z * back_z - 1.0
            far = np.sqrt(max(along * along - outside, 0.0)) - along
            more = np.floor(max(length - far, 0.0))
            at_x, at_z = from_x + (far + more) * along_x, from_z + (far + more) * along_z
            total += 1.0 + more
            count += 1.0 + more
            if more > 1e15:  # beyond the digits of a number the end of the line is reached
                at_x, at_z = end_x, end_z
                k += 1
        total += np.hypot((n - 1) * spacing / opening - at_x, z[n - 1] / opening - at_z)
    return total * opening, count
