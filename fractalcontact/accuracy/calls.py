"""Extreme calls: not the face is extreme but the load, the material, the length of the path or the size."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

SPACING, RADIUS, MODULUS = 1e-4, 0.4365941, 1e9  # m; radius of the plate in spacings; Pa
DECADES = 12


def _dataset(**values: Any) -> xr.Dataset:
    import xarray as xr

    return xr.Dataset({name: float(value) for name, value in values.items()})


def _noise(n: int, seed: int = 1) -> xr.DataArray:
    from fractalcontact import surfaces

    return surfaces.from_array(1e-6 * np.random.default_rng(seed).normal(size=(n, n)), SPACING)


def stiff_and_soft() -> xr.Dataset:
    """Return the pair modulus of a stiff and a 10^6 times softer body over that of a rigid and a soft one."""
    from fractalcontact import contact

    soft, ratio = 1e6, 1e6
    pair = contact.effective_modulus(soft * ratio, 0.2, soft, 0.3)
    return _dataset(
        ratio_to_soft=pair / (soft / (1 - 0.3**2)),
        ratio_turned=pair / contact.effective_modulus(soft, 0.3, soft * ratio, 0.2),
    )


def one_contact() -> xr.Dataset:
    """Return area and closure of a single node under a force so small that no other touches."""
    from fractalcontact import contact

    face = _noise(32)
    force = 1e-9 * MODULUS * SPACING**2
    pressed = contact.press(face, contact_modulus=MODULUS, normal_force=force, influence="disc", keep=())
    plate = force / (2.0 * RADIUS * SPACING * MODULUS)
    return _dataset(
        nodes=pressed["contact_fraction"].item() * face.size,
        closure_of_a_plate=pressed["closure"].item() / plate,
    )


def nearly_full() -> xr.Dataset:
    """Return the area fraction of a wave under the pressure at which Westergaard leaves 10^-4 of it open."""
    from fractalcontact import contact, surfaces

    n, share = 20000, 1e-4
    x = np.arange(n) / n
    face = surfaces.from_array(np.broadcast_to(np.cos(2 * np.pi * x), (4, n)), 1.0 / n, periodic=True)
    pressure = np.pi * MODULUS * np.cos(np.pi * share / 2) ** 2
    pressed = contact.press(
        face, contact_modulus=MODULUS, nominal_pressure=pressure, keep=(), tolerance=1e-12
    )
    return _dataset(open_share=1 - pressed["contact_fraction"].item(), converged=pressed["converged"].item())


def up_and_down() -> xr.Dataset:
    """Return how far a load path over 12 decades comes back to where it was, and whether it ever fell."""
    from fractalcontact import contact

    up = np.geomspace(1e-9, 10.0 ** (DECADES - 9), 2 * DECADES + 1) * 1e4
    path = np.concatenate([up, up[-2::-1]])
    pressed = contact.press(_noise(32), contact_modulus=MODULUS, nominal_pressure=path, keep=())
    closure = pressed["closure"].values
    there, back = closure[: up.size], closure[up.size - 1 :][::-1]
    return _dataset(
        hysteresis=np.max(np.abs(back / there - 1)),
        steps_that_fell=np.count_nonzero(np.diff(there) <= 0),
        converged=pressed["converged"].values.all(),
    )


def barely_hard_enough() -> xr.Dataset:
    """Return area fraction and force carried where the hardness is one part in 10^4 above the pressure."""
    from fractalcontact import contact

    face, mean = _noise(32), 1e6
    pressed = contact.press(
        face, contact_modulus=MODULUS, nominal_pressure=mean, hardness=mean * 1.0001, keep=("pressure",)
    )
    carried = float(pressed["pressure"].values.mean()) / mean
    return _dataset(contact_fraction=pressed["contact_fraction"].item(), carried=carried)


def long_path() -> xr.Dataset:
    """Return how far closures drift over 2000 steps between two loads, and the bytes a step keeps."""
    from fractalcontact import contact

    path = np.tile([1e4, 1e5], 1000)
    pressed = contact.press(_noise(8), contact_modulus=MODULUS, nominal_pressure=path, keep=())
    closure = pressed["closure"].values
    return _dataset(
        drift=max(float(np.ptp(closure[start::2])) / closure[start] for start in (0, 1)),
        kilobytes_a_step=pressed.nbytes / path.size / 1e3,
    )


def huge() -> xr.Dataset:
    """Return slope and contact of a periodic face of 8192 x 8192 points."""
    from fractalcontact import contact, surfaces

    n = 8192
    face = surfaces.spectral(
        (n, n), 1e-6, hurst=0.8, rms_slope=0.1, rolloff=n * 2.5e-7, short_cutoff=4e-6, rng=1
    )
    pressed = contact.press(
        face, contact_modulus=MODULUS, nominal_pressure=1e-2 * MODULUS, tolerance=1e-6, keep=()
    )
    slope = float(np.sqrt(sum(np.mean(np.diff(face.values, axis=axis) ** 2) for axis in (0, 1)))) / 1e-6
    return _dataset(
        contact_fraction=pressed["contact_fraction"].item(),
        converged=pressed["converged"].item(),
        rms_slope=slope,
    )
