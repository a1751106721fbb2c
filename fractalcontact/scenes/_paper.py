"""The statements of Borri-Brunetto, Carpinteri and Chiaia (1998), each beside the result of a study."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from fractalcontact.base.tables import table
from fractalcontact.scenes._caveats import group_of
from fractalcontact.scenes._contents import note

Array = np.ndarray[Any, np.dtype[Any]]

PAPER_DIMENSION = (2.15, 2.29)  # of the scanned face
PAPER_SHEAR, PAPER_BLOCK = 8e-4, 2e-2  # m: shear of the plateau, edge of the block
PLATEAU = 0.25  # largest last change over the first one that counts as a plateau
MIN_CELLS = 30  # fewer cells in contact resolve no spot


class Statement(NamedTuple):
    """One statement of the paper: its section, the statement, the result of the study, and the comparison."""

    section: str
    statement: str
    result: str
    agrees: str


def paper_table(tree: xr.DataTree) -> str:
    """Compare a study with the statements of the 1998 paper.

    Parameters
    ----------
    tree : DataTree
        From `fractalcontact.scenes.run` or `fractalcontact.open`; nothing else is read.

    Returns
    -------
    str
        A row for every statement for which the study has data. Empty where there is no joint.

    Notes
    -----
    The paper states orders of magnitude and trends; its surface is not published, so that its numbers cannot
    be reproduced. `summary` prints this table for a scene with ``paper = true``.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> result = fc.scenes.run("rigid_sliding", progress=False)
    >>> print(fc.scenes.paper_table(result).splitlines()[3][-3:])
    yes
    """
    statements = paper_statements(tree)
    if not statements:
        return ""
    rows = [("section", "statement of the paper", "this study", "agrees"), *statements]
    limit = (
        "The paper states orders of magnitude and trends; neither its surface nor its modulus is published."
    )
    return "\n".join([table(rows), note(limit)])


def paper_statements(tree: xr.DataTree) -> list[Statement]:
    """Return the statements of the paper for which a study has data, each beside its result."""
    if "joints" not in tree.children:
        return []
    return [statement for part in PARTS for statement in part(tree)]


def _surface_dimension(tree: xr.DataTree) -> Iterator[Statement]:
    estimates = group_of(tree, "dimensions")
    if estimates is None or "method" not in estimates.dims:
        return
    dimension = np.asarray(estimates["fractal_dimension"].values, dtype=float)
    low, high = PAPER_DIMENSION
    inside = (np.nanmin(dimension) >= low - 0.05) and (np.nanmax(dimension) <= high + 0.05)
    span = f"{np.nanmin(dimension):.2f} to {np.nanmax(dimension):.2f} by {dimension.size} methods"
    yield Statement("2", f"dimension of the face {low} to {high}", span, _word(inside))


def _delta_surface(tree: xr.DataTree) -> Iterator[Statement]:
    delta = group_of(tree, "joints/delta_surface")
    if delta is None:
        return
    from fractalcontact import dimensions

    plane = delta["height"].isel(shear=-1) if "shear" in delta["height"].dims else delta["height"]
    curve = dimensions.covering(plane)
    slopes = np.gradient(np.log(curve["covering_area"].values), np.log(curve["cube_size"].values))
    by_area = 2.0 - float(np.mean(slopes[:3]))
    shear = float(np.max(delta["shear"].values)) * 1e3
    yield Statement(
        "3",
        "the delta-surface has a dimension above 2",
        f"{by_area:.2f} at {shear:.3g} mm, from its area",
        _word(by_area > 2.005),
    )


def _closure(tree: xr.DataTree) -> Iterator[Statement]:
    closure = group_of(tree, "joints/closure")
    if closure is None or closure.sizes.get("step", 1) < 2:
        return
    area, force = _values(closure, "contact_fraction"), _values(closure, "normal_force")
    if closure.sizes["shear"] > 1:
        yield from _closure_over_shear(closure, area)
    resolved = (area > 0) & (force > 0) & (area * _cells(closure) >= MIN_CELLS)
    exponents = [
        float(np.polyfit(np.log(forces[rows]), np.log(areas[rows]), 1)[0])
        for areas, forces, rows in zip(area, force, resolved, strict=True)
        if rows.sum() > 2
    ]
    if exponents:
        yield Statement(
            "4",
            "contact area nearly proportional to F",
            f"A ~ F^{min(exponents):.2f} to F^{max(exponents):.2f}",
            _word(min(exponents) > 0.85 and max(exponents) < 1.1),
        )


def _closure_over_shear(closure: xr.Dataset, area: Array) -> Iterator[Statement]:
    inner, last = _values(closure, "interface_closure")[:, -1] * 1e6, area[:, -1] * 100
    changes = np.abs(np.diff(last))
    yield Statement(
        "4",
        "compliance grows with v",
        f"w_int {inner[0]:.3g} to {inner[-1]:.3g} um",
        _word(bool((np.diff(inner) > 0).all())),
    )
    yield Statement(
        "4",
        "contact area at equal F falls with v",
        f"{last[0]:.2g} to {last[-1]:.2g} % at the largest force",
        _word(bool((np.diff(last) < 0).all())),
    )
    yield Statement(
        "4",
        "... then stays nearly constant",
        f"last change {changes[-1] / max(changes[0], 1e-300):.0%} of the first",
        _word(bool(changes[-1] <= PLATEAU * changes[0])),
    )


def _contact_set(tree: xr.DataTree) -> Iterator[Statement]:
    boxes = group_of(tree, "domains/box_dimension")
    if boxes is None or "step" not in boxes.dims:
        return
    dimension, null = _values(boxes, "box_dimension"), _values(boxes, "null_dimension")
    rises = dimension[:, -1] > dimension[:, 0]
    yield Statement(
        "4",
        "dimension of the contact domain grows with F from 0, below 2",
        f"{np.nanmin(dimension[:, 0]):.2f} to {np.nanmax(dimension[:, -1]):.2f}; random null "
        f"{np.nanmin(null[:, 0]):.2f} to {np.nanmax(null[:, -1]):.2f}",
        _word(bool(rises.all()) and float(np.nanmax(dimension)) < 2.0),
    )


def _rigid_dilatancy(tree: xr.DataTree) -> Iterator[Statement]:
    rigid = group_of(tree, "joints/rigid_dilatancy")
    if rigid is None or rigid.sizes.get("shear", 1) < 3 or "direction" not in rigid.dims:
        return
    shear = np.asarray(rigid["shear"].values, dtype=float)
    dilatancy = np.asarray(rigid["rigid_dilatancy"].transpose("direction", "shear").values) * 1e3
    slope = np.asarray(rigid["mean_slope"].values, dtype=float)
    names = [str(name) for name in rigid["direction"].values]
    edge = np.sqrt(float(rigid["nominal_area"]))
    early = int(np.argmin(np.abs(shear - PAPER_SHEAR / PAPER_BLOCK * edge)))
    rising, falling = slope > 0, slope < 0
    two_pairs = rising.any() and falling.any()
    agrees = bool(two_pairs and dilatancy[rising, -1].min() > dilatancy[falling, -1].max())
    values = ", ".join(
        f"{name} {row[early]:.2g} / {row[-1]:.2g}" for name, row in zip(names, dilatancy, strict=True)
    )
    yield Statement(
        "4",
        "two directions reach a plateau, the opposite two keep rising",
        f"mm at {shear[early] * 1e3:.2g} / {shear[-1] * 1e3:.3g} mm: {values}",
        _word(agrees),
    )
    slopes = ", ".join(f"{name} {value:+.3f}" for name, value in zip(names, slope, strict=True))
    yield Statement("4", "... because of the mean slope of the face", slopes, _word(agrees))


def _elastic_dilatancy(tree: xr.DataTree) -> Iterator[Statement]:
    elastic = group_of(tree, "joints/elastic_dilatancy")
    if elastic is None:
        return
    first = elastic.isel(direction=0) if "direction" in elastic.dims else elastic
    moved = np.atleast_1d(first["shear"].values) > 0
    rigid = np.atleast_1d(first["rigid_dilatancy"].values)[moved]
    loaded = np.asarray(first["dilatancy"].transpose("shear", "step").values)[moved]
    if rigid.size == 0:
        return
    ordered = (loaded[:, 0] < rigid).all() and (np.diff(loaded, axis=1) < 0).all()
    values = ", ".join(f"{value * 1e6:.3g}" for value in (rigid[-1], *loaded[-1]))
    yield Statement(
        "4", "dilatancy falls with F, always below the rigid one", f"{values} um", _word(bool(ordered))
    )


def _decorrelation(tree: xr.DataTree) -> Iterator[Statement]:
    result = group_of(tree, "joints/decorrelation_length")
    if result is None:
        return
    lengths = np.atleast_1d(result["decorrelation_length"].values) * 1e3
    values = ", ".join(f"{value:.2g}" if np.isfinite(value) else "none" for value in lengths)
    agrees = _word(bool(np.isfinite(lengths).any()))
    yield Statement("4", "the faces decorrelate beyond a threshold", f"{values} mm", agrees)


def _friction(tree: xr.DataTree) -> Iterator[Statement]:
    from fractalcontact.joints import PARK_PAULAY

    friction = group_of(tree, "joints/friction")
    if friction is None:
        return
    angle = np.asarray(friction["friction_angle"].values, dtype=float)
    basic = float(friction["basic_friction_angle"])
    codes = " and ".join(f"{value:g} ({name})" for name, value in PARK_PAULAY.items())
    coefficient = np.tan(np.radians(angle[angle < 90.0]))
    span = (
        f"{coefficient.min():.2f} to {coefficient.max():.2f}" if coefficient.size else "none: the faces lock"
    )
    yield Statement("1", f"coefficients in codes: {codes}", span, "compare")
    yield Statement(
        "4",
        "friction angle = basic + dilatancy angle",
        f"{basic:g} + {np.nanmin(angle) - basic:.1f} to {np.nanmax(angle) - basic:.1f} degree",
        "by definition",
    )


PARTS: tuple[Callable[[xr.DataTree], Iterator[Statement]], ...] = (
    _surface_dimension,
    _delta_surface,
    _closure,
    _contact_set,
    _rigid_dilatancy,
    _elastic_dilatancy,
    _decorrelation,
    _friction,
)


def _values(data: xr.Dataset, name: str) -> Array:
    """Return a variable over (shear, step); of several directions the first."""
    variable = data[name]
    if "direction" in variable.dims:
        variable = variable.isel(direction=0)
    for dim in ("shear", "step"):
        if dim not in variable.dims:
            variable = variable.expand_dims({dim: data.sizes.get(dim, 1)})
    return np.asarray(variable.transpose("shear", "step").values, dtype=float)


def _cells(closure: xr.Dataset) -> float:
    """Return the number of cells of the block."""
    crack = json.loads(closure.attrs["provenance"])["parameters"]["crack"]
    return float(np.prod(crack["block_cells"]))


def _word(agrees: bool) -> str:
    return "yes" if agrees else "no"
