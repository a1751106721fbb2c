"""Benchmark of the estimators and the analysis of contact sets against other packages that are installed.

    python packages.py                              # 512 x 512 points, half a minute
    python packages.py --sizes 512,2048,8192 --rounds 5 --out peers

Each row is one question that both answer: how often boxes meet a set, the variogram along x, the power
spectrum, the rms height in windows, the parameters of ISO 25178, islands. The answers are compared first, as
the largest relative difference; then both run in turn, `--rounds` times, on one processor. The ratio is
formed within each round. A peer that takes more than 15 seconds runs once, and one that takes more than
`--limit` seconds is left out at larger sizes. Nothing
here is a dependency:

    pip install porespy gstools scikit-gstat SurfaceTopography surfalize

Writes `peers.csv` and the figure `peers.png` into `--out`.
"""

from __future__ import annotations

import argparse
import csv
import os
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Any

os.environ.setdefault("FRACTALCONTACT_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")  # numpy reads it when it is imported

import numpy as np
import xarray as xr

import fractalcontact as fc

SPACING = 1e-6
PATIENCE = 15.0  # seconds of a peer that is not run again
Answer = Callable[[], np.ndarray]


@dataclass(frozen=True)
class Question:
    """What is asked, the package that answers it too, and both answers for a surface of n x n points."""

    name: str
    peer: str
    both: Callable[[xr.DataArray], tuple[Answer, Answer]]
    expected: str  # how far the answers may differ, and why


def surface_of(n: int) -> xr.DataArray:
    """Return a periodic self-affine surface of n x n points."""
    return fc.surfaces.spectral((n, n), SPACING, hurst=0.7, rms_height=1e-6, rng=1)


def touching(surface: xr.DataArray) -> xr.DataArray:
    """Return the highest tenth of the points."""
    return surface > float(np.quantile(surface.values[::7, ::7], 0.9))


def aligned_boxes(surface: xr.DataArray) -> tuple[Answer, Answer]:
    """Boxes of edge 1, 2, 4 ... on one grid; porespy counts those that hold both phases."""
    import porespy

    mask = touching(surface)
    sizes = 2 ** np.arange(int(np.log2(min(mask.shape))))
    values = mask.values

    def ours() -> np.ndarray:
        boxes = fc.domains.box_counts(mask, sizes, cover="aligned")
        empty = fc.domains.box_counts(~mask, sizes, cover="aligned")
        total = np.prod([-(-n // sizes) for n in mask.shape], axis=0)
        return np.asarray(boxes["box_count"].values + empty["box_count"].values - total)

    return ours, lambda: np.asarray(porespy.metrics.boxcount(values, bins=sizes).count)


def fewest_boxes(surface: xr.DataArray) -> tuple[Answer, Answer]:
    """The fewest boxes over all offsets of the grid, as FracLac asks for; one loop over offsets in numpy."""
    mask = touching(surface)
    sizes = np.array([2, 3, 4, 6, 8, 12, 16])
    values = mask.values

    def by_offsets() -> np.ndarray:
        fewest = []
        for size in sizes:
            counts = []
            for dy in range(size):
                rows = np.add.reduceat(values, np.r_[0, np.arange(dy or size, len(values), size)], axis=0) > 0
                for dx in range(size):
                    columns = np.r_[0, np.arange(dx or size, values.shape[1], size)]
                    counts.append(np.count_nonzero(np.add.reduceat(rows, columns, axis=1)))
            fewest.append(min(counts))
        return np.array(fewest)

    def ours() -> np.ndarray:
        return np.asarray(fc.domains.box_counts(mask, sizes, periodic=False, cover="minimum")["box_count"])

    return ours, by_offsets


def variogram_along_x(surface: xr.DataArray) -> tuple[Answer, Answer]:
    """The variogram along x at every lag, averaged over all rows."""
    import gstools

    free = surface.values
    lines = xr.DataArray(free, dims=("line", "x"), coords={"x": surface["x"].values}, name="height")
    lags = np.arange(1, free.shape[1] // 2 + 1)

    def ours() -> np.ndarray:
        return np.asarray(fc.dimensions.variogram(lines)["variogram"].mean("line").values[: lags.size])

    return ours, lambda: np.asarray(gstools.vario_estimate_axis(free.T, direction="x")[lags])


def variogram_of_profile(surface: xr.DataArray) -> tuple[Answer, Answer]:
    """The variogram of one profile at the lags of a few hundred spacings, from all pairs of points."""
    import skgstat

    heights, lags = surface.values[0], np.arange(1, min(surface.shape[1] // 2, 256) + 1)
    line = xr.DataArray(heights, dims="x", coords={"x": surface["x"].values}, name="height")
    at = np.arange(heights.size, dtype=float)

    def ours() -> np.ndarray:
        curve = fc.dimensions.variogram(line, max_lag=(lags[-1] + 0.01) * SPACING)
        return np.asarray(curve["variogram"].values[: lags.size])

    def theirs() -> np.ndarray:
        # classes end at the bounds: one lag in each
        peer = skgstat.Variogram(at, heights, bin_func=list(lags + 0.5), fit_method=None)
        return np.asarray(peer.experimental)

    return ours, theirs


def power_spectrum(surface: xr.DataArray) -> tuple[Answer, Answer]:
    """The radially averaged power spectrum, at the wavelengths from 8 points to a quarter of the surface."""
    from SurfaceTopography import Topography

    n = surface.shape[0]
    peer = Topography(surface.values.T, (n * SPACING,) * 2, periodic=True)
    wanted = np.geomspace(2 * np.pi * 4 / (n * SPACING), 2 * np.pi / (8 * SPACING), 8)

    def at_wanted(wavenumber: np.ndarray, density: np.ndarray) -> np.ndarray:
        keep = np.isfinite(density) & (density > 0)
        return np.exp(np.interp(np.log(wanted), np.log(wavenumber[keep]), np.log(density[keep])))

    def ours() -> np.ndarray:
        curve = fc.dimensions.spectrum(surface)
        return at_wanted(curve["wavenumber"].values, curve["power_spectral_density"].values)

    return ours, lambda: at_wanted(*peer.power_spectrum_from_area())


def window_roughness(surface: xr.DataArray) -> tuple[Answer, Answer]:
    """The rms height in windows, each about its own plane; the peer's windows do not overlap."""
    from SurfaceTopography import Topography

    n = surface.shape[0]
    free = surface.drop_attrs().assign_coords(x=surface["x"].values, y=surface["y"].values)
    peer = Topography(surface.values.T, (n * SPACING,) * 2)
    wanted = n * SPACING / np.array([4.0, 8.0, 16.0, 32.0])

    def ours() -> np.ndarray:
        curve = fc.dimensions.roughness_length(free)
        return np.asarray(np.interp(wanted[::-1], curve["window_size"], curve["roughness"]))[::-1]

    def theirs() -> np.ndarray:
        bandwidth, rms = peer.variable_bandwidth_from_area()
        order = np.argsort(bandwidth)
        return np.asarray(np.interp(wanted[::-1], np.array(bandwidth)[order], np.array(rms)[order]))[::-1]

    return ours, theirs


def height_parameters(surface: xr.DataArray) -> tuple[Answer, Answer]:
    """Sq, Sa, Ssk, Sku, Sz, Sdq and Sdr."""
    import surfalize

    heights = surface.values * 1e6  # surfalize takes micrometres
    free = surface.drop_attrs().assign_coords(x=surface["x"].values, y=surface["y"].values)
    names = ("rms_height", "mean_absolute_height", "skewness", "kurtosis", "peak_to_valley", "rms_slope")

    def ours() -> np.ndarray:
        parameters = fc.surfaces.describe(free)
        values = [float(parameters[name]) for name in (*names, "developed_area_excess")]
        return np.array(values) * [1e6, 1e6, 1, 1, 1e6, 1, 100]

    def theirs() -> np.ndarray:
        peer = surfalize.Surface(heights, SPACING * 1e6, SPACING * 1e6)  # anew: it remembers its results
        return np.array([getattr(peer, name)() for name in ("Sq", "Sa", "Ssk", "Sku", "Sz", "Sdq", "Sdr")])

    return ours, theirs


def islands(surface: xr.DataArray) -> tuple[Answer, Answer]:
    """Number of islands, cells of the largest, mean area, Euler number (of scikit-image: scipy has none)."""
    from scipy import ndimage
    from skimage.measure import euler_number

    mask = touching(surface)
    values = mask.values

    def ours() -> np.ndarray:
        result = fc.domains.islands(mask, periodic=False, keep=(), include=())
        names = ("n_islands", "largest_cells", "mean_island_area", "euler_number")
        return np.array([float(result[name]) for name in names])

    def theirs() -> np.ndarray:
        label, count = ndimage.label(values)
        cells = np.bincount(label.ravel())[1:]
        euler = euler_number(values, connectivity=1)
        return np.array([count, cells.max(), cells.mean() * SPACING**2, euler])

    return ours, theirs


QUESTIONS = (
    Question("boxes on one grid", "porespy", aligned_boxes, "the same"),
    Question("fewest boxes over all offsets", "numpy", fewest_boxes, "the same"),
    Question("variogram along x, all lags", "gstools", variogram_along_x, "rounding"),
    Question("variogram of a profile", "skgstat", variogram_of_profile, "rounding"),
    Question("radial power spectrum", "SurfaceTopography", power_spectrum, "other rings: 10 %"),
    Question("rms height in windows", "SurfaceTopography", window_roughness, "windows that overlap: 10 %"),
    Question("parameters of ISO 25178", "surfalize", height_parameters, "slopes of other order: 10 %"),
    Question("islands", "scipy", islands, "rounding"),
)


def measure(question: Question, surface: xr.DataArray, rounds: int) -> dict[str, Any]:
    """Return the difference of both answers, their times and the ratio within each round."""
    ours, theirs = question.both(surface)
    mine, start = np.asarray(ours(), float), time.perf_counter()
    other, first = np.asarray(theirs(), float), time.perf_counter() - start
    finite = np.isfinite(mine) & np.isfinite(other)
    scale = np.maximum(np.abs(mine[finite]), 1e-300)
    difference = float(np.max(np.abs(mine[finite] - other[finite]) / scale))
    times: list[tuple[float, float]] = []
    if first > PATIENCE:  # this run is its only round
        start = time.perf_counter()
        ours()
        times, rounds = [(time.perf_counter() - start, first)], 0
    for _ in range(rounds):
        laps = []
        for answer in (ours, theirs):
            start = time.perf_counter()
            answer()
            laps.append(time.perf_counter() - start)
        times.append((laps[0], laps[1]))
    ratios = [their / my for my, their in times]
    return {
        "difference": difference,
        "time": min(my for my, _ in times),
        "peer_time": min(their for _, their in times),
        "ratio_min": min(ratios),
        "ratio_median": statistics.median(ratios),
    }


def main() -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--sizes", default="512")
    parser.add_argument("--only", default="", help="words: questions whose name contains one of them")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--limit", type=float, default=60.0, help="seconds after which a peer is left out")
    parser.add_argument("--out", default="peers")
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    slow: set[str] = set()
    for n in map(int, options.sizes.split(",")):
        surface = surface_of(n)
        for question in QUESTIONS:
            wanted = any(word in question.name for word in options.only.split(","))
            if find_spec(question.peer) is None or question.name in slow or not wanted:
                continue
            row = {"n": n, "question": question.name, "peer": question.peer, "expected": question.expected}
            row |= measure(question, surface, options.rounds)
            rows.append(row)
            if row["peer_time"] > options.limit:
                slow.add(question.name)
            times = f"{row['time']:9.4f} s {row['peer_time']:9.4f} s"
            ratio = f"{row['ratio_median']:7.1f} times (least {row['ratio_min']:.1f})"
            differ = f"answers differ by {row['difference']:.1e} ({question.expected})"
            print(f"{n:5d}  {question.name:30s} {question.peer:18s} {times}  {ratio}  {differ}", flush=True)
    if not rows:
        sys.exit("nothing was measured: none of the other packages is installed")
    out = Path(options.out)
    out.mkdir(parents=True, exist_ok=True)
    with (out / "peers.csv").open("w", newline="", encoding="utf-8") as stream:
        writer = csv.DictWriter(stream, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    draw(rows, out / "peers.png")


def draw(rows: list[dict[str, Any]], target: Path) -> None:
    """Draw both times against n, one panel a question."""
    import matplotlib.pyplot as plt

    names = list(dict.fromkeys(row["question"] for row in rows))
    figure, axes = plt.subplots(2, -(-len(names) // 2), figsize=(12, 6), layout="constrained", sharex=True)
    for ax, name in zip(axes.flat, names, strict=False):
        own = [row for row in rows if row["question"] == name]
        n = [row["n"] for row in own]
        ax.loglog(n, [row["time"] for row in own], "o-", label="fractalcontact")
        ax.loglog(n, [row["peer_time"] for row in own], "s--", label=own[0]["peer"])
        ax.set(title=name, xlabel="points along each axis", ylabel="time (s)")
        ax.legend()
    for ax in axes.flat[len(names) :]:
        ax.remove()
    figure.savefig(target, dpi=150)


if __name__ == "__main__":
    sys.exit(main())
