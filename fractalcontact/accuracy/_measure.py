"""True error against run time of every method, and which methods are dominated by others."""

from __future__ import annotations

import math
import time
import tracemalloc
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.accuracy._benchmarks import SUBPACKAGES, Benchmark, Method, benchmarks
from fractalcontact.base.progress import track
from fractalcontact.base.provenance import stamp
from fractalcontact.base.schema import label
from fractalcontact.base.signals import Stop
from fractalcontact.base.validation import Problems, word_tuple

Array = np.ndarray[Any, np.dtype[Any]]

WHERE = "fractalcontact.accuracy.measure"
REPEATS = 3
GROWTH, LARGEST_GROWTH = 2.0, 8.0  # of the time from one setting to the next, before it is known and at most

RESAMPLES = 1000  # of the bootstrap over the replicates of a random error
CONFIDENCE = 0.95
EQUAL_ERRORS = 1.01  # ratio of two errors that is no difference
LEAST_SCATTER = 0.1  # of the logarithm of a run time, also where repeats agree: they follow each other

MEASURED = ("error", "run_time", "first_run_time", "memory")
ALONE, OPTIMAL, DOMINATED, UNDECIDED = "alone", "Pareto optimal", "dominated", "undecided"


@dataclass
class Setting:
    """What was measured of a method at one value of its parameter."""

    parameter: float
    replicates: Array
    error: float
    times: list[float]  # of the repeated calls, without the first
    first_run_time: float
    memory: float

    @property
    def run_time(self) -> float:
        """Return the shortest time of all calls."""
        return min(self.first_run_time, *self.times)


@dataclass
class Curve:
    """The settings of one method that fitted into the budget."""

    benchmark: Benchmark
    method: Method
    settings: list[Setting] = field(default_factory=list)

    @property
    def complete(self) -> bool:
        """Return whether every parameter of the method was measured."""
        return len(self.settings) == len(self.method.parameters)


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
        `on_pareto_front`: no other method of the benchmark is clearly better in both error and time. Over
        `method`: `benchmark`, `parameter_name`, `error_meaning`, `truth`, `share_on_pareto_front` and
        `verdict` (see Notes). `run_time_scatter`: scatter of the logarithm of repeated run times.

    Raises
    ------
    InvalidInput
        An unknown part, or a budget that is not positive.

    Notes
    -----
    "Clearly" means at 95 %. Random errors are compared by a bootstrap over their surfaces or masks, which
    are the same for all methods; run times by their scatter in this run. A method is "dominated" if it was
    measured at all its settings and at each another method is clearly better in both error and time. It is
    "Pareto optimal" if at one setting all others are clearly worse in one of the two, and none has a setting
    left that could be better. Otherwise the verdict is "undecided": a larger budget can decide it.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> flow = [b for b in fc.accuracy.benchmarks("joints") if b.name == "checkerboard"]
    >>> measured = fc.accuracy.measure({"flow": flow}, budget=0.05)["flow"]
    >>> print(str(measured["verdict"].values[0]), bool(measured["error"][0, 0] < 0.1))
    alone True
    """
    with Problems(WHERE) as problems:
        if isinstance(parts, Mapping):
            valid = all(isinstance(item, Benchmark) for part in parts.values() for item in part)
            problems.require(valid, "parts", "sequences of Benchmark in a mapping", parts)
        elif parts is not None:
            problems.choices("parts", parts, SUBPACKAGES)
        problems.number("budget", budget, above=0)
    if not isinstance(parts, Mapping):
        parts = {name: benchmarks(name) for name in word_tuple(parts) or SUBPACKAGES}
    measured: dict[str, list[Curve]] = {name: [] for name in parts}
    pending = [
        (name, Curve(benchmark, method))
        for name, part in parts.items()
        for benchmark in part
        for method in benchmark.methods
    ]
    end = time.perf_counter() + budget
    missing = [curve.method.name for _, curve in pending]
    for name, curve in track(pending, progress, "accuracy", unit="method"):
        if stop:
            break
        start = time.perf_counter()
        share = (end - start) / len(missing)
        compile_time = _measure_curve(curve, share, stop)
        end += min(compile_time, time.perf_counter() - start)
        measured[name].append(curve)
        del missing[0]
    tree = xr.DataTree()
    for name, curves in measured.items():
        if curves:
            tree[name] = xr.DataTree(_dataset(name, curves))
    parameters = {"parts": list(parts), "budget": budget}
    tree.attrs = stamp(xr.Dataset(), WHERE, parameters, title="Error against run time").attrs
    if missing:
        tree.attrs["completeness"] = f"partial: the run was stopped; missing: {'; '.join(missing)}"
    return tree


def _measure_curve(curve: Curve, share: float, stop: Stop | None) -> float:
    """Measure the settings that fit into a share of seconds; return the seconds of compiling."""
    spent, expected, compile_time = 0.0, 0.0, 0.0
    for parameter in curve.method.parameters:
        if curve.settings and (stop or spent + expected > share):
            break
        start = time.perf_counter()
        setting = _measure_setting(curve, parameter, share - spent)
        elapsed = time.perf_counter() - start
        if not curve.settings:
            compile_time = max(0.0, setting.first_run_time - setting.run_time)
            elapsed -= compile_time
            # what is set up once, such as the exact solution, does not come again
            expected = GROWTH * (REPEATS + 2) * setting.run_time
        else:
            growth = setting.run_time / curve.settings[-1].run_time
            expected = min(max(growth, 1.0), LARGEST_GROWTH) * elapsed
        curve.settings.append(setting)
        spent += elapsed
    return compile_time


def _measure_setting(curve: Curve, parameter: float, seconds: float) -> Setting:
    method = curve.method
    problem = method.prepare(parameter)
    times = []
    for number in range(REPEATS + 1):
        start = time.perf_counter()
        result = method.solve(problem)
        times.append(time.perf_counter() - start)
        if number and sum(times[1:]) > seconds / 4:
            break
    replicates = np.atleast_1d(np.asarray(method.errors(result, parameter), float))
    error = float(curve.benchmark.statistic(replicates, 0))
    return Setting(parameter, replicates, error, times[1:], times[0], _peak_memory(method, problem))


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


def _dataset(name: str, curves: list[Curve]) -> xr.Dataset:
    """Return what was measured of one part, labelled."""
    width = max(len(curve.settings) for curve in curves)
    columns = {key: np.full((len(curves), width), np.nan) for key in (*MEASURED, "parameter")}
    for row, curve in enumerate(curves):
        for column, setting in enumerate(curve.settings):
            for key, values in columns.items():
                values[row, column] = getattr(setting, key)
    scatter = _run_time_scatter(curves)
    on_front = np.zeros((len(curves), width), bool)
    verdicts = [""] * len(curves)
    for rows in _rows_by_benchmark(curves):
        comparison = Comparison([curves[row] for row in rows], scatter)
        for row, front, verdict in zip(rows, comparison.fronts(), comparison.verdicts(), strict=True):
            on_front[row, : len(front)] = front
            verdicts[row] = verdict
    counts = np.array([len(curve.settings) for curve in curves])
    plane = ("method", "setting")
    words = {
        "benchmark": [curve.benchmark.name for curve in curves],
        "parameter_name": [curve.method.parameter_name for curve in curves],
        "error_meaning": [curve.benchmark.error_meaning for curve in curves],
        "truth": [curve.benchmark.truth for curve in curves],
    }
    dataset = label(
        xr.Dataset(
            {key: (plane, values) for key, values in columns.items()}
            | {
                "on_pareto_front": (plane, on_front),
                "share_on_pareto_front": ("method", on_front.sum(axis=1) / np.maximum(counts, 1)),
                "verdict": ("method", verdicts),
                "run_time_scatter": scatter,
            },
            coords={"method": [curve.method.name for curve in curves], "setting": np.arange(width)}
            | {key: ("method", values) for key, values in words.items()},
        )
    )
    for key in columns:
        dataset[key].attrs["reason"] = (
            "NaN: the method has no such setting, or its share of the budget was spent"
        )
    return stamp(dataset, WHERE, {"part": name}, title=f"Error against run time: {name}")


def _rows_by_benchmark(curves: list[Curve]) -> Iterator[list[int]]:
    names = [curve.benchmark.name for curve in curves]
    for name in dict.fromkeys(names):
        yield [row for row, other in enumerate(names) if other == name]


def _run_time_scatter(curves: list[Curve]) -> float:
    """Return the standard deviation of the logarithm of a repeated run time, the median over all settings.

    The median, because a burst of other load on the machine disturbs a few settings by a large factor. On two
    cores with seven busy processes it was .1 to .4; the shortest times of three runs differed by .19 to .26.
    """
    repeated = [setting.times for curve in curves for setting in curve.settings if len(setting.times) > 1]
    if not repeated:
        return math.nan  # no time was repeated: no two times can be called different
    return max(LEAST_SCATTER, float(np.median([np.std(np.log(times), ddof=1) for times in repeated])))


class Comparison:
    """Pairwise comparison of the settings of the methods of one benchmark, at 95 % confidence.

    Two settings compare only if they belong to different methods, and, in a benchmark of equal parameters, if
    their parameters are equal.
    """

    def __init__(self, curves: list[Curve], scatter: float) -> None:
        self.curves = curves
        self.benchmark = curves[0].benchmark
        settings = [setting for curve in curves for setting in curve.settings]
        counts = [len(curve.settings) for curve in curves]
        self.owner = np.repeat(np.arange(len(curves)), counts)
        self.ends = np.cumsum(counts)[:-1]
        self.parameter = np.array([setting.parameter for setting in settings])
        self.errors = np.array([setting.error for setting in settings])
        self.log_time = np.log([setting.run_time for setting in settings])
        # of a difference of two logarithms of times: the normal quantile times sqrt(2) times the scatter
        self.time_margin = 1.96 * math.sqrt(2.0) * scatter
        log_errors = np.array([_bootstrap_log_errors(setting, self.benchmark) for setting in settings])
        compares = self.owner[:, None] != self.owner
        if self.benchmark.equal_parameters:
            compares &= self.parameter[:, None] == self.parameter
        quicker = self._quicker(self.log_time[:, None], self.log_time)
        smaller = np.array([_clearly_smaller(one, log_errors) for one in log_errors])
        self.beaten = (compares & quicker & smaller).any(axis=0)
        # all settings that compare are clearly worse, in error or in time
        self.unbeaten = (~compares | quicker | smaller).all(axis=1)

    def _quicker(self, log_time: Any, other: Any) -> Any:
        return log_time + self.time_margin < other

    def fronts(self) -> list[Array]:
        """Return for each method, by setting, whether no other method is clearly better in error and time."""
        return np.split(~self.beaten & np.isfinite(self.errors), self.ends)

    def verdicts(self) -> list[str]:
        """Return the verdict on each method."""
        return [self._verdict(number, curve) for number, curve in enumerate(self.curves)]

    def _verdict(self, number: int, curve: Curve) -> str:
        if len(self.benchmark.methods) == 1:
            return ALONE
        mine = np.flatnonzero(self.owner == number).tolist()
        if any(self.unbeaten[place] and self._is_final(place) for place in mine):
            return OPTIMAL
        return DOMINATED if curve.complete and self.beaten[mine].all() else UNDECIDED

    def _is_final(self, place: int) -> bool:
        """Whether no setting that is not measured yet could be better: it would have to be quicker.

        In the order of growing cost a setting to come takes longer than the last one that was measured.
        """
        measured = {curve.method.name: number for number, curve in enumerate(self.curves)}
        for method in self.benchmark.methods:
            number = measured.get(method.name)
            if number == self.owner[place]:
                continue
            if number is None:
                return False
            theirs = self.owner == number
            if self.benchmark.equal_parameters:
                parameter = self.parameter[place]
                if parameter in method.parameters and parameter not in self.parameter[theirs]:
                    return False
            elif not self.curves[number].complete and not self._quicker(
                self.log_time[place], self.log_time[theirs].max()
            ):
                return False
        return True


def _bootstrap_log_errors(setting: Setting, benchmark: Benchmark) -> Array:
    """Return the logarithm of the error of resampled replicates, (RESAMPLES,).

    The resamples depend on the number of replicates only, so that two methods on the same surfaces are
    compared surface by surface.
    """
    count = len(setting.replicates)
    if count == 1:
        return np.full(RESAMPLES, np.log(max(setting.error, np.finfo(float).tiny)))
    index = np.random.default_rng(count).integers(count, size=(RESAMPLES, count))
    errors = benchmark.statistic(setting.replicates[index], 1)
    return np.asarray(np.log(np.maximum(errors, np.finfo(float).tiny)))


def _clearly_smaller(log_errors: Array, others: Array) -> Array:
    """Return for each of the other settings whether the error of this one is smaller at 95 % confidence."""
    differences = np.quantile(log_errors - others, 0.5 + CONFIDENCE / 2, axis=1)
    return np.asarray(differences < -math.log(EQUAL_ERRORS))
