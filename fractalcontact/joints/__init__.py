"""A crack: two rough faces that are sheared, pressed together, and leak.

A study starts with a `Crack`: the two faces, the block that slides, and the material. From it come

delta_surface         what separates the faces after a shear
delta_dimension       how rough that difference is, by methods that disagree
closure               how they close under a normal force
closure_laws          the named laws of closure fitted to it, and its stiffness
dilatancy             how far they open when they slide: rigid, under a normal force, or against a spring
friction              the friction angle and the shear strength that follow from the dilatancy
cyclic_shear          the shear stress along a path that goes to and fro
decorrelation_length  the shear at which the facing heights have decorrelated
transmissivity        how much fluid the open part of the joint lets through
register              brings two measured faces into mated position first

Beside them stand the named laws of the field, to compare with: `barton_choubey_strength`,
`barton_bandis_scaled`, `bandis_constants`, `bandis_closure`, `PARK_PAULAY`, the `roughness_coefficient`
of a measured face that they ask for, and the size effects `self_weight_strength` and `size_effect`.

Lengths are in metres, forces in N, pressures in Pa and angles in degrees; E is +x and N is +y.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
