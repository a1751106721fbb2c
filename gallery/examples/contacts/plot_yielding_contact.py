"""
Contact with a hardness
=======================

With a hardness the contact pressure has an upper limit. Where it is reached the surface is indented
permanently: unloading follows a different curve, some closure remains without force, and reloading is
elastic until the previous force is exceeded.
"""

import numpy as np
from matplotlib import pyplot as plt

import fractalcontact as fc

MODULUS, HARDNESS = 15.6e9, 0.8e9
surface = fc.surfaces.spectral((128, 128), 1e-5, hurst=0.8, rms_slope=0.1, short_cutoff=8e-5, rng=4)
up = np.linspace(0, 4e8, 25)
path = np.concatenate([up, up[-4::-3], up[3::3], up[-1] + up[1:6]])

load = {"contact_modulus": MODULUS, "nominal_pressure": path}
elastic = fc.contact.press(surface, **load, keep=())
plastic = fc.contact.press(surface, **load, hardness=HARDNESS, keep=("state", "residual_height"))
print(plastic)

# %%
# The work of the force equals the stored elastic energy plus the plastic work.

force, closure = plastic["normal_force"].values, plastic["closure"].values
work = np.cumsum(np.diff(closure) * (force[1:] + force[:-1]) / 2)
energy = (plastic["elastic_energy"] + plastic["plastic_work"]).values[1:]
print("work of the force / (elastic energy + plastic work):", work[-1] / energy[-1])

last = plastic.isel(step=-1)
row = int((surface - last["residual_height"]).max("x").argmax("y"))
figure = plt.figure(figsize=(8.4, 3.4), layout="constrained")
left, middle, right = figure.subplots(1, 3)
left.plot(elastic["closure"] * 1e6, path / 1e6, c="0.6", label="elastic")
left.plot(plastic["closure"] * 1e6, path / 1e6, ".-", c="C0", label="with hardness")
left.set_xlabel("closure (µm)")
left.set_ylabel("nominal pressure (MPa)")
left.legend(frameon=False)
middle.plot(path / 1e6, elastic["contact_fraction"], c="0.6")
middle.plot(path / 1e6, plastic["contact_fraction"], ".-", c="C0")
middle.set_xlabel("nominal pressure (MPa)")
middle.set_ylabel("contact fraction")
right.plot(surface["x"] * 1e3, surface[row] * 1e6, c="0.6", label="initial")
right.plot(surface["x"] * 1e3, last["residual_height"][row] * 1e6, c="C0", label="after unloading")
right.set_xlabel("x (mm)")
right.set_ylabel("height (µm)")
right.legend(frameon=False)
for ax in (left, middle, right):
    ax.spines[["top", "right"]].set_visible(False)
