"""
A contact that yields
=====================

With a hardness the pressure has a greatest value. Where it is reached the surface is indented, for good:
unloading follows another way than loading, some closure is left without force, and loading again is elastic
until the old force is passed. Without one, the way back is the way there.
"""

import numpy as np
from matplotlib.figure import Figure

import fractalcontact as fc

MODULUS, HARDNESS = 15.6e9, 0.8e9
face = fc.surfaces.spectral((128, 128), 1e-5, hurst=0.8, rms_slope=0.1, short_cutoff=8e-5, rng=4)
up = np.linspace(0, 4e8, 25)
path = np.concatenate([up, up[-4::-3], up[3::3], up[-1] + up[1:6]])

load = {"contact_modulus": MODULUS, "nominal_pressure": path}
elastic = fc.contact.press(face, **load, keep=())
yielding = fc.contact.press(face, **load, hardness=HARDNESS, keep=("state", "residual_height"))
print(yielding)

# %%
# The work of the force is stored in the elastic body or spent on the indentation.

force, closure = yielding["normal_force"].values, yielding["closure"].values
work = np.cumsum(np.diff(closure) * (force[1:] + force[:-1]) / 2)
stored = (yielding["elastic_energy"] + yielding["plastic_work"]).values[1:]
print("work of the force over energy stored and spent:", work[-1] / stored[-1])

last = yielding.isel(step=-1)
row = int((face - last["residual_height"]).max("x").argmax("y"))
picture = Figure(figsize=(8.4, 3.4), layout="constrained")
left, middle, right = picture.subplots(1, 3)
left.plot(elastic["closure"] * 1e6, path / 1e6, c="0.6", label="elastic")
left.plot(yielding["closure"] * 1e6, path / 1e6, ".-", c="C0", label="with a hardness")
left.set_xlabel("closure (um)")
left.set_ylabel("nominal pressure (MPa)")
left.legend(frameon=False)
middle.plot(path / 1e6, elastic["contact_fraction"], c="0.6")
middle.plot(path / 1e6, yielding["contact_fraction"], ".-", c="C0")
middle.set_xlabel("nominal pressure (MPa)")
middle.set_ylabel("contact fraction")
right.plot(face["x"] * 1e3, face[row] * 1e6, c="0.6", label="before")
right.plot(face["x"] * 1e3, last["residual_height"][row] * 1e6, c="C0", label="unloaded after")
right.set_xlabel("x (mm)")
right.set_ylabel("height (um)")
right.legend(frameon=False)
for ax in (left, middle, right):
    ax.spines[["top", "right"]].set_visible(False)
