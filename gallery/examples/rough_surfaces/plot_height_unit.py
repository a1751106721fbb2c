"""
Cube counting depends on the unit of height
===========================================

Cubes are as high as they are wide, so that cube counting compares heights with lengths. A surface with
very small heights fits into a single layer of cubes and counts as a plane; with large heights it counts
as rough. The option `vertical_scale` sets this ratio, and it belongs to the result. The variogram does
not depend on it.
"""

import numpy as np
from matplotlib import pyplot as plt

import fractalcontact as fc

HURST = 0.6
surface = fc.surfaces.fbm((512, 512), 1e-5, hurst=HURST, rms_increment=1e-6, rng=2)

scales = np.geomspace(0.1, 1000, 9)
counts = [fc.dimensions.cube_counts(surface, vertical_scale=float(scale)) for scale in scales]
print(counts[0])

# %%
# The dimension is the mean slope of the counts, here over all cube sizes. It rises from 2 as the heights
# are magnified, and then stays below the true value: the highest and lowest point of a column of cubes
# are missed if they lie between grid points.

slopes = [-np.polyfit(np.log(count.cube_size), np.log(count.cube_count), 1)[0] for count in counts]
estimates = fc.dimensions.estimate(surface, ["variogram", "cube_counts"])
variogram, cube_counts = (float(value) for value in estimates.fractal_dimension)
print(estimates)

figure = plt.figure(figsize=(6.4, 3.6), layout="constrained")
ax = figure.add_subplot()
ax.semilogx(scales, slopes, marker="o", label="cube counts, heights multiplied")
ax.axhline(cube_counts, color="C0", lw=0.9, ls="--", label="cube counts, height range = extent")
ax.axhline(variogram, color="C1", lw=1.4, label="variogram, any unit")
ax.axhline(3 - HURST, color="black", lw=0.9, ls=":", label="true")
ax.set_xlabel("factor on the heights")
ax.set_ylabel("fractal dimension")
ax.spines[["top", "right"]].set_visible(False)
ax.legend(frameon=False, bbox_to_anchor=(1.0, 1.0), loc="upper left")
