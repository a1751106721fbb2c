"""Rough surfaces in contact: fractal dimension, closure, dilatancy and the domain of true contacts.

Subpackages:

surfaces    input and synthesis of surfaces
dimensions  roughness and fractal dimension
contact     elastic and plastic contact of a rough surface with a flat
joints      a crack of two faces under normal load and shear
domains     analysis of the set of true contacts: islands, box dimension, lacunarity
scenes      a whole study declared in one TOML file
accuracy    error against run time of every method
plotting    figures drawn from labelled results

`save` and `open` write and read results as NetCDF files. A subpackage is imported when it is first used.
Exceptions and warnings are in `fractalcontact.base.errors`; `InvalidInput` is a `ValueError` too.
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
