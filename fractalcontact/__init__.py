"""Rough surfaces in contact: fractal dimension, closure, dilatancy and the domain of true contacts.

The rooms, in the order in which a surface walks through them:

surfaces    heights come in: synthetic or measured
dimensions  how rough a surface is
contact     two bodies pressed together
joints      a crack: two faces, sheared and closed
domains     what touches: islands, box dimension, lacunarity
scenes      a whole study declared in one file

Importing the package loads none of them; each is loaded when it is first named.
"""

import lazy_loader

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
