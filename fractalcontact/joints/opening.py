"""Dilatancy: how far the faces part when they slide, rigid or under a normal force."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.provenance import stamp
from fractalcontact.base.schema import label
from fractalcontact.joints._checks import (
    block_coords,
    check_crack,
    check_shear,
    direction_coords,
    is_nothing,
    missing,
    resampling_errors,
)
from fractalcontact.joints._directions import Direction, several_directions
from fractalcontact.joints._rigid import mean_slopes, separations

if TYPE_CHECKING:
    import xarray as xr

    from fractalcontact.joints.crack import Crack

WHERE = "fractalcontact.joints.dilatancy"
COMPASS = ("E", "N", "W", "S")
Array = np.ndarray[Any, np.dtype[Any]]


def dilatancy(
    crack: Crack,
    *,
    shear: float | Sequence[float] | Array,
    direction: str | float | Sequence[str | float] = COMPASS,
    normal_force: float | Sequence[float] | None = None,
    normal_stiffness: float | None = None,
    bulk: str = "flat_block",
    keep: Sequence[str] = (),
    influence: str | None = None,
    disc_radius: str | float = "second_order",
    hardness: float | None = None,
    tolerance: float = 1e-8,
    method: str = "fast",
    progress: bool = False,
) -> xr.Dataset:
    """Return the dilatancy of a crack that slides.

    A rigid block is lifted to delta_r(v) = max over the block of (lower(x + v) - upper(x)). Under a normal
    force F the faces close again by w_int, and delta(F, v) = delta_r(v) - w_int(F, v), w_int = w - w_b.
    Without a force no contact is solved. Instead of being constant the force may grow with the dilatancy, as
    it does where the rock around the joint holds it: N = N0 + k A (delta(N, v) - delta(N0, 0)).

    Parameters
    ----------
    crack : Crack
    shear : float or sequence of float
        Shear displacements v >= 0, m, each once.
    direction : str, float, or a sequence of them
        Directions in which the block slides: compass words, or azimuths in degrees (E = 0, anticlockwise).
    normal_force : float or sequence of float, optional
        Normal forces on the block, N; a sequence is a path of load, run anew for every shear.
    normal_stiffness : float, optional
        Stiffness k of what holds the block, per nominal area, Pa/m. Every `normal_force` is then the one at
        no shear, N0. It never falls below zero. None: the force is constant.
    bulk : {"flat_block", "uniform_pressure"}
        What w_b is: the closure of the flat block under the same influence coefficients, or the mean
        settlement under uniform pressure.
    keep : sequence of str
        Maps over (direction, shear, step, y, x) to keep: "state", "pressure", "gap", "displacement",
        "residual_height".
    influence, disc_radius, hardness, tolerance, method
        As for `fractalcontact.contact.press`; like `bulk` and `keep` refused where there is no force.
    progress : bool
        Show a bar over the shears.

    Returns
    -------
    Dataset
        rigid_dilatancy (direction, shear), m, relative to its value at v = 0, which is kept as
        initial_offset; mean_slope (direction) of the lower face, and plateau_dilatancy (direction, shear),
        which is rigid_dilatancy less mean_slope times v: what is left when the oblique asymptote is taken
        away; interpolation_error (direction, shear), m, that of shears between whole cells, see
        `delta_surface`; basic_friction_angle (degree) and nominal_area (m2). With forces also, over
        (direction, shear, step): dilatancy, interface_closure, closure (m), contact_fraction,
        corrected_contact_fraction, mean_gap, elastic_energy, iterations, residual, converged, stop_reason;
        over step: normal_force, nominal_pressure, bulk_closure; and the maps in `keep`. With a
        normal_stiffness (kept, Pa/m) these three are over (direction, shear, step) too, and
        initial_force over step. run_time (s).

    Raises
    ------
    InvalidInput
        The block would leave its face, heights are missing in its path, or an argument is wrong.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3, eq. 2 and figure 5.
    """
    with Problems(WHERE) as problems:
        check_crack(crack, problems)
        towards = several_directions(direction, problems)
        shears = check_shear(shear, crack, towards, problems)
        path = None
        solver = {"influence": influence, "disc_radius": disc_radius, "hardness": hardness}
        solver |= {"tolerance": tolerance, "method": method}
        if normal_force is not None:
            from fractalcontact.joints import _elastic

            loads = {"normal_force": normal_force}
            path = _elastic.check_load(problems, crack, loads, bulk, keep, solver)
            if normal_stiffness is not None:
                problems.number("normal_stiffness", normal_stiffness, above=0)
        else:
            kept = () if is_nothing(keep) else keep
            given = {"keep": kept, "normal_stiffness": normal_stiffness, "bulk": bulk, **solver}
            for name, value in given.items():
                usual = (dilatancy.__kwdefaults__ or {})[name]
                unused = value is usual or (isinstance(value, type(usual)) and value == usual)
                problems.require(unused, name, "nothing without normal_force", value)
    start = time.perf_counter()
    result = _rigid(crack, shears, towards)
    parameters = {"crack": crack.summary(), "shear": shears, "direction": [d.name for d in towards]}
    facts: dict[str, Any] = {}
    if path is not None:
        pressed = [
            _pressed(crack, shears, one, path, lifted, normal_stiffness, progress)
            for one, lifted in zip(towards, result["rigid_dilatancy"].values, strict=True)
        ]
        facts = {"achieved_residual": max(float(one["residual"].max()) for one in pressed)}
        result = _with_elastic(result, crack, pressed, sprung=normal_stiffness is not None)
        parameters |= path.parameters() | {"normal_stiffness": normal_stiffness}
        if normal_stiffness is not None:
            result = result.assign(normal_stiffness=float(normal_stiffness))
            result["initial_force"] = "step", path.values
    result["run_time"] = time.perf_counter() - start
    result = stamp(label(result), WHERE, parameters, title="dilatancy of a crack", **facts)
    if path is not None:
        result["bulk_closure"].attrs["comment"] = path.bulk_comment
    return result


def _pressed(
    crack: Crack,
    shears: Array,
    towards: Direction,
    path: Any,
    lifted: Array,
    stiffness: float | None,
    progress: bool,
) -> dict[str, Array]:
    if stiffness is None:
        from fractalcontact.joints._elastic import press_sheared

        return press_sheared(crack, shears, towards, path, WHERE, progress)
    from fractalcontact.joints._spring import press_sprung

    whole = stiffness * crack.nominal_area
    return press_sprung(crack, shears, lifted, towards, path, whole, WHERE, progress)


def _with_elastic(
    rigid: xr.Dataset, crack: Crack, pressed: Sequence[dict[str, Array]], *, sprung: bool
) -> xr.Dataset:
    """Add what was found under force: scalars over (direction, shear, step), and maps."""
    columns = {name: np.stack([one[name] for one in pressed]) for name in pressed[0]}
    dims = ("direction", "shear", "step", "y", "x")
    forces = ("normal_force", "nominal_pressure", "bulk_closure")
    step: dict[str, Any] = {name: columns.pop(name) for name in forces}
    # constant forces are the same for every direction and shear
    step = {n: (dims[:3], v) if sprung else ("step", v[0, 0]) for n, v in step.items()}
    for name in ("contact_area", "run_time"):
        del columns[name]
    found = {name: (dims[: values.ndim], values) for name, values in columns.items()}
    lifted = rigid["rigid_dilatancy"].values[..., None]
    found["dilatancy"] = (dims[:3], lifted - columns["interface_closure"])
    coords: dict[str, Any] = {"step": np.arange(columns["closure"].shape[-1])}
    coords |= {name: step.pop(name) for name in forces[:2]}
    if any(values.ndim > 3 for values in columns.values()):
        coords |= block_coords(crack, crack.layout)
    return rigid.assign(found | step).assign_coords(coords)


def _rigid(crack: Crack, shears: Array, towards: Sequence[Direction]) -> xr.Dataset:
    import xarray as xr

    layout = crack.layout
    lower, upper = crack.faces()
    initial = separations(lower, upper, layout, np.zeros(1), (0.0, 1.0))[0]
    lifted = np.stack([_lifted(crack, shears, one) for one in towards]) - initial
    slope_y, slope_x = mean_slopes(lower, layout)
    slopes = np.array([slope_y * d.unit[0] + slope_x * d.unit[1] for d in towards])
    plane = ("direction", "shear")
    return xr.Dataset(
        {
            "rigid_dilatancy": (plane, lifted),
            "plateau_dilatancy": (plane, lifted - slopes[:, None] * shears),
            "mean_slope": ("direction", slopes),
            "interpolation_error": (plane, resampling_errors(crack, shears, towards)),
            "initial_offset": initial,
            "basic_friction_angle": crack.basic_friction_angle,
            "nominal_area": crack.nominal_area,
        },
        coords={"shear": ("shear", shears), **direction_coords(towards)},
    )


def _lifted(crack: Crack, shears: Array, towards: Direction) -> Array:
    highest = separations(*crack.faces(), crack.layout, shears, towards.unit)
    if not np.isfinite(highest).all():
        raise missing(WHERE, crack, towards, float(shears[~np.isfinite(highest)][0]))
    return highest
