"""The benchmarks of each subpackage: methods, their parameter, and a truth that they did not compute."""

import importlib

from fractalcontact.accuracy._benchmarks._benchmark import Benchmark as Benchmark
from fractalcontact.accuracy._benchmarks._benchmark import Method as Method
from fractalcontact.base.validation import Problems

SUBPACKAGES = ("surfaces", "dimensions", "contact", "domains", "joints")


def benchmarks(subpackage: str) -> tuple[Benchmark, ...]:
    """Return the benchmarks of one subpackage.

    Parameters
    ----------
    subpackage : {"surfaces", "dimensions", "contact", "domains", "joints"}

    Returns
    -------
    tuple of Benchmark

    Raises
    ------
    InvalidInput
        The name is unknown.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> hertz = fc.accuracy.benchmarks("contact")[0]
    >>> print(hertz.truth)
    Hertz: 4/3 E* sqrt(R) d^1.5
    >>> print(hertz.methods[0].name)
    elimination, disc
    """
    with Problems("fractalcontact.accuracy.benchmarks") as problems:
        problems.choice("subpackage", subpackage, SUBPACKAGES)
    module = importlib.import_module(f"fractalcontact.accuracy._benchmarks._{subpackage}")
    result: tuple[Benchmark, ...] = module.benchmarks()
    return result
