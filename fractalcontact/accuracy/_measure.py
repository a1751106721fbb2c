"""True error against run time of every method, and which settings are on the Pareto front."""

from __future__ import annotations

import time
import tracemalloc
import warnings
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from fractalcontact.accuracy._benchmarks import SUBPACKAGES, Benchmark, Method, benchmarks
from fractalcontact.base.errors import SmallStrainWarning
from fractalcontact.base.numbers import Array
from fractalcontact.base.provenance import stamp
from fractalcontact.base.schema import label
from fractalcontact.base.signals import Stop, track
from fractalcontact.base.validation import Problems, word_tuple

WHERE = "fractalcontact.accuracy.measure"
# further calls of a setting, the shortest of which counts: on a busy machine one of four took 1.07 times the
# shortest of 60 (median of eight methods), a single one 1.36, one of eight 1.04
REPEATS = 3


class Setting(NamedTuple):
    """What was measured of a method at one value of its parameter."""

    parameter: float
    error: float
    run_time: float  # s, shortest of all calls
    first_run_time: float  # s, with compilation
    memory: float  # bytes, peak of one call


def measure(
    parts: Sequence[str] | str | Mapping[str, Sequence[Benchmark]] | None = None,
    *,
    budget: float = 60.0,
    progress: bool = False,
    stop: Stop | None = None,
) -> xr.DataTree:
    """Measure true error, run time and memory of the methods of each subpackage.

    Parameters
    ----------
    parts : str, sequence of str, or mapping, optional
        Out of "surfaces", "dimensions", "contact", "domains", "joints"; None: all of them. A mapping gives
        benchmarks of your own under a name.
    budget : float
        Seconds for the whole. The time that is left is shared evenly by the methods still to come. Each is
        measured at one setting at least, then at the next ones while its share lasts. The time of compiling
        is not counted.
    progress : bool
        Show a progress bar.
    stop : Stop, optional
        Asked before each setting. Once it is true the results so far are returned, and the attribute
        `completeness` names the methods that are missing.

    Returns
    -------
    DataTree
        A group for each part, over (method, setting): `error`, `run_time` (s, shortest of the calls),
        `first_run_time` (s, with compilation), `memory` (byte, peak of one call), `parameter`, and
        `on_pareto_front`: no setting of another method of the benchmark has a smaller error in a shorter
        time; where the parameter is the size of the input, none of the same size. Over
        `method`: `benchmark`, `parameter_name`, `error_meaning` and `truth`.

    Raises
    ------
    InvalidInput
        An unknown part, or a budget that is not positive.

    Notes
    -----
    Methods of a benchmark have the same surfaces or masks. A difference of a tenth in time, or of a random
    error within its scatter, is none: repeat the run, on an idle machine, before a method is preferred.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> flow = [b for b in fc.accuracy.benchmarks("joints") if b.name == "checkerboard"]
    >>> measured = fc.accuracy.measure({"flow": flow}, budget=0.05)["flow"]
    >>> print(bool(measured["on_pareto_front"][0, 0]), bool(measured["error"][0, 0] < 0.1))
    True True
    """
    with Problems(WHERE) as problems:
        _check_parts(problems, parts)
        problems.number("budget", budget, above=0)
        problems.boolean("progress", progress)
        problems.require(stop is None or isinstance(stop, Stop), "stop", "a Stop, or None", stop)
    if not isinstance(parts, Mapping):
        parts = {name: benchmarks(name) for name in (SUBPACKAGES if parts is None else word_tuple(parts))}
    rows = [
        (part, benchmark, method)
        for part, group in parts.items()
        for benchmark in group
        for method in benchmark.methods
    ]
    settings: list[list[Setting]] = []
    end = time.perf_counter() + budget
    with warnings.catch_warnings():
        # the contact benchmarks are linear problems in units of their own: their slopes mean nothing
        warnings.simplefilter("ignore", SmallStrainWarning)
        for _, benchmark, method in track(rows, progress, "accuracy", unit="method"):
            if stop:
                break
            share = (end - time.perf_counter()) / (len(rows) - len(settings))
            settings.append(_measure_method(benchmark, method, share, stop))
            first = settings[-1][0]
            end += first.first_run_time - first.run_time
    tree = xr.DataTree()
    for part in parts:
        of_part = [(*row[1:], done) for row, done in zip(rows, settings, strict=False) if row[0] == part]
        if of_part:
            tree[part] = xr.DataTree(_dataset(part, of_part))
    parameters = {"parts": list(parts), "budget": budget}
    tree.attrs = stamp(xr.Dataset(), WHERE, parameters, title="Error against run time").attrs
    missing = "; ".join(method.name for _, _, method in rows[len(settings) :])
    if missing:
        tree.attrs["completeness"] = f"partial: the run was stopped; missing: {missing}"
    return tree


def _check_parts(problems: Problems, parts: Any) -> None:
    if isinstance(parts, Mapping):
        valid = all(
            isinstance(part, Sequence) and all(isinstance(item, Benchmark) for item in part)
            for part in parts.values()
        )
        problems.require(valid, "parts", "sequences of Benchmark in a mapping", parts)
    elif parts is not None:
        problems.choices("parts", parts, SUBPACKAGES)


def _measure_method(benchmark: Benchmark, method: Method, share: float, stop: Stop | None) -> list[Setting]:
    """Measure the settings that fit into a share of seconds, the first one in any case."""
    settings: list[Setting] = []
    spent = expected = 0.0
    for parameter in method.parameters:
        if settings and (stop or spent + expected > share):
            break
        start = time.perf_counter()
        setting = _measure_setting(benchmark, method, parameter, share - spent)
        elapsed = time.perf_counter() - start
        if not settings:  # what is compiled, or set up once for all settings, does not come again
            elapsed = min(elapsed, (REPEATS + 2) * setting.run_time)
        settings.append(setting)
        # the next setting takes twice as long: sizes double, tolerances fall by ten
        spent, expected = spent + elapsed, 2.0 * elapsed
    return settings


def _measure_setting(benchmark: Benchmark, method: Method, parameter: float, seconds: float) -> Setting:
    problem = method.prepare(parameter)
    times = []
    for _ in range(REPEATS + 1):
        start = time.perf_counter()
        result = method.solve(problem)
        times.append(time.perf_counter() - start)
        if sum(times[1:]) > seconds / 4:  # a long call is not repeated so often
            break
    errors = np.atleast_1d(np.asarray(method.errors(result, parameter), float))
    error = float(benchmark.statistic(errors, 0))
    return Setting(parameter, error, min(times), times[0], _peak_memory(method, problem))


def _peak_memory(method: Method, problem: Any) -> float:
    """Return the most bytes that one call had allocated at a time."""
    tracing = tracemalloc.is_tracing()
    if not tracing:
        tracemalloc.start(1)
    try:
        before = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        method.solve(problem)
        return float(max(0, tracemalloc.get_traced_memory()[1] - before))
    finally:
        if not tracing:
            tracemalloc.stop()


def _dataset(part: str, measured: Sequence[tuple[Benchmark, Method, list[Setting]]]) -> xr.Dataset:
    """Return what was measured of one part, labelled."""
    width = max(len(settings) for *_, settings in measured)
    columns = {name: np.full((len(measured), width), np.nan) for name in Setting._fields}
    for row, (*_, settings) in enumerate(measured):
        for name, values in columns.items():
            values[row, : len(settings)] = [getattr(setting, name) for setting in settings]
    plane = ("method", "setting")
    words = {
        "benchmark": [benchmark.name for benchmark, *_ in measured],
        "parameter_name": [method.parameter_name for _, method, _ in measured],
        "error_meaning": [benchmark.error_meaning for benchmark, *_ in measured],
        "truth": [benchmark.truth for benchmark, *_ in measured],
    }
    front = pareto_front([benchmark for benchmark, *_ in measured], columns)
    dataset = label(
        xr.Dataset(
            {name: (plane, values) for name, values in columns.items()} | {"on_pareto_front": (plane, front)},
            {"method": [method.name for _, method, _ in measured], "setting": np.arange(width)}
            | {name: ("method", values) for name, values in words.items()},
        )
    )
    for name in columns:
        dataset[name].attrs["reason"] = (
            "NaN: the method has no such setting, or its share of the budget was spent"
        )
    return stamp(dataset, WHERE, {"part": part}, title=f"Error against run time: {part}")


def pareto_front(compared: Sequence[Benchmark], columns: Mapping[str, Array]) -> Array:
    """Return where no setting of another method has a smaller error in a shorter time.

    Of a benchmark with `equal_parameters` settings of the same parameter are compared.
    """
    error, seconds, parameter = (columns[name] for name in ("error", "run_time", "parameter"))
    front = np.isfinite(error)
    for row, benchmark in enumerate(compared):
        others = [n for n, other in enumerate(compared) if other is benchmark and n != row]
        for column in np.flatnonzero(front[row]):
            is_better = (error[others] < error[row, column]) & (seconds[others] < seconds[row, column])
            if benchmark.equal_parameters:
                is_better &= parameter[others] == parameter[row, column]
            front[row, column] = not is_better.any()
    return front
