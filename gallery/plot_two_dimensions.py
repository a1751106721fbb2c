"""
Two dimensions of a contact domain
==================================

The set of true contacts has been called a fractal in two senses. Its box dimension counts boxes on one map,
at one resolution: it grows with the load, from 0 for a point through 1 to 2 for a plane. The other asks how
the area shrinks as the surface is resolved more finely: theory gives 1 + H, whatever the load. The two are
different quantities, and neither stands for the other.
"""

import numpy as np

import fractalcontact as fc

MODULUS, SLOPE, N = 1e10, 0.1, 256
pressure = MODULUS * SLOPE * np.array([1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.4, 1.5])


def face(hurst):
    return fc.surfaces.spectral((N, N), 1e-5, hurst=hurst, rms_slope=SLOPE, short_cutoff=4e-5, rng=1)


# %%
# On one map, at growing load: two surfaces, of Hurst exponent 0.8 and 0.3, and a random dust of as many
# cells. Counted over all sizes of box the dust's dimension is at least as large: that number measures how
# much is covered. Small boxes tell the contacts from a dust, and the smoother surface from the rougher.

counted = {}
for hurst in (0.8, 0.3):
    state = fc.contact.press(face(hurst), contact_modulus=MODULUS, nominal_pressure=pressure)["state"]
    every, small = (fc.domains.box_dimension(state, scales=2 ** np.arange(k)) for k in (9, 6))
    counted[hurst] = fc.domains.box_dimension(state)
    columns = [every.coverage, every.box_dimension, every.null_dimension, small.box_dimension]
    print(f"H = {hurst}: coverage, all boxes, dust, boxes to 32 cells, dust")
    print(np.array([*columns, small.null_dimension]).T.round(3))

print(counted[0.8])
smooth = fc.plotting.box_dimension(counted[0.8])
rough = fc.plotting.box_dimension(counted[0.3])

# %%
# Where the local dimension is level over a range of sizes a power law holds there. At low load it falls: the
# contacts are smooth islands, seen from afar as points.

slopes = fc.plotting.local_slopes(counted[0.8])

# %%
# Over resolutions: the same surface with ever shorter waves left out, on ever coarser grids, under one load.


def coarsened(surface, factor):
    """Keep the waves that a grid coarser by a factor can carry."""
    modes = np.fft.fft2(surface.values)
    kept = np.fft.fftfreq(N // factor, 1 / (N // factor)).astype(int)
    heights = np.fft.ifft2(modes[np.ix_(kept, kept)]).real / factor**2
    return fc.surfaces.from_array(heights, 1e-5 * factor, periodic=True)


for hurst in (0.8, 0.3):
    whole = fc.surfaces.spectral((N, N), 1e-5, hurst=hurst, rms_slope=2 * SLOPE, rng=1)
    load = {"contact_modulus": MODULUS, "nominal_pressure": MODULUS * SLOPE * np.array([0.01, 0.03])}
    masks = [fc.contact.press(coarsened(whole, factor), **load)["state"] for factor in (1, 2, 4, 8)]
    found = fc.domains.area_dimension(masks, corrected=True)
    print(f"H = {hurst}: theory {1 + hurst}, measured {found.area_dimension.values.round(2)}")

print(found)
