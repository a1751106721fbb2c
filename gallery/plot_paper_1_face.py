"""
The paper, figure 1: the face and its delta-surface
===================================================

The face has 512 x 512 points, 80 µm apart. A block of 2 x 2 cm, cut out of its middle, is slid over it
by 8 mm to the West; what then separates the two is the delta-surface.
"""

from shared_study import study

import fractalcontact as fc

study = study()
print(study["surfaces"].to_dataset())

figure = fc.plotting.paper_figure(study, 1)

# %%
# The paper gives fractal dimensions from 2.15 to 2.29 for its face. The shaded band is that range; the
# face here is a synthetic one that was made to behave alike.

dimensions = fc.plotting.dimensions(study["dimensions"], band=(2.15, 2.29))
print(study["dimensions"].to_dataset())

# %%
# Each dimension is the slope of a curve in a stated window of scales. The curves come first, with their
# local slopes: where these are not level there is no dimension to speak of.

curves = fc.plotting.dimension_curves(study["dimensions"])
