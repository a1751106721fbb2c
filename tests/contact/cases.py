"""Random contact problems, and an independent check of their solutions.

The check takes pressure and closure from a result and computes everything else anew in plain numpy: influence
coefficients from their closed forms, displacement by one Fourier transform, and the conditions of contact in
SI units.
"""

from dataclasses import dataclass, field

import numpy as np

import fractalcontact as fc

NOISE = 2e-13  # rounding of a recomputed displacement, over the greatest length in the problem


@dataclass
class Case:
    """One problem: a surface, and how it is pressed."""

    name: str
    heights: np.ndarray
    spacing: tuple[float, float]
    periodic: bool
    options: dict = field(default_factory=dict)

    @property
    def surface(self):
        return fc.surfaces.from_array(self.heights, self.spacing, periodic=self.periodic)

    def press(self, **changes):
        keep = ("state", "pressure", "gap")
        return fc.contact.press(self.surface, **{"keep": keep, **self.options, **changes})


def log_uniform(rng, low, high):
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def self_affine(rng, shape, hurst):
    """Heights with a spectrum |q|^(-2 - 2 hurst) on a torus."""
    q = np.hypot(np.fft.fftfreq(shape[0])[:, None], np.fft.rfftfreq(shape[1])[None])
    q[0, 0] = np.inf
    return np.fft.irfft2(np.fft.rfft2(rng.normal(size=shape)) * q ** (-1 - hurst), shape)


def plane_of(shape):
    """Coordinates from -1 to 1 along the longer axis, the nodes being as far apart along both."""
    longest = max(shape) - 1
    y, x = (2 * (np.arange(n) - (n - 1) / 2) / longest for n in shape)
    return y[:, None], x[None, :]


def heights_of(rng, kind, shape):
    """Heights of about unit range."""
    y, x = plane_of(shape)
    if kind in ("rough", "plateaus", "pits", "quantised"):
        rough = self_affine(rng, shape, rng.uniform(0, 1))
        rough = rough / max(np.ptp(rough), 1e-300)
        if kind == "plateaus":
            return np.minimum(rough, np.quantile(rough, rng.uniform(0.1, 0.99)))
        if kind == "pits":
            return np.maximum(rough, np.quantile(rough, rng.uniform(0.1, 0.99)))
        levels = 2 ** rng.integers(1, 8)
        return np.round(rough * levels) / levels if kind == "quantised" else rough
    faces = {
        "noise": lambda: rng.normal(size=shape),
        "sphere": lambda: -(x**2 + y**2),
        "bowl": lambda: x**2 + y**2,
        "cone": lambda: -np.hypot(x, y),
        "wave": lambda: np.cos(2 * np.pi * rng.integers(1, 4) * np.arange(shape[1]) / shape[1]) + 0 * y,
        "waves": lambda: (
            np.cos(2 * np.pi * np.arange(shape[1]) / shape[1])
            * np.cos(2 * np.pi * np.arange(shape[0]) / shape[0])[:, None]
        ),
        "round punch": lambda: np.where(np.hypot(x, y) <= rng.uniform(0.05, 0.9), 1.0, 0.0),
        "square punch": lambda: np.where(np.maximum(abs(x), abs(y)) <= rng.uniform(0.05, 0.9), 1.0, 0.0),
        "ramp": lambda: x + rng.uniform(-1, 1) * y,
        "spikes": lambda: (rng.random(shape) < 3 / (shape[0] * shape[1])) * rng.random(shape),
        "pit": lambda: -(np.arange(shape[0] * shape[1]).reshape(shape) == shape[1] + 1).astype(float),
        "chequers": lambda: np.indices(shape).sum(axis=0) % 2 * 1.0,
        "step": lambda: np.where(x > 0, 1.0, 0.0) + 0 * y,
        "flat": lambda: np.zeros(shape),
    }
    return faces[kind]() * np.ones(shape)


KINDS = (
    "rough", "rough", "rough", "plateaus", "pits", "quantised", "noise", "sphere", "bowl", "cone", "wave",
    "waves", "round punch", "square punch", "ramp", "spikes", "pit", "chequers", "step", "flat",
)  # fmt: skip


def shape_of(rng, largest):
    """From 3 points to `largest`, not only powers of two; sometimes a hundred times longer than wide."""
    n = round(log_uniform(rng, 3, largest))
    other = n if rng.random() < 0.6 else max(3, round(n / log_uniform(rng, 1, 100)))
    return (n, other) if rng.random() < 0.5 else (other, n)


def draw(seed, largest=128):
    """Return the case of a seed."""
    rng = np.random.default_rng([seed, 77])
    kind = KINDS[seed % len(KINDS)]
    shape, periodic = shape_of(rng, largest), bool(rng.random() < 0.5)
    spacing = log_uniform(rng, 1e-9, 1e2)
    influence = "spectral" if periodic else str(rng.choice(["disc", "square"]))
    ratio = log_uniform(rng, 1, 2 if influence == "disc" else 100) if rng.random() < 0.4 else 1.0
    spacings = (spacing, spacing * ratio) if rng.random() < 0.5 else (spacing * ratio, spacing)
    height = spacing * min(shape) * log_uniform(rng, 1e-8, 3.0)
    heights = heights_of(rng, kind, shape) * height + height * float(rng.choice([0.0, 0.0, 1.0, -1e3]))
    modulus = log_uniform(rng, 1e-6, 1e15)
    options = {"contact_modulus": modulus, "influence": influence}
    gap = heights.max() - heights
    slope = max(height, float(gap.mean())) / (spacing * np.sqrt(ratio) * max(shape))
    control = str(rng.choice(["closure", "normal_force", "nominal_pressure"]))
    if control == "closure":
        greatest = 0.97 * gap.mean() if periodic else height * log_uniform(rng, 1e-6, 3.0)
        if periodic and greatest == 0:
            control = "nominal_pressure"
    if control != "closure":
        greatest = modulus * slope * log_uniform(rng, 1e-10, 30.0)
    if control == "normal_force":
        greatest *= spacings[0] * spacings[1] * heights.size
    if rng.random() < 0.3:
        cap = modulus * slope * log_uniform(rng, 1e-2, 30.0)
        options["hardness"] = cap
        if control != "closure":
            most = cap if control == "nominal_pressure" else cap * spacings[0] * spacings[1] * heights.size
            greatest = min(greatest, float(rng.choice([0.3, 0.97, 1.0])) * most)
    path = {
        "one": [1.0],
        "up": list(np.geomspace(1e-3, 1.0, 4)),
        "up and down": [0.1, 1.0, 0.1, 0.0, 0.1],
        "wild": [1.0, 1e-6, 1.0, 1.0, 0.3],
    }[str(rng.choice(["one", "one", "up", "up and down", "wild"]))]
    options[control] = greatest * np.array(path)
    options["tolerance"] = float(rng.choice([1e-8, 1e-8, 1e-4, 1e-11]))
    name = f"{seed} {kind} {shape[0]}x{shape[1]} {'periodic' if periodic else 'free'} {influence} {control}"
    return Case(name, heights, spacings, periodic, options)


def long_table(case, radius):
    """Displacement (m) at offset (i, j) under 1 Pa on one cell, from the closed forms."""
    long = np.longdouble
    dy, dx = long(case.spacing[0]), long(case.spacing[1])
    shape, modulus = case.heights.shape, long(case.options["contact_modulus"])
    y, x = np.arange(shape[0])[:, None] * dy, np.arange(shape[1])[None, :] * dx
    if case.options["influence"] == "disc":
        r = np.hypot(y, x)
        r[0, 0] = 1
        table = np.arcsin(np.minimum(long(radius) / r, 1)) / (long(np.pi) * long(radius))
        table[0, 0] = 1 / (2 * long(radius))
        return np.asarray(table * dy * dx / modulus, dtype=float)
    total = long(0)
    for b, a, sign in ((1, 1, 1), (-1, -1, 1), (1, -1, -1), (-1, 1, -1)):
        u, v = y + b * dy / 2, x + a * dx / 2
        total = total + sign * (u * np.arcsinh(v / abs(u)) + v * np.arcsinh(u / abs(v)))
    return np.asarray(total / (long(np.pi) * modulus), dtype=float)


def displacement_under(case, pressure, radius):
    """Displacement (m) of every node under `pressure` (Pa)."""
    ny, nx = pressure.shape
    if case.periodic:
        q = (
            2
            * np.pi
            * np.hypot(
                np.fft.fftfreq(ny, case.spacing[0])[:, None], np.fft.rfftfreq(nx, case.spacing[1])[None]
            )
        )
        q[0, 0] = np.inf
        return np.fft.irfft2(np.fft.rfft2(pressure) * 2 / (case.options["contact_modulus"] * q), (ny, nx))
    table = long_table(case, radius)
    index = [np.minimum(np.arange(2 * n), 2 * n - np.arange(2 * n)).clip(max=n - 1) for n in (ny, nx)]
    padded = (2 * ny, 2 * nx)
    symbol = np.fft.rfft2(table[np.ix_(*index)])
    return np.fft.irfft2(np.fft.rfft2(pressure, padded) * symbol, padded)[:ny, :nx]


def judge(case, result):
    """List what is wrong with a result; nothing for a right one that converged."""
    wrong = []
    tolerance, cell = case.options["tolerance"], case.spacing[0] * case.spacing[1]
    cap = case.options.get("hardness", np.inf)
    top = case.heights.max() - case.heights
    radius = float(result["disc_radius"]) if "disc_radius" in result else 0.0
    control = next(
        name for name in ("closure", "normal_force", "nominal_pressure") if case.options.get(name) is not None
    )
    imposed = np.atleast_1d(case.options[control])
    plastic, noise = np.zeros_like(top), 0.0
    for step, value in enumerate(imposed):
        here = result.isel(step=step)

        def blame(what, here=here, step=step):
            wrong.append(f"step {step}: {what} [{here['stop_reason'].item()}]")

        p, gap = here["pressure"].values, here["gap"].values
        closure, force = float(here["closure"]), float(here["normal_force"])
        if not (np.isfinite(p).all() and np.isfinite(gap).all() and np.isfinite([closure, force]).all()):
            blame("not finite")
            continue
        if not bool(here["converged"]):
            blame(f"not converged, residual {float(here['residual']):.2g}")
        if not (p >= 0).all() or not (p <= cap).all():
            blame("pressure outside its bounds")
        if not (gap >= 0).all() or (p * gap != 0).any():
            blame("gap negative, or pressure across a gap")
        if not np.isclose(p.sum() * cell, force, rtol=3e-9, atol=0):
            blame(f"pressures carry {p.sum() * cell:.12g} of {force:.12g}")
        if not np.isclose(float(here[control]), value, rtol=1e-13, atol=0):
            blame(f"{control} {float(here[control]):.17g} instead of {value:.17g}")
        u = displacement_under(case, p, radius)
        g = top + plastic + u - closure
        flat = p.max() * max(case.spacing) * max(p.shape) / case.options["contact_modulus"]
        noise = max(noise, NOISE * (top.max() + plastic.max() + abs(closure) + abs(u).max() + 1e-2 * flat))
        yielded = p >= cap
        if not (here["state"].values == np.where(yielded, 2, p > 0)).all():
            blame("state is not that of the pressure")
        total = p.sum()
        overlap = max(0.0, float((-g[~yielded]).max(initial=0.0)))
        if total == 0:
            if overlap > noise:
                blame(f"overlap {overlap:.3g} without pressure")
            continue
        opened = float((p * np.maximum(g, 0)).sum() / total)
        local = total / p.size * np.sqrt(cell) / case.options["contact_modulus"]
        scale = max(float((p * u).sum() / total), local)
        residual = (opened + overlap) / scale
        claimed = 1.001 * tolerance if bool(here["converged"]) else 10 * float(here["residual"])
        if residual > claimed + 8 * noise / scale:
            blame(f"residual {residual:.3g} recomputed, {float(here['residual']):.3g} reported")
        if abs(np.where(p > 0, 0, np.maximum(g, 0)) - gap).max() > noise + 2 * tolerance * scale:
            blame("gap is not that of the pressure")
        energy = 0.5 * float((p * u).sum()) * cell
        if not np.isclose(float(here["elastic_energy"]), energy, rtol=1e-6, atol=force * noise):
            blame(f"energy {float(here['elastic_energy']):.9g} instead of {energy:.9g}")
        if case.periodic:
            closed = float(top.mean() + plastic.mean() - g.mean())
            if abs(closed - closure) > noise:
                blame("closure is not top - mean height - mean gap")
        plastic += np.where(yielded, np.maximum(-g, 0), 0.0)
    return wrong
