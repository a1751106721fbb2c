"""The benchmarks of each subpackage: methods that approximate a known result at several errors and times."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fractalcontact.base.numbers import Array as Array
from fractalcontact.base.validation import Problems

SUBPACKAGES = ("surfaces", "dimensions", "contact", "domains", "joints")
POINTS, TOLERANCE = "points along an edge", "tolerance"
TOLERANCES = tuple(10.0**-k for k in range(2, 11))  # a decade each, down to near rounding
# tolerance of a solution to rounding: pressures of the rough benchmarks are off by 2e-13 at most; 1e-15 is
# not met by two of the six
EXACT = 1e-13
HURST = 0.7  # of the fractional Brownian surfaces, any; `estimators` measures .1 to .9


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


def root_mean_square(errors: Array, axis: int) -> Array:
    """Return the root mean square over the replicates along an axis and all axes after it, NaN left out."""
    squares = errors.reshape(*errors.shape[: axis + 1], -1) ** 2
    finite = np.isfinite(squares)
    count = finite.sum(axis=(axis, -1))
    total = np.where(finite, squares, 0.0).sum(axis=(axis, -1))
    return np.asarray(np.sqrt(np.where(count > 0, total / np.maximum(count, 1), np.nan)))


def largest_error(exact: Any, *, relative: bool = False) -> Callable[[Any, float], float]:
    """Return the function for the largest error against a known result, which the parameter may give."""

    def error(result: Any, parameter: float) -> float:
        truth = exact(parameter) if callable(exact) else exact
        return float(np.max(np.abs(result / truth - 1.0 if relative else result - truth)))

    return error


def value_of(
    function: Callable[..., Any], variable: str, at: dict[str, Any] | None = None, **options: Any
) -> Callable[[Any], Array]:
    """Return the function of an input for a variable of the result of `function`, where `at` selects it."""

    def solve(problem: Any) -> Array:
        return np.asarray(function(problem, **options)[variable].sel(at or {}).squeeze())

    return solve


@dataclass(frozen=True)
class Method:
    """One method, to be measured at several values of its parameter.

    Attributes
    ----------
    name : str
        Unique among the benchmarks that are measured together.
    parameters : sequence of float
        Values of the parameter, in the order of growing cost.
    prepare : callable
        Parameter to the input of `solve`; not timed.
    solve : callable
        Input to the result; timed.
    errors : callable
        Result and parameter to the true error of every replicate (surface, mask, seed), one row for each; a
        single number where the error is not random. Not timed.
    parameter_name : str
        What the parameter is.

    Examples
    --------
    >>> import math
    >>> import fractalcontact as fc
    >>> method = fc.accuracy.Method(
    ...     "trapezoidal rule",
    ...     parameters=(10, 100),
    ...     prepare=lambda n: [k / n for k in range(int(n) + 1)],
    ...     solve=lambda x: sum(math.exp(a) + math.exp(b) for a, b in zip(x, x[1:])) / 2 / (len(x) - 1),
    ...     errors=lambda integral, n: abs(integral - (math.e - 1)),
    ...     parameter_name="intervals",
    ... )
    >>> print(round(method.errors(method.solve(method.prepare(10)), 10), 4))
    0.0014
    """

    name: str
    parameters: Sequence[float]
    prepare: Callable[[float], Any]
    solve: Callable[[Any], Any]
    errors: Callable[[Any, float], Any]
    parameter_name: str = POINTS


@dataclass(frozen=True)
class Benchmark:
    """Methods whose errors are comparable, because they approximate the same known result.

    Attributes
    ----------
    name, error_meaning, truth : str
        What is computed, what the error is, and what it is measured against.
    methods : tuple of Method
    equal_parameters : bool
        The parameter is the size of the input and not a choice: methods compare at equal parameters only.
    statistic : callable
        Errors of the replicates and an axis to the error of the method. Default: root mean square.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> for benchmark in fc.accuracy.benchmarks("joints"):
    ...     print(f"{benchmark.name}: {len(benchmark.methods)}")
    sinusoidal aperture, across: 2
    checkerboard: 1
    sliding wave: 1
    closure law: 1
    """

    name: str
    error_meaning: str
    truth: str
    methods: tuple[Method, ...]
    equal_parameters: bool = False
    statistic: Callable[[Array, int], Array] = root_mean_square
