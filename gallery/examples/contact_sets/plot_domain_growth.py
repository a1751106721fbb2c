"""
Contact domain from first touch to saturation
=============================================

A periodic rough surface is pressed from first touch to almost full contact. The contact domain begins as
a few points, merges into islands, and ends as a plane with holes.
"""

import numpy as np

import fractalcontact as fc

MODULUS = 1e10  # Pa

surface = fc.surfaces.spectral(
    (256, 256), 1e-5, hurst=0.8, rms_slope=0.1, long_cutoff=2.56e-3, short_cutoff=4e-5, rng=7
)
pressure = MODULUS * np.geomspace(2e-4, 0.1, 14)
pressed = fc.contact.press(surface, contact_modulus=MODULUS, nominal_pressure=pressure)
print(pressed)

maps = fc.plotting.contact_domains(pressed.isel(step=[0, 3, 6, 8, 10, 13]))

# %%
# The box dimension begins near 1, with a few clusters, and ends at 2. That of the random null (randomly
# placed cells of equal coverage) begins near 0 and is larger above a coverage of about a quarter. The
# difference between the two shows the clustering of the contacts; the box dimension alone does not.

dimensions = fc.domains.box_dimension(pressed["state"])
print(dimensions)
box_dimension = fc.plotting.box_dimension(dimensions)

# %%
# The lacunarity decreases from that of rare points towards 1, that of a full plane.

lacunarity = fc.domains.lacunarity(pressed["state"], [1, 2, 4, 8, 16, 32, 64, 128])
lacunarity_curves = fc.plotting.lacunarity(lacunarity)

# %%
# The real contact area is proportional to the pressure at first and saturates in the end.

area = fc.plotting.contact_area(pressed, against="nominal_pressure")
