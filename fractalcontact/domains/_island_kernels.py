"""Loops over the parts of islands: joining them across seams, and measuring them."""

from __future__ import annotations

from typing import Any

import numpy as np

from fractalcontact.base.jit import kernel

Array = np.ndarray[Any, np.dtype[Any]]


@kernel
def _root(parent: Array, shift: Array, part: int) -> int:
    """Follow a part to the root of its island; its shift becomes that against the root."""
    root = part
    down, right = 0, 0
    while parent[root] != root:
        down += shift[root, 0]
        right += shift[root, 1]
        root = parent[root]
    while parent[part] != root and part != root:  # shorten the way for the next time
        above = parent[part]
        step_down, step_right = shift[part, 0], shift[part, 1]
        parent[part] = root
        shift[part, 0], shift[part, 1] = down, right
        down -= step_down
        right -= step_right
        part = above
    return root


@kernel
def join(links: Array, parent: Array, shift: Array, closes: Array) -> None:
    """Join parts by links (part, part, periods down, periods right): where the second part really lies.

    `parent` (parts), each at first its own, gets the root of every part; `shift` (parts, 2) its shift in
    periods (y, x) against the root; `closes` (parts, 2), for every root, whether the island closes on itself
    along y and along x.
    """
    for link in range(links.shape[0]):
        one, other = links[link, 0], links[link, 1]
        root, below = _root(parent, shift, one), _root(parent, shift, other)
        down = shift[one, 0] + links[link, 2] - shift[other, 0]
        right = shift[one, 1] + links[link, 3] - shift[other, 1]
        if root == below:
            closes[root, 0] |= down != 0
            closes[root, 1] |= right != 0
        else:
            top, under = (root, below) if root < below else (below, root)
            sign = 1 if top == root else -1
            parent[under] = top
            shift[under, 0], shift[under, 1] = sign * down, sign * right
            closes[top, 0] |= closes[under, 0]
            closes[top, 1] |= closes[under, 1]
    for part in range(parent.size):
        _root(parent, shift, part)


@kernel
def measure(
    parts: Array, cells: Array, start: int, wrap_y: bool, wrap_x: bool, sums: Array, sides: Array, box: Array
) -> None:
    """Add up the parts of a band of rows that begins at row `start` of the plane.

    `sums` (parts, 3) gets cells, rows and columns; `sides` (parts, 2) the sides across y and across x that
    face open cells; `box` (parts, 4) the first and last row and column, and holds wide limits before.
    """
    ny, nx = cells.shape
    for k in range(parts.shape[0]):
        i = start + k
        for j in range(nx):
            part = parts[k, j]
            if part == 0:
                continue
            sums[part, 0] += 1
            sums[part, 1] += i
            sums[part, 2] += j
            box[part, 0] = min(box[part, 0], i)
            box[part, 1] = max(box[part, 1], i)
            box[part, 2] = min(box[part, 2], j)
            box[part, 3] = max(box[part, 3], j)
            if (i > 0 or wrap_y) and cells[i - 1, j] == 0:
                sides[part, 0] += 1
            if (i < ny - 1 or wrap_y) and cells[(i + 1) % ny, j] == 0:
                sides[part, 0] += 1
            if (j > 0 or wrap_x) and cells[i, j - 1] == 0:
                sides[part, 1] += 1
            if (j < nx - 1 or wrap_x) and cells[i, (j + 1) % nx] == 0:
                sides[part, 1] += 1
