"""
The paper, figure 3: closure laws and real contact area
=======================================================

After each shear the block is pressed down again. The further it has slid, the longer the stage of
closing and the softer the interface; at equal force less of it touches. The area grows nearly in
proportion to the force.
"""

import numpy as np
from shared_study import study

import fractalcontact as fc

study = study()
closure = study["joints/closure"].to_dataset()
print(closure)

figure = fc.plotting.paper_figure(study, 3)

# %%
# How near to proportional? The exponent of the corrected area against the force, over the last decade:

last = closure.where(closure.normal_force >= 3e3, drop=True)
for shear in last.shear.values:
    one = last.sel(shear=shear)
    growth = one.corrected_contact_fraction[-1] / one.corrected_contact_fraction[0]
    exponent = float(np.log(growth) / np.log(one.normal_force[-1] / one.normal_force[0]))
    print(f"v = {1e3 * shear:5.2f} mm: area ~ force^{exponent:.2f}")
