"""
How exact a contact is: spacing and tolerance
=============================================

Two errors make up that of a contact. That of the grid falls with the spacing s; how fast depends on the
influence coefficients and on the edge of the contact: with the square of s where the pressure goes to zero
at the edge, with s itself where it is singular there, as under a flat punch, or where the plates of the
paper have any radius but that of second order. That of the iteration is bounded by the tolerance. Here the
first is held against closed forms, and the second against solutions at the least tolerance there is.
"""

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

import fractalcontact as fc

FREE = {
    "disc, second order": {},
    "disc, inscribed": {"disc_radius": "inscribed"},
    "disc, equal area": {"disc_radius": "equal_area"},
    "square": {"influence": "square"},
}
RADII = np.array([5, 10, 20, 40])  # of the contact, in spacings
PLACES = 6  # of its centre between the nodes, at random


def press(heights, periodic=False, **options):
    """Press heights on a grid of spacing 1 against a modulus of 1."""
    face = fc.surfaces.from_array(heights, 1.0, periodic=periodic)
    return fc.contact.press(face, contact_modulus=1.0, tolerance=1e-10, keep=(), **options)


def ball(y, x, radius, **options):
    """Force 4/3 sqrt(R) d^1.5 and area pi R d (Hertz 1882)."""
    curvature = 100.0 * radius
    heights, depth = -(x**2 + y**2) / (2 * curvature), radius**2 / curvature
    found = press(heights, closure=depth + heights.max(), **options)
    cells = heights.size / (np.pi * radius**2)
    return {
        "ball: force": float(found["normal_force"][0]) / (4 / 3 * curvature**0.5 * depth**1.5) - 1,
        "ball: area": float(found["contact_fraction"][0]) * cells - 1,
        "ball: corrected area": float(found["corrected_contact_fraction"][0]) * cells - 1,
    }


def cone(y, x, radius, **options):
    """Force pi a^2 slope/2 under the closure pi a slope/2 (Sneddon 1965)."""
    heights = -0.1 * np.hypot(x, y)
    found = press(heights, closure=np.pi * radius * 0.05 + heights.max(), **options)
    return {"cone: force": float(found["normal_force"][0]) / (np.pi * radius**2 * 0.05) - 1}


def round_punch(y, x, radius, **options):
    """Force 2 a d (Boussinesq 1885)."""
    found = press(np.where(np.hypot(x, y) <= radius, 1.0, 0.0), closure=1e-3, **options)
    return {"round punch: force": float(found["normal_force"][0]) / (2e-3 * radius) - 1}


def square_punch(_y, _x, radius, **options):
    """Force 1.15230 L d, from the capacitance of a square plate (Read 1997)."""
    n = 2 * int(radius)
    stiffness = fc.contact.flat_stiffness((n, n), 1.0, contact_modulus=1.0, **options)
    return {"square punch: force": stiffness / (1.15230 * n) - 1}


def wave(y, x, radius):
    """Area and mean gap under a share of the pressure that would flatten the wave (Westergaard 1939)."""
    n, share = 2 * int(radius), 0.3 + 0.4 * (y[0, 0] % 1)
    heights = np.cos(2 * np.pi * (np.arange(n) + x[0, 0]) / n) * np.ones((4, 1))
    found = press(heights, periodic=True, nominal_pressure=share * np.pi / n)
    half = np.arcsin(np.sqrt(share))
    gap = np.cos(half) ** 2 + 2 * share * np.log(np.sin(half))
    return {
        "wave: area": float(found["contact_fraction"][0]) - 2 * half / np.pi,
        "wave: mean gap": float(found["mean_gap"][0]) - gap,
    }


def crossed_waves(y, x, radius):
    """Mean gap 0.38475 under a tenth of the pressure that would flatten them (limit of fine grids)."""
    n = 2 * int(radius)
    along, across = (np.cos(2 * np.pi * (np.arange(n) + start) / n) for start in (x[0, 0], y[0, 0]))
    pressure = 0.1 * np.sqrt(2) * np.pi / n
    found = press(across[:, None] * along, periodic=True, nominal_pressure=pressure)
    return {"crossed waves: mean gap": float(found["mean_gap"][0]) - 0.384749}


def curves(problem, influence, options):
    """Root mean square of the errors over the places of the centre, for every radius."""
    rng, rows = np.random.default_rng(1), []
    for radius in RADII:
        n, errors = int(2.5 * radius) + 3, []
        for _ in range(PLACES):
            start = rng.uniform(-0.5, 0.5, 2) - n / 2
            y, x = np.arange(n)[:, None] + start[0], np.arange(n)[None, :] + start[1]
            errors.append(problem(y, x, radius * rng.uniform(1.0, 1.05), **options))
        rows.append({name: np.sqrt(np.mean([one[name] ** 2 for one in errors])) for name in errors[0]})
    coords = {"influence": [influence], "radius": RADII}
    one = {name: (("influence", "radius"), [[row[name] for row in rows]]) for name in rows[0]}
    return xr.Dataset(one, coords)


parts = [curves(problem, "spectral", {}) for problem in (wave, crossed_waves)]
for influence, options in FREE.items():
    parts += [curves(one, influence, options) for one in (ball, cone, round_punch, square_punch)]
error = xr.merge(parts, join="outer", compat="no_conflicts")
print(error)

# %%
# The orders are the slopes of the curves; dotted and dashed lines have slopes of 1 and 2. The raw area is too
# large by a part of its edge, and falls to the true one in proportion to the spacing; the area that is
# corrected for the perimeter has a third of that error. The area of a wave comes in whole rows of nodes.

order = -np.log(error).assign_coords(radius=np.log(RADII)).polyfit("radius", 1).sel(degree=1, drop=True)
order = order.rename({name: name.removesuffix("_polyfit_coefficients") for name in order})
print(order.to_dataframe().T.round(2).to_string())

picture = Figure(figsize=(8.4, 6.4), layout="constrained")
axes = picture.subplots(3, 3, sharex=True)
for ax, name in zip(axes.flat, error, strict=True):
    for number, influence in enumerate([*FREE, "spectral"]):
        if influence in error["influence"] and error[name].sel(influence=influence).notnull().all():
            ax.loglog(
                RADII, error[name].sel(influence=influence), "o-", ms=3, c=f"C{number}", label=influence
            )
    middle = float(error[name].max())
    for slope, style in ((1, ":"), (2, "--")):
        ax.loglog(RADII, middle * (RADII[0] / RADII) ** slope, style, c="0.6", lw=0.9)
    ax.set_title(name, fontsize="medium")
    ax.spines[["top", "right"]].set_visible(False)
for ax in axes[-1]:
    ax.set_xlabel("radius or half wave / spacing")
    ax.set_xticks(RADII, [str(radius) for radius in RADII])
    ax.minorticks_off()
for ax in axes[:, 0]:
    ax.set_ylabel("error")
handles = {
    label: handle for ax in axes.flat for handle, label in zip(*ax.get_legend_handles_labels(), strict=True)
}
picture.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=5, frameon=False)

# %%
# The residual that is reported bounds the square of the error of the pressure in the energy norm (dashed).
# That is for the worst case: the relative error of the pressure, root mean square over the nodes, is about
# the residual itself (dotted), that of the closure under a given force is smaller, and the contact area is
# right to the last node long before the tolerance of 1e-8.

rough = fc.surfaces.spectral((96, 96), 1e-4, hurst=0.8, rms_slope=0.1, short_cutoff=8e-4, rng=3)
faces = {
    "rough, periodic, light": (rough, 0.002),
    "rough, periodic, nearly full": (rough, 0.15),
    "rough, free": (fc.surfaces.from_array(rough.values, 1e-4), 0.02),
    "quantised, free": (fc.surfaces.from_array(np.round(rough.values, 6), 1e-4), 0.02),
}
tolerances = 10.0 ** -np.arange(1, 11)
stopped = xr.Dataset(coords={"face": list(faces), "tolerance": tolerances})
for name in ("residual", "pressure_error", "area_error", "closure_error"):
    stopped[name] = (("face", "tolerance"), np.zeros((len(faces), tolerances.size)))
for name, (face, pressure) in faces.items():
    load = {"contact_modulus": 1.0, "nominal_pressure": pressure, "keep": ("pressure",)}
    exact = fc.contact.press(face, tolerance=1e-12, **load)
    for tolerance in tolerances:
        found, place = (
            fc.contact.press(face, tolerance=tolerance, **load),
            {"face": name, "tolerance": tolerance},
        )
        stopped["residual"].loc[place] = found["residual"][0]
        missed = [abs(found[one] - exact[one]) for one in ("contact_fraction", "closure")]
        stopped["area_error"].loc[place] = missed[0][0] / exact["contact_fraction"][0]
        stopped["closure_error"].loc[place] = missed[1][0] / exact["closure"][0]
        square = ((found["pressure"] - exact["pressure"]) ** 2).sum() / (exact["pressure"] ** 2).sum()
        stopped["pressure_error"].loc[place] = np.sqrt(square)
print(stopped)

figure = Figure(figsize=(8.4, 3.2), layout="constrained")
places = figure.subplots(1, 3, sharex=True)
for ax, name in zip(places, ("pressure_error", "area_error", "closure_error"), strict=True):
    for face in faces:
        one = stopped.sel(face=face)
        ax.loglog(one["residual"], one[name].where(one[name] > 0), "o-", ms=3, label=face)
    line = np.array([1e-11, 1e-1])
    ax.loglog(line, np.sqrt(line), "--", c="0.6", lw=0.9)
    ax.loglog(line, line, ":", c="0.6", lw=0.9)
    ax.set_xlabel("residual")
    ax.set_title(name.replace("_", " "), fontsize="medium")
    ax.spines[["top", "right"]].set_visible(False)
figure.legend(*places[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
