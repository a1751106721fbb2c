"""True error against run time: each method over its own knob, against a truth it did not compute."""

from __future__ import annotations

import importlib
import time
import tracemalloc
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.base.checks import Problems
from fractalcontact.base.progress import track
from fractalcontact.base.provenance import stamp
from fractalcontact.base.schema import label

if TYPE_CHECKING:
    import xarray as xr

    from fractalcontact.accuracy.trials.trial import Contest, Experiment
    from fractalcontact.base.signals import Stop

WHERE = "fractalcontact.accuracy.measure"
PARTS = ("surfaces", "dimensions", "contact", "domains", "joints")
REPEATS = 3
GROWTH, MOST = 2.0, 8.0  # of the time from one setting to the next, before it is known and at most
NOISE = 1.1  # ratio of two run times that is no difference
MEASURED = ("error", "run_time", "first_run_time", "memory")

Found = dict[float, dict[str, float]]


def measure(
    parts: Sequence[str] | str | None = None,
    *,
    budget: float = 60.0,
    progress: bool = False,
    stop: Stop | None = None,
) -> xr.DataTree:
    """Measure true error against run time and memory.

    Parameters
    ----------
    parts : str or sequence of str, optional
        Out of "surfaces", "dimensions", "contact", "domains", "joints"; None: all of them.
    budget : float
        Seconds for the whole. What is left is shared evenly by the methods still to come, and a method is
        turned up until its share is spent, so that a larger budget shows more of each curve. Every method is
        measured at one setting at least, and the time of compiling is not counted.
    progress : bool
        Show a bar.
    stop : Stop, optional
        Asked before each setting (`fractalcontact.base.signals.noted`): once it is true, what there is by
        then is returned, and the attribute `completeness` names the methods that are missing.

    Returns
    -------
    DataTree
        A group for each part, over (method, setting): `error`, `run_time` (s, least of three runs),
        `first_run_time` (s, with compilation), `memory` (byte, most that was allocated at a time, measured
        in a run of its own), `knob` and `on_frontier`: no other method of the same contest came as near in
        as little time. NaN (see `reason`) where the budget ended. Over `method`: `contest`, `knob_name`,
        `error_meaning`, `truth`, and `share_on_frontier`, which is 0 for a method never worth choosing.

    Raises
    ------
    InvalidInput
        An unknown part, or a budget that is not positive.

    Notes
    -----
    Memory is that of arrays and Python objects; what a transform library works in is not seen.

    The type of number is no knob: results are float64 throughout. A large free contact begins in single
    precision of its own accord, and ends at the same tolerance.
    """
    import xarray as xr

    with Problems(WHERE) as problems:
        names = PARTS if parts is None else problems.choices("parts", parts, PARTS)
        problems.number("budget", budget, above=0)
    end = time.perf_counter() + budget
    sets = {name: contests(name) for name in names}
    left = sum(len(one.experiments) for part in sets.values() for one in part)
    every = [(name, one) for name, part in sets.items() for contest in part for one in contest.experiments]
    found: dict[str, dict[str, Found]] = {name: {} for name in sets}
    for name, experiment in track(every, progress, "accuracy", unit="method"):
        if stop:
            break
        share = (end - time.perf_counter()) / left
        compiled = time.perf_counter()
        found[name][experiment.method], idle = _turned_up(experiment, share, stop)
        end += min(idle, time.perf_counter() - compiled)
        left -= 1
    tree = xr.DataTree()
    for name, part in sets.items():
        if found[name]:
            tree[name] = xr.DataTree(_labelled(name, part, found[name]))
    tree.attrs = stamp(
        xr.Dataset(), WHERE, {"parts": list(names), "budget": budget}, title="Error against run time"
    ).attrs
    if left:
        missing = [one.method for name, one in every if one.method not in found[name]]
        tree.attrs["completeness"] = f"partial: the run was stopped; missing: {'; '.join(missing)}"
    return tree


def contests(part: str) -> tuple[Contest, ...]:
    """Return what is measured in one room."""
    found: tuple[Contest, ...] = importlib.import_module(f"fractalcontact.accuracy.trials.{part}").contests()
    return found


def _turned_up(experiment: Experiment, share: float, stop: Stop | None) -> tuple[Found, float]:
    """Return what was measured at every knob that fits into the share of seconds, and that of compiling."""
    found: Found = {}
    spent, expected, idle = 0.0, 0.0, 0.0
    for knob in experiment.knobs:
        if found and (stop or spent + expected > share):
            break
        start = time.perf_counter()
        told = _measured(experiment, knob, share - spent)
        whole = time.perf_counter() - start
        if not found:  # the first call of all compiles
            idle = max(0.0, told["first_run_time"] - told["run_time"])
            whole -= idle
        before = [one["run_time"] for one in found.values()][-1:]
        growth = min(max(told["run_time"] / before[0], 1.0), MOST) if before else GROWTH
        # what is set up once, such as the exact solution, does not come again
        expected = growth * (whole if found else (REPEATS + 2) * told["run_time"])
        found[knob] = told
        spent += whole
    return found, idle


def _measured(experiment: Experiment, knob: float, room: float) -> dict[str, float]:
    """Return what came at one setting."""
    case = experiment.prepare(knob)
    times = []
    for number in range(REPEATS + 1):
        start = time.perf_counter()
        result = experiment.solve(case)
        times.append(time.perf_counter() - start)
        if number and sum(times[1:]) > room / 4:
            break
    told = {"error": experiment.error(result, knob), "run_time": min(times), "first_run_time": times[0]}
    return told | {"memory": _peak(experiment, case)}


def _peak(experiment: Experiment, case: Any) -> float:
    """Return the most that one call had allocated at a time, in bytes."""
    running = tracemalloc.is_tracing()
    if not running:
        tracemalloc.start(1)
    try:
        before = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        experiment.solve(case)
        return float(max(0, tracemalloc.get_traced_memory()[1] - before))
    finally:
        if not running:
            tracemalloc.stop()


def _labelled(name: str, part: tuple[Contest, ...], found: dict[str, Found]) -> xr.Dataset:
    import xarray as xr

    entries = [(contest, one) for contest in part for one in contest.experiments if one.method in found]
    methods = [one.method for _, one in entries]
    width = max(len(one) for one in found.values())
    columns = {key: np.full((len(methods), width), np.nan) for key in (*MEASURED, "knob")}
    for row, method in enumerate(methods):
        for column, (knob, told) in enumerate(found[method].items()):
            columns["knob"][row, column] = knob
            for key in MEASURED:
                columns[key][row, column] = told[key]
    frontier = on_frontier(
        columns["error"],
        columns["run_time"],
        [contest.name for contest, _ in entries],
        np.where([[contest.given] for contest, _ in entries], columns["knob"], 0.0),
    )
    counted = np.isfinite(columns["error"]).sum(axis=1)
    plane = ("method", "setting")
    words = {
        "contest": [contest.name for contest, _ in entries],
        "knob_name": [one.knob for _, one in entries],
        "error_meaning": [contest.error for contest, _ in entries],
        "truth": [contest.truth for contest, _ in entries],
    }
    dataset = label(
        xr.Dataset(
            {key: (plane, values) for key, values in columns.items()}
            | {
                "on_frontier": (plane, frontier),
                "share_on_frontier": ("method", frontier.sum(axis=1) / np.maximum(counted, 1)),
            },
            coords={"method": methods, "setting": np.arange(width)}
            | {key: ("method", values) for key, values in words.items()},
        )
    )
    for key in (*MEASURED, "knob"):
        dataset[key].attrs["reason"] = (
            "NaN: the method has no such setting, or its share of the budget was spent"
        )
    return stamp(dataset, WHERE, {"part": name}, title=f"Error against run time: {name}")


def on_frontier(
    error: np.ndarray[Any, Any],
    seconds: np.ndarray[Any, Any],
    contest: Sequence[str],
    given: np.ndarray[Any, Any],
) -> np.ndarray[Any, Any]:
    """Whether no other method of the contest has a smaller error in less time; shapes (method, setting).

    Only settings with the same `given` are compared. Times within a tenth of each other are equal.
    """
    found = np.isfinite(error)
    for row, column in np.argwhere(found):
        rivals = [k for k, name in enumerate(contest) if name == contest[row] and k != row]
        better = (error[rivals] < error[row, column]) & (NOISE * seconds[rivals] < seconds[row, column])
        better &= given[rivals] == given[row, column]
        found[row, column] = not better.any()
    return np.asarray(found)
