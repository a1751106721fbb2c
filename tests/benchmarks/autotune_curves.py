"""Measure the curves from which scenes choose methods and tolerances for their `error` or `budget`.

    python tests/benchmarks/autotune_curves.py FILE [--budget 110]

FILE is JSON: benchmark, method, and lists of parameter, error and seconds in the order of growing cost. The
shipped file was made with this command. Make it again on an idle machine after a change of the speed or the
error of a method; the seconds are those of the machine that measured them.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

import fractalcontact as fc

PARTS = ("contact", "dimensions", "domains")
# key of the file, variable of `fractalcontact.accuracy.measure`
COLUMNS = {"parameter": "parameter", "error": "error", "seconds": "run_time"}


def curves(measured):
    """Return the curves of a result of `fractalcontact.accuracy.measure`, with numbers of three digits."""
    result = {}
    for node in measured.children.values():
        data = node.to_dataset()
        for method in data["method"].values:
            row = data.sel({"method": method})
            # settings that were not measured are NaN, and an error of zero has no logarithm
            finite = np.isfinite(row["error"].values) & (row["error"].values > 0)
            if finite.any():
                result.setdefault(str(row["benchmark"].values), {})[str(method)] = {
                    key: [float(f"{value:.3g}") for value in row[name].values[finite]]
                    for key, name in COLUMNS.items()
                }
    return result


def write(measured, path):
    """Write the curves of a result of `fractalcontact.accuracy.measure` as JSON."""
    Path(path).write_text(json.dumps(curves(measured), indent=1) + "\n", encoding="utf-8")


def main(arguments=None):
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("--budget", type=float, default=110.0, help="seconds for the whole (110)")
    options = parser.parse_args(arguments)
    write(fc.accuracy.measure(PARTS, budget=options.budget, progress=True), options.file)
    print(f"written: {options.file}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
