"""Tables of what was measured and of what the extreme cases gave, for the screen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from fractalcontact.base.tables import table

if TYPE_CHECKING:
    import xarray as xr

    from fractalcontact.accuracy.examination import Finding


def curves_table(measured: xr.DataTree) -> str:
    """Return error, seconds and memory of every method at every setting, contest by contest.

    A star marks the frontier: no other method of the contest came as near in as little time.
    """
    parts = []
    for name, node in measured.children.items():
        data = node.to_dataset()
        contests = data["contest"].values
        for contest in dict.fromkeys(contests.tolist()):
            one = data.isel(method=contests == contest)
            rows: list[tuple[str, ...]] = [
                (
                    "method",
                    str(one["knob_name"].values[0]),
                    "error",
                    "seconds",
                    "first call",
                    "memory",
                    "frontier",
                )
            ]
            for method in one["method"].values:
                row = one.sel({"method": method})
                rows += [
                    (
                        str(method),
                        f"{float(row['knob'][k]):g}",
                        f"{float(row['error'][k]):.3g}",
                        f"{float(row['run_time'][k]):.2e}",
                        f"{float(row['first_run_time'][k]):.2e}",
                        f"{float(row['memory'][k]) / 1e6:.3g} MB",
                        "*" if bool(row["on_frontier"][k]) else "",
                    )
                    for k in range(row.sizes["setting"])
                    if np.isfinite(row["error"][k])
                ]
            head = f"{name}, {contest}: {one['error_meaning'].values[0]}\nagainst {one['truth'].values[0]}"
            parts.append(f"{head}\n{table(rows)}")
    return "\n\n".join([*parts, choice_table(measured)])


def choice_table(measured: xr.DataTree) -> str:
    """Return which methods are worth choosing: on the frontier of their contest at which settings."""
    rows: list[tuple[str, ...]] = [("room", "contest", "method", "on the frontier", "least error", "in")]
    for name, node in measured.children.items():
        data = node.to_dataset()
        for method in data["method"].values:
            one = data.sel({"method": method})
            alone = int((data["contest"] == one["contest"]).sum()) == 1
            count = int(np.isfinite(one["error"]).sum())
            held = int(one["on_frontier"].sum())
            best = int(np.nanargmin(one["error"].values))
            rows.append(
                (
                    name,
                    str(one["contest"].values),
                    str(method),
                    "alone" if alone else f"{held} of {count}" if held else "never worth choosing",
                    f"{float(one['error'][best]):.2g}",
                    f"{float(one['run_time'][best]):.2g} s",
                )
            )
    return table(rows)


def estimators_table(bench: xr.Dataset) -> str:
    """Return bias, error over the least possible one and coverage of every method, case by case.

    A block for each family and size; a column for each exponent with bias, ratio and coverage; the seconds
    are those of the median exponent.
    """
    blocks = []
    for family in bench["family"].values:
        for size, members in zip(bench["size"].values, bench["member_count"].values, strict=True):
            block = bench.sel(family=family, size=size)
            least = ", ".join(f"{value:.2g}" for value in block["least_error"].values)
            rows: list[tuple[str, ...]] = [
                ("method", *(f"H = {hurst:g}" for hurst in block["hurst"].values), "seconds")
            ]
            for method in block["method"].values:
                one = block.sel({"method": method})
                columns = zip(
                    *(one[name].values for name in ("bias", "error_ratio", "interval_coverage")), strict=True
                )
                cells = [f"{bias:+.3f} {_ratio(ratio)} {_share(share)}" for bias, ratio, share in columns]
                rows.append((str(method), *cells, f"{float(one['run_time'].median()):.1e}"))
            blocks.append(f"{family}, {size} x {size} points, {members} surfaces\n"
                          f"least errors {least}\n{table(rows)}")  # fmt: skip
    head = "bias of H, root mean square error over the Cramer-Rao bound, coverage of the 95 % interval"
    return "\n\n".join([head, *blocks])


def _ratio(value: float) -> str:
    return f"{value:.2f}" if value < 9.995 else f"{value:.0f}"


def _share(value: float) -> str:
    return f"{value:.3f}" if np.isfinite(value) else "none"


def cases_table(findings: Mapping[str, Sequence[Finding]]) -> str:
    """Return one line for each extreme case and quantity: expected, got, seconds."""
    rows: list[tuple[str, ...]] = [
        ("case", "function and quantity", "expected", "got", "error", "seconds", "")
    ]
    for name, found in findings.items():
        rows += [
            (
                name,
                one.name,
                _expectation(one.expected),
                _outcome(one)[:60],
                "" if np.isnan(one.error) else f"{one.error:.1e}",
                f"{one.run_time:.3f}",
                "" if one.ok else "FAILED",
            )
            for one in found
        ]
    failed = sum(not one.ok for found in findings.values() for one in found)
    total = sum(len(found) for found in findings.values())
    return f"{table(rows)}\n\n{total} findings on {len(findings)} cases, {failed} failed"


def cases_dataset(findings: Mapping[str, Sequence[Finding]]) -> xr.Dataset:
    """Return all findings, one after the other along `finding`."""
    import xarray as xr

    from fractalcontact.base.provenance import stamp
    from fractalcontact.base.schema import label

    all_of = [(case, one) for case, found in findings.items() for one in found]
    columns = {
        "case": [case for case, _ in all_of],
        "quantity": [one.name for _, one in all_of],
        "expectation": [_expectation(one.expected) for _, one in all_of],
        "outcome": [_outcome(one) for _, one in all_of],
        "value": [np.nan if isinstance(one.got, str) else one.got for _, one in all_of],
        "error": [one.error for _, one in all_of],
        "run_time": [one.run_time for _, one in all_of],
        "passed": [one.ok for _, one in all_of],
    }
    table_of = xr.Dataset({name: ("finding", np.array(column)) for name, column in columns.items()})
    result = label(table_of.assign_coords(finding=np.arange(len(all_of))))
    result["error"].attrs["comment"] = "NaN where nothing but a finite number or a reason was expected"
    return stamp(result, "fractalcontact.accuracy", {"cases": list(findings)}, title="Extreme cases")


def worst_rows(findings: Mapping[str, Sequence[Finding]]) -> list[tuple[str, ...]]:
    """Return one row for each extreme case: the quantity that came out worst, and the slowest call."""
    rows: list[tuple[str, ...]] = [("case", "worst quantity", "expected", "got", "error", "slowest call, s")]
    for name, found in findings.items():
        worst = max(found, key=lambda one: (not one.ok, np.nan_to_num(one.error, nan=-1.0)))
        got = _outcome(worst)
        expected = _expectation(worst.expected) or "finite or explained"
        error = "" if np.isnan(worst.error) else f"{worst.error:.1e}"
        rows.append(
            (
                name,
                worst.name,
                expected,
                got[:60] if worst.ok else f"FAILED: {got[:60]}",
                error,
                f"{max(one.run_time for one in found):.2g}",
            )
        )
    return rows


def _outcome(finding: Finding) -> str:
    return finding.got if isinstance(finding.got, str) else f"{finding.got:.6g}"


def _expectation(expected: object) -> str:
    if expected is None:
        return ""
    if isinstance(expected, tuple):
        return f"{expected[0]:g} ... {expected[1]:g}"
    return expected if isinstance(expected, str) else f"{expected:g}"
