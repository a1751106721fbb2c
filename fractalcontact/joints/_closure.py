"""Closure of a sheared crack: its delta-surface is pressed by a flat, and the bulk part is subtracted."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from fractalcontact.base.compass import is_single, read_directions
from fractalcontact.base.numbers import Array, float_array
from fractalcontact.base.results import public_result
from fractalcontact.base.schema import CONTACT_MAPS, DEFAULT_TOLERANCE, STOP_REASONS
from fractalcontact.base.validation import Problems
from fractalcontact.joints._crack import Crack, check_sliding
from fractalcontact.joints._delta_surface import interpolation_errors
from fractalcontact.joints._sheared_contact import (
    BULK,
    PRESSING_BYTES,
    Pressing,
    check_pressing,
    over_directions,
    press_sheared,
    pressed_dataset,
)

Path = float | Sequence[float] | Array

WHERE = "fractalcontact.joints.closure"
UNDETERMINED = (
    "NaN where periodic faces are closed to the mean plane of the delta-surface or beyond: "
    "no force is then determined"
)


def _check(problems: Problems) -> None:
    check_sliding(problems)
    check_pressing(problems)
    problems.choices("keep", among=CONTACT_MAPS, optional=True)
    problems.choice("bulk", among=BULK)


@public_result(title="closure of a sheared crack", check=_check, memory=PRESSING_BYTES)
def closure(
    crack: Crack,
    *,
    shear: Path,
    direction: str | float | Sequence[str | float] = "E",
    closure: Path | None = None,
    normal_force: Path | None = None,
    nominal_pressure: Path | None = None,
    bulk: str = "flat_block",
    keep: Sequence[str] = ("state",),
    influence: str | None = None,
    disc_radius: str = "second_order",
    hardness: float | None = None,
    tolerance: float = DEFAULT_TOLERANCE,
    method: str = "fast",
    progress: bool = False,
) -> xr.Dataset:
    """Return the closure of a sheared crack under a path of load.

    The delta-surface of every shear is pressed together along the same path. The closure w counts from first
    touch at that shear. Without its bulk part, w_int = w - w_b(F), it is 0 to rounding for mated faces, where
    `bulk` is "flat_block" and no node yields.

    Parameters
    ----------
    crack : Crack
    shear : float or sequence of float
        Shear displacements v >= 0, m, each once.
    direction : str, float, or a sequence of them
        Direction of sliding: compass word, or degrees anticlockwise from E. A sequence gives the
        result a first dim `direction`.
    closure, normal_force, nominal_pressure : float or sequence of float
        Exactly one of them: approach from first touch (m), force on the block (N), or force over its area
        (Pa). A sequence is a path of load, which may go up and down.
    bulk : {"flat_block", "uniform_pressure"}
        Bulk part w_b: closure of the flat block, or its mean displacement under uniform pressure (about 9 %
        more for a square). Zero for periodic bodies.
    keep : sequence of str
        Maps over (shear, step, y, x): "state", "pressure", "gap", "displacement", "residual_height".
    influence, disc_radius, hardness, tolerance, method
        As for `fractalcontact.contact.press`. With a `hardness` unloading is stiffer than loading.
    progress : bool
        Show a progress bar over the shears.

    Returns
    -------
    Dataset over (shear, step), or (direction, shear, step)
        closure, bulk_closure, interface_closure (m), normal_force (N), nominal_pressure (Pa), the other
        scalars of `press`, the maps in `keep`; nominal_area (m2); over shear interpolation_error (m, rms)
        and the rms_slope of the delta-surface.

    Raises
    ------
    InvalidInput
        The block would leave its face, heights are missing in its path, or an argument is wrong. A step that
        stops before its tolerance is met gives a ConvergenceWarning.

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3, section 4 and figure 3.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> face = fc.surfaces.fbm((48, 48), 1e-4, hurst=0.8, rms_increment=2e-6, rng=1)
    >>> crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=3.2e-3)
    >>> result = fc.joints.closure(crack, shear=[0, 2e-4], normal_force=[10, 100])
    >>> (result.interface_closure.values * 1e6).round(1).tolist()  # micrometres
    [[0.0, 0.0], [2.2, 5.2]]
    """
    directions, shears = read_directions(direction), float_array(shear)
    loads = {"closure": closure, "normal_force": normal_force, "nominal_pressure": nominal_pressure}
    pressing = Pressing.read(
        crack,
        WHERE,
        loads,
        bulk=bulk,
        keep=keep,
        influence=influence,
        disc_radius=disc_radius,
        hardness=hardness,
        tolerance=tolerance,
        method=method,
    )
    pressed = [press_sheared(pressing, shears, towards, progress) for towards in directions]
    result = pressed_dataset(pressing, shears, directions, over_directions(pressing, pressed))
    result["interpolation_error"] = ("direction", "shear"), interpolation_errors(crack, shears, directions)
    if is_single(direction):
        result = result.isel(direction=0)
    _explain_undetermined(result)
    return result


def _explain_undetermined(result: xr.Dataset) -> None:
    """Add the reason where an elastic body does not determine the force."""
    if bool((result["stop_reason"] == STOP_REASONS["beyond_full_contact"]).any()):
        for name, variable in result.variables.items():
            is_measured = "step" in variable.dims and variable.dtype.kind == "f"
            if is_measured and bool(np.isnan(variable.values).any()):
                result[name].attrs["reason"] = UNDETERMINED
