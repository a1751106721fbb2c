"""Text tables for the screen, no wider than it."""

from __future__ import annotations

import shutil
from collections.abc import Sequence

from tabulate import tabulate

WIDTH = 110  # where the output is no terminal
MIN_COLUMN = 9  # characters: a narrower column would break the words of its head
GAP = 2  # between columns


def screen_width() -> int:
    """Return the width of the terminal, which the environment variable COLUMNS overrides."""
    return shutil.get_terminal_size(fallback=(WIDTH, 24)).columns


def table(rows: Sequence[Sequence[str]], width: int | None = None) -> str:
    """Return rows of text as aligned columns; the first row is the head.

    Where the table would be wider than `width` (by default the screen), its widest cells take several lines.

    Examples
    --------
    >>> print(table([("method", "error"), ("fast", "1e-08")]))
    method    error
    --------  -------
    fast      1e-08
    """
    head, *body = rows
    widths = _column_widths(rows, screen_width() if width is None else width)
    text = tabulate(
        body,
        headers=list(head),
        tablefmt="simple",
        disable_numparse=True,
        maxcolwidths=widths if body else None,
        maxheadercolwidths=widths,
    )
    return "\n".join(line.rstrip() for line in text.splitlines())


def _column_widths(rows: Sequence[Sequence[str]], width: int) -> list[int]:
    """Return the width of every column: that of its longest cell, the widest columns cut until all fit."""
    # the library makes every column two characters wider than its head
    widths = [max(len(row[0]) + GAP, *(len(cell) for cell in row)) for row in zip(*rows, strict=True)]
    while sum(widths) + GAP * (len(widths) - 1) > width and max(widths) > MIN_COLUMN:
        widths[widths.index(max(widths))] -= 1
    return widths
