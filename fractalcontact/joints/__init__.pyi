from ._closure_laws import closure_laws as closure_laws
from ._registration import register as register
from ._strength_criteria import PARK_PAULAY as PARK_PAULAY
from ._strength_criteria import bandis_closure as bandis_closure
from ._strength_criteria import bandis_constants as bandis_constants
from ._strength_criteria import barton_bandis_scaled as barton_bandis_scaled
from ._strength_criteria import barton_choubey_strength as barton_choubey_strength
from ._strength_criteria import self_weight_strength as self_weight_strength
from ._strength_criteria import size_effect as size_effect
from .closing import closure as closure
from .crack import Crack as Crack
from .cycling import cyclic_shear as cyclic_shear
from .forgetting import decorrelation_length as decorrelation_length
from .leakage import transmissivity as transmissivity
from .opening import dilatancy as dilatancy
from .profiling import roughness_coefficient as roughness_coefficient
from .roughening import delta_dimension as delta_dimension
from .sliding import delta_surface as delta_surface
from .strength import friction as friction

__all__ = [
    "Crack",
    "PARK_PAULAY",
    "bandis_closure",
    "bandis_constants",
    "barton_bandis_scaled",
    "barton_choubey_strength",
    "closure",
    "closure_laws",
    "cyclic_shear",
    "decorrelation_length",
    "delta_dimension",
    "delta_surface",
    "dilatancy",
    "friction",
    "register",
    "roughness_coefficient",
    "self_weight_strength",
    "size_effect",
    "transmissivity",
]
