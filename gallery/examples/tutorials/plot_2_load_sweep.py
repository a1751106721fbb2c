"""
A load sweep against Persson's theory
=====================================

A self-affine surface is pressed by a flat from first touch to nearly complete contact. The true area of
contact is compared with three theories, which know the surface by its spectrum alone.
"""

import numpy as np

import fractalcontact as fc

# %%
# A periodic surface has no edges to disturb the comparison. The spectrum is cut at eight spacings, so
# that the smallest contacts are resolved, and falls off at a quarter of the length, so that there are
# enough of the largest waves.

surface = fc.surfaces.spectral(
    (256, 256), 1e-6, hurst=0.8, rms_slope=0.1, rolloff=64e-6, short_cutoff=8e-6, rng=1
)
print(surface)

# %%
# What matters is the load: the pressure divided by the product of modulus and rms slope. Loads are evenly
# spaced in the logarithm.

modulus = fc.contact.effective_modulus(70e9, 0.3)
pressure = 0.1 * modulus * np.geomspace(3e-3, 2.0, 14)
pressed = fc.contact.press(surface, contact_modulus=modulus, nominal_pressure=pressure)
theories = fc.contact.theories(surface, contact_modulus=modulus, nominal_pressure=pressure)
print(pressed)

# %%
# Counting cells overestimates the area by the cells at the edge of the contacts; the corrected area
# (Yastrebov, Anciaux and Molinari 2017) takes half of them off.

area = fc.plotting.plot(pressed, "contact_area", against="nominal_pressure", theory=theories, log=True)

# %%
# Contact fraction over pressure / (modulus x rms slope). Persson's theory starts at :math:`\sqrt{8/\pi} =
# 1.60`; that of Bush, Gibson and Thomas at :math:`\sqrt{2\pi} = 2.51`. Solutions lie between them.

reduced = pressure / (modulus * 0.1)
persson = theories.contact_fraction.sel(theory="persson").values
own = pressed.corrected_contact_fraction.values
for load, solution, theory in zip(reduced, own, persson, strict=True):
    slopes = f"solution {solution / load:.2f}, Persson {theory / load:.2f}"
    print(f"load {load:6.3f}: contact {solution:.3f}; contact over load: {slopes}")
