"""
Directional roughness
=====================

A ground surface is rough across its striae and smooth along them. `directions` estimates the Hurst
exponent and the height increments in each direction, and tests whether the differences are significant.
This example compares a striated surface with an isotropic one; both are cut from larger surfaces.
"""

import numpy as np
from matplotlib import pyplot as plt

import fractalcontact as fc


def cut_surface(anisotropy_ratio):
    """Return every fourth point of a part of a surface: not periodic, without short cut-off."""
    large = fc.surfaces.spectral(
        (1024, 1024),
        1e-5,
        hurst=0.7,
        rms_height=2e-5,
        anisotropy_ratio=anisotropy_ratio,
        direction=30.0,
        rng=1,
    )
    return fc.surfaces.from_array(large.values[:800:4, :800:4], 4e-5)


surfaces = {"isotropic": cut_surface(1.0), "striated": cut_surface(3.0)}
results = {name: fc.dimensions.directions(surface) for name, surface in surfaces.items()}
print(results["striated"])

# %%
# The test of isotropy, and the anisotropy ratio with its interval.

for name, result in results.items():
    print(
        f"{name}: p = {float(result.isotropy_p_value):.2g}, "
        f"anisotropy ratio {float(result.anisotropy_ratio):.2f} "
        f"({float(result.anisotropy_ratio_low):.2f} to {float(result.anisotropy_ratio_high):.2f}) "
        f"along {float(result.anisotropy_azimuth):.0f} degrees"
    )

# %%
# Heights change least along the striae, while the exponent is the same in all directions.

figure = plt.figure(figsize=(7.2, 3.4), layout="constrained")
left, right = figure.subplots(1, 2, subplot_kw={"projection": "polar"})
for name, result in results.items():
    angle = np.radians(np.concatenate([result.azimuth, result.azimuth + 180.0, result.azimuth[:1]]))
    for ax, quantity in ((left, result.rms_increment * 1e6), (right, result.hurst)):
        ax.plot(angle, np.concatenate([quantity, quantity, quantity[:1]]), marker="o", ms=3, label=name)
left.set_title("rms increment over 40 µm (µm)", fontsize=9, pad=28)
right.set_title("Hurst exponent", fontsize=9, pad=28)
left.set_yticks([1, 2, 3])
right.set_yticks([0.5, 1])
right.legend(frameon=False, bbox_to_anchor=(1.05, 1.0), loc="upper left")
