from ._benchmarks import Benchmark as Benchmark
from ._benchmarks import Method as Method
from ._benchmarks import benchmarks as benchmarks
from ._cases import Case as Case
from ._cases import cases as cases
from ._estimators import estimators as estimators
from ._examine import Result as Result
from ._examine import examine as examine
from ._extremes import extremes as extremes
from ._measure import measure as measure
from ._summary import summary as summary

__all__ = [
    "Benchmark",
    "Case",
    "Method",
    "Result",
    "benchmarks",
    "cases",
    "estimators",
    "examine",
    "extremes",
    "measure",
    "summary",
]
