"""Compiled loops of the contact solver: influence coefficients and the fused passes of the iteration.

Every pass of the iteration runs over bands of blocks (`base.resources.in_bands`); a block is as many rows as
a bin of the preconditioner. The sums of a block go to its row of `out` and are added up by the caller, block
after block, so that they do not depend on the number of threads. The inner loops have no branches, so that
they are vectorised.

Symbols as in `_constrained_cg`: p pressure, u displacement, h gap of the undeformed surface, t search
direction, r = K t, z preconditioned gap, tau step length; the gap is g = u + h - closure.
"""

from __future__ import annotations

import numpy as np

from fractalcontact.base.jit import kernel, sum_kernel


@kernel
def love_table(start, stop, table, dy, dx, orders, nodes, weights):  # type: ignore[no-untyped-def]
    """Mean of 1/(pi r) over a cell of edges (dy, dx), for every offset (i dy, j dx) in `table`.

    The closed form (Love 1929) is a difference of four corners, which loses the square of the distance in
    digits. It serves the 3 x 3 nearest cells. Cells up to 4 away take the closed form along one edge and
    Gauss quadrature along the other, farther cells quadrature along both, of lower order with the distance.
    Against 40 points along one edge and the closed form along the other, for dx = dy and 2 dy, the relative
    differences were 2e-15, 7e-16 and, beyond 4, 10, 30 and 100 cells, 1e-15, 3e-15, 8e-15 and 1e-14, where
    the reference is a difference of two near numbers itself.
    """
    nx = table.shape[1]
    largest = max(dy, dx)
    for i in range(start, stop):
        for j in range(nx):
            y, x = i * dy, j * dx
            reach = max(y, x) / largest
            total = 0.0
            if i < 3 and j < 3:  # too near for quadrature, and near enough for the digits of the closed form
                for sy in (-0.5, 0.5):
                    for sx in (-0.5, 0.5):
                        b, a = y + sy * dy, x + sx * dx
                        corner = b * np.arcsinh(a / abs(b)) + a * np.arcsinh(b / abs(a))
                        total += corner if sy * sx > 0 else -corner
                table[i, j] = total / (np.pi * dy * dx)
            elif reach > 4:  # each order from where the next lower one leaves no more than rounding
                rule = 0 if reach > 100 else 1 if reach > 30 else 2 if reach > 10 else 3
                for k in range(orders[rule]):
                    for m in range(orders[rule]):
                        b, a = y + nodes[rule, k] * dy, x + nodes[rule, m] * dx
                        total += weights[rule, k] * weights[rule, m] / np.sqrt(a * a + b * b)
                table[i, j] = total / np.pi
            elif i >= j:  # closed along x, where the cell is near; quadrature across, where r changes least
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
def scale_modes(start, stop, parts, qy2, qx2, factor, invert, mean, work):  # type: ignore[no-untyped-def]
    """Multiply columns of modes by factor * |q|, or by factor / |q|; by `mean` where q = 0.

    `parts` (my, mx, 2) are real and imaginary parts. Adds up `work` (mx), the products of the modes before
    and after, unless it is empty.
    """
    weight, x2, total = np.empty(stop - start, parts.dtype), qx2[start:stop], work[start:stop]
    total[:] = 0
    for i in range(parts.shape[0]):
        row, y2 = parts[i, start:stop], qy2[i]
        if invert:  # loops of their own for the weights of a row: they are vectorised
            for j in range(weight.size):
                weight[j] = factor / np.sqrt(y2 + x2[j])
        else:
            for j in range(weight.size):
                weight[j] = factor * np.sqrt(y2 + x2[j])
        if start == 0 and y2 == 0:
            weight[0] = mean
        for j in range(total.size):
            real, imaginary = np.float64(row[j, 0]), np.float64(row[j, 1])
            total[j] += weight[j] * (real * real + imaginary * imaginary)
        for j in range(weight.size):
            row[j, 0] *= weight[j]
            row[j, 1] *= weight[j]


@kernel
def multiply_modes(start, stop, parts, symbol, work):  # type: ignore[no-untyped-def]
    """Multiply columns of modes, as real and imaginary parts (my, mx, 2), by a real symbol.

    Adds up `work` (mx), the products of the modes before and after, unless it is empty.
    """
    total = work[start:stop]
    total[:] = 0
    for i in range(parts.shape[0]):
        row, weight = parts[i, start:stop], symbol[i, start:stop]
        for j in range(total.size):
            real, imaginary = np.float64(row[j, 0]), np.float64(row[j, 1])
            total[j] += weight[j] * (real * real + imaginary * imaginary)
        for j in range(weight.size):
            row[j, 0] *= weight[j]
            row[j, 1] *= weight[j]


@kernel
def multiply_by_wave_vectors(  # type: ignore[no-untyped-def]
    start, stop, x, y, qy, qx, signed_qy, signed_qx, factor, excess, inverse, mean
):
    """Multiply the modes of two planes by w along the wave vector q and by w (1 + excess) across it.

    w is factor/|q|, or factor |q| with `inverse`, or `mean` where q = 0. The modes are real and imaginary
    parts (my, mx, 2).
    """
    for i in range(start, stop):
        for j in range(x.shape[1]):
            yy, xx = qy[i] * qy[i], qx[j] * qx[j]
            q2 = yy + xx
            if q2 > 0:
                q = np.sqrt(q2)
                weight = factor * q if inverse else factor / q
                part = weight * excess / q2
                of_xx, of_yy = weight + part * yy, weight + part * xx
                of_xy = -part * signed_qy[i] * signed_qx[j]
            else:
                of_xx, of_yy, of_xy = mean, mean, 0.0
            for k in range(2):
                a, b = x[i, j, k], y[i, j, k]
                x[i, j, k] = of_xx * a + of_xy * b
                y[i, j, k] = of_xy * a + of_yy * b


@kernel
def multiply_by_symbols(start, stop, x, y, of_xx, of_yy, of_xy):  # type: ignore[no-untyped-def]
    """Multiply the modes of two planes, as real and imaginary parts (my, mx, 2), by a symmetric matrix."""
    for i in range(start, stop):
        for j in range(x.shape[1]):
            for k in range(2):
                a, b = x[i, j, k], y[i, j, k]
                x[i, j, k] = of_xx[i, j] * a + of_xy[i, j] * b
                y[i, j, k] = of_xy[i, j] * a + of_yy[i, j] * b


@sum_kernel
def objective_sums(start, stop, rows, h, u, p, p_max, out):  # type: ignore[no-untyped-def]
    """Sum p, p u, p h over all nodes, and p, p (u + h) over the nodes below p_max."""
    ny, nx = p.shape
    for k in range(start, stop):
        force, p_u, p_h, force_below, level = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):
                value = np.float64(p[i, j])
                pu, ph = value * u[i, j], value * h[i, j]
                force += value
                p_u += pu
                p_h += ph
                if value < p_max:
                    force_below += value
                    level += pu + ph
        out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4] = force, p_u, p_h, force_below, level


@sum_kernel
def residual_sums(start, stop, rows, h, u, p, p_max, closure, out):  # type: ignore[no-untyped-def]
    """Sum p max(g, 0), find the largest overlap, and sum the error inside and outside of the free set.

    Inside (0 < p < p_max) and outside (p = 0 and g < 0, or p = p_max and g > 0): count, sum g, sum g^2.
    """
    ny, nx = p.shape
    zero = 0 * closure
    lowest = np.empty(nx, p.dtype)
    for k in range(start, stop):
        opened, n_in, s_in, q_in, n_out, s_out, q_out = 0.0, 0, 0.0, 0.0, 0, 0.0, 0.0
        for j in range(nx):
            lowest[j] = 0
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):  # a loop of its own: a minimum among the sums would prevent vectorisation
                g = u[i, j] + h[i, j] - closure
                g = g if p[i, j] < p_max else zero
                lowest[j] = g if g < lowest[j] else lowest[j]
            for j in range(nx):
                g = np.float64(u[i, j] + h[i, j] - closure)
                value = p[i, j]
                inside = (value > 0) & (value < p_max)
                outside = ((value <= 0) & (g < 0)) | ((value >= p_max) & (g > 0))
                g_in, g_out = g if inside else 0.0, g if outside else 0.0
                opened += value * (g if g > 0 else 0.0)
                n_in += inside
                s_in += g_in
                q_in += g_in * g_in
                n_out += outside
                s_out += g_out
                q_out += g_out * g_out
        least = zero
        for j in range(nx):
            least = lowest[j] if lowest[j] < least else least
        out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4] = opened, -least, n_in, s_in, q_in
        out[k, 5], out[k, 6], out[k, 7] = n_out, s_out, q_out


@sum_kernel
def select_free_set(  # type: ignore[no-untyped-def]
    start, stop, rows, columns, h, u, p, p_max, closure, admit, shift, unit, mask, x, bins, counts, out
):
    """Choose the free set, put its gap less `shift` over `unit` into x, and sum both over the bins.

    Free are the nodes with 0 < p < p_max and, where `admit`, the nodes outside that violate the conditions
    of contact. Counts the changes of `mask`.
    """
    ny, nx = p.shape
    zero, factor = 0 * shift, 1 / unit
    row_sum, row_count = np.empty(nx, x.dtype), np.empty(nx, x.dtype)
    for k in range(start, stop):
        changes = 0
        for j in range(nx):
            row_sum[j], row_count[j] = 0, 0
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):
                g = u[i, j] + h[i, j] - closure
                value = p[i, j]
                violating = ((value <= 0) & (g < 0)) | ((value >= p_max) & (g > 0))
                free = ((value > 0) & (value < p_max)) | (violating & admit)
                x[i, j] = (g - shift) * factor if free else zero
                row_count[j] += 1 if free else 0
                changes += free != mask[i, j]
                mask[i, j] = free
            for j in range(nx):
                row_sum[j] += x[i, j]
        for b in range(bins.shape[1]):  # not over all nodes with j // columns: divisions take long
            # not summed in the arrays: whether that is vectorised would depend on their places in memory
            total, count = x.dtype.type(0), x.dtype.type(0)
            for j in range(b * columns, min(b * columns + columns, nx)):
                total += row_sum[j]
                count += row_count[j]
            bins[k, b], counts[k, b] = total, count
        out[k, 0] = changes


@sum_kernel
def fill_outside(start, stop, rows, columns, mask, bins, x):  # type: ignore[no-untyped-def]
    """Fill x outside of the free set, where it is zero, with the value of the bin."""
    my, mx = mask.shape
    row = np.empty(mx, x.dtype)
    for k in range(start, stop):
        for b in range(bins.shape[1]):
            for j in range(b * columns, min(b * columns + columns, mx)):
                row[j] = bins[k, b]
        for i in range(k * rows, min(k * rows + rows, my)):
            for j in range(mx):
                x[i, j] += 0 * row[j] if mask[i, j] else row[j]


@sum_kernel
def sum_outside(start, stop, rows, columns, mask, x, bins):  # type: ignore[no-untyped-def]
    """Sum x outside of the free set over the bins."""
    my, mx = mask.shape
    row = np.empty(mx, x.dtype)
    for k in range(start, stop):
        for j in range(mx):
            row[j] = 0
        for i in range(k * rows, min(k * rows + rows, my)):
            for j in range(mx):
                row[j] += 0 * x[i, j] if mask[i, j] else x[i, j]
        for b in range(bins.shape[1]):
            total = x.dtype.type(0)
            for j in range(b * columns, min(b * columns + columns, mx)):
                total += row[j]
            bins[k, b] = total


@sum_kernel
def add_bins(start, stop, rows, columns, mask, bins, h, u, t, closure, x, out):  # type: ignore[no-untyped-def]
    """Add the bins to x, which makes it z over its unit; on the free set sum x, x g and t."""
    ny, nx = h.shape
    row = np.empty(nx, x.dtype)
    for k in range(start, stop):
        z_sum, z_g, t_sum = 0.0, 0.0, 0.0
        for b in range(bins.shape[1]):
            for j in range(b * columns, min(b * columns + columns, nx)):
                row[j] = bins[k, b]
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):
                z = x[i, j] + row[j]
                x[i, j] = z
                free = np.float64(z) if mask[i, j] else 0.0
                z_sum += free
                z_g += free * (u[i, j] + h[i, j] - closure)
                t_sum += np.float64(t[i, j]) if mask[i, j] else 0.0
        out[k, 0], out[k, 1], out[k, 2] = z_sum, z_g, t_sum


@sum_kernel
def search_direction(  # type: ignore[no-untyped-def]
    start, stop, rows, mask, z, unit, mean, beta, h, u, closure, t, out
):
    """Set t = unit z - mean + beta t on the free set and 0 outside; sum t and t g."""
    ny, nx = t.shape
    zero = 0 * mean
    for k in range(start, stop):
        t_sum, t_g = 0.0, 0.0
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):
                value = unit * z[i, j] - mean + beta * t[i, j] if mask[i, j] else zero
                t[i, j] = value
                t_sum += value
                t_g += np.float64(value) * (u[i, j] + h[i, j] - closure)
        out[k, 0], out[k, 1] = t_sum, t_g


@sum_kernel
def projected_step_sums(start, stop, rows, p, t, tau, p_max, out):  # type: ignore[no-untyped-def]
    """Count the nodes that p - tau t takes out of bounds; sum its projection onto them."""
    ny, nx = t.shape
    zero = 0 * tau
    for k in range(start, stop):
        clipped, force = 0, 0.0
        for i in range(k * rows, min(k * rows + rows, ny)):
            for j in range(nx):
                value = p[i, j] - tau * t[i, j]
                clipped += (value < 0) | (value > p_max)
                value = value if value > 0 else zero
                force += value if value < p_max else p_max
        out[k, 0], out[k, 1] = clipped, force


@kernel
def pair_sum(start, stop, table, iy, ix, targets, sources, value, out):  # type: ignore[no-untyped-def]
    """Sum table[offset to the source] * value over the sources, for every target node."""
    for k in range(start, stop):
        y, x = iy[targets[k]], ix[targets[k]]
        total = 0.0
        for m in range(sources.size):
            dy, dx = abs(y - iy[sources[m]]), abs(x - ix[sources[m]])
            # unsigned indices: no test for negative ones
            total += table[np.uint32(dy), np.uint32(dx)] * value[m]
        out[targets[k]] = total
