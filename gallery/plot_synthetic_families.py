"""
Four ways to make up a rough surface
====================================

All four are asked for the same Hurst exponent, 0.7. What they give is told by their variograms: a
self-affine surface has the slope 2 H = 1.4 at every lag. Fractional Brownian surfaces are made to have
it exactly. The others are made for other ends: spectral surfaces are periodic and have cut-offs,
midpoint displacement is quick, Weierstrass surfaces are sums of few waves.
"""

from matplotlib.figure import Figure

import fractalcontact as fc

N, SPACING, HURST = 257, 1e-5, 0.7

families = {
    "fbm": fc.surfaces.fbm((N, N), SPACING, hurst=HURST, rms_increment=1e-6, rng=1),
    "spectral": fc.surfaces.spectral((N, N), SPACING, hurst=HURST, rms_height=2e-5, rng=1),
    "midpoint": fc.surfaces.midpoint((N, N), SPACING, hurst=HURST, rms_increment=1e-6, rng=1),
    "weierstrass": fc.surfaces.weierstrass((N, N), SPACING, hurst=HURST, rms_height=2e-5, rng=1),
}
print(families["fbm"])

reliefs = Figure(figsize=(9.2, 7.4), layout="constrained")
for ax, (name, face) in zip(reliefs.subplots(2, 2).ravel(), families.items(), strict=True):
    fc.plotting.surface(face, title=name, ax=ax)

# %%
# The variograms of single surfaces wander at lags beyond a tenth of the face, where few independent
# pairs are left. Means over a dozen surfaces of each family show what the generators do.

curves = {name: fc.dimensions.variogram(face, max_lag=N * SPACING / 3) for name, face in families.items()}
print(curves["fbm"])


def make(name, seed):
    """Return one more surface of a family."""
    size = {"rms_height": 2e-5} if name in ("spectral", "weierstrass") else {"rms_increment": 1e-6}
    return getattr(fc.surfaces, name)((N, N), SPACING, hurst=HURST, rng=seed, **size)


means = {
    name: sum(
        fc.dimensions.variogram(make(name, seed), max_lag=N * SPACING / 3).variogram for seed in range(12)
    )
    / 12
    for name in families
}

picture = Figure(figsize=(9.2, 3.6), layout="constrained")
left, right = picture.subplots(1, 2)
for name, mean in means.items():
    lag = mean.lag * 1e6
    left.loglog(lag, mean * 1e12, label=name)
    right.semilogx(lag, (mean / mean.lag ** (2 * HURST)) / (mean / mean.lag ** (2 * HURST))[0], label=name)
right.axhline(1, color="black", lw=0.9, ls=":")
left.set_ylabel("variogram (µm²)")
right.set_ylabel("variogram over lag$^{2H}$, first lag = 1")
for ax in (left, right):
    ax.set_xlabel("lag (µm)")
    ax.spines[["top", "right"]].set_visible(False)
right.legend(frameon=False, bbox_to_anchor=(1.0, 1.0), loc="upper left")
