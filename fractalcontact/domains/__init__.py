"""What touches: islands of contact, their dimension, their gaps, and how they change.

A mask says which cells of the plane are in contact: booleans, or integer flags where contact means a value
above zero, with dims (..., y, x). Any leading dims, such as the steps of a load path, are kept by every
function. Start with `describe`, which gives every scalar at once.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
