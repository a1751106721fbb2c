"""
1998 paper, figure 2: scheme of the simulation
==============================================

The block slides over the lower face in one of four directions. The two faces, which were mated before
shear, are then in contact at few points, and the joint opens by the dilatancy.
"""

import os
from pathlib import Path

import fractalcontact as fc

folder = Path(os.environ.get("FRACTALCONTACT_GALLERY", "concrete_crack_out"))
if not (folder / "result.nc").exists():
    fc.scenes.run("concrete_crack", out=folder, progress=False)
study = fc.open(folder / "result.nc")
print(study["joints/delta_surface"].to_dataset())

figure = fc.plotting.paper_figure(study, 2)
