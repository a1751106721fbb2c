"""Surface input and synthesis: synthetic surfaces, measured files, preparation and statistics.

fbm          exact fractional Brownian surface, the reference for every estimator
spectral     periodic self-affine surface with cut-offs, the reference for contact
midpoint     random midpoint displacement, with its known errors
weierstrass  sum of cosines at geometric wavelengths (Ausloos and Berman)
SelfAffine   closed forms of the self-affine spectrum
from_array   heights on a uniform grid as a surface
from_points  points of a cloud or mesh, gridded
fit_plane    best-fit plane of points, and the rotation into it
read         surface from a file: NetCDF, npy, table, point cloud, mesh, raster, or an instrument's format
read_points  points of a cloud or mesh, to select a part before they are gridded
sample       surfaces installed with the package
level        remove the mean, a plane or a quadric
despike      remove isolated outliers of a scan
fill         fill small gaps
describe     statistics of heights, slopes and curvature
texture      correlation lengths, and the core of the height distribution (ISO 25178-2)
gaussian_filter  waviness or roughness, by the Gaussian filter of ISO 16610

A surface is a DataArray `height` with dims (y, x), in metres, heights up, x and y ascending at cell centres.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
