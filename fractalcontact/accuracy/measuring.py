"""True error against run time: each method over its own knob, against a truth it did not compute."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fractalcontact.accuracy import experiments
from fractalcontact.base.checks import Problems
from fractalcontact.base.provenance import stamp
from fractalcontact.base.schema import label

if TYPE_CHECKING:
    import xarray as xr

WHERE = "fractalcontact.accuracy.measure"
REPEATS = 3


def measure(parts: Sequence[str] | str | None = None, *, budget: float = 60.0) -> xr.DataTree:
    """Measure true error against run time.

    Parameters
    ----------
    parts : str or sequence of str, optional
        Out of "surfaces", "dimensions", "contact", "domains", "joints"; None: all of them.
    budget : float
        Seconds for the whole, shared evenly by the methods. A method is turned up until its share is
        spent, so that a larger budget shows more of each curve.

    Returns
    -------
    DataTree
        A group for each part with `error`, `run_time` (s, least of three runs) and `first_run_time` (s,
        with compilation) over (method, knob); NaN (see `reason`) where the budget ended. The meaning of
        the knob, of the error and of the truth are attributes of `error`.

    Raises
    ------
    InvalidInput
        An unknown part, or a budget that is not positive.
    """
    import xarray as xr

    with Problems(WHERE) as problems:
        names = (
            tuple(experiments.PARTS) if parts is None else problems.choices("parts", parts, experiments.PARTS)
        )
        problems.number("budget", budget, above=0)
    sets = {name: experiments.PARTS[name]() for name in names}
    share = budget / sum(len(one.experiments) for one in sets.values())
    tree = xr.DataTree.from_dict({f"/{name}": _measured(name, one, share) for name, one in sets.items()})
    tree.attrs = stamp(
        xr.Dataset(), WHERE, {"parts": list(names), "budget": budget}, title="Error against run time"
    ).attrs
    return tree


def _measured(name: str, part: experiments.Part, share: float) -> xr.Dataset:
    import xarray as xr

    knobs = sorted({knob for one in part.experiments for knob in one.knobs})
    methods = [one.method for one in part.experiments]
    blank = np.full((len(methods), len(knobs)), np.nan)
    columns = {key: blank.copy() for key in ("error", "run_time", "first_run_time")}
    for row, one in enumerate(part.experiments):
        for knob, (error, seconds, first) in _turned_up(one, share).items():
            place = row, knobs.index(knob)
            columns["error"][place], columns["run_time"][place], columns["first_run_time"][place] = (
                error,
                seconds,
                first,
            )
    dataset = xr.Dataset(
        {key: (("method", "knob"), values) for key, values in columns.items()},
        coords={"method": methods, "knob": np.asarray(knobs, dtype=float)},
    )
    dataset = label(dataset)
    for key in columns:
        dataset[key].attrs["reason"] = (
            "NaN: not a setting of this method, or its share of the budget was spent"
        )
    dataset["error"].attrs.update(knob=part.knob, error=part.error, truth=part.truth)
    facts: dict[str, Any] = {"share": share}
    return stamp(dataset, WHERE, {"part": name}, title=f"Error against run time: {name}", **facts)


def _turned_up(experiment: experiments.Experiment, share: float) -> dict[float, tuple[float, float, float]]:
    """Return error, least and first run time for every knob that fits into the share of seconds.

    The first call of all may compile; its time is told, and not counted against the share.
    """
    found: dict[float, tuple[float, float, float]] = {}
    spent, last = 0.0, 0.0
    for knob in experiment.knobs:
        if found and spent + 2.0 * last > share:
            break
        case = experiment.prepare(knob)
        times = []
        for _ in range(REPEATS if found else REPEATS + 1):
            start = time.perf_counter()
            result = experiment.solve(case)
            times.append(time.perf_counter() - start)
            if spent + sum(times[1:]) > share:
                break
        found[knob] = experiment.error(result, knob), min(times), times[0]
        last = sum(times[1:]) if len(found) == 1 else sum(times)
        spent += last
    return found
