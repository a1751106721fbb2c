"""Names on axes and the scale of a variable; the SI prefixes are those of `base.units`."""

from __future__ import annotations

import xarray as xr

from fractalcontact.base.schema import QUANTITIES
from fractalcontact.base.units import Scale, scale_for

# names on axes, where the long name of the schema is too long
SHORT = {
    "height": "height",
    "closure": "closure $w$",
    "interface_closure": r"interface closure $w_\mathrm{int}$",
    "normal_force": "normal force $F$",
    "nominal_pressure": "nominal pressure",
    "shear": "shear displacement $v$",
    "tangential_force": "tangential force $Q$",
    "tangential_displacement": "tangential displacement",
    "rigid_dilatancy": r"rigid dilatancy $\delta_\mathrm{r}$",
    "dilatancy": r"dilatancy $\delta$",
    "contact_fraction": "real contact area",
    "coverage": "coverage",
    "friction_angle": "friction angle",
    "dilatancy_angle": "dilatancy angle",
    "shear_displacement": "shear displacement",
    "shear_stress": r"shear stress $\tau$",
    "normal_stress": r"normal stress $\sigma$",
    "shear_strength": r"shear strength $\tau$",
    "box_dimension": r"box dimension $\Delta_\sigma$",
    "lacunarity": r"lacunarity $\Lambda$",
    "fractal_dimension": r"fractal dimension $\Delta$",
    "hydraulic_aperture": "hydraulic aperture",
    "mean_gap": "mean gap",
    "area": "island area",
    "variogram": "variogram",
    "second_variogram": "second variogram",
    "madogram": "madogram",
    "lag": "lag",
    "cube_size": "cube edge",
    "variation": "height variation",
    "power_spectral_density": "power spectral density",
    "profile_power_spectral_density": "profile spectral density",
    "cube_count": "number of cubes",
    "roughness": "rms roughness in a window",
    "covering_area": "area of the covering triangles",
    "covering_length": "length of the covering polygon",
}
PERCENT = frozenset({"contact_fraction", "corrected_contact_fraction", "open_fraction", "coverage"})


def units_of(data: xr.DataArray) -> str:
    """Return the units of a variable: its own attribute, else those of its name in the schema."""
    units = data.attrs.get("units")
    quantity = QUANTITIES.get(str(data.name))
    if units is None:
        units = (quantity.units or "") if quantity else ""
    return str(units)


def scale_of(data: xr.DataArray) -> Scale:
    """Return the scale that suits the largest value of a variable."""
    if str(data.name) in PERCENT:
        return Scale(0.01, "%")
    return scale_for(units_of(data), data.values)


def name_of(data: xr.DataArray) -> str:
    """Return the name of a variable on axes and in legends."""
    name = str(data.name)
    quantity = QUANTITIES.get(name)
    long_name = data.attrs.get("long_name") or (quantity.long_name if quantity else name)
    return SHORT.get(name, str(long_name))


def axis_label(data: xr.DataArray, scale: Scale) -> str:
    """Return the label of an axis that shows `data` at `scale`."""
    return scale.label(name_of(data))
