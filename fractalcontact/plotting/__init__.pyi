from .accuracy_curves import error_against_time as error_against_time
from .accuracy_curves import estimator_errors as estimator_errors
from .closing import closure_laws as closure_laws
from .closing import contact_area as contact_area
from .domain_maps import contact_domains as contact_domains
from .domain_maps import island_map as island_map
from .domain_maps import islands as islands
from .drawing import draw as draw
from .forgetting import correlation as correlation
from .forgetting import delta_dimension as delta_dimension
from .lacunar import box_dimension as box_dimension
from .lacunar import lacunarity as lacunarity
from .lacunar import local_slopes as local_slopes
from .leakage import hydraulic_aperture as hydraulic_aperture
from .paper import paper_figure as paper_figure
from .relief import face as face
from .relief import field as field
from .roughness import dimension_curves as dimension_curves
from .roughness import dimensions as dimensions
from .scheme import sliding_scheme as sliding_scheme
from .sliding import elastic_dilatancy as elastic_dilatancy
from .sliding import friction as friction
from .sliding import rigid_dilatancy as rigid_dilatancy

__all__ = [
    "box_dimension",
    "closure_laws",
    "contact_area",
    "contact_domains",
    "correlation",
    "delta_dimension",
    "dimension_curves",
    "dimensions",
    "draw",
    "elastic_dilatancy",
    "error_against_time",
    "estimator_errors",
    "face",
    "field",
    "friction",
    "hydraulic_aperture",
    "island_map",
    "islands",
    "lacunarity",
    "local_slopes",
    "paper_figure",
    "rigid_dilatancy",
    "sliding_scheme",
]
