"""Every argument of the public functions with extreme and wrong values: a result or a clear error."""

import inspect
import warnings

import numpy as np
import pytest
import xarray as xr

import fractalcontact as fc
from fractalcontact.base.errors import FractalContactWarning, InvalidInput

WRONG = (
    None, np.nan, -np.inf, 0, -1, 1e308, 5e-324, 10**400, 1j, True, "x", b"x", object(), [],
    {}, [None], [1.0, np.nan],
    [[1.0, 2.0]], np.array([]), np.array(1.0), np.float32(1.0),
)  # fmt: skip

NOISE = 1e-6 * np.random.default_rng(3).normal(size=(24, 24))
SURFACE = fc.surfaces.from_array(NOISE, 1e-4)
CLOUD = np.random.default_rng(2).random((50, 3)) * [1.0, 1.0, 0.1]
MASK = (SURFACE > 0).drop_attrs()
CRACK = fc.joints.Crack(SURFACE, young=1e10, poisson=0.2, block=1.6e-3)
SHEARED = fc.joints.dilatancy(CRACK, shear=[0.0, 1e-4, 2e-4], direction="E")
GENERATOR = {"shape": (8, 8), "spacing": 1e-4, "hurst": 0.5, "rng": 1}

CALLS = {
    "surfaces.fbm": GENERATOR | {"rms_increment": 1e-6},
    "surfaces.spectral": GENERATOR | {"rms_height": 1e-6},
    "surfaces.midpoint": GENERATOR | {"rms_increment": 1e-6},
    "surfaces.weierstrass": GENERATOR | {"rms_height": 1e-6},
    "surfaces.from_array": {"heights": NOISE, "spacing": 1e-4},
    "surfaces.read": {"path": "nowhere.npy"},
    "surfaces.read_points": {"path": "nowhere.xyz"},
    "surfaces.fit_plane": {"points": CLOUD},
    "surfaces.from_points": {"points": CLOUD},
    "surfaces.sample": {"name": "nothing"},
    "surfaces.level": {"surface": SURFACE},
    "surfaces.gaussian_filter": {"surface": SURFACE, "cutoff": 6e-4, "keep": "long"},
    "surfaces.texture": {"surface": SURFACE},
    "surfaces.fill": {"surface": SURFACE},
    "surfaces.despike": {"surface": SURFACE},
    "surfaces.describe": {"surface": SURFACE},
    "dimensions.spectrum": {"surface": SURFACE},
    "dimensions.variogram": {"surface": SURFACE},
    "dimensions.madogram": {"surface": SURFACE},
    "dimensions.second_variogram": {"surface": SURFACE},
    "dimensions.covering": {"surface": SURFACE},
    "dimensions.cube_counts": {"surface": SURFACE},
    "dimensions.roughness_length": {"surface": SURFACE},
    "dimensions.hurst_map": {"surface": SURFACE, "window": 1.0},
    "dimensions.waves": {"surface": SURFACE},
    "dimensions.height_lacunarity": {"surface": SURFACE, "mass": "sum"},
    "dimensions.higuchi": {"surface": SURFACE},
    "dimensions.detrended_fluctuation": {"surface": SURFACE},
    "dimensions.divider": {"surface": SURFACE},
    "dimensions.variation": {"surface": SURFACE, "sizes": [2e-4], "windows": "squares", "mean": "geometric"},
    "dimensions.estimate": {"surface": SURFACE, "methods": "variogram"},
    "contact.effective_modulus": {"young": 1e9, "poisson": 0.2, "young2": 1e9, "poisson2": 0.2},
    "contact.effective_poisson": {"young": 1e9, "poisson": 0.2, "young2": 1e9, "poisson2": 0.2},
    "contact.flat_stiffness": {"shape": (8, 8), "spacing": 1e-4, "contact_modulus": 1e9},
    "contact.press": {"surface": SURFACE, "contact_modulus": 1e9, "nominal_pressure": 1e4},
    "contact.theories": {"surface": SURFACE, "contact_modulus": 1e9, "nominal_pressure": 1e4},
    "contact.partial_slip": {
        "surface": SURFACE, "contact_modulus": 1e9, "poisson": 0.2, "friction_coefficient": 0.5,
        "nominal_pressure": 1e4, "tangential_force": 0.0,
    },
    "joints.Crack": {"lower": SURFACE, "young": 1e10, "poisson": 0.2},
    "joints.delta_surface": {"crack": CRACK, "shear": 1e-4},
    "joints.direct_shear": {
        "crack": CRACK, "path": 1e-4, "nominal_pressure": 1e6, "hardness": 1e9, "normal_stiffness": 1e9,
        "shear_stiffness": 1e12, "distance": 1e-4,
    },
    "joints.area_dimension": {"crack": CRACK, "shear": 1e-4, "normal_force": 1.0},
    "joints.self_weight": {"crack": CRACK, "shear": 1e-4, "structure_size": 1.0, "unit_weight": 1e4},
    "joints.directional_roughness": {"surface": SURFACE},
    "joints.dilatancy": {"crack": CRACK, "shear": [0.0, 1e-4]},
    "joints.friction": {"dilatancy": SHEARED},
    "joints.cyclic_shear": {"dilatancy": SHEARED, "path": [0.0, 1e-4, 0.0], "nominal_pressure": 1e6},
    "joints.partial_slip": {
        "crack": CRACK, "shear": 1e-4, "normal_force": 1.0, "tangential_force": 0.0,
        "friction_coefficient": 0.5,
    },
    "joints.roughness_coefficient": {"surface": SURFACE, "lag": 1e-4},
    "joints.strength_envelope": {
        "surface": SURFACE, "nominal_pressure": 1e6, "wall_strength": 1e8, "basic_friction_angle": 30,
    },
    "joints.shear_curve": {
        "surface": SURFACE, "displacement": 1e-3, "nominal_pressure": 1e6, "wall_strength": 1e8,
        "residual_friction_angle": 30, "length": 0.1, "damage_coefficient": 1.5, "normal_stiffness": 1e9,
    },
    "joints.transmissivity": {"gap": SURFACE - SURFACE.min()},
    "joints.uplift": {
        "gap": SURFACE - SURFACE.min(), "upstream_pressure": 1e5, "normal_stiffness": 1e10,
    },
    "joints.bandis_aperture": {"roughness": 10, "wall_strength": 5e7, "compressive_strength": 1e8},
    "joints.hydraulic_aperture": {"aperture": 1e-4, "roughness": 10},
    "joints.bandis_closure": {"nominal_pressure": 1e6, "initial_stiffness": 1e9, "greatest_closure": 1e-4},
    "joints.bandis_constants": {"roughness": 10, "wall_strength": 1e8, "aperture": 1e-4},
    "joints.barton_bandis_scaled": {"roughness": 10, "wall_strength": 1e8, "length": 1.0},
    "joints.barton_choubey_strength": {
        "nominal_pressure": 1e6, "roughness": 10, "wall_strength": 1e8, "residual_angle": 30,
    },
    "joints.self_weight_strength": {"length": 1.0, "unit_weight": 1e4, "friction_angle": 30},
    "joints.size_effect": {"scale": 2.0, "contact_dimension": 1.5},
    "domains.islands": {"mask": MASK},
    "domains.box_dimension": {"mask": MASK},
    "domains.box_counts": {"mask": MASK},
    "domains.generalised_dimensions": {"mask": MASK},
    "domains.boundary_dimension": {"mask": MASK},
    "domains.lacunarity": {"mask": MASK},
    "domains.percolation": {"mask": MASK},
    "domains.area_dimension": {"masks": [MASK, MASK]},
}  # fmt: skip


@pytest.mark.parametrize("name", CALLS)
def test_wrong_argument_gives_a_result_or_a_clear_error(name):
    subpackage, _, function_name = name.partition(".")
    function = getattr(getattr(fc, subpackage), function_name)
    failed = []
    for argument in inspect.signature(function).parameters:
        for value in WRONG:
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", FractalContactWarning)
                    result = function(**{**CALLS[name], argument: value})
            except InvalidInput:
                continue
            except Exception as error:
                failed.append(f"{argument}={value!r:.40}: {type(error).__name__}: {error}")
                continue
            if isinstance(result, xr.Dataset):
                numbers = [
                    variable.values for variable in result.variables.values() if variable.dtype.kind == "f"
                ]
                if any(np.isinf(values).any() for values in numbers):
                    failed.append(f"{argument}={value!r:.40}: an infinite number")
    assert not failed, "\n".join(failed)
