"""Loops of the contact solver: influence tables and the fused passes of the iteration.

Every pass runs over bands of blocks; a block is as many rows as a bin of the preconditioner. Sums go to one
row of `out` for each block and are added up by the caller, so that they do not depend on the bands.
"""

from __future__ import annotations

import numpy as np

from fractalcontact.base.jit import kernel

# ruff: noqa: D103 (each pass is described where it is used, in _descent.py)


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
def scale_modes(start, stop, modes, qy2, qx2, factor, invert, mean):  # type: ignore[no-untyped-def]
    """Multiply modes by factor * |q|, or by factor / |q|; by `mean` where q = 0."""
    for i in range(start, stop):
        for j in range(modes.shape[1]):
            q2 = qy2[i] + qx2[j]
            q = np.sqrt(q2)
            if q2 == 0:
                modes[i, j] *= mean
            elif invert:
                modes[i, j] *= factor / q
            else:
                modes[i, j] *= factor * q


@kernel
def multiply(start, stop, modes, symbol):  # type: ignore[no-untyped-def]
    """Multiply modes by a real symbol."""
    for i in range(start, stop):
        for j in range(modes.shape[1]):
            modes[i, j] *= symbol[i, j]


@kernel
def weigh(start, stop, rows, gap, u, p, cap, out):  # type: ignore[no-untyped-def]
    """Sum p, p u, p gap over all nodes, and p, p (u + gap) over those below the cap."""
    ny, nx = p.shape
    for k in range(start, stop):
        force, work, height, below, level = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):
                value = p[i, j]
                if value > 0:
                    pu, ph = np.float64(value) * u[i, j], np.float64(value) * gap[i, j]
                    force += value
                    work += pu
                    height += ph
                    if value < cap:
                        below += value
                        level += pu + ph
        out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4] = force, work, height, below, level


@kernel
def inspect(start, stop, rows, gap, u, p, cap, closure, out):  # type: ignore[no-untyped-def]
    """Measure the error: sum p g+, greatest overlap; and how it divides between the set and outside.

    Inside (0 < p < cap) and outside (p = 0 overlapping, p = cap open): count, sum g, sum g^2.
    """
    ny, nx = p.shape
    for k in range(start, stop):
        opened, overlap, n_in, s_in, q_in, n_out, s_out, q_out = 0.0, 0.0, 0, 0.0, 0.0, 0, 0.0, 0.0
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):
                g = np.float64(u[i, j] + gap[i, j] - closure)
                value = p[i, j]
                if value > 0:
                    if g > 0:
                        opened += value * g
                    if value < cap:
                        n_in += 1
                        s_in += g
                        q_in += g * g
                        overlap = max(overlap, -g)
                    elif g > 0:
                        n_out += 1
                        s_out += g
                        q_out += g * g
                elif g < 0:
                    n_out += 1
                    s_out += g
                    q_out += g * g
                    overlap = max(overlap, -g)
        out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4] = opened, overlap, n_in, s_in, q_in
        out[k, 5], out[k, 6], out[k, 7] = n_out, s_out, q_out


@kernel
def select(start, stop, rows, columns, gap, u, p, cap, closure, admit, shift, mask, x, bins, counts, out):  # type: ignore[no-untyped-def]
    """Choose the free set, put its gap less `shift` into x, and sum both over the bins.

    Free are 0 < p < cap and, where `admit`, the nodes outside that want in. Counts the changes of `mask`.
    """
    ny, nx = p.shape
    for k in range(start, stop):
        bins[k, :] = 0.0
        counts[k, :] = 0.0
        changes = 0
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):
                g = u[i, j] + gap[i, j] - closure
                value = p[i, j]
                free = value > 0 and value < cap
                if not free and admit:
                    free = (value <= 0 and g < 0) or (value >= cap and g > 0)
                changes += free != mask[i, j]
                mask[i, j] = free
                if free:
                    x[i, j] = g - shift
                    bins[k, j // columns] += g - shift
                    counts[k, j // columns] += 1
        out[k, 0] = changes


@kernel
def extend(start, stop, rows, columns, mask, bins, x):  # type: ignore[no-untyped-def]
    """Fill x outside the free set with the value of the bin."""
    my, mx = mask.shape
    for k in range(start, stop):
        for i in range(k * rows, min(k * rows + rows, my)):
            for j in range(mx):
                if not mask[i, j]:
                    x[i, j] = bins[k, j // columns]


@kernel
def collect(start, stop, rows, columns, mask, x, bins):  # type: ignore[no-untyped-def]
    """Sum x outside the free set over the bins."""
    my, mx = mask.shape
    for k in range(start, stop):
        bins[k, :] = 0.0
        for i in range(k * rows, min(k * rows + rows, my)):
            for j in range(mx):
                if not mask[i, j]:
                    bins[k, j // columns] += x[i, j]


@kernel
def correct(start, stop, rows, columns, mask, bins, gap, u, r, closure, x, out):  # type: ignore[no-untyped-def]
    """Add the bin to x on the free set; sum x, x g, x r and r there."""
    ny, nx = gap.shape
    for k in range(start, stop):
        z_sum, zg, zr, r_sum = 0.0, 0.0, 0.0, 0.0
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):
                if mask[i, j]:
                    z = x[i, j] + bins[k, j // columns]
                    x[i, j] = z
                    z_sum += z
                    zg += np.float64(z) * (u[i, j] + gap[i, j] - closure)
                    zr += np.float64(z) * r[i, j]
                    r_sum += r[i, j]
        out[k, 0], out[k, 1], out[k, 2], out[k, 3] = z_sum, zg, zr, r_sum


@kernel
def turn(start, stop, rows, mask, x, mean, beta, t):  # type: ignore[no-untyped-def]
    """Direction t = x - mean + beta t on the free set, zero outside."""
    ny, nx = t.shape
    for k in range(start, stop):
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):
                t[i, j] = x[i, j] - mean + beta * t[i, j] if mask[i, j] else 0.0


@kernel
def slope(start, stop, rows, gap, u, t, r, closure, out):  # type: ignore[no-untyped-def]
    """Sum g t and t r."""
    ny, nx = t.shape
    for k in range(start, stop):
        gt, tr = 0.0, 0.0
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):
                along = np.float64(t[i, j])
                gt += along * (u[i, j] + gap[i, j] - closure)
                tr += along * r[i, j]
        out[k, 0], out[k, 1] = gt, tr


@kernel
def advance(start, stop, rows, p, t, step, cap, new, out):  # type: ignore[no-untyped-def]
    """Step along -t and clip to 0 .. cap; count what was clipped, sum what is new (all, and at the cap)."""
    ny, nx = t.shape
    for k in range(start, stop):
        clipped, force, capped = 0, 0.0, 0.0
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):
                value = p[i, j] - step * t[i, j]
                if value < 0:
                    value = p[i, j] * 0
                    clipped += 1
                elif value >= cap:
                    clipped += p[i, j] < cap
                    value = cap
                    capped += value
                new[i, j] = value
                force += value
        out[k, 0], out[k, 1], out[k, 2] = clipped, force, capped


@kernel
def rescale(start, stop, rows, p, factor, cap, out):  # type: ignore[no-untyped-def]
    """Scale what is below the cap; sum all, and what is at the cap."""
    ny, nx = p.shape
    for k in range(start, stop):
        force, capped = 0.0, 0.0
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):
                value = p[i, j]
                if value < cap:
                    value = value * factor
                    if value >= cap:
                        value = cap
                    p[i, j] = value
                if value >= cap:
                    capped += value
                force += value
        out[k, 0], out[k, 1] = force, capped


@kernel
def follow(start, stop, rows, u, r, step):  # type: ignore[no-untyped-def]
    """Settlement after a step that was not clipped."""
    ny, nx = u.shape
    for k in range(start, stop):
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):
                u[i, j] -= step * r[i, j]


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
