from ._covering_area import covering as covering
from ._cube_counts import cube_counts as cube_counts
from ._detrended_fluctuation import detrended_fluctuation as detrended_fluctuation
from ._directions import directions as directions
from ._divider import divider as divider
from ._estimate import estimate as estimate
from ._exponent_by_scale import scaling as scaling
from ._height_lacunarity import height_lacunarity as height_lacunarity
from ._higuchi import higuchi as higuchi
from ._hurst_map import hurst_map as hurst_map
from ._methods import methods as methods
from ._roughness_length import roughness_length as roughness_length
from ._spectrum import spectrum as spectrum
from ._variation import variation as variation
from ._variogram import variogram as variogram
from ._waves import waves as waves

__all__ = [
    "covering",
    "cube_counts",
    "detrended_fluctuation",
    "directions",
    "divider",
    "estimate",
    "height_lacunarity",
    "higuchi",
    "hurst_map",
    "methods",
    "roughness_length",
    "scaling",
    "spectrum",
    "variation",
    "variogram",
    "waves",
]
