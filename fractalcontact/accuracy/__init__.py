"""How right, how fast, and what happens at the edges.

cases      the catalogue of extreme surfaces and masks, with what is expected of each
examine    every room's functions run on one case, held against what is expected
measure    true error against run time of the methods, over their own knobs
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
