"""
Shear strength with damage
==========================

A joint is sheared under three normal stresses. Where the pressure on an asperity reaches the hardness, the
asperity is worn, and the wear is carried along the path of shear. The friction angle falls with the normal
stress by itself; the empirical curve of Barton and Bandis is drawn beside it.
"""

import numpy as np

import fractalcontact as fc

PRESSURES, STRENGTH, FRICTION = [1e6, 3e6, 9e6], 60e6, 32.0
face = fc.surfaces.fbm((128, 128), 5e-4, hurst=0.8, rms_increment=8e-5, rng=6)
crack = fc.joints.Crack(face, young=30e9, poisson=0.2, block=0.04, basic_friction_angle=FRICTION)

test = fc.joints.direct_shear(crack, 6e-3, nominal_pressure=PRESSURES, hardness=STRENGTH)
print(test)

curve = fc.joints.shear_curve(
    face,
    np.linspace(0, 6e-3, 121),
    nominal_pressure=PRESSURES,
    wall_strength=STRENGTH,
    residual_friction_angle=FRICTION,
)
curves = fc.plotting.plot(test, beside=curve)

# %%
# The peak strengths among the empirical criteria, which see the face as a JRC or as an angle of its
# asperities. Crosses are the strength at the end of the test.

envelope = fc.joints.strength_envelope(
    face,
    nominal_pressure=np.linspace(0.2e6, 10e6, 50),
    wall_strength=STRENGTH,
    basic_friction_angle=FRICTION,
    residual_friction_angle=FRICTION,
    cohesion=2e6,
)
print(
    test.peak_friction_angle.values.round(1), "degrees; JRC", float(envelope.roughness_coefficient.round(1))
)
strengths = fc.plotting.strength_envelope(envelope, tests=test)

# %%
# In a cycle the way back is easier than the way out, and the second cycle finds the asperities worn.

cycles = fc.joints.direct_shear(
    crack, [3e-3, -3e-3, 3e-3, -3e-3], nominal_pressure=PRESSURES[1], hardness=STRENGTH
)
loops = fc.plotting.plot(cycles)
