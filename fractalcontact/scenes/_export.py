"""Results for other programs: curves and numbers as tables, maps as VTK image data or TIFF.

There is a table for every group and set of dims. ParaView reads the VTK files, Fiji and ImageJ the TIFFs.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.errors import require_library
from fractalcontact.base.files import written_whole
from fractalcontact.base.numbers import Array
from fractalcontact.base.schema import units_of
from fractalcontact.base.validation import Problems, Words, writing

_File = tuple[str, Callable[[Path], None]]  # its name, and what writes it

WHERE = "fractalcontact.scenes.export"
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
        coordinate and variable of these dims, headed by its name and unit: `normal_force (N)`. Flags are the
        words of their `flag_meanings`. Numbers without dims are in the table `..._values`. Maps over x and y
        are left out.

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
    groups = dict.fromkeys(
        tuple(str(dim) for dim in variable.dims) for variable in dataset.data_vars.values()
    )
    return sorted((dims for dims in groups if not set(dims) >= MAP_DIMS), key=len)


def _frame(dataset: xr.Dataset, dims: tuple[str, ...]) -> Any:
    """Return the variables of these dims beside their coordinates, a row for each point."""
    from pandas import DataFrame  # type: ignore[import-untyped]

    sizes = {dim: dataset.sizes[dim] for dim in dims}
    coords = [name for name, coord in dataset.coords.items() if set(coord.dims) <= set(dims) - {name}]
    names = [name for name, variable in dataset.data_vars.items() if variable.dims == dims]
    variables: dict[Any, Any] = {dim: xr.Variable(dim, np.arange(size)) for dim, size in sizes.items()}
    variables |= dataset.variables  # a dim may have no coordinate
    columns = (*dims, *coords, *names)
    return DataFrame(
        {heading(dataset, str(name)): _in_words(variables[name].set_dims(sizes)).ravel() for name in columns}
    )


def _in_words(variable: xr.Variable) -> Array:
    """Return the values of a variable; of flags what they mean."""
    values: Array = np.asarray(variable.values)
    if not {"flag_values", "flag_meanings"} <= variable.attrs.keys():
        return values
    meanings = str(variable.attrs["flag_meanings"]).split()
    words = dict(zip(np.ravel(variable.attrs["flag_values"]).tolist(), meanings, strict=True))
    named = [words.get(value, str(value)) for value in values.ravel().tolist()]
    return np.array(named, dtype=object).reshape(values.shape)


def heading(dataset: xr.Dataset, name: str) -> str:
    """Return the name of a variable with its unit."""
    units = units_of(name, dataset.variables[name].attrs if name in dataset.variables else {})
    return f"{name} ({units})" if units not in ("", "1") else name


def export(
    result: xr.DataTree | xr.Dataset | xr.DataArray,
    folder: str | os.PathLike[str],
    *,
    to: str = "vti",
    force: bool = False,
) -> list[Path]:
    """Write the maps of a result for ParaView (VTK image data, .vti) or Fiji and ImageJ (TIFF).

    Parameters
    ----------
    result : DataTree, Dataset or DataArray
        A study, a result or a surface: all variables over y and x are written, heights, states, pressures,
        gaps and labels of islands. Curves are in `fractalcontact.scenes.tables`.
    folder : path-like
        Created if it does not exist.
    to : {"vti", "tiff"}
        "vti": one file for every plane of a group, `joints_closure_shear000_step003.vti`, with all its maps
        as they are, at points with the spacing and origin (m) of the surface; ParaView opens the files of a
        path as a series. "tiff": one file for every map, with its planes as a stack whose labels name shear
        and load. Numbers have 32 bits, states and masks 8; the row of the greatest y is on top, and the
        pixels are in um. Names of arrays hold the unit: `pressure (Pa)`.
    force : bool, default False
        Overwrite files under these names.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    InvalidInput
        `result` has no maps, or the folder has files of these names or cannot be written.
    MissingExtra
        "vti" needs pyevtk (extra `vtk`).

    Examples
    --------
    >>> import tempfile
    >>> import fractalcontact as fc
    >>> surface = fc.surfaces.fbm((32, 32), 1e-4, hurst=0.8, rms_increment=1e-6, rng=1)
    >>> pressed = fc.contact.press(surface, contact_modulus=2e10, nominal_pressure=[1e6, 2e6])
    >>> [path.name for path in fc.scenes.export(pressed, tempfile.mkdtemp(), to="tiff")]
    ['result_state.tif']
    """
    with Problems(WHERE) as problems:
        is_result = isinstance(result, (xr.DataArray, xr.Dataset, xr.DataTree))
        problems.require(is_result, "result", "a DataTree, Dataset or DataArray", type(result).__name__)
        problems.path("folder", folder)
        problems.choice("to", to, FORMATS)
        problems.boolean("force", force)
    if to == "vti":
        require_library("VTK image data", "pyevtk", "vtk")
    if isinstance(result, xr.DataArray):
        result = result.to_dataset(name="values" if result.name is None else result.name)
    with Problems(WHERE) as problems:
        for _, dataset in groups_of(result):
            for dim in sorted(MAP_DIMS & set(dataset.coords)):
                kind = dataset[dim].dtype
                problems.require(kind.kind in "iuf", f"result.{dim}", "numbers in metres", f"type {kind}")
    result = result.map_over_datasets(_ascending) if isinstance(result, xr.DataTree) else _ascending(result)
    target = Path(folder)
    files = {target / name: write for group in groups_of(result) for name, write in FORMATS[to](*group)}
    with Problems(WHERE) as problems:
        problems.require(bool(files), "result", "maps over y and x", Words("none"))
        taken = [path.name for path in files if path.exists()] if not force else []
        expected = "a folder without files of these names (another folder, or force to overwrite)"
        problems.require(not taken, "folder", expected, Words(f"{target.name!r} with {', '.join(taken[:3])}"))
    with writing(WHERE, "folder", target):
        target.mkdir(parents=True, exist_ok=True)
        for path, write in files.items():
            with written_whole(path) as temporary:
                write(temporary)
    return list(files)


def _ascending(dataset: xr.Dataset) -> xr.Dataset:
    """Return a dataset whose y and x ascend."""
    return dataset.sortby([dim for dim in dataset.dims if dim in MAP_DIMS and dim in dataset.coords])


def _maps(dataset: xr.Dataset) -> Iterator[tuple[tuple[str, ...], list[str]]]:
    """Yield the leading dims of the maps of numbers, each set once, with the names of its maps."""
    by_dims: dict[tuple[str, ...], list[str]] = {}
    for name, variable in dataset.data_vars.items():
        if set(variable.dims) >= MAP_DIMS and variable.dtype.kind in "biuf" and variable.size:
            leading = tuple(str(dim) for dim in variable.dims if dim not in MAP_DIMS)
            by_dims.setdefault(leading, []).append(str(name))
    yield from by_dims.items()


def _vti_files(group: str, dataset: xr.Dataset) -> Iterator[_File]:
    for leading, names in _maps(dataset):
        maps = {name: dataset[name].transpose(*leading, "y", "x") for name in names}
        for index in np.ndindex(*(dataset.sizes[dim] for dim in leading)):
            place = "".join(f"_{dim}{number:03d}" for dim, number in zip(leading, index, strict=True))
            own = "" if leading or len(list(_maps(dataset))) == 1 else "_surface"
            planes = {heading(dataset, name): each[index] for name, each in maps.items()}
            yield f"{group}{own}{place}.vti", partial(_write_vti, planes)


def _write_vti(planes: dict[str, xr.DataArray], path: Path) -> None:
    from pyevtk.hl import imageToVTK

    plane = next(iter(planes.values()))
    origin, spacing = zip(*(_axis(plane[dim].values) for dim in ("x", "y")), strict=True)
    points = {name: _column_major(each.values) for name, each in planes.items()}
    # a spacing of 0 across the plane is refused by ParaView's filters
    written = imageToVTK(str(path), (*origin, 0.0), (*spacing, min(spacing)), pointData=points)
    Path(written).replace(path)


def _axis(values: Array) -> tuple[float, float]:
    """Return the first coordinate and the spacing; that of a single point is 1."""
    first = float(values[0])
    return first, (float(values[-1]) - first) / (values.size - 1) if values.size > 1 else 1.0


def _column_major(values: Array) -> Array:
    """Return a plane over (y, x) as VTK takes it: (x, y, z), x running first."""
    plane = values.astype(np.uint8) if values.dtype.kind == "b" else values
    return np.asfortranarray(plane.T[:, :, np.newaxis])


def _tiff_files(group: str, dataset: xr.Dataset) -> Iterator[_File]:
    for leading, names in _maps(dataset):
        for name in names:
            yield f"{group}_{name}.tif", partial(_write_tiff, dataset, name, leading)


def _write_tiff(dataset: xr.Dataset, name: str, leading: tuple[str, ...], path: Path) -> None:
    import tifffile

    field = dataset[name].transpose(*leading, "y", "x")
    is_flag = field.dtype.kind == "b" or (field.dtype.kind in "iu" and field.dtype.itemsize == 1)
    values = field.values.astype(np.uint8 if is_flag else np.float32)
    planes = values.reshape(-1, *values.shape[-2:])[:, ::-1]
    (_, dx), (_, dy) = (_axis(field[dim].values) for dim in ("x", "y"))
    metadata = {
        "axes": "ZYX",
        "unit": "um",
        "Labels": [_label(field, leading, index) for index in np.ndindex(*values.shape[:-2])],
        "Info": f"{heading(dataset, name)}: {field.attrs.get('long_name', name)}",
    }
    resolution = 1e-6 / dx, 1e-6 / dy  # pixels per unit: ImageJ shows lengths in it
    tifffile.imwrite(path, planes, imagej=True, resolution=resolution, metadata=metadata)


def _label(field: xr.DataArray, leading: tuple[str, ...], index: tuple[int, ...]) -> str:
    """Return the coordinates of a plane in words: shear (m) = 0.0002, normal_force (N) = 300."""
    plane = field[index]
    scalars = {name: coord for name, coord in plane.coords.items() if coord.ndim == 0}
    words = [
        f"{heading(field.to_dataset(name='map'), str(name))} = {c.item()}" for name, c in scalars.items()
    ]
    return ", ".join(words) or ", ".join(f"{dim} {n}" for dim, n in zip(leading, index, strict=True))


FORMATS: dict[str, Callable[[str, xr.Dataset], Iterator[_File]]] = {"vti": _vti_files, "tiff": _tiff_files}
