"""The curves and numbers of a study as tables: one for every group and set of dims, maps left out."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import xarray as xr

from fractalcontact.base.schema import QUANTITIES
from fractalcontact.base.validation import Problems, writing

MAP_DIMS = frozenset({"x", "y"})
SINGLE = "values"


def tables(result: xr.DataTree | xr.Dataset, folder: str | os.PathLike[str] | None = None) -> dict[str, Any]:
    """Return the curves and numbers of a result as tables, and write them as CSV files into a folder.

    Parameters
    ----------
    result : DataTree or Dataset
        From `fractalcontact.scenes.run`, `fractalcontact.open` or any public function.
    folder : path-like, optional
        Write each table there, named after its group and dims: `joints_closure_by_shear_step.csv`. Created if
        it does not exist.

    Returns
    -------
    dict of str to pandas.DataFrame
        By the name of the file without suffix. One row for every point of the dims, one column for every
        coordinate and variable of these dims, headed by its name and unit: `normal_force (N)`. Numbers
        without dims are in the table `..._values`. Maps over x and y are left out.

    Raises
    ------
    InvalidInput
        `result` is neither a DataTree nor a Dataset, or `folder` cannot be written.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-6, rng=1)
    >>> pressed = fc.contact.press(surface, contact_modulus=2e10, nominal_pressure=[1e6, 2e6])
    >>> curves = fc.scenes.tables(pressed)["result_by_step"]
    >>> curves[["nominal_pressure (Pa)", "converged"]]
       nominal_pressure (Pa)  converged
    0              1000000.0       True
    1              2000000.0       True
    """
    with Problems("fractalcontact.scenes.tables") as problems:
        is_result = isinstance(result, (xr.Dataset, xr.DataTree))
        problems.require(is_result, "result", "a DataTree or Dataset", type(result).__name__)
        if folder is not None:
            problems.path("folder", folder)
    frames: dict[str, Any] = {}
    for path, dataset in groups_of(result):
        for dims in _sets_of_dims(dataset):
            name = f"{path}_by_{'_'.join(dims)}" if dims else f"{path}_{SINGLE}"
            frames[name] = _frame(dataset, dims)
    if folder is not None:
        with writing("fractalcontact.scenes.tables", "folder", folder):
            Path(folder).mkdir(parents=True, exist_ok=True)
            for name, frame in frames.items():
                frame.to_csv(Path(folder) / f"{name}.csv", index=False)
    return frames


def groups_of(result: xr.DataTree | xr.Dataset) -> list[tuple[str, xr.Dataset]]:
    """Return the name and the Dataset of every group that has data."""
    if isinstance(result, xr.Dataset):
        return [("result", result)]
    return [
        (node.path.strip("/").replace("/", "_") or "result", node.to_dataset(inherit=False))
        for node in result.subtree
        if node.data_vars and (node is not result or not node.children)  # the root repeats its groups
    ]


def _sets_of_dims(dataset: xr.Dataset) -> list[tuple[str, ...]]:
    """Return the dims of the variables, each set once, without those of maps."""
    found = dict.fromkeys(tuple(str(dim) for dim in variable.dims) for variable in dataset.data_vars.values())
    return sorted((dims for dims in found if not set(dims) >= MAP_DIMS), key=len)


def _frame(dataset: xr.Dataset, dims: tuple[str, ...]) -> Any:
    names = [name for name, variable in dataset.data_vars.items() if variable.dims == dims]
    chosen = dataset[names].drop_vars(
        [name for name, coord in dataset.coords.items() if not set(coord.dims) <= set(dims)], errors="ignore"
    )
    # a load that can be selected would be no column
    chosen = chosen.drop_indexes([name for name in chosen.xindexes if name not in chosen.dims])
    if not dims:
        chosen = chosen.expand_dims("row")
    frame = (
        chosen.to_dataframe(dim_order=list(dims) or None).reset_index().drop(columns="row", errors="ignore")
    )
    coords = [name for name in frame.columns if name not in names and name not in dims]
    frame = frame[[*dims, *coords, *names]]
    frame.columns = [heading(dataset, str(name)) for name in frame.columns]
    return frame


def heading(dataset: xr.Dataset, name: str) -> str:
    """Return the name of a variable with its unit."""
    attributes = dataset.variables[name].attrs if name in dataset.variables else {}
    quantity = QUANTITIES.get(name)
    units = attributes.get("units", quantity.units if quantity else "") or ""
    return f"{name} ({units})" if units not in ("", "1") else name
