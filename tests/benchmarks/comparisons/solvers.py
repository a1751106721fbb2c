"""Benchmark of the contact solver against the other solvers that are installed.

    python solvers.py                       # a minute or two
    python solvers.py --sizes 256,512,1024,2048,4096 --seeds 1,2,3 --threads 1,2
    python solvers.py --only cold --boundaries free --sizes 512 --without tamaas
    python solvers.py --only memory --sizes 2048

The others are Tamaas, ContactMechanics (with its own solver and with NuMPI's) and ASPHER (preconditioned,
and nested in two precisions); none is required. Surfaces are periodic self-affine, H = 0.8, wavelengths 4 to
n/4, rms slope 0.1; pressures are 0.001, 0.01 and 0.03 of the modulus, or a path of 20 from 0.0005 to 0.05.

Every solver is run with ever smaller tolerances of its own. What counts is the error computed here from its
pressure alone, in the same way for all:

    complementarity = sum of p (g - min g) / (sum of p * standard deviation of the heights),

where g is the displacement under p less the heights. The time of a solver is that of its first tolerance with
an error of at most `--target`; along a path the greatest error counts. Then all solvers run one after the
other, `--repeats` times, and the ratio to this solver is formed within each repeat. The clock covers the
solution: for the other solvers without their set-up (but ASPHER's nested mode sets up inside), for this
solver all of `press`, labels included.

Each number of threads is a process of its own, bound to as many processors. Memory is the peak of a process
that does nothing else, less what it had before. Transforms are pairs on the finest grid, where a solver
reports them. Writes `solvers.csv` (every run), `solvers.png` and the table `solvers.txt` into `--out`.
"""

from __future__ import annotations

import argparse
import csv
import multiprocessing
import os
import resource
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

LOADS = (0.001, 0.01, 0.03)
PATH = tuple(np.geomspace(0.0005, 0.05, 20).tolist())
TOLERANCES = tuple(digit * 10.0**-k for k in range(3, 10) for digit in (3, 1))  # ever tighter
THIS_SOLVER = "fractalcontact"
# pressures and pairs of transforms (nan where the solver does not tell), step after step
Answer = Iterator[tuple[np.ndarray, float]]


@dataclass(frozen=True)
class Case:
    """One surface on a unit square, to be pressed with modulus 1."""

    n: int
    boundary: str
    start: str
    loads: tuple[float, ...]
    seed: int

    @property
    def heights(self) -> np.ndarray:
        """Heights (n, n) of zero mean."""
        rng = np.random.default_rng(self.seed)
        k = np.hypot(np.fft.fftfreq(self.n, 1 / self.n)[:, None], np.arange(self.n // 2 + 1)[None, :])
        band = (k >= 4) & (k <= self.n / 4)
        modes = np.where(band, np.where(band, k, 1.0) ** -1.8, 0.0) * np.exp(2j * np.pi * rng.random(k.shape))
        heights = np.fft.irfft2(modes, s=(self.n, self.n))
        slope = 2j * np.pi * np.fft.rfft2(heights)
        ky, kx = np.fft.fftfreq(self.n, 1 / self.n)[:, None], np.arange(self.n // 2 + 1)[None, :]
        squares = [np.mean(np.fft.irfft2(slope * q, s=(self.n, self.n)) ** 2) for q in (kx, ky)]
        return heights * (0.1 / np.sqrt(sum(squares)))


def fractalcontact(case: Case, heights: np.ndarray) -> Callable[[float], Answer]:
    """This solver: the whole call, labels and all."""
    import fractalcontact as fc

    surface = fc.surfaces.from_array(heights, 1 / case.n, periodic=case.boundary == "periodic")
    influence = "spectral" if case.boundary == "periodic" else "square"

    def solve(tolerance: float) -> Answer:
        result = fc.contact.press(
            surface,
            contact_modulus=1.0,
            nominal_pressure=case.loads,
            influence=influence,
            tolerance=tolerance,
            keep=("pressure",),
        )
        yield from zip(result["pressure"].values, result["transforms"].values, strict=True)

    return solve


def aspher(mode: str, precision: str) -> Callable[[Case, np.ndarray], Callable[[float], Answer]]:
    """ASPHER: nested, which sets up inside, or preconditioned, started from the step before along a path."""

    def prepare(case: Case, heights: np.ndarray) -> Callable[[float], Answer]:
        import aspher as peer

        gap = np.ascontiguousarray(heights.max() - heights).ravel()
        backend = "periodic" if case.boundary == "periodic" else "fft"
        coarsest = case.n
        while coarsest > 64 and coarsest % 2 == 0:
            coarsest //= 2
        common = {"domain_size": 1.0, "E_star": 1.0, "backend": backend}
        solver = peer.ContactSolver(grid_size=case.n, **common) if mode == "precond" else None

        def solve(tolerance: float) -> Answer:
            before = None
            for load in case.loads:
                limits = {"tol": tolerance, "max_iter": 10000}
                if solver is None:
                    given = {"grid_size": case.n, "gap": gap, "p_nominal": load, "coarsest": coarsest}
                    result = peer.solve_nested(**given, **common, **limits, precision=precision)
                else:
                    result = solver.solve(gap, load, **limits, precond="fourier-fft", p_init=before)
                    before = np.array(result.pressure) if case.start == "path" else None
                yield (
                    np.array(result.pressure).reshape(heights.shape),
                    result.matvec_count + result.precond_count,
                )

        return solve

    return prepare


def tamaas(case: Case, heights: np.ndarray) -> Callable[[float], Answer]:
    """Tamaas: two pairs in an iteration; along a path it starts from the step before by itself."""
    import tamaas as peer

    peer.initialize(1)
    peer.set_log_level(peer.LogLevel.error)

    def solve(tolerance: float) -> Answer:
        model = peer.Model(peer.model_type.basic_2d, [1.0, 1.0], list(heights.shape))
        model.E, model.nu = 1.0, 0.0
        solver = peer.PolonskyKeerRey(model, heights, tolerance)
        if case.boundary == "free":  # after the elastic constants, which are read here
            peer.ModelFactory.registerNonPeriodic(model, "free")
            solver.setIntegralOperator("free")
        solver.max_iter, solver.dump_freq = 20000, 10**9
        for load in case.loads:
            solver.solve(load)
            yield np.array(model.traction), np.nan

    return solve


def contactmechanics(method: str) -> Callable[[Case, np.ndarray], Callable[[float], Answer]]:
    """ContactMechanics: Polonsky and Keer, or NuMPI's conjugate gradients without restart."""

    def prepare(case: Case, heights: np.ndarray) -> Callable[[float], Answer]:
        from ContactMechanics.FFTElasticHalfSpace import FreeFFTElasticHalfSpace, PeriodicFFTElasticHalfSpace
        from ContactMechanics.Optimization.ConstrainedConjugateGradients import (
            constrained_conjugate_gradients,
        )
        from NuMPI.Optimization import CCGWithoutRestart
        from SurfaceTopography import Topography

        periodic, shape = case.boundary == "periodic", heights.shape
        half_space = (PeriodicFFTElasticHalfSpace if periodic else FreeFFTElasticHalfSpace)(
            shape, 1.0, (1.0, 1.0)
        )
        topography = Topography(heights, (1.0, 1.0), periodic=periodic)
        size, std = heights.size, float(heights.std())

        def displacement(force: np.ndarray) -> np.ndarray:
            padded = np.zeros(half_space.nb_subdomain_grid_pts)
            padded[: shape[0], : shape[1]] = -force.reshape(shape)
            return half_space.evaluate_disp(padded)[: shape[0], : shape[1]]

        def restarted(load: float, tolerance: float, before: np.ndarray | None) -> tuple[np.ndarray, float]:
            start = {}
            if before is not None:
                padded = np.zeros(half_space.nb_subdomain_grid_pts)
                padded[: shape[0], : shape[1]] = -before * (load / before.sum())
                start["initial_forces"] = padded
            result = constrained_conjugate_gradients(
                half_space,
                topography,
                external_force=load,
                maxiter=20000,
                pentol=tolerance * std,
                forcetol=tolerance * load / size,
                thermotol=tolerance,
                **start,
            )
            return np.array(result.jac).reshape(shape), float(result.nfev)

        def kept(load: float, tolerance: float, before: np.ndarray | None) -> tuple[np.ndarray, float]:
            start = np.full(size, load / size) if before is None else before.ravel() * (load / before.sum())
            result = CCGWithoutRestart.constrained_conjugate_gradients(
                lambda force: (0.0, (displacement(force) - heights).ravel()),
                lambda force: displacement(force).ravel(),
                x0=start,
                mean_val=load / size,
                gtol=tolerance * std,
                maxiter=20000,
            )
            return np.array(result.x).reshape(shape), 2.0 * result.nit + 1

        def solve(tolerance: float) -> Answer:
            before = None
            for load in case.loads:
                force, pairs = (restarted if method == "pk" else kept)(load, tolerance, before)
                before = force if case.start == "path" else None
                yield force * size, pairs

        return solve

    return prepare


SOLVERS: dict[str, tuple[str, Callable[[Case, np.ndarray], Callable[[float], Answer]]]] = {
    THIS_SOLVER: ("fractalcontact", fractalcontact),
    "aspher precond": ("aspher", aspher("precond", "double")),
    "aspher nested": ("aspher", aspher("nested", "double")),
    "aspher nested float": ("aspher", aspher("nested", "float_then_double")),
    "tamaas": ("tamaas", tamaas),
    "contactmechanics pk": ("ContactMechanics", contactmechanics("pk")),
    "contactmechanics ccg": ("ContactMechanics", contactmechanics("ccg")),
}


class Judge:
    """Complementarity of a pressure: one displacement in plain numpy, the same for all solvers."""

    def __init__(self, case: Case, heights: np.ndarray) -> None:
        self.heights, self.std, n = heights, float(heights.std()), case.n
        self.wide = n if case.boundary == "periodic" else 2 * n
        if case.boundary == "periodic":
            q = 2 * np.pi * np.hypot(np.fft.fftfreq(n, 1 / n)[:, None], np.arange(n // 2 + 1)[None, :])
            self.symbol = np.divide(2.0, q, out=np.zeros_like(q), where=q > 0)
        else:  # Love (1929)
            at = np.fft.fftfreq(2 * n, 1 / (2 * n)) / n
            edge = 0.5 / n

            def corner(y: np.ndarray, x: np.ndarray) -> np.ndarray:
                return y * np.arcsinh(x / np.abs(y)) + x * np.arcsinh(y / np.abs(x))

            y, x = at[:, None], at[None, :]
            table = corner(y + edge, x + edge) + corner(y - edge, x - edge)
            table -= corner(y + edge, x - edge) + corner(y - edge, x + edge)
            self.symbol = np.fft.rfft2(table / np.pi)

    def __call__(self, pressure: np.ndarray) -> float:
        """Return the complementarity over the standard deviation of the heights."""
        n, wide = self.heights.shape[0], (self.wide, self.wide)
        gap = np.fft.irfft2(np.fft.rfft2(pressure, s=wide) * self.symbol, s=wide)[:n, :n] - self.heights
        return float(np.sum(pressure * (gap - gap.min())) / (np.sum(pressure) * self.std))


def timed(
    solve: Callable[[float], Answer], tolerance: float, options: argparse.Namespace
) -> tuple[float, list[np.ndarray], float]:
    """Seconds, pressures, and pairs of transforms."""
    clock = time.process_time if options.clock == "processor" else time.perf_counter
    begun = clock()
    answer = list(solve(tolerance))
    seconds = clock() - begun
    return seconds, [pressure for pressure, _ in answer], float(sum(pairs for _, pairs in answer))


def compare(case: Case, names: list[str], options: argparse.Namespace) -> list[dict[str, Any]]:
    """Run all solvers on one case: a sweep of tolerances, then repeats at the one that meets the target."""
    heights = case.heights
    judge, rows = Judge(case, heights), []
    solves = {name: SOLVERS[name][1](case, heights) for name in names}
    met: dict[str, float] = {}
    once: set[str] = set()  # too slow to be repeated
    for name, solve in solves.items():
        loosest = 3 * options.target if case.start == "path" else options.loosest  # a path draws no curve
        loosest = min(
            [loosest, options.loosest, *(tolerance for of, tolerance in options.begin if of == name)]
        )
        for tolerance in TOLERANCES:
            if tolerance > 1.01 * loosest:
                continue
            seconds, pressures, pairs = timed(solve, tolerance, options)
            error = max(judge(pressure) for pressure in pressures)
            rows.append(
                record(case, name, options.threads, "tolerance sweep", tolerance, error, seconds, pairs)
            )
            if error <= options.target and name not in met:
                met[name] = tolerance
                if seconds > options.patience:  # this run is its repeat
                    once.add(name)
                    rows.append(rows[-1] | {"kind": "repeat"})
            enough = options.target * (options.beyond if seconds <= options.patience else 1.0)
            if error <= enough or seconds > 10 * options.patience:
                break
    for _ in range(options.repeats):
        for name, tolerance in met.items():
            if name in once:
                continue
            seconds, pressures, pairs = timed(solves[name], tolerance, options)
            error = max(judge(pressure) for pressure in pressures)
            rows.append(record(case, name, options.threads, "repeat", tolerance, error, seconds, pairs))
    return rows


def record(
    case: Case, name: str, threads: int, kind: str, tolerance: float, error: float, *cost: float
) -> dict[str, Any]:
    """One run as a line of the table."""
    facts = asdict(case) | {"loads": " ".join(f"{load:g}" for load in case.loads), "steps": len(case.loads)}
    run = {"solver": name, "threads": threads, "kind": kind, "tolerance": tolerance, "error": error}
    return facts | run | {"seconds": cost[0], "pairs": cost[1], "load_average": os.getloadavg()[0]}


def worker(arguments: tuple[argparse.Namespace, Case, list[str]]) -> list[dict[str, Any]]:
    """Compare in a process of its own, with as many processors as threads."""
    options, case, names = arguments
    warm = Case(128, case.boundary, "cold", (0.01,), 0)
    for name in names:  # compiled, and its libraries loaded
        list(SOLVERS[name][1](warm, warm.heights)(1e-6))
    return compare(case, names, options)


def peak_memory(arguments: tuple[argparse.Namespace, Case, list[str]]) -> list[dict[str, Any]]:
    """Peak memory of one solve beyond what was there before, in arrays of n x n doubles."""
    options, case, (name,) = arguments
    warm = Case(128, case.boundary, "cold", (0.01,), 0)
    list(SOLVERS[name][1](warm, warm.heights)(1e-6))
    heights = case.heights.copy()
    Path("/proc/self/clear_refs").write_text("5")  # the peak starts anew
    before = status("VmRSS")
    for _ in SOLVERS[name][1](case, heights)(1e-6):
        pass
    arrays = (max(status("VmHWM"), 0) - before) / heights.nbytes
    return [record(case, name, options.threads, "memory", 1e-6, np.nan, np.nan, np.nan) | {"arrays": arrays}]


def status(field: str) -> int:
    """Memory of this process in bytes."""
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith(field + ":"):
            return int(line.split()[1]) * 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def apart(task: Callable[[Any], list[dict[str, Any]]], options: argparse.Namespace, *more: Any) -> Any:
    """Run a task in a fresh process that has `options.threads` threads and processors."""
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "FRACTALCONTACT_THREADS"):
        os.environ[name] = str(options.threads)
    every = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(every)[-options.threads :])
    try:
        with multiprocessing.get_context("spawn").Pool(1) as pool:
            return pool.map(task, [(options, *more)])[0]
    finally:
        os.sched_setaffinity(0, every)


def cases(options: argparse.Namespace) -> Iterator[Case]:
    """Every case asked for."""
    for n in options.sizes:
        for boundary in options.boundaries:
            for seed in options.seeds:
                if "cold" in options.only:
                    yield from (Case(n, boundary, "cold", (load,), seed) for load in options.loads)
                if "path" in options.only and n <= options.path_up_to:
                    yield Case(n, boundary, "path", PATH, seed)


def table(rows: list[dict[str, Any]]) -> str:
    """Medians over repeats and seeds, and the ratios to this solver within each repeat."""
    lines = [
        f"{'threads n boundary start load':36} {'solver':22} {'seconds':>9} {'pairs a step':>12} "
        f"{'error':>8} {'this/other':>11} {'arrays':>6}"
    ]
    groups: dict[tuple[Any, ...], dict[str, list[dict[str, Any]]]] = {}
    for row in rows:
        load = row["loads"] if row["start"] == "cold" else "path"
        key = (row["threads"], row["n"], row["boundary"], row["start"], load)
        if row["kind"] == "repeat":
            groups.setdefault(key, {}).setdefault(row["solver"], []).append(row)
    memory = {
        (row["n"], row["boundary"], row["solver"]): row["arrays"] for row in rows if row["kind"] == "memory"
    }
    for key, solvers in groups.items():
        for name, runs in solvers.items():
            ratios = [
                this["seconds"] / other["seconds"]
                for this, other in zip(solvers.get(THIS_SOLVER, []), runs, strict=False)
                if this["seed"] == other["seed"]
            ]
            median = {
                item: statistics.median(run[item] for run in runs) for item in ("seconds", "pairs", "error")
            }
            arrays, ratio = memory.get((key[1], key[2], name), np.nan), statistics.median(ratios or [np.nan])
            lines.append(
                f"{' '.join(map(str, key)):36} {name:22} {median['seconds']:9.3f} "
                f"{median['pairs'] / runs[0]['steps']:12.1f} {median['error']:8.1e} "
                f"{ratio:11.3f} {arrays:6.1f}"
            )
    return "\n".join([*lines, *totals(groups), *growth(rows)])


def totals(groups: dict[tuple[Any, ...], dict[str, list[dict[str, Any]]]]) -> Iterator[str]:
    """Total over the loads of a cold case, against the fastest of each package."""
    sums: dict[tuple[Any, ...], dict[str, dict[str, float]]] = {}
    for (threads, n, boundary, start, load), solvers in groups.items():
        if start == "cold":
            for name, runs in solvers.items():
                median = statistics.median(run["seconds"] for run in runs)
                sums.setdefault((threads, n, boundary), {}).setdefault(name, {})[load] = median
    for key, solvers in sums.items():
        this_solver = solvers.get(THIS_SOLVER, {})
        for package in ("aspher", "tamaas", "contactmechanics"):
            complete = {
                k: v
                for k, v in solvers.items()
                if k.startswith(package) and this_solver and v.keys() == this_solver.keys()
            }
            if complete:
                best = min(complete, key=lambda name: sum(complete[name].values()))
                ratio = sum(this_solver.values()) / sum(complete[best].values())
                yield f"threads {key[0]} n {key[1]} {key[2]}: all loads, this solver / {best} = {ratio:.3f}"


def growth(rows: list[dict[str, Any]]) -> Iterator[str]:
    """Exponent with which the pairs of transforms grow with n, least squares over the sizes."""
    for name in dict.fromkeys(row["solver"] for row in rows):
        for boundary in ("periodic", "free"):
            runs = [
                (row["n"], row["pairs"], row["loads"])
                for row in rows
                if (row["kind"], row["start"], row["solver"], row["boundary"])
                == ("repeat", "cold", name, boundary)
            ]
            if len({n for n, _, _ in runs}) > 1 and all(np.isfinite(pairs) for _, pairs, _ in runs):
                for load in dict.fromkeys(load for _, _, load in runs):
                    n, pairs = zip(*((n, pairs) for n, pairs, at in runs if at == load), strict=True)
                    power = np.polyfit(np.log(n), np.log(pairs), 1)[0]
                    yield f"{name} {boundary} {load}: pairs grow as n^{power:.2f} from {min(n)} to {max(n)}"


def draw(rows: list[dict[str, Any]], target: float, path: Path) -> None:
    """Time against true error on the largest common grid, time and pairs against n."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    threads = min(row["threads"] for row in rows)
    kept = [row for row in rows if row["threads"] == threads and row["kind"] != "memory"]
    subjects = list(dict.fromkeys((row["boundary"], row["start"]) for row in kept))
    figure, axes = plt.subplots(len(subjects), 3, figsize=(15, 4.2 * len(subjects)), squeeze=False)
    for line, (boundary, start) in zip(axes, subjects, strict=True):
        here = [row for row in kept if (row["boundary"], row["start"]) == (boundary, start)]
        loads = sorted({row["loads"] for row in here}, key=lambda text: float(text.split()[0]))
        load = loads[len(loads) // 2]
        here = [row for row in here if row["loads"] == load]
        n = max(row["n"] for row in here)
        for colour, name in enumerate(SOLVERS):
            runs = [row for row in here if row["solver"] == name]
            look = {
                "color": f"C{colour}",
                "label": name,
                "marker": "o",
                "ms": 4,
                "lw": 1 + (name == THIS_SOLVER),
            }
            curve = sorted(
                (row["tolerance"], row["error"], row["seconds"])
                for row in runs
                if row["n"] == n
                and row["kind"] == "tolerance sweep"
                and row["seed"] == min(o["seed"] for o in runs)
            )
            if curve:
                line[0].loglog([e for _, e, _ in curve], [s for _, _, s in curve], **look)
            for place, item in ((line[1], "seconds"), (line[2], "pairs")):
                repeats = [row for row in runs if row["kind"] == "repeat" and np.isfinite(row[item])]
                sizes = sorted({row["n"] for row in repeats})
                median = [
                    statistics.median(t[item] / t["steps"] for t in repeats if t["n"] == m) for m in sizes
                ]
                if sizes:
                    place.loglog(sizes, median, **look)
        line[0].axvline(target, color="0.7", lw=1)
        line[0].invert_xaxis()
        label = f"{boundary}, {start}" + (f", p = {load} E*" if start == "cold" else ", 20 steps")
        line[0].set(xlabel="complementarity / std of heights", ylabel="seconds", title=f"{label}, n = {n}")
        line[1].set(xlabel="n", ylabel="seconds a step", title=f"to {target:g}")
        line[2].set(xlabel="n", ylabel="pairs of transforms a step", title=f"to {target:g}")
        for place in line[1:]:
            place.set_xticks(sizes := sorted({row["n"] for row in here}), [str(m) for m in sizes])
            place.minorticks_off()
    figure.suptitle(f"{threads} thread{'s' if threads > 1 else ''}")
    figure.tight_layout(rect=(0, 0.3 / figure.get_figheight(), 1, 1))
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="lower center", ncols=len(SOLVERS), fontsize=8)
    figure.savefig(path, dpi=110)


def write(rows: list[dict[str, Any]], path: Path) -> None:
    """Write every run as a line of a CSV file."""
    with path.open("w", newline="") as file:
        names = list(dict.fromkeys(name for row in rows for name in row))
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(rows)


def parsed(arguments: list[str] | None) -> argparse.Namespace:
    """Read the command line."""
    numbers = {"type": lambda text: tuple(int(number) for number in text.split(","))}
    words = {"type": lambda text: tuple(text.split(","))}
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--sizes", default=(256, 512), **numbers)
    parser.add_argument("--seeds", default=(1,), **numbers)
    parser.add_argument("--threads", default=(1,), **numbers)
    parser.add_argument("--loads", default=LOADS, type=lambda text: tuple(float(p) for p in text.split(",")))
    parser.add_argument("--boundaries", default=("periodic", "free"), **words)
    parser.add_argument("--only", default=("cold", "path", "memory"), **words, help="of cold, path, memory")
    parser.add_argument("--without", default=(), **words, help="solvers or packages left out")
    parser.add_argument("--path-up-to", type=int, default=512, help="largest n for paths")
    parser.add_argument("--target", type=float, default=1e-6, help="complementarity to reach")
    parser.add_argument("--loosest", type=float, default=1e-3, help="tolerance where the sweeps begin")
    parser.add_argument("--beyond", type=float, default=0.1, help="share of the target where a sweep ends")
    parser.add_argument(
        "--begin",
        type=lambda text: (text.rpartition("=")[0], float(text.rpartition("=")[2])),
        action="append",
        default=[],
        help="SOLVER=TOLERANCE: where its sweep begins, if that is below --loosest",
    )
    parser.add_argument(
        "--patience", type=float, default=60.0, help="seconds beyond which a run is not repeated"
    )
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--clock", choices=("wall", "processor"), default="wall", help="processor: if busy")
    parser.add_argument("--out", type=Path, default=Path("bench-solvers"))
    return parser.parse_args(arguments)


def main(arguments: list[str] | None = None) -> None:
    """Compare, print the table, write the files."""
    options = parsed(arguments)
    names = [name for name, (module, _) in SOLVERS.items() if find_spec(module)]
    names = [name for name in names if not {name, name.split()[0]} & set(options.without)]
    rows: list[dict[str, Any]] = []
    options.out.mkdir(parents=True, exist_ok=True)
    for threads in options.threads:
        alone = argparse.Namespace(**(vars(options) | {"threads": threads}))
        for case in cases(options):
            rows += apart(worker, alone, case, names)
            write(rows, options.out / "solvers.csv")  # a long run may be stopped
            label = f"{case.boundary} {case.start} {case.loads[0]:g} .. {case.loads[-1]:g}, seed {case.seed}"
            print(f"done: {threads} threads, n {case.n} {label}", file=sys.stderr, flush=True)
    if "memory" in options.only:
        alone = argparse.Namespace(**(vars(options) | {"threads": min(options.threads)}))
        for n in options.sizes:
            for boundary in options.boundaries:
                case = Case(n, boundary, "cold", (0.01,), options.seeds[0])
                for name in names:
                    rows += apart(peak_memory, alone, case, [name])
    write(rows, options.out / "solvers.csv")
    draw(rows, options.target, options.out / "solvers.png")
    text = table(rows)
    (options.out / "solvers.txt").write_text(text + "\n")
    print(text)


if __name__ == "__main__":
    sys.exit(main())
