"""
1998 paper, figure 5: dilatancy
===============================

The rigid dilatancy rises steeply within the first millimetre. Towards East and South it goes on rising
with the mean slope of the surface. The elastic dilatancy decreases with the normal force. Below, the
contact domains under 30 kN; at
8 mm the two faces are no longer correlated.
"""

import os
from pathlib import Path

import fractalcontact as fc

folder = Path(os.environ.get("FRACTALCONTACT_GALLERY", "concrete_crack_out"))
if not (folder / "result.nc").exists():
    fc.scenes.run("concrete_crack", out=folder, progress=False)
study = fc.open(folder / "result.nc")
print(study["joints/elastic_dilatancy"].to_dataset())

figure = fc.plotting.paper_figure(study, 5)

# %%
# The slope of the dilatancy curve adds to the basic friction angle. The joint is strongest within the
# first tenths of a millimetre, where the asperities still fit.

friction = fc.plotting.friction(study["joints/friction"], reach=8e-4)
print(study["joints/friction"].to_dataset())
