from ._accuracy import error_against_time as error_against_time
from ._accuracy import estimator_errors as estimator_errors
from ._closure import closure_laws as closure_laws
from ._closure import hydraulic_aperture as hydraulic_aperture
from ._closure import uplift as uplift
from ._contact_curves import area_by_resolution as area_by_resolution
from ._contact_curves import contact_area as contact_area
from ._contact_curves import path as path
from ._contact_curves import pressure_distribution as pressure_distribution
from ._contact_curves import slip_loops as slip_loops
from ._curves import curves as curves
from ._dimensions import dimension_curves as dimension_curves
from ._dimensions import dimensions as dimensions
from ._dimensions import directional_roughness as directional_roughness
from ._dimensions import scaling as scaling
from ._draw import draw as draw
from ._ensemble import scans as scans
from ._fields import contact_domains as contact_domains
from ._fields import field as field
from ._fields import first_contact as first_contact
from ._fields import surface as surface
from ._islands import alluvial as alluvial
from ._islands import evolution as evolution
from ._islands import islands as islands
from ._size_curves import box_dimension as box_dimension
from ._size_curves import lacunarity as lacunarity
from ._size_curves import signature as signature
from ._strength import correlation as correlation
from ._strength import delta_dimension as delta_dimension
from ._strength import dilatancy as dilatancy
from ._strength import friction as friction
from ._strength import self_weight as self_weight
from ._strength import shear_curve as shear_curve
from ._strength import strength_envelope as strength_envelope

__all__ = [
    "alluvial",
    "area_by_resolution",
    "box_dimension",
    "closure_laws",
    "contact_area",
    "contact_domains",
    "correlation",
    "curves",
    "delta_dimension",
    "dimension_curves",
    "dimensions",
    "directional_roughness",
    "draw",
    "dilatancy",
    "error_against_time",
    "estimator_errors",
    "evolution",
    "field",
    "first_contact",
    "friction",
    "hydraulic_aperture",
    "islands",
    "lacunarity",
    "path",
    "pressure_distribution",
    "scaling",
    "scans",
    "self_weight",
    "shear_curve",
    "signature",
    "slip_loops",
    "strength_envelope",
    "surface",
    "uplift",
]
