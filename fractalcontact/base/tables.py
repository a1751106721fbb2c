"""Text tables for the screen."""

from collections.abc import Sequence

from tabulate import tabulate


def table(rows: Sequence[Sequence[str]]) -> str:
    """Return rows of text as aligned columns; the first row is the head.

    Examples
    --------
    >>> print(table([("method", "error"), ("fast", "1e-08")]))
    method    error
    --------  -------
    fast      1e-08
    """
    head, *body = rows
    text = tabulate(body, headers=list(head), tablefmt="simple", disable_numparse=True)
    return "\n".join(line.rstrip() for line in text.splitlines())
