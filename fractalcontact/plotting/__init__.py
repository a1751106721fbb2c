"""Figures, drawn from labelled results and from nothing else.

Every function takes a result as the other rooms give it, or as it was read back from a file, and returns a
matplotlib Figure. No state of pyplot is touched, so figures can be made on a machine without a screen, many
at a time. Units come from the labels of the data and are shown with the prefix that suits them (mm, um, kN).

    figure = fc.plotting.closure_laws(result)
    figure.savefig("closure.png")

A function with one panel takes `ax`, one with several takes `figure` (a Figure or a SubFigure), to become
part of a larger drawing. `paper_figure` draws the five figures of the founding paper from a saved study;
`draw` writes every figure that a study has data for.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
