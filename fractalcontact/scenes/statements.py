"""The statements of the founding paper, each beside what a study finds, from its saved file alone."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fractalcontact.base.tables import table

if TYPE_CHECKING:
    import xarray as xr

Array = np.ndarray[Any, np.dtype[Any]]

PAPER_DIMENSION = (2.15, 2.29)  # of the scanned face
PAPER_SMALL, PAPER_PARTS = 8e-4, 2e-2  # m: shear of the plateau, edge of the block
LEVEL = 0.25  # greatest change, over that between the least shears, that counts as levelled
HARDNESS = (0.1e9, 1e9)  # Pa: of cement paste and of hard aggregate, between which concrete yields
FEW = 30  # cells in contact that resolve no spot
STEEP = 0.3  # rms slope from which small-slope elasticity is a anisotropy_ratio


class Statement(NamedTuple):
    """One statement of the paper: its section, what it says, what is found, and whether that agrees."""

    place: str
    says: str
    found: str
    agrees: str


def paper_table(tree: xr.DataTree) -> str:
    """Return the statements of the paper beside what a study finds, as a table for the screen.

    Parameters
    ----------
    tree : DataTree
        From `fractalcontact.scenes.run` or `fractalcontact.open`; nothing else is read.

    Returns
    -------
    str
        A row for every statement that the study has data for, then what the numbers cannot bear: slopes,
        unresolved spots, true pressures beside the hardness. Empty where there is no joint.

    Notes
    -----
    The paper claims orders and trends; its surface is not published, so that its numbers cannot be met.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3.
    """
    found = paper_statements(tree)
    if not found:
        return ""
    rows = [("paper", "says", "this study finds", "agrees"), *found]
    notes = [f"  {note}" for note in caveats(tree)]
    return "\n".join([table(rows), *notes])


def paper_statements(tree: xr.DataTree) -> list[Statement]:
    """Return the statements of the paper that a study has data for, each beside what is found."""
    if "joints" not in tree.children:
        return []
    return [statement for part in PARTS for statement in part(tree)]


def caveats(tree: xr.DataTree) -> list[str]:
    """Return what the numbers of a study cannot bear."""
    closure = _group(tree, "joints/closure")
    notes = ["the paper claims orders and trends, not numbers: its face is not published, nor its modulus"]
    if closure is None:
        return notes
    cells = np.rint(_values(closure, "contact_fraction") * _cells(closure))
    least = int(cells[:, 0].min())
    if least < FEW:
        notes.append(
            f"at the least force {least} to {int(cells[:, 0].max())} cells touch: no spot is resolved, and "
            "the area is that of the grid"
        )
    pressure = _values(closure, "nominal_pressure")[:, -1] / _values(closure, "contact_fraction")[:, -1]
    notes.append(
        f"true mean pressure at the greatest force {pressure.min() / 1e9:.2g} to {pressure.max() / 1e9:.2g} "
        f"GPa, where concrete yields at {HARDNESS[0] / 1e9:g} to {HARDNESS[1] / 1e9:g} GPa: elastic areas "
        "are too small unless a hardness is given"
    )
    delta = _group(tree, "joints/delta_surface")
    if delta is not None:
        slope = _slope(delta["height"])
        word = "outside" if slope > STEEP else "within"
        notes.append(f"rms slope of the delta-surface {slope:.2g}: {word} small-slope elasticity")
    return notes


def _face(tree: xr.DataTree) -> Iterator[Statement]:
    found = _group(tree, "dimensions")
    if found is None or "method" not in found.dims:
        return
    dimension = np.asarray(found["fractal_dimension"].values, dtype=float)
    low, high = PAPER_DIMENSION
    inside = (np.nanmin(dimension) >= low - 0.05) and (np.nanmax(dimension) <= high + 0.05)
    span = f"{np.nanmin(dimension):.2f} to {np.nanmax(dimension):.2f} by {dimension.size} methods"
    yield Statement("2", f"the face has a dimension of {low} to {high}", span, _word(inside))


def _delta(tree: xr.DataTree) -> Iterator[Statement]:
    found = _group(tree, "joints/delta_surface")
    if found is None:
        return
    from fractalcontact import dimensions

    plane = found["height"].isel(shear=-1) if "shear" in found["height"].dims else found["height"]
    curve = dimensions.covering(plane)
    slopes = np.gradient(np.log(curve["covering_area"].values), np.log(curve["cube_size"].values))
    by_area = 2.0 - float(np.mean(slopes[:3]))
    shear = float(np.max(found["shear"].values)) * 1e3
    yield Statement(
        "3",
        "the delta-surface rises above dimension 2",
        f"{by_area:.2f} at {shear:.3g} mm by its area; spectrum and variogram fall with v",
        _word(by_area > 2.005),
    )


def _closing(tree: xr.DataTree) -> Iterator[Statement]:
    found = _group(tree, "joints/closure")
    if found is None or found.sizes.get("step", 1) < 2:
        return
    area, force = _values(found, "contact_fraction"), _values(found, "normal_force")
    known = (area > 0) & (force > 0) & (area * _cells(found) >= FEW)
    powers = [
        float(np.polyfit(np.log(f[k]), np.log(a[k]), 1)[0])
        for a, f, k in zip(area, force, known, strict=True)
        if k.sum() > 2
    ]
    if found.sizes["shear"] > 1:
        inner, last = _values(found, "interface_closure")[:, -1] * 1e6, area[:, -1] * 100
        rises = bool((np.diff(inner) > 0).all())
        yield Statement(
            "4", "compliance grows with v", f"w_int {inner[0]:.3g} to {inner[-1]:.3g} um", _word(rises)
        )
        yield Statement(
            "4",
            "true area at equal F falls with v",
            f"{last[0]:.2g} to {last[-1]:.2g} % at the greatest force",
            _word(bool((np.diff(last) < 0).all())),
        )
        changes = np.abs(np.diff(last))
        yield Statement(
            "4",
            "... then stays nearly the same",
            f"last change {changes[-1] / max(changes[0], 1e-300):.0%} of the first",
            _word(bool(changes[-1] <= LEVEL * changes[0])),
        )
    if powers:
        yield Statement(
            "4",
            "true area is nearly proportional to F",
            f"A ~ F^{min(powers):.2f} to F^{max(powers):.2f}",
            _word(min(powers) > 0.85 and max(powers) < 1.1),
        )


def _domains(tree: xr.DataTree) -> Iterator[Statement]:
    found = _group(tree, "domains/box_dimension")
    if found is None or "step" not in found.dims:
        return
    dimension = _values(found, "box_dimension")
    dust = _values(found, "null_dimension")
    rises = dimension[:, -1] > dimension[:, 0]
    yield Statement(
        "4",
        "the domain's dimension grows with F from 0 to less than 2",
        f"{np.nanmin(dimension[:, 0]):.2f} to {np.nanmax(dimension[:, -1]):.2f}; random dust "
        f"{np.nanmin(dust[:, 0]):.2f} to {np.nanmax(dust[:, -1]):.2f}",
        _word(bool(rises.all()) and float(np.nanmax(dimension)) < 2.0),
    )


def _rigid(tree: xr.DataTree) -> Iterator[Statement]:
    found = _group(tree, "joints/rigid_dilatancy")
    if found is None or found.sizes.get("shear", 1) < 3 or "direction" not in found.dims:
        return
    shear = np.asarray(found["shear"].values, dtype=float)
    lifted = np.asarray(found["rigid_dilatancy"].transpose("direction", "shear").values) * 1e3
    slope = np.asarray(found["mean_slope"].values, dtype=float)
    names = [str(name) for name in found["direction"].values]
    edge = np.sqrt(float(found["nominal_area"]))
    early = int(np.argmin(np.abs(shear - PAPER_SMALL / PAPER_PARTS * edge)))
    span = ", ".join(f"{n} {lifted[i, early]:.2g} / {lifted[i, -1]:.2g}" for i, n in enumerate(names))
    up, down = slope > 0, slope < 0
    apart = up.any() and down.any()
    more = bool(apart and lifted[up, -1].min() > lifted[down, -1].max())
    yield Statement(
        "4",
        "two directions reach a plateau, the opposite two go on rising",
        f"mm at {shear[early] * 1e3:.2g} / {shear[-1] * 1e3:.3g} mm: {span}",
        _word(more),
    )
    slopes = ", ".join(f"{n} {value:+.3f}" for n, value in zip(names, slope, strict=True))
    yield Statement("4", "... because of the mean slope of the face", slopes, _word(more))


def _elastic(tree: xr.DataTree) -> Iterator[Statement]:
    found = _group(tree, "joints/elastic_dilatancy")
    if found is None:
        return
    first = found.isel(direction=0) if "direction" in found.dims else found
    moved = np.atleast_1d(first["shear"].values) > 0
    rigid = np.atleast_1d(first["rigid_dilatancy"].values)[moved]
    under = np.asarray(first["dilatancy"].transpose("shear", "step").values)[moved]
    if rigid.size == 0:
        return
    ordered = (under[:, 0] < rigid).all() and (np.diff(under, axis=1) < 0).all()
    ends = ", ".join(f"{value * 1e6:.3g}" for value in (rigid[-1], *under[-1]))
    yield Statement(
        "4", "dilatancy is less the greater F, always below the rigid one", f"{ends} um", _word(bool(ordered))
    )


def _memory(tree: xr.DataTree) -> Iterator[Statement]:
    found = _group(tree, "joints/decorrelation_length")
    if found is None:
        return
    lengths = np.atleast_1d(found["decorrelation_length"].values) * 1e3
    told = ", ".join(f"{value:.2g}" if np.isfinite(value) else "none" for value in lengths)
    yield Statement(
        "4",
        "the faces forget each other at a threshold",
        f"{told} mm",
        _word(bool(np.isfinite(lengths).any())),
    )


def _friction(tree: xr.DataTree) -> Iterator[Statement]:
    from fractalcontact.joints import PARK_PAULAY

    found = _group(tree, "joints/friction")
    if found is None:
        return
    angle = np.asarray(found["friction_angle"].values, dtype=float)
    basic = float(found["basic_friction_angle"])
    usual = " and ".join(f"{value:g} ({name})" for name, value in PARK_PAULAY.items())
    coefficient = np.tan(np.radians(angle[angle < 90.0]))
    span = (
        f"{coefficient.min():.2f} to {coefficient.max():.2f}" if coefficient.size else "none: the faces lock"
    )
    yield Statement("1", f"codes take coefficients of {usual}", span, "compare")
    yield Statement(
        "4",
        "friction angle = basic + dilatancy angle",
        f"{basic:g} + {np.nanmin(angle) - basic:.1f} to {np.nanmax(angle) - basic:.1f} degrees",
        "by definition",
    )


PARTS: tuple[Callable[[Any], Iterator[Statement]], ...] = (
    _face, _delta, _closing, _domains, _rigid, _elastic, _memory, _friction,
)  # fmt: skip


def _group(tree: xr.DataTree, path: str) -> xr.Dataset | None:
    try:
        node: Any = tree[path]
    except KeyError:
        return None
    return node.to_dataset() if getattr(node, "has_data", False) else None


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


def _slope(height: xr.DataArray) -> float:
    from fractalcontact import surfaces

    plane = height.isel(shear=-1) if "shear" in height.dims else height
    return float(surfaces.describe(plane)["rms_slope"])


def _word(agrees: bool) -> str:
    return "yes" if agrees else "no"
