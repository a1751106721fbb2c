"""What a result or the tree of a study holds: groups, members of an ensemble, origin, sources of methods."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.units import quantity_text

if TYPE_CHECKING:
    import xarray as xr

MEMBER = "member"  # the dim of an ensemble


def group_of(tree: xr.DataTree, path: str) -> xr.Dataset | None:
    """Return the Dataset of a group, None where the study has none."""
    node = tree
    for name in path.split("/"):
        if name not in node.children:
            return None
        node = node.children[name]
    return node.to_dataset() if node.has_data else None


def member_count(tree: xr.DataTree) -> int:
    """Return the number of members of an ensemble; 0 for a single study."""
    return max((node.sizes[MEMBER] for node in tree.subtree if MEMBER in node.sizes), default=0)


def of_member(tree: xr.DataTree, number: int) -> xr.DataTree:
    """Return the results of one member of an ensemble."""
    member_tree: xr.DataTree = tree.map_over_datasets(
        lambda data: data.isel({MEMBER: number}, missing_dims="ignore")
    )
    member_tree.attrs = dict(tree.attrs)
    return member_tree


BORRI_BRUNETTO_1998 = (
    "Borri-Brunetto, Carpinteri and Chiaia, Contact, closure and friction behaviour of rough crack concrete "
    "surfaces, FRAMCOS-3 (1998)"
)
NO_REFERENCES = "none"


def joined_references(*texts: str) -> str:
    """Return the sources of several methods, each once."""
    sources = dict.fromkeys(source for text in texts for source in text.split("; ") if text != NO_REFERENCES)
    return "; ".join(sources) or NO_REFERENCES


def provenance_of(data: Any) -> dict[str, Any]:
    """Return the provenance of a result, as `provenance.stamp` wrote it; empty for other data."""
    try:
        entry = json.loads(data.attrs.get("provenance", "{}"))
    except (AttributeError, TypeError, ValueError):
        return {}
    return entry if isinstance(entry, dict) else {}


def entries_in(provenance: Any) -> Iterator[dict[str, Any]]:
    """Yield every table in a provenance: those of the calls that made its arguments after its own."""
    if isinstance(provenance, dict):
        yield provenance
        provenance = list(provenance.values())
    for each in provenance if isinstance(provenance, list) else ():
        yield from entries_in(each)


def stated_argument(provenance: Any, names: Sequence[str]) -> str:
    """Return which of some arguments the call of a provenance states, else one that made its arguments.

    Of several the first of `names`; empty where none is stated.
    """
    calls = (each.get("parameters") for each in entries_in(provenance))
    entries = (call for call in calls if isinstance(call, dict))
    return next((name for call in entries for name in names if call.get(name) is not None), "")


def end_of_first_leg(test: xr.Dataset) -> str:
    """Return the shear at which a shear test first turns or ends; empty of a result without its path.

    Every leg has both its ends.
    """
    if not {"shear", "point"} <= {*test.variables, *test.sizes}:
        return ""
    positions = test["shear"].transpose(..., "point").values
    legs = positions.reshape(-1, test.sizes["point"])[0, 1:]  # the first of its points is before all legs
    turns = np.flatnonzero(np.diff(legs) == 0.0)
    return quantity_text(legs[turns[0] if turns.size else -1], "m")


def scene_of(data: Any) -> dict[str, Any]:
    """Return the scene of a study, from the provenance of its root; empty for other data."""
    parameters = provenance_of(data).get("parameters")
    scene = parameters.get("scene") if isinstance(parameters, dict) else None
    return scene if isinstance(scene, dict) else {}
