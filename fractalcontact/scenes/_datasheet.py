"""The datasheet of a joint: its curves on one page, with rows of the tables of the study beside them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import xarray as xr

from fractalcontact.base.study import group_of, of_member
from fractalcontact.base.tables import table
from fractalcontact.base.validation import NONE, Problems
from fractalcontact.scenes._caveats import caveats
from fractalcontact.scenes._result_tables import ResultTable
from fractalcontact.scenes._summary import stage_tables, written_rows

# by group, columns of the table that its stage declares
SHOWN = {
    "joints/roughness_coefficient": ("JRC", "scatter of the profiles", "read every", "regression over"),
    "joints/directional_roughness": ("largest roughness metric", "smallest roughness metric"),
    "joints/strength_envelope": (),  # its remarks alone: the page has its curves
    "joints/direct_shear": ("peak strength", "friction angle", "residual strength"),
    "joints/uplift": ("uplift", "of the linear diagram"),
    "joints/closure_laws": ("preferred law", "seating pressure"),
}


def datasheet(tree: xr.DataTree, *, figure: Any = None) -> dict[str, Any]:
    """Draw one page about a joint: roughness, strength, stiffness, aperture, flow, and limits of validity.

    The numbers are those of the summary and the report. Of an ensemble they are those of its first member.

    Parameters
    ----------
    tree : DataTree
        From `fractalcontact.scenes.run` or `fractalcontact.open`, with any of the groups
        joints/roughness_coefficient, directional_roughness, strength_envelope, direct_shear, shear_curve,
        closure, closure_laws, transmissivity and uplift. Panels without data stay empty.
    figure : Figure, optional
        An empty figure of matplotlib, which becomes the page: A4, upright. Default: a new figure.

    Returns
    -------
    dict of str to Axes
        The panels by what they show.

    Raises
    ------
    InvalidInput
        The study has none of these groups.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> import xarray as xr
    >>> surface = fc.surfaces.fbm((64, 64), 5e-4, hurst=0.8, rms_increment=1e-4, rng=1)
    >>> envelope = fc.joints.strength_envelope(
    ...     surface, nominal_pressure=[1e6, 4e6], wall_strength=6e7, basic_friction_angle=30
    ... )
    >>> list(fc.scenes.datasheet(xr.DataTree.from_dict({"/joints/strength_envelope": envelope})))
    ['strength', 'normal stiffness', 'mean gap', 'transmissivity']
    """
    from fractalcontact.plotting.joint_page import GROUPS, draw_page  # only where figures are wanted

    with Problems("fractalcontact.scenes.datasheet") as problems:
        problems.tree("tree", tree)
        is_sheet = figure is None or hasattr(figure, "subfigures")
        problems.require(is_sheet, "figure", "a Figure or SubFigure, or None", figure)
        if isinstance(tree, xr.DataTree):
            is_of_joint = any(group_of(tree, f"joints/{name}") is not None for name in GROUPS)
            problems.require(is_of_joint, "tree", f"at least one of joints/{', joints/'.join(GROUPS)}", NONE)

    study = of_member(tree, 0)
    shown = list(_tables(study))
    # the page has room for so many characters beside the strength
    texts = [f"{each.title}\n{table(written_rows(each), 74, rule=False)}" for each in shown if each.heads]
    remarks = [remark for each in shown for remark in each.remarks]
    lines = "\n\n".join(texts).splitlines()
    return draw_page(study, lines, [*caveats(study), *remarks], figure)


def _tables(study: xr.DataTree, most: int = 4) -> Iterator[ResultTable]:
    """Yield the tables of the page with the columns that it shows, and at most so many rows."""
    for name, columns in SHOWN.items():
        yield from (made.selected(columns).shortened(most) for made in stage_tables(study, [name]))
