from .bench import estimators as estimators
from .catalogue import Case as Case
from .catalogue import cases as cases
from .examination import examine as examine
from .measuring import measure as measure

__all__ = [
    "Case",
    "cases",
    "estimators",
    "examine",
    "measure",
]
