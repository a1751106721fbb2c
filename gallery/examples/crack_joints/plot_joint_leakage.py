"""
Closure, dilatancy and leakage of a joint
=========================================

A mated joint is sheared by three amounts, closed under growing normal force, and the flow through it is
computed. Shear opens the joint; the normal force closes it again, but not to its state before shear.
"""

import numpy as np

import fractalcontact as fc

surface = fc.surfaces.fbm((256, 256), 1e-4, hurst=0.8, rms_increment=1e-5, rng=5)
crack = fc.joints.Crack(surface, young=60e9, poisson=0.25, block=0.0128, basic_friction_angle=30.0)
print(crack)

closure = fc.joints.closure(
    crack, shear=[2e-4, 8e-4, 3.2e-3], direction="E", normal_force=[100, 300, 1e3, 3e3, 1e4], keep=["gap"]
)
print(closure)
laws = fc.plotting.plot(closure)

# %%
# The rise of the block when it slides without normal force, in four directions.

opening = fc.joints.dilatancy(crack, shear=np.arange(0, 4e-3, 1e-4))
print(opening)
dilatancy = fc.plotting.dilatancy(opening)

# %%
# The hydraulic aperture is the distance of two smooth parallel plates that let the same flow pass.

flow = fc.joints.transmissivity(closure["gap"])
print(flow)
aperture = fc.plotting.plot(flow)
