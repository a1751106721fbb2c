"""The bench of the estimators as a table for the screen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fractalcontact.base.text import table

if TYPE_CHECKING:
    import xarray as xr


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
