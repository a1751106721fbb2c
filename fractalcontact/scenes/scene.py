"""A study as it was declared: what is given, and what is wanted."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

Table = Mapping[str, Any]


@dataclass(frozen=True)
class Scene:
    """A study: what is given, and what is wanted.

    Attributes
    ----------
    name : str
        Stem of the scene file.
    tables : mapping
        The file as parsed; ranges are spelled out as lists.
    folder : Path
        Where relative paths of the scene start.
    """

    name: str
    tables: Table
    folder: Path

    def table(self, name: str) -> Table:
        """Return one table, empty if it is not given."""
        return self.tables.get(name) or {}

    def wanted(self, room: str) -> tuple[str, ...]:
        """Return the words that `[want]` gives for a room."""
        words = self.table("want").get(room, ())
        return (words,) if isinstance(words, str) else tuple(words)

    @property
    def figures(self) -> bool:
        """Whether figures are wanted."""
        return bool(self.table("want").get("figures", False))

    @property
    def registers(self) -> bool:
        """Whether the faces of the joint are to be brought into mated position."""
        return bool(self.table("joint").get("register", False))

    def options(self, table: str, stage: str, keys: Iterable[str]) -> dict[str, Any]:
        """Return the values of `keys` from a table, those of its sub-table `stage` first."""
        whole = self.table(table)
        own = whole.get(stage)
        own = own if isinstance(own, dict) else {}
        # a stage may bear the name of an argument ([joint.closure]), so sub-tables are no values
        common = {key: value for key, value in whole.items() if not isinstance(value, dict)}
        return {key: own.get(key, common.get(key)) for key in keys if key in own or key in common}
