"""
Test an estimator of your own
=============================

A new estimator of the Hurst exponent, tested on surfaces whose exponent is known: its bias and its
scatter beside those of the package.
"""

import numpy as np
from matplotlib import pyplot as plt

import fractalcontact as fc


def mean_difference(surface, lags=(1, 2, 4, 8, 16)):
    """Return H from the mean absolute height difference along x, which grows as the lag to the power H."""
    heights = surface.values
    means = [np.abs(heights[:, lag:] - heights[:, :-lag]).mean() for lag in lags]
    return np.polyfit(np.log(lags), np.log(means), 1)[0]


# %%
# Twelve members for each exponent. ``rng`` makes the numbers repeatable.

truths, members = np.array([0.3, 0.5, 0.7, 0.9]), 12
own, default = [], []
for hurst in truths:
    faces = fc.surfaces.fbm((96, 96), 1e-4, hurst=hurst, rms_increment=1e-5, members=members, rng=7)
    own.append([mean_difference(face) for face in faces])
    default.append(fc.dimensions.estimate(faces).fitted_hurst.isel(method=0).values)
own, default = np.array(own), np.array(default)
print(faces)

# %%
# Bias and root mean square error, and the bias in units of its own standard error: beyond 3 it is no
# chance.

for name, found in (("mean difference", own), ("default", default)):
    error = found - truths[:, None]
    bias, scatter = error.mean(axis=1), error.std(axis=1, ddof=1)
    rms = np.sqrt((error**2).mean(axis=1))
    print(f"{name:16} bias {bias.round(3)}  rms {rms.round(3)}  z {(bias / scatter * members**0.5).round(1)}")

# %%
# The estimators of the package are measured in the same way, on more and larger surfaces, with
# ``fractalcontact accuracy estimators``; how to add one to it is on the page :doc:`/contributing`.

figure, ax = plt.subplots(figsize=(5, 3.6), layout="constrained")
for offset, name, found in ((-0.01, "mean difference", own), (0.01, "default", default)):
    error = found - truths[:, None]
    ax.errorbar(truths + offset, error.mean(axis=1), error.std(axis=1), fmt="o", label=name)
ax.axhline(0.0, color="0.5", lw=0.8)
ax.set(xlabel="true Hurst exponent", ylabel="error, mean and standard deviation")
ax.legend()
