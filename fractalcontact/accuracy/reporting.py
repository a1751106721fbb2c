"""Tables of what was measured and of what the extreme cases gave, for the screen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from fractalcontact.base.text import table

if TYPE_CHECKING:
    import xarray as xr

    from fractalcontact.accuracy.examination import Finding


def curves_table(measured: xr.DataTree) -> str:
    """Return error and seconds of every method at every setting, part by part.

    A star marks the frontier: no other method of the part reached as small an error in as short a time.
    """
    parts = []
    for name, node in measured.children.items():
        data = node.to_dataset()
        notes = data["error"].attrs
        rows: list[tuple[str, ...]] = [
            ("method", notes["knob"], "error", "seconds", "first call", "frontier")
        ]
        errors, seconds = data["error"].values, data["run_time"].values
        for row, method in enumerate(data["method"].values):
            for column, knob in enumerate(data["knob"].values):
                error, time = errors[row, column], seconds[row, column]
                if np.isfinite(error):
                    beaten = ((errors < error) & (seconds <= time)).any()
                    first = float(data["first_run_time"][row, column])
                    mark = "" if beaten else "*"
                    rows.append(
                        (str(method), f"{knob:g}", f"{error:.3g}", f"{time:.2e}", f"{first:.2e}", mark)
                    )
        parts.append(f"{name}: {notes['error']}\nagainst {notes['truth']}\n{table(rows)}")
    return "\n\n".join(parts)


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
    rows: list[tuple[str, ...]] = [("case", "function and quantity", "expected", "got", "seconds", "")]
    for name, found in findings.items():
        for one in found:
            got = one.got if isinstance(one.got, str) else f"{one.got:.6g}"
            expected = "" if one.expected is None else _expectation(one.expected)
            rows.append(
                (name, one.name, expected, got[:60], f"{one.run_time:.3f}", "" if one.ok else "FAILED")
            )
    failed = sum(not one.ok for found in findings.values() for one in found)
    total = sum(len(found) for found in findings.values())
    return f"{table(rows)}\n\n{total} findings on {len(findings)} cases, {failed} failed"


def _expectation(expected: object) -> str:
    if isinstance(expected, tuple):
        return f"{expected[0]:g} ... {expected[1]:g}"
    return expected if isinstance(expected, str) else f"{expected:g}"
