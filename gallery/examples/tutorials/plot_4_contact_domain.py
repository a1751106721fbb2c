"""
Contact domain, random null and lacunarity
==========================================

The set of true contacts looks like a fractal dust. How much of its box dimension and lacunarity says
something about the surface, and how much about the number of cells?
"""

from matplotlib import pyplot as plt

import fractalcontact as fc

surface = fc.surfaces.spectral((256, 256), 1e-4, hurst=0.8, rms_slope=0.1, rolloff=6.4e-3, rng=5)
modulus = 2e10
pressed = fc.contact.press(surface, contact_modulus=modulus, nominal_pressure=[5e6, 2e7, 8e7, 3e8])
print(pressed)
maps = fc.plotting.plot(pressed, "contact_domains")

# %%
# The null is a set of as many cells, placed at random. A dimension that differs from it by more than its
# scatter is a property of the set.

box = fc.domains.box_dimension(pressed.state)
names = ["coverage", "box_dimension", "null_dimension", "differs_from_random"]
print(box[names].to_dataframe()[names].round(3).to_string())

# %%
# Contacts cluster. At small coverage random cells lie alone, and their dimension over the boxes in use is
# near 0, below that of the contacts; at larger coverage random cells reach every box, and theirs is the
# larger one. So a dimension says nothing without its coverage and its boxes. The lacunarity tells more
# directly: beyond one cell it is above that of the null (dashed) at every box size.

lacunarity = fc.domains.lacunarity(pressed.state)
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
left.semilogx(box.coverage, box.box_dimension, "o-", label="contacts")
left.semilogx(box.coverage, box.null_dimension, "s--", color="0.5", label="random null")
left.set(xlabel="coverage", ylabel="box dimension", ylim=(0, 2))
left.legend()
for step in range(pressed.sizes["step"]):
    one = lacunarity.isel(step=step)
    label = f"{pressed.nominal_pressure[step] / 1e6:g} MPa"
    (line,) = right.loglog(one.box_length * 1e3, one.lacunarity, label=label)
    right.loglog(one.box_length * 1e3, one.null_lacunarity, "--", color=line.get_color())
right.set(xlabel="box edge (mm)", ylabel="lacunarity")
right.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))

# %%
# Islands: how many, and how large. Those of a few cells are not resolved at any load.

islands = fc.domains.islands(pressed.state)
print(islands.n_islands.values, "islands")
sizes = fc.plotting.islands(islands)
