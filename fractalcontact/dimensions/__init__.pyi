from .curves import covering as covering
from .curves import cube_counts as cube_counts
from .curves import madogram as madogram
from .curves import roughness_length as roughness_length
from .curves import second_variogram as second_variogram
from .curves import spectrum as spectrum
from .curves import variation as variation
from .curves import variogram as variogram
from .estimating import estimate as estimate
from .estimating import methods as methods
from .orienting import directions as directions

__all__ = [
    "covering",
    "cube_counts",
    "directions",
    "estimate",
    "madogram",
    "methods",
    "roughness_length",
    "second_variogram",
    "spectrum",
    "variation",
    "variogram",
]
