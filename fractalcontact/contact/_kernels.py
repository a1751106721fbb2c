"""Loops of the contact solver: influence tables and the fused passes of the iteration."""

from __future__ import annotations

import numpy as np

from fractalcontact.base.jit import parallel_kernel, prange


@parallel_kernel
def love_table(table, dy, dx, orders, nodes, weights):  # type: ignore[no-untyped-def]
    """Mean of 1/(pi r) over a cell of edges (dy, dx), for every offset (i dy, j dx) in `table`."""
    ny, nx = table.shape
    largest = max(dy, dx)
    for i in prange(ny):
        for j in range(nx):
            y, x = i * dy, j * dx
            reach = max(y, x) / largest
            if i < 3 and j < 3:
                total = 0.0
                for sy in (-0.5, 0.5):
                    for sx in (-0.5, 0.5):
                        b, a = y + sy * dy, x + sx * dx
                        corner = b * np.arcsinh(a / abs(b)) + a * np.arcsinh(b / abs(a))
                        total += corner if sy * sx > 0 else -corner
                table[i, j] = total / (np.pi * dy * dx)
                continue
            rule = 0 if reach > 100 else 1 if reach > 30 else 2 if reach > 10 else 3 if reach > 4 else 4
            total = 0.0
            if rule < 4:
                for p in range(orders[rule]):
                    for q in range(orders[rule]):
                        b, a = y + nodes[rule, p] * dy, x + nodes[rule, q] * dx
                        total += weights[rule, p] * weights[rule, q] / np.sqrt(a * a + b * b)
                table[i, j] = total / np.pi
            elif i * dy * dx >= j * dx * dy and i >= 3:
                for p in range(orders[4]):
                    b = y + nodes[4, p] * dy
                    total += weights[4, p] * (np.arcsinh((x + dx / 2) / b) - np.arcsinh((x - dx / 2) / b))
                table[i, j] = total / (np.pi * dx)
            else:
                for q in range(orders[4]):
                    a = x + nodes[4, q] * dx
                    total += weights[4, q] * (np.arcsinh((y + dy / 2) / a) - np.arcsinh((y - dy / 2) / a))
                table[i, j] = total / (np.pi * dy)
