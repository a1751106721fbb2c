"""
Blur, noise and two exponents: the Hurst exponent by scale
==========================================================

Every instrument blurs, and adds noise. Here a surface of the exponent 0.7 is scanned with a point spread of
one and a half points and noise of 2 % of its rms increment.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.ndimage import gaussian_filter

import fractalcontact as fc

rng = np.random.default_rng(1)
surface = fc.surfaces.fbm((288, 288), 1e-5, hurst=0.7, rms_increment=1e-7, rng=rng)
heights = gaussian_filter(surface.values, 1.5)[16:-16, 16:-16]
scan = fc.surfaces.from_array(heights + 2e-9 * rng.standard_normal(heights.shape), 1e-5)

# %%
# The estimate contains the blur and the noise. The spread may be given, if the instrument is known.

for options in ({}, {"psf": 1.5e-5}):
    result = fc.dimensions.estimate(scan, **options).sel({"method": "default"})
    low, high = float(result.ci_low), float(result.ci_high)
    print(f"H = {float(result.hurst):.2f}, 95 % interval {low:.2f} to {high:.2f}")
print(result.note.item())

# %%
# The exponent by octave of wavelength shows where blur and noise end and self-affinity begins. A surface that
# is rough at short waves and smooth at long ones (right) has no single exponent; the estimate is then that of
# the band.

rough = fc.surfaces.fbm((256, 256), 1e-5, hurst=0.3, rms_increment=1e-7, rng=rng)
smooth = fc.surfaces.fbm((256, 256), 1e-5, hurst=0.9, rms_increment=4e-8, rng=rng)
both = rough + smooth.values
figure, (left, right) = plt.subplots(1, 2, figsize=(7.5, 3.2), layout="constrained")
octaves = fc.dimensions.scaling(scan)
print(octaves)
fc.plotting.scaling(octaves, ax=left)
fc.plotting.scaling(fc.dimensions.scaling(both), ax=right)
print(fc.dimensions.estimate(both).note.values)
