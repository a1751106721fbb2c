"""Extensions of sphinx for this site: tables made from the package."""

import re
from pathlib import Path

from docutils import nodes
from docutils.parsers.rst import Directive

# words that people look for, by the function that answers; a search of the site lists these functions first
INDEX = {
    "fractalcontact.joints.roughness_coefficient": ("JRC", "joint roughness coefficient", "Z2"),
    "fractalcontact.joints.closure": (
        "closure law",
        "normal stiffness of a joint",
        "real contact area of a joint",
    ),
    "fractalcontact.joints.closure_laws": ("Bandis closure law", "hyperbolic closure law"),
    "fractalcontact.joints.strength_envelope": ("Barton shear strength", "JCS", "Patton"),
    "fractalcontact.joints.dilatancy": ("dilation of a joint", "dilatancy"),
    "fractalcontact.joints.transmissivity": ("cubic law", "leakage of a joint"),
    "fractalcontact.contact.press": ("contact with a flat", "real contact area", "Polonsky and Keer"),
    "fractalcontact.domains.hausdorff_content": (
        "Hausdorff content",
        "Hausdorff measure",
        "Hausdorff dimension",
    ),
    "fractalcontact.domains.box_dimension": ("box counting", "fractal dimension of a set"),
    "fractalcontact.domains.islands": ("cluster", "connected components", "contact spots", "grains"),
    "fractalcontact.domains.lacunarity": ("gliding box",),
    "fractalcontact.surfaces.describe": ("Sq", "Sa", "Sdq", "ISO 25178", "rms height"),
    "fractalcontact.surfaces.read": ("my own scan", "file formats", "point cloud", "CSV"),
    "fractalcontact.surfaces.level": ("tilt", "mean plane", "detrend"),
    "fractalcontact.surfaces.despike": ("outliers", "spikes"),
    "fractalcontact.dimensions.estimate": ("fractal dimension", "Hurst exponent"),
    "fractalcontact.dimensions.spectrum": ("PSD", "power spectral density"),
    "fractalcontact.dimensions.variogram": ("structure function", "height-height correlation", "HHCF"),
}


def setup(app):
    """Register the directives and hooks of this file."""
    app.add_directive("names", Names)
    app.add_directive("commands", Commands)
    app.add_directive("extras", Extras)
    app.add_directive("scene-tables", SceneTables)
    app.connect("autodoc-process-docstring", prepare_docstring)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def prepare_docstring(app, what, name, obj, options, lines):  # noqa: ARG001
    """Keep the first paragraph of a module docstring; escape the bars of `|a - b|`; add index entries."""
    if what == "module" and "" in lines:
        del lines[lines.index("") :]
    words = next((INDEX[key] for key in INDEX if name in (key, _defined_in(key))), ())
    if words:
        lines[:0] = [".. index::", *(f"   single: {word}" for word in words), ""]
    in_example = False
    for number, line in enumerate(lines):
        in_example = line.lstrip().startswith(">>>") or (in_example and bool(line.strip()))
        if not in_example:
            lines[number] = line.replace("|", r"\|")


def _defined_in(key):
    """Return the full name of the object behind a public name, with the module that defines it."""
    from importlib import import_module

    module, _, name = key.rpartition(".")
    found = getattr(import_module(module), name)
    return f"{found.__module__}.{found.__qualname__}"


class Names(Directive):
    """A table of all names in results with units and meaning, from the schema."""

    def run(self):
        from fractalcontact.base.schema import QUANTITIES

        rows = [
            (nodes.literal(text=name), quantity.units or "text", quantity.long_name)
            for name, quantity in sorted(QUANTITIES.items())
        ]
        return [table((28, 12, 60), ("name", "units", "meaning"), rows)]


class Extras(Directive):
    """The optional dependencies of the package with their purpose, from the comments of pyproject.toml."""

    def run(self):
        import tomllib

        text = (Path(__file__).parent.parent / "pyproject.toml").read_text(encoding="utf-8")
        rows = []
        for name, packages in tomllib.loads(text)["project"]["optional-dependencies"].items():
            purpose = re.search(rf"^{name} = .*?# *(.*)$", text, re.MULTILINE)
            if purpose:
                rows.append((nodes.literal(text=name), ", ".join(packages), purpose[1]))
        return [table((10, 34, 56), ("extra", "installs", "for"), rows)]


class Commands(Directive):
    """What each command of the command line takes, as its `--help` says."""

    def run(self):
        from fractalcontact.cli import command_help

        sections = []
        for name, words in command_help().items():
            title = f"fractalcontact {name}"
            section = nodes.section(ids=[nodes.make_id(title)], names=[nodes.fully_normalize_name(title)])
            section += nodes.title("", title)
            section += nodes.literal_block(words, words, language="none")
            sections.append(section)
        return sections


class SceneTables(Directive):
    """The tables of a scene, their keys and values, from the JSON Schema of scenes."""

    def run(self):
        from fractalcontact import scenes

        schema = scenes.json_schema()
        settings = {
            key: value for key, value in schema["properties"].items() if "properties" not in _object(value)
        }
        tables = {key: value for key, value in schema["properties"].items() if key not in settings}
        sections = [self.section("Before the tables", "", settings, ())]
        for name, table_schema in tables.items():
            for words, form in self.forms(table_schema):
                title = f"[{name}]{words}"
                stages = {key: _object(value) for key, value in form["properties"].items()}
                stages = {key: value for key, value in stages.items() if "properties" in value}
                own = {key: value for key, value in form["properties"].items() if key not in stages}
                purpose = table_schema.get("description", "")
                required = form.get("required", ())
                sections.append(self.section(title, purpose, own, required))
                for key, value in stages.items():
                    text = value.get("description", "")
                    sections.append(self.section(f"[{name}.{key}]", text, value["properties"], ()))
        return sections

    @staticmethod
    def forms(schema):
        """Yield a title and a schema for every form of a table."""
        for form in schema.get("oneOf", [schema]):
            source = next(
                (key for key in ("read", "sample", "generate") if key in form.get("required", ())), ""
            )
            words = form["properties"].get("generate", {}).get("const", "")
            yield (f", {source} = {words!r}" if words else f", {source}" if source else ""), form

    @staticmethod
    def section(title, purpose, keys, required):
        result = nodes.section(ids=[nodes.make_id(title)], names=[nodes.fully_normalize_name(title)])
        result += nodes.title("", title)
        if purpose:
            result += nodes.paragraph("", purpose)
        rows = [
            (
                nodes.literal(text=key),
                _values(value),
                value.get("description", "") + " Required." * (key in required),
            )
            for key, value in keys.items()
        ]
        if rows:
            result += table((24, 26, 50), ("key", "value", "meaning"), rows)
        return result


def _object(schema):
    """Return the form of a value that is a table, an empty schema if none is."""
    forms = [schema, *schema.get("anyOf", ())]
    return next((form for form in forms if "properties" in form or "oneOf" in form), {})


def _values(schema):
    """Return the values that a key takes, in words."""
    if "anyOf" in schema:
        kinds = [_values(form) for form in schema["anyOf"] if "$ref" not in form and "properties" not in form]
        ranges = ["a range"] if any("$ref" in form for form in schema["anyOf"]) else []
        return ", or ".join(dict.fromkeys([*kinds, *ranges]))
    if "enum" in schema:
        return ", ".join(f'"{word}"' for word in schema["enum"])
    if "const" in schema:
        return f'"{schema["const"]}"'
    if schema.get("type") == "array":
        inner = _values(schema.get("items", {}))
        return (
            "[ny, nx]"
            if schema.get("maxItems") == 2 and not inner
            else "a list of these"
            if inner
            else "a list"
        )
    signs = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
    bounds = " and ".join(f"{sign} {schema[key]:g}" for key, sign in signs.items() if key in schema)
    names = {"boolean": "true or false", "string": "text", "number": "number", "integer": "integer"}
    return f"{names.get(schema.get('type'), 'see the function')} {bounds}".strip()


def table(widths, head, rows):
    """Return a table; a cell is text or a node."""
    result, group, body = nodes.table(), nodes.tgroup(cols=len(widths)), nodes.tbody()
    group += [nodes.colspec(colwidth=width) for width in widths]
    group += nodes.thead("", _row(head))
    body += [_row(row) for row in rows]
    group += body
    result += group
    return result


def _row(cells):
    row = nodes.row()
    for cell in cells:
        text = nodes.Text(cell) if isinstance(cell, str) else cell
        row += nodes.entry("", nodes.paragraph("", "", text))
    return row
