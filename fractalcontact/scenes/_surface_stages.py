"""The stages of a surface: height, roughness, dimension, contact with a flat, partial slip."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import xarray as xr

from fractalcontact.base.file_contents import remarks
from fractalcontact.base.study import MEMBER, entries_in, group_of, provenance_of
from fractalcontact.base.units import quantity_text
from fractalcontact.scenes._result_tables import Column, Rows, length, plain, share_of
from fractalcontact.scenes._scene import PRESS
from fractalcontact.scenes._stage_type import CONTACT_MAPS, PARTIAL_SLIP, SLIP_MAPS, StageType, stage_type


def _of_method(_: xr.DataTree, data: xr.Dataset) -> Iterator[str]:
    """Yield notes and reasons, those of several methods once."""
    methods = [str(name) for name in data["method"].values]
    for key in (key for key in ("note", "reason") if key in data):
        texts = data[key].transpose(..., "method").values.reshape(-1, len(methods))
        for names, text in remarks(methods, texts):
            count = int((texts == text).any(axis=1).sum())
            yield f"{names}{share_of(count, len(texts))}: {text}"
    if MEMBER in data.dims:
        yield "The intervals are those of one surface: the means of their ends."


def _misfit(state: xr.Dataset) -> str:
    text = plain(np.abs(state["misfit"]), 1)
    return "" if text == "-" else f"z = {text}"


def _gridding(tree: xr.DataTree, data: xr.Dataset) -> Iterator[str]:
    """Yield how a cloud of points became a surface: points, cells, and the plane below the heights."""
    surface = group_of(tree, "surfaces")
    statistics = data if surface is None else surface
    made = (each for each in entries_in(provenance_of(statistics)) if "point_distance" in each)
    record = next(made, None)
    if record is None or not {"y", "x"} <= set(statistics.sizes):
        return
    spacing = length(float(statistics["x"][1] - statistics["x"][0]))
    cells = " x ".join(str(statistics.sizes[dim]) for dim in ("y", "x"))
    distance = length(record["point_distance"])
    text = f"gridded from {record['points']} points, about {distance} apart, on {cells} cells of {spacing}"
    if record.get("plane") == "best fit":
        tilt = float(np.degrees(np.arccos(min(1.0, abs(record["rotation_matrix"][2][2])))))
        text += f"; heights are above the best-fit plane of the points, tilted by {tilt:.3g}°"
    yield text


AREAS = (
    Column("contact area", "contact_fraction"),
    Column("area, perimeter-corrected", "corrected_contact_fraction", screen=False),
)


def _sticks(state: xr.Dataset) -> str:
    share = 100 * state["stick_area"] / state["contact_area"].where(state["contact_area"] > 0)
    return f"{plain(share, 1)} %"


def _slip_limits(_: xr.DataTree, data: xr.Dataset) -> Iterator[str]:
    limit = data["friction_coefficient"] * data["normal_force"].max()
    yield f"all slides at {quantity_text(float(limit.mean()), 'N')}"
    if "stuck_ratio" in data:
        first = data["stiffness_ratio"].isel(step=0)
        ratios = f"{plain(first, 3)} at the first step; {plain(data['stuck_ratio'], 3)} where nothing slips"
        yield f"shear over normal stiffness of the joint: {ratios} (theory)"


def _mean_plane(state: xr.Dataset) -> xr.DataArray | None:
    """Return the root mean square height of the mean plane where it carries more than half of Sq².

    ISO 25178 removes the plane first; the faces of a joint keep theirs. An axis that repeats is level.
    """
    free = [dim for dim in ("y", "x") if dim in state.coords and "period" not in state[dim].attrs]
    if not free or "mean_slope_x" not in state:
        return None
    square = sum(state[f"mean_slope_{dim}"] ** 2 * state[dim].var() for dim in free)
    if not bool((square > 0.5 * state["rms_height"] ** 2).all()):
        return None
    return state["rms_height"].copy(data=np.sqrt(square))


STATISTICS = (
    Column("Sq", "rms_height"),
    Column("of it the mean plane", _mean_plane),
    Column("Sa", "mean_absolute_height", screen=False),
    Column("Sp", "peak_height", screen=False),
    Column("Sv", "valley_depth", screen=False),
    Column("Sz", "peak_to_valley", screen=False),
    Column("Ssk", "skewness", 3, screen=False),
    Column("Sku", "kurtosis", 3, screen=False),
    Column("Sdq", "rms_slope"),
    Column("Sdr", "developed_area_excess", screen=False),
    Column("Sal", "autocorrelation_length"),
    Column("Str", "texture_aspect_ratio", 3),
    Column("Sk", "core_height", screen=False),
    Column("Spk", "reduced_peak_height", screen=False),
    Column("Svk", "reduced_valley_depth", screen=False),
)
SLIP_TABLE = Rows(
    "partial slip",
    ("shear", "step"),
    (
        Column("displacement", "tangential_displacement"),
        Column("sticks", _sticks),
        Column("stiffness", "tangential_stiffness"),
        Column("dissipated energy", "dissipated_energy"),
    ),
    _slip_limits,
    load="tangential_force",
)
SURFACE = ("surfaces",)


CURVES = (
    "spectrum", "variogram", "cube_counts", "roughness_length", "variation", "higuchi",
    "detrended_fluctuation", "divider", "covering",
)  # fmt: skip


def _curve(method: str) -> StageType:
    name = f"dimensions.{method}"
    return StageType(f"dimensions/{method}", SURFACE, name, wanted=name, for_figures=True)


STAGES = (
    stage_type(
        "surfaces",
        (),
        "surfaces.read",
        "ISO 25178",
        (),
        *STATISTICS,
        remarks=_gridding,
        table="surface",
        wanted="surfaces.height",
        takes="file",
    ),  # with its description
    StageType("surfaces/description", SURFACE, "surfaces.describe", wanted="surfaces.describe"),
    stage_type(
        "surfaces/texture", SURFACE, "surfaces.texture", "texture", (), *STATISTICS, wanted="surfaces.texture"
    ),
    stage_type(
        "dimensions",
        SURFACE,
        "dimensions.estimate",
        "fractal dimension",
        ("method",),
        Column("dimension D", "fractal_dimension", 3),
        Column("95 % interval", ("fractal_dimension_low", "fractal_dimension_high"), 3),
        Column("range of scales", ("scale_min", "scale_max")),
        Column("goodness of fit", _misfit, screen=False),
        remarks=_of_method,
        table="dimensions",
    ),
    *map(_curve, CURVES),
    stage_type(
        "contact",
        SURFACE,
        "contact.press",
        "contact",
        ("step",),
        Column("closure", "closure"),
        *AREAS,
        table="contact",
        wanted=f"contact.{PRESS}",
        keeps=CONTACT_MAPS,
        splits=("step",),
        presses=True,
    ),
    # not below contact: its steps are others than those of the load path
    StageType(
        PARTIAL_SLIP,
        SURFACE,
        "contact.partial_slip",
        "contact.partial_slip",
        f"contact.{PARTIAL_SLIP}",
        keeps=SLIP_MAPS,
        presses=True,
        refuses_hardness=True,
        rows=SLIP_TABLE,
    ),
)
