"""
A measured face, from its file to its dimension
===============================================

With the environment variable ``FRACTALCONTACT_DATA`` set to a folder that holds it, this example reads
a scanned face of gneiss (65 x 65 mm, 0.3 mm apart; Cunha and others, 2024). Without it, it takes the
land surface that matplotlib installs. It says which.
"""

import os
from pathlib import Path

import fractalcontact as fc

gneiss = Path(os.environ.get("FRACTALCONTACT_DATA", "nowhere"), "freiberg_gneiss_side_a.npy")
if gneiss.is_file():
    face = fc.surfaces.read(gneiss, spacing=3e-4, units="m")
    print("a face of gneiss, with", int(face.isnull().sum()), "points missing")
else:
    face = fc.surfaces.sample("jacksboro_fault_dem")
    print("no FRACTALCONTACT_DATA here: the land around the Jacksboro fault instead")

face = fc.surfaces.level(fc.surfaces.fill(face))
print(fc.surfaces.describe(face))
relief = fc.plotting.surface(face)

# %%
# The curves, before any fit.

curves = {
    "spectrum": fc.dimensions.spectrum(face),
    "variogram": fc.dimensions.variogram(face),
    "cube_counts": fc.dimensions.cube_counts(face),
}
estimates = fc.dimensions.estimate(face, ["default", *curves])
print(estimates)
scaling = fc.plotting.dimension_curves(curves, estimates)

# %%
# And the dimensions with their intervals. They need not agree: each method sees the same face through
# another window, and a real face is self-affine over a part of its scales at best.

dimensions = fc.plotting.dimensions(estimates)
