"""The two parts of the site that sphinx does not bring: figures without pyplot, and the table of names."""

from docutils import nodes
from docutils.parsers.rst import Directive


def setup(app):
    """Make the directive `names` known to sphinx."""
    app.add_directive("names", Names)
    app.connect("autodoc-process-docstring", escape_bars)
    return {"parallel_read_safe": True, "parallel_write_safe": True}


def escape_bars(app, what, name, obj, options, lines):  # noqa: ARG001
    """Keep absolute values, `|a - b|`, from being read as substitutions."""
    lines[:] = [line.replace("|", r"\|") for line in lines]


class Names(Directive):
    """A table of every name that a result may carry, with its unit and meaning, straight from the schema."""

    def run(self):
        from fractalcontact.base.schema import QUANTITIES

        table, group, body = nodes.table(), nodes.tgroup(cols=3), nodes.tbody()
        group += [nodes.colspec(colwidth=width) for width in (28, 12, 60)]
        head = nodes.thead("", self._row("name", "units", "meaning"))
        for name, quantity in sorted(QUANTITIES.items()):
            body += self._row(nodes.literal(text=name), quantity.units or "text", quantity.long_name)
        group += [head, body]
        table += group
        return [table]

    def _row(self, *cells):
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
