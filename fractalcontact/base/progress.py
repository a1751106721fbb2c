"""Progress bars for stages that may take more than a moment; silent unless asked for."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

T = TypeVar("T")


def track(
    items: Iterable[T], enabled: bool, description: str, *, unit: str = "step", total: int | None = None
) -> Iterable[T]:
    """Iterate over `items`, showing a bar on the error stream when `enabled`."""
    if not enabled:
        return items
    from tqdm import tqdm

    return tqdm(items, desc=description, unit=unit, total=total, dynamic_ncols=True, delay=1.0, leave=False)
