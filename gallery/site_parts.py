"""The two parts of the site that sphinx does not bring: figures without pyplot, and the table of names."""

from docutils import nodes
from docutils.parsers.rst import Directive


def setup(app):
    """Make the directive `names` known to sphinx."""
    app.add_directive("names", Names)
    app.add_directive("extremes", Extremes)
    app.connect("autodoc-process-docstring", escape_bars)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def escape_bars(app, what, name, obj, options, lines):  # noqa: ARG001
    """Keep absolute values, `|a - b|`, from being read as substitutions."""
    lines[:] = [line.replace("|", r"\|") for line in lines]


class Names(Directive):
    """A table of every name that a result may carry, with its unit and meaning, straight from the schema."""

    def run(self):
        from fractalcontact.base.schema import QUANTITIES

        rows = [
            (nodes.literal(text=name), quantity.units or "text", quantity.long_name)
            for name, quantity in sorted(QUANTITIES.items())
        ]
        return [table((28, 12, 60), ("name", "units", "meaning"), rows)]


class Extremes(Directive):
    """The catalogue of extreme cases, each examined by this build, with what came out worst."""

    def run(self):
        from fractalcontact import accuracy
        from fractalcontact.accuracy.reporting import worst_rows

        cases = {name: case for name, case in accuracy.cases.items() if not case.large}
        head, *rows = worst_rows({name: accuracy.examine(case) for name, case in cases.items()})
        told = [
            (name, accuracy.cases[name].story, nodes.literal(text=quantity), *rest)
            for name, quantity, *rest in rows
        ]
        return [table((16, 28, 26, 12, 12, 8, 8), (head[0], "what is extreme", *head[1:]), told)]


def table(widths, head, rows):
    """Return a table; a cell is text or a node."""
    whole, group, body = nodes.table(), nodes.tgroup(cols=len(widths)), nodes.tbody()
    group += [nodes.colspec(colwidth=width) for width in widths]
    group += nodes.thead("", _row(head))
    body += [_row(row) for row in rows]
    group += body
    whole += group
    return whole


def _row(cells):
    row = nodes.row()
    for cell in cells:
        text = nodes.Text(cell) if isinstance(cell, str) else cell
        row += nodes.entry("", nodes.paragraph("", "", text))
    return row


def _get_sg_image_scraper():
    return save_figures


def save_figures(_, block_vars, gallery_conf):
    """Save the figures that a block of an example left behind; return the text that shows them."""
    from matplotlib.figure import Figure
    from sphinx_gallery.scrapers import figure_rst

    shown = block_vars["example_globals"].setdefault("_shown", set())
    paths = []
    for value in list(block_vars["example_globals"].values()):
        if isinstance(value, Figure) and id(value) not in shown:
            shown.add(id(value))
            path = next(block_vars["image_path_iterator"])
            value.savefig(path, dpi=150)
            paths.append(path)
    return figure_rst(paths, gallery_conf["src_dir"])
