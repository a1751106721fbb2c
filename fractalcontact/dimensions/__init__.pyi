from ._cube_counts import covering as covering
from ._cube_counts import cube_counts as cube_counts
from ._directions import directions as directions
from ._estimate import estimate as estimate
from ._exponent_by_scale import scaling as scaling
from ._hurst_map import hurst_map as hurst_map
from ._methods import methods as methods
from ._pool import pool as pool
from ._profile_lengths import divider as divider
from ._profile_lengths import higuchi as higuchi
from ._roughness_length import detrended_fluctuation as detrended_fluctuation
from ._roughness_length import roughness_length as roughness_length
from ._spectrum import spectrum as spectrum
from ._variation import height_lacunarity as height_lacunarity
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
    "pool",
    "roughness_length",
    "scaling",
    "spectrum",
    "variation",
    "variogram",
    "waves",
]
