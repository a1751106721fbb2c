"""
Two dimensions of a contact domain
==================================

The set of true contacts has been called fractal in two senses. Its box dimension counts boxes on one map
at one resolution; it grows with the load from 0 (a point) to 2 (a plane). The other dimension describes
how the contact area decreases as the surface is resolved more finely; theory gives 1 + H at any load.
They are different quantities.
"""

import numpy as np

import fractalcontact as fc

MODULUS, SLOPE, N = 1e10, 0.1, 256
pressure = MODULUS * SLOPE * np.array([1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.4, 1.5])


def rough_surface(hurst):
    return fc.surfaces.spectral((N, N), 1e-5, hurst=hurst, rms_slope=SLOPE, short_cutoff=4e-5, rng=1)


# %%
# Box dimensions of two surfaces at growing load, with the Hurst exponents 0.8 and 0.3, and of their
# random null. Over all box sizes the null has a dimension at least as large: this dimension measures
# mainly coverage. With small boxes the contacts differ from the null, and the smoother surface from the
# rougher one.

dimensions = {}
for hurst in (0.8, 0.3):
    state = fc.contact.press(rough_surface(hurst), contact_modulus=MODULUS, nominal_pressure=pressure)[
        "state"
    ]
    all_sizes, small = (fc.domains.box_dimension(state, box_sizes=2 ** np.arange(k)) for k in (9, 6))
    dimensions[hurst] = fc.domains.box_dimension(state)
    columns = [all_sizes.coverage, all_sizes.box_dimension, all_sizes.null_dimension]
    columns += [small.box_dimension, small.null_dimension]
    print(f"H = {hurst}: coverage, all boxes, null, boxes up to 32 cells, null")
    print(np.array(columns).T.round(3))

print(dimensions[0.8])
smooth = fc.plotting.box_dimension(dimensions[0.8])
rough = fc.plotting.box_dimension(dimensions[0.3])

# %%
# A power law holds where the local dimension is constant over a range of sizes. At low load it decreases:
# the contacts are smooth islands that look like points from afar.

slopes = fc.plotting.signature(dimensions[0.8])

# %%
# The area dimension: the same surface with successively shorter waves left out, on coarser grids, under
# one load.


def coarsen(surface, factor):
    """Return a surface with the waves that a grid coarser by a factor can represent."""
    modes = np.fft.fft2(surface.values)
    wavenumbers = np.fft.fftfreq(N // factor, 1 / (N // factor)).astype(int)
    heights = np.fft.ifft2(modes[np.ix_(wavenumbers, wavenumbers)]).real / factor**2
    return fc.surfaces.from_array(heights, 1e-5 * factor, periodic=True)


for hurst in (0.8, 0.3):
    fine = fc.surfaces.spectral((N, N), 1e-5, hurst=hurst, rms_slope=2 * SLOPE, rng=1)
    load = {"contact_modulus": MODULUS, "nominal_pressure": MODULUS * SLOPE * np.array([0.01, 0.03])}
    masks = [fc.contact.press(coarsen(fine, factor), **load)["state"] for factor in (1, 2, 4, 8)]
    result = fc.domains.area_dimension(masks, corrected=True)
    print(f"H = {hurst}: theory {1 + hurst}, measured {result.area_dimension.values.round(2)}")

print(result)
