"""
How contact domains evolve with shear, at three grids
=====================================================

One crack, whose shortest waves are resolved, is pressed at three shear displacements on three grids. Four
findings: a dimension without its window says nothing about shear; one window in metres does not depend on the
grid; most of a dimension is the coverage, size and number of the spots; and a measure between length and area
remains where the area shrinks with the resolution.
"""

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr

import fractalcontact as fc

EXTENT, FINEST, GRIDS = 20e-3, 512, (128, 256, 512)
SHEARS = [0.16e-3, 0.8e-3, 8e-3]
PRESSURE = 25e6


def press(shortest, n, shears, nominal_pressure):
    """Press a crack whose face is resolved down to `shortest`, sampled at n x n of the finest points."""
    face = fc.surfaces.spectral(
        (FINEST, FINEST),
        EXTENT / FINEST,
        hurst=0.8,
        rms_slope=0.1,
        rolloff=6e-3,
        short_cutoff=shortest,
        rng=1,
    )
    every = FINEST // n
    lower = fc.surfaces.from_array(face.values[::every, ::every], EXTENT / n, periodic=True)
    crack = fc.joints.Crack(lower, young=30e9, poisson=0.2)
    delta = fc.joints.delta_surface(crack, shears)
    pressed = fc.contact.press(
        delta, contact_modulus=crack.contact_modulus, nominal_pressure=nominal_pressure, tolerance=1e-6
    )
    return pressed["state"]


states = {n: press(0.625e-3, n, SHEARS, PRESSURE).isel(step=0) for n in GRIDS}
finest = states[FINEST]
print(finest)

# %%
# **A dimension needs its window.** Over boxes of 0.1 to 0.6 mm the dimension of the contact domain rises with
# shear, over boxes of 0.6 to 2.5 mm it falls, and over longer ones all boxes meet the set at the smallest
# shear: the dimension is 2 then, whatever the set is. None of the three trends is that of the domain.

windows = {
    "0.1 to 0.6 mm": (0.1e-3, 0.6e-3),
    "0.6 to 2.5 mm": (0.6e-3, 2.5e-3),
    "2.5 to 10 mm": (2.5e-3, 10e-3),
}
for words, window in windows.items():
    boxes = fc.domains.box_dimension(finest, window=window, cover="mean")
    print(f"D over {words} at the three shears:", boxes["box_dimension"].values.round(2))

# %%
# **One window in metres does not depend on the grid.** The signature fits all states over the same lengths,
# and says which states have no dimension there, and why.

WINDOW = (0.6e-3, 2.4e-3)
signatures = {n: fc.domains.signature(states[n], window=WINDOW) for n in GRIDS}
for n, signature in signatures.items():
    each = fc.domains.box_dimension(states[n], window="each")["box_dimension"]
    print(f"{n} cells: a window for each set {each.values.round(2)}, one window in metres", end=" ")
    print(
        signature["domain_dimension"].values.round(2),
        "gap (mm)",
        (1e3 * signature["gap_size"].values).round(2),
    )
signature = signatures[FINEST]
print(signature["reason"].values)

# %%
# The local slopes d(s) of the three states at each grid (thin: 128 cells; thick: 512): they coincide above
# a few cells. Dashed: random spots of equal area, perimeter and number.

figure, (left, right) = plt.subplots(1, 2, figsize=(7.6, 3.2), layout="constrained")
for n, result in signatures.items():
    for k, shear in enumerate(SHEARS):
        label = f"{1e3 * shear:g} mm" if n == FINEST else None
        side = 1e3 * result["side"]
        left.semilogx(side, result["local_slope"][k], f"C{k}", lw=n / 256, label=label)
spots = 2 - np.gradient(np.log(signature["spots_fraction"]), np.log(signature["side"]), axis=-1)
for k in range(len(SHEARS)):
    left.semilogx(1e3 * signature["side"], spots[k], f"C{k}--", lw=0.8)
left.axvspan(1e3 * WINDOW[0], 1e3 * WINDOW[1], color="0.92")
left.set(xlabel="side of the square (mm)", ylabel="local dimension d(s)", ylim=(0.5, 2.05))
left.legend(title="shear", frameon=False)

# %%
# **Shear clusters the contacts.** The dimension follows that of random spots (dashed above). What remains is
# the clustering: squares that random spots would meet, over those that the contacts meet. It is 1 for spots
# at random, and grows with shear, as the delta-surface gains long waves; the 95 % interval says how far one
# surface tells. At a small shear the contacts form chains across the slide: boxes along it then have the
# lower lacunarity. The ratio grows to 1 with shear.

for name in ("clustering", "lacunarity_ratio"):
    low, high = signature[f"{name}_low"][:, -1], signature[f"{name}_high"][:, -1]
    rows = zip(signature[name].values[:, -1], low.values, high.values, strict=True)
    print(name, "at the longest scale:", *(f"{value:.2f} ({a:.2f} to {b:.2f})" for value, a, b in rows))

# %%
# **A measure that remains.** A face with waves down to the grid is resolved nowhere: each finer grid has a
# smaller area of contact. The Hausdorff content, the cheapest cover by squares at the price of side^s, does
# not change at the exponent s between the two limits of the dimension of the domain.

rough = [press(None, n, SHEARS[2:], PRESSURE).isel(shear=0, step=0) for n in GRIDS]
bracket = fc.domains.area_dimension(rough)
s = float(bracket["stationary_exponent"])
contents = [float(fc.domains.hausdorff_content(state, s, shifts=4)["relative_content"]) for state in rough]
area = bracket["contact_fraction"].values[::-1]
print("share of the area in contact:", area.round(4))
print(f"Hausdorff content at s = {s:.2f}:", np.round(contents, 3))
print(f"dimension of the domain between {s:.2f} and {float(bracket['area_dimension']):.2f}")

table = xr.DataArray([area / area[0], np.array(contents) / contents[0]], dims=("measure", "cells"))
for values, label in zip(table, ("area", f"content, s = {s:.2f}"), strict=True):
    right.semilogx(GRIDS, values, "o-", base=2, label=label)
right.set(xlabel="cells along a side", ylabel="over that of the coarsest grid", ylim=(0, 1.15))
right.legend(frameon=False)
plt.show()
