"""
Four families of synthetic surfaces
===================================

All four surfaces have the nominal Hurst exponent 0.7. Their variograms show what they have in common:
that of a self-affine surface has the slope 2 H = 1.4 at every lag. Fractional Brownian surfaces have it
exactly. Spectral surfaces are periodic and have cut-offs, midpoint displacement is fast, Weierstrass
surfaces are sums of few waves.
"""

import matplotlib.pyplot as plt

import fractalcontact as fc

N, SPACING, HURST = 257, 1e-5, 0.7
SIZE = {
    "fbm": {"rms_increment": 1e-6},
    "spectral": {"rms_height": 2e-5},
    "midpoint": {"rms_increment": 1e-6},
    "weierstrass": {"rms_height": 2e-5},
}


def generate(family, seed):
    """Return one surface of a family."""
    return getattr(fc.surfaces, family)((N, N), SPACING, hurst=HURST, rng=seed, **SIZE[family])


surfaces = {family: generate(family, 1) for family in SIZE}
print(surfaces["fbm"])

maps = plt.figure(figsize=(9.2, 7.4), layout="constrained")
for ax, (family, surface) in zip(maps.subplots(2, 2).ravel(), surfaces.items(), strict=True):
    fc.plotting.surface(surface, title=family, ax=ax)

# %%
# The variogram of a single surface fluctuates at lags above a tenth of its extent, where few independent
# pairs are left. The mean of a dozen surfaces shows the family.

print(fc.dimensions.variogram(surfaces["fbm"], max_lag=N * SPACING / 3))
means = {}
for family in SIZE:
    curves = [fc.dimensions.variogram(generate(family, seed), max_lag=N * SPACING / 3) for seed in range(12)]
    means[family] = sum(curve.variogram for curve in curves) / 12

variograms = plt.figure(figsize=(9.2, 3.6), layout="constrained")
left, right = variograms.subplots(1, 2)
for ax in (left, right):
    ax.set_prop_cycle(color=["#0072B2", "#D55E00", "#009E73", "#CC79A7"])  # for any colour vision
for family, mean in means.items():
    lag = mean.lag * 1e6
    compensated = mean / mean.lag ** (2 * HURST)
    left.loglog(lag, mean * 1e12, label=family)
    right.semilogx(lag, compensated / compensated[0], label=family)
right.axhline(1, color="black", lw=0.9, ls=":")
left.set_ylabel("variogram (µm²)")
right.set_ylabel("variogram / lag$^{2H}$, first lag = 1")
for ax in (left, right):
    ax.set_xlabel("lag (µm)")
    ax.spines[["top", "right"]].set_visible(False)
right.legend(frameon=False, bbox_to_anchor=(1.0, 1.0), loc="upper left")
