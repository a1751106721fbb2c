"""
Counting cubes depends on the unit of height
============================================

Cubes are as high as they are wide, so heights are compared with lengths. Drawn flat, a surface fits
into a single layer of cubes and counts as a plane; drawn high, it counts as rough. The choice is made
by `vertical_scale`, and it belongs to the result. The variogram of the same surface does not care.
"""

import numpy as np
from matplotlib.figure import Figure

import fractalcontact as fc

HURST = 0.6
face = fc.surfaces.fbm((512, 512), 1e-5, hurst=HURST, rms_increment=1e-6, rng=2)

scales = np.geomspace(0.1, 1000, 9)
counts = [fc.dimensions.cube_counts(face, vertical_scale=float(scale)) for scale in scales]
print(counts[0])

# %%
# The dimension is the mean slope of the counts, taken here over all sizes of the cubes alike. It rises
# from 2 with the height of the drawing, and then stays below the true value: the highest and the lowest
# point of a cube's column are missed where they lie between the points.

slopes = [-np.polyfit(np.log(one.cube_size), np.log(one.cube_count), 1)[0] for one in counts]
estimates = fc.dimensions.estimate(face, ["variogram", "cube_counts"])
variogram, by_range = (float(value) for value in estimates.fractal_dimension)
print(estimates)

picture = Figure(figsize=(6.4, 3.6), layout="constrained")
ax = picture.add_subplot()
ax.semilogx(scales, slopes, marker="o", label="cube counts, heights multiplied")
ax.axhline(by_range, color="C0", lw=0.9, ls="--", label="cube counts, height range = extent")
ax.axhline(variogram, color="C1", lw=1.4, label="variogram, whatever the unit")
ax.axhline(3 - HURST, color="black", lw=0.9, ls=":", label="true")
ax.set_xlabel("factor on the heights")
ax.set_ylabel("fractal dimension")
ax.spines[["top", "right"]].set_visible(False)
ax.legend(frameon=False, bbox_to_anchor=(1.0, 1.0), loc="upper left")
