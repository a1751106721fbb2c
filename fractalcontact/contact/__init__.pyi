from .flat_block import flat_stiffness as flat_stiffness
from .modulus import effective_modulus as effective_modulus
from .pressing import press as press

__all__ = [
    "effective_modulus",
    "flat_stiffness",
    "press",
]
