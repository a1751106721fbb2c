"""Scenes that are damaged as a careless editor, or a malicious one, would do it."""

import datetime
import math

from fuzz_faults import fault_of

from fractalcontact.base.errors import FractalContactError

TABLES = {
    "surface": {
        "generate": "fbm", "shape": [20, 20], "spacing": 1e-4, "hurst": 0.8, "rms_increment": 4e-6,
        "rng": 5,
    },
    "material": {"young": 30e9, "poisson": 0.2, "basic_friction_angle": 35.0},
}  # fmt: skip
JOINT = {"block": 1.2e-3, "direction": "W", "shear": [1e-4, 2e-4], "normal_force": [1.0, 10.0]}

# every scene runs in about a tenth of a second as it stands
SCENES = {
    "roughness": {
        **TABLES,
        "want": {"surfaces": ["describe", "height"], "dimensions": ["variogram", "spectrum"]},
    },
    "contact": {
        **TABLES,
        "contact": {"contact_modulus": 1e9, "nominal_pressure": {"first": 1e5, "last": 1e7, "count": 3}},
        "want": {"contact": "press", "domains": ["box_dimension", "islands"], "keep": ["state"]},
    },
    "members": {
        **TABLES,
        "surface": {**TABLES["surface"], "members": 2},
        "contact": {"closure": [1e-6, 2e-6]},
        "want": {"contact": ["press"], "domains": ["evolution"]},
    },
    "joint": {
        **TABLES,
        "joint": {**JOINT, "rigid_dilatancy": {"shear": {"start": 0.0, "stop": 2e-4, "step": 1e-4}},
                  "friction": {"smoothing": 1e-4}},
        "want": {"joints": ["rigid_dilatancy", "closure", "friction"], "domains": ["lacunarity"]},
    },
    "two faces": {
        **TABLES,
        "upper": {**TABLES["surface"], "rng": 6, "level": 1},
        "joint": {**JOINT, "register": False},
        "want": {"joints": ["closure", "delta_surface", "transmissivity"]},
    },
    "spectral": {
        "title": "a periodic surface",
        "surface": {"generate": "spectral", "shape": [20, 20], "spacing": [1e-4, 1e-4], "hurst": 0.8,
                    "rms_height": 1e-5, "rng": 5},
        "contact": {"contact_modulus": 1e9, "normal_force": 1.0, "hardness": 1e9},
        "want": {"contact": ["press"], "surfaces": "describe"},
    },
    "domains": {
        **TABLES,
        "contact": {"contact_modulus": 1e9, "normal_force": [1e-2, 1e-1], "influence": "square",
                    "boundary": "free", "tolerance": 1e-7, "method": "fast"},
        "domains": {
            "box_dimension": {"cover": "minimum", "box_sizes": [1, 8]},
            "box_counts": {"box_sizes": [1, 2, 4]},
            "lacunarity": {"box_sizes": [1, 2, 4], "boxes": "gliding"}, "islands": {"connectivity": 2},
            "generalised_dimensions": {"q": [0, 1, 2]}, "percolation": {"periodic": False},
            "evolution": {"include": ["islands"]}, "minkowski_dimension": {"radii": [1, 2, 3]},
        },
        "want": {
            "contact": ["press"], "keep": ["state", "label"],
            "domains": ["box_dimension", "box_counts", "lacunarity", "islands", "generalised_dimensions",
                        "percolation", "minkowski_dimension", "describe", "lineage"],
        },
    },
    "every stage": {
        **TABLES,
        "joint": {
            "block": [1.2e-3, 1.2e-3], "direction": ["E", 90], "shear": [0.0, 1e-4],
            "normal_force": [0.1, 1.0],
            "closure": {"direction": "E", "bulk": "flat_block", "disc_radius": "second_order"},
            "delta_surface": {"shear": 1e-4, "direction": "N"},
            "delta_dimension": {"direction": "N", "shear": [1e-4], "window": [1e-4, 6e-4]},
            "elastic_dilatancy": {"shear": [0.0, 1e-4], "normal_force": [1.0], "tolerance": 1e-7},
            "decorrelation_length": {"direction": "E", "shear": [0.0, 1e-4, 2e-4]},
            "transmissivity": {"axis": "x", "viscosity": 1e-3},
        },
        "want": {
            "joints": ["closure", "delta_surface", "delta_dimension", "elastic_dilatancy", "friction",
                       "decorrelation_length", "transmissivity"],
        },
    },
    "file": {
        "surface": {"read": "scan.npy", "spacing": 1e-4, "units": "um", "level": 1, "fill": True,
                    "despike": True},
        "dimensions": {"noise": True, "scales": [1e-4, 1e-3]},
        "want": {"dimensions": "default", "figures": True},
    },
}  # fmt: skip

NOW = datetime.datetime(2026, 1, 2, 3, 4, 5)

VALUES = (
    0, 1, 2, 3, -1, 10**12, 10**30, 10**400, -(10**400), 2**63, 0.5, 1.5, 1e-300, 1e300, 5e-324, -0.0,
    math.nan,
    math.inf, -math.inf, True, False, "", "x", "no", "yes", "1e9", "1,5", "E", "all", "press",
    "../../etc/passwd",
    "/dev/zero", "/tmp", "$HOME", "$NOTHING/x", "~/x.npy", "a\0b", "a\nb", "x" * 2000, "\u00e4\u2603", NOW,
    NOW.date(), NOW.time(), [], [[]], {}, [1], [1, 2], [1, 2, 3], [3, 2, 1], [20, 20], [1.5, 2.5], [0],
    [-1, -1],
    [1e-4, 1e-4], [math.nan], [math.inf, 1], [True], ["x"], ["x", 1], [1, [2]], [[1, 2], [3]], [[1, 2],
    [3, 4]],
    [[[[1]]]], [NOW], [{}], [{"a": 1}], {"a": 1}, {"a": {"b": {"c": [1]}}}, {"start": 0, "stop": 1,
    "step": 0},
    {"start": 0.0, "stop": 1e-4, "step": 1e-5}, {"first": 1, "last": 10, "count": 3}, {"start": "x"},
    {"first": 1e5, "last": 1e6, "count": 10**7}, {"start": NOW, "stop": NOW, "step": 1}, [10**400], ["E",
    "W"],
    ["E", 45], [None], "default", "height", "describe", "closure", ["closure", "closure"], [20], [20, 20,
    20],
    [200000, 200000], 200000, "fbm", "spectral", "weierstrass", "midpoint", "first_yield", -45, 720, 1e9,
)  # fmt: skip

KEYS = (
    "surface", "upper", "material", "contact", "joint", "dimensions", "domains", "want", "title",
    "read", "sample", "generate", "level", "despike", "fill", "members", "rng", "shape",
    "spacing", "block", "register", "closure", "normal_force", "nominal_pressure", "keep", "figures",
    "scales",
    "islands", "friction", "hardness", "influence", "boundary", "tolerance", "method", "smoothing",
    "channel",
    "units", "bulk", "box_sizes", "connectivity", "window", "yield_pressure", "lag", "progress", "periodic",
    "x", "", "a b", "\u00e4", "\"",
)  # fmt: skip


def toml_of(tables):
    """Return tables as TOML text; None stands for an empty word, as TOML has none."""
    lines = [f"{_key(key)} = {_value(value)}" for key, value in tables.items() if not _is_table(value)]
    for key, value in tables.items():
        if _is_table(value):
            lines.append(f"[{_key(key)}]")
            lines += [f"{_key(word)} = {_value(item)}" for word, item in value.items()]
    return "\n".join(lines) + "\n"


def _is_table(value):
    return isinstance(value, dict) and bool(value)


def _key(word):
    return '"' + _escaped(word) + '"'


def _escaped(word):
    marks = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\0": "\\u0000"}
    return "".join(marks.get(letter, letter) for letter in word)


def _value(value):
    if value is None:
        return '""'
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return '"' + _escaped(value) + '"'
    if isinstance(value, float) and not math.isfinite(value):
        return repr(value)
    if isinstance(value, (datetime.date, datetime.time)):
        return value.isoformat()
    if isinstance(value, list):
        return "[" + ", ".join(map(_value, value)) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{_key(key)} = {_value(item)}" for key, item in value.items()) + "}"
    return repr(value)


def damaged_tables(pick):
    """Return what was done, and the tables of a scene after one to three mistakes."""
    name = pick(sorted(SCENES))
    tables = {key: dict(value) if isinstance(value, dict) else value for key, value in SCENES[name].items()}
    mistakes = range(pick([1, 1, 1, 1, 1, 2, 3]))
    return [name, *(_mistake(tables, pick) for _ in mistakes)], tables


def _mistake(tables, pick):
    what = pick(["value", "value", "value", "value", "key", "drop", "inside", "move", "whole"])
    inner = [key for key, value in tables.items() if isinstance(value, dict)]
    if not inner or what == "whole":
        key = pick([*sorted(tables), *KEYS])
        tables[key] = pick(VALUES)
        return f"{key} = {str(tables[key])[:60]}"
    place = pick(sorted(inner))
    table = tables[place]
    within = [key for key, value in table.items() if isinstance(value, dict) and value]
    if within and pick([True, True, False]):
        word = pick(sorted(within))
        table[word] = dict(table[word])
        place, table = f"{place}.{word}", table[word]
    if what == "key" or not table:
        key = pick(KEYS)
        table[key] = pick(VALUES)
    else:
        key = pick(sorted(table))
        if what == "drop":
            del table[key]
            return f"without {place}.{key}"
        if what == "move":
            tables[pick(sorted(inner))] = {**table}
            return f"{place} copied"
        value = table[key]
        if what == "inside" and isinstance(value, list):
            table[key] = [*value, pick(VALUES)]
        elif what == "inside" and isinstance(value, dict) and value:
            table[key] = {**value, pick(sorted(value)): pick(VALUES)}
        else:
            table[key] = pick(VALUES)
    return f"{place}.{key} = {str(table[key])[:60]}"


def damaged_text(pick):
    """Return what was done, and the bytes of a scene file that may be no TOML at all."""
    if pick([True, True, True, True, True, True, True, True, False]):
        done, tables = damaged_tables(pick)
        return done, toml_of(tables).encode("utf-8", "surrogatepass")
    name = pick(sorted(SCENES))
    text = toml_of(SCENES[name]).encode()
    what = pick(["cut", "bytes", "deep list", "deep table", "long number", "zero bytes", "twice", "empty"])
    place = pick(range(len(text)))
    changed = {
        "cut": lambda: text[:place],
        "bytes": lambda: text[:place] + bytes(pick(range(256)) for _ in range(4)) + text[place:],
        "deep list": lambda: b"deep = " + b"[" * 3000 + b"]" * 3000 + b"\n" + text,
        "deep table": lambda: text + b"\n[" + b".".join([b"a"] * 3000) + b"]\n",
        "long number": lambda: b"title = " + b"9" * 5000 + b"\n" + text,
        "zero bytes": lambda: bytes(pick([0, 1, 100])),
        "twice": lambda: text + text,
        "empty": lambda: b"",
    }[what]()
    return [name, what], changed


def fault_of_scene(source, folder, *, seconds=30):
    """Return what is wrong with the run of a scene file: None for a clear error or a result."""
    import fractalcontact as fc

    path = folder / "study.toml"
    path.write_bytes(source)

    def run():
        try:
            fc.scenes.run(path, out=folder / "out", progress=False)
        except FractalContactError as error:
            text = str(error)
            assert "expected" in text or "not a TOML file" in text or "set the environment" in text, text
            raise

    return fault_of(run, seconds=seconds)
