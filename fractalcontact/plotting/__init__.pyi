from ._accuracy import error_against_time as error_against_time
from ._accuracy import estimator_errors as estimator_errors
from ._area_dimension import area_dimension as area_dimension
from ._box_dimension import box_dimension as box_dimension
from ._box_dimension import local_slopes as local_slopes
from ._closure import closure_fits as closure_fits
from ._closure import closure_laws as closure_laws
from ._closure import contact_area as contact_area
from ._contact_curves import mean_gap as mean_gap
from ._contact_curves import pressure_distribution as pressure_distribution
from ._contact_curves import stiffness as stiffness
from ._contact_maps import contact_domains as contact_domains
from ._curves import curves as curves
from ._datasheet import datasheet as datasheet
from ._decorrelation import correlation as correlation
from ._decorrelation import delta_dimension as delta_dimension
from ._dilatancy import elastic_dilatancy as elastic_dilatancy
from ._dilatancy import rigid_dilatancy as rigid_dilatancy
from ._dimensions import dimension_curves as dimension_curves
from ._dimensions import dimensions as dimensions
from ._directional_roughness import directional_roughness as directional_roughness
from ._draw import draw as draw
from ._exponent_by_scale import scaling as scaling
from ._friction import friction as friction
from ._islands import island_map as island_map
from ._islands import islands as islands
from ._lacunarity import lacunarity as lacunarity
from ._paper import paper_figure as paper_figure
from ._partial_slip import slip_domains as slip_domains
from ._partial_slip import slip_loops as slip_loops
from ._self_weight import self_weight as self_weight
from ._shear_curve import shear_curve as shear_curve
from ._shear_scheme import sliding_scheme as sliding_scheme
from ._strength_envelope import strength_envelope as strength_envelope
from ._surface import field as field
from ._surface import surface as surface
from ._transmissivity import hydraulic_aperture as hydraulic_aperture
from ._uplift import uplift as uplift

__all__ = [
    "area_dimension",
    "box_dimension",
    "closure_fits",
    "closure_laws",
    "contact_area",
    "contact_domains",
    "correlation",
    "curves",
    "datasheet",
    "delta_dimension",
    "dimension_curves",
    "dimensions",
    "directional_roughness",
    "draw",
    "elastic_dilatancy",
    "error_against_time",
    "estimator_errors",
    "field",
    "friction",
    "hydraulic_aperture",
    "island_map",
    "islands",
    "lacunarity",
    "local_slopes",
    "mean_gap",
    "paper_figure",
    "pressure_distribution",
    "rigid_dilatancy",
    "scaling",
    "self_weight",
    "shear_curve",
    "sliding_scheme",
    "stiffness",
    "slip_domains",
    "slip_loops",
    "strength_envelope",
    "surface",
    "uplift",
]
