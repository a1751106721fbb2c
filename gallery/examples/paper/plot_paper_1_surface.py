"""
1998 paper, figure 1: crack surface and delta-surface
=====================================================

The crack surface has 512 x 512 points, 80 µm apart. A block of 2 x 2 cm from its centre is sheared by 8
mm towards West. The delta-surface is the height difference of the two faces.
"""

import os
from pathlib import Path

import fractalcontact as fc

folder = Path(os.environ.get("FRACTALCONTACT_GALLERY", "concrete_crack_out"))
if not (folder / "result.nc").exists():
    fc.scenes.run("concrete_crack", out=folder, progress=False)
study = fc.open(folder / "result.nc")
print(study["surfaces"].to_dataset())

figure = fc.plotting.paper_figure(study, 1)

# %%
# The paper gives fractal dimensions from 2.15 to 2.29 for its surface (shaded). The surface here is
# synthetic, with similar roughness.

dimensions = fc.plotting.dimensions(study["dimensions"], band=(2.15, 2.29), band_name="1998 paper")
print(study["dimensions"].to_dataset())

# %%
# Each dimension is the slope of a scaling curve in a stated window of scales. A dimension is defined only
# where the local slope is constant.

curves = fc.plotting.dimension_curves(study["dimensions"])
