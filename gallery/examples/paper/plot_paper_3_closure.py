"""
1998 paper, figure 3: closure laws and real contact area
========================================================

After each shear displacement the block is pressed down. With growing shear the closure increases, the
interface becomes softer, and the contact area at equal force decreases. The area grows nearly in
proportion to the force.
"""

import os
from pathlib import Path

import numpy as np

import fractalcontact as fc

folder = Path(os.environ.get("FRACTALCONTACT_GALLERY", "concrete_crack_out"))
if not (folder / "result.nc").exists():
    fc.scenes.run("concrete_crack", out=folder, progress=False)
study = fc.open(folder / "result.nc")
closure = study["joints/closure"].to_dataset()
print(closure)

figure = fc.plotting.paper_figure(study, 3)

# %%
# The exponent of the corrected area as a function of force, over the last decade of force:

last = closure.where(closure.normal_force >= 3e3, drop=True)
for shear in last.shear.values:
    path = last.sel(shear=shear)
    growth = path.corrected_contact_fraction[-1] / path.corrected_contact_fraction[0]
    exponent = float(np.log(growth) / np.log(path.normal_force[-1] / path.normal_force[0]))
    print(f"v = {1e3 * shear:5.2f} mm: area ~ force^{exponent:.2f}")
