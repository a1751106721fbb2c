"""Text tables for the screen, no wider than it."""

from __future__ import annotations

import re
import shutil
import textwrap
from collections.abc import Sequence
from html import escape

from tabulate import tabulate

GAP = 2  # spaces that tabulate puts between columns
GLUE = "\N{NO-BREAK SPACE}"  # between number and unit while cells are wrapped
BEFORE_UNIT = r"(?<=\d) (?=[%°]|[fpnµmkMGT]?(?:m|N|Pa|J|s)\b)"  # the space of a quantity in a sentence
# the spaces of a quantity; where these make a table too wide, it may break before its ±
QUANTITY = (r"(?<=\d) (?=[±µ%°A-Za-z])|(?<=±) ", r"(?<=\d) (?=[µ%°A-Za-z])|(?<=±) ")


def screen_width() -> int:
    """Return the width of the terminal, which the environment variable COLUMNS overrides; 110 of a file."""
    return shutil.get_terminal_size(fallback=(110, 24)).columns


def table(rows: Sequence[Sequence[str]], width: int | None = None, *, rule: bool = True) -> str:
    """Return rows of text as aligned columns; the first row is the head.

    Where the table would be wider than `width` (by default the screen), its widest cells take several lines;
    a number keeps its unit. Without `rule` there is no line below the head.

    Examples
    --------
    >>> print(table([("method", "error"), ("fast", "1e-08")]))
    method    error
    --------  -------
    fast      1e-08
    """
    limit = screen_width() if width is None else width
    for spaces in QUANTITY:
        glued = [[re.sub(spaces, GLUE, cell) for cell in row] for row in rows]
        widths = _column_widths(glued, limit)
        if _total(widths) <= limit:
            break
    head, *body = glued
    text = tabulate(
        body,
        headers=head,
        tablefmt="simple" if rule else "plain",
        disable_numparse=True,
        maxcolwidths=widths if body else None,
        maxheadercolwidths=[max(size - GAP, 1) for size in widths] if body else None,  # heads are padded
    )
    return "\n".join(line.rstrip() for line in text.replace(GLUE, " ").splitlines())


def html_table(title: str, rows: Sequence[tuple[str, str]]) -> str:
    """Return a small table of names and values for a notebook."""
    body = tabulate(rows, tablefmt="html", disable_numparse=True)
    return f"<div><b>{escape(title)}</b>{body}</div>"


def _column_widths(rows: Sequence[Sequence[str]], width: int) -> list[int]:
    """Return the width of every column: that of its longest cell, the widest columns cut until all fit."""
    columns = list(zip(*rows, strict=True))
    widths = [max(len(head) + GAP, *map(len, cells), 0) for head, *cells in columns]
    shortest = [max(_longest_word(head) + GAP, *map(_longest_word, cells), 0) for head, *cells in columns]
    while _total(widths) > width:
        slack = [size - least for size, least in zip(widths, shortest, strict=True)]
        if max(slack) <= 0:
            break
        widths[max((i for i, unused in enumerate(slack) if unused > 0), key=lambda i: widths[i])] -= 1
    return widths


def _total(widths: Sequence[int]) -> int:
    return sum(widths) + GAP * (len(widths) - 1)


def _longest_word(cell: str, most: int = 24) -> int:
    """Return the length of the longest word of a cell; one of more than `most` characters may be broken."""
    return min(most, max((len(word) for word in re.split(r" |(?<=-)", cell)), default=0))


def note(words: str, indent: int = 2) -> str:
    """Return a remark, indented below its table and wrapped to the width of the screen."""
    first, rest = " " * indent, " " * (indent + 2)
    glued = re.sub(BEFORE_UNIT, GLUE, words)
    filled = textwrap.fill(glued, screen_width(), initial_indent=first, subsequent_indent=rest)
    return filled.replace(GLUE, " ")
