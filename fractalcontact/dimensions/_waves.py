"""Single waves of a surface, such as machining marks: found in its white surface, named and removed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.coords import leading_coords
from fractalcontact.base.results import public_result
from fractalcontact.base.validation import Problems
from fractalcontact.dimensions._spectrum import without_trend
from fractalcontact.dimensions._surface_input import Surface, check_surface, read_surfaces
from fractalcontact.dimensions._white_surface import LONGEST, WhiteSurface, carrier, is_beside

Array = np.ndarray[Any, np.dtype[Any]]

SMALLEST = 16  # points along an axis
LARGEST_CROP = 1024  # points along an axis of the part that is searched: a wave runs through all of it
MOST = 32  # waves that are no multiples; more are a pattern
MOST_REPEATED = 0.1  # share of rows or columns: a surface enlarged by repetition
_ROUNDS = 24  # of searches: strong waves hide faint ones
_LEFT = 0.05  # of the mean square increment, below which many waves are all there is
_NONE_LEFT = 1e-8
_LEAST_SHARE = 1e-5  # of the mean square increment: less changes no estimate
_NAMED = 3  # waves in a note
_MULTIPLES = 12  # of a wave that are looked for at their own places
_DIVISORS = 3  # of them: a wave may itself be the second or third multiple of one
_FEW = 3
_BESIDE = 1.5  # modes from a wave that was subtracted
_SAME = 0.5  # modes between a wave and the multiple that it is
_MOST_MULTIPLES, _MISSED = 256, 6  # that are looked for where two are known, up to so many that are not there
_CERTAIN = 8.0  # power of a wave over the expected one, once the strong ones beside it are gone
_ON_COMB = 4.0  # power of such a multiple over the expected one: 2 % of the modes have it
_NAMES = ("wavelength", "wave_azimuth", "wave_amplitude", "wave_p_value", "run_time", "wave")


def _check(problems: Problems) -> None:
    check_surface(problems, smallest=SMALLEST, gaps=False, reserved=_NAMES)


@public_result(
    title="Single waves of a surface",
    achieved_error="at most one surface in 1000 without a wave shows one",
    references="Fisher, Proceedings of the Royal Society A 125 (1929) 54-59",
    check=_check,
    memory=88.0,
)
def waves(surface: xr.DataArray) -> xr.Dataset:
    """Find the single waves of a surface, such as marks of machining, in any direction.

    Parameters
    ----------
    surface : DataArray
        Heights in m, dims (..., y, x), or (..., x) for a profile, without gaps; at least 16 points along each
        axis.

    Returns
    -------
    Dataset over the leading dims and `wave`, the strongest first
        `wavelength` (m), `wave_azimuth` (degree anticlockwise from E, 0 ... 180, the direction across the
        crests), `wave_amplitude` (m, from the mean to a crest) and `wave_p_value`, the probability that a
        surface without single waves has one that stands out as much. NaN beyond the last wave.

    Raises
    ------
    InvalidInput
        Wrong axes, a surface too small, or gaps.

    Notes
    -----
    Found where the probability is below 0.001; wavelengths from two spacings to a quarter of the extent (a
    seventh of a profile). Among N points a wave is found from an amplitude of about 8 sqrt(S / N) on, S being
    the power spectral density at its wavelength over the area of a cell. At 128 x 128 points that is 0.1 rms
    increments at 6 spacings, 0.3 at 12 and 0.8 at 24 (H = 0.5); at 256 x 256 half of it. Multiples of a
    wave that are shorter than two spacings are listed at their aliases. `estimate` removes what is found.
    Detection, false alarms and accuracy: page `estimator_accuracy`.

    References
    ----------
    Fisher (1929), Proc. R. Soc. A 125.

    Examples
    --------
    >>> import numpy as np, fractalcontact as fc
    >>> ground = fc.surfaces.fbm((128, 128), 1e-5, hurst=0.7, rms_increment=1e-7, rng=1)
    >>> marks = 1e-7 * np.cos(2 * np.pi * (0.6 * ground.x + 0.8 * ground.y) / 5e-5)
    >>> result = fc.dimensions.waves(ground + marks)
    >>> print(f"{float(result.wavelength[0]):.1e} m at {float(result.wave_azimuth[0]):.0f} degrees")
    5.0e-05 m at 53 degrees
    """
    found = [find_waves(single) for single in read_surfaces(surface)]
    return _dataset(surface, found)


@dataclass(frozen=True, eq=False)
class Wave:
    """One wave of a surface.

    Attributes
    ----------
    wavelength, azimuth, amplitude : float
        In m, degrees, and m.
    p_value : float
    cycles : (y, x)
        Per point.
    cosine, sine : float
        Amplitudes in the unit of the scaled heights, with the phase 0 at the first point.
    on_comb : bool
        Looked for at a multiple of others, whose frequency it has.
    """

    wavelength: float
    azimuth: float
    amplitude: float
    p_value: float
    cycles: tuple[float, float]
    cosine: float
    sine: float
    on_comb: bool = False


def without_waves(surface: Surface) -> tuple[Surface, str]:
    """Return a surface without its single waves, and a note that names them; itself if it has none.

    Where little is left, or the wavelengths are in geometric progression, the waves are the surface itself,
    as the terms of a Weierstrass function are.
    """
    if min(surface.grid.shape) < SMALLEST or surface.is_constant or not surface.is_complete:
        return surface, ""
    found = find_waves(surface)
    if not found:
        return surface, ""
    heights = _subtracted(surface.heights, found)
    left = _mean_square_increment(heights) / _mean_square_increment(surface.heights)
    combs = [members for _, members in _combs(found, heights.shape)]
    if left < (_LEFT if len(combs) > _FEW else _NONE_LEFT) or _is_progression(found):
        return surface, ""
    named = ", ".join(map(_name, combs[:_NAMED]))
    more = f" and {len(combs) - _NAMED} weaker ones" if len(combs) > _NAMED else ""
    count = f"{len(combs)} single waves" if len(combs) > 1 else "a single wave"
    without = surface.with_heights(heights)
    return without, f"{count} removed: {named}{more}"


def _name(comb: dict[int, Wave]) -> str:
    first, wave = min(comb.items())
    others = f" and {len(comb) - 1} of its multiples" if len(comb) > 1 else ""
    if first > 1:
        others = f" and {len(comb) - 1} more multiples of {wave.wavelength * first:.3g} m"
    return (
        f"{wave.wavelength:.3g} m at {wave.azimuth:.0f} degrees with the amplitude "
        f"{wave.amplitude:.2g} m{others}"
    )


def _is_progression(found: Sequence[Wave]) -> bool:
    """Return whether more than a few wavelengths have one ratio from each to the next."""
    ratios = np.diff(np.log(np.sort([wave.wavelength for wave in found])))
    return len(found) > _FEW and bool(np.ptp(ratios) < 0.02 * ratios.mean())


def find_waves(surface: Surface) -> list[Wave]:
    """Return the single waves of a complete surface or profile, the strongest first.

    Waves are searched in rounds, as a strong one hides others; none if there are more than a few dozen. The
    multiples of a wave, which the cusps of a turned surface have, are few places, and stand on its ray.
    Blocks of equal heights are periodic, but no waves.
    """
    if surface.repeated_share > MOST_REPEATED:
        return []
    heights, shape = surface.heights, surface.heights.shape
    crop = tuple(
        slice((n - size) // 2, (n - size) // 2 + size)
        for n, size in zip(shape, np.minimum(shape, LARGEST_CROP), strict=True)
    )
    is_whole = max(shape) <= LARGEST_CROP
    is_periodic = all(surface.grid.periodic) and is_whole

    def whitened(heights: Array, is_tapered: bool) -> WhiteSurface:
        part = without_trend(heights, plane=not is_periodic)
        spacing = surface.plane_spacing
        return WhiteSurface.of(part, spacing, is_periodic=is_periodic, is_tapered=is_tapered)

    found: list[Wave] = []
    new: list[Wave] = []
    is_tapered = not is_periodic  # strong waves first
    for _ in range(_ROUNDS):
        if new and is_whole and not is_periodic:
            # without strong waves the surface is whiter, and its waves are measured better
            white = whitened(heights, is_tapered)
            corrected = [_corrected(surface, wave, white) for wave in new]
            heights = _subtracted(heights, new, -1.0)
            new = [
                wave
                for wave, ratio in corrected
                if is_tapered or ratio > min(_CERTAIN, -0.5 * np.log(max(wave.p_value, 1e-300)))
            ]
            heights = _subtracted(heights, new)
        found += new
        if len(found) > MOST and len(_combs(found, heights.shape)) > MOST:
            return []
        white = whitened(heights[crop], is_tapered)
        new = _of_combs(surface, found, white) if is_whole and not is_tapered else []
        peaks = [] if new else white.peaks(_related(found, white.white.shape))
        whole = white if is_whole or not peaks else whitened(heights, is_tapered)
        for peak in peaks:
            at = peak.cycles if is_whole else whole.refined(peak.cycles, max(shape) / LARGEST_CROP)[0]
            if beside := [wave for wave in found if is_beside(at, np.array(wave.cycles), shape)]:
                # what a wave has left of itself: both are fitted as one
                heights = _subtracted(heights, beside, -1.0)
                found = [wave for wave in found if wave not in beside]
                at, whole = np.array(beside[0].cycles), whitened(heights, is_tapered)
            cycles, amplitudes = whole.fitted(at, peak.ratio)
            wave = _named(surface, cycles, amplitudes, peak.p_value)
            if _share(heights, wave) > _LEAST_SHARE:
                new.append(wave)
        heights = _subtracted(heights, new)
        if not (new or is_tapered) or _is_progression(found):
            break
        if is_tapered and not new:  # all of them are measured again, without the taper
            is_tapered, found, new = False, [], found
    return sorted(found, key=lambda wave: -wave.amplitude)


def _corrected(surface: Surface, wave: Wave, white: WhiteSurface) -> tuple[Wave, float]:
    """Return a wave that was subtracted, with what is left of it in a white surface, and its power there."""
    cycles, amplitudes = np.array(wave.cycles), np.array([wave.cosine, wave.sine])
    shift, rest = (0.0, np.array(white.wave(cycles)[:2])) if wave.on_comb else white.step(cycles, amplitudes)
    corrected = _named(surface, cycles + shift, amplitudes + rest, wave.p_value, on_comb=wave.on_comb)
    return corrected, white.power_of(cycles, amplitudes + rest)


def _combs(found: Sequence[Wave], shape: tuple[int, ...]) -> list[tuple[Array, dict[int, Wave]]]:
    """Sort waves by the one whose multiples they are: its cycles per point, and the waves by their multiple.

    The multiples of marks, as those of a sawtooth, may be found where the first of them is not.
    """
    left, result = sorted(found, key=lambda wave: -wave.amplitude), []
    while left:
        best: dict[int, Wave] = {}
        cycles = np.array([wave.cycles for wave in left])
        divisors = np.arange(1, _MULTIPLES + 1)
        all_apart = _apart(cycles, cycles[0] / divisors[:, None], 2 * _MULTIPLES, shape)
        for divisor, apart in enumerate(all_apart, 1):
            least = max(len(best), 1 + (divisor > _DIVISORS))
            may_be = int(np.count_nonzero((apart < _SAME).any(axis=0)))
            if may_be > least and len(members := _members(left, apart)) > least:
                best = members
        best = best or {1: left[0]}
        if len(best) > _FEW:
            best |= _members(left, _apart(cycles, _base(best, shape), _MOST_MULTIPLES, shape))
        left = [wave for wave in left if wave not in best.values()]
        result.append((_base(best, shape), best))
    return result


def _apart(cycles: Array, bases: Array, most: int, shape: tuple[int, ...]) -> Array:
    """Return how many modes waves are apart from the multiples of bases: (..., multiple below most, wave)."""
    multiples = np.arange(1, most)[:, None] * bases[..., None, :]
    return _unfolded(cycles, multiples[..., None, :], shape)[1]


def _members(waves: Sequence[Wave], apart: Array) -> dict[int, Wave]:
    """Return the waves that are multiples of a base, by their multiple; `apart` as of `_apart`."""
    members: dict[int, Wave] = {}
    for row, column in np.argwhere(apart < _SAME):
        if waves[column] not in members.values():
            members.setdefault(int(row) + 1, waves[column])
    return members


def _base(members: dict[int, Wave], shape: tuple[int, ...]) -> Array:
    """Return the cycles per point of a wave from those of its multiples, the most certain of them first."""
    multiple, strongest = max(members.items(), key=lambda member: member[1].amplitude)
    base = np.array(strongest.cycles) / multiple
    # the power of a wave over that of the surface, whose exponent is taken as 0.5
    weights = {k: (wave.amplitude * wave.wavelength**-1.5) ** 2 for k, wave in members.items()}
    total = sum(weight * k * k for k, weight in weights.items())
    return np.asarray(
        sum(
            weights[k] * k * _unfolded(np.array(wave.cycles), base * k, shape)[0]
            for k, wave in members.items()
        )
        / total
    )


def _unfolded(waves: Array, cycles: Array, shape: tuple[int, ...]) -> tuple[Array, Array]:
    """Return the cycles of waves before sampling, the nearest to some, and how many modes they are apart."""
    both = [waves + np.rint(cycles - waves), np.rint(cycles + waves) - waves]
    apart = [np.maximum(*np.moveaxis(np.abs((each - cycles) * shape), -1, 0)) for each in both]
    return np.where((apart[0] <= apart[1])[..., None], *both), np.minimum(*apart)


def _of_combs(surface: Surface, found: Sequence[Wave], white: WhiteSurface) -> list[Wave]:
    """Return further multiples of waves of which two are known: as their places are, little is enough."""
    shape, level = white.white.shape, None
    new: list[Wave] = []
    for base, members in _combs(found, shape):
        if len(members) < 2:
            continue
        level = level or white.level()
        missed = 0
        known = np.array([wave.cycles for wave in [*found, *new]])
        multiples = np.setdiff1d(np.arange(1, _MOST_MULTIPLES), list(members))
        places = (multiples[:, None] * base + 0.5) % 1.0 - 0.5
        is_free = _unfolded(known, places[:, None], shape)[1].min(axis=1) >= _BESIDE
        is_free &= np.hypot(*(places * shape).T) >= LONGEST[surface.axes]
        own: list[Array] = []
        for cycles in places[is_free]:
            if missed > _MISSED:
                break
            if own and _unfolded(np.array(own), cycles, shape)[1].min() < _BESIDE:
                continue
            cosine, sine, ratio = white.wave(cycles)
            ratio /= level.at(cycles)
            missed += 1
            if ratio > _ON_COMB:
                missed = 0
                own.append(cycles)
                new.append(_named(surface, cycles, (cosine, sine), float(np.exp(-ratio)), on_comb=True))
    return new


def _related(found: Sequence[Wave], shape: tuple[int, ...]) -> list[Array]:
    """Return the cycles per point of the multiples of single waves, and of those whose multiples they may be.

    Multiples shorter than two spacings are seen at their aliases. Each place is listed once.
    """
    done, related = [np.array(wave.cycles) for wave in found], []
    for wave in (next(iter(members.values())) for _, members in _combs(found, shape) if len(members) == 1):
        for divisor in range(1, _DIVISORS + 1):
            for multiple in range(1, _MULTIPLES + 1):
                at = np.array(wave.cycles) * multiple / divisor
                if divisor > 1 and float(np.abs(at).max()) > 0.5:
                    break
                at = (at + 0.5) % 1.0 - 0.5
                if _unfolded(np.array(done), at, shape)[1].min() > 1.0:
                    done.append(at)
                    related.append(at)
    return related


def _named(
    surface: Surface,
    cycles: Array,
    amplitudes: Sequence[float] | Array,
    p_value: float,
    on_comb: bool = False,
) -> Wave:
    """Return a wave of given cycles per point and amplitudes of its cosine and sine, in SI units."""
    waves_per_metre = np.array(cycles) / np.array(surface.spacing)
    return Wave(
        wavelength=float(1.0 / np.hypot(*waves_per_metre)),
        azimuth=float(np.degrees(np.arctan2(*waves_per_metre)) % 180.0),
        amplitude=float(np.hypot(*amplitudes)) * surface.unit,
        p_value=p_value,
        cycles=(float(cycles[0]), float(cycles[1])),
        cosine=float(amplitudes[0]),
        sine=float(amplitudes[1]),
        on_comb=on_comb,
    )


def _subtracted(heights: Array, found: Sequence[Wave], factor: float = 1.0) -> Array:
    """Return heights less `factor` times some waves."""
    result = heights.copy()
    for wave in found:
        result -= (carrier(heights.shape, wave.cycles) * (factor * complex(wave.cosine, -wave.sine))).real
    return result


def _share(heights: Array, wave: Wave) -> float:
    """Return the mean square increment of a wave over that of some heights, along both axes."""
    total = sum(
        float(np.mean(np.diff(heights, axis=axis) ** 2)) for axis in (0, 1) if heights.shape[axis] > 1
    )
    square = wave.cosine**2 + wave.sine**2
    return float(square * np.sum(1.0 - np.cos(2.0 * np.pi * np.array(wave.cycles)))) / max(total, 1e-300)


def _mean_square_increment(heights: Array) -> float:
    steps = np.diff(heights, axis=1)
    return float(np.mean(steps * steps))


def _dataset(surface: xr.DataArray, found: Sequence[Sequence[Wave]]) -> xr.Dataset:
    """Return the waves of all surfaces, padded with NaN to the largest number of them."""
    axes = 2 if "y" in surface.dims else 1
    leading = surface.dims[: surface.ndim - axes]
    most = max(len(each) for each in found)
    shape = [*(surface.sizes[dim] for dim in leading), most]
    data: dict[str, Any] = {}
    for name, field in zip(_NAMES, ("wavelength", "azimuth", "amplitude", "p_value"), strict=False):
        values = np.full((len(found), most), np.nan)
        for row, each in enumerate(found):
            values[row, : len(each)] = [getattr(wave, field) for wave in each]
        data[name] = (*leading, "wave"), values.reshape(shape)
    coords: dict[str, Any] = dict(leading_coords(surface, leading, taken=(*data, "run_time")))
    return xr.Dataset(data, coords=coords | {"wave": np.arange(most)})
