"""Names on axes and the scale of a variable; the SI prefixes are those of `base.units`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
import xarray as xr

from fractalcontact.base.schema import QUANTITIES
from fractalcontact.base.units import Scale, named_scale, scale_for
from fractalcontact.base.validation import Problems

Units: TypeAlias = Mapping[str, str]  # by the name of a variable
WANTED = "display_units"  # attribute of a variable whose unit in a figure was chosen

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
PLAIN = Scale(1.0, "")  # of a number without a unit
PER_CENT = Scale(0.01, "%")
PERCENT = frozenset({"contact_fraction", "corrected_contact_fraction", "open_fraction", "coverage"})


def units_of(data: xr.DataArray) -> str:
    """Return the units of a variable: its own attribute, else those of its name in the schema."""
    units = data.attrs.get("units")
    quantity = QUANTITIES.get(str(data.name))
    if units is None:
        units = (quantity.units or "") if quantity else ""
    return str(units)


def check_units(problems: Problems, name: str, units: Any) -> None:
    """Check that units are given by the names of variables."""
    are_words = isinstance(units, Mapping) and all(
        isinstance(word, str) for pair in units.items() for word in pair
    )
    problems.require(units is None or are_words, name, "a dict of variable and unit", units)


def shown_in(data: Any, units: Units | None, where: str) -> Any:
    """Return a result whose variables have the units that a figure is to show them in as an attribute.

    The units have been checked by `check_units`.
    """
    if units is None:
        return data
    if isinstance(data, xr.DataTree):
        parts = [node.to_dataset() for node in data.subtree]
    else:
        parts = list(data.values()) if isinstance(data, Mapping) and not hasattr(data, "dims") else [data]
    variables = {
        name: _variable(part, name) for part in parts if hasattr(part, "coords") for name in _names(part)
    }
    with Problems(f"fc.plotting.{where}") as problems:
        for name, unit in units.items():
            place = f"units[{name!r}]"
            if problems.require(name in variables, place, f"one of {', '.join(sorted(variables))}", name):
                own = units_of(variables[name])
                possible = named_scale(own, unit) is not None
                problems.require(possible, place, f"{own or '1'}, with a prefix", unit)
    if isinstance(data, xr.DataTree):
        return data.map_over_datasets(lambda dataset: _marked(dataset, units))
    if isinstance(data, Mapping) and not hasattr(data, "dims"):
        return {key: _marked(part, units) for key, part in data.items()}
    return _marked(data, units)


def _names(data: xr.Dataset | xr.DataArray) -> list[str]:
    """Return the names of the variables of a Dataset, or of a DataArray and its coordinates."""
    own = (
        ["height" if data.name is None else data.name]
        if isinstance(data, xr.DataArray)
        else list(data.data_vars)
    )
    return [str(name) for name in (*own, *data.coords)]


def _variable(data: Any, name: str) -> Any:
    """Return a variable by name; a DataArray itself has its own name."""
    return data if isinstance(data, xr.DataArray) and name not in data.coords else data[name]


def _marked(data: Any, units: Units) -> Any:
    if not hasattr(data, "coords"):  # the figure refuses it
        return data
    marked = data.copy(deep=False)
    for name in set(units) & set(_names(data)):
        _variable(marked, name).attrs[WANTED] = units[name]
    return marked


def scale_of(data: xr.DataArray, values: Any = None) -> Scale:
    """Return the scale of a variable: the one chosen, else that which suits its largest value.

    `values` are all that are shown on one axis, where that is more than the variable.
    """
    wanted = named_scale(units_of(data), str(data.attrs[WANTED])) if WANTED in data.attrs else None
    if wanted is not None:
        return wanted
    if str(data.name) in PERCENT:
        return PER_CENT
    return scale_for(units_of(data), np.asarray(data.values if values is None else values))


def label_axis(axis: Any, text: str, scale: Scale) -> None:
    """Label an axis; its unit can be read with `axis.get_units()`."""
    axis.set_label_text(scale.label(text))
    name = axis.axis_name
    shared = axis.axes.get_shared_x_axes() if name == "x" else axis.axes.get_shared_y_axes()
    for ax in shared.get_siblings(axis.axes):
        sibling = ax.xaxis if name == "x" else ax.yaxis
        sibling.units = scale.unit  # `set_units` would leave bands and intervals out of view


def name_of(data: xr.DataArray) -> str:
    """Return the name of a variable on axes and in legends."""
    name = str(data.name)
    quantity = QUANTITIES.get(name)
    long_name = data.attrs.get("long_name") or (quantity.long_name if quantity else name)
    return SHORT.get(name, str(long_name))
