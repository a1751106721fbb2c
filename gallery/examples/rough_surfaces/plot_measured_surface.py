"""
From a measured file to the fractal dimension
=============================================

If the environment variable ``FRACTALCONTACT_DATA`` names a folder with the file, this example reads a
scanned surface of gneiss (65 x 65 mm, spacing 0.3 mm; Cunha and others, 2024). Otherwise it takes the
land surface that matplotlib installs.
"""

import os
from pathlib import Path

import fractalcontact as fc

gneiss = Path(os.environ.get("FRACTALCONTACT_DATA", "nowhere"), "freiberg_gneiss_side_a.npy")
if gneiss.is_file():
    surface = fc.surfaces.read(gneiss, spacing=3e-4, units="m")
    print("gneiss surface with", int(surface.isnull().sum()), "missing points")
else:
    surface = fc.surfaces.sample("jacksboro_fault_dem")
    print("FRACTALCONTACT_DATA is not set: land surface around the Jacksboro fault")

surface = fc.surfaces.level(fc.surfaces.fill(surface))
print(fc.surfaces.describe(surface))
relief = fc.plotting.surface(surface)

# %%
# The scaling curves with the fitted slopes.

curves = {
    "spectrum": fc.dimensions.spectrum(surface),
    "variogram": fc.dimensions.variogram(surface),
    "cube_counts": fc.dimensions.cube_counts(surface),
}
estimates = fc.dimensions.estimate(surface, ["default", *curves])
print(estimates)
scaling = fc.plotting.plot(curves, estimates=estimates)

# %%
# The dimensions with their intervals. They need not agree: the methods use different windows of scales,
# and a real surface is self-affine within a part of its scales at best.

dimensions = fc.plotting.dimensions(estimates)
