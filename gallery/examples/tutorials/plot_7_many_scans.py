"""
Many scans of one surface, pooled
=================================

A laboratory has sixty scans, not one. Each is an ordinary study with a row, a page and its maps; the pooled
dimension has an interval that holds the error within each scan and the scatter between scans. Here 64
synthetic scans with the blur and the noise of an instrument show that the interval holds the truth.
"""

import os
import warnings
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter

import fractalcontact as fc

# %%
# 64 scans of surfaces whose exponents scatter about 0.7 (so that D is 2.3) with a deviation of 0.03, each
# blurred by an instrument and with white noise; one file is damaged. Replace this block by your own files.

HURST, SCATTER = 0.7, 0.03
Path("scans").mkdir(exist_ok=True)
rng = np.random.default_rng(35)
for number in range(64):
    truth = fc.surfaces.fbm((80, 80), 1e-5, hurst=rng.normal(HURST, SCATTER), rms_increment=1e-6, rng=number)
    measured = gaussian_filter(truth.values, 0.7, mode="nearest")[8:-8, 8:-8]
    measured += rng.normal(0.0, 5e-8, measured.shape)
    fc.save(fc.surfaces.from_array(measured, 1e-5), f"scans/scan_{number:02d}.nc")
Path("scans/scan_99.nc").write_bytes(b"a file that was cut short")

# %%
# One scene for all of them. ``fractalcontact roughness scans/*.nc`` writes such a scene itself.
# ``workers=8`` or ``client=`` would share the scans between processes, with the same result.

Path("scans.toml").write_text(
    """
title = "64 scans"

[surface]
read = "scans/*.nc"

[want]
surfaces = ["describe"]
dimensions = ["default"]
"""
)
with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # that one of 65 scans failed, which the table says
    result = fc.scenes.run("scans.toml", out="out", progress=False)
print(fc.scenes.summary(result))

# %%
# The interval of one scan is that of its own exponent. The pooled one is that of the mean over the scans.

pooled = fc.dimensions.pool(result["dimensions"].to_dataset())
low, high = float(pooled.fractal_dimension_low), float(pooled.fractal_dimension_high)
print(f"D {pooled.fractal_dimension:.3f}, 95 % interval {low:.3f} to {high:.3f}; truth {3 - HURST:.3f}")
print(f"scatter between scans {pooled.between_scans:.3f}, error within {pooled.within_scans:.3f}")
assert low < 3 - HURST < high
axes = fc.plotting.plot(result["overview"])

# %%
# The two measured faces of one fracture, where they are there (see :doc:`/measured_surfaces`), have one
# exponent: a joint fit, each with an amplitude and a noise of its own. Spikes of the scanner are taken out
# first; with them the interval of a face is withheld, and the reason names this step.

if "FRACTALCONTACT_DATA" in os.environ:
    faces = [fc.surfaces.despike(fc.surfaces.sample(f"freiberg_gneiss_side_{name}")) for name in "ab"]
    joint = fc.dimensions.pool(faces, model="common")
    print(joint)
    assert int(joint.scan_count) == 2
else:
    print("measured surfaces: skipped, FRACTALCONTACT_DATA is not set")
