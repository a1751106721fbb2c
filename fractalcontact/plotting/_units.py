"""Units and names on axes: the SI prefix that suits the values, and a short label."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.schema import QUANTITIES

Array = np.ndarray[Any, np.dtype[Any]]

PREFIXES = {12: "T", 9: "G", 6: "M", 3: "k", 0: "", -3: "m", -6: "µ", -9: "n", -12: "p"}
SMALLEST = 0.5  # the largest value on an axis is at least this many of the shown units
PREFIXED = re.compile(r"^(m|N|Pa|J|s|m2|m3)$")
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

# names on axes, where the long name of the schema is too long
SHORT = {
    "height": "height",
    "closure": "closure $w$",
    "interface_closure": r"interface closure $w_\mathrm{int}$",
    "normal_force": "normal force $F$",
    "nominal_pressure": "nominal pressure",
    "shear": "shear displacement $v$",
    "rigid_dilatancy": r"rigid dilatancy $\delta_\mathrm{r}$",
    "dilatancy": r"dilatancy $\delta$",
    "contact_fraction": "real contact area",
    "coverage": "coverage",
    "friction_angle": "friction angle",
    "dilatancy_angle": "dilatancy angle",
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


@dataclass(frozen=True)
class Scale:
    """A conversion for display: shown value = value / factor, in `unit`."""

    factor: float
    unit: str

    def __call__(self, values: Any) -> Array:
        """Return the values to show."""
        return np.asarray(values, dtype=np.float64) / self.factor

    def label(self, text: str) -> str:
        """Return `text` with the unit after it."""
        return f"{text} ({self.unit})" if self.unit else text


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


def scale_for(units: str, values: Any) -> Scale:
    """Return the scale for values in `units`; prefixes only for the units in `PREFIXED`."""
    if units in ("", "1"):
        return Scale(1.0, "")
    if units == "degree":
        return Scale(1.0, "°")
    if not PREFIXED.match(units):
        return Scale(1.0, raise_exponents(units))
    power = int(units[-1]) if units[-1].isdigit() else 1
    largest = _largest(values)
    if largest == 0:
        return Scale(1.0, raise_exponents(units))
    fitting = [e for e in PREFIXES if largest >= SMALLEST * 10.0 ** (e * power)]
    exponent = max(fitting) if fitting else min(PREFIXES)
    if units == "s":
        exponent = min(exponent, 0)
    return Scale(10.0 ** (exponent * power), PREFIXES[exponent] + raise_exponents(units))


def raise_exponents(units: str) -> str:
    """Return UDUNITS text with raised exponents: `Pa m-1` becomes `Pa m⁻¹`."""
    return re.sub(r"(?<=[A-Za-z])(-?\d+)", lambda match: match.group().translate(SUPERSCRIPT), units)


def name_of(data: xr.DataArray) -> str:
    """Return the name of a variable on axes and in legends."""
    name = str(data.name)
    quantity = QUANTITIES.get(name)
    long_name = data.attrs.get("long_name") or (quantity.long_name if quantity else name)
    return SHORT.get(name, str(long_name))


def axis_label(data: xr.DataArray, scale: Scale) -> str:
    """Return the label of an axis that shows `data` at `scale`."""
    return scale.label(name_of(data))


def quantity_text(value: float, units: str, digits: int = 3) -> str:
    """Return one value with its unit, for example `30 kN`."""
    scale = scale_for(units, value)
    return f"{value / scale.factor:.{digits}g} {scale.unit}".rstrip()


def _largest(values: Any) -> float:
    """Return the largest finite magnitude, 0 if there is none."""
    size = np.abs(np.asarray(values, dtype=np.float64))
    size = size[np.isfinite(size)]
    return float(size.max()) if size.size else 0.0
