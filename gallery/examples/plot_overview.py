"""
From a surface to its contact domain
====================================

A rough surface, the pressure where a flat touches it, and the islands of contact.
"""

from pathlib import Path

import matplotlib.pyplot as plt
from PIL import Image

import fractalcontact as fc

MODULUS = 1e10  # Pa

surface = fc.surfaces.spectral(
    (512, 512), 40e-6, hurst=0.8, rms_slope=0.15, rolloff=6e-3, short_cutoff=160e-6, rng=4
)
pressed = fc.contact.press(
    surface, contact_modulus=MODULUS, nominal_pressure=0.012 * MODULUS, keep=("state", "pressure")
)
islands = fc.domains.islands(pressed["state"])
print(pressed)
print(islands)

# %%
# Three maps side by side.

overview = plt.figure(figsize=(12.4, 3.7), layout="constrained")
left, middle, right = overview.subplots(1, 3)
fc.plotting.surface(surface, title="rough surface", ax=left)
fc.plotting.field(pressed["pressure"], title="contact pressure under load", ax=middle)
fc.plotting.field(islands["label"], title="islands of contact", ax=right)

# %%
# The picture of the first page is this figure with fewer colours.

folder = Path("../images")
if folder.is_dir():
    overview.savefig(folder / "overview.png", dpi=100)
    picture = Image.open(folder / "overview.png").convert("RGB").quantize(256)
    picture.save(folder / "overview.png", optimize=True)
