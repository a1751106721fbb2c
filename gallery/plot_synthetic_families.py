"""
Four ways to make up a rough surface
====================================

All four are asked for the same Hurst exponent, 0.7. Their variograms show what they are: only the
fractional Brownian surface obeys its power law at every lag. The others are made for other ends: a
spectral surface is periodic, midpoint displacement is quick, Weierstrass surfaces are smooth sums of
few waves.
"""

from matplotlib.figure import Figure

import fractalcontact as fc

N, SPACING, HURST = 256, 1e-5, 0.7

faces = {
    "fbm": fc.surfaces.fbm((N, N), SPACING, hurst=HURST, rms_increment=1e-6, rng=1),
    "spectral": fc.surfaces.spectral((N, N), SPACING, hurst=HURST, rms_height=2e-5, rng=1),
    "midpoint": fc.surfaces.midpoint((N + 1, N + 1), SPACING, hurst=HURST, rms_increment=1e-6, rng=1),
    "weierstrass": fc.surfaces.weierstrass((N, N), SPACING, hurst=HURST, rms_height=2e-5, rng=1),
}
print(faces["fbm"])

# %%
# Side by side.

reliefs = Figure(figsize=(9.2, 7.4), layout="constrained")
for ax, (name, face) in zip(reliefs.subplots(2, 2).ravel(), faces.items(), strict=True):
    fc.plotting.face(face, title=name, ax=ax)

# %%
# Their variograms, and the local slope, which for a self-affine surface is twice the Hurst exponent:
# 1.4.

curves = {name: fc.dimensions.variogram(face) for name, face in faces.items()}
print(curves["fbm"])
variograms = fc.plotting.dimension_curves(curves)
