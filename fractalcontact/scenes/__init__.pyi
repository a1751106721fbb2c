from .planning import plan as plan
from .reading import Scene as Scene
from .reading import load as load
from .running import run as run

__all__ = [
    "Scene",
    "load",
    "plan",
    "run",
]
