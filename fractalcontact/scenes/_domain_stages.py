"""The stages that analyse the set of true contacts."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.study import group_of
from fractalcontact.base.units import number, span
from fractalcontact.scenes._result_tables import Column, at_value, finite, length, plain, share_of
from fractalcontact.scenes._stage_type import ISLAND_MAP, StageType, stage_type


def _window(state: xr.Dataset) -> str | None:
    """Return the lengths over which the dimension was fitted; those over others are not comparable."""
    names = ("window_low", "window_high") if "window_low" in state else ("scale_min", "scale_max")
    if not set(names) <= set(state.variables) or not finite(state[names[0]]).size:
        return None
    ends = np.concatenate([finite(state[name]) for name in names])
    is_length = state[names[0]].attrs.get("units") == "m"
    text = span(ends, length) if is_length else f"{span(ends, number)} cells"
    return text.replace(" ", "\N{NO-BREAK SPACE}")


def _on_sets(_: xr.DataTree, data: xr.Dataset) -> Iterator[str]:
    """Yield how many sets differ from random ones of equal coverage, and in how many boxes are saturated."""
    if "differs_from_random" in data:
        differs = np.asarray(data["differs_from_random"].values, dtype=bool)
        yield (
            "The counts of boxes of 2, 3 and 4 cells, not the dimensions, are tested against random sets of "
            f"equal coverage: {int(differs.sum())} of {differs.size} sets differ."
        )
    if "is_saturated" in data and (count := int(data["is_saturated"].sum())):
        yield (
            f"More than half of the largest boxes meet the contacts in {count} of "
            f"{data['is_saturated'].size} states: there D tells little more than the coverage."
        )


def _beside_null(name: str, null: str) -> Any:
    """Return a function that writes a variable and, in brackets, that of random cells of equal coverage.

    Over several box sizes both are those of the middle one.
    """

    def write(state: xr.Dataset) -> str | None:
        if name not in state:
            return None
        state = state.isel(box_size=state.sizes.get("box_size", 0) // 2, missing_dims="ignore")
        return plain(state[name], 2) + (f" ({plain(state[null], 2)})" if null in state else "")

    return write


def _middle_box(state: xr.Dataset) -> str | None:
    if "box_size" not in state.dims:
        return None
    return length(float(state["box_length"][state.sizes["box_size"] // 2]))


def _crosses(state: xr.Dataset) -> str | None:
    """Return the axes along which the set of contacts crosses the body, and in how many members."""
    if "percolates" not in state or "axis" not in state.coords:
        return None
    along = {str(axis): state["percolates"].sel(axis=axis) for axis in state["axis"].values}
    axes = [f"{axis}{share_of(int(each.sum()), each.size)}" for axis, each in along.items() if each.any()]
    return f"along {' and '.join(axes)}" if axes else "no"


def _window_dimension(state: xr.Dataset) -> str | None:
    """Return the dimension over the window and that of random spots, or why there is none."""
    if "domain_dimension" not in state:
        return None
    if finite(state["domain_dimension"]).size:
        return f"{plain(state['domain_dimension'], 2)} ({plain(state['spots_dimension'], 2)})"
    flag = state["signature_flag"]
    names = flag.attrs["flag_meanings"].split()
    words = [names[value].replace("_", " ") for value in np.unique(flag.values)]
    return ", ".join(words)


def _longest_scale(name: str) -> Any:
    """Return a function that takes a variable at the longest of the three scales of the window."""
    return lambda state: state[name].isel(scale=-1) if name in state else None


def _signature_window(
    _: xr.DataTree, data: xr.Dataset, others: str = "; clustering and patches at {}"
) -> Iterator[str]:
    """Yield the windows (each member has its own), and why some states have no dimension."""
    ends = zip(*(data[name].values.ravel() for name in ("window_low", "window_high")), strict=True)
    for low, high in dict.fromkeys((length(low), length(high)) for low, high in ends if np.isfinite(low)):
        yield f"D is over {low} to {high}, beside that of random spots{others.format(high)}."
    reasons = [str(reason) for reason in data["reason"].values.ravel() if reason]
    if reasons:
        of_which = "" if len(set(reasons)) == 1 else "; the last of them"
        yield f"{len(reasons)} of {data['reason'].size} states have no dimension{of_which}: {reasons[-1]}."


def _evolution_remarks(tree: xr.DataTree, data: xr.Dataset) -> Iterator[str]:
    """Yield what is counted, and what holds for dimensions where no table of the signature says it."""
    yield "Births, deaths, merges and splits are those since the state before on the path of load or shear."
    if group_of(tree, SIGNATURE) is None:
        yield from _signature_window(tree, data, others="")


SIGNATURE = "domains/signature"
OVER = ("shear", "step")  # a table has rows over the shears, each under the last load, or over the load


def _domain(
    name: str, title: str = "", *columns: Column, needs: tuple[str, ...] = (), **more: Any
) -> StageType:
    options: dict[str, Any] = {
        "table": f"domains.{name}",
        "wanted": f"domains.{name}",
        "first_dim": True,
    } | more
    source, function = ("contact or joints/closure", *needs), f"domains.{name}"
    return stage_type(
        f"domains/{name}", source, function, title, OVER, *columns, takes="map", reads="state", **options
    )


def _set_dimension(name: str, words: str, null: str = " (random)", **more: Any) -> StageType:
    return _domain(
        name,
        words,
        Column(f"{words} D{null}", _beside_null(name, "null_dimension")),
        Column("over", _window),
        Column("95 % interval", ("ci_low", "ci_high"), 2, screen=False),
        remarks=_on_sets,
        **more,
    )


STAGES = (
    # one window of lengths for all states
    _domain(
        "signature",
        "signature of the contact set",
        Column("spot", "spot_size"),
        Column("gap", "gap_size"),
        Column("D (random spots)", _window_dimension),
        Column("clustering", _longest_scale("clustering"), 2),
        Column("patch", _longest_scale("integral_range")),
        Column("lacunarity x : y", _longest_scale("lacunarity_ratio"), 2, screen=False),
        remarks=_signature_window,
        whole_path=True,
    ),
    _set_dimension("box_dimension", "box", whole_path=True),
    _domain("box_counts"),
    _set_dimension("minkowski_dimension", "Minkowski"),
    _set_dimension("correlation_dimension", "correlation"),
    _domain(
        "generalised_dimensions",
        "generalised dimensions",
        *(
            Column(f"D_{order}", at_value("generalised_dimension", "moment_order", order), 2)
            for order in (0, 1, 2)
        ),
    ),
    _set_dimension("boundary_dimension", "boundary", null=""),
    _domain(
        "lacunarity",
        "lacunarity",
        Column("lacunarity (random)", _beside_null("lacunarity", "null_lacunarity")),
        Column("boxes", _middle_box),
    ),
    _domain(
        "islands",
        "islands",
        Column("islands", "n_islands", 0),
        Column("largest island", "largest_island"),
        Column("mean area", "mean_island_area", screen=False),
        keeps=(ISLAND_MAP,),
        whole_path=True,
    ),
    _domain(
        "percolation",
        "percolation",
        Column("contacts cross", _crosses),
        Column("largest share", "largest_share"),
    ),
    _domain("hausdorff_content"),
    _domain(
        "describe",
        "contact set",
        Column("islands", "n_islands", 0),
        Column("box D (random)", _beside_null("box_dimension", "null_dimension")),
        Column("D over the window", _window_dimension),
        Column("clustering", _longest_scale("clustering"), 2),
        Column("contacts cross", _crosses, screen=False),
        whole_path=True,
    ),
    _domain(
        "evolution",
        "evolution",
        Column("births", "births", 0),
        Column("deaths", "deaths", 0),
        Column("merges", "merges", 0),
        Column("splits", "splits", 0),
        Column("D (random spots)", _window_dimension, screen=False),
        remarks=_evolution_remarks,
        needs=(SIGNATURE,),
        whole_path=True,
    ),
    _domain("lineage", whole_path=True),
)
