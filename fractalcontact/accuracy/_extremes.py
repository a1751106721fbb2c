"""All extreme cases, each examined in a child process that is ended when it exceeds its time limit."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.accuracy._cases import Case, cases
from fractalcontact.accuracy._examine import Result, examine
from fractalcontact.base.errors import FractalContactError
from fractalcontact.base.progress import track
from fractalcontact.base.results import public_result
from fractalcontact.base.signals import Stop
from fractalcontact.base.validation import Problems, word_list


def _check(problems: Problems, *, names: Any, stop: Any) -> None:
    problems.require(stop is None or isinstance(stop, Stop), "stop", "a Stop, or None", stop)
    if isinstance(names, (list, tuple)):
        names = [item for item in names if not isinstance(item, Case)]
    if names is not None and not isinstance(names, Case):
        problems.choices("names", names, cases)


@public_result(title="Extreme cases", achieved_error="exact", check=_check)
def extremes(
    names: str | Case | Sequence[str | Case] | None = None,
    *,
    large: bool = False,
    progress: bool = False,
    stop: Stop | None = None,
) -> xr.Dataset:
    """Examine extreme cases, and return all results as one table.

    Parameters
    ----------
    names : str, Case, or sequence of them, optional
        Out of `cases`, or cases of your own whose `make` can be pickled. Default: all of `cases`.
    large : bool
        Include the cases that take minutes and gigabytes.
    progress : bool
        Show a progress bar.
    stop : Stop, optional
        Asked after each case. Once it is true the results so far are returned, and the attribute
        `completeness` names the cases that are missing.

    Returns
    -------
    Dataset over `result`
        case, quantity, expectation, outcome (text), value (NaN where the outcome is text), error, run_time
        (s) and passed. A case that exceeds its time limit, or ends its process, has one failed result.

    Raises
    ------
    InvalidInput
        A name is unknown.

    Notes
    -----
    The cases are examined one after another in a child process. After a case that hangs or crashes a new
    process continues with the next one.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> results = fc.accuracy.extremes("one cell")
    >>> print(results["passed"].values.all())
    True
    """
    chosen = _chosen(names, large)
    results: dict[str, list[Result]] = {}
    for case, outcome in track(_examine_apart(chosen), progress, "extremes", unit="case", total=len(chosen)):
        if not isinstance(outcome, str):
            results[case.name] = outcome
        elif not stop:  # a signal from the terminal ends the child as well: that is no failure of the case
            results[case.name] = [Result("all", None, outcome, False, case.time_limit)]
        if stop:
            break
    dataset = _table(results)
    missing = "; ".join(case.name for case in chosen if case.name not in results)
    if missing:
        dataset.attrs["completeness"] = f"partial: the run was stopped; missing: {missing}"
    return dataset


def _chosen(names: Any, large: bool) -> list[Case]:
    if names is None:
        return [case for case in cases.values() if large or not case.large]
    items = [names] if isinstance(names, Case) else word_list(names)
    return [item if isinstance(item, Case) else cases[item] for item in items]


def _table(results: dict[str, list[Result]]) -> xr.Dataset:
    rows = [(name, result) for name, group in results.items() for result in group]
    columns = {
        "case": [name for name, _ in rows],
        "quantity": [result.name for _, result in rows],
        "expectation": [_expectation(result.expected) for _, result in rows],
        "outcome": [result.got if isinstance(result.got, str) else f"{result.got:.6g}" for _, result in rows],
        "value": [np.nan if isinstance(result.got, str) else result.got for _, result in rows],
        "error": [result.error for _, result in rows],
        "run_time": [result.run_time for _, result in rows],
        "passed": [result.passed for _, result in rows],
    }
    dataset = xr.Dataset({name: ("result", np.array(values)) for name, values in columns.items()})
    dataset["error"].attrs["comment"] = "NaN where only a finite number or a reason was expected"
    return dataset.assign_coords(result=np.arange(len(rows)))


def _expectation(expected: object) -> str:
    if expected is None:
        return ""
    if isinstance(expected, tuple):
        return f"{expected[0]:g} ... {expected[1]:g}"
    return expected if isinstance(expected, str) else f"{expected:g}"


# ---------------------------------------------------------------------------------------------------------
# The child process. An executor of concurrent.futures has no way to end a task that hangs.


def _examine_apart(chosen: Sequence[Case]) -> Iterator[tuple[Case, list[Result] | str]]:
    """Yield each case with its results, or with the reason why there are none."""
    context = multiprocessing.get_context("spawn")
    process: Any = None
    try:
        for case in chosen:
            if process is None:
                connection, other_end = context.Pipe()
                process = context.Process(target=_serve, args=(other_end,), daemon=True)
                process.start()
                other_end.close()
                _wait_for_start(connection)
            connection.send(case)
            outcome: list[Result] | str
            try:
                in_time = connection.poll(case.time_limit)
                outcome = connection.recv() if in_time else f"hung: ended after {case.time_limit:g} s"
            except EOFError:
                process.join()
                outcome = f"its process ended with code {process.exitcode}"
            if isinstance(outcome, str):
                process.kill()
                process.join()
                process = None
            yield case, outcome
    finally:
        if process is not None:
            process.kill()


def _wait_for_start(connection: Connection) -> None:
    """Wait until the child process has started, which does not count for the time of a case."""
    try:
        connection.recv()
    except EOFError as error:
        remedy = 'a script that calls this needs `if __name__ == "__main__":` around the call'
        raise FractalContactError(
            f"fractalcontact.accuracy: no process could be started: {remedy}"
        ) from error


def _serve(connection: Connection) -> None:
    """Examine the cases that arrive, until the parent ends the process."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    threading.Thread(target=_exit_with_parent, daemon=True).start()
    connection.send(None)
    while True:
        connection.send(examine(connection.recv()))


def _exit_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
    os._exit(1)
