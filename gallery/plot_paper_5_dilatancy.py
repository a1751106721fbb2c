"""
The paper, figure 5: dilatancy
==============================

Rigid faces climb to a plateau within the first millimetre; towards East and South they then go on
climbing with the mean slope of the face. Elastic faces climb less, the less the harder they are
pressed. Below, the domains of contact under 30 kN: at 8 mm the faces have decorrelated.
"""

from shared_study import study

import fractalcontact as fc

study = study()
print(study["joints/elastic_dilatancy"].to_dataset())

figure = fc.plotting.paper_figure(study, 5)

# %%
# The slope of the dilatancy adds to the basic friction angle. At the first tenths of a millimetre,
# where the asperities still fit, the joint is strongest.

friction = fc.plotting.friction(study["joints/friction"], reach=8e-4)
print(study["joints/friction"].to_dataset())
