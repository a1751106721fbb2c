"""Benchmark of partial slip: steps of both methods against a normal solution, and against Tamaas.

    python tests/contact/bench_partial_slip.py --size 512
    python tests/contact/bench_partial_slip.py --size 256 --tamaas 30,100,300

A path of first loading and unloading on a self-affine surface (H = 0.8, rms slope 0.1), pressed to some
tenth of its area, in turn with `press`. The cost is that of a step over that of `press`, in time and in pairs
of transforms (those of x and y counted each); the first step includes the normal solution.

Tamaas solves one step of an incompressible body, whose normal and tangential displacements are not coupled,
with ever more iterations. Its error is that to its own last solution, because its operator differs in the
highest mode; here the error is that to a solution to 1e-10.
"""

import argparse
import time
from importlib.util import find_spec

import numpy as np

import fractalcontact as fc

MODULUS, FRICTION, PRESSURE = 1e9, 0.4, 0.005
SHARES = np.concatenate([np.arange(0, 1, 0.1), [0.7, 0.4, 0.1, -0.2, -0.5, -0.8]])
LOADING = slice(1, 10)


def rough(n, *, periodic):
    surface = fc.surfaces.spectral((n, n), 1e-5, hurst=0.8, rms_slope=0.1, short_cutoff=8e-5, rng=4)
    return surface if periodic else fc.surfaces.from_array(surface.values, 1e-5)


def compare_with_normal_solution(n, poisson, repeats):
    for periodic in (True, False):
        surface = rough(n, periodic=periodic)
        limit = FRICTION * PRESSURE * MODULUS * (n * 1e-5) ** 2
        load = {"contact_modulus": MODULUS, "nominal_pressure": PRESSURE * MODULUS, "keep": ()}
        given = {**load, "poisson": poisson, "friction_coefficient": FRICTION}
        given["tangential_force"] = limit * SHARES
        times = {"press": [], "superposition": [], "full": []}
        results = {}
        for _ in range(repeats + 1):  # the first compiles
            start = time.perf_counter()
            pressed = fc.contact.press(surface, **load)
            times["press"].append(time.perf_counter() - start)
            for method in ("superposition", "full"):
                results[method] = fc.contact.partial_slip(surface, method=method, **given)
                times[method].append(results[method]["run_time"].values)
        pairs, normal = int(pressed["transforms"][0]), np.median(times["press"][1:])
        kind = "periodic" if periodic else "free"
        print(
            f"{kind}, n = {n}: press {pairs} pairs, {normal:.3g} s, contact {pressed.contact_fraction[0]:.3f}"
        )
        for method, result in results.items():
            ratio = result["transforms"].values / pairs
            seconds = np.median(times[method][1:], axis=0) / normal
            mean, most = ratio[LOADING].mean(), ratio[LOADING].max()
            print(
                f"  {method}: pairs of a step {mean:.2f} (at most {most:.2f}) in loading,"
                f" {ratio[1:].mean():.2f} on the whole path; time {seconds[LOADING].mean():.2f}"
            )


def compare_with_tamaas(n, iterations):
    import tamaas as tm

    tm.initialize(1)
    tm.set_log_level(tm.LogLevel.error)
    surface, pressure = rough(n, periodic=True), PRESSURE * MODULUS
    shear = 0.5 * FRICTION * pressure
    given = {
        "contact_modulus": MODULUS,
        "poisson": 0.5,
        "friction_coefficient": FRICTION,
        "nominal_pressure": pressure,
        "tangential_force": shear * (n * 1e-5) ** 2,
        "method": "full",
        "keep": ("traction_x", "traction_y"),
    }

    def solve_here(tolerance):
        start = time.perf_counter()
        result = fc.contact.partial_slip(surface, tolerance=tolerance, **given)
        return time.perf_counter() - start, np.stack([result[f"traction_{a}"][0].values for a in "xy"])

    def solve_there(most):
        model = tm.Model(tm.model_type.surface_2d, [n * 1e-5] * 2, [n, n])
        model.nu = 0.5
        model.E = MODULUS * (1 - model.nu**2)
        solver = tm.PolonskyKeerTan(model, np.ascontiguousarray(surface.values.T), 1e-14, FRICTION)
        solver.max_iter = most
        start = time.perf_counter()
        solver.solve([shear, 0.0, pressure])
        return time.perf_counter() - start, np.moveaxis(np.array(model.traction)[..., :2], (0, 1), (2, 1))

    for name, solve, settings, best in (
        ("here, tolerance", solve_here, (1e-2, 1e-3, 1e-4, 1e-6), 1e-10),
        ("Tamaas, iterations", solve_there, iterations[:-1], iterations[-1]),
    ):
        exact = solve(best)[1]
        for setting in settings:
            seconds, traction = solve(setting)
            error = np.sqrt(np.mean((traction - exact) ** 2) / np.mean(exact**2))
            print(f"{name} {setting:g}: rms error {error:.1e}, {seconds:.3f} s")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--poisson", type=float, default=0.2)
    parser.add_argument("--repeats", type=int, default=1)
    parser.add_argument("--tamaas", help="iterations, for example 30,100,300")
    options = parser.parse_args()
    if options.tamaas and find_spec("tamaas"):
        compare_with_tamaas(options.size, [int(word) for word in options.tamaas.split(",")])
    else:
        compare_with_normal_solution(options.size, options.poisson, options.repeats)
