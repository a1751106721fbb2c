"""
From a surface to its contacts
==============================

A rough face, the places where it touches a flat that is pressed on it, and the islands that these make:
what the toolkit is for, in one row.
"""

from matplotlib.figure import Figure
from PIL import Image
from shared_study import HERE

import fractalcontact as fc

MODULUS = 1e10  # Pa

face = fc.surfaces.spectral(
    (512, 512), 40e-6, hurst=0.8, rms_slope=0.15, rolloff=6e-3, short_cutoff=160e-6, rng=4
)
pressed = fc.contact.press(
    face, contact_modulus=MODULUS, nominal_pressure=0.012 * MODULUS, keep=("state", "pressure")
)
islands = fc.domains.islands(pressed["state"])
print(pressed)
print(islands)

# %%
# Three maps of the plotting room, side by side.

overview = Figure(figsize=(12.4, 3.7), layout="constrained")
left, middle, right = overview.subplots(1, 3)
fc.plotting.surface(face, title="a rough face", ax=left)
fc.plotting.field(pressed["pressure"], title="pressed: where it touches, and how hard", ax=middle)
fc.plotting.island_map(islands, title="the domain of contact and its islands", ax=right)

# %%
# The picture of the first page is this one, with fewer colours.

picture = HERE / "images" / "overview.png"
overview.savefig(picture, dpi=100)
Image.open(picture).convert("RGB").quantize(256).save(picture, optimize=True)
