from . import solver as solver
from ._flat_block import flat_stiffness as flat_stiffness
from ._modulus import effective_modulus as effective_modulus
from ._modulus import effective_poisson as effective_poisson
from ._partial_slip import partial_slip as partial_slip
from ._press import press as press
from ._theories import theories as theories

__all__ = [
    "effective_modulus",
    "effective_poisson",
    "flat_stiffness",
    "partial_slip",
    "press",
    "theories",
]
