"""Figures, drawn from labelled results.

Every function takes a result of another subpackage, as computed or as read back from a file.

    ax = fc.plotting.plot(result)
    ax.figure.savefig("closure.png")  # or .svg, .pdf

`plot` draws the standard figure of a result, and other kinds by name; `path` any variable of a path of load
or shear, `field` any map.

A function with one panel returns its Axes, one with several an array of Axes; `ax=` or `axes=` draws into a
figure that exists. A page about a joint is `fractalcontact.scenes.datasheet`. A new figure is one of pyplot:
a notebook shows it once, at the end of the cell, and `plt.show()` in a window. Text, lines and background
follow the style of matplotlib that is in use; `plt.style.use("fractalcontact.plotting.report")` is that of
the files that `draw` writes. Units are read from the data and shown with a suitable prefix (mm, µm, kN), or
as `units={"normal_force": "kN"}` says; that of an axis is `ax.xaxis.get_units()`.
`curves(ax).to_csv("closure.csv")` exports the numbers. `draw` writes every figure that a study has data for,
without pyplot.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
