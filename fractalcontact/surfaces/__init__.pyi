from ._defects import despike as despike
from ._defects import fill as fill
from ._describe import describe as describe
from ._fbm import fbm as fbm
from ._filters import gaussian_filter as gaussian_filter
from ._filters import level as level
from ._fit_plane import fit_plane as fit_plane
from ._from_array import from_array as from_array
from ._from_points import from_points as from_points
from ._midpoint import midpoint as midpoint
from ._read import read as read
from ._read_points import read_points as read_points
from ._sample import sample as sample
from ._self_affine import SelfAffine as SelfAffine
from ._spectral import spectral as spectral
from ._texture import texture as texture
from ._weierstrass import weierstrass as weierstrass

__all__ = [
    "SelfAffine",
    "describe",
    "despike",
    "fbm",
    "fill",
    "fit_plane",
    "from_array",
    "from_points",
    "gaussian_filter",
    "level",
    "midpoint",
    "read",
    "read_points",
    "sample",
    "spectral",
    "texture",
    "weierstrass",
]
