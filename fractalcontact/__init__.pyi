from . import accuracy as accuracy
from . import contact as contact
from . import dimensions as dimensions
from . import domains as domains
from . import joints as joints
from . import plotting as plotting
from . import scenes as scenes
from . import surfaces as surfaces
from .base.netcdf import open as open
from .base.netcdf import save as save

__version__: str
