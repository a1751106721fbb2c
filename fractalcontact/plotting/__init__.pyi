from ._closure import uplift as uplift
from ._contact_curves import path as path
from ._dimensions import dimensions as dimensions
from ._dimensions import directional_roughness as directional_roughness
from ._dimensions import scaling as scaling
from ._draw import curves as curves
from ._draw import draw as draw
from ._draw import plot as plot
from ._fields import field as field
from ._fields import surface as surface
from ._islands import evolution as evolution
from ._islands import islands as islands
from ._size_curves import box_dimension as box_dimension
from ._size_curves import lacunarity as lacunarity
from ._size_curves import signature as signature
from ._strength import decorrelation_length as decorrelation_length
from ._strength import dilatancy as dilatancy
from ._strength import friction as friction
from ._strength import strength_envelope as strength_envelope

__all__ = [
    "box_dimension",
    "decorrelation_length",
    "curves",
    "dimensions",
    "directional_roughness",
    "draw",
    "dilatancy",
    "evolution",
    "field",
    "friction",
    "islands",
    "lacunarity",
    "path",
    "plot",
    "scaling",
    "signature",
    "strength_envelope",
    "surface",
    "uplift",
]
