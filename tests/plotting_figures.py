"""Reading numbers, colours and pixels back from a figure."""

import re

import numpy as np

FACTORS = {
    "m": 1.0, "mm": 1e-3, "µm": 1e-6, "nm": 1e-9, "Mm": 1e6, "N": 1.0, "kN": 1e3,
    "Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "GPa": 1e9,
    "%": 0.01, "°": 1.0, "mm²": 1e-6, "m⁴": 1.0, "rad m⁻¹": 1.0, "µm²": 1e-12,
}  # fmt: skip

OPEN, CONTACT, YIELDED = (
    np.array([int(code[i : i + 2], 16) for i in (0, 2, 4)]) / 255 for code in ("F2F0E9", "12355B", "D55E00")
)
MISSING = np.full(3, 0xD9 / 255)


def factor(label):
    """Return the SI value of the unit in brackets at the end of a label."""
    return FACTORS[re.search(r"\(([^()]*)\)$", label).group(1)]


def drawn(ax):
    """Return the curves on an axes in SI units."""
    fx, fy = factor(ax.get_xlabel()), factor(ax.get_ylabel())
    return [np.array([line.get_xdata(), line.get_ydata()], float) * [[fx], [fy]] for line in ax.lines]


def holds(curves, x, y):
    """Return True if one of the curves goes through the points."""
    x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
    return any(c.shape[1] == x.size and np.allclose(c, [x, y], rtol=1e-12, equal_nan=True) for c in curves)


def colours(ax):
    """Return the colours of the image on an axes, first row south."""
    assert ax.images[0].origin == "lower"
    return np.asarray(ax.images[0].get_array())


def figure_of(axes):
    """Return the figure of some Axes, alone, in an array or in a dict; a figure itself."""
    if hasattr(axes, "add_axes"):
        return axes
    first = np.ravel(np.array(list(axes.values()) if isinstance(axes, dict) else axes, dtype=object))[0]
    return first.get_figure(root=True)


def render(axes):
    """Draw the figure of some Axes to pixels, as in a file, and check that nothing is cut off."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.colors import to_rgb

    figure = figure_of(axes)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]
    border = np.concatenate([pixels[0], pixels[-1], pixels[:, 0], pixels[:, -1]])
    face = np.round(255 * np.array(to_rgb(figure.get_facecolor())))
    assert (border == face).all(), "something is cut off at the edge of the figure"
    return pixels
