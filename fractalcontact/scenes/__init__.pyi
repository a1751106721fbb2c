from .planning import plan as plan
from .reading import load as load
from .running import run as run
from .scene import Scene as Scene
from .statements import paper_table as paper_table

__all__ = [
    "Scene",
    "load",
    "paper_table",
    "plan",
    "run",
]
