"""Extensions of sphinx for this site: tables made from the package."""

import re
from pathlib import Path

from docutils import nodes
from docutils.parsers.rst import Directive


def setup(app):
    """Register the directives and hooks of this file."""
    app.add_directive("names", Names)
    app.add_directive("extremes", Extremes)
    app.add_directive("extras", Extras)
    app.connect("autodoc-process-docstring", prepare_docstring)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def prepare_docstring(app, what, name, obj, options, lines):  # noqa: ARG001
    """Keep the first paragraph of a module docstring; escape the bars of `|a - b|`."""
    if what == "module" and "" in lines:
        del lines[lines.index("") :]
    in_example = False
    for number, line in enumerate(lines):
        in_example = line.lstrip().startswith(">>>") or (in_example and bool(line.strip()))
        if not in_example:
            lines[number] = line.replace("|", r"\|")


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


class Extremes(Directive):
    """The catalogue of extreme cases, run by this build, with the largest error of each case."""

    def run(self):
        from fractalcontact import accuracy

        worst = accuracy.worst_results(accuracy.extremes())
        names = ("case", "quantity", "expectation", "outcome", "error", "run_time", "passed")
        rows = [
            (
                case,
                accuracy.cases[case].description,
                nodes.literal(text=quantity),
                expectation or "finite or explained",
                ("" if passed else "FAILED: ") + outcome[:60],
                "" if error != error else f"{error:.1e}",
                f"{seconds:.2g}",
            )
            for case, quantity, expectation, outcome, error, seconds, passed in zip(
                *(worst[name].values for name in names), strict=True
            )
        ]
        head = ("case", "description", "worst quantity", "expected", "result", "error", "slowest call, s")
        return [table((16, 28, 26, 12, 12, 8, 8), head, rows)]


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
