"""
Roughness by direction
======================

A ground face is rough across its striae and smooth along them. `directions` measures the exponent and the
height increments along each direction, and tells how likely an isotropic face would show as much of a
difference. Here is a stretched face beside an isotropic one, both cut out of larger ones.
"""

import numpy as np
from matplotlib.figure import Figure

import fractalcontact as fc


def cut(anisotropy_ratio):
    """Every fourth point: the waves of a face without edges, shorter ones among them."""
    whole = fc.surfaces.spectral(
        (1024, 1024), 1e-5, hurst=0.7, rms_height=2e-5, anisotropy_ratio=anisotropy_ratio, azimuth=30.0, rng=1
    )
    return fc.surfaces.from_array(whole.values[:800:4, :800:4], 4e-5)


faces = {"isotropic": cut(1.0), "stretched": cut(3.0)}
found = {name: fc.dimensions.directions(face) for name, face in faces.items()}
print(found["stretched"])

# %%
# The test of isotropy, and the anisotropy_ratio with its interval.

for name, one in found.items():
    print(
        f"{name}: p = {float(one.isotropy_p_value):.2g}, anisotropy_ratio {float(one.anisotropy_ratio):.2f} "
        f"({float(one.anisotropy_ratio_low):.2f} to {float(one.anisotropy_ratio_high):.2f}) "
        f"along {float(one.anisotropy_azimuth):.0f} degrees"
    )

# %%
# Heights change least along the striae, while the exponent is the same all round.

picture = Figure(figsize=(7.2, 3.4), layout="constrained")
left, right = picture.subplots(1, 2, subplot_kw={"projection": "polar"})
for name, one in found.items():
    around = np.radians(np.concatenate([one.azimuth, one.azimuth + 180.0, one.azimuth[:1]]))
    for ax, quantity in ((left, one.rms_increment * 1e6), (right, one.hurst)):
        ax.plot(around, np.concatenate([quantity, quantity, quantity[:1]]), marker="o", ms=3, label=name)
left.set_title("rms increment over 40 µm (µm)", fontsize=9)
right.set_title("Hurst exponent", fontsize=9)
left.set_yticks([1, 2, 3])
right.set_yticks([0.5, 1])
right.legend(frameon=False, bbox_to_anchor=(1.05, 1.0), loc="upper left")
