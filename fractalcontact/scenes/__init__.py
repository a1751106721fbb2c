"""A study declared in one file: what is given, and which results are wanted.

reading    the scene file, parsed and checked
planning   the stages that the wanted results need, and why
stages     what each stage computes, by calling the rooms
running    the plan carried out: kept stages, resuming, one NetCDF, the figures
reporting  the summary on the screen

Nothing is computed, imported, compiled or stored that no wanted result needs.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
