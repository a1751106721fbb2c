"""
The paper, figure 2: the scheme of the simulation
=================================================

The block slides over the face in one of four directions. Seen from the side the two faces, which fitted
when the crack opened, now ride on each other: the joint opens by the dilatancy.
"""

from shared_study import study

import fractalcontact as fc

study = study()
print(study["joints/delta_surface"].to_dataset())

figure = fc.plotting.paper_figure(study, 2)
