"""Loops of the contact solver: influence tables and the fused passes of the iteration.

Every pass runs over bands of blocks; a block is as many rows as a bin of the preconditioner. Sums go to one
row of `out` for each block and are added up by the caller, so that they do not depend on the bands. The inner
loops are written without branches, so that they run in vector lanes.
"""

from __future__ import annotations

import numpy as np

from fractalcontact.base.jit import kernel, sum_kernel


@kernel
def love_table(start, stop, table, dy, dx, orders, nodes, weights):  # type: ignore[no-untyped-def]
    """Mean of 1/(pi r) over a cell of edges (dy, dx), for every offset (i dy, j dx) in `table`."""
    nx = table.shape[1]
    largest = max(dy, dx)
    for i in range(start, stop):
        for j in range(nx):
            y, x = i * dy, j * dx
            reach = max(y, x) / largest
            total = 0.0
            if i < 3 and j < 3:
                for sy in (-0.5, 0.5):
                    for sx in (-0.5, 0.5):
                        b, a = y + sy * dy, x + sx * dx
                        corner = b * np.arcsinh(a / abs(b)) + a * np.arcsinh(b / abs(a))
                        total += corner if sy * sx > 0 else -corner
                table[i, j] = total / (np.pi * dy * dx)
            elif reach > 4:
                rule = 0 if reach > 100 else 1 if reach > 30 else 2 if reach > 10 else 3
                for k in range(orders[rule]):
                    for m in range(orders[rule]):
                        b, a = y + nodes[rule, k] * dy, x + nodes[rule, m] * dx
                        total += weights[rule, k] * weights[rule, m] / np.sqrt(a * a + b * b)
                table[i, j] = total / np.pi
            elif i >= j:
                for k in range(orders[4]):
                    b = y + nodes[4, k] * dy
                    total += weights[4, k] * (np.arcsinh((x + dx / 2) / b) - np.arcsinh((x - dx / 2) / b))
                table[i, j] = total / (np.pi * dx)
            else:
                for k in range(orders[4]):
                    a = x + nodes[4, k] * dx
                    total += weights[4, k] * (np.arcsinh((y + dy / 2) / a) - np.arcsinh((y - dy / 2) / a))
                table[i, j] = total / (np.pi * dy)


@kernel
def scale_modes(start, stop, parts, qy2, qx2, factor, invert, mean):  # type: ignore[no-untyped-def]
    """Multiply modes by factor * |q|, or by factor / |q|; by `mean` where q = 0.

    `parts` (my, mx, 2) are real and imaginary parts.
    """
    for i in range(start, stop):
        for j in range(parts.shape[1]):
            q = np.sqrt(qy2[i] + qx2[j])
            weight = (factor / q if q > 0 else mean) if invert else (factor * q if q > 0 else mean)
            parts[i, j, 0] *= weight
            parts[i, j, 1] *= weight


@kernel
def multiply(start, stop, parts, symbol):  # type: ignore[no-untyped-def]
    """Multiply modes, as real and imaginary parts (my, mx, 2), by a real symbol."""
    for i in range(start, stop):
        for j in range(parts.shape[1]):
            parts[i, j, 0] *= symbol[i, j]
            parts[i, j, 1] *= symbol[i, j]


@sum_kernel
def weigh(start, stop, rows, gap, u, p, cap, out):  # type: ignore[no-untyped-def]
    """Sum p, p u, p gap over all nodes, and p, p (u + gap) over those below the cap."""
    ny, nx = p.shape
    for k in range(start, stop):
        force, work, height, below, level = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):
                value = np.float64(p[i, j])
                pu, ph = value * u[i, j], value * gap[i, j]
                force += value
                work += pu
                height += ph
                if value < cap:
                    below += value
                    level += pu + ph
        out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4] = force, work, height, below, level


@sum_kernel
def inspect(start, stop, rows, gap, u, p, cap, closure, out):  # type: ignore[no-untyped-def]
    """Measure the error: sum p g+, greatest overlap; and how it divides between the set and outside.

    Inside (0 < p < cap) and outside (p = 0 overlapping, p = cap open): count, sum g, sum g^2.
    """
    ny, nx = p.shape
    nothing = 0 * closure
    low = np.empty(nx, p.dtype)
    for k in range(start, stop):
        opened, n_in, s_in, q_in, n_out, s_out, q_out = 0.0, 0, 0.0, 0.0, 0, 0.0, 0.0
        for j in range(nx):
            low[j] = 0
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):  # on its own: a greatest value among the sums would stop the lanes
                g = u[i, j] + gap[i, j] - closure
                g = g if p[i, j] < cap else nothing
                low[j] = g if g < low[j] else low[j]
            for j in range(nx):
                g = np.float64(u[i, j] + gap[i, j] - closure)
                value = p[i, j]
                inside = (value > 0) & (value < cap)
                outside = ((value <= 0) & (g < 0)) | ((value >= cap) & (g > 0))
                within, without = g if inside else 0.0, g if outside else 0.0
                opened += value * (g if g > 0 else 0.0)
                n_in += inside
                s_in += within
                q_in += within * within
                n_out += outside
                s_out += without
                q_out += without * without
        least = nothing
        for j in range(nx):
            least = low[j] if low[j] < least else least
        out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4] = opened, -least, n_in, s_in, q_in
        out[k, 5], out[k, 6], out[k, 7] = n_out, s_out, q_out


@sum_kernel
def select(start, stop, rows, columns, gap, u, p, cap, closure, admit, shift, mask, x, bins, counts, out):  # type: ignore[no-untyped-def]
    """Choose the free set, put its gap less `shift` into x, and sum both over the bins.

    Free are 0 < p < cap and, where `admit`, the nodes outside that want in. Counts the changes of `mask`.
    """
    ny, nx = p.shape
    nothing = 0 * shift
    wide, many = np.empty(nx, x.dtype), np.empty(nx, x.dtype)
    for k in range(start, stop):
        changes = 0
        for j in range(nx):
            wide[j], many[j] = 0, 0
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):
                g = u[i, j] + gap[i, j] - closure
                value = p[i, j]
                wanting = ((value <= 0) & (g < 0)) | ((value >= cap) & (g > 0))
                free = ((value > 0) & (value < cap)) | (wanting & admit)
                x[i, j] = g - shift if free else nothing
                many[j] += 1 if free else 0
                changes += free != mask[i, j]
                mask[i, j] = free
            for j in range(nx):
                wide[j] += x[i, j]
        for j in range(bins.shape[1]):
            bins[k, j], counts[k, j] = 0, 0
        for j in range(nx):
            bins[k, j // columns] += wide[j]
            counts[k, j // columns] += many[j]
        out[k, 0] = changes


@sum_kernel
def extend(start, stop, rows, columns, mask, bins, x):  # type: ignore[no-untyped-def]
    """Fill x, zero outside the free set, with the value of the bin there."""
    my, mx = mask.shape
    wide = np.empty(mx, x.dtype)
    for k in range(start, stop):
        for j in range(mx):
            wide[j] = bins[k, j // columns]
        for i in range(k * rows, min(k * rows + rows, my)):
            for j in range(mx):
                x[i, j] += 0 * wide[j] if mask[i, j] else wide[j]


@sum_kernel
def collect(start, stop, rows, columns, mask, x, bins):  # type: ignore[no-untyped-def]
    """Sum x outside the free set over the bins."""
    my, mx = mask.shape
    wide = np.empty(mx, x.dtype)
    for k in range(start, stop):
        for j in range(mx):
            wide[j] = 0
        for i in range(k * rows, min(k * rows + rows, my)):
            for j in range(mx):
                wide[j] += 0 * x[i, j] if mask[i, j] else x[i, j]
        for j in range(bins.shape[1]):
            bins[k, j] = 0
        for j in range(mx):
            bins[k, j // columns] += wide[j]


@sum_kernel
def correct(start, stop, rows, columns, mask, bins, gap, u, t, closure, x, out):  # type: ignore[no-untyped-def]
    """Add the bin to x; on the free set sum x, x g and t."""
    ny, nx = gap.shape
    wide = np.empty(nx, x.dtype)
    for k in range(start, stop):
        total, along, last = 0.0, 0.0, 0.0
        for j in range(nx):
            wide[j] = bins[k, j // columns]
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):
                z = x[i, j] + wide[j]
                x[i, j] = z
                free = np.float64(z) if mask[i, j] else 0.0
                total += free
                along += free * (u[i, j] + gap[i, j] - closure)
                last += np.float64(t[i, j]) if mask[i, j] else 0.0
        out[k, 0], out[k, 1], out[k, 2] = total, along, last


@sum_kernel
def turn(start, stop, rows, mask, x, mean, beta, gap, u, closure, t, out):  # type: ignore[no-untyped-def]
    """Direction t = x - mean + beta t on the free set, zero outside; sum t and t g."""
    ny, nx = t.shape
    nothing = 0 * mean
    for k in range(start, stop):
        total, along = 0.0, 0.0
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):
                value = x[i, j] - mean + beta * t[i, j] if mask[i, j] else nothing
                t[i, j] = value
                total += value
                along += np.float64(value) * (u[i, j] + gap[i, j] - closure)
        out[k, 0], out[k, 1] = total, along


@sum_kernel
def bend(start, stop, rows, t, r, out):  # type: ignore[no-untyped-def]
    """Sum t r."""
    for k in range(start, stop):
        total = 0.0
        for i in range(k * rows, min(k * rows + rows, t.shape[0])):
            for j in range(t.shape[1]):
                total += np.float64(t[i, j]) * r[i, j]
        out[k, 0] = total


@sum_kernel
def survey(start, stop, rows, p, t, step, cap, out):  # type: ignore[no-untyped-def]
    """Count what a step along -t would push over the bounds; sum what it leaves, cut to them."""
    ny, nx = t.shape
    nothing = 0 * step
    for k in range(start, stop):
        clipped, force = 0, 0.0
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):
                value = p[i, j] - step * t[i, j]
                clipped += (value < 0) | (value > cap)
                value = value if value > 0 else nothing
                force += value if value < cap else cap
        out[k, 0], out[k, 1] = clipped, force


@kernel
def pair_sum(start, stop, table, iy, ix, wanted, sources, value, out):  # type: ignore[no-untyped-def]
    """Sum of table[distance to source] * value over the sources, for every wanted node."""
    for k in range(start, stop):
        y, x = iy[wanted[k]], ix[wanted[k]]
        total = 0.0
        for m in range(sources.size):
            dy, dx = abs(y - iy[sources[m]]), abs(x - ix[sources[m]])
            total += table[np.uint32(dy), np.uint32(dx)] * value[m]  # unsigned: no test for negatives
        out[wanted[k]] = total
