"""Coverage and error of the default estimate of the exponent, by kind of surface, with own generators.

    python estimator_kinds.py                       # 20 surfaces of each kind and exponent, 128 x 128 points
    python estimator_kinds.py --members 300 --sizes 128,256 --kinds exact,mark --out kinds
    python estimator_kinds.py --out kinds --table   # of what was measured

Nothing here calls the synthesis of the package: fractional Brownian heights are exact (Stein 2002, J. Comput.
Graph. Stat. 11), others are sums of Fourier modes. Each surface has a seed of its own, so that a run can be
continued. Writes `estimates.csv` into `--out`, a row for each surface, and prints for each kind the coverage
of the 95 % intervals, their median width, the root mean square error, the same over the Cramer-Rao bound of
an exact surface, the share of intervals that were withheld, and the processor time.
"""

from __future__ import annotations

import argparse
import csv
import os
import sys
import time
from collections.abc import Callable
from functools import lru_cache, partial
from pathlib import Path
from typing import Any
from zlib import crc32

os.environ.setdefault("FRACTALCONTACT_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")  # numpy reads it when it is imported

import numpy as np
from scipy import ndimage, special

import fractalcontact as fc

Array = np.ndarray[Any, np.dtype[Any]]
Generator = np.random.Generator

SPACING, HEIGHT = 1e-4, 1e-6  # m
MARGIN = 24  # points beyond the edges, which a filter reaches
COLUMNS = ("kind", "hurst", "size", "member", "estimate", "low", "high", "reason", "seconds")


@lru_cache(maxsize=8)
def _embedding(n: int, hurst: float) -> tuple[Array, float]:
    """Return the roots of the eigenvalues of a torus that holds n x n Brownian points, and its slope."""
    alpha = 2.0 * hurst
    beta, reach = 0.0, 1.0
    square, level = 0.5 * alpha, 1.0 - 0.5 * alpha
    if alpha > 1.5:
        reach = 2.0
        beta = alpha * (2.0 - alpha) / (3.0 * reach * (reach**2 - 1.0))
        square = 0.5 * (alpha - beta * (reach - 1.0) ** 2 * (reach + 2.0))
        level = beta * (reach - 1.0) ** 3 + 1.0 - square
    edge = 2 * int(reach) * n
    steps = np.minimum(np.arange(edge), edge - np.arange(edge)) / n
    r = np.hypot(steps[:, None], steps)
    beyond = np.where(r <= reach, beta * (reach - r) ** 3 / np.maximum(r, 1e-12), 0.0)
    covariance = np.where(r <= 1.0, level - r**alpha + square * r * r, beyond)
    return np.sqrt(np.maximum(np.fft.rfft2(covariance).real, 0.0)), square


def brownian(n: int, hurst: float, rng: Generator) -> Array:
    """Return n x n fractional Brownian heights of unit rms increment."""
    roots, square = _embedding(n, hurst)
    edge = roots.shape[0]
    z = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((edge, edge))) * roots, (edge, edge))[:n, :n]
    slope = rng.standard_normal(2) * np.sqrt(2.0 * square)
    y, x = np.mgrid[:n, :n] / n
    return np.asarray((z + slope[0] * y + slope[1] * x) * n**hurst / np.sqrt(2.0))


def from_spectrum(n: int, density: Callable[[Array], Array], rng: Generator) -> Array:
    """Return a quarter of a periodic surface without aliases; `density` is that of cycles per point."""
    edge = 2 * n
    frequency = np.hypot(np.fft.fftfreq(edge)[:, None], np.fft.rfftfreq(edge))
    frequency[0, 0] = np.inf
    modes = np.fft.rfft2(rng.standard_normal((edge, edge))) * np.sqrt(density(frequency))
    z = np.fft.irfft2(modes, (edge, edge))[:n, :n]
    return np.asarray(z / np.sqrt(np.mean(np.diff(z, axis=1) ** 2)))


def matern(n: int, hurst: float, rng: Generator, corner: float) -> Array:
    """Return n x n exact points of the Matern covariance with a roll-off at a wavelength in points."""
    edge = 4 * n
    steps = np.minimum(np.arange(edge), edge - np.arange(edge)) * 2.0 * np.pi / corner
    r = np.maximum(np.hypot(steps[:, None], steps), 1e-9)
    covariance = np.exp2(1.0 - hurst) / special.gamma(hurst) * r**hurst * special.kv(hurst, r)
    roots = np.sqrt(np.maximum(np.fft.rfft2(covariance).real, 0.0))
    z = np.fft.irfft2(np.fft.rfft2(rng.standard_normal((edge, edge))) * roots, (edge, edge))[:n, :n]
    return np.asarray(z / np.sqrt(2.0 * (covariance[0, 0] - covariance[0, 1])))


def blurred(n: int, hurst: float, rng: Generator, spread: float = 0.0, noise: float = 0.0) -> Array:
    """Return a surface after a Gaussian blur and white noise."""
    z = brownian(n + 2 * MARGIN, hurst, rng)
    z = ndimage.gaussian_filter(z, spread) if spread else z
    return inner(z, n) + noise * rng.standard_normal((n, n))


def inner(z: Array, n: int) -> Array:
    """Return the n x n points in the middle."""
    start = (z.shape[0] - n) // 2
    return z[start : start + n, start : start + n]


def marked(n: int, hurst: float, rng: Generator, waves: int = 1) -> Array:
    """Return a surface with waves of one rms increment, 4 to 24 spacings long."""
    z = brownian(n, hurst, rng)
    y, x = np.mgrid[:n, :n]
    for length in rng.uniform(4.0, 24.0, waves):
        angle, phase = rng.uniform(0.0, [np.pi, 2.0 * np.pi])
        z = z + np.cos(2.0 * np.pi / length * (x * np.cos(angle) + y * np.sin(angle)) + phase)
    return z


def with_gaps(n: int, hurst: float, rng: Generator, share: float, size: float = 0.0) -> Array:
    """Return a surface without a share of its points, in patches of a size in points."""
    field = rng.standard_normal((n, n))
    field = ndimage.gaussian_filter(field, size) if size else field
    return np.where(field < np.quantile(field, share), np.nan, brownian(n, hurst, rng))


def sum_of_two(n: int, hurst: float, rng: Generator, lag: float) -> Array:
    """Return the sum of surfaces of H and of 0.8 whose increments are equal over a lag in spacings."""
    return brownian(n, hurst, rng) + lag ** (hurst - 0.8) * brownian(n, 0.8, rng)


def knee(n: int, hurst: float, rng: Generator, corner: float, long_hurst: float) -> Array:
    """Return a surface with another exponent beyond a wavelength in points."""

    def density(frequency: Array) -> Array:
        bend = np.minimum(frequency * corner, 1.0) ** (2.0 * (hurst - long_hurst))
        return frequency ** (-2.0 - 2.0 * hurst) * bend

    return from_spectrum(n, density, rng)


def box_mean(n: int, hurst: float, rng: Generator) -> Array:
    """Return the mean over 3 x 3 points."""
    return inner(ndimage.uniform_filter(brownian(n + 2 * MARGIN, hurst, rng), 3), n)


def area_mean(n: int, hurst: float, rng: Generator) -> Array:
    """Return the mean over the area of each point, of 4 x 4 finer points."""
    z = brownian(4 * n, hurst, rng) * 4.0**hurst
    return np.asarray(z.reshape(n, 4, n, 4).mean(axis=(1, 3)))


def moved(n: int, hurst: float, rng: Generator) -> Array:
    """Return a surface moved by half a point, linearly interpolated."""
    return inner(ndimage.shift(brownian(n + 2 * MARGIN, hurst, rng), 0.5, order=1), n)


def turned(n: int, hurst: float, rng: Generator) -> Array:
    """Return a surface turned by 20 degrees with cubic splines."""
    return inner(ndimage.rotate(brownian(int(1.4 * n), hurst, rng), 20.0, reshape=False, order=3), n)


def finer(n: int, hurst: float, rng: Generator) -> Array:
    """Return a surface interpolated to 1.5 times as many points with cubic splines."""
    return inner(ndimage.zoom(brownian(int(n / 1.5) + 2 * MARGIN, hurst, rng), 1.5, order=3), n)


def high_passed(n: int, hurst: float, rng: Generator) -> Array:
    """Return a surface less its Gaussian mean over an eighth of the extent."""
    z = brownian(2 * n, hurst, rng)
    spread = n / 8.0 * np.sqrt(np.log(2.0) / 2.0) / np.pi  # cut-off of ISO 16610: half the amplitude is left
    return inner(z - ndimage.gaussian_filter(z, spread), n)


def stepped(n: int, hurst: float, rng: Generator) -> Array:
    """Return a surface with an oblique step of five rms increments."""
    y, x = np.mgrid[:n, :n] - 0.5 * n
    return brownian(n, hurst, rng) + 5.0 * (np.cos(0.4) * x + np.sin(0.4) * y > 0.1 * n)


def skewed(n: int, hurst: float, rng: Generator) -> Array:
    """Return heights with a quarter of their square added."""
    z = brownian(n, hurst, rng)
    z -= z.mean()
    return z + 0.25 * z * z / z.std()


def stretched(n: int, hurst: float, rng: Generator) -> Array:
    """Return an anisotropic surface: increments along y as over twice the lag along x."""
    return brownian(2 * n, hurst, rng)[::2, :n]


def under_oblique_lay(n: int, hurst: float, rng: Generator) -> Array:
    """Return an exact surface whose lengths differ by 2.8 to 1, at 22 degrees to the axes.

    Its points are a lattice of an isotropic surface: 4 points along x and 1 along y apart, and 1 and 2.
    """
    x, y = np.arange(n), np.arange(n)[:, None]
    return brownian(5 * n, hurst, rng)[x + 2 * y, 4 * x + y]


def filtered(n: int, hurst: float, rng: Generator, transfer: Callable[[Array], Array]) -> Array:
    """Return a surface after a filter; `transfer` is that of radians per point."""
    z = brownian(n + 2 * MARGIN, hurst, rng)
    edge = z.shape[0]
    mirrored = np.pad(z, ((0, edge), (0, edge)), "symmetric")  # so that opposite edges do not meet
    q = 2.0 * np.pi * np.hypot(np.fft.fftfreq(2 * edge)[:, None], np.fft.rfftfreq(2 * edge))
    seen = np.fft.irfft2(np.fft.rfft2(mirrored) * transfer(q), mirrored.shape)
    return inner(seen[:edge, :edge], n)


def through_lens(n: int, hurst: float, rng: Generator, finest: float) -> Array:
    """Return a surface seen by a lens without aberrations, in incoherent light (Goodman 2005).

    It shows no waves shorter than `finest` spacings.
    """

    def transfer(q: Array) -> Array:
        share = np.minimum(finest * q / (2.0 * np.pi), 1.0)
        return np.asarray(2.0 / np.pi * (np.arccos(share) - share * np.sqrt(1.0 - share**2)))

    return filtered(n, hurst, rng, transfer)


def long_tails(n: int, hurst: float, rng: Generator, width: float) -> Array:
    """Return a surface after the point spread (1 + (r / width)^2)^(-3/2), r in points."""
    return filtered(n, hurst, rng, lambda q: np.exp(-width * q))


def modulated(n: int, hurst: float, rng: Generator) -> Array:
    """Return heights whose amplitude is lognormal, .3, and smooth over a sixteenth of the extent."""
    field = ndimage.gaussian_filter(rng.standard_normal((n, n)), n / 16.0)
    z = brownian(n, hurst, rng)
    return np.asarray((z - z.mean()) * np.exp(0.3 * (field - field.mean()) / field.std()))


def profile(n: int, hurst: float, rng: Generator, spread: float = 0.0) -> Array:
    """Return n points of an exact profile (Davies and Harte 1987), after a blur."""
    size = n + 2 * MARGIN
    lag = np.minimum(np.arange(2 * size), 2 * size - np.arange(2 * size)).astype(float)
    power = 2.0 * hurst
    covariance = 0.5 * ((lag + 1.0) ** power + np.abs(lag - 1.0) ** power) - lag**power
    roots = np.sqrt(np.maximum(np.fft.rfft(covariance).real, 0.0))
    z = np.cumsum(np.fft.irfft(np.fft.rfft(rng.standard_normal(2 * size)) * roots, 2 * size)[:size])
    z = ndimage.gaussian_filter1d(z, spread) if spread else z
    return np.asarray(z[MARGIN : MARGIN + n])


THREE = (0.2, 0.5, 0.9)
KINDS: dict[str, tuple[Callable[..., Array], tuple[float, ...]]] = {
    "exact": (brownian, THREE),
    **{
        f"blur_{spread:g}_noise_{noise:g}": (partial(blurred, spread=spread, noise=noise), THREE)
        for spread in (0.0, 0.5, 1.0, 2.0, 3.0)
        for noise in (0.0, 0.05)
        if spread or noise
    },
    "noise_0.2": (partial(blurred, noise=0.2), THREE),
    "mark": (marked, THREE),
    "five_marks": (partial(marked, waves=5), THREE),
    "gaps_10_percent": (partial(with_gaps, share=0.1), THREE),
    "patches_30_percent": (partial(with_gaps, share=0.3, size=3.0), THREE),
    "slow_rolloff_16": (partial(matern, corner=16.0), THREE),
    "sudden_rolloff_16": (partial(knee, corner=16.0, long_hurst=-1.0), THREE),
    "knee_16": (partial(knee, corner=16.0, long_hurst=0.8), (0.3,)),
    "sum_lag_3": (partial(sum_of_two, lag=3.0), (0.3,)),
    "sum_lag_8": (partial(sum_of_two, lag=8.0), (0.3,)),
    "high_pass": (high_passed, THREE),
    "mean_3x3": (box_mean, THREE),
    "mean_of_area": (area_mean, THREE),
    "moved_bilinear": (moved, THREE),
    "turned_cubic": (turned, THREE),
    "finer_cubic": (finer, THREE),
    "step": (stepped, THREE),
    "rounded": (lambda n, hurst, rng: np.round(brownian(n, hurst, rng) / 0.5) * 0.5, THREE),
    "skewed": (skewed, THREE),
    "anisotropic": (stretched, THREE),
    "oblique_lay": (under_oblique_lay, THREE),
    "lens": (partial(through_lens, finest=3.0), THREE),
    "long_tails": (partial(long_tails, width=0.5), THREE),
    "modulated": (modulated, THREE),
    "profile": (profile, THREE),
    "profile_blur_1": (partial(profile, spread=1.0), THREE),
}


def measure(kind: str, hurst: float, n: int, member: int, seed: int) -> dict[str, Any]:
    """Return a row of `COLUMNS`; a profile has n^2/16 points."""
    rng = np.random.default_rng([crc32(kind.encode()), int(100 * hurst), n, member, seed])
    heights = KINDS[kind][0](n * n // 16 if kind.startswith("profile") else n, hurst, rng)
    surface = fc.surfaces.from_array(HEIGHT * heights, SPACING)
    start = time.process_time()
    found = fc.dimensions.estimate(surface)
    seconds = time.process_time() - start
    values = [float(found[name].squeeze()) for name in ("hurst", "ci_low", "ci_high")]
    reason = str(found["reason"].squeeze().values)
    row = (kind, hurst, n, member, *(f"{value:.5f}" for value in values), reason, f"{seconds:.3f}")
    return dict(zip(COLUMNS, row, strict=True))


def table(rows: list[dict[str, str]]) -> list[str]:
    """Return the lines of the table, a kind and size in each, with a column for each exponent."""
    from fractalcontact.accuracy._cramer_rao import brownian_bound

    cells: dict[tuple[str, int], dict[float, list[dict[str, str]]]] = {}
    for row in rows:
        cells.setdefault((row["kind"], int(row["size"])), {}).setdefault(float(row["hurst"]), []).append(row)
    lines = [
        "kind, size, members: coverage | median width | rms error | over bound | withheld | median seconds"
    ]
    for (kind, n), by_hurst in sorted(
        cells.items(), key=lambda cell: (cell[0][1], list(KINDS).index(cell[0][0]))
    ):
        texts: list[list[str]] = [[], [], [], [], [], []]
        for hurst, members in sorted(by_hurst.items()):
            estimate, low, high, seconds = (
                np.array([float(row[name]) for row in members])
                for name in ("estimate", "low", "high", "seconds")
            )
            known = np.isfinite(low)
            error = float(np.sqrt(np.nanmean(np.square(estimate - hurst))))
            is_profile = kind.startswith("profile")
            bound = brownian_bound(hurst, n * n // 16 if is_profile else n, axes=1 if is_profile else 2)
            held = (low <= hurst) & (high >= hurst)
            values = (
                f"{held[known].mean():.3f}" if known.any() else "-",
                f"{np.median((high - low)[known]):.3f}" if known.any() else "-",
                f"{error:.4f}",
                f"{error / bound:.2f}",
                f"{1.0 - known.mean():.2f}",
                f"{np.median(seconds):.2f}",
            )
            for column, value in zip(texts, values, strict=True):
                column.append(value)
        number = "/".join(str(len(members)) for members in by_hurst.values())
        lines.append(f"{kind:22s} {n:4d} {number:11s} " + " | ".join(" ".join(column) for column in texts))
    return lines


def main() -> None:
    """Measure what is not yet there, members in turn over all kinds, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else "")
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--sizes", default="128")
    parser.add_argument("--members", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0, help="of another draw of all surfaces")
    parser.add_argument("--out", type=Path, default=Path("kinds"))
    parser.add_argument("--table", action="store_true", help="print the table of what was measured, and stop")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    path = options.out / "estimates.csv"
    rows: list[dict[str, str]] = list(csv.DictReader(path.open())) if path.exists() else []
    done = {(row["kind"], float(row["hurst"]), int(row["size"]), int(row["member"])) for row in rows}
    if not options.table:
        with path.open("a", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS)
            if not rows:
                writer.writeheader()
            for member in range(options.members):
                for n in map(int, options.sizes.split(",")):
                    for kind in options.kinds.split(","):
                        for hurst in KINDS[kind][1]:
                            if (kind, hurst, n, member) not in done:
                                row = measure(kind, hurst, n, member, options.seed)
                                writer.writerow(row)
                                rows.append({name: str(value) for name, value in row.items()})
                file.flush()
    sys.stdout.write("\n".join(table(rows)) + "\n")


if __name__ == "__main__":
    main()
