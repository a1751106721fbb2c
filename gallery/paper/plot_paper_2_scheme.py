"""
1998 paper, figure 2: scheme of the simulation
==============================================

The block slides over the lower face in one of four directions. The two faces, which were mated before
shear, are then in contact at few points, and the joint opens by the dilatancy.
"""

from shared_study import study

import fractalcontact as fc

study = study()
print(study["joints/delta_surface"].to_dataset())

figure = fc.plotting.paper_figure(study, 2)
