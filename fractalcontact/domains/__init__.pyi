from ._boundary import boundary_dimension as boundary_dimension
from ._box_counting import box_counts as box_counts
from ._box_counting import box_dimension as box_dimension
from ._correlation import correlation_dimension as correlation_dimension
from ._describe import describe as describe
from ._evolution import evolution as evolution
from ._evolution import lineage as lineage
from ._hausdorff_content import area_dimension as area_dimension
from ._hausdorff_content import hausdorff_content as hausdorff_content
from ._islands import islands as islands
from ._islands import percolation as percolation
from ._lacunarity import lacunarity as lacunarity
from ._minkowski import minkowski_dimension as minkowski_dimension
from ._multifractal import generalised_dimensions as generalised_dimensions
from ._read_mask import read_mask as read_mask
from ._signature import signature as signature

__all__ = [
    "area_dimension",
    "boundary_dimension",
    "box_counts",
    "box_dimension",
    "correlation_dimension",
    "describe",
    "evolution",
    "generalised_dimensions",
    "hausdorff_content",
    "islands",
    "lacunarity",
    "lineage",
    "minkowski_dimension",
    "percolation",
    "read_mask",
    "signature",
]
