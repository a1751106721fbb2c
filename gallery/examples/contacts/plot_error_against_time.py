"""
Error against run time
======================

Two solvers for the contact of two bodies are compared: the dense elimination of the 1998 paper, which
drops points in tension until none is left, and the FFT solver, which never forms a matrix. Both solve the
contact of a sphere, whose force is known (Hertz), on successively finer grids. Lower is more accurate,
further left is faster.
"""

import fractalcontact as fc

fc.accuracy.measure("contact", budget=1)  # compiles the kernels, so that compile time is not measured
measured = fc.accuracy.measure("contact", budget=12)["contact"].to_dataset()
print(measured)

# %%
# The function also draws the other benchmarks of this group, with rough surfaces.

sphere = measured.isel(method=measured["benchmark"] == "sphere")
figure = fc.plotting.plot(sphere)
