from ._area_by_resolution import area_by_resolution as area_by_resolution
from ._closure import bandis_closure as bandis_closure
from ._closure import closure as closure
from ._closure_laws import closure_laws as closure_laws
from ._crack import Crack as Crack
from ._decorrelation import decorrelation_length as decorrelation_length
from ._delta_surface import delta_dimension as delta_dimension
from ._delta_surface import delta_surface as delta_surface
from ._dilatancy import dilatancy as dilatancy
from ._direct_shear import direct_shear as direct_shear
from ._friction import friction as friction
from ._partial_slip import partial_slip as partial_slip
from ._registration import register as register
from ._roughness import directional_roughness as directional_roughness
from ._roughness import roughness_coefficient as roughness_coefficient
from ._size_effect import self_weight as self_weight
from ._size_effect import size_effect as size_effect
from ._strength_envelope import shear_curve as shear_curve
from ._strength_envelope import strength_envelope as strength_envelope
from ._transmissivity import hydraulic_aperture as hydraulic_aperture
from ._transmissivity import transmissivity as transmissivity
from ._uplift import uplift as uplift

__all__ = [
    "Crack",
    "area_by_resolution",
    "bandis_closure",
    "closure",
    "closure_laws",
    "decorrelation_length",
    "delta_dimension",
    "delta_surface",
    "dilatancy",
    "direct_shear",
    "directional_roughness",
    "friction",
    "hydraulic_aperture",
    "partial_slip",
    "register",
    "roughness_coefficient",
    "self_weight",
    "shear_curve",
    "size_effect",
    "strength_envelope",
    "transmissivity",
    "uplift",
]
