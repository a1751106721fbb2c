"""Roughness of a surface: curves over scale, and the fractal dimension.

estimate          Hurst exponent and fractal dimension with a 95 % interval
methods           names of the methods of `estimate`, with one line each
pool              common exponent of several scans, and their scatter
directions        exponent by direction, and tests of isotropy
hurst_map         exponent in windows that move over the surface
waves             single waves, such as marks of machining
scaling           exponent by octave of wavelength, beside that of `estimate`
spectrum          power spectral density, averaged over directions
variogram         half the mean square increment against the lag; madogram, second differences
roughness_length  rms height in windows against their edge
variation         range of the heights over segments or squares against their length
higuchi           length of profiles by increments against the lag
detrended_fluctuation  rms height of profiles about lines in windows (DFA)
divider           length of profiles walked with dividers against their opening
height_lacunarity  lacunarity of the heights (grey values) by gliding windows
cube_counts       number of cubes that meet the surface against their edge
covering          area of the triangulated surface against the edge of the triangles

A fractional Brownian surface of Hurst exponent H has the dimension 3 - H, its profiles 2 - H. Every curve
comes with its local slope.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
