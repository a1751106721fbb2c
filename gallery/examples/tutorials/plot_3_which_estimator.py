"""
Which estimator of fractal dimension?
=====================================

The same surfaces, exact and spoilt as scans are, by several estimators. The truth is known, since the
surfaces are synthetic.
"""

import numpy as np
import xarray as xr
from matplotlib import pyplot as plt
from scipy.ndimage import gaussian_filter

import fractalcontact as fc

HURST = 0.7
METHODS = ["default", "increments", "spectrum", "variogram", "cube_counts", "roughness_length"]
exact = fc.surfaces.fbm((192, 192), 1e-4, hurst=HURST, rms_increment=1e-5, rng=2)
rng = np.random.default_rng(2)
surfaces = {
    "exact": exact,
    "white noise": exact + 3e-6 * rng.normal(size=exact.shape),
    "blur of 1.5 spacings": exact.copy(data=gaussian_filter(exact.values, 1.5)),
    "heights rounded": 1e-5 * (exact / 1e-5).round(),
    "trend": exact + 0.2 * exact.x,
}
print(exact)

# %%
# All have a dimension of 3 - 0.7 = 2.3.

for name, surface in surfaces.items():
    surfaces[name] = surface.rename("height").assign_attrs(units="m")
estimates = {name: fc.dimensions.estimate(surface, METHODS) for name, surface in surfaces.items()}
table = xr.concat([one.fractal_dimension for one in estimates.values()], "surface", coords="minimal")
print(table.assign_coords(surface=list(surfaces)).round(2).to_pandas().to_string())

# %%
# The default, ``likelihood``, models noise and blur where the heights show them, and is the only one with
# an interval. Straight lines through curves take noise for roughness (a higher dimension) and blur for
# smoothness (a lower one).

figure, panels = plt.subplots(1, 3, figsize=(11, 3.4), layout="constrained", sharex=True)
for ax, name in zip(panels, ["exact", "white noise", "blur of 1.5 spacings"], strict=True):
    fc.plotting.dimensions(estimates[name], truth=3 - HURST, ax=ax)
    ax.set_title(name)

# %%
# What the estimate found is said in the variable ``note``, for each method.

for name, one in estimates.items():
    first = one.isel(method=0)
    low, high = first.fractal_dimension_low, first.fractal_dimension_high
    print(f"{name}: {first.fractal_dimension:.2f} ({low:.2f} to {high:.2f})")
    print("   ", first.note.item() or "no remark")

# %%
# Take the default, unless a standard or a comparison with other work asks for a curve; then quote its
# window of scales as well. Bias, error and coverage of every method on your machine: ``fractalcontact
# accuracy estimators``.
