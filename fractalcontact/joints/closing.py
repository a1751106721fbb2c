"""Closure of a crack: how the faces approach when they are pressed together."""

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
    resampling_errors,
)
from fractalcontact.joints._directions import is_one, several_directions
from fractalcontact.joints._elastic import check_load, explain, press_sheared

if TYPE_CHECKING:
    import xarray as xr

    from fractalcontact.joints.crack import Crack

WHERE = "fractalcontact.joints.closure"
Path = float | Sequence[float] | np.ndarray[Any, np.dtype[Any]]


def closure(
    crack: Crack,
    *,
    shear: Path,
    direction: str | float | Sequence[str | float] = "E",
    closure: Path | None = None,
    normal_force: Path | None = None,
    nominal_pressure: Path | None = None,
    bulk: str = "flat_block",
    keep: Sequence[str] = (),
    influence: str | None = None,
    disc_radius: str | float = "second_order",
    hardness: float | None = None,
    tolerance: float = 1e-8,
    method: str = "fast",
    progress: bool = False,
) -> xr.Dataset:
    """Return the closure laws of a crack that has been sheared.

    The delta-surface of every shear is pressed together along the same path of load. The closure w counts
    from the first touch at that shear. What the bulk of the bodies contributes, w_b(F), is taken out:
    w_int = w - w_b. Mated faces at zero shear have w_int = 0 to rounding.

    Parameters
    ----------
    crack : Crack
    shear : float or sequence of float
        Shear displacements v >= 0, m, each once.
    direction : str, float, or a sequence of them
        Direction in which the block slides: a compass word, or the azimuth in degrees (E = 0, anticlockwise).
        A sequence gives the result a first dim `direction`.
    closure, normal_force, nominal_pressure : float or sequence of float
        Exactly one of them: approach from first touch (m), force on the block (N), or force over its area
        (Pa). A sequence is a path of load; it may go up and down. Elastic faces come back the way they went;
        with a `hardness` what has yielded stays indented, and unloading is stiffer than loading was.
    bulk : {"flat_block", "uniform_pressure"}
        What w_b is: the closure of the flat block under the same influence coefficients, or the mean
        settlement under uniform pressure (about 9 % more for a square). Zero for periodic bodies, whose mean
        settlement is a rigid motion.
    keep : sequence of str
        Maps over (shear, step, y, x) to keep: "state", "pressure", "gap", "displacement", "residual_height".
    influence, disc_radius, hardness, tolerance, method
        As for `fractalcontact.contact.press`.
    progress : bool
        Show a bar over the shears.

    Returns
    -------
    Dataset over (shear, step), or (direction, shear, step)
        closure, bulk_closure, interface_closure (m), normal_force (N), nominal_pressure (Pa), contact_area
        (m2), contact_fraction, corrected_contact_fraction, mean_gap (m), elastic_energy (J), with a hardness
        plastic_work (J), iterations, residual, converged, stop_reason, run_time (s); the maps in `keep`;
        nominal_area (m2); interpolation_error (m, rms) over shear: that of shears between whole cells. Under
        closure control periodic faces that are closed to their mean plane or beyond have no force: NaN, with
        the `reason`; the other shears are not touched by that.

    Raises
    ------
    InvalidInput
        The block would leave its face, heights are missing in its path, or an argument is wrong.

    Warns
    -----
    ConvergenceWarning
        A step stopped before its tolerance was met.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3, section 4 and figure 3.
    """
    import xarray as xr

    loads = {"closure": closure, "normal_force": normal_force, "nominal_pressure": nominal_pressure}
    solver = {"influence": influence, "disc_radius": disc_radius, "hardness": hardness}
    solver |= {"tolerance": tolerance, "method": method}
    with Problems(WHERE) as problems:
        check_crack(crack, problems)
        towards = several_directions(direction, problems)
        shears = check_shear(shear, crack, towards, problems)
        load = check_load(problems, crack, loads, bulk, keep, solver)
    begun = time.perf_counter()
    pressed = [press_sheared(crack, shears, one, load, WHERE, progress) for one in towards]
    columns = {name: np.stack([each[name] for each in pressed]) for name in pressed[0]}
    dims = ("direction", "shear", "step", "y", "x")
    found: dict[str, Any] = {name: (dims[: values.ndim], values) for name, values in columns.items()}
    found["interpolation_error"] = dims[:2], resampling_errors(crack, shears, towards)
    coords: dict[str, Any] = {name: found.pop(name) for name in loads}
    coords |= {"shear": ("shear", shears), "step": np.arange(columns["closure"].shape[2])}
    coords |= direction_coords(towards)
    if load.keep:
        coords |= block_coords(crack, crack.layout)
    result = xr.Dataset(found, coords).assign(nominal_area=crack.nominal_area)
    if is_one(direction):
        result = result.isel(direction=0)
    facts: dict[str, Any] = {
        "achieved_residual": float(columns["residual"].max()),
        "run_time": time.perf_counter() - begun,
    }
    words = [one.name for one in towards]
    parameters = {"crack": crack.summary(), "shear": shears, "direction": words} | load.parameters()
    result = stamp(label(result), WHERE, parameters, title="closure of a sheared crack", **facts)
    result["bulk_closure"].attrs["comment"] = load.bulk_comment
    explain(result)
    return result
