from .brownian import fbm as fbm
from .despiking import despike as despike
from .displacement import midpoint as midpoint
from .measured import from_array as from_array
from .measured import read as read
from .preparing import fill as fill
from .preparing import level as level
from .samples import sample as sample
from .statistics import describe as describe
from .synthesis import SelfAffine as SelfAffine
from .synthesis import spectral as spectral
from .waves import weierstrass as weierstrass

__all__ = [
    "SelfAffine",
    "describe",
    "despike",
    "fbm",
    "fill",
    "from_array",
    "level",
    "midpoint",
    "read",
    "sample",
    "spectral",
    "weierstrass",
]
