"""Other solvers on the same input, where they are installed: pressure and contact set agree.

Tamaas (Frerot et al. 2020), ContactMechanics (Pastewka and others) and ASPHER (Yastrebov). The
coefficients are the same: spectral for periodic bodies, Love's for free ones.
"""

import warnings

import numpy as np
import pytest

import fractalcontact as fc

N, SPACING, MODULUS = 48, 1e-4, 1e9
TOLERANCE = 1e-11
SHARES = (0.004, 0.08)


def rough_surface(boundary):
    rough = fc.surfaces.spectral((N, N), SPACING, hurst=0.8, rms_slope=0.1, short_cutoff=8e-4, rng=9)
    return rough if boundary == "periodic" else fc.surfaces.from_array(rough.values, SPACING)


def tamaas(heights, pressure, boundary):
    tm = pytest.importorskip("tamaas")
    tm.initialize(1)
    tm.set_log_level(tm.LogLevel.error)
    model = tm.Model(tm.model_type.basic_2d, [N * SPACING] * 2, [N, N])
    model.E, model.nu = MODULUS, 0.0
    solver = tm.PolonskyKeerRey(model, heights, TOLERANCE)
    if boundary == "free":
        tm.ModelFactory.registerNonPeriodic(model, "free")
        solver.setIntegralOperator("free")
    solver.max_iter = 5000
    assert solver.solve(pressure) <= TOLERANCE
    return np.array(model.traction)


def contact_mechanics(heights, pressure, boundary):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        half_space = pytest.importorskip("ContactMechanics.FFTElasticHalfSpace")
        from ContactMechanics.Optimization import ConstrainedConjugateGradients
        from SurfaceTopography import Topography

        kind = "PeriodicFFTElasticHalfSpace" if boundary == "periodic" else "FreeFFTElasticHalfSpace"
        body = getattr(half_space, kind)((N, N), MODULUS, (N * SPACING,) * 2)
        topography = Topography(heights, (N * SPACING,) * 2, periodic=boundary == "periodic")
        result = ConstrainedConjugateGradients.constrained_conjugate_gradients(
            body,
            topography,
            external_force=pressure * (N * SPACING) ** 2,
            pentol=TOLERANCE * heights.std(),
            forcetol=TOLERANCE * pressure * SPACING**2,
            thermotol=TOLERANCE,
            maxiter=5000,
        )
    assert result.success
    return np.asarray(result.jac).reshape(N, N) / SPACING**2


def aspher(heights, pressure, boundary):
    library = pytest.importorskip("aspher")
    backend = "periodic" if boundary == "periodic" else "fft"
    solver = library.ContactSolver(grid_size=N, domain_size=N * SPACING, E_star=MODULUS, backend=backend)
    gap = np.ascontiguousarray(heights.max() - heights).ravel()
    result = solver.solve(gap, pressure, tol=TOLERANCE, max_iter=5000, precond="fourier-fft")
    assert result.converged
    return np.array(result.pressure, dtype=float).reshape(N, N)


@pytest.mark.slow
@pytest.mark.parametrize("boundary", ["periodic", "free"])
@pytest.mark.parametrize("other_solver", [tamaas, contact_mechanics, aspher])
def test_pressure_and_area_match_other_solvers(other_solver, boundary):
    surface = rough_surface(boundary)
    influence = "spectral" if boundary == "periodic" else "square"
    for share in SHARES:
        pressure = share * MODULUS
        ours = fc.contact.press(
            surface,
            contact_modulus=MODULUS,
            nominal_pressure=pressure,
            influence=influence,
            tolerance=TOLERANCE,
            keep=("pressure",),
        )
        theirs = other_solver(surface.values, pressure, boundary)
        assert float(ours["contact_fraction"][0]) == pytest.approx(np.mean(theirs > 0), abs=1e-12)
        missed = np.linalg.norm(ours["pressure"][0] - theirs) / np.linalg.norm(theirs)
        assert missed < 1e-8
