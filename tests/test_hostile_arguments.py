"""Every argument of the public functions, given what nobody should give: an answer, or a refusal in words."""

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
FACE = fc.surfaces.from_array(NOISE, 1e-4)
MASK = (FACE > 0).drop_attrs()
CRACK = fc.joints.Crack(FACE, young=1e10, poisson=0.2, block=1.6e-3)
SLID = fc.joints.dilatancy(CRACK, shear=[0.0, 1e-4, 2e-4], direction="E")
MADE = {"shape": (8, 8), "spacing": 1e-4, "hurst": 0.5, "rng": 1}

CALLS = {
    "surfaces.fbm": MADE | {"rms_increment": 1e-6},
    "surfaces.spectral": MADE | {"rms_height": 1e-6},
    "surfaces.midpoint": MADE | {"rms_increment": 1e-6},
    "surfaces.weierstrass": MADE | {"rms_height": 1e-6},
    "surfaces.from_array": {"heights": NOISE, "spacing": 1e-4},
    "surfaces.read": {"path": "nowhere.npy"},
    "surfaces.sample": {"name": "nothing"},
    "surfaces.level": {"surface": FACE},
    "surfaces.fill": {"surface": FACE},
    "surfaces.despike": {"surface": FACE},
    "surfaces.describe": {"surface": FACE},
    "dimensions.spectrum": {"surface": FACE},
    "dimensions.variogram": {"surface": FACE},
    "dimensions.madogram": {"surface": FACE},
    "dimensions.second_variogram": {"surface": FACE},
    "dimensions.covering": {"surface": FACE},
    "dimensions.cube_counts": {"surface": FACE},
    "dimensions.roughness_length": {"surface": FACE},
    "dimensions.estimate": {"surface": FACE, "methods": "variogram"},
    "contact.effective_modulus": {"young": 1e9, "poisson": 0.2, "young2": 1e9, "poisson2": 0.2},
    "contact.flat_stiffness": {"shape": (8, 8), "spacing": 1e-4, "contact_modulus": 1e9},
    "contact.press": {"surface": FACE, "contact_modulus": 1e9, "nominal_pressure": 1e4},
    "joints.Crack": {"lower": FACE, "young": 1e10, "poisson": 0.2},
    "joints.delta_surface": {"crack": CRACK, "shear": 1e-4},
    "joints.dilatancy": {"crack": CRACK, "shear": [0.0, 1e-4]},
    "joints.friction": {"dilatancy": SLID},
    "joints.cyclic_shear": {"dilatancy": SLID, "path": [0.0, 1e-4, 0.0], "nominal_pressure": 1e6},
    "joints.roughness_coefficient": {"surface": FACE, "lag": 1e-4},
    "joints.transmissivity": {"gap": FACE - FACE.min()},
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
def test_a_wrong_argument_is_refused_in_words_or_serves(name):
    room, _, word = name.partition(".")
    function = getattr(getattr(fc, room), word)
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
                numbers = [one.values for one in result.variables.values() if one.dtype.kind == "f"]
                if any(np.isinf(values).any() for values in numbers):
                    failed.append(f"{argument}={value!r:.40}: an infinite number")
    assert not failed, "\n".join(failed)
