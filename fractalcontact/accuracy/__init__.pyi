from ._benchmarks import Benchmark as Benchmark
from ._benchmarks import Method as Method
from ._benchmarks import benchmarks as benchmarks
from ._estimators import estimators as estimators
from ._measure import measure as measure
from ._summary import summary as summary

__all__ = [
    "Benchmark",
    "Method",
    "benchmarks",
    "estimators",
    "measure",
    "summary",
]
