"""Files that a pattern stands for: `scans/*.sur`, or `**/side_[ab].ply`."""

from __future__ import annotations

import os
import re
from glob import glob
from pathlib import Path
from typing import Any

WILDCARD = re.compile(r"\*\*/|\*|\?|\[[^\]]+\]")
GROUPS = {"**/": "((?:.*/)?)", "*": "([^/]*)", "?": "([^/])"}


def is_pattern(name: Any, folder: Path = Path()) -> bool:
    """Return whether a name is a pattern and not that of a file."""
    return isinstance(name, str) and bool(WILDCARD.search(name)) and not (folder / name).is_file()


def files_of(pattern: str, folder: Path = Path()) -> dict[str, str]:
    """Return the files of a pattern, sorted, by what its wildcards stand for; relative ones from `folder`."""
    name = os.path.expandvars(pattern)
    pattern = Path(os.path.normpath(folder.absolute() / name)).as_posix()  # the folder may not exist yet
    paths = glob(pattern, recursive=True)  # noqa: PTH207 `Path.glob` takes no absolute one
    found = sorted(Path(path).as_posix() for path in paths if Path(path).is_file())
    groups = (GROUPS.get(part, f"({part.replace('[!', '[^')})") for part in WILDCARD.findall(pattern))
    fixed = [re.escape(text) for text in WILDCARD.split(pattern)]
    expression = re.compile("".join(text for pair in zip(fixed, [*groups, ""], strict=True) for text in pair))
    files = {}
    for path in found:
        match = expression.fullmatch(path)
        key = "_".join(filter(None, match.groups())) if match else path
        files[key] = path if Path(name).is_absolute() else Path(os.path.relpath(path, folder)).as_posix()
    return files
