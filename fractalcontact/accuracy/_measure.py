"""True error against run time of every method, and which methods are dominated by others."""

from __future__ import annotations

import math
import time
import tracemalloc
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.accuracy._benchmarks import SUBPACKAGES, Benchmark, Method, benchmarks
from fractalcontact.base.errors import SmallStrainWarning
from fractalcontact.base.progress import track
from fractalcontact.base.provenance import stamp
from fractalcontact.base.schema import label
from fractalcontact.base.signals import Stop
from fractalcontact.base.validation import Problems, word_tuple

Array = np.ndarray[Any, np.dtype[Any]]

WHERE = "fractalcontact.accuracy.measure"
REPEATS, LATE_REPEATS = 3, 2
LATE_SHARE = 0.25  # of the budget, for timing all settings a second time
GROWTH, LARGEST_GROWTH = 2.0, 8.0  # of the time from one setting to the next, before it is known and at most

RESAMPLES = 1000  # of the bootstrap over the replicates of a random error
CONFIDENCE = 0.95
EQUAL_ERRORS = 1.01  # ratio of two errors that is no difference
LEAST_SCATTER = 0.1  # of the logarithm of a run time, also where the two timings agree

MEASURED = ("error", "run_time", "first_run_time", "memory")
ONLY, OPTIMAL, DOMINATED, UNDECIDED = "only method", "Pareto optimal", "dominated", "undecided"


@dataclass
class Setting:
    """What was measured of a method at one value of its parameter."""

    parameter: float
    replicates: Array
    error: float
    times: list[float]  # of the repeated calls, without the first
    first_run_time: float
    memory: float
    late_time: float | None = None  # shortest call after all methods were measured

    @property
    def run_time(self) -> float:
        """Return the shortest time of all calls."""
        late = [] if self.late_time is None else [self.late_time]
        return min([self.first_run_time, *self.times, *late])


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
        `verdict` (see Notes). `run_time_scatter`: standard deviation of the logarithm of a run time.

    Raises
    ------
    InvalidInput
        An unknown part, or a budget that is not positive.

    Notes
    -----
    "Clearly" means at 95 %. Random errors are compared by a bootstrap over their surfaces or masks, which
    are the same for all methods. Run times are compared by the scatter between two timings of each setting;
    the second follows when all methods were measured, and takes up to a quarter of the budget. A method is
    "dominated" if it was measured at all its settings, and at each another method is clearly better in both
    error and time. It is "Pareto optimal" if at one setting all others are clearly worse in one of the two,
    and none has a setting left that could be better. The "only method" of a benchmark is compared with none.
    Otherwise the verdict is "undecided": a larger budget or an idle machine can decide it.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> flow = [b for b in fc.accuracy.benchmarks("joints") if b.name == "checkerboard"]
    >>> measured = fc.accuracy.measure({"flow": flow}, budget=0.05)["flow"]
    >>> print(str(measured["verdict"].values[0]), bool(measured["error"][0, 0] < 0.1))
    only method True
    """
    with Problems(WHERE) as problems:
        _check_parts(problems, parts)
        problems.number("budget", budget, above=0)
        problems.boolean("progress", progress)
        problems.require(stop is None or isinstance(stop, Stop), "stop", "a Stop, or None", stop)
    if not isinstance(parts, Mapping):
        parts = {name: benchmarks(name) for name in (SUBPACKAGES if parts is None else word_tuple(parts))}
    curves = [
        (name, Curve(benchmark, method))
        for name, part in parts.items()
        for benchmark in part
        for method in benchmark.methods
    ]
    with warnings.catch_warnings():
        # the contact benchmarks are linear problems in units of their own: their slopes mean nothing
        warnings.simplefilter("ignore", SmallStrainWarning)
        _measure_curves([curve for _, curve in curves], (1.0 - LATE_SHARE) * budget, progress, stop)
        _time_again([curve for _, curve in curves], stop)
    tree = xr.DataTree()
    for name in parts:
        measured = [curve for part, curve in curves if part == name and curve.settings]
        if measured:
            tree[name] = xr.DataTree(_dataset(name, measured))
    parameters = {"parts": list(parts), "budget": budget}
    tree.attrs = stamp(xr.Dataset(), WHERE, parameters, title="Error against run time").attrs
    missing = "; ".join(curve.method.name for _, curve in curves if not curve.settings)
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


def _measure_curves(curves: Sequence[Curve], budget: float, progress: bool, stop: Stop | None) -> None:
    """Measure one curve after another; each has an even share of the time that is left."""
    end = time.perf_counter() + budget
    for number, curve in enumerate(track(curves, progress, "accuracy", unit="method")):
        if stop:
            return
        start = time.perf_counter()
        compile_time = _measure_curve(curve, (end - start) / (len(curves) - number), stop)
        end += min(compile_time, time.perf_counter() - start)


def _time_again(curves: Sequence[Curve], stop: Stop | None) -> None:
    """Time the settings that are compared once more, so that their scatter includes a change of the load."""
    for curve in curves:
        if len(curve.benchmark.methods) == 1:
            continue
        for setting in curve.settings:
            if stop:
                return
            problem = curve.method.prepare(setting.parameter)
            times = []
            for _ in range(LATE_REPEATS):
                start = time.perf_counter()
                curve.method.solve(problem)
                times.append(time.perf_counter() - start)
            setting.late_time = min(times)


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
    dataset["run_time_scatter"].attrs["reason"] = "NaN: no setting was timed a second time"
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
    """Return the standard deviation of the logarithm of a shortest run time, from a second timing of each.

    A second timing some time later differs by more than a repeated call, because the load of the machine
    changes. The median over all settings leaves out bursts that disturb a few of them by a large factor.
    """
    settings = [setting for curve in curves for setting in curve.settings]
    differences = [
        abs(math.log(setting.late_time / min(setting.times)))
        for setting in settings
        if setting.late_time is not None
    ]
    if not differences:
        return math.nan  # nothing was timed twice: no two times can be called different
    # the median of |difference| of two normal numbers is .6745 sqrt(2) standard deviations
    return max(LEAST_SCATTER, float(np.median(differences)) / (0.6745 * math.sqrt(2.0)))


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
        smaller = np.array([_clearly_smaller(errors, log_errors) for errors in log_errors])
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
            return ONLY
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
