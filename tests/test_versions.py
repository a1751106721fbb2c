"""The constraints of the oldest libraries name what pyproject.toml allows."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FLOORS = ROOT / ".ci" / "floors.txt"
# of the tests alone, or without a floor: not in the constraints
LEFT_OUT = {
    "mypy",
    "ruff",
    "sphinx",
    "sphinx-gallery",
    "numpydoc",
    "pydata-sphinx-theme",
    "compliance-checker",
}

pytestmark = pytest.mark.skipif(not FLOORS.is_file(), reason="no checkout: .ci is not in the archive")


def requirements():
    """Return the floors of pyproject.toml by library."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"].values()
    lines = [*project["dependencies"], *(line for extra in extras for line in extra)]
    pairs = (re.fullmatch(r"([\w-]+)(?:\[.*\])?>=([\d.]+)", line) for line in lines)
    return {pair[1]: pair[2] for pair in pairs if pair}


def constraints():
    """Return the first constraint of each library: that of the oldest Python."""
    found = {}
    for line in FLOORS.read_text(encoding="utf-8").splitlines():
        pair = re.match(r"([\w-]+)==([\d.]+)", line)
        if pair:
            found.setdefault(pair[1], pair[2])
    return found


def numbers(version):
    parts = [int(part) for part in version.split(".")]
    return parts + [0] * (3 - len(parts))


def test_every_floor_is_a_constraint_and_no_other():
    floors, pinned = requirements(), constraints()
    assert set(floors) >= LEFT_OUT
    assert set(floors) - LEFT_OUT == set(pinned)
    different = {name: floors[name] for name in pinned if numbers(floors[name]) != numbers(pinned[name])}
    assert not different
