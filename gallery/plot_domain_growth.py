"""
The domain of contact, from dust to saturation
==============================================

A periodic rough face is pressed harder and harder, from the first touch to almost full contact. Its
domain of contact begins as a few points, joins into islands, and ends as a plane with holes.
"""

import numpy as np

import fractalcontact as fc

MODULUS = 1e10  # Pa

face = fc.surfaces.spectral(
    (256, 256), 1e-5, hurst=0.8, rms_slope=0.1, long_cutoff=2.56e-3, short_cutoff=4e-5, rng=7
)
pressure = MODULUS * np.geomspace(2e-4, 0.1, 14)
pressed = fc.contact.press(face, contact_modulus=MODULUS, nominal_pressure=pressure)
print(pressed)

maps = fc.plotting.contact_domains(pressed.isel(step=[0, 3, 6, 8, 10, 13]))

# %%
# The box dimension begins near 1, with a few clusters, and ends at 2, with the plane. A random dust of
# equal coverage begins near 0 and overtakes the contacts when a quarter of the plane is covered: the
# number alone says little, the distance from the dust says that the contacts are clustered.

counted = fc.domains.box_dimension(pressed["state"])
print(counted)
box_dimension = fc.plotting.box_dimension(counted)

# %%
# The lacunarity falls from that of rare points towards 1, that of a full plane.

gaps = fc.domains.lacunarity(pressed["state"], [1, 2, 4, 8, 16, 32, 64, 128])
lacunarity = fc.plotting.lacunarity(gaps)

# %%
# The real area: proportional to the pressure at first, saturating in the end.

area = fc.plotting.contact_area(pressed, against="nominal_pressure")
