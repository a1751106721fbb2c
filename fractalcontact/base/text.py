"""Plain tables for the screen."""

from collections.abc import Sequence

WIDTH = 110


def table(rows: Sequence[tuple[str, ...]]) -> str:
    """Return rows as aligned columns, the first row as the head."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    lines = [
        "  ".join(f"{cell:<{width}}" for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in rows
    ]
    return "\n".join([lines[0], "-" * min(WIDTH, sum(widths) + 2 * len(widths) - 2), *lines[1:]])
