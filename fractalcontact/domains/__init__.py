"""Geometry of the contact set: islands, dimensions, lacunarity, percolation, and their evolution.

A mask marks the cells of the plane that are in contact: booleans, or integer flags where contact means a
value above zero, with dims (..., y, x). Every function keeps leading dims, such as the steps of a load path.
Start with `describe`, which gives all scalars at once.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
