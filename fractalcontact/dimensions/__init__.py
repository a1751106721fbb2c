"""How rough a surface is: the curves over scale, and the fractal dimension fitted to them.

estimate          Hurst exponent and fractal dimension, with an honest interval
methods           the names of the methods, one line each
spectrum          power spectral density, averaged over directions
variogram         half the mean square increment against the lag
madogram          half the mean absolute increment against the lag
second_variogram  mean square second difference against the lag
roughness_length  rms height in windows against their edge
variation         range of the heights over stretches against their length
cube_counts       number of cubes that meet the surface against their edge
covering          area of the triangulated surface against the edge of the triangles

A curve is measured first and fitted afterwards; each comes with its local slope. A fractional Brownian
surface of Hurst exponent H has the dimension 3 - H, its profiles 2 - H.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
