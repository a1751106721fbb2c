"""Progress bars on the error stream."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

T = TypeVar("T")


def track(
    items: Iterable[T], enabled: bool, description: str, *, unit: str = "step", total: int | None = None
) -> Iterable[T]:
    """Iterate over `items`; show a bar if `enabled` and the loop takes longer than a second."""
    if not enabled:
        return items
    from tqdm import tqdm

    return tqdm(items, desc=description, unit=unit, total=total, dynamic_ncols=True, delay=1.0, leave=False)
