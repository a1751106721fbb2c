"""
Stick and slip before sliding
=============================

A pressed rough surface is sheared by a force below that of sliding, mu times the normal force. The edges
of the contact spots slip first, small spots as a whole; what sticks under a tangential force Q is the
contact under the normal force P - Q/mu.
"""

import matplotlib.pyplot as plt
import numpy as np

import fractalcontact as fc

MODULUS, FORCE, FRICTION = 15.6e9, 250.0, 0.6
surface = fc.surfaces.spectral((192, 192), 1e-5, hurst=0.8, rms_slope=0.1, short_cutoff=8e-5, rng=4)
sliding = FRICTION * FORCE
loading = np.linspace(0, 0.9, 10)
cycle = np.concatenate([np.linspace(0.9, -0.9, 19)[1:], np.linspace(-0.9, 0.9, 19)[1:]])

sheared = fc.contact.partial_slip(
    surface,
    contact_modulus=MODULUS,
    poisson=0.2,
    friction_coefficient=FRICTION,
    normal_force=FORCE,
    tangential_force=sliding * np.concatenate([loading, cycle]),
)
print(sheared)

maps = fc.plotting.plot(sheared.isel(step=[0, 3, 6, 9, 15, 27]), "contact_domains")

# %%
# The loop between force and displacement encloses the energy that friction dissipates in one cycle. The
# stick domain is a contact domain under a lower force, and has its lower box dimension.

stick = (sheared["slip_state"] == 1).isel(step=[0, 3, 6, 9])
dimensions = fc.domains.box_dimension(stick)
print(dimensions["box_dimension"].values)

figure = plt.figure(figsize=(7.2, 3.2), layout="constrained")
left, right = figure.subplots(1, 2)
left.plot(sheared["tangential_displacement"] * 1e6, sheared["tangential_force"], c="#0072B2")
left.set_xlabel("tangential displacement (µm)")
left.set_ylabel("tangential force (N)")
first = sheared.isel(step=slice(10))
for name, colour in (("stick", "#12355B"), ("slip", "#E69F00")):
    area = first[f"{name}_area"] * 1e6
    right.plot(first["tangential_force"] / sliding, area, ".-", c=colour, label=name)
right.set_xlabel("tangential force / force of sliding")
right.set_ylabel("area (mm²)")
right.legend(frameon=False)
for ax in (left, right):
    ax.spines[["top", "right"]].set_visible(False)
