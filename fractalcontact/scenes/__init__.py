"""A study declared in one TOML file: its input, and the results that are wanted from it.

Only the stages that the wanted results need are computed, imported, compiled and stored.

``[surface]``     the lower face, or the only surface: ``read`` a file (with spacing, units, channel), or many
                  (a pattern or a list: each is a study of its own, stacked along `scan`),
                  ``sample`` a shipped one, or ``generate`` with fbm, spectral, midpoint or weierstrass and
                  its arguments (``members`` makes an ensemble). ``level``, ``despike``, ``fill`` prepare it,
                  ``level`` alone one that is generated.
                  Spikes are removed for the contact alone: the roughness is that of the surface as scanned,
                  unless nothing is pressed.
``[upper]``       the upper face, in the same way; without it the two faces match perfectly
``[material]``    young, poisson (a value, or [lower, upper]), basic_friction_angle, hardness, yield_pressure
``[joint]``       block, and the arguments of the functions of `joints` (shear, direction, normal_force ...);
                  ``[joint.closure]`` and so on give one stage its own values; ``register = true`` brings two
                  measured faces into mated position
``[contact]``     the arguments of `contact.press`; ``[contact.partial_slip]`` those of
                  `contact.partial_slip` (tangential_force, friction_coefficient ...)
``[dimensions]``  the arguments of `dimensions.estimate`
``[domains.lacunarity]`` and so on: the arguments of the functions of `domains`
``[want]``        surfaces, dimensions, contact, joints, domains: lists of results; keep: maps to store;
                  figures: true or false; datasheet: one page about a joint

Before the tables: ``title``.

A pressure may have its unit, "30 GPa". A list of numbers may be a range: ``{start, stop, step}``, or
``{first, last, count}`` evenly spaced in the logarithm.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
