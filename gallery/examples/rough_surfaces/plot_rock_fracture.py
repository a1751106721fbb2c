"""
The exponent of a rock fracture, beside published ones
======================================================

Fracture and fault surfaces of rock are self-affine over many scales. Scanned with lidar, a laser profilometer
and an interferometer, five exhumed faults have the exponent 0.58 ± 0.07 along the direction of slip and
0.81 ± 0.04 across it (Candela and others, 2012, *Roughness of fault surfaces over nine decades of length
scales*, Journal of Geophysical Research, doi:10.1029/2011JB009041). The dimension 3 - H is then 2.42 and
2.19.

This example measures a natural fracture in gneiss (Cunha and others, 2024), a file of the folder that the
environment variable ``FRACTALCONTACT_DATA`` names; the page :doc:`/measured_surfaces` has its address,
licence and checksum. No published dimension of this fracture itself was found: the comparison is with other
rocks. Without the file a synthetic surface of H = 0.81 stands in for it.
"""

import os
from pathlib import Path

import matplotlib.pyplot as plt

import fractalcontact as fc

name = "freiberg_gneiss_side_a"
if Path(os.environ.get("FRACTALCONTACT_DATA", "nowhere"), f"{name}.npy").is_file():
    fracture = fc.surfaces.sample(name)
    print(f"gneiss, {int(fracture.isnull().sum())} of {fracture.size} points missing")
else:
    fracture = fc.surfaces.fbm((217, 217), 3e-4, hurst=0.81, rms_increment=1.2e-4, rng=1)
    print("no file of the gneiss: a synthetic stand-in of H = 0.81, which is no measurement")
print(fracture)

# %%
# The default estimate. The points were interpolated linearly on the grid, which changes the shortest waves:
# the exponent changes with scale, the interval is wide, and the note says why.

result = fc.dimensions.estimate(fracture).sel({"method": "default"})
low, high = float(result.ci_low), float(result.ci_high)
print(f"H = {float(result.hurst):.2f}, 95 % interval {low:.2f} to {high:.2f}")
print(f"dimension {float(result.fractal_dimension):.2f}")
print(result.note.item() or "no remark")

# %%
# Left, the exponent by octave of wavelength; blue is the estimate, over the waves that its model describes.
# Right, the exponent by direction; the grey bands are the published ones, of other rocks.

figure, (left, right) = plt.subplots(1, 2, figsize=(8.5, 3.4), layout="constrained")
fc.plotting.scaling(fc.dimensions.scaling(fc.surfaces.fill(fracture)), ax=left)
by_direction = fc.dimensions.directions(fracture, scales=(2.4e-3, 2e-2))
right.errorbar(
    by_direction.azimuth,
    by_direction.fitted_hurst,
    1.96 * by_direction.standard_error,
    fmt="o",
    color="tab:blue",
    capsize=3,
)
for centre, half_width, color, label in (
    (0.81, 0.04, "0.8", "faults, across slip"),
    (0.58, 0.07, "0.9", "faults, along slip"),
):
    right.axhspan(centre - half_width, centre + half_width, color=color, label=label)
right.set(xlabel="azimuth (degree)", ylabel="Hurst exponent", ylim=(0.0, 1.1))
right.legend(loc="lower right")
