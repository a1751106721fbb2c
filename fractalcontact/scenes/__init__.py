"""A study declared in one file: what is given, and which results are wanted.

grammar     what a scene may say
reading     the scene file, parsed and checked
given       faces, and the arguments that the tables stand for
checking    what is wrong with them; `doubting`: what is hardly meant
choosing    methods and tolerances, for an error or a time
planning    the stages that the wanted results need, and why
stages      what each stage computes, by calling the rooms
studying    one study, stage by stage; `sweeping`: an ensemble, member by member
working     tasks carried out here or on workers; `keeping`: finished parts, to go on from
running     a scene checked, carried out, drawn and written as one file
reporting   the summary on the screen
statements  what the founding paper says beside what a study finds

Nothing is computed, imported, compiled or stored that no wanted result needs. A scene is TOML:

``[surface]``     the face: ``read`` a file (with spacing, units, channel), ``sample`` a shipped one, or
                  ``generate`` with fbm, spectral, midpoint or weierstrass and its arguments; ``level``,
                  ``despike`` and ``fill`` prepare it; the spikes of a scan are taken out for the contact
                  alone, its dimension is that of the face as it was scanned
``[upper]``       the facing one, the same way; without it the faces match perfectly
``[material]``    young, poisson, basic_friction_angle, hardness
``[joint]``       block, direction, shear, normal_force and other arguments of the functions of `joints`;
                  ``[joint.closure]`` and so on give one stage values of its own; ``register = true`` brings
                  two measured faces into mated position
``[contact]``     the arguments of `contact.press`
``[dimensions]``  the arguments of `dimensions.estimate`
``[domains.lacunarity]`` and so on: the arguments of the functions of `domains`
``[want]``        surfaces, dimensions, contact, joints, domains: lists of results; keep: maps to store;
                  figures: true or false

A list of numbers may be a range: ``{start, stop, step}``, or ``{first, last, count}`` evenly spaced in the
logarithm.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
