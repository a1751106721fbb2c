"""Results of this subpackage as text tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.errors import InvalidInput
from fractalcontact.base.tables import table
from fractalcontact.base.validation import NONE, Problems

Row = tuple[str, ...]
WHERE = "fractalcontact.accuracy.summary"
_SETTING, _METHOD, _CASE = ("method", "setting"), ("method",), ("method", "family", "hurst", "size")
# dims of the variables that are read, of `measure` and `estimators`
MEASURED = {
    **dict.fromkeys(("parameter", "error", "run_time", "first_run_time", "memory"), _SETTING),
    **dict.fromkeys(("benchmark", "parameter_name", "error_meaning", "truth", "method"), _METHOD),
    "on_pareto_front": _SETTING,
}
ESTIMATED = {
    **dict.fromkeys(("bias", "error_ratio", "interval_coverage", "run_time"), _CASE),
    "least_error": ("family", "hurst", "size"),
    "member_count": ("size",),
    **{name: (name,) for name in _CASE},
}


def summary(results: Any) -> str:
    """Return a result of `measure` or `estimators` as a text table.

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
        parts = {name: node.to_dataset() for name, node in results.children.items()}
        for name, part in parts.items():
            _check(f"results/{name}", part, MEASURED)
        return "\n\n".join(text for name, part in parts.items() for text in _measured_tables(name, part))
    if isinstance(results, xr.Dataset) and "error_ratio" in results:
        _check("results", results, ESTIMATED)
        return _estimators_summary(results)
    expected = "a result of measure or estimators"
    raise InvalidInput(WHERE, [f"results: expected {expected}, got {type(results).__name__}"])


def _check(argument: str, results: xr.Dataset, columns: Mapping[str, Row]) -> None:
    """Check that a result has the variables that are read, with their dims and types."""
    with Problems(WHERE) as problems:
        problems.result(argument, results)
        for name, dims in columns.items():
            got = f"dims {results[name].dims}" if name in results.variables else NONE
            has_dims = got is not NONE and set(results[name].dims) == set(dims)
            problems.require(has_dims, f"{argument}.{name}", f"a variable over {', '.join(dims)}", got)


def _measured_tables(part: str, data: xr.Dataset) -> list[str]:
    """Return a table for each benchmark: every method at every setting, a star on the Pareto front."""
    tables = []
    names = data["benchmark"].values
    for name in dict.fromkeys(names.tolist()):
        benchmark = data.isel(method=names == name)
        meaning, truth, parameter = (
            str(benchmark[key].values[0]) for key in ("error_meaning", "truth", "parameter_name")
        )
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
                for k in np.flatnonzero(np.isfinite(row["error"].values))
            ]
        tables.append(f"{part}, {name}: {meaning}\nagainst {truth}\n{table(rows)}")
    return tables


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
            is_profile = family == "profile"
            points = f"{size} points" if is_profile else f"{size} x {size} points"
            head = f"{family}, {points}, {members} {'profiles' if is_profile else 'surfaces'}"
            blocks.append(f"{head}\nCramer-Rao bounds {bounds}\n{table(rows)}")
    return "\n\n".join(blocks)


def _estimator_cell(bias: float, ratio: float, coverage: float) -> str:
    # three digits
    ratio_text = f"{ratio:.2f}" if ratio < 9.995 else f"{ratio:.0f}"
    return f"{bias:+.3f} {ratio_text} {f'{coverage:.3f}' if np.isfinite(coverage) else 'none'}"
