"""Shear stress and dilation of a joint against displacement, after Barton and Bandis."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems, float_array
from fractalcontact.joints._compass import checked_direction, read_direction
from fractalcontact.joints._roughness_coefficient import LARGEST_JRC, SAMPLE_LENGTH, roughness_coefficient
from fractalcontact.joints._strength_criteria import scaled_constants
from fractalcontact.joints._strength_envelope import FITTED_STRESS, LARGEST, LARGEST_ANGLE, SMALLEST

Array = np.ndarray[Any, np.dtype[Any]]

# mobilised over peak roughness against displacement over that at the peak; at no displacement the angle is 0
MOBILISED = ((0.3, 0.0), (0.6, 0.75), (1.0, 1.0), (2.0, 0.85), (4.0, 0.7), (10.0, 0.5), (100.0, 0.0))
SMALLEST_PEAK = 1e-4  # displacement at the peak over the length: a smooth joint has none of its own
FEWEST_STEPS = 200  # of the integration of the dilation, up to the last displacement
SMOOTH = "the surface has no roughness on the scale of standard profiles: JRC is below 0"
OUTSIDE = "outside the range of the criterion where in_range is False"


def _check(
    problems: Problems,
    *,
    surface: Any,
    displacement: Any,
    nominal_pressure: Any,
    wall_strength: Any,
    residual_friction_angle: Any,
    direction: Any,
    length: Any,
    damage_coefficient: Any,
    normal_stiffness: Any,
) -> None:
    if problems.numbers("displacement", displacement, at_least=0, at_most=LARGEST):
        ascending = bool((np.diff(float_array(displacement)) > 0).all())
        problems.require(ascending, "displacement", "ascending values", displacement)
    problems.numbers("nominal_pressure", nominal_pressure, at_least=SMALLEST, at_most=LARGEST)
    problems.number("wall_strength", wall_strength, at_least=SMALLEST, at_most=LARGEST)
    problems.number("residual_friction_angle", residual_friction_angle, above=0, below=LARGEST_ANGLE)
    problems.number("length", length, at_least=SAMPLE_LENGTH, at_most=LARGEST)
    problems.number("damage_coefficient", damage_coefficient, at_least=1, at_most=2, optional=True)
    problems.number("normal_stiffness", normal_stiffness, above=0, at_most=LARGEST, optional=True)
    direction = checked_direction(problems, direction)
    with problems.collect():
        roughness_coefficient.validate(surface, direction=direction)


@public_result(
    title="Barton-Bandis shear curve",
    references=(
        "Barton (1982), Terra Tek report 82-39; Barton, Bandis and Bakhtar (1985), Int. J. Rock Mech. Min. "
        "Sci. 22:121; Barton and Choubey (1977), Rock Mechanics 10:1"
    ),
    achieved_error="that of the criterion, which is empirical",
    check=_check,
)
def shear_curve(
    surface: xr.DataArray,
    displacement: float | Sequence[float] | Array,
    *,
    nominal_pressure: float | Sequence[float],
    wall_strength: float,
    residual_friction_angle: float,
    direction: str | float = "E",
    length: float = SAMPLE_LENGTH,
    damage_coefficient: float | None = None,
    normal_stiffness: float | None = None,
) -> xr.Dataset:
    """Return shear stress and dilation against shear displacement by the mobilised roughness of Barton.

    tau = sigma tan(phi_r + JRC_mob log10(JCS/sigma)), where JRC_mob rises to JRC at the displacement of the
    peak and falls beyond it. The empirical counterpart of `direct_shear`.

    Parameters
    ----------
    surface : DataArray, shape (y, x)
        Heights of one face, m, of which the JRC is taken.
    displacement : float or sequence of float
        Shear displacements, m, ascending, from 0 on.
    nominal_pressure : float or sequence of float
        Normal stresses at the start, Pa.
    wall_strength : float
        Compressive strength JCS of the walls, Pa.
    residual_friction_angle : float
        phi_r, degree.
    direction : str or float
        Direction in which the block slides: compass word, or azimuth in degrees.
    length : float
        Length of the joint, m, at least 0.1, for which JRC, JCS and the peak displacement hold.
    damage_coefficient : float, optional
        M, by which the dilation is less than the angle of the roughness: 1 at low normal stress to 2 at high.
        Default: 0.7 + JRC/(12 log10(JCS/sigma)), within 1 and 2.
    normal_stiffness : float, optional
        Stiffness of a spring on the block per area, Pa/m. Default: constant normal stress.

    Returns
    -------
    Dataset over (shear_displacement, nominal_pressure)
        shear_stress, normal_stress, Pa; friction_angle, dilatancy_angle, degree; dilatancy, m. Over
        nominal_pressure: peak_shear_strength, Pa, and in_range, whether the criterion was made for such
        values. Also peak_displacement, m, and the roughness_coefficient of the length.

    Raises
    ------
    InvalidInput
        An argument is wrong.

    Notes
    -----
    Mobilised over peak JRC is 0, 0.75, 1, 0.85, 0.7, 0.5, 0 at 0.3, 0.6, 1, 2, 4, 10, 100 times the peak
    displacement L/500 (JRC/L)^0.33; before 0.3 friction alone is mobilised, from 0. The friction angle is
    limited to 70 degrees.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((128, 128), 0.5e-3, hurst=0.8, rms_increment=1e-4, rng=1)
    >>> curve = fc.joints.shear_curve(
    ...     surface, [0, 1e-3, 1e-2], nominal_pressure=1e6, wall_strength=1e8, residual_friction_angle=28
    ... )
    >>> curve.friction_angle.values[:, 0].round(1).tolist()
    [0.0, 42.8, 35.5]
    """
    found = roughness_coefficient(surface, direction=direction).roughness_coefficient
    roughness = float(found.item()) if math.isfinite(found.item()) and found.item() > 0 else 0.0
    jrc, jcs, peak = scaled_constants(roughness, float(wall_strength), float(length))
    peak = max(peak, SMALLEST_PEAK * float(length))
    given, pressures = float_array(displacement), float_array(nominal_pressure)
    # the dilation is an integral: steps finer than the displacements in between
    fine = np.union1d(given, np.linspace(0.0, given[-1], FEWEST_STEPS + 1)) if given[-1] > 0 else given
    stiffness = 0.0 if normal_stiffness is None else float(normal_stiffness)
    sigma = np.empty((pressures.size, fine.size))
    opening, angle, rise = np.zeros_like(sigma), np.empty_like(sigma), np.empty_like(sigma)
    for j, place in enumerate(fine):
        sigma[:, j] = pressures if j == 0 else sigma[:, j - 1]
        for _ in range(2 if j and stiffness else 1):  # the stress at the end of the step, once corrected
            dilation = _dilation(sigma[:, j], jrc, jcs, float(residual_friction_angle), damage_coefficient)
            angle[:, j], rise[:, j] = _mobilised(place / peak, float(residual_friction_angle), *dilation)
            if j:
                step = 0.5 * (np.tan(rise[:, j]) + np.tan(rise[:, j - 1])) * (place - fine[j - 1])
                opening[:, j] = opening[:, j - 1] + step
                sigma[:, j] = pressures + stiffness * opening[:, j]
    at = np.searchsorted(fine, given)
    decades = _dilation(pressures, jrc, jcs, float(residual_friction_angle), damage_coefficient)[0]
    ratio, dims = pressures / jcs, ("nominal_pressure", "shear_displacement")
    inside = (ratio >= FITTED_STRESS[0]) & (ratio <= FITTED_STRESS[1]) & (0 <= found.item() <= LARGEST_JRC)
    result = xr.Dataset(
        {
            "shear_stress": (dims, (sigma * np.tan(angle))[:, at]),
            "normal_stress": (dims, sigma[:, at]),
            "friction_angle": (dims, np.degrees(angle)[:, at]),
            "dilatancy_angle": (dims, np.degrees(rise)[:, at]),
            "dilatancy": (dims, opening[:, at]),
            "peak_shear_strength": (
                "nominal_pressure",
                pressures * np.tan(np.radians(float(residual_friction_angle) + decades)),
            ),
            "in_range": ("nominal_pressure", inside),
            "peak_displacement": peak,
            "roughness_coefficient": jrc,
        },
        coords={
            "nominal_pressure": pressures,
            "shear_displacement": given,
            "direction": read_direction(direction).name,
        },
    )
    result["peak_shear_strength"].attrs["long_name"] = "shear strength at the peak, under the first stress"
    if not inside.all():
        result["shear_stress"].attrs["comment"] = OUTSIDE
    if found.item() < 0 or not math.isfinite(found.item()):
        result["roughness_coefficient"].attrs["comment"] = SMOOTH
    return result.transpose("shear_displacement", "nominal_pressure")


def _dilation(
    sigma: Array, jrc: float, jcs: float, residual_angle: float, damage: float | None
) -> tuple[Array, Array]:
    """Return the angle of the roughness at the peak, degree, and the damage coefficient M."""
    decades = np.clip(np.log10(jcs) - np.log10(sigma), 0.0, None)
    roughness_angle = np.minimum(jrc * decades, LARGEST_ANGLE - residual_angle)
    if damage is not None:
        return roughness_angle, np.full(sigma.shape, float(damage))
    with np.errstate(divide="ignore", invalid="ignore"):
        coefficient = 0.7 + jrc / (12.0 * decades)
    return roughness_angle, np.clip(np.nan_to_num(coefficient, nan=2.0), 1.0, 2.0)


def _mobilised(
    place: float, residual_angle: float, roughness_angle: Array, damage: Array
) -> tuple[Array, Array]:
    """Return friction and dilation angle (radian) at a displacement over that of the peak."""
    places, shares = np.array([0.0, *(row[0] for row in MOBILISED)]), [row[1] for row in MOBILISED]
    if place < places[1]:
        mobilised = np.full(roughness_angle.shape, -residual_angle * (1.0 - place / places[1]))
    else:
        mobilised = roughness_angle * float(np.interp(place, places[1:], shares))
    dilation = np.clip(mobilised, 0.0, None) / damage
    return np.radians(residual_angle + mobilised), np.radians(dilation)
