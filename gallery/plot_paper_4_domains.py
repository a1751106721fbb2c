"""
The paper, figure 4: the domain of contact under growing force
==============================================================

At a shear of 0.4 mm the contacts begin as scattered points, which grow into islands. The letters are
those on the closure law of figure 3.
"""

from shared_study import study

import fractalcontact as fc

study = study()
print(study["domains/box_dimension"].to_dataset())

figure = fc.plotting.paper_figure(study, 4)

# %%
# The box dimension of the domain, beside that of a random dust of equal coverage. A box count alone
# cannot tell a fractal from scattered points; the distance between the two lines can.

box_dimension = fc.plotting.box_dimension(study["domains/box_dimension"])

# %%
# The lacunarity tells at which scale the gaps are: it stays high as far as the clusters of contacts
# reach, where that of the dust has long fallen to one.

lacunarity = fc.plotting.lacunarity(study["domains/lacunarity"], shear=4e-4)
