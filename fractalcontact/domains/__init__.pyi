from .counting import box_counts as box_counts
from .counting import box_dimension as box_dimension
from .crossing import percolation as percolation
from .descending import lineage as lineage
from .edges import boundary_dimension as boundary_dimension
from .following import evolution as evolution
from .gliding import lacunarity as lacunarity
from .growing import minkowski_dimension as minkowski_dimension
from .labelling import islands as islands
from .moments import generalised_dimensions as generalised_dimensions
from .pairing import correlation_dimension as correlation_dimension
from .resolving import area_dimension as area_dimension
from .summary import describe as describe

__all__ = [
    "area_dimension",
    "boundary_dimension",
    "box_counts",
    "box_dimension",
    "correlation_dimension",
    "describe",
    "evolution",
    "generalised_dimensions",
    "islands",
    "lacunarity",
    "lineage",
    "minkowski_dimension",
    "percolation",
]
