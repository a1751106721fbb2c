"""
What accuracy costs
===================

Two solvers for the contact of two bodies: the one of the paper, which solves a dense system and drops
the points in tension until none is left, and the fast one, which never sets up a matrix. Both are put
to the sphere of Hertz, whose force is known, on ever finer grids. Further down is more accurate,
further left is faster.
"""

import fractalcontact as fc

fc.accuracy.measure("contact", budget=1)  # compiles, so that what follows times no compiler
measured = fc.accuracy.measure("contact", budget=12)["contact"].to_dataset()
print(measured)

# %%
# The contests that are measured beside it, over rough faces, are drawn by the same function.

sphere = measured.isel(method=measured["contest"] == "sphere")
figure = fc.plotting.error_against_time(sphere)
