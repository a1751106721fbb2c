"""
The stick domain is a contact domain at lower load
==================================================

A tangential force makes the contact of a rough surface slip, from the edges of its spots inwards. How does
the part that still sticks shrink, compared with the contact itself when it is unloaded? The superposition of
Ciavarella and Jaeger says that both are the same set: what sticks under the tangential force Q is the contact
under the normal force P - Q/mu. That needs bodies without Poisson effect. Here the stick set of Coulomb's law
with a Poisson's ratio of .3, and its measures, stand beside it.
"""

import matplotlib.pyplot as plt
import numpy as np

import fractalcontact as fc

MODULUS, FRICTION, FORCE = 15.6e9, 0.6, 2000.0
surface = fc.surfaces.spectral((256, 256), 1e-5, hurst=0.8, rms_slope=0.1, rng=1)
shares = np.array([0.0, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95])  # of the force of sliding
sheared = {
    method: fc.contact.partial_slip(
        surface,
        contact_modulus=MODULUS,
        poisson=0.3,
        friction_coefficient=FRICTION,
        normal_force=FORCE,
        tangential_force=FRICTION * FORCE * shares,
        method=method,
    )
    for method in ("superposition", "full")
}
unloaded = fc.contact.press(
    surface, contact_modulus=MODULUS, normal_force=FORCE * (1 - shares), keep=("state",)
)
print(sheared["full"])

maps = fc.plotting.plot(sheared["full"], "contact_domains")

# %%
# The stick set of the superposition and the contact under the smaller force agree node by node. With the
# Poisson effect some nodes change places at the edges, but area, dimension and lacunarity hardly do.

sets = {name: result["slip_state"] == 1 for name, result in sheared.items()}
sets["contact at P - Q/mu"] = unloaded["state"] == 1
contact = sets["contact at P - Q/mu"].values
for name, planes in sets.items():
    different = (planes.values != contact).sum(axis=(1, 2)) / contact.sum(axis=(1, 2))
    print(f"{name}: part of the nodes that differ {different.round(3)}")

# %%
# The box dimension of the stick set falls with the tangential force, to isolated clusters on the highest
# asperities, and it falls as that of the contact does when it is unloaded. Random sets of the same coverage
# have a higher dimension until near sliding, and a lower one then, when they are scattered points. The
# lacunarity, here with boxes of four nodes, rises to several times that of random sets: what sticks last is
# clustered.

SCALES = (2, 4, 8, 16, 32)  # of all sets, in nodes
measured = {
    name: (fc.domains.box_dimension(planes, box_sizes=SCALES), fc.domains.lacunarity(planes))
    for name, planes in sets.items()
}
figure = plt.figure(figsize=(7.2, 3.2), layout="constrained")
left, right = figure.subplots(1, 2)
styles = {"superposition": "o-", "full": "s--", "contact at P - Q/mu": "k:"}
for name, (boxes, gliding) in measured.items():
    left.plot(shares, boxes["box_dimension"], styles[name], label=name, ms=4)
    at_box = (gliding["lacunarity"] / gliding["null_lacunarity"]).sel(box_size=4)
    right.plot(shares, at_box, styles[name], label=name, ms=4)
boxes = measured["full"][0]
left.plot(shares, boxes["null_dimension"], c="0.6", label="random null")
left.set_ylabel("box dimension")
right.set_ylabel("lacunarity over that of the null")
for ax in (left, right):
    ax.set_xlabel("tangential force / force of sliding")
    ax.spines[["top", "right"]].set_visible(False)
left.legend(frameon=False)
print({name: boxes["box_dimension"].values.round(2).tolist() for name, (boxes, _) in measured.items()})
print("random null", boxes["null_dimension"].values.round(2))
