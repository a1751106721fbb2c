"""Every argument of the public functions with extreme and wrong values: a result or a clear error."""

import inspect
import random
import warnings

import numpy as np
import pytest
import xarray as xr
from calls import CALLS, UNLABELLED, function_of, labelled_functions

from fractalcontact.base.errors import FractalContactWarning, InvalidInput

WRONG = (
    None, np.nan, -np.inf, 0, -1, 1e308, 5e-324, 10**400, 1j, True, "x", b"x", object(), [],
    {}, [None], [1.0, np.nan],
    [[1.0, 2.0]], np.array([]), np.array(1.0), np.float32(1.0),
)  # fmt: skip

# the quickest of what an argument chooses between: most values are passed on to a whole call
QUICK = {
    "dimensions.estimate": {"methods": "variogram"},
    "joints.area_by_resolution": {"normal_force": [1.0]},
    "joints.dilatancy": {"shear": [0.0, 1e-4], "direction": "E"},
    "joints.direct_shear": {"path": 1e-4},
    "joints.shear_curve": {"displacement": [0.0, 1e-4], "nominal_pressure": [1e5]},
    "surfaces.sample": {"name": "nothing"},
}


# `tests/fuzz/test_pairs.py` tries values that every argument must refuse
@pytest.mark.parametrize("count", [8, pytest.param(len(WRONG), marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", [*labelled_functions(), *sorted(UNLABELLED & CALLS.keys())])
def test_wrong_argument_gives_a_result_or_a_clear_error(name, count, request):
    """Every argument with some of the values, others every day (see tests/fuzz)."""
    function, given = function_of(name), CALLS[name]() | QUICK.get(name, {})
    failed, stream = [], random.Random(f"{request.config.getoption('--seed')}, {name}")
    for argument in inspect.signature(function).parameters:
        for value in stream.sample(WRONG, count):
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", FractalContactWarning)
                    result = function(**(given | {argument: value}))
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
