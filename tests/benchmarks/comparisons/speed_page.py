"""Make the tables and figures of the page `gallery/speed.rst` from the measured runs.

    python speed_page.py ../../../gallery

The runs are in `measured`: `solvers.csv` of `solvers.py` (its repeats),
`large.csv` of `large_grids.py`, `peers.csv` of `packages.py` and `sweeps.csv` of
`workers.py`. To renew the page, run these, put their files there, and run this one. It writes the
tables `speed/*.csv` and the figures `images/speed_*.png` below the folder given.
"""

from __future__ import annotations

import csv
import statistics
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

MEASURED = Path(__file__).resolve().parent / "measured"
THIS = "fractalcontact"
RIVALS = {"ASPHER": "aspher", "Tamaas": "tamaas", "ContactMechanics": "contactmechanics"}
COLOURS = {THIS: "#0072B2", "ASPHER": "#D55E00", "Tamaas": "#009E73", "ContactMechanics": "#CC79A7"}
MARKERS = {THIS: "o", "ASPHER": "s", "Tamaas": "^", "ContactMechanics": "D"}
NONE = "–"
Row = dict[str, Any]
Table = tuple[list[str], list[list[str]]]


def read(name: str) -> list[Row]:
    """Return the rows of a measured file, numbers as numbers."""
    with (MEASURED / name).open(encoding="utf-8", newline="") as stream:
        return [{key: _number(value) for key, value in row.items()} for row in csv.DictReader(stream)]


def _number(word: str) -> Any:
    try:
        return int(word) if word.isdigit() else float(word)
    except ValueError:
        return word


def of(rows: Iterable[Row], **wanted: Any) -> list[Row]:
    """Return the rows with these values."""
    return [row for row in rows if all(row[key] == value for key, value in wanted.items())]


def least_time(runs: list[Row], package: str) -> dict[Any, float]:
    """Return for each load the least time of the fastest solver of a package."""
    word = RIVALS.get(package, package)
    times: dict[Any, float] = {}
    for run in runs:
        if str(run["solver"]).startswith(word):
            times[run["loads"]] = min(times.get(run["loads"], np.inf), run["seconds"])
    return times


def total_ratio(runs: list[Row], package: str) -> float:
    """Return time over that of this solver, all loads that both have solved together; NaN without any."""
    ours, theirs = least_time(runs, THIS), least_time(runs, package)
    common = [load for load in ours if load in theirs]
    return sum(theirs[load] for load in common) / sum(ours[load] for load in common) if common else np.nan


def solver_cases(rows: list[Row]) -> list[tuple[str, str, int, int]]:
    """Return start, boundary, threads and n of every case."""
    return sorted({(row["start"], row["boundary"], row["threads"], row["n"]) for row in rows})


def solver_table(rows: list[Row]) -> Table:
    """Return the time of this solver and how many times as long the others take."""
    head = ["start", "body", "threads", "n", "ms a solution", "pairs", *RIVALS]
    lines = []
    for start, boundary, threads, n in solver_cases(rows):
        runs = of(rows, start=start, boundary=boundary, threads=threads, n=n)
        own = of(runs, solver=THIS)
        steps = own[0]["steps"]
        milliseconds = 1e3 * statistics.fmean(least_time(runs, THIS).values()) / steps
        pairs = statistics.fmean(run["pairs"] for run in own) / steps
        ratios = [_rounded(total_ratio(runs, package)) for package in RIVALS]
        lines.append([start, boundary, str(threads), str(n), _time(milliseconds), f"{pairs:.0f}", *ratios])
    return head, lines


def load_table(rows: list[Row]) -> Table:
    """Return how many times as long the fastest other solver takes, by load, for cold solutions."""
    cold = of(rows, start="cold")
    loads = sorted({row["loads"] for row in cold})
    lines = []
    for _, boundary, threads, n in solver_cases(cold):
        runs = of(cold, boundary=boundary, threads=threads, n=n)
        line = [boundary, str(threads), str(n)]
        for load in loads:
            one = of(runs, loads=load)
            known = [ratio for package in RIVALS if np.isfinite(ratio := total_ratio(one, package))]
            line.append(_rounded(min(known, default=np.nan)))
        lines.append(line)
    return ["body", "threads", "n", *(f"p = {load:g} E*" for load in loads)], lines


def large_table(rows: list[Row]) -> Table:
    """Return time, pairs and memory against n."""
    lines = [
        [
            row["boundary"],
            str(row["n"]),
            f"{row['seconds']:.3g}",
            str(row["pairs"]),
            f"{row['residual']:.1e}" if row["residual"] else NONE,
            f"{row['peak_bytes'] / 1e9:.2f}",
            f"{1e9 * row['seconds'] / row['pairs'] / row['n'] ** 2:.1f}",
            str(row["date"]),
        ]
        for row in sorted(rows, key=lambda row: (row["boundary"] == "free", row["n"]))
    ]
    return ["body", "n", "s", "pairs", "residual", "peak (GB)", "ns a pair and point", "measured"], lines


def peer_table(rows: list[Row]) -> Table:
    """Return times of both, ratio and difference of the answers, a line for each question and size."""
    lines = [
        [
            row["question"],
            row["peer"],
            str(row["n"]),
            _time(1e3 * row["time"]),
            _time(1e3 * row["peer_time"]),
            _rounded(row["ratio_median"]),
            f"{row['difference']:.0e}",
        ]
        for row in sorted(rows, key=lambda row: _order(rows, row))
    ]
    return ["question", "package", "n", "ms here", "ms there", "ratio", "difference"], lines


def _order(rows: list[Row], row: Row) -> tuple[int, int]:
    names = list(dict.fromkeys(other["question"] for other in rows))
    return names.index(row["question"]), row["n"]


def sweep_table(rows: list[Row]) -> Table:
    """Return the wall time of ensembles."""
    lines = [
        [
            str(row["n"]),
            str(row["members"]),
            row["start"],
            row["kept"],
            row["way"],
            f"{row['time']:.3g}",
            f"{row['ratio']:.2f}",
        ]
        for row in rows
    ]
    return ["n", "members", "start", "results", "run", "s", "times one thread"], lines


def _time(milliseconds: float) -> str:
    return f"{milliseconds:.0f}" if milliseconds >= 100 else f"{milliseconds:.3g}"


def _rounded(ratio: float) -> str:
    if not np.isfinite(ratio):
        return NONE
    return f"{ratio:.0f}" if ratio >= 10 else f"{ratio:.1f}" if ratio >= 1 else f"{ratio:.2f}"


def tables() -> dict[str, Table]:
    """Return all tables by the name of their file."""
    solvers = read("solvers.csv")
    return {
        "solvers": solver_table(solvers),
        "loads": load_table(solvers),
        "large": large_table(read("large.csv")),
        "peers": peer_table(read("peers.csv")),
        "sweeps": sweep_table(read("sweeps.csv")),
    }


def draw_solvers(rows: list[Row], target: Path) -> None:
    """Draw the time of a solution against n, one panel for each start and body; one thread."""
    import matplotlib.pyplot as plt

    rows = of(rows, threads=1)
    figure, axes = plt.subplots(2, 2, figsize=(8, 6.4), layout="constrained", sharex=True, sharey=True)
    for line, start in zip(axes, ("cold", "path"), strict=True):
        for ax, boundary in zip(line, ("periodic", "free"), strict=True):
            for package in (THIS, *RIVALS):
                points = []
                for n in sorted({row["n"] for row in rows}):
                    runs = of(rows, start=start, boundary=boundary, n=n)
                    ours, times = least_time(runs, THIS), least_time(runs, package)
                    if times and ours.keys() == times.keys():
                        points.append((n, 1e3 * statistics.fmean(times.values()) / runs[0]["steps"]))
                look = {"color": COLOURS[package], "marker": MARKERS[package], "label": package}
                if points:
                    ax.loglog(*zip(*points, strict=True), lw=2.2 if package == THIS else 1.3, **look)
            title = "one load, cold" if start == "cold" else "path of 20 loads, a step"
            ax.set_title(f"{title}, {boundary}")
            _size_axis(ax, sorted({row["n"] for row in rows}))
        line[0].set_ylabel("time of a solution (ms)")
    for ax in axes[-1]:
        ax.set_xlabel("points along each axis")
    axes[0, 0].legend()
    figure.savefig(target, dpi=130)
    plt.close(figure)


def draw_ratios(rows: list[Row], target: Path) -> None:
    """Draw how many times as long the fastest other solver takes, by load, against n."""
    import matplotlib.pyplot as plt

    head, lines = load_table(rows)
    figure, axes = plt.subplots(1, 2, figsize=(8, 3.9), layout="constrained", sharey=True)
    colours = ("#56B4E9", "#0072B2", "#002B5C")
    for ax, boundary in zip(axes, ("periodic", "free"), strict=True):
        for threads, style in (("1", "-"), ("2", "--")):
            own = [line for line in lines if line[0] == boundary and line[1] == threads]
            for column, colour in zip(range(3, len(head)), colours, strict=True):
                points = [(int(line[2]), float(line[column])) for line in own if line[column] != NONE]
                if points:
                    label = f"{head[column]}, {threads} thread{'s' if threads == '2' else ''}"
                    ax.loglog(*zip(*points, strict=True), style, marker="o", color=colour, label=label)
        ax.axhline(1, color="0.3", lw=1)
        ax.set(title=f"{boundary}, cold", xlabel="points along each axis")
        ax.set_yticks([0.3, 1, 3, 5, 10, 30], ["0.3", "1", "3", "5", "10", "30"])
        ax.minorticks_off()
        _size_axis(ax, sorted({int(line[2]) for line in lines}))
    axes[0].set_ylabel("fastest other solver / this one")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    figure.savefig(target, dpi=130)
    plt.close(figure)


def draw_large(rows: list[Row], target: Path) -> None:
    """Draw pairs, time and peak memory against n, with a power law."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, 3, figsize=(9, 3.2), layout="constrained")
    panels = (
        ("pairs", "pairs of transforms", 1.0),
        ("seconds", "time (s)", 1.0),
        ("peak_bytes", "peak memory (GB)", 1e-9),
    )
    for ax, (name, label, factor) in zip(axes, panels, strict=True):
        for boundary, colour, marker in (("periodic", "#0072B2", "o"), ("free", "#D55E00", "s")):
            own = sorted(of(rows, boundary=boundary), key=lambda row: row["n"])
            n, values = np.array([[row["n"], factor * row[name]] for row in own], float).T
            ax.loglog(
                n, values, marker=marker, color=colour, label=boundary, ls="" if name == "pairs" else "-"
            )
            if name == "pairs":
                power, start = np.polyfit(np.log(n), np.log(values), 1)
                fit = np.exp(start) * n**power
                ax.loglog(n, fit, color=colour, lw=1, label=f"{boundary}: $n^{{{power:.2f}}}$")
        ax.set(xlabel="points along each axis", ylabel=label)
        _size_axis(ax, [64, 256, 1024, 4096, 16384])
    axes[0].set_yticks([20, 30, 50, 100], ["20", "30", "50", "100"])
    axes[0].yaxis.minorticks_off()
    axes[0].legend()
    axes[1].legend()
    figure.savefig(target, dpi=130)
    plt.close(figure)


def draw_peers(rows: list[Row], target: Path) -> None:
    """Draw both times against n, one panel a question."""
    import matplotlib.pyplot as plt

    names = list(dict.fromkeys(row["question"] for row in rows))
    figure, axes = plt.subplots(2, -(-len(names) // 2), figsize=(10, 5), layout="constrained", sharex=True)
    for ax, name in zip(axes.flat, names, strict=False):
        own = sorted(of(rows, question=name), key=lambda row: row["n"])
        n = [row["n"] for row in own]
        ax.loglog(n, [1e3 * row["time"] for row in own], "o-", color="#0072B2", label=THIS)
        ax.loglog(n, [1e3 * row["peer_time"] for row in own], "s--", color="#D55E00", label=own[0]["peer"])
        ax.set_title(name)
        ax.legend()
        _size_axis(ax, sorted({row["n"] for row in rows}))
    for ax in axes.flat[len(names) :]:
        ax.remove()
    for ax in axes[-1]:
        ax.set_xlabel("points along each axis")
    for ax in axes[:, 0]:
        ax.set_ylabel("time (ms)")
    figure.savefig(target, dpi=130)
    plt.close(figure)


def _size_axis(ax: Any, sizes: list[int]) -> None:
    ax.set_xticks(sizes, [str(n) for n in sizes])
    ax.xaxis.minorticks_off()


def main(folder: Path) -> None:
    """Write all tables and figures below a folder."""
    import matplotlib as mpl
    import matplotlib.pyplot as plt

    mpl.use("Agg")
    (folder / "speed").mkdir(parents=True, exist_ok=True)
    (folder / "images").mkdir(exist_ok=True)
    for name, (head, lines) in tables().items():
        with (folder / "speed" / f"{name}.csv").open("w", encoding="utf-8", newline="") as stream:
            csv.writer(stream, lineterminator="\n").writerows([head, *lines])
    with plt.style.context("fractalcontact.plotting.report"):
        draw_solvers(read("solvers.csv"), folder / "images" / "speed_solvers.png")
        draw_ratios(read("solvers.csv"), folder / "images" / "speed_loads.png")
        draw_large(read("large.csv"), folder / "images" / "speed_large.png")
        draw_peers(read("peers.csv"), folder / "images" / "speed_peers.png")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
