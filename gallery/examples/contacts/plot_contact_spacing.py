"""
Discretisation error of a contact
=================================

The error of a contact solution due to the grid decreases with the spacing s. The order depends on the
edge of the contact: it is 2 where the pressure goes to zero at the edge, and 1 where the pressure is
singular there, as under a flat punch, or where the circular plates have a radius other than that of
second order. This example compares solutions with closed forms.
"""

import warnings

import numpy as np
import xarray as xr
from matplotlib import pyplot as plt

import fractalcontact as fc

FREE = {
    "disc, second order": {},
    "disc, inscribed": {"disc_radius": "inscribed"},
    "disc, equal area": {"disc_radius": "equal_area"},
    "square": {"influence": "square"},
}
RADII = np.array([5, 10, 20, 40])  # of the contact, in spacings
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")  # distinguishable with any colour vision
POSITIONS = 6  # random positions of the centre between the grid points


def press(heights, periodic=False, **options):
    """Press heights on a grid of spacing 1 with a contact modulus of 1."""
    surface = fc.surfaces.from_array(heights, 1.0, periodic=periodic)
    with warnings.catch_warnings():  # a linear problem in units of its own: its slopes mean nothing
        warnings.filterwarnings("ignore", message=".*rms slope")
        return fc.contact.press(surface, contact_modulus=1.0, tolerance=1e-10, keep=(), **options)


def sphere(y, x, radius, **options):
    """Force 4/3 sqrt(R) d^1.5 and area pi R d (Hertz 1882)."""
    curvature = 100.0 * radius
    heights, depth = -(x**2 + y**2) / (2 * curvature), radius**2 / curvature
    result = press(heights, closure=depth + heights.max(), **options)
    cells = heights.size / (np.pi * radius**2)
    return {
        "sphere: force": float(result["normal_force"][0]) / (4 / 3 * curvature**0.5 * depth**1.5) - 1,
        "sphere: area": float(result["contact_fraction"][0]) * cells - 1,
        "sphere: corrected area": float(result["corrected_contact_fraction"][0]) * cells - 1,
    }


def cone(y, x, radius, **options):
    """Force pi a^2 slope/2 at the closure pi a slope/2 (Sneddon 1965)."""
    heights = -0.1 * np.hypot(x, y)
    result = press(heights, closure=np.pi * radius * 0.05 + heights.max(), **options)
    return {"cone: force": float(result["normal_force"][0]) / (np.pi * radius**2 * 0.05) - 1}


def round_punch(y, x, radius, **options):
    """Force 2 a d (Boussinesq 1885)."""
    result = press(np.where(np.hypot(x, y) <= radius, 1.0, 0.0), closure=1e-3, **options)
    return {"round punch: force": float(result["normal_force"][0]) / (2e-3 * radius) - 1}


def square_punch(_y, _x, radius, **options):
    """Force 1.15230 L d, from the capacitance of a square plate (Read 1997)."""
    n = 2 * int(radius)
    stiffness = fc.contact.flat_stiffness((n, n), 1.0, contact_modulus=1.0, **options)
    return {"square punch: force": stiffness / (1.15230 * n) - 1}


def wave(y, x, radius):
    """Area and mean gap at a fraction of the pressure of full contact (Westergaard 1939)."""
    n, fraction = 2 * int(radius), 0.3 + 0.4 * (y[0, 0] % 1)
    heights = np.cos(2 * np.pi * (np.arange(n) + x[0, 0]) / n) * np.ones((4, 1))
    result = press(heights, periodic=True, nominal_pressure=fraction * np.pi / n)
    half = np.arcsin(np.sqrt(fraction))
    gap = np.cos(half) ** 2 + 2 * fraction * np.log(np.sin(half))
    return {
        "wave: area": float(result["contact_fraction"][0]) - 2 * half / np.pi,
        "wave: mean gap": float(result["mean_gap"][0]) - gap,
    }


def crossed_waves(y, x, radius):
    """Mean gap 0.38475 at a tenth of the pressure of full contact (limit of fine grids)."""
    n = 2 * int(radius)
    along, across = (np.cos(2 * np.pi * (np.arange(n) + start) / n) for start in (x[0, 0], y[0, 0]))
    pressure = 0.1 * np.sqrt(2) * np.pi / n
    result = press(across[:, None] * along, periodic=True, nominal_pressure=pressure)
    return {"crossed waves: mean gap": float(result["mean_gap"][0]) - 0.384749}


def rms_errors(problem, influence, options):
    """Root mean square error over random positions of the centre, for every radius."""
    rng, rows = np.random.default_rng(1), []
    for radius in RADII:
        n, errors = int(2.5 * radius) + 3, []
        for _ in range(POSITIONS):
            start = rng.uniform(-0.5, 0.5, 2) - n / 2
            y, x = np.arange(n)[:, None] + start[0], np.arange(n)[None, :] + start[1]
            errors.append(problem(y, x, radius * rng.uniform(1.0, 1.05), **options))
        rows.append({name: np.sqrt(np.mean([e[name] ** 2 for e in errors])) for name in errors[0]})
    variables = {name: (("influence", "radius"), [[row[name] for row in rows]]) for name in rows[0]}
    return xr.Dataset(variables, {"influence": [influence], "radius": RADII})


parts = [rms_errors(problem, "spectral", {}) for problem in (wave, crossed_waves)]
for influence, options in FREE.items():
    parts += [
        rms_errors(problem, influence, options) for problem in (sphere, cone, round_punch, square_punch)
    ]
error = xr.merge(parts, join="outer", compat="no_conflicts")
print(error)

# %%
# The orders are the slopes of the curves; grey lines have the slopes 1 (dotted) and 2 (dashed). The raw
# contact area is too large by a part of its perimeter, and this error decreases in proportion to the
# spacing; the corrected area has a third of it. The area of a wave changes by whole rows of grid points.

order = -np.log(error).assign_coords(radius=np.log(RADII)).polyfit("radius", 1).sel(degree=1, drop=True)
order = order.rename({name: name.removesuffix("_polyfit_coefficients") for name in order})
print(order.to_dataframe().T.round(2).to_string())

figure = plt.figure(figsize=(8.4, 6.4), layout="constrained")
axes = figure.subplots(3, 3, sharex=True)
for ax, name in zip(axes.flat, error, strict=True):
    for number, influence in enumerate([*FREE, "spectral"]):
        if influence in error["influence"] and error[name].sel(influence=influence).notnull().all():
            ax.loglog(
                RADII, error[name].sel(influence=influence), "o-", ms=3, c=COLOURS[number], label=influence
            )
    largest = float(error[name].max())
    for slope, style in ((1, ":"), (2, "--")):
        ax.loglog(RADII, largest * (RADII[0] / RADII) ** slope, style, c="0.6", lw=0.9)
    ax.set_title(name, fontsize="medium")
    ax.spines[["top", "right"]].set_visible(False)
for ax in axes[-1]:
    ax.set_xticks(RADII, [str(radius) for radius in RADII])
    ax.minorticks_off()
axes[-1, 1].set_xlabel("radius or half wavelength / spacing")
for ax in axes[:, 0]:
    ax.set_ylabel("error")
handles = {
    label: handle for ax in axes.flat for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)
}
figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=5, frameon=False)
