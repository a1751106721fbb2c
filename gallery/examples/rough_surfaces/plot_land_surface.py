"""
The exponent of a land surface, beside published ones
=====================================================

From maps of heights of the state of Oregon, Huang and Turcotte (1990,
*Fractal image analysis: application to the topography of Oregon and synthetic images*, Journal of the Optical
Society of America A 7) report a mean dimension of 2.586 from spectra in two dimensions and of 1.487 from
spectra of profiles, thus exponents H of 0.414 and 0.513. Lovejoy and others (1995, *The l(1/2) law and
multifractal topography*, Nonlinear Processes in Geophysics 2, doi:10.5194/npg-2-16-1995) derive H = 1/2.

This example measures another piece of land, valleys and ridges at the Jacksboro fault in Tennessee, of
which no published dimension was found. The map, of the United States Geological Survey, is installed with
matplotlib: nothing is fetched.
"""

import matplotlib.pyplot as plt

import fractalcontact as fc

land = fc.surfaces.sample("jacksboro_fault_dem")
spacing = [float(land[axis][1] - land[axis][0]) for axis in ("y", "x")]
print(f"{land.sizes['y']} x {land.sizes['x']} heights, {spacing[0]:.0f} m x {spacing[1]:.0f} m apart")
print(land)

# %%
# No single exponent describes all wavelengths here; the default estimate takes the map for blurred, and gives
# the long waves an exponent of their own. The note says so.

result = fc.dimensions.estimate(land).sel({"method": "default"})
low, high = float(result.ci_low), float(result.ci_high)
print(f"H = {float(result.hurst):.2f}, 95 % interval {low:.2f} to {high:.2f}")
print(result.note.item())

# %%
# The exponent by octave of wavelength shows why: it falls from above 1 at the shortest waves, where the map
# is smooth, to about 0 beyond the width of ridges and valleys. The blue window is that of the estimate, whose
# exponent is that of the short waves. The published values are means over larger pieces of land; they lie
# between the exponents of the short and of the long waves here.

by_octave = fc.dimensions.scaling(land)
longest = (float(by_octave.scale_min), float(by_octave.scale_max))
print(f"estimate over {1e-3 * longest[0]:.1f} to {1e-3 * longest[1]:.0f} km:", end=" ")
print(f"H = {float(by_octave.window_hurst):.2f}", end=", ")
print(f"95 % interval {float(by_octave.window_ci_low):.2f} to {float(by_octave.window_ci_high):.2f}")
figure, axes = plt.subplots(figsize=(6.4, 3.6), layout="constrained")
fc.plotting.scaling(by_octave, ax=axes)
axes.axhspan(0.414, 0.513, color="tab:orange", alpha=0.6)
note = axes.text(0.02, 0.26, "Oregon (published)", transform=axes.get_yaxis_transform())
