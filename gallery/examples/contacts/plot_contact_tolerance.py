"""
Iteration error of a contact
============================

The reported residual bounds the square of the error of the pressure in the energy norm. This example
compares solutions at growing tolerance with a solution at the smallest tolerance.
"""

import numpy as np
import xarray as xr
from matplotlib import pyplot as plt

import fractalcontact as fc

rough = fc.surfaces.spectral((96, 96), 1e-4, hurst=0.8, rms_slope=0.1, short_cutoff=8e-4, rng=3)
cases = {
    "periodic, light load": (rough, 0.002),
    "periodic, nearly full contact": (rough, 0.15),
    "free": (fc.surfaces.from_array(rough.values, 1e-4), 0.02),
    "free, quantised heights": (fc.surfaces.from_array(np.round(rough.values, 6), 1e-4), 0.02),
}
tolerances = 10.0 ** -np.arange(1, 11)
names = ("residual", "pressure_error", "area_error", "closure_error")
shape = (len(cases), tolerances.size)
errors = xr.Dataset(
    {name: (("case", "tolerance"), np.zeros(shape)) for name in names},
    {"case": list(cases), "tolerance": tolerances},
)
for case, (surface, pressure) in cases.items():
    load = {"contact_modulus": 1.0, "nominal_pressure": pressure, "keep": ("pressure",)}
    exact = fc.contact.press(surface, tolerance=1e-12, **load)
    for tolerance in tolerances:
        result, point = (
            fc.contact.press(surface, tolerance=tolerance, **load),
            {"case": case, "tolerance": tolerance},
        )
        difference = {name: abs(result[name] - exact[name])[0] for name in ("contact_fraction", "closure")}
        square = ((result["pressure"] - exact["pressure"]) ** 2).sum() / (exact["pressure"] ** 2).sum()
        errors["residual"].loc[point] = result["residual"][0]
        errors["pressure_error"].loc[point] = np.sqrt(square)
        errors["area_error"].loc[point] = difference["contact_fraction"] / exact["contact_fraction"][0]
        errors["closure_error"].loc[point] = difference["closure"] / exact["closure"][0]
print(errors)

# %%
# The bound (dashed) is for the worst case. The relative rms error of the pressure is about the residual
# itself (dotted), that of the closure at a given force is smaller, and the contact area is exact long
# before the default tolerance of 1e-8.

figure = plt.figure(figsize=(8.4, 3.2), layout="constrained")
axes = figure.subplots(1, 3, sharex=True)
for ax, name in zip(axes, names[1:], strict=True):
    ax.set_prop_cycle(color=["#0072B2", "#D55E00", "#009E73", "#CC79A7"])  # for any colour vision
    for case in cases:
        curve = errors.sel(case=case)
        ax.loglog(curve["residual"], curve[name].where(curve[name] > 0), "o-", ms=3, label=case)
    line = np.array([1e-11, 1e-1])
    ax.loglog(line, np.sqrt(line), "--", c="0.6", lw=0.9)
    ax.loglog(line, line, ":", c="0.6", lw=0.9)
    ax.set_xlabel("residual")
    ax.set_title(name.replace("_", " "), fontsize="medium")
    ax.spines[["top", "right"]].set_visible(False)
figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
