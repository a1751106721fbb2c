"""Inputs of the extreme cases: surfaces, masks, and whole calls whose load, path or size is extreme."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

from fractalcontact import contact, surfaces
from fractalcontact.base.grid import plane_coords

Array = np.ndarray[Any, np.dtype[Any]]

SPACING, MODULUS = 1e-4, 1e9  # m, Pa
PLATE_RADIUS = 0.4365941  # of the default circular plate, in spacings


# ---------------------------------------------------------------------------------------------------------
# Surfaces


def constant(height: float) -> xr.DataArray:
    """Return 16 x 16 equal heights."""
    return surfaces.from_array(np.full((16, 16), height), SPACING)


def spike() -> xr.DataArray:
    """Return one node above a plane."""
    return surfaces.from_array(_spike(), SPACING)


def step_of_one_rounding() -> xr.DataArray:
    """Return one node above a plane at 10^9 m, by the last bit of the height."""
    return surfaces.from_array(np.where(_spike() > 0, np.nextafter(1e9, np.inf), 1e9), 1.0)


def _spike() -> Array:
    heights = np.zeros((33, 33))
    heights[16, 16] = 1e-5
    return heights


def plane() -> xr.DataArray:
    """Return a plane of slope 0.1 along x."""
    return surfaces.from_array(1e-5 * np.broadcast_to(np.arange(24.0), (24, 24)), SPACING)


def sphere(n: int = 65, radius: float = 0.05) -> xr.DataArray:
    """Return the cap of a sphere as a paraboloid."""
    y, x = np.mgrid[0:n, 0:n].astype(float)
    middle = (n - 1) / 2
    return surfaces.from_array(-((y - middle) ** 2 + (x - middle) ** 2) * SPACING**2 / (2 * radius), SPACING)


def wave(n: int = 64, amplitude: float = 1e-6) -> xr.DataArray:
    """Return one periodic wave along x."""
    heights = amplitude * np.cos(2 * np.pi * np.arange(float(n)) / n)
    return surfaces.from_array(np.broadcast_to(heights, (n, n)), SPACING, periodic=True)


def white_noise(
    shape: tuple[int, int],
    scale: float = 1e-6,
    spacing: float | tuple[float, float] = SPACING,
    *,
    offset: float = 0.0,
    highest: float = np.inf,
    missing: tuple[int, int] | None = None,
) -> xr.DataArray:
    """Return uncorrelated normal heights, cut off at `highest`, with one missing point if asked for."""
    heights = np.minimum(offset + scale * np.random.default_rng(1).normal(size=shape), highest)
    if missing is not None:
        heights[missing] = np.nan
    return surfaces.from_array(heights, spacing)


def brownian(hurst: float, *, quantum: float | None = None, holes: bool = False) -> xr.DataArray:
    """Return a fractional Brownian surface, rounded to multiples of `quantum`, or with two blocks missing."""
    surface = surfaces.fbm((64, 64), SPACING, hurst=hurst, rms_increment=1e-6, rng=7)
    heights = surface.values.copy()
    if quantum is not None:
        heights = quantum * np.rint(heights / quantum)
    if holes:
        heights[5:15, 5:13] = heights[40:50, 30:40] = np.nan
    return surfaces.from_array(heights, SPACING)


# ---------------------------------------------------------------------------------------------------------
# Masks


def mask(values: Array, *, periodic: bool = False) -> xr.DataArray:
    """Return a mask with coordinates."""
    coords = plane_coords(values.shape, (SPACING, SPACING), (periodic, periodic))
    return xr.DataArray(np.asarray(values, bool), dims=("y", "x"), coords=coords, name="contact")


def uniform_mask(value: bool, shape: tuple[int, int] = (32, 32), *, periodic: bool = False) -> xr.DataArray:
    """Return a mask of equal cells."""
    return mask(np.full(shape, value), periodic=periodic)


def single_cell(*, inverted: bool = False) -> xr.DataArray:
    """Return a mask of one cell, or of all cells but one."""
    values = np.zeros((32, 32), bool)
    values[16, 10] = True
    return mask(~values if inverted else values)


def line(axis: str) -> xr.DataArray:
    """Return a mask of one row (axis "x") or one column."""
    values = np.zeros((32, 32), bool)
    values[16] = True
    return mask(values if axis == "x" else values.T)


def diagonal() -> xr.DataArray:
    """Return the diagonal of 3 x 3 cells."""
    return mask(np.eye(3))


def checkerboard() -> xr.DataArray:
    """Return a periodic mask of every second cell."""
    y, x = np.mgrid[0:32, 0:32]
    return mask(y % 2 == x % 2, periodic=True)


def carpet(levels: int = 4) -> xr.DataArray:
    """Return the carpet of Sierpinski."""
    values = np.ones((1, 1), bool)
    for _ in range(levels):
        values = np.kron(values, np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], bool)).astype(bool)
    return mask(values)


def independent_cells() -> xr.DataArray:
    """Return a random mask of one cell in ten."""
    return mask(np.random.default_rng(3).random((64, 64)) < 0.1)


# ---------------------------------------------------------------------------------------------------------
# Calls: each returns the numbers that are compared with what is expected


def _numbers(**values: Any) -> xr.Dataset:
    return xr.Dataset({name: float(value) for name, value in values.items()})


def stiff_and_soft() -> xr.Dataset:
    """Return the pair modulus of a stiff and a 10^6 times softer body over that of a rigid and a soft one."""
    soft, ratio = 1e6, 1e6
    pair = contact.effective_modulus(soft * ratio, 0.2, soft, 0.3)
    return _numbers(
        ratio_to_soft=pair / (soft / (1 - 0.3**2)),
        ratio_swapped=pair / contact.effective_modulus(soft, 0.3, soft * ratio, 0.2),
    )


def one_contact() -> xr.Dataset:
    """Return area and closure of a single node under a force so small that no other node touches."""
    surface = white_noise((32, 32))
    force = 1e-9 * MODULUS * SPACING**2
    pressed = contact.press(surface, contact_modulus=MODULUS, normal_force=force, influence="disc", keep=())
    plate = force / (2.0 * PLATE_RADIUS * SPACING * MODULUS)
    return _numbers(
        nodes=pressed["contact_fraction"].item() * surface.size,
        closure_of_a_plate=pressed["closure"].item() / plate,
    )


def nearly_full() -> xr.Dataset:
    """Return the area fraction of a wave under the pressure at which Westergaard leaves 10^-4 of it open."""
    n, share = 20000, 1e-4
    x = np.arange(n) / n
    surface = surfaces.from_array(np.broadcast_to(np.cos(2 * np.pi * x), (4, n)), 1.0 / n, periodic=True)
    pressure = np.pi * MODULUS * np.cos(np.pi * share / 2) ** 2
    pressed = contact.press(
        surface, contact_modulus=MODULUS, nominal_pressure=pressure, keep=(), tolerance=1e-12
    )
    return _numbers(open_share=1 - pressed["contact_fraction"].item(), converged=pressed["converged"].item())


def up_and_down(decades: int = 12) -> xr.Dataset:
    """Return how closely a load path over 12 decades returns to its closures, and how often closure falls."""
    up = np.geomspace(1e-9, 10.0 ** (decades - 9), 2 * decades + 1) * 1e4
    path = np.concatenate([up, up[-2::-1]])
    pressed = contact.press(white_noise((32, 32)), contact_modulus=MODULUS, nominal_pressure=path, keep=())
    closure = pressed["closure"].values
    loading, unloading = closure[: up.size], closure[up.size - 1 :][::-1]
    return _numbers(
        hysteresis=np.max(np.abs(unloading / loading - 1)),
        steps_that_fell=np.count_nonzero(np.diff(loading) <= 0),
        converged=pressed["converged"].values.all(),
    )


def barely_hard_enough() -> xr.Dataset:
    """Return area fraction and force carried where the hardness is one part in 10^4 above the pressure."""
    surface, mean = white_noise((32, 32)), 1e6
    pressed = contact.press(
        surface, contact_modulus=MODULUS, nominal_pressure=mean, hardness=mean * 1.0001, keep=("pressure",)
    )
    carried = float(pressed["pressure"].values.mean()) / mean
    return _numbers(contact_fraction=pressed["contact_fraction"].item(), carried=carried)


def yielded_spikes() -> xr.Dataset:
    """Return the nodes that yield under two spikes, and the force of the plane over what the spikes leave."""
    heights = np.zeros((40, 40))
    heights[5, 7] = heights[30, 22] = 1e-3
    surface = surfaces.from_array(heights, 1e-4, periodic=True)
    pressure = 1.0
    pressed = contact.press(
        surface,
        contact_modulus=1e9,
        nominal_pressure=pressure,
        hardness=2.0 * pressure,
        keep=("pressure", "state"),
    )
    plane = float(pressed["pressure"].values[0][heights == 0].sum())
    return _numbers(
        converged=float(pressed["converged"][0]),
        yielded=float((pressed["state"] == 2).sum()),
        plane_over_rest=plane / (pressure * (heights.size - 4.0)),
    )


def long_path() -> xr.Dataset:
    """Return how far closures drift over 1000 steps between two loads, and the bytes kept for each step."""
    path = np.tile([1e4, 1e5], 500)
    pressed = contact.press(white_noise((8, 8)), contact_modulus=MODULUS, nominal_pressure=path, keep=())
    closure = pressed["closure"].values
    return _numbers(
        drift=max(float(np.ptp(closure[start::2])) / closure[start] for start in (0, 1)),
        kilobytes_a_step=pressed.nbytes / path.size / 1e3,
    )


def huge() -> xr.Dataset:
    """Return slope and contact of a periodic surface of 8192 x 8192 points."""
    n = 8192
    surface = surfaces.spectral(
        (n, n), 1e-6, hurst=0.8, rms_slope=0.1, rolloff=n * 2.5e-7, short_cutoff=4e-6, rng=1
    )
    pressed = contact.press(
        surface, contact_modulus=MODULUS, nominal_pressure=1e-2 * MODULUS, tolerance=1e-6, keep=()
    )
    slope = float(np.sqrt(sum(np.mean(np.diff(surface.values, axis=axis) ** 2) for axis in (0, 1)))) / 1e-6
    return _numbers(
        contact_fraction=pressed["contact_fraction"].item(),
        converged=pressed["converged"].item(),
        rms_slope=slope,
    )
