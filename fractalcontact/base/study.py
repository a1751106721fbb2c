"""The tree of a study: its groups, and the members of an ensemble."""

from __future__ import annotations

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
