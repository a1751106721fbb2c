"""Names, units, meanings and encodings of all variables that a result may have.

A public function passes its result through `label`, which sets `units`, `long_name` and the NetCDF encoding
of every variable and coordinate from the table below; other attributes are dropped. A name that is not in
the table is an error. Units are UDUNITS in SI; angles are in degrees, counts in "1". No name is `load`,
which is a method of xarray.
"""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import xarray as xr

CONVENTIONS = "CF-1.11"
CORE_DIMS = ("y", "x")


@dataclass(frozen=True)
class Quantity:
    """Unit (UDUNITS) and meaning of one name; `attributes` are written as they stand.

    A function may state one of `other_units` instead, as for scales in cells.
    """

    units: str | None
    long_name: str
    attributes: dict[str, Any] = field(default_factory=dict)
    other_units: tuple[str, ...] = ()

    @cached_property
    def labels(self) -> dict[str, Any]:
        """Attributes of a variable of this name."""
        units = {} if self.units is None else {"units": self.units}
        return {"long_name": self.long_name} | units | self.attributes


# rms slope beyond which strains are not small: the shear strain under a flattened wave is up to its slope
# over e (1 - nu), about half of it
STEEP = 0.3
# exponents with which surfaces are made; the circulant embedding is positive at .001 and .999 as well, where
# heights are nearly white noise, or a plane
HURST_RANGE: dict[str, Any] = {"at_least": 0.01, "at_most": 0.99}
DEFAULT_TOLERANCE = 1e-8  # of a contact; from 1e-5 on the area is that of the solution (page theory_contact)


def _flags(meanings: str, first: int = 0) -> dict[str, Any]:
    """Return the CF attributes of flags that count from `first`."""
    count = len(meanings.split())
    return {"flag_values": np.arange(first, first + count, dtype=np.int8), "flag_meanings": meanings}


_STATE = _flags("open contact yielded")
OPEN, CONTACT, YIELDED = range(3)
_STOP = _flags("converged rounding stagnated iteration_limit force_missed beyond_full_contact")
STOP_REASONS = dict(zip(_STOP["flag_meanings"].split(), _STOP["flag_values"], strict=True))
_SLIP_STATE = _flags("open stick slip")
_, STICK, SLIP = range(3)
_SLIP_METHOD = _flags("superposition full")
SLIP_MAPS = ("slip_state", "traction_x", "traction_y", "slip_x", "slip_y")  # that `partial_slip` can return
CONTACT_MAPS = ("state", "pressure", "gap", "displacement", "residual_height")  # that `press` can return
_EVENT = _flags("continuation birth death merge split merge_and_split")
_SIGNATURE = _flags("measured empty full no_window filled too_few unresolved")
_SCALE_POSITION = _flags("below inside above", first=-1)
_PREFERRED_LAW = _flags("undecided exponential hyperbolic neither")
PREFERRED_LAW = dict(zip(_PREFERRED_LAW["flag_meanings"].split(), _PREFERRED_LAW["flag_values"], strict=True))
_NO_INTERVAL = {"comment": "NaN where no interval with tested coverage can be given"}
_NO_CENTRE = {"comment": "NaN where an island extends around the whole period"}
_NO_WATER = {"comment": "NaN where no water comes from an edge or a drain"}
_NO_ISLAND = {"comment": "NaN where the set is empty"}


def _with_ends(
    name: str, units: str, long_name: str, attributes: dict[str, Any] | None = None, share: str = "95 % "
) -> dict[str, Quantity]:
    """Return the rows of a quantity and of the ends of its interval, to which alone the attributes belong."""
    of = f"{share}interval of the {name.replace('_', ' ').replace('minkowski', 'Minkowski')}"
    ends = {
        f"{name}_{short}": Quantity(units, f"{end} end of the {of}", attributes or {})
        for short, end in (("low", "lower"), ("high", "upper"))
    }
    return {name: Quantity(units, long_name), **ends}


QUANTITIES: dict[str, Quantity] = {
    # coordinates of the plane and of the paths through it
    "x": Quantity("m", "position along x"),
    "y": Quantity("m", "position along y"),
    "step": Quantity("1", "step of the load path"),
    "shear": Quantity("m", "shear displacement of the block"),
    "direction": Quantity(None, "direction in which the block slides (E is +x, N is +y)"),
    "azimuth": Quantity("degree", "azimuth (E = 0, anticlockwise)"),
    "member": Quantity("1", "member of an ensemble"),
    "scan": Quantity(None, "measured surface, by its file"),
    "axis": Quantity(None, "axis of the plane"),
    # surfaces
    "height": Quantity("m", "surface height"),
    "valid": Quantity("1", "cell was observed"),
    "mask": Quantity("1", "cell belongs to the set"),
    "finest_scale": Quantity("m", "shortest wavelength that the measured points resolve"),
    "plane_axis": Quantity(None, "axis of the best-fit plane"),
    "point_axis": Quantity(None, "axis of the coordinates of the points"),
    "position": Quantity("m", "positions of the points"),
    "triangles": Quantity("1", "numbers of the points that each triangle joins"),
    "rotation_matrix": Quantity("1", "unit vectors along the axes of the plane"),
    "centre": Quantity("m", "mean position of the points"),
    "point_count": Quantity("1", "number of points"),
    "filled_points": Quantity("1", "number of missing points that were filled"),
    "removed_points": Quantity("1", "number of spikes that were removed"),
    "missing_points": Quantity("1", "number of missing points"),
    "mean_height": Quantity("m", "mean height"),
    "rms_height": Quantity("m", "root mean square height about the mean"),
    "mean_absolute_height": Quantity("m", "mean absolute deviation of the heights from their mean"),
    "peak_height": Quantity("m", "largest height above the mean"),
    "valley_depth": Quantity("m", "largest depth below the mean"),
    "peak_to_valley": Quantity("m", "largest minus smallest height"),
    "skewness": Quantity("1", "skewness of the heights"),
    "kurtosis": Quantity("1", "kurtosis of the heights (3 for a Gaussian surface)"),
    "autocorrelation_length": Quantity("m", "shortest distance at which the autocorrelation is 0.2"),
    "texture_aspect_ratio": Quantity(
        "1", "shortest over longest distance at which the autocorrelation is 0.2"
    ),
    "core_height": Quantity("m", "height of the core of the surface"),
    "reduced_peak_height": Quantity("m", "mean height of the peaks above the core"),
    "reduced_valley_depth": Quantity("m", "mean depth of the valleys below the core"),
    "peak_material_ratio": Quantity("1", "share of the area that the peaks above the core take"),
    "valley_material_ratio": Quantity("1", "share of the area above the valleys below the core"),
    "rms_slope": Quantity("1", "root mean square of the surface gradient (both components)"),
    "rms_slope_x": Quantity("1", "root mean square slope along x"),
    "rms_slope_y": Quantity("1", "root mean square slope along y"),
    "mean_slope_x": Quantity("1", "slope of the mean plane along x"),
    "mean_slope_y": Quantity("1", "slope of the mean plane along y"),
    "rms_curvature": Quantity("m-1", "root mean square of the mean curvature"),
    "nayak_parameter": Quantity("1", "bandwidth parameter of Nayak, m0 m4 / m2^2"),
    "developed_area_ratio": Quantity("1", "area of the surface over the area of its plane"),
    "developed_area_excess": Quantity("1", "area of the surface over the area of its plane, minus one"),
    # dimensions
    "method": Quantity(None, "estimator"),
    "hurst": Quantity("1", "Hurst exponent"),
    **_with_ends("fractal_dimension", "1", "fractal dimension", _NO_INTERVAL),
    "note": Quantity(None, "remarks on the estimate"),
    "reason": Quantity(None, "why there is no interval, or no estimate"),
    "window_rule": Quantity(None, "how the scales of the fit were chosen"),
    "fitted_hurst": Quantity("1", "Hurst exponent as fitted, not limited to 0 ... 1"),
    "misfit": Quantity("1", "goodness of fit: z of the change of the exponent with scale"),
    "standard_error": Quantity("1", "standard error of the Hurst exponent"),
    "ci_low": Quantity("1", "lower end of the 95 % confidence interval of the Hurst exponent", _NO_INTERVAL),
    "ci_high": Quantity("1", "upper end of the 95 % confidence interval of the Hurst exponent", _NO_INTERVAL),
    "window_hurst": Quantity("1", "Hurst exponent of the waves that one model describes"),
    "window_ci_low": Quantity("1", "lower end of the 95 % interval of window_hurst"),
    "window_ci_high": Quantity("1", "upper end of the 95 % interval of window_hurst"),
    "in_window": Quantity("1", "the octave is among the waves that one model describes"),
    "scale_min": Quantity("m", "smallest scale of the fit", other_units=("1",)),
    "scale_max": Quantity("m", "largest scale of the fit", other_units=("1",)),
    "rms_increment": Quantity("m", "root mean square height increment over one lag"),
    "increment_lag": Quantity("m", "lag of the height increment"),
    "noise_height": Quantity("m", "root mean square height of white measurement noise"),
    "blur_spread": Quantity("m", "spread of the instrument's Gaussian point spread function"),
    "topothesy": Quantity("m", "topothesy: lag at which the rms increment equals the lag"),
    "isotropy_p_value": Quantity(
        "1", "p value of isotropy: probability that an isotropic surface differs as much"
    ),
    **_with_ends(
        "anisotropy_ratio", "1", "ratio of the longest to the shortest correlation length", _NO_INTERVAL
    ),
    "anisotropy_azimuth": Quantity("degree", "azimuth of the longer correlation (E = 0, anticlockwise)"),
    "anisotropy_p_value": Quantity(
        "1", "p value of the anisotropy ratio: probability that such a surface differs as much"
    ),
    "run_time": Quantity("s", "run time"),
    "wavenumber": Quantity("rad m-1", "wavenumber"),
    "wavelength": Quantity("m", "wavelength"),
    "wave": Quantity("1", "number of the single wave, the strongest first"),
    "wave_azimuth": Quantity("degree", "azimuth across the crests of a wave (E = 0, anticlockwise)"),
    "wave_amplitude": Quantity("m", "amplitude of a wave, from the mean to a crest"),
    "wave_p_value": Quantity("1", "probability that a surface without single waves has one as strong"),
    "power_spectral_density": Quantity("m4", "power spectral density of the surface"),
    "profile_power_spectral_density": Quantity("m3", "power spectral density of the profile"),
    "mode_count": Quantity("1", "number of modes in the bin"),
    "lag": Quantity("m", "lag"),
    "pair_count": Quantity("1", "number of pairs of points"),
    "variogram": Quantity("m2", "half the mean square height increment"),
    "second_variogram": Quantity("m2", "mean square second difference of the heights"),
    "madogram": Quantity("m", "half the mean absolute height increment"),
    "cube_size": Quantity("m", "edge of the cubes along the surface"),
    "cube_count": Quantity("1", "number of cubes that meet the surface"),
    "window_size": Quantity("m", "edge of the window"),
    "roughness": Quantity("m", "mean root mean square height inside the windows"),
    "variation": Quantity("m", "mean range of the heights over a window"),
    "higuchi_length": Quantity("m", "length of a profile after Higuchi"),
    "divider_length": Quantity("m", "length of a profile measured with dividers"),
    "divider": Quantity("m", "opening of the dividers"),
    "fluctuation": Quantity("m", "root mean square height about straight lines in windows"),
    "covering_area": Quantity("m2", "area of the triangulated surface"),
    "covering_length": Quantity("m", "length of the polygon through the profile"),
    "vertical_scale": Quantity("1", "factor on the heights"),
    "local_slope": Quantity(
        "1", "local slope in log-log scale", {"comment": "NaN where a value is not positive, or stands alone"}
    ),
    # contact
    "closure": Quantity("m", "closure from first touch"),
    "normal_force": Quantity("N", "normal force"),
    "nominal_pressure": Quantity("Pa", "normal force over the nominal area"),
    "nominal_area": Quantity("m2", "nominal contact area"),
    "contact_area": Quantity("m2", "real contact area (cells in contact)"),
    "contact_fraction": Quantity("1", "real over nominal contact area (cells in contact)"),
    "corrected_contact_fraction": Quantity(
        "1", "real over nominal contact area, corrected for the perimeter"
    ),
    "mean_gap": Quantity("m", "mean gap"),
    "elastic_energy": Quantity("J", "elastic energy"),
    "plastic_work": Quantity("J", "work spent on indentation at the hardness, since the start of the path"),
    "iterations": Quantity("1", "number of iterations"),
    "transforms": Quantity("1", "number of pairs of Fourier transforms"),
    "residual": Quantity("1", "optimality error reached"),
    "converged": Quantity("1", "the tolerance was met"),
    "stop_reason": Quantity("1", "why the solver stopped", _STOP),
    "state": Quantity("1", "contact state", _STATE),
    "pressure": Quantity("Pa", "contact pressure"),
    "gap": Quantity("m", "gap between the bodies"),
    "displacement": Quantity("m", "elastic displacement of the surface"),
    "residual_height": Quantity("m", "surface height after unloading"),
    "disc_radius": Quantity("m", "radius of the rigid circular plate"),
    "contact_modulus": Quantity("Pa", "contact modulus E* of the pair"),
    "poisson": Quantity("1", "Poisson's ratio of the bodies"),
    "friction_coefficient": Quantity("1", "coefficient of friction"),
    "tangential_force": Quantity("N", "tangential force on the upper body, positive towards the direction"),
    "tangential_displacement": Quantity("m", "elastic displacement of the upper body along the direction"),
    "slip_method": Quantity("1", "method that solved the partial slip", _SLIP_METHOD),
    "superposition_error": Quantity("1", "relative error of a tangential displacement by superposition"),
    "tangential_stiffness": Quantity("N m-1", "increment of tangential force over that of displacement"),
    "contact_stiffness": Quantity("Pa m-1", "derivative of the nominal pressure by the closure"),
    "relative_conductance": Quantity(
        "m-1", "contact conductance per nominal area over the mean conductivity 2/(rho1 + rho2)"
    ),
    "maximum_pressure": Quantity("Pa", "greatest pressure in the contact"),
    "pressure_class": Quantity("1", "middle of a class of pressures, over the greatest pressure"),
    "area_share": Quantity("1", "share of the nominal area with a pressure of the class"),
    "load_share": Quantity("1", "share of the force borne at a pressure of the class"),
    "interface_stiffness": Quantity("Pa m-1", "normal stiffness of the interface per nominal area"),
    "stiffness_ratio": Quantity("1", "shear stiffness of the interface over its normal stiffness"),
    "stuck_ratio": Quantity("1", "theory for that ratio where nothing slips: 2 (1 - nu)/(2 - nu)"),
    "sliding_force": Quantity("N", "tangential force at which the whole contact slides"),
    "stick_area": Quantity("m2", "contact area that sticks (cells)"),
    "slip_area": Quantity("m2", "contact area that slips (cells)"),
    "dissipated_energy": Quantity("J", "energy dissipated by friction since the start of the path"),
    "slip_state": Quantity("1", "open, stick or slip", _SLIP_STATE),
    "traction_x": Quantity("Pa", "tangential traction on the surface along x"),
    "traction_y": Quantity("Pa", "tangential traction on the surface along y"),
    "slip_x": Quantity("m", "slip of the upper body over the surface along x"),
    "slip_y": Quantity("m", "slip of the upper body over the surface along y"),
    "theory": Quantity(None, "theory of rough contact"),
    "m0": Quantity("m2", "mean square height"),
    "m2": Quantity("1", "mean square slope of the profiles of an isotropic surface"),
    "m4": Quantity("m-2", "mean square second derivative of the profiles of an isotropic surface"),
    "pressure_spread": Quantity("Pa", "standard deviation of the pressure in complete contact, E* g/2"),
    # joints
    "bulk_closure": Quantity("m", "closure of the flat block under the same force"),
    "interface_closure": Quantity("m", "closure without that of the flat block"),
    "initial_force": Quantity("N", "normal force at zero shear"),
    "normal_stiffness": Quantity("Pa m-1", "stiffness of the spring on the block, per nominal area"),
    "rigid_dilatancy": Quantity("m", "rigid dilatancy relative to zero shear"),
    "initial_offset": Quantity("m", "rigid separation at zero shear"),
    "dilatancy": Quantity("m", "dilatancy under normal force"),
    "mean_slope": Quantity("1", "slope of the mean plane towards the direction of sliding"),
    "plateau_dilatancy": Quantity("m", "rigid dilatancy without that of the mean plane"),
    "basic_friction_angle": Quantity("degree", "basic friction angle"),
    "dilatancy_angle": Quantity("degree", "dilatancy angle"),
    "frictionless_angle": Quantity("degree", "angle of the force between the faces without friction"),
    "friction_angle": Quantity("degree", "friction angle"),
    "shear_strength": Quantity("Pa", "shear strength"),
    "structure_size": Quantity("m", "size of the structure: height of material above the joint"),
    "strength_exponent": Quantity("1", "exponent of the shear strength over the size of the structure"),
    "distance": Quantity("m", "shear over which a peak is taken"),
    "secant_friction_angle": Quantity("degree", "greatest friction angle over a distance of shear"),
    "secant_shear_strength": Quantity("Pa", "greatest shear strength over a distance of shear"),
    "peak_distance": Quantity("m", "distance of shear of the peak values"),
    "peak_friction_angle": Quantity("degree", "greatest friction angle over the peak distance"),
    "peak_shear": Quantity("m", "shear from which the greatest friction angle extends"),
    "peak_shear_strength": Quantity("Pa", "greatest shear strength over the peak distance"),
    "peak_strength_shear": Quantity("m", "shear from which the greatest shear strength extends"),
    "shear_stress": Quantity("Pa", "shear stress on the block, positive towards its direction"),
    "point": Quantity("1", "point of the path of shear"),
    **_with_ends("closure_length", "m", "closure in which the pressure grows by e, of the exponential law"),
    **_with_ends("reference_pressure", "Pa", "pressure at zero closure of the exponential law"),
    "exponential_misfit": Quantity("m", "root mean square difference from the exponential law"),
    **_with_ends("initial_stiffness", "Pa m-1", "normal stiffness at zero pressure of the hyperbolic law"),
    **_with_ends("greatest_closure", "m", "greatest closure of the hyperbolic law"),
    "hyperbolic_misfit": Quantity("m", "root mean square difference from the hyperbolic law"),
    "preferred_law": Quantity("1", "law that the closures of the first loading prefer", _PREFERRED_LAW),
    "law_score": Quantity("1", "statistic of Vuong, exponential against hyperbolic law"),
    "seating_pressure": Quantity("Pa", "nominal pressure from which the closure is counted"),
    "seated_closure": Quantity("m", "interface closure counted from the seating pressure"),
    "roughness_coefficient": Quantity("1", "joint roughness coefficient JRC"),
    "roughness_coefficient_low": Quantity("1", "JRC below which 2.5 % of the single profiles lie"),
    "roughness_coefficient_high": Quantity("1", "JRC above which 2.5 % of the single profiles lie"),
    "scaled_roughness_coefficient": Quantity("1", "joint roughness coefficient JRC of the longer joint"),
    "scaled_wall_strength": Quantity("Pa", "wall strength JCS of the longer joint"),
    "size_ratio": Quantity("1", "ratio of the sizes of two joints"),
    "strength_factor": Quantity("1", "factor of the shear strength"),
    "friction_factor": Quantity("1", "factor of the friction coefficient"),
    "fracture_energy_factor": Quantity("1", "factor of the fracture energy"),
    "scale_position": Quantity("1", "position of JRC on the scale of standard profiles", _SCALE_POSITION),
    "lag_azimuth": Quantity("degree", "azimuth of the lag in whole cells, from x towards y"),
    "regression_interval": Quantity("m", "sampling interval to which the regression was fitted"),
    "area_fraction": Quantity("1", "share of the area that faces the shear"),
    "theta_max": Quantity("degree", "greatest apparent dip towards the shear"),
    "shape": Quantity("1", "exponent C of the area over the apparent dip"),
    "roughness_metric": Quantity("degree", "directional roughness theta_max/(C+1)"),
    "mean_dip": Quantity("degree", "mean apparent dip of the area that faces the shear"),
    "shear_displacement": Quantity("m", "shear displacement of the block with its elastic part"),
    "normal_stress": Quantity("Pa", "normal stress on the block"),
    "shear_stiffness": Quantity("Pa m-1", "elastic shear stiffness per nominal area"),
    "peak_displacement": Quantity("m", "shear displacement at the greatest shear stress"),
    "wear_depth": Quantity("m", "volume worn off both faces over the nominal area"),
    "worn_fraction": Quantity("1", "share of the block that has been worn"),
    "residual_shear_strength": Quantity("Pa", "mean shear stress over the end of the first leg"),
    "residual_lower": Quantity("m", "height of the lower face after the test"),
    "residual_upper": Quantity("m", "height of the upper face after the test"),
    "criterion": Quantity(None, "criterion of shear strength"),
    "assumption": Quantity(None, "what the criterion assumes"),
    "in_range": Quantity("1", "the criterion was made for such values"),
    "asperity_angle": Quantity("degree", "asperity angle i"),
    "profile_slope": Quantity("1", "root mean square slope Z2 of the profile at a lag"),
    "smoothing": Quantity("m", "length of shear over which the slope of the dilatancy was taken"),
    "stiffness": Quantity("Pa m-1", "normal stiffness per nominal area"),
    "interpolation_error": Quantity("m", "rms interpolation error for shifts of a fraction of a cell"),
    "aperture": Quantity("m", "mechanical aperture"),
    "correlation": Quantity("1", "correlation of the facing heights"),
    "structure_function": Quantity("m2", "variance of the difference of the facing heights"),
    "covering_dimension": Quantity("1", "dimension by the area of the triangulated surface"),
    "variogram_dimension": Quantity("1", "dimension by the variogram"),
    "spectrum_dimension": Quantity("1", "dimension by the power spectral density"),
    "delta_height": Quantity("m", "root mean square height of the delta-surface"),
    **_with_ends("decorrelation_length", "m", "shear at which the facing heights have decorrelated"),
    "missing_reason": Quantity(None, "why a value or its interval is missing"),
    "shift_x": Quantity("m", "shift of the upper face along x"),
    "shift_y": Quantity("m", "shift of the upper face along y"),
    "rotation": Quantity("degree", "rotation of the upper face in its plane"),
    "shift_x_error": Quantity("m", "standard error of the shift along x"),
    "shift_y_error": Quantity("m", "standard error of the shift along y"),
    "rotation_error": Quantity("degree", "standard error of the rotation"),
    "tilt_x": Quantity("1", "slope added to the upper face along x"),
    "tilt_y": Quantity("1", "slope added to the upper face along y"),
    "mismatch": Quantity("m", "root mean square mismatch of the faces in mated position"),
    "common_fraction": Quantity("1", "fraction of the lower face that the upper one covers"),
    "hydraulic_aperture": Quantity("m", "hydraulic aperture (cubic law)"),
    "transmissivity": Quantity("m3", "transmissivity: hydraulic aperture cubed over 12"),
    "percolates": Quantity("1", "an open path crosses the joint along the axis"),
    "open_fraction": Quantity("1", "open over nominal area"),
    "narrow_fraction": Quantity(
        "1", "area open by less than 0.001 of the mean opening, which counts as closed, over nominal area"
    ),
    "overlap_fraction": Quantity("1", "area where the faces overlap over nominal area"),
    "flow_conductance": Quantity("m3 Pa-1 s-1", "flow per width and pressure gradient"),
    "relative_pressure": Quantity("1", "fluid pressure over its drop along the axis"),
    "flux_x": Quantity("m3", "flow per width along x, times viscosity over the mean pressure gradient"),
    "flux_y": Quantity("m3", "flow per width along y, times viscosity over the mean pressure gradient"),
    "diagram": Quantity(None, "distribution of the uplift: of the joint, or assumed by guidelines"),
    "fluid_pressure": Quantity("Pa", "water pressure in the joint", _NO_WATER),
    "uplift_profile": Quantity("Pa", "uplift per area along the flow, mean across it"),
    "uplift_force": Quantity("N", "uplift force"),
    "mean_uplift": Quantity("Pa", "uplift force over the nominal area"),
    "uplift_arm": Quantity("m", "distance of the line of action of the uplift from the upstream side"),
    "uplift_x": Quantity("m", "x of the point where the uplift acts"),
    "uplift_y": Quantity("m", "y of the point where the uplift acts"),
    "effective_stress": Quantity("Pa", "normal stress on the contacts over the nominal area"),
    "balance_error": Quantity("1", "effective stress plus uplift over the total stress, minus 1"),
    "wet_fraction": Quantity("1", "area under water pressure over nominal area"),
    "isolated_fraction": Quantity("1", "open area that no water reaches over nominal area"),
    # domains
    "exponent": Quantity("1", "exponent s of the content"),
    "hausdorff_content": Quantity(None, "Hausdorff content by dyadic squares, mean over the shifts"),
    "hausdorff_content_min": Quantity(None, "Hausdorff content, least over the shifts"),
    "relative_content": Quantity("1", "Hausdorff content over that power of the side of the extent"),
    "coarsest_side": Quantity("m", "side of the largest square of the cover"),
    "stationary_exponent": Quantity("1", "exponent at which the content does not depend on the resolution"),
    "scale": Quantity("m", "side of the square"),
    "side": Quantity("m", "side of the square"),
    "window_low": Quantity("m", "shortest side of a square in the window"),
    "window_high": Quantity("m", "longest side of a square in the window"),
    **_with_ends("spot_size", "m", "4 coverage over perimeter per area, the diameter of discs"),
    **_with_ends("gap_size", "m", "square that meets the set at half of its positions"),
    **_with_ends("gap_size_ratio", "1", "gap size over that of the state before"),
    **_with_ends("pair_correlation_length", "m", "distance up to which the pair correlation exceeds 2"),
    **_with_ends("domain_dimension", "1", "box dimension of the domain over the window"),
    **_with_ends("domain_dimension_change", "1", "box dimension less that of the state before"),
    "local_dimension_min": Quantity("1", "least local box dimension in the window"),
    "local_dimension_max": Quantity("1", "greatest local box dimension in the window"),
    "spots_dimension": Quantity("1", "box dimension of random spots of equal area, perimeter and number"),
    **_with_ends("excess_dimension", "1", "box dimension less that of random spots"),
    **_with_ends("excess_dimension_change", "1", "excess dimension less that of the state before"),
    **_with_ends("clustering", "1", "squares that meet random spots over those that meet the set"),
    **_with_ends("clustering_ratio", "1", "clustering over that of the state before"),
    **_with_ends("integral_range", "m2", "integral range: area of an independent patch of the set"),
    **_with_ends("integral_range_ratio", "1", "integral range over that of the state before"),
    **_with_ends("lacunarity_ratio", "1", "lacunarity less 1 of boxes along x over that of boxes along y"),
    "hit_fraction": Quantity("1", "share of positions at which the square meets the set"),
    "spots_fraction": Quantity("1", "share of positions at which the square meets random spots"),
    "median_cells": Quantity("1", "number of cells of the median island"),
    "signature_flag": Quantity("1", "whether the state has a dimension", _SIGNATURE),
    "box_size": Quantity("1", "edge of the box in cells"),
    "box_length": Quantity("m", "edge of the box"),
    "box_count": Quantity("1", "number of boxes that meet the set"),
    "box_measure": Quantity(
        "1", "number of boxes that meet the set, cut boxes by their part inside the mask"
    ),
    **_with_ends("box_dimension", "1", "box dimension of the set", _NO_INTERVAL, share=""),
    "null_dimension": Quantity("1", "box dimension of the random null of equal coverage"),
    "null_spread": Quantity("1", "standard deviation of the box dimension of the random null"),
    "box_local_slope": Quantity("1", "local box dimension, -d ln(box_measure)/d ln(box_size)"),
    "minkowski_local_slope": Quantity("1", "local Minkowski dimension, 2 - d ln(area)/d ln(radius)"),
    "correlation_local_slope": Quantity("1", "local correlation dimension, d ln(mean_mass)/d ln(box_size)"),
    "minkowski_null_dimension": Quantity("1", "Minkowski dimension of the random null of equal coverage"),
    "correlation_null_dimension": Quantity("1", "correlation dimension of the random null of equal coverage"),
    "null_count": Quantity("1", "expected number of boxes that meet the random null"),
    "differs_from_random": Quantity("1", "the set differs from the random null of equal coverage"),
    "coverage": Quantity("1", "fraction of the observed cells in the set"),
    "is_saturated": Quantity("1", "more than half of the largest boxes meet the islands of the set"),
    "follows_power_law": Quantity("1", "the local slopes of the window agree with one power law"),
    **_with_ends("minkowski_dimension", "1", "Minkowski dimension of the set", _NO_INTERVAL, share=""),
    "radius": Quantity("1", "radius by which the set is dilated, in cells"),
    "radius_length": Quantity("m", "radius by which the set is dilated"),
    "grown_fraction": Quantity("1", "area within the radius of the set over the observed area"),
    "null_fraction": Quantity("1", "area within the radius of the random null over the observed area"),
    **_with_ends("correlation_dimension", "1", "correlation dimension of the set", _NO_INTERVAL, share=""),
    "mean_mass": Quantity("1", "mean number of cells of the set in a square around one of them"),
    "null_mass": Quantity("1", "mean number of cells of the random null in a square around one of them"),
    **_with_ends("lacunarity", "1", "gliding-box lacunarity"),
    "null_lacunarity": Quantity("1", "lacunarity of the random null of equal coverage"),
    "normalised_lacunarity": Quantity("1", "lacunarity minus 1 over that of single cells minus 1"),
    "area_dimension": Quantity("1", "dimension of the set by its area at several resolutions"),
    "resolution": Quantity("m", "spacing to which the contact is resolved"),
    "boundary_sides": Quantity("1", "number of sides of cells on the boundary of the set"),
    "largest_share": Quantity("1", "share of the set in its largest island", _NO_ISLAND),
    "singularity_strength": Quantity("1", "singularity strength alpha(q)"),
    "singularity_spectrum": Quantity("1", "singularity spectrum f(alpha(q))"),
    **_with_ends("boundary_dimension", "1", "dimension of the boundary of the set", _NO_INTERVAL, share=""),
    "moment_order": Quantity("1", "order q of the moment"),
    "generalised_dimension": Quantity("1", "generalised dimension D_q"),
    "mass_exponent": Quantity("1", "mass exponent tau(q)"),
    "island": Quantity("1", "island"),
    "island_label": Quantity("1", "number of the island in the label map"),
    "island_step": Quantity("1", "step of the plane that holds the island"),
    "island_shear": Quantity("m", "shear displacement of the plane that holds the island"),
    "island_direction": Quantity(None, "direction of sliding of the plane that holds the island"),
    "island_scan": Quantity(None, "scan that holds the island"),
    "island_member": Quantity("1", "ensemble member that holds the island"),
    "n_islands": Quantity("1", "number of islands"),
    "label": Quantity("1", "number of the island, 0 outside"),
    "area": Quantity("m2", "area of the island"),
    "length": Quantity("m", "length of the island"),
    "cells": Quantity("1", "number of cells of the island"),
    "perimeter": Quantity("m", "perimeter of the island"),
    "orientation": Quantity("degree", "angle from y to the long axis of the island", _NO_CENTRE),
    "eccentricity": Quantity("1", "eccentricity of the ellipse of equal second moments", _NO_CENTRE),
    "gyration_radius": Quantity("m", "rms distance of the cells of the island from its centroid", _NO_CENTRE),
    "solidity": Quantity("1", "cells of the island over those of its convex hull", _NO_CENTRE),
    "centroid_x": Quantity("m", "centroid along x", _NO_CENTRE),
    "centroid_y": Quantity("m", "centroid along y", _NO_CENTRE),
    "x_min": Quantity("m", "western edge of the island"),
    "x_max": Quantity("m", "eastern edge of the island"),
    "y_min": Quantity("m", "southern edge of the island"),
    "y_max": Quantity("m", "northern edge of the island"),
    "largest_cells": Quantity("1", "number of cells of the largest island"),
    "total_perimeter": Quantity("m", "perimeter of the set"),
    "largest_island": Quantity("m2", "area of the largest island"),
    "mean_island_area": Quantity("m2", "mean area of the islands"),
    "largest_length": Quantity("m", "length of the largest island of a profile"),
    "mean_island_length": Quantity("m", "mean length of the islands of a profile"),
    "euler_number": Quantity("1", "Euler number: islands less holes"),
    "births": Quantity("1", "islands that overlap no island of the step before"),
    "deaths": Quantity("1", "islands of the step before that overlap no island"),
    "merges": Quantity("1", "islands that overlap several of the step before"),
    "splits": Quantity("1", "islands of the step before that overlap several"),
    "absorbed": Quantity("1", "islands of the step before that merges joined to others"),
    "fragments": Quantity("1", "islands that splits added"),
    "overlap": Quantity("1", "common over united area of successive sets"),
    "chance_overlap": Quantity("1", "expected overlap of successive sets placed at random"),
    "overlap_beyond_chance": Quantity("1", "overlap beyond that by chance, over the largest possible"),
    "hausdorff_distance": Quantity("m", "Hausdorff distance between successive sets"),
    "return_step": Quantity("1", "step with the same load on the opposite branch of the path"),
    "hysteresis": Quantity("1", "share of the united area of two sets at the same load that is in only one"),
    "coverage_change": Quantity("1", "coverage less that at the same load on the opposite branch"),
    "link": Quantity("1", "relation of an island before to an island after"),
    "link_step": Quantity("1", "step of the later plane"),
    "link_shear": Quantity("m", "shear displacement of the later plane"),
    "link_direction": Quantity(None, "direction of sliding of both planes"),
    "link_scan": Quantity(None, "scan of both planes"),
    "link_member": Quantity("1", "ensemble member of both planes"),
    "island_before": Quantity("1", "number of the island before, 0 if there is none"),
    "island_after": Quantity("1", "number of the island after, 0 if there is none"),
    "common_cells": Quantity("1", "number of cells that both islands share"),
    "cells_before": Quantity("1", "number of cells of the island before, 0 if there is none"),
    "cells_after": Quantity("1", "number of cells of the island after, 0 if there is none"),
    "event": Quantity("1", "event in the history of the island", _EVENT),
    # accuracy
    "error": Quantity("1", "true error"),
    "memory": Quantity("byte", "peak memory"),
    "first_run_time": Quantity("s", "run time of the first call, with compilation"),
    "parameter": Quantity("1", "parameter of the method that trades error for time"),
    "setting": Quantity("1", "number of the setting, in the order of growing cost"),
    "benchmark": Quantity(None, "methods that approximate the same known result"),
    "parameter_name": Quantity(None, "meaning of the parameter"),
    "error_meaning": Quantity(None, "meaning of the error"),
    "truth": Quantity(None, "what the error is measured against"),
    "on_pareto_front": Quantity(
        "1", "no comparable setting of another method is better in both error and time"
    ),
    "family": Quantity(None, "family of surfaces"),
    "size": Quantity("1", "points along an edge"),
    "bias": Quantity("1", "mean error of the Hurst exponent"),
    "rms_error": Quantity("1", "root mean square error of the Hurst exponent"),
    "blur": Quantity("1", "spread of the blur, in spacings"),
    "relative_noise": Quantity("1", "rms height of white noise over the rms increment"),
    "marks": Quantity("1", "amplitude of an oblique wave over the rms increment"),
    "least_error": Quantity("1", "least standard deviation of the Hurst exponent (Cramer-Rao bound)"),
    **_with_ends("error_ratio", "1", "root mean square error over the Cramer-Rao bound"),
    **_with_ends("interval_coverage", "1", "share of the 95 % intervals that hold the true exponent"),
    "interval_share": Quantity("1", "share of the surfaces with an interval"),
    "caveats": Quantity(None, "what limits the results of the scan"),
    "between_scans": Quantity("1", "standard deviation of the exponent between scans"),
    "within_scans": Quantity("1", "standard error of the exponent of a scan, root mean square over scans"),
    "heterogeneity": Quantity("1", "share of the scatter between scans in the mean square"),
    "scan_count": Quantity("1", "number of scans"),
    "status": Quantity(None, "whether the study of the scan is done or failed"),
    "member_count": Quantity("1", "number of surfaces"),
}

T = TypeVar("T", xr.Dataset, xr.DataArray)


NOTES = ("long_name", "comment", "reason")


def units_of(name: Hashable, attributes: Mapping[Any, Any]) -> str:
    """Return the units that a variable states, or else those of its name; "" where it has none."""
    quantity = QUANTITIES.get(str(name))
    return str(attributes.get("units") or (quantity.units if quantity else "") or "")


def in_cells(name: str) -> dict[str, str]:
    """Return the attributes of a length or an area that is counted in cells; none of other quantities."""
    quantity = QUANTITIES.get(name)
    return {"units": "1", "comment": "in cells"} if quantity and quantity.units in ("m", "m2") else {}


def is_in_cells(attributes: Mapping[Any, Any]) -> bool:
    """Return whether a variable with these attributes is counted in cells, as `in_cells` says."""
    return attributes.get("units") == "1" and str(attributes.get("comment", "")).startswith("in cells")


def label(data: T) -> T:
    """Return `data` with the labels of this table; of other attributes few are kept.

    They are the period of an axis, `reason`, and of the variables of a Dataset `long_name` and `comment`.

    Parameters
    ----------
    data : Dataset or DataArray
        Every variable and coordinate is known to the table; a DataArray by its `name`. The coordinate of a
        dim may have a name of the user's own, and so may one of the rows of a table that is called after
        their dim (`island_seed`): it keeps its own units and meaning.

    Returns
    -------
    Dataset or DataArray
        A shallow copy. Attributes of the Dataset itself are kept: `base.provenance` sets them.

    Raises
    ------
    KeyError
        A name is not in the table.
    """
    data = data.copy(deep=False)
    coordinates = data.coords.variables  # not DataArrays, which take 30 microseconds each to make
    for name, coordinate in coordinates.items():
        if name not in QUANTITIES and _follows_dim(str(name), coordinate.dims):
            _label_own(str(name), coordinate)
        else:
            _label_variable(str(name), coordinate, ("reason",), is_coordinate=True)
    if not hasattr(data, "data_vars"):
        _label_variable(str(data.name), data.variable, (), is_coordinate=False)
        return data
    for name in data.variables.keys() - coordinates.keys():
        _label_variable(str(name), data.variables[name], NOTES, is_coordinate=False)
    return data


def encoded(dataset: xr.Dataset) -> xr.Dataset:
    """Return a shallow copy whose variables carry the encoding of this table and no other.

    Otherwise the encoding left by a file or an operation would decide how the data are written.
    """
    dataset = dataset.copy(deep=False)
    for name, variable in dataset.variables.items():
        variable.encoding = _encoding(variable, is_coordinate=name in dataset.coords)
    return dataset


def _label_variable(name: str, variable: xr.Variable, kept: tuple[str, ...], *, is_coordinate: bool) -> None:
    """Label a variable; of its attributes some are kept, and units that it may state."""
    if name not in QUANTITIES:
        raise KeyError(f"variable {name!r} has no unit: give it a Quantity in `base/schema.py`")
    quantity, stated = QUANTITIES[name], variable.attrs
    attributes = quantity.labels.copy()
    if name in CORE_DIMS and "period" in stated:
        attributes["period"] = float(stated["period"])
    if kept and stated.get("units") == "1":
        attributes |= in_cells(name)
    if kept and stated.get("units") in quantity.other_units:
        attributes["units"] = stated["units"]
    variable.attrs = attributes | {key: stated[key] for key in kept if key in stated}
    variable.encoding = _encoding(variable, is_coordinate=is_coordinate)


def _follows_dim(name: str, dims: tuple[Hashable, ...]) -> bool:
    """Return whether a coordinate is that of its only dim, or named after it (`island_seed`)."""
    return len(dims) == 1 and (name == dims[0] or name.startswith(f"{dims[0]}_"))


def _label_own(name: str, variable: xr.Variable) -> None:
    """Label the coordinate of a dim that is not in the table."""
    attributes = {"long_name": str(variable.attrs.get("long_name", name))}
    if variable.dtype.kind in "biuf":
        attributes["units"] = str(variable.attrs.get("units", "1"))
    variable.attrs = attributes
    variable.encoding = _encoding(variable, is_coordinate=True)


def _encoding(variable: xr.Variable, *, is_coordinate: bool) -> dict[str, Any]:
    kind = variable.dtype.kind
    if kind in "USO":
        return {"dtype": "S1"}
    encoding: dict[str, Any] = {}
    if is_coordinate or kind != "f":
        encoding["_FillValue"] = None
    if is_coordinate or not variable.ndim:
        return encoding
    is_map = variable.dims[-2:] == CORE_DIMS
    if is_map or variable.nbytes > 4096:  # compression saves no space in a smaller variable
        encoding.update(zlib=True, complevel=4, shuffle=True, fletcher32=True)
        if is_map:
            encoding["chunksizes"] = (1,) * (variable.ndim - 2) + variable.shape[-2:]
    return encoding
