"""Processor time of the main calls, on inputs that are made before the clock starts."""

from __future__ import annotations

import json
import os
import time
import warnings
from functools import cache, partial
from pathlib import Path

import numpy as np
import xarray as xr
from scipy.ndimage import gaussian_filter

import fractalcontact as fc

SPACING = 1e-4
CRACK = Path(__file__).resolve().parents[3] / "datasets" / "concrete_crack.nc"


@cache
def exact(n: int = 256) -> xr.DataArray:
    """Return an exact fractional Brownian surface."""
    return fc.surfaces.fbm((n, n), SPACING, hurst=0.7, rms_increment=1e-6, rng=1)


def blurred() -> xr.DataArray:
    """Return a surface under a Gaussian blur of one spacing, without its margin."""
    rough = fc.surfaces.fbm((296, 296), SPACING, hurst=0.6, rms_increment=1e-6, rng=2)
    return fc.surfaces.from_array(gaussian_filter(rough.values, 1.0)[20:-20, 20:-20], SPACING)


def gapped() -> xr.DataArray:
    """Return a surface of which a tenth is missing."""
    return exact().where(np.random.default_rng(3).random(exact().shape) > 0.1)


def profile() -> xr.DataArray:
    """Return one line of the exact surface."""
    return exact().isel(y=0)


def periodic(n: int = 256) -> xr.DataArray:
    """Return a periodic self-affine surface."""
    return fc.surfaces.spectral((n, n), SPACING, hurst=0.8, rms_height=1e-5, rng=4)


def measured_map(name: str) -> xr.DataArray:
    """Return a measured map, where the folder of measured surfaces has it."""
    folder = os.environ.get("FRACTALCONTACT_DATA")
    if not folder:
        raise NotImplementedError("FRACTALCONTACT_DATA is not set")  # asv skips the benchmark
    spacing = json.loads((Path(folder) / f"{name}.json").read_text(encoding="utf-8"))
    heights = np.load(Path(folder) / f"{name}.npy").astype(float)
    return fc.surfaces.from_array(heights, (spacing["dy"], spacing["dx"]))


def shipped() -> xr.DataArray:
    """Return the surface of the shipped study."""
    return fc.surfaces.read(CRACK)


class ProcessorTime:
    """Benchmarks in processor time, which other work on the machine changes less than elapsed time."""

    timer = time.process_time
    timeout = 300


class Estimate(ProcessorTime):
    """`dimensions.estimate` of exact and of measured surfaces."""

    inputs = {
        "exact": exact,
        "blurred": blurred,
        "gapped": gapped,
        "profile": profile,
        "shipped crack": shipped,
        "interferometer": partial(measured_map, "wli_126um_opd1"),
        "atomic force microscope": partial(measured_map, "afm_10um_di3"),
    }
    params = list(inputs)
    param_names = ("surface",)

    def setup(self, name: str) -> None:
        """Make the surface."""
        self.surface = self.inputs[name]()

    def time_estimate(self, _: str) -> None:
        """Time the default estimator."""
        fc.dimensions.estimate(self.surface)


class Press(ProcessorTime):
    """`contact.press` of free and periodic bodies."""

    params = ("free 256", "periodic 256", "periodic 32")
    param_names = ("body",)

    def setup(self, name: str) -> None:
        """Make the surface."""
        self.surface = exact() if name == "free 256" else periodic(int(name.split()[1]))
        self.pressures = {"free 256": [1e5, 1e6], "periodic 256": [1e6, 1e7], "periodic 32": [1e6]}[name]

    def time_press(self, _: str) -> None:
        """Time one or two load steps."""
        fc.contact.press(self.surface, contact_modulus=1e9, nominal_pressure=self.pressures)


class PartialSlip:
    """The cost of a step of `contact.partial_slip`: a count, the same on every machine."""

    params = ("superposition", "full")
    param_names = ("method",)
    unit = "pairs of transforms of a step over those of the normal solution"
    timeout = 300

    def track_step_over_normal_solution(self, method: str) -> float:
        """Return the mean over nine steps of first loading."""
        surface = fc.surfaces.spectral((128, 128), 1e-5, hurst=0.8, rms_slope=0.1, short_cutoff=8e-5, rng=4)
        load = {"contact_modulus": 1e9, "nominal_pressure": 5e6, "keep": ()}
        normal = fc.contact.press(surface, **load)
        limit = 0.4 * float(normal["normal_force"][0])
        slip = fc.contact.partial_slip(
            surface,
            method=method,
            poisson=0.2,
            friction_coefficient=0.4,
            tangential_force=limit * np.arange(0.0, 1.0, 0.1),
            **load,
        )
        return float(slip["transforms"][1:].mean() / normal["transforms"][0])


class Closure(ProcessorTime):
    """`joints.closure` of the shipped crack, two shears and two forces."""

    def setup(self) -> None:
        """Make the crack."""
        self.crack = fc.joints.Crack(shipped(), young=30e9, poisson=0.2, block=0.01)

    def time_closure(self) -> None:
        """Time the delta-surfaces and their solutions."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            fc.joints.closure(self.crack, shear=[4e-4, 8e-4], direction="W", normal_force=[100, 1000])


class Domains(ProcessorTime):
    """Analysis of the contact sets of three loads."""

    def setup(self) -> None:
        """Press the surface."""
        pressed = fc.contact.press(exact(), contact_modulus=1e9, nominal_pressure=[1e5, 1e6, 4e6])
        self.states = pressed["state"]

    def time_box_dimension(self) -> None:
        """Time the box dimension."""
        fc.domains.box_dimension(self.states)

    def time_lacunarity(self) -> None:
        """Time the lacunarity."""
        fc.domains.lacunarity(self.states)

    def time_islands(self) -> None:
        """Time the islands."""
        fc.domains.islands(self.states)


class Generate(ProcessorTime):
    """Generators of surfaces, 1024 x 1024 points."""

    def time_fbm(self) -> None:
        """Time an exact Brownian surface."""
        fc.surfaces.fbm((1024, 1024), SPACING, hurst=0.7, rms_increment=1e-6, rng=1)

    def time_spectral(self) -> None:
        """Time a periodic surface."""
        fc.surfaces.spectral((1024, 1024), SPACING, hurst=0.7, rms_height=1e-6, rng=1)


class PeakMemory:
    """Peak memory of a process that makes a surface of 1024 x 1024 points and analyses it."""

    timeout = 300

    def peakmem_press(self) -> None:
        """Measure `press` of a periodic body."""
        fc.contact.press(periodic(1024), contact_modulus=1e9, nominal_pressure=1e6)

    def peakmem_estimate(self) -> None:
        """Measure `estimate` of an exact surface."""
        fc.dimensions.estimate(exact(1024))
