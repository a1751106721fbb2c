"""Joints: a crack of two rough faces that are sheared, pressed together, and leak.

A study starts with a `Crack`: the two faces, the block that slides, and the material. It gives

delta_surface         the difference of the facing heights after a shear
delta_dimension       the dimension of that difference, by area, variogram and spectrum
closure               the closure of the faces under a path of load
area_by_resolution    the contact area against the spacing of the heights
closure_laws          exponential and hyperbolic laws fitted to the closure, and the normal stiffness
dilatancy             the opening of the faces during shear: rigid, under a normal force, or against a spring
friction              friction angle and shear strength from the dilatancy
self_weight           shear strength against the size of the structure that loads the joint
direct_shear          shear test with wear, along a path of shear that may reverse
partial_slip          stick, slip and stiffness under a shear force below that of sliding
decorrelation_length  the shear at which the facing heights have decorrelated
transmissivity        the flow through the open part of the joint
uplift                the force of the water in the joint, and its line of action
register              two measured faces brought into mated position, before all others

For comparison with practice: the `roughness_coefficient` (JRC) and the `directional_roughness` of a surface,
the `strength_envelope` by several criteria and the `shear_curve` of Barton and Bandis, of a surface or of a
JRC, the closure by `bandis_closure`, the `hydraulic_aperture` from the mechanical one, and the `size_effect`.

Lengths are in metres, forces in N, pressures in Pa and angles in degrees; E is +x and N is +y.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
