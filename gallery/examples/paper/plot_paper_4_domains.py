"""
1998 paper, figure 4: contact domain under growing force
========================================================

At a shear displacement of 0.4 mm the contacts begin as scattered points and grow into islands. The
letters are those on the closure law of figure 3.
"""

import os
from pathlib import Path

import fractalcontact as fc

folder = Path(os.environ.get("FRACTALCONTACT_GALLERY", "concrete_crack_out"))
if not (folder / "result.nc").exists():
    fc.scenes.run("concrete_crack", out=folder, progress=False)
study = fc.open(folder / "result.nc")
print(study["domains/box_dimension"].to_dataset())

figure = fc.plotting.paper_figure(study, 4)

# %%
# The box dimension of the domain beside its random null (randomly placed cells of equal coverage). A box
# count alone does not distinguish a fractal set from scattered points; the difference from the null does.

box_dimension = fc.plotting.box_dimension(study["domains/box_dimension"])

# %%
# The lacunarity stays high up to the size of the clusters of contacts, where that of the null is close to
# one.

lacunarity = fc.plotting.lacunarity(study["domains/lacunarity"], shear=4e-4)
