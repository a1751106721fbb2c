"""Names on axes and the scale of a variable; the SI prefixes are those of `base.units`."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
import xarray as xr

from fractalcontact.base.numbers import Array
from fractalcontact.base.schema import QUANTITIES, is_in_cells
from fractalcontact.base.units import Scale, named_scale, number, scale_for
from fractalcontact.base.validation import Problems

Units: TypeAlias = Mapping[str, str]  # by the name of a variable
WANTED = "display_units"  # attribute of a variable whose unit in a figure was chosen

# names on axes, where that of the variable is not enough and the long name of the schema too long
SHORT = {
    "closure": "closure $w$",
    "interface_closure": r"interface closure $w_\mathrm{int}$",
    "normal_force": "normal force $F$",
    "shear": "shear displacement $v$",
    "tangential_force": "tangential force $Q$",
    "rigid_dilatancy": r"rigid dilatancy $\delta_\mathrm{r}$",
    "dilatancy": r"dilatancy $\delta$",
    "contact_fraction": "real contact area",
    "shear_stress": r"shear stress $\tau$",
    "normal_stress": r"normal stress $\sigma$",
    "shear_strength": r"shear strength $\tau$",
    "box_dimension": r"box dimension $\Delta_\sigma$",
    "lacunarity": r"lacunarity $\Lambda$",
    "fractal_dimension": "fractal dimension $D$",
    "area": "island area",
    "cube_size": "cube edge",
    "variation": "height variation",
    "profile_power_spectral_density": "profile spectral density",
    "cube_count": "number of cubes",
    "roughness": "rms roughness in a window",
    "covering_area": "area of the covering triangles",
    "covering_length": "length of the covering polygon",
    **dict.fromkeys(("contact_stiffness", "stiffness", "interface_stiffness"), "normal stiffness"),
}
# names that say it shorter than the long name of the schema
OWN_NAME = ("height", "nominal_pressure", "tangential_displacement", "coverage", "friction_angle",
            "dilatancy_angle", "shear_displacement", "hydraulic_aperture", "mean_gap", "variogram",
            "second_variogram", "madogram", "lag", "power_spectral_density", "spot_size", "gap_size",
            "pair_correlation_length")  # fmt: skip
SHORT |= {name: name.replace("_", " ") for name in OWN_NAME}
PLAIN = Scale(1.0, "")  # of a number without a unit
PER_CENT = Scale(0.01, "%")  # of a share
# shown in per cent
SHARES = ("contact_fraction", "corrected_contact_fraction", "open_fraction", "coverage")


def units_of(data: xr.DataArray) -> str:
    """Return the units of a variable: its own attribute, else those of its name in the schema."""
    units = data.attrs.get("units")
    quantity = QUANTITIES.get(str(data.name))
    if units is None:
        units = (quantity.units or "") if quantity else ""
    return "cells" if is_in_cells(data.attrs) else str(units)


def _are_units(value: Any) -> bool:
    pairs = value.items() if isinstance(value, Mapping) else [(None, None)]
    return all(isinstance(word, str) for pair in pairs for word in pair)


UNITS_EXPECTED = ("a dict of variable and unit", _are_units)


def shown_in(data: xr.Dataset, units: Units | None) -> xr.Dataset:
    """Return a result whose variables have the units that a figure is to show them in as an attribute."""
    if units is None:
        return data
    require_units([data], units)
    return marked(data, units)


def require_units(datasets: Iterable[xr.Dataset], units: Units) -> None:
    """Raise InvalidInput unless each unit is one of a variable of the datasets."""
    variables = {str(name): dataset[name] for dataset in datasets for name in dataset.variables}
    with Problems("fc.plotting") as problems:
        for name, unit in units.items():
            place = f"units[{name!r}]"
            if problems.require(name in variables, place, f"one of {', '.join(sorted(variables))}", name):
                own = units_of(variables[name])
                possible = named_scale(own, unit) is not None
                problems.require(possible, place, f"{own or '1'}, with a prefix", unit)


def marked(data: xr.Dataset, units: Units) -> xr.Dataset:
    """Return a copy of a dataset with the unit to show as an attribute of its variables."""
    data = data.copy(deep=False)
    for name in units.keys() & data.variables.keys():
        data[name].attrs[WANTED] = units[name]
    return data


def scale_of(data: xr.DataArray, values: Any = None) -> Scale:
    """Return the scale of a variable: the one chosen, else that which suits its largest value.

    `values` are all that are shown on one axis, where that is more than the variable.
    """
    wanted = named_scale(units_of(data), str(data.attrs[WANTED])) if WANTED in data.attrs else None
    if wanted is not None:
        return wanted
    if str(data.name) in SHARES:
        return PER_CENT
    return scale_for(units_of(data), np.asarray(data.values if values is None else values))


def number_texts(scale: Scale, values: Any, digits: int) -> list[str]:
    """Return the numbers that label curves; "-" for NaN."""
    shown = scale(np.atleast_1d(values)).tolist()
    return [number(value, digits) if np.isfinite(value) else "-" for value in shown]


def name_of(data: xr.DataArray) -> str:
    """Return the name of a variable on axes and in legends."""
    name = str(data.name)
    quantity = QUANTITIES.get(name)
    long_name = data.attrs.get("long_name") or (quantity.long_name if quantity else name)
    return SHORT.get(name, str(long_name))


@dataclass(frozen=True)
class Quantity:
    """Values (SI) to show on an axis, with the scale and the name that they have there.

    A label has `width` characters in a line: 44 of 9 points are 2.9 inches, the height of a panel in a row.
    """

    values: Array
    scale: Scale
    name: str
    width: int = 44

    @property
    def shown(self) -> Array:
        """The values as they are shown."""
        return self.scale(self.values)

    def label(self, axis: Any) -> None:
        """Label an axis; its unit can be read with `axis.get_units()`."""
        axis.set_label_text(textwrap.fill(self.scale.label(self.name), self.width))
        name = axis.axis_name
        shared = axis.axes.get_shared_x_axes() if name == "x" else axis.axes.get_shared_y_axes()
        for ax in shared.get_siblings(axis.axes):
            sibling = ax.xaxis if name == "x" else ax.yaxis
            sibling.units = self.scale.unit  # `set_units` would leave bands and intervals out of view
            sibling.factor = self.scale.factor


def label_axis(axis: Any, text: str, scale: Scale) -> None:
    """Label an axis with a name and a unit."""
    Quantity(np.empty(0), scale, text).label(axis)
