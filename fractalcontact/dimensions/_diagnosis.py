"""What no exponent describes: spikes, seams, levelled rows, repeated or interpolated points, missing
extremes, products of profiles.

Each is named with the preparation step that removes it; `estimate` then gives no interval. Nothing is
repaired here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from fractalcontact.base.numbers import Array
from fractalcontact.dimensions._mode_bins import LEAST
from fractalcontact.dimensions._surface_input import NOTABLE_SHARE, Surface

# standard deviations of what no surface does by chance: 6.5 was the most of the lines of 5200 exact surfaces,
# H .1 to .97, of 64 to 512 points a side; jumps of two rms increments have 8 or more, missing valleys of 2 to
# 20 % of 256 x 256 points with H .2 and .5 have 6.7 to 34
_DEVIATIONS = 7.0


def diagnose(surface: Surface, *, is_window: bool = False) -> str:
    """Return why no interval holds for a surface, and what to do; empty where nothing was found.

    `is_window`: `scales` leave out the waves that interpolated or repeated points have made.
    """
    if surface.finest_scale:
        return ""
    return (
        ("" if is_window else resampling(surface))
        or _seams(surface.heights, rounding_step(surface))
        or _spikes(surface.heights)
        or _missing_extremes(surface.heights)
        or _product(surface.heights)
    )


def resampling(surface: Surface, linear: float = 0.01) -> str:
    """Return that points were repeated, interpolated or replaced by medians; empty where they were not.

    `linear`: share of heights exactly on a line with their neighbours; measured heights have none.
    """
    if surface.is_enlarged:
        return (
            "many rows or columns repeat their neighbours: the surface was enlarged; remove the repeated "
            "ones, or give `scales` from eight blocks on"
        )
    if surface.linear_share > linear:
        return (
            "many heights lie exactly on lines between neighbours: they are interpolated or medians; give "
            "the points to fractalcontact.surfaces.from_points, or `scales` from eight distances of points on"
        )
    return ""


def rounding_step(surface: Surface, *, rows: int = 16, sample: int = 4096, tolerance: float = 0.02) -> float:
    """Return the step to which scaled heights were rounded; 0 where none is seen in a sample of some rows.

    Second differences are multiples of it, also once a plane was subtracted. `tolerance`: of a step, distance
    of rounded heights from multiples after a change of unit.
    """
    lines = surface.heights[:: max(1, surface.shape[0] // rows)]
    bends = np.diff(lines[:, :: -(-lines.size // sample)], 2, axis=1)
    observed = bends[np.isfinite(bends)]
    # of the numbers themselves: many files hold single precision
    rounding = 8.0 * float(np.finfo(np.float32).eps * np.nanmax(np.abs(lines), initial=0.0))
    levels = np.unique(observed)
    levels = levels[np.diff(levels, prepend=-np.inf) > rounding]
    if observed.size < 8 or levels.size < 2:
        return 0.0
    gaps = np.diff(levels)
    step = float(gaps[gaps > tolerance * np.median(gaps)].min())
    multiples = (observed - levels[0]) / step
    return step if np.abs(multiples - np.rint(multiples)).max() <= tolerance else 0.0


def rounding_noise(surface: Surface) -> float:
    """Return the rms height of the rounding of scaled heights, which counts as white noise."""
    return math.hypot(rounding_step(surface) / math.sqrt(12.0), float(np.finfo(float).eps))


def unevenness(heights: Array, blocks: int = 8, parts: int = 4) -> float:
    """Return by how much the roughness scatters between blocks more than within them, at least 1.

    The variances of the exponent grow by this factor. There are up to 8 x 8 `blocks`, of 4 x 4 `parts` each:
    the scatter within a block has 15 degrees of freedom. Where roughness is even, the variance of the mean
    square second difference of blocks is a sixteenth of that of the parts.
    """
    ny, nx = heights.shape
    shape = (1, nx - 2) if ny == 1 else (ny - 1, nx - 1)
    edges = [max(1, n // (blocks * parts)) for n in shape]
    counts = [n // edge // parts * parts for n, edge in zip(shape, edges, strict=True)]
    if min(count for count, n in zip(counts, shape, strict=True) if n > 1) < 2 * parts:
        return 1.0
    steps = [parts if count else 1 for count in counts]
    ny, nx = (max(count, 1) for count in counts)
    means, number = np.zeros((ny, nx)), np.zeros((ny, nx), dtype=int)
    for row, squares in zip(range(ny), _squared_bends(heights, edges[0]), strict=False):
        part = squares[:, : nx * edges[1]].reshape(edges[0], nx, edges[1])
        number[row] = np.count_nonzero(np.isfinite(part), axis=(0, 2))
        means[row] = np.nansum(part, axis=(0, 2)) / np.maximum(number[row], 1)
    if number.min() == 0 or means.mean() == 0.0:
        return 1.0
    by_block = means.reshape(ny // steps[0], steps[0], nx // steps[1], steps[1])
    within = float(np.mean(by_block.var(axis=(1, 3), ddof=1)))
    between = float(np.var(by_block.mean(axis=(1, 3)), ddof=1)) * steps[0] * steps[1]
    return max(1.0, between / within - 1.0) if within > 0.0 else 1.0


def _squared_bends(heights: Array, rows: int = 32) -> Iterator[Array]:
    """Yield the squares of mixed second differences, which offsets of rows and columns do not change.

    Some rows at a time, which the cache holds. Of a profile those of plain second differences.
    """
    if heights.shape[0] == 1:
        yield np.square(np.diff(heights, 2, axis=1))
    for start in range(0, heights.shape[0] - 1, rows):
        bends = np.diff(np.diff(heights[start : start + rows + 1], axis=0), axis=1)
        yield np.square(bends, out=bends)


def _spikes(heights: Array, size: int = 1 << 20, spike: float = 20.0) -> str:
    """Look for squared differences beyond those of a Gaussian surface.

    The quantile of a sample of this `size` scatters by .2 %. `spike`: standard deviations; 1e8 Gaussian
    second differences reach 5.7, scanned rock faces 39. With less than `NOTABLE_SHARE` of the squares noise
    and misfit describe them.
    """
    step = -(-heights.size // size)
    sample = np.concatenate([squares.ravel()[::step] for squares in _squared_bends(heights)])
    sample = sample[np.isfinite(sample)]
    if sample.size == 0:
        return ""
    # 90 % quantile of chi square over its mean: smooth patches do not move it
    typical = float(np.quantile(sample, 0.9)) / 2.706
    number, above, total = 0, 0.0, 0.0
    for squares in _squared_bends(heights):
        high = squares[squares > spike**2 * typical]
        number, above, total = number + high.size, above + high.sum(), total + np.nansum(squares)
    if typical == 0.0 or above < NOTABLE_SHARE * total:
        return ""
    return (
        f"{number} heights stand out of their neighbours by more than {spike:.0f} standard deviations: "
        "spikes, steps or rougher patches; see fractalcontact.surfaces.despike"
    )


def _seams(heights: Array, step: float, points: int = 512) -> str:
    """Look for lines along an axis across which heights differ more than across all others.

    Heights were rounded to `step`, which is spread evenly again. The median of some `points` of a line
    scatters by 7 %; a seam doubles it. Their standard deviation follows from the range of their middle half,
    which is 1.349 of it in a normal distribution.
    """
    if min(heights.shape) < 16 or np.isnan(heights.min()):
        return ""
    for whole, name in ((heights, "rows"), (heights.T, "columns")):
        lines = np.ascontiguousarray(whole[:, :: max(1, whole.shape[1] // points)])
        # spikes move no median; where heights were rounded, it would jump between a few numbers
        even = np.arange(lines.shape[1]) * 0.5 * (5.0**0.5 - 1.0) % 1.0 - 0.5  # multiples of the golden ratio
        steps = np.diff(lines, axis=0)
        squares = np.median((steps - np.median(steps) + step * even) ** 2, axis=1)
        if not squares.min() > 0.0:
            continue
        low, middle, high = np.quantile(np.log(squares), (0.25, 0.5, 0.75))
        number = int(np.sum(np.log(squares) - middle > _DEVIATIONS * (high - low) / 1.349))
        if number > 0:
            return (
                f"heights jump between {name} at {number} places, as at seams of tiles: analyse the tiles "
                "one by one, or level them first"
            )
    return ""


def _product(heights: Array, lines: int = 32, share: float = 0.9999) -> str:
    """Look for a product f(x) g(y): differences along both axes have rank one.

    They are taken between `lines` of points or a few more, evenly spaced. `share`: of their squares, in the
    largest component. It is .69 at most of 810 surfaces of all kinds of the accuracy page, 33 to 128 points a
    side, and .9988 of one of 33 points blurred by 8.
    """
    down, across = (max(1, n // lines) for n in heights.shape)
    bends = np.diff(np.diff(heights[::down, ::across], axis=0), axis=1)
    if min(bends.shape) < lines - 1 or not np.isfinite(bends.sum()):
        return ""
    squares = np.square(np.linalg.svd(bends, compute_uv=False))
    text = "the heights are a product of a profile along x and one along y: estimate a row and a column alone"
    return text if squares[0] > share * squares.sum() else ""


def _missing_extremes(heights: Array, edge: int = 15) -> str:
    """Look for gaps whose neighbours lie to one side of their surroundings: valleys or peaks are missing.

    `edge`: points along an edge of the surroundings. Of `LEAST` gaps the scatter of their means is known to a
    quarter.
    """
    from scipy.ndimage import grey_dilation, label, uniform_filter

    observed = np.isfinite(heights)
    if observed.all() or heights.shape[0] == 1:
        return ""
    gaps, _ = label(~observed, np.ones((3, 3)))
    border = np.concatenate([gaps[0], gaps[-1], gaps[:, 0], gaps[:, -1]])
    owner = np.where(observed, grey_dilation(np.where(np.isin(gaps, border), 0, gaps), (3, 3)), 0)
    count = np.bincount(owner.ravel())
    numbers = np.flatnonzero(count)[1:]
    if numbers.size < LEAST:
        return ""
    around = uniform_filter(np.where(observed, heights, 0.0), edge)
    around /= np.maximum(uniform_filter(observed.astype(float), edge), 1e-6)
    deviation = np.where(observed, heights - around, 0.0)
    means = (np.bincount(owner.ravel(), deviation.ravel()) / np.maximum(count, 1))[numbers]
    z = float(means.mean() / (means.std(ddof=1) / np.sqrt(numbers.size)))
    if not abs(z) > _DEVIATIONS:
        return ""
    which, side = ("low", "below") if z < 0 else ("high", "above")
    return (
        f"{which} heights are missing: those beside gaps lie {abs(z):.1f} standard deviations {side} their "
        "surroundings; scan again with a larger range, or crop to a complete part"
    )
