"""Results of this subpackage as text tables."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.tables import table
from fractalcontact.base.validation import NONE, Problems

Row = tuple[str, ...]
Columns = Mapping[str, tuple[tuple[str, ...], str]]
SUMMARY, WORST = "fractalcontact.accuracy.summary", "fractalcontact.accuracy.worst_results"
WORDS, NUMBERS, TRUTH = "words", "numbers", "truth values"
KINDS = {WORDS: "UT", NUMBERS: "iuf", TRUTH: "b"}
_SETTING, _METHOD, _RESULT = ("method", "setting"), ("method",), ("result",)
_CASE = ("method", "family", "hurst", "size")
# dims and type of the variables that are read, of `measure`, `estimators` and `extremes`
MEASURED: Columns = {
    **dict.fromkeys(("parameter", "error", "run_time", "first_run_time", "memory"), (_SETTING, NUMBERS)),
    **dict.fromkeys(("benchmark", "parameter_name", "error_meaning", "truth", "verdict"), (_METHOD, WORDS)),
    "on_pareto_front": (_SETTING, TRUTH),
    "method": (_METHOD, WORDS),
}
ESTIMATED: Columns = {
    **dict.fromkeys(("bias", "error_ratio", "interval_coverage", "run_time"), (_CASE, NUMBERS)),
    "least_error": (_CASE[1:], NUMBERS),
    **dict.fromkeys(("member_count", "size"), (("size",), NUMBERS)),
    "hurst": (("hurst",), NUMBERS),
    "family": (("family",), WORDS),
    "method": (_METHOD, WORDS),
}
RANKED: Columns = {
    "case": (_RESULT, WORDS),
    **dict.fromkeys(("error", "run_time"), (_RESULT, NUMBERS)),
    "passed": (_RESULT, TRUTH),
}
EXAMINED: Columns = {
    **RANKED,
    **dict.fromkeys(("quantity", "expectation", "outcome"), (_RESULT, WORDS)),
}


def summary(results: Any) -> str:
    """Return a result of `measure`, `estimators` or `extremes` as a text table.

    Parameters
    ----------
    results : DataTree or Dataset

    Returns
    -------
    str

    Raises
    ------
    InvalidInput
        It is no such result.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> bench = fc.accuracy.estimators(0.5, 16, "fbm", "increments", members=4, rng=1)
    >>> print(fc.accuracy.summary(bench).splitlines()[2])
    fbm, 16 x 16 points, 4 surfaces
    """
    if isinstance(results, xr.DataTree) and results.children:
        for part, node in results.children.items():
            _check(SUMMARY, f"results/{part}", node.to_dataset(), MEASURED)
        return _measured_summary(results)
    if isinstance(results, xr.Dataset) and "error_ratio" in results:
        _check(SUMMARY, "results", results, ESTIMATED)
        return _estimators_summary(results)
    if isinstance(results, xr.Dataset) and "expectation" in results:
        _check(SUMMARY, "results", results, EXAMINED)
        return _extremes_summary(results)
    expected = "a result of measure, estimators or extremes"
    raise InvalidInput(SUMMARY, [f"results: expected {expected}, got {type(results).__name__}"])


def _check(where: str, argument: str, results: xr.Dataset, columns: Columns) -> None:
    """Check that a result has the variables that are read, with their dims and types."""
    with Problems(where) as problems:
        for name, (dims, what) in columns.items():
            place = f"{argument}.{name}"
            if problems.require(name in results.variables, place, f"{what} over {', '.join(dims)}", NONE):
                own = results.variables[name]
                problems.require(set(own.dims) == set(dims), place, f"dims {dims}", own.dims)
                is_text = own.dtype.kind == "O" and all(isinstance(value, str) for value in own.values.flat)
                kind = "U" if is_text else own.dtype.kind  # words of a file have the type object
                problems.require(kind in KINDS[what], place, what, f"type {own.dtype}")


def _measured_summary(measured: xr.DataTree) -> str:
    parts = []
    for part, node in measured.children.items():
        data = node.to_dataset()
        names = data["benchmark"].values
        for name in dict.fromkeys(names.tolist()):
            benchmark = data.isel(method=names == name)
            meaning, truth = (benchmark[key].values[0] for key in ("error_meaning", "truth"))
            parts.append(f"{part}, {name}: {meaning}\nagainst {truth}\n{table(_curve_rows(benchmark))}")
    head: Row = ("subpackage", "benchmark", "method", "verdict", "on Pareto front", "least error", "in")
    verdicts = [head, *(row for part, node in measured.children.items() for row in _verdict_rows(part, node))]
    return "\n\n".join([*parts, table(verdicts)])


def _curve_rows(benchmark: xr.Dataset) -> list[Row]:
    """Return error, seconds and memory of every method at every setting; a star marks the Pareto front."""
    parameter = str(benchmark["parameter_name"].values[0])
    rows: list[Row] = [("method", parameter, "error", "seconds", "first call", "memory", "Pareto front")]
    for method in benchmark["method"].values:
        row = benchmark.sel({"method": method})
        rows += [
            (
                str(method),
                f"{float(row['parameter'][k]):g}",
                f"{float(row['error'][k]):.3g}",
                f"{float(row['run_time'][k]):.2e}",
                f"{float(row['first_run_time'][k]):.2e}",
                f"{float(row['memory'][k]) / 1e6:.3g} MB",
                "*" if bool(row["on_pareto_front"][k]) else "",
            )
            for k in range(row.sizes["setting"])
            if np.isfinite(row["error"][k])
        ]
    return rows


def _verdict_rows(part: str, node: xr.DataTree) -> Iterator[Row]:
    data = node.to_dataset()
    for method in data["method"].values:
        row = data.sel({"method": method})
        count = int(np.isfinite(row["error"]).sum())
        if not count:
            continue
        best = int(np.nanargmin(row["error"].values))
        yield (
            part,
            str(row["benchmark"].values),
            str(method),
            str(row["verdict"].values),
            f"{int(row['on_pareto_front'].sum())} of {count}",
            f"{float(row['error'][best]):.2g}",
            f"{float(row['run_time'][best]):.2g} s",
        )


def _estimators_summary(bench: xr.Dataset) -> str:
    """Return a block for each family and size, with a column for each exponent."""
    blocks = ["bias of H, root mean square error over the Cramer-Rao bound, coverage of the 95 % interval"]
    for family in bench["family"].values:
        for size, members in zip(bench["size"].values, bench["member_count"].values, strict=True):
            block = bench.sel(family=family, size=size)
            bounds = ", ".join(f"{value:.2g}" for value in block["least_error"].values)
            rows: list[Row] = [("method", *(f"H = {hurst:g}" for hurst in block["hurst"].values), "seconds")]
            for method in block["method"].values:
                row = block.sel({"method": method})
                columns = (row[name].values for name in ("bias", "error_ratio", "interval_coverage"))
                cells = [_estimator_cell(*values) for values in zip(*columns, strict=True)]
                # the run time of the median exponent
                rows.append((str(method), *cells, f"{float(row['run_time'].median()):.1e}"))
            head = f"{family}, {size} x {size} points, {members} surfaces\nCramer-Rao bounds {bounds}"
            blocks.append(f"{head}\n{table(rows)}")
    return "\n\n".join(blocks)


def _estimator_cell(bias: float, ratio: float, coverage: float) -> str:
    ratio_text = f"{ratio:.2f}" if ratio < 9.995 else f"{ratio:.0f}"
    return f"{bias:+.3f} {ratio_text} {f'{coverage:.3f}' if np.isfinite(coverage) else 'none'}"


def _extremes_summary(results: xr.Dataset) -> str:
    rows: list[Row] = [("case", "function and quantity", "expected", "got", "error", "seconds", "")]
    names = ("case", "quantity", "expectation", "outcome", "error", "run_time", "passed")
    for case, quantity, expected, outcome, error, seconds, passed in zip(
        *(results[name].values for name in names), strict=True
    ):
        error_text = "" if np.isnan(error) else f"{error:.1e}"
        mark = "" if passed else "FAILED"
        rows.append((case, quantity, expected, outcome[:60], error_text, f"{seconds:.3f}", mark))
    failed, count = (
        int((~results["passed"].values.astype(bool)).sum()),
        len(np.unique(results["case"].values)),
    )
    return f"{table(rows)}\n\n{results.sizes['result']} results of {count} cases, {failed} failed"


def worst_results(results: xr.Dataset) -> xr.Dataset:
    """Return the worst result of each extreme case: one that failed, else the one of the largest error.

    Parameters
    ----------
    results : Dataset
        From `extremes`.

    Returns
    -------
    Dataset
        The rows of `results`, one for each case, with the longest `run_time` of the case.

    Raises
    ------
    InvalidInput
        It is no such result.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> import xarray as xr
    >>> columns = {
    ...     "case": ["flat", "flat", "wave"],
    ...     "error": [0.0, 1e-9, float("nan")],
    ...     "passed": [True, True, False],
    ...     "run_time": [0.2, 0.1, 0.1],
    ... }
    >>> results = xr.Dataset({name: ("result", values) for name, values in columns.items()})
    >>> worst = fc.accuracy.worst_results(results)
    >>> print(worst["error"].values, worst["run_time"].values)
    [1.e-09    nan] [0.2 0.1]
    """
    with Problems(WORST) as problems:
        is_dataset = isinstance(results, xr.Dataset)
        problems.require(is_dataset, "results", "a Dataset from `extremes`", type(results).__name__)
    _check(WORST, "results", results, RANKED)
    cases = results["case"].values
    badness = np.where(results["passed"], np.nan_to_num(results["error"].values, nan=-1.0), np.inf)
    rows, longest = [], []
    for name in dict.fromkeys(cases.tolist()):
        places = np.flatnonzero(cases == name)
        rows.append(int(places[np.argmax(badness[places])]))
        longest.append(float(results["run_time"].values[places].max()))
    worst = results.isel(result=rows)
    return worst.assign(run_time=worst["run_time"].copy(data=np.array(longest)))
