"""Why a number of a result is missing: the reason that a variable with NaN has in its attributes.

A function that knows more states it itself, in the attributes `reason` or `comment` of the variable.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

_FIT = "NaN where no power law was fitted: the set or the surface is empty, flat or too small"
_AMPLITUDE = "NaN where the method gives no amplitude, or no power law was fitted"
_EMPTY = "NaN where the set is empty, or the mask is too small"
_AREA = "NaN where the set is empty"
_SLOPE = "NaN where a value is not positive, or stands alone"
_OCTAVES = "NaN where no run of octaves has one exponent"
_HEIGHTS = "NaN where too few heights are observed at this scale"
_FLAT = "NaN where the heights do not vary, or too few are observed"
_STATE = "NaN where the state has none, see signature_flag and reason, or has no state before it"
_OF_STATES = ("spot_size", "gap_size", "domain_dimension", "excess_dimension", "clustering", "integral_range")
_OF_CHANGES = ("gap_size_ratio", "domain_dimension_change", "excess_dimension_change", "clustering_ratio")
_WITH_ENDS = (*_OF_STATES, *_OF_CHANGES, "integral_range_ratio", "lacunarity_ratio")

REASONS = {
    **dict.fromkeys((f"{name}{end}" for name in _WITH_ENDS for end in ("", "_low", "_high")), _STATE),
    **dict.fromkeys(
        ("local_dimension_min", "local_dimension_max", "spots_dimension", "median_cells"), _STATE
    ),
    **dict.fromkeys((f"pair_correlation_length{end}" for end in ("", "_low", "_high")), _STATE),
    **dict.fromkeys(("hit_fraction", "spots_fraction"), _STATE),
    **dict.fromkeys(("window_low", "window_high"), "NaN where no window of ratio 4 fits into the mask"),
    "stationary_exponent": "NaN where a mask is empty, or cells or ratios of spacings do not allow one",
    **dict.fromkeys(
        ("scale_min", "scale_max", "fitted_hurst", "fractal_dimension", "singularity_strength"), _FIT
    ),
    **dict.fromkeys(("singularity_spectrum", "mass_exponent"), _FIT),
    **dict.fromkeys(("rms_increment", "topothesy"), _AMPLITUDE),
    "noise_height": "NaN where the method has no model of noise, or no power law was fitted",
    "blur_spread": "NaN where the method has no model of blur, or no power law was fitted",
    "misfit": "NaN where the method has no test of its model, or no power law was fitted",
    **dict.fromkeys(("window_hurst", "window_ci_low", "window_ci_high"), _OCTAVES),
    "hurst": _FLAT,
    "standard_error": "NaN where no interval with tested coverage can be given",
    **dict.fromkeys(("covering_area", "cube_count", "roughness", "madogram", "variogram"), _HEIGHTS),
    **dict.fromkeys(("second_variogram", "variation"), _HEIGHTS),
    **dict.fromkeys(("fluctuation", "divider_length", "higuchi_length"), _HEIGHTS),
    **dict.fromkeys(("total_perimeter", "largest_island", "mean_island_area"), _AREA),
    **dict.fromkeys(("largest_length", "mean_island_length"), _AREA),
    **dict.fromkeys(("null_dimension", "null_spread", "mean_mass", "null_mass"), _EMPTY),
    **dict.fromkeys(("minkowski_null_dimension", "correlation_null_dimension"), _EMPTY),
    **dict.fromkeys(("lacunarity", "null_lacunarity", "normalised_lacunarity"), _EMPTY),
    **dict.fromkeys(("lacunarity_low", "lacunarity_high"), f"{_EMPTY}, or the method gives no interval"),
    **dict.fromkeys(("box_local_slope", "minkowski_local_slope", "correlation_local_slope"), _SLOPE),
    "correlation": "NaN where the heights of a face do not vary",
    "tangential_stiffness": "NaN where periodic bodies stick everywhere: they move together as rigid bodies",
    "interpolation_error": "NaN where a face has no line without gaps that is long enough to measure it",
    "scaled_roughness_coefficient": "NaN where the joint roughness coefficient is negative or missing",
    "uplift_arm": "NaN where there is no uplift",
    "rotation_error": "NaN where no rotation was fitted, or too few tiles hold observed heights",
    "aperture": "NaN where the faces do not overlap, or a height is missing",
    **dict.fromkeys(("dilatancy_angle", "friction_angle"), "NaN where the dilatancy is missing"),
    **dict.fromkeys(("shear", "azimuth", "closure", "normal_force"), "NaN as in the data given"),
    "nominal_pressure": "NaN as in the data given",
}


def give_reasons(result: xr.Dataset | xr.DataArray, own: Mapping[str, str]) -> None:
    """Set the attribute `reason` of every variable or coordinate with NaN that states none, in place.

    `own` are the reasons of the function that made the result; they go before those of this module.
    """
    reasons = {**REASONS, **own}
    variables = result.variables if isinstance(result, xr.Dataset) else result.coords.variables
    for name in variables.keys() & reasons.keys():
        variable = variables[name]
        stated = "reason" in variable.attrs or "NaN" in variable.attrs.get("comment", "")
        if variable.dtype.kind == "f" and not stated and np.isnan(variable.values).any():
            variable.attrs["reason"] = reasons[str(name)]
