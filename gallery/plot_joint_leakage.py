"""
A joint that closes, slides and leaks
=====================================

A mated pair of faces: it is sheared by three amounts, closed under growing force, and the fluid is let
through. Shear opens the joint; force closes it again, but never so far as it was before the shear.
"""

import numpy as np

import fractalcontact as fc

face = fc.surfaces.fbm((256, 256), 1e-4, hurst=0.8, rms_increment=1e-5, rng=5)
crack = fc.joints.Crack(face, young=60e9, poisson=0.25, block=0.0128, basic_friction_angle=30.0)
print(crack)

closed = fc.joints.closure(
    crack, shear=[2e-4, 8e-4, 3.2e-3], direction="E", normal_force=[100, 300, 1e3, 3e3, 1e4], keep=["gap"]
)
print(closed)
laws = fc.plotting.closure_laws(closed)

# %%
# How far the block rises when it slides, in four directions and without force.

opened = fc.joints.dilatancy(crack, shear=np.arange(0, 4e-3, 1e-4))
print(opened)
dilatancy = fc.plotting.rigid_dilatancy(opened)

# %%
# What is left between the faces lets fluid through. The hydraulic aperture is that of two smooth plates
# that let the same flow pass.

leaking = fc.joints.transmissivity(closed["gap"])
print(leaking)
aperture = fc.plotting.hydraulic_aperture(leaking)
