"""
Contact domain from first touch to saturation
=============================================

A periodic rough surface is pressed from first touch to almost full contact. The contact domain begins as
a few spots, merges into islands, and ends as a plane with holes.
"""

import numpy as np

import fractalcontact as fc

MODULUS = 1e10  # Pa

surface = fc.surfaces.spectral(
    (256, 256), 1e-5, hurst=0.8, rms_slope=0.1, rolloff=1.28e-3, short_cutoff=8e-5, rng=7
)
pressure = MODULUS * np.geomspace(5e-4, 0.1, 14)
pressed = fc.contact.press(surface, contact_modulus=MODULUS, nominal_pressure=pressure)
print(pressed)

maps = fc.plotting.plot(pressed.isel(step=[0, 3, 6, 8, 10, 13]), "contact_domains")

# %%
# The whole evolution in one map: without plasticity the sets are nested, so that the domain at a load is all
# that has its colour or a darker one.

first = fc.plotting.plot(pressed, "first_contact")

# %%
# Islands are born until those that merge outnumber them. The dotted line is the load of coalescence.

evolution = fc.domains.evolution(pressed["state"])
print(evolution)
counts = fc.plotting.evolution(evolution)

# %%
# Which islands grow together: each of the 20 largest islands of the last load has a colour, and so have all
# that it grew from.

tree = fc.plotting.plot(fc.domains.lineage(pressed.isel(step=slice(0, 9))["state"]))

# %%
# The local dimension d(s) of all states over one axis in metres. Below the spot size (circle) a domain is a
# plane, d = 2; beyond the gap size (square) every box meets it, and d is 2 again. Between the two d says how
# the spots are placed: it is that of random spots of equal area, perimeter and number (dashed) where they are
# scattered. Clustered spots leave larger gaps, so that beyond the spot size their curve stays below.

signature = fc.domains.signature(pressed["state"])
print(signature)
slopes = fc.plotting.signature(signature)

# %%
# Up to a coverage of a quarter the spots hardly grow, while the gaps between them close by more than ten.

lengths = fc.plotting.path(signature, ["spot_size", "gap_size", "pair_correlation_length"])

# %%
# The lacunarity decreases from that of rare spots towards 1, that of a full plane, at every box size.

lacunarity = fc.domains.lacunarity(pressed["state"], [1, 2, 4, 8, 16, 32, 64, 128])
lacunarity_curves = fc.plotting.lacunarity(lacunarity)
lacunarity_map = fc.plotting.lacunarity(lacunarity, maps=True)

# %%
# The real contact area is proportional to the pressure at first and saturates in the end.

area = fc.plotting.plot(pressed, "contact_area", against="nominal_pressure")
