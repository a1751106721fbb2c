from .planning import plan as plan
from .reading import load as load
from .running import run as run
from .scene import Scene as Scene
from .statements import paper_table as paper_table
from .weighing import footprint as footprint

__all__ = [
    "Scene",
    "footprint",
    "load",
    "paper_table",
    "plan",
    "run",
]
