"""From the `units` of a result to what stands on an axis: a prefix that suits the numbers, a short label."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.schema import QUANTITIES

if TYPE_CHECKING:
    import xarray as xr

Array = np.ndarray[Any, np.dtype[Any]]

PREFIXES = {12: "T", 9: "G", 6: "M", 3: "k", 0: "", -3: "m", -6: "µ", -9: "n", -12: "p"}
SMALLEST = 0.5  # the largest number on an axis is at least this many of the shown units
PREFIXED = re.compile(r"^(m|N|Pa|J|s|m2|m3)$")
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")

# what a figure calls a quantity, where the long name of the schema is too long for an axis
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
    "friction_angle": "friction angle",
    "dilatancy_angle": "dilatancy angle",
    "shear_strength": r"shear strength $\tau$",
    "box_dimension": r"box dimension $\Delta_\sigma$",
    "lacunarity": r"lacunarity $\Lambda$",
    "fractal_dimension": r"fractal dimension $\Delta$",
    "hydraulic_aperture": "hydraulic aperture",
    "mean_gap": "mean gap",
    "area": "area of the island",
    "variogram": "variogram",
    "second_variogram": "second variogram",
    "madogram": "madogram",
    "lag": "lag",
    "cube_size": "edge of the cubes",
    "variation": "height variation",
    "power_spectral_density": "spectral density",
    "profile_power_spectral_density": "profile density",
    "cube_count": "number of cubes",
    "roughness": "rms height in a window",
    "covering_area": "area of the triangles",
    "covering_length": "length of the polygon",
}
PERCENT = frozenset({"contact_fraction", "corrected_contact_fraction", "open_fraction", "coverage"})


@dataclass(frozen=True)
class Scale:
    """Shown number = value / factor, in `unit`."""

    factor: float
    unit: str

    def __call__(self, values: Any) -> Array:
        """Return the numbers to show."""
        return np.asarray(values, dtype=np.float64) / self.factor

    def label(self, text: str) -> str:
        """Return `text` with the unit after it."""
        return f"{text} ({self.unit})" if self.unit else text


def units_of(data: xr.DataArray) -> str:
    """Return the units of a variable: its own, or those that its name has in the schema."""
    given = data.attrs.get("units")
    quantity = QUANTITIES.get(str(data.name))
    return str(given if given is not None else (quantity.units or "") if quantity else "")


def scale_of(data: xr.DataArray) -> Scale:
    """Return the scale that suits the largest number of a variable."""
    if str(data.name) in PERCENT:
        return Scale(0.01, "%")
    return scale_for(units_of(data), data.values)


def scale_for(units: str, values: Any) -> Scale:
    """Return the scale for `units` and the numbers to be shown; prefixes only where they are customary."""
    if units in ("", "1"):
        return Scale(1.0, "")
    if units == "degree":
        return Scale(1.0, "°")
    if not PREFIXED.match(units):
        return Scale(1.0, pretty(units))
    power = int(units[-1]) if units[-1].isdigit() else 1
    largest = _largest(values)
    if largest == 0:
        return Scale(1.0, pretty(units))
    fitting = [e for e in PREFIXES if largest >= SMALLEST * 10.0 ** (e * power)]
    exponent = max(fitting) if fitting else min(PREFIXES)
    if units == "s":
        exponent = min(exponent, 0)
    return Scale(10.0 ** (exponent * power), PREFIXES[exponent] + pretty(units))


def pretty(units: str) -> str:
    """Return UDUNITS text with raised exponents: `Pa m-1` becomes `Pa m⁻¹`."""
    return re.sub(r"(?<=[A-Za-z])(-?\d+)", lambda found: found.group().translate(SUPERSCRIPT), units)


def name_of(data: xr.DataArray) -> str:
    """Return what a figure calls a variable."""
    name = str(data.name)
    quantity = QUANTITIES.get(name)
    long_name = data.attrs.get("long_name") or (quantity.long_name if quantity else name)
    return SHORT.get(name, str(long_name))


def axis_label(data: xr.DataArray, scale: Scale) -> str:
    """Return the label of an axis that shows `data` at `scale`."""
    return scale.label(name_of(data))


def amount(value: float, units: str, digits: int = 3) -> str:
    """Return one number with its unit, `30 kN` for example."""
    scale = scale_for(units, value)
    return f"{value / scale.factor:.{digits}g} {scale.unit}".rstrip()


def _largest(values: Any) -> float:
    size = np.abs(np.asarray(values, dtype=np.float64))
    size = size[np.isfinite(size)]
    return float(size.max()) if size.size else 0.0
