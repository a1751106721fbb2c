from .planning import plan as plan
from .reading import load as load
from .running import run as run
from .scene import Scene as Scene

__all__ = [
    "Scene",
    "load",
    "plan",
    "run",
]
