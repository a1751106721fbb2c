"""Values that no argument expects, and damaged arrays; every choice is made by a function `pick`.

`pick` takes a sequence and returns one of its entries: `random.Random(seed).choice`.
"""

import datetime
import decimal
import fractions
import pathlib
import uuid

import numpy as np
import xarray as xr

HUGE = 10**400
NOW = datetime.datetime(2026, 1, 2, 3, 4, 5)

# made by functions, so that no call can change the values of the next
VALUES = {
    "None": lambda: None,
    "NaN": lambda: np.nan,
    "infinity": lambda: np.inf,
    "minus infinity": lambda: -np.inf,
    "zero": lambda: 0,
    "minus one": lambda: -1,
    "one": lambda: 1,
    "two": lambda: 2,
    "half": lambda: 0.5,
    "three and a half": lambda: 3.5,
    "1e308": lambda: 1e308,
    "denormal": lambda: 5e-324,
    "10^400": lambda: HUGE,
    "-10^400": lambda: -HUGE,
    "2^63": lambda: 2**63,
    "10^12": lambda: 10**12,
    "complex": lambda: 1j,
    "true": lambda: True,
    "false": lambda: False,
    "word": lambda: "x",
    "no": lambda: "no",
    "number in words": lambda: "1.5",
    "empty word": lambda: "",
    "null byte": lambda: "a\0b",
    "surrogate": lambda: "\ud800",
    "long word": lambda: "x" * 5000,
    "bytes": lambda: b"x",
    "object": object,
    "type": lambda: int,
    "function": lambda: len,
    "module": lambda: np,
    "date": lambda: datetime.date(2026, 1, 2),
    "time": lambda: datetime.time(1, 2, 3),
    "datetime": lambda: NOW,
    "timedelta": lambda: datetime.timedelta(seconds=1),
    "datetime64": lambda: np.datetime64("2026-01-02"),
    "timedelta64": lambda: np.timedelta64(1, "s"),
    "not a time": lambda: np.datetime64("NaT", "s"),
    "decimal": lambda: decimal.Decimal("1.5"),
    "fraction": lambda: fractions.Fraction(3, 2),
    "uuid": lambda: uuid.UUID(int=1),
    "path": lambda: pathlib.Path("nowhere"),
    "folder": lambda: pathlib.Path("/tmp"),
    "slice": lambda: slice(None),
    "ellipsis": lambda: ...,
    "range": lambda: range(3),
    "generator": lambda: (number for number in (1, 2)),
    "set": lambda: {1, 2},
    "empty list": list,
    "empty tuple": tuple,
    "empty dict": dict,
    "dict": lambda: {"a": 1},
    "dict of lists": lambda: {"a": [1, {"b": None}]},
    "list of None": lambda: [None],
    "list with NaN": lambda: [1.0, np.nan],
    "list of words": lambda: ["a", "b"],
    "mixed list": lambda: [1, "a", None, 2.0],
    "list of bools": lambda: [True, False],
    "list of dates": lambda: [NOW],
    "list of dicts": lambda: [{"a": 1}, {"b": 2}],
    "matrix": lambda: [[1.0, 2.0]],
    "ragged": lambda: [[1.0, 2.0], [3.0]],
    "ragged words": lambda: [["a", "b"], "c"],
    "ragged deep": lambda: [1, [2, [3, [4]]]],
    "nested": lambda: [[[[[[1]]]]]],
    "deep": lambda: deep(2000),
    "itself": lambda: containing_itself(),
    "huge list": lambda: [1.0, HUGE],
    "complex list": lambda: [1j, 2],
    "descending": lambda: [3.0, 2.0, 1.0],
    "repeated": lambda: [1.0, 1.0],
    "negative list": lambda: [-1.0, 2.0],
    "empty array": lambda: np.array([]),
    "0-D array": lambda: np.array(1.0),
    "1-D array": lambda: np.arange(4.0),
    "2-D array": lambda: np.ones((3, 3)),
    "3-D array": lambda: np.ones((2, 3, 3)),
    "4-D array": lambda: np.ones((1, 2, 3, 3)),
    "zero-size array": lambda: np.ones((0, 4)),
    "object array": lambda: np.array([None, 1, "a"], dtype=object),
    "complex array": lambda: np.ones((4, 4)) * 1j,
    "array of words": lambda: np.array(["a", "b"]),
    "array of dates": lambda: np.array(["2026-01-02"], dtype="datetime64[D]"),
    "array of time differences": lambda: np.array([1, 2], dtype="timedelta64[s]"),
    "structured array": lambda: np.zeros(3, dtype=[("a", float), ("b", int)]),
    "masked array": lambda: np.ma.masked_array([1.0, 2.0], [True, False]),
    "all masked": lambda: np.ma.masked_all((3, 3)),
    "boolean array": lambda: np.eye(4, dtype=bool),
    "unsigned array": lambda: np.ones((4, 4), np.uint8),
    "half precision": lambda: np.ones((4, 4), np.float16),
    "long double": lambda: np.ones((4, 4), np.longdouble),
    "big endian": lambda: np.ones((4, 4), ">f8"),
    "matrix with infinity": lambda: np.array([[1.0, np.inf], [0.0, 1.0]]),
    "all NaN": lambda: np.full((4, 4), np.nan),
    "float32": lambda: np.float32(1.0),
    "int8": lambda: np.int8(1),
    "numpy bool": lambda: np.bool_(True),
    "numpy word": lambda: np.str_("x"),
    "numpy void": lambda: np.void(b"abc"),
    "DataArray": lambda: xr.DataArray(np.ones((4, 4)), dims=("y", "x")),
    "0-D DataArray": lambda: xr.DataArray(1.0),
    "1-D DataArray": lambda: xr.DataArray(np.ones(3), dims="x"),
    "DataArray of words": lambda: xr.DataArray(["a"], dims="x"),
    "Variable": lambda: xr.Variable("x", [1.0]),
    "Dataset": lambda: xr.Dataset({"height": (("y", "x"), np.ones((4, 4)))}),
    "empty Dataset": xr.Dataset,
    "DataTree": xr.DataTree,
    "random state": lambda: np.random.default_rng(1),
    "class without array": lambda: Awkward(),
}  # fmt: skip


class Awkward:
    """An object whose conversion to an array, length and words all fail."""

    def __array__(self, *_, **__):
        raise RuntimeError("no array")

    def __len__(self):
        raise RuntimeError("no length")

    def __repr__(self):
        raise RuntimeError("no words")

    def __bool__(self):
        raise RuntimeError("neither true nor false")


def deep(levels):
    """Return a list inside a list, and so on."""
    value = []
    for _ in range(levels):
        value = [value]
    return value


def containing_itself():
    """Return a list that contains itself."""
    value = [1.0]
    value.append(value)
    return value


def wrong_value(pick):
    """Return the name of a value and the value."""
    name = pick(list(VALUES))
    return name, VALUES[name]()


COORDINATES = {
    "words": lambda n: np.array([f"c{k}" for k in range(n)]),
    "dates": lambda n: np.datetime64("2026-01-01", "ns") + np.arange(n).astype("timedelta64[D]"),
    "time differences": lambda n: np.arange(n).astype("timedelta64[s]").astype("timedelta64[ns]"),
    "objects": lambda n: np.array([object() for _ in range(n)], dtype=object),
    "complex numbers": lambda n: np.arange(n) * 1j,
    "truth": lambda n: np.arange(n) % 2 == 1,
    "NaN": lambda n: np.full(n, np.nan),
    "infinity": lambda n: np.full(n, np.inf),
    "uneven": lambda n: np.arange(n) ** 2.0,
    "equal": lambda n: np.zeros(n),
    "huge": lambda n: np.arange(n) * 1e300,
    "tiny": lambda n: np.arange(n) * 1e-300,
}  # fmt: skip

# what may stand in an attribute of a file of another origin
ATTRIBUTES = {
    "mm": "mm", "furlong": "furlong", "empty": "", "number": 5, "NaN": np.nan, "zero": 0.0,
    "negative": -1.0,
    "word": "x", "array": np.array([1.0, 2.0]), "empty array": np.array([]), "words": ["m", "mm"],
    "None": None,
    "dict": {"a": 1}, "infinity": np.inf, "bytes": b"m", "true": True, "complex": 1j, "date": NOW,
}  # fmt: skip


def damaged(array, pick):
    """Return what was done to a labelled array, and the array; words in capitals must be refused."""
    if isinstance(array, xr.Dataset):
        return damaged_dataset(array, pick)
    name = pick(list(DAMAGE))
    try:
        result = DAMAGE[name](array, pick)
    except ValueError:  # a dim that is there already, for example
        return "as it was", array
    return result if isinstance(result, tuple) else (name, result)


def damaged_dataset(dataset, pick):
    """Return a result with one of its variables or coordinates damaged or missing."""
    if not dataset.variables:
        return "as it was", dataset
    name = pick([str(name) for name in dataset.variables])
    what = pick(["drop", "damage", "transpose", "NaN", "words", "empty", "attributes", "first", "array"])
    values = dataset.variables[name]
    if what == "drop":
        return f"without {name}", dataset.drop_vars(name)
    if what == "transpose":
        return "transposed", dataset.transpose(*reversed(list(dataset.dims)))
    if what == "NaN" and values.dtype.kind == "f":
        return f"{name} NaN", dataset.assign({name: values * np.nan})
    if what == "words":
        return f"{name} words", dataset.assign({name: (values.dims, np.full(values.shape, "a"))})
    if what == "empty" and dataset.dims:
        dim = pick([str(dim) for dim in dataset.dims])
        return f"no {dim}", dataset.isel({dim: slice(0)})
    if what == "first" and dataset.dims and min(dataset.sizes.values()):
        dim = pick([str(dim) for dim in dataset.dims])
        return f"first {dim}", dataset.isel({dim: 0})
    if what == "array":
        return f"array {name}", dataset[name]
    result = dataset.copy()
    key, word = pick(["units", "long_name", "provenance"]), pick(list(ATTRIBUTES))
    if key == "provenance":
        result.attrs[key] = ATTRIBUTES[word]
    else:
        result[name].attrs[key] = ATTRIBUTES[word]
    return f"{name}.{key} = {word}", result


def _coordinate(array, pick):
    dims = [dim for dim in ("x", "y") if dim in array.dims]
    if not dims:
        return "as it was", array
    dim, word = pick(dims), pick(list(COORDINATES))
    return f"{dim.upper()} {word.upper()}", array.assign_coords({dim: COORDINATES[word](array.sizes[dim])})


def _attribute(array, pick):
    targets = [None, *(dim for dim in ("x", "y") if dim in array.coords)]
    target, word = pick(targets), pick(list(ATTRIBUTES))
    result = array.copy()
    if target is None:
        key = pick(["units", "long_name", "provenance", "references", "title"])
        result.attrs[key] = ATTRIBUTES[word]
        return f"{key} {word}", result
    key = pick(["units", "period"])
    coordinate = result[target].copy()
    coordinate.attrs[key] = ATTRIBUTES[word]
    return f"{target}.{key} {word}", result.assign_coords({target: coordinate})


def _dtype(array, pick):
    kind = pick(["complex", "object", "U4", "datetime64[ns]", "timedelta64[ns]", "float16", ">f8", "int8",
                 "uint64", "bool", "float32", "object words"])  # fmt: skip
    if kind == "complex":
        return "TYPE COMPLEX", array * (1 + 1j)
    if kind in ("object", "object words"):
        values = np.full(array.shape, "a" if kind == "object words" else 1.5, dtype=object)
        return "TYPE OBJECT", array.copy(data=values)
    if kind == "U4":
        return "TYPE WORDS", array.copy(data=np.full(array.shape, "a"))
    values = np.nan_to_num(array.values.astype(float)).astype("int64" if "64[ns]" in kind else "float64")
    result = array.copy(data=values.astype(kind))
    return ("TYPE TIME" if "64[ns]" in kind else f"type {kind}"), result


def _missing(array, pick):
    values = array.values.astype(np.float64)
    value = pick([np.nan, np.inf, -np.inf, 1e200, 1e-320])
    share = pick(["one", "all", "row", "column"])
    places = {"one": (..., 0), "all": (...,), "row": (..., 0, slice(None)), "column": (..., slice(None), 0)}
    place = places[share] if values.ndim > 1 or share == "all" else (..., 0)
    if values.ndim == 0:
        place = ()
    values[place] = value
    return f"{share} {value}", array.copy(data=values)


def _multiindex(array, pick):
    if "x" not in array.dims:
        return array
    levels = {name: ("x", np.arange(array.sizes["x"])) for name in ("a", "b")}
    return array.drop_vars("x", errors="ignore").assign_coords(levels).set_index(x=["a", "b"])


DAMAGE = {
    "coordinate": _coordinate,
    "coordinate again": _coordinate,
    "attribute": _attribute,
    "attribute again": _attribute,
    "type": _dtype,
    "missing": _missing,
    "transposed": lambda a, pick: a.transpose(),
    "x descending": lambda a, pick: a.isel(x=slice(None, None, -1)) if "x" in a.dims else a,
    "y descending": lambda a, pick: a.isel(y=slice(None, None, -1)) if "y" in a.dims else a,
    "Dataset": lambda a, pick: a.to_dataset(name="height"),
    "tree": lambda a, pick: xr.DataTree(a.to_dataset(name="height")),
    "plain array": lambda a, pick: a.values,
    "nested lists": lambda a, pick: a.values.tolist(),
    "pandas": lambda a, pick: a.to_series() if a.name is not None and a.ndim else a.rename("z").to_series(),
    "variable": lambda a, pick: a.variable,
    "dask": lambda a, pick: a.chunk(),
    "no coordinates": lambda a, pick: a.drop_vars(list(a.coords)),
    "no x": lambda a, pick: a.drop_vars("x", errors="ignore"),
    "other dims": lambda a, pick: a.rename({dim: f"{dim}2" for dim in a.dims}),
    "dims swapped in name": lambda a, pick: a.rename({"x": "y", "y": "x"}) if a.ndim == 2 else a,
    "profile": lambda a, pick: a.isel({a.dims[0]: 0}) if a.ndim else a,
    "one number": lambda a, pick: a.isel(dict.fromkeys(a.dims, 0)),
    "empty": lambda a, pick: a.isel({pick(a.dims): slice(0)}) if a.ndim else a,
    "one column": lambda a, pick: a.isel({pick(a.dims): slice(1)}) if a.ndim else a,
    "two by two": lambda a, pick: a.isel(dict.fromkeys(a.dims, slice(2))),
    "extra dim": lambda a, pick: a.expand_dims(pick(["member", "shear", "z", "step", "direction"])),
    "extra dim at the end": lambda a, pick: a.expand_dims({"z": 2}, axis=-1),
    "members with names": lambda a, pick: a.expand_dims(member=["first", "second"]),
    "members that are dates": lambda a, pick: a.expand_dims(member=[np.datetime64("2026-01-01", "ns")]),
    "no members": lambda a, pick: a.expand_dims(member=[]),
    "2-D coordinate": lambda a, pick: a.assign_coords(lat=(a.dims, np.ones(a.shape))),
    "odd name": lambda a, pick: a.rename(pick([None, "x y", "", "a" * 300, "run_time", "label"])),
    "coordinate named as a result": lambda a, pick: a.assign_coords(
        {pick(["hurst", "closure", "scale", "run_time"]): 1.0}
    ),
    "multi-index": _multiindex,
}  # fmt: skip
