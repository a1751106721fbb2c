"""Where heights come in: synthetic surfaces, measured files, and what is done to them first.

fbm          exact fractional Brownian surface, the reference for every estimator
spectral     periodic self-affine surface with cut-offs, the reference for contact
midpoint     random midpoint displacement, with the errors it has
weierstrass  a sum of cosines at geometric wavelengths (Ausloos and Berman)
from_array   your own heights on a uniform grid
read         a file: NetCDF, npy, csv, or an instrument's format
sample       surfaces that come with the package
level        remove the mean, a plane or a quadric
despike      take out points that stand out from all around them
fill         fill small gaps
describe     heights, slopes and curvature in numbers

A surface is a DataArray `height` with dims (y, x), in metres, heights up, x and y ascending at cell centres.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
