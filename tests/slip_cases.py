"""Sheared balls and rough surfaces, with the closed forms of Cattaneo and Mindlin, for partial slip."""

import numpy as np

import fractalcontact as fc

MODULUS, POISSON, FRICTION, RADIUS = 1e9, 0.2, 0.4, 1.0
CONTACT_RADIUS = 2e-3
FORCE = 4 / 3 * MODULUS * CONTACT_RADIUS**3 / RADIUS
LIMIT = FRICTION * FORCE
COMPLIANCE = 4 * (2 - POISSON) / (2 * (1 - POISSON)) / MODULUS  # S = 4 lambda / E*
ALL = ("slip_state", "traction_x", "traction_y", "slip_x", "slip_y")


def ball(cells):
    """Return a ball that touches over `cells` spacings from its centre under FORCE."""
    spacing = CONTACT_RADIUS / cells
    x = spacing * np.arange(-int(1.25 * cells) - 1, int(1.25 * cells) + 2)
    return fc.surfaces.from_array(-(x**2 + x[:, None] ** 2) / (2 * RADIUS), spacing)


def mindlin_displacement(share):
    return 3 * LIMIT / (16 * CONTACT_RADIUS) * COMPLIANCE * (1 - (1 - share) ** (2 / 3))


def loop_energy(share):
    """Return the energy of a loop between -share and share of the limit (Mindlin and Deresiewicz 1953)."""
    falling = 1 - (1 - share) ** (5 / 3) - 5 * share / 6 * (1 + (1 - share) ** (2 / 3))
    return 9 * LIMIT**2 / (10 * CONTACT_RADIUS) * COMPLIANCE * falling


def rough(n=48, rng=4, periodic=True):
    surface = fc.surfaces.spectral((n, n), 1e-5, hurst=0.8, rms_slope=0.1, short_cutoff=8e-5, rng=rng)
    return surface if periodic else fc.surfaces.from_array(surface.values, 1e-5)


def sheared(surface, forces, **options):
    given = {"contact_modulus": MODULUS, "poisson": POISSON, "friction_coefficient": FRICTION, "keep": ALL}
    given["method"] = "superposition"
    if not {"closure", "nominal_pressure"} & options.keys():
        given["normal_force"] = 1.0
    return fc.contact.partial_slip(surface, tangential_force=forces, **(given | options))
