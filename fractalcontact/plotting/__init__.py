"""Figures, drawn from labelled results.

Every function takes a result of another subpackage, as computed or as read back from a file, and returns a
matplotlib Figure. No function uses pyplot or changes global settings, so figures can be drawn without a
display and in any number. Units are read from the data and shown with a suitable prefix (mm, µm, kN).

    figure = fc.plotting.closure_laws(result)
    figure.savefig("closure.png")

A function with one panel takes `ax`, one with several takes `figure` (a Figure or a SubFigure), to draw into
a larger figure. `paper_figure` draws the five figures of the 1998 paper from a study; `draw` writes every
figure that a study has data for.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
