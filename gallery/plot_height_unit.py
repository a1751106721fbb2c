"""
Counting cubes depends on the unit of height
============================================

Cubes have the same edge along the surface and across it, so the heights are compared with the lengths:
a surface drawn ten times higher has another count of cubes and another "dimension". The variogram of
the same surface does not move. This is a property of the method, not a fault of the surface.
"""

import numpy as np
from matplotlib.figure import Figure

import fractalcontact as fc

HURST = 0.7
face = fc.surfaces.fbm((256, 256), 1e-5, hurst=HURST, rms_increment=1e-5, rng=2)

found = {}
for times in (0.01, 0.1, 1.0, 10.0, 100.0):
    drawn = face * times
    drawn.attrs["units"] = "m"
    found[times] = fc.dimensions.estimate(drawn, ["variogram", "cube_counts"])
print(found[1.0])

# %%
# On a dimension of 2.3 the cube counts give anything from 2 to more, according to the height.

picture = Figure(figsize=(5.4, 3.6), layout="constrained")
ax = picture.add_subplot()
for row, (name, marker) in enumerate({"variogram": "o", "cube_counts": "s"}.items()):
    values = [float(one.fractal_dimension.isel(method=row)) for one in found.values()]
    ax.semilogx(list(found), values, marker=marker, label=name.replace("_", " "))
ax.axhline(3 - HURST, color="black", lw=0.8, ls=":", label="true")
ax.set_xlabel("heights multiplied by")
ax.set_ylabel("fractal dimension")
ax.legend(frameon=False)
print({times: np.round(one.fractal_dimension.values, 3) for times, one in found.items()})
