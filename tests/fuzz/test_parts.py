"""Labelled arguments with a part that is missing, single or renamed: a clear error, or a right answer."""

import itertools

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr
from calls import CALLS, function_of
from fuzz_faults import fault_of


def parts(data):
    """Yield what was done to labelled data, and the data; what xarray itself refuses is left out."""
    variables = list(data.data_vars) if isinstance(data, xr.Dataset) else []
    changes = {
        f"without {name}": lambda name=name: data.drop_vars(name) for name in [*data.coords, *variables]
    }
    for name in variables:
        if data[name].ndim:
            changes[f"one {name}"] = lambda name=name: data.assign(
                {name: data[name].isel(dict.fromkeys(data[name].dims, 0))}
            )
        if data[name].dtype.kind == "f":
            changes[f"{name} all NaN"] = lambda name=name: data.assign({name: data[name].where(False)})
    for dim in data.dims:
        changes |= {
            f"one {dim}": lambda dim=dim: data.isel({dim: 0}),
            f"one {dim}, dropped": lambda dim=dim: data.isel({dim: 0}, drop=True),
            f"first {dim}": lambda dim=dim: data.isel({dim: [0]}),
            f"last {dim}": lambda dim=dim: data.isel({dim: [-1]}),
            f"no {dim}": lambda dim=dim: data.isel({dim: slice(0)}),
            f"{dim} reversed": lambda dim=dim: data.isel({dim: slice(None, None, -1)}),
            f"{dim} renamed": lambda dim=dim: data.rename({dim: "other"}),
            f"{dim} far away": lambda dim=dim: data.assign_coords({dim: np.arange(data.sizes[dim]) + 100.0}),
        }
    if variables:
        changes["two members"] = lambda: xr.concat([data, data], "member")
        changes["transposed"] = data.transpose
    for what, change in changes.items():
        try:
            yield what, change()
        except (ValueError, TypeError):  # a multi-index, for example
            continue


@pytest.mark.parametrize("stride", [15, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", sorted(CALLS))
def test_part_of_a_labelled_argument(name, stride):
    """Every fifteenth part, from another one for every function; all of them took 48 s of processor time."""
    faults, first = {}, sorted(CALLS).index(name) % stride
    for argument, data in CALLS[name]().items():
        every = parts(data) if isinstance(data, (xr.Dataset, xr.DataArray)) else ()
        for what, value in itertools.islice(every, first, None, stride):
            arguments = {**CALLS[name](), argument: value}
            fault = fault_of(lambda arguments=arguments: function_of(name)(**arguments))
            plt.close("all")
            if fault is not None:
                faults[f"{argument} {what}"] = fault
    assert faults == {}
