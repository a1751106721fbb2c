"""What a study says: small tables and what limits them, on the screen and on the page of a joint."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.file_contents import stage_rows
from fractalcontact.base.study import group_of, member_count, of_member
from fractalcontact.base.tables import note, table
from fractalcontact.base.validation import NONE, Problems
from fractalcontact.scenes._caveats import aperture_as_placed, caveats
from fractalcontact.scenes._result_tables import ResultTable, length, table_of
from fractalcontact.scenes._result_tree import OVERVIEW, scan_facts, scan_tables
from fractalcontact.scenes._stages import STAGES

MORE = "--verbose and the report have all"


@dataclass(frozen=True)
class Summary:
    """What there is to say of a study: facts about its input, tables, caveats, and the stages of its run."""

    title: str
    facts: list[str]
    tables: list[ResultTable]
    caveats: list[str]
    stages: list[tuple[str, ...]]

    def text(self, *, verbose: bool) -> str:
        """Return it as text: all of it, or so much as fits a screen."""
        return _verbose_text(self) if verbose else _screen_text(self)


def summary(tree: xr.DataTree, *, verbose: bool = False) -> str:
    r"""Return the main results of a study as text, with what limits them.

    Of an ensemble, every number is the mean over the members with its standard deviation.

    Parameters
    ----------
    tree : DataTree
        From `fractalcontact.scenes.run` or `fractalcontact.open`.
    verbose : bool
        All tables with all columns, remarks and caveats, and the run time and the achieved error of every
        stage, as in the report. Default: at most 36 lines, with at most three caveats.

    Returns
    -------
    str

    Examples
    --------
    >>> import fractalcontact as fc
    >>> result = fc.scenes.run("rigid_sliding", progress=False)
    >>> print("\n".join(fc.scenes.summary(result).splitlines()[2:4]))
    toward    shear    rigid dilatancy    slope of face
    E         10 mm    1.15 mm            +0.0264
    """
    with Problems("fractalcontact.scenes.summary") as problems:
        problems.tree("tree", tree)
        problems.boolean("verbose", verbose)
    return summary_of(tree).text(verbose=verbose)


def summary_of(tree: xr.DataTree) -> Summary:
    """Return all there is to say of a study."""
    title = str(tree.attrs.get("title", tree.name or "result"))
    return Summary(title, facts(tree), list(_tables(tree)), caveats(tree), stage_rows(tree))


def facts(tree: xr.DataTree) -> list[str]:
    """Return what a reader has to know of the input: the members, and how the surfaces were prepared."""
    members = member_count(tree)
    ensemble = [f"ensemble of {members} members: mean ± standard deviation over the members"]
    preparation = str(tree.attrs.get("preparation", ""))
    done = filter(None, preparation.split("; "))
    return [*scan_facts(tree), *(ensemble if members else []), *done, *_openings(tree)]


def _openings(tree: xr.DataTree) -> Iterator[str]:
    """Yield the opening of two measured faces where they lie, and how far faces that overlap are lifted."""
    aperture = aperture_as_placed(tree)
    if aperture is None:
        return
    mean, smallest = float(aperture.mean()), float(aperture.min())
    lifted = (
        f"; rigid, the faces first touch with the upper one lifted by {length(-smallest)}, at a mean "
        f"aperture of {length(mean - smallest)}"
    )
    yield f"aperture: mean {length(mean)}, smallest {length(smallest)}" + (lifted if smallest < 0.0 else "")


def _tables(tree: xr.DataTree) -> Iterator[ResultTable]:
    """Yield the table of every stage that the study has a result of; of many scans first a row for each."""
    yield from scan_tables(tree)
    if group_of(tree, OVERVIEW) is None:  # of many scans, each has a page of its own for the rest
        yield from stage_tables(tree, STAGES)


def stage_tables(tree: xr.DataTree, names: Iterable[str]) -> Iterator[ResultTable]:
    """Yield the table of each of the stages that the study has a result of."""
    for name in names:
        rows, data = STAGES[name].rows, group_of(tree, name)
        made = None if rows is None or data is None else table_of(rows, tree, data)
        if made is not None:
            yield made


def joined_tables(tables: Sequence[ResultTable]) -> list[ResultTable]:
    """Return tables with the columns of all that have the same rows, or some of them, in one."""
    joined: list[ResultTable] = []
    for each in tables:
        place = next((i for i, other in enumerate(joined) if _fit(each, other)), None)
        if place is None:
            joined.append(each)
        else:
            joined[place] = joined[place].beside(each)
    return joined


def _fit(one: ResultTable, other: ResultTable) -> bool:
    """Return whether the rows of one table are among those of another."""
    if not one.key_heads or one.key_heads != other.key_heads:
        return False
    # more columns beside the key do not fit 110 characters without heads of three lines
    if len(one.heads) + len(other.heads) > 8:
        return False
    ours, theirs = set(one.keys), set(other.keys)
    return (
        len(ours) == len(one.keys) and len(theirs) == len(other.keys) and (ours <= theirs or theirs <= ours)
    )


def _screen_text(whole: Summary, lines: int = 36, most: int = 3) -> str:
    """Return a summary in so many lines: results first, then at most `most` of the caveats.

    A command adds what it has written, 40 lines in all.
    """
    tables = joined_tables([each.selected(each.on_screen) for each in whole.tables if each.on_screen])
    ends = [note(caveat, indent=0) for caveat in whole.caveats[:most]]
    left_out = len(whole.caveats) - most
    ends += [f"caveats left out: {left_out}; {MORE}"] if left_out > 0 else []
    single = [_as_line(each) for each in tables if not each.key_heads]
    head = "\n".join([whole.title, *(note(fact, indent=0) for fact in whole.facts), *single])
    foot = ["\n".join(ends)] if ends else []
    left = lines - sum(part.count("\n") + 2 for part in [head, *foot])
    return "\n\n".join([head, *_fitted([each for each in tables if each.key_heads], left), *foot])


def _fitted(tables: Sequence[ResultTable], lines: int) -> list[str]:
    """Return tables that fit so many lines: the longest loses rows first, then the last are left out."""
    most = [len(each.keys) for each in tables]
    shown = [table(each.rows, rule=False) for each in tables]

    def height() -> int:
        return sum(text.count("\n") + 2 for text in shown)

    while height() > lines and shown:
        longest = int(np.argmax(most))
        if most[longest] > 2:  # the first and the last
            most[longest] -= 1
            shown[longest] = table(tables[longest].shortened(most[longest]).rows, rule=False)
        else:
            most.pop()
            shown.pop()
            lines -= 2 if len(shown) == len(tables) - 1 else 0  # for the words below
    left_out = len(tables) - len(shown)
    return [*shown, f"tables left out: {left_out}; {MORE}"] if left_out else shown


def _as_line(one_row: ResultTable) -> str:
    """Return a table with a single row and no key as a line."""
    cells = ", ".join(f"{head} {cell}" for head, cell in zip(one_row.heads, one_row.cells[0], strict=True))
    return note(f"{one_row.title}: {cells}", indent=0)


def _verbose_text(whole: Summary) -> str:
    """Return all of a summary as text."""
    sections = ["\n".join([whole.title, *(note(fact, indent=0) for fact in whole.facts)])]
    for each in whole.tables:
        lines = [each.title, table(written_rows(each)), *(note(remark) for remark in each.remarks)]
        sections.append("\n".join(lines))
    sections += ["\n".join(note(caveat) for caveat in whole.caveats)] if whole.caveats else []
    sections += [table(whole.stages)] if whole.stages else []
    return "\n\n".join(sections)


def written_rows(each: ResultTable) -> list[tuple[str, ...]]:
    """Return the head and the rows of a table; of a single row without a key a row for each value."""
    if each.key_heads:
        return each.rows
    return [("quantity", "value"), *zip(each.heads, each.cells[0], strict=True)]


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
    shown = list(_page_tables(study))
    # the page has room for so many characters beside the strength
    texts = [f"{each.title}\n{table(written_rows(each), 74, rule=False)}" for each in shown if each.heads]
    remarks = [remark for each in shown for remark in each.remarks]
    lines = "\n\n".join(texts).splitlines()
    return draw_page(study, lines, [*caveats(study), *remarks], figure)


def _page_tables(study: xr.DataTree, most: int = 4) -> Iterator[ResultTable]:
    """Yield the tables of the page with the columns that it shows, and at most so many rows."""
    for name, columns in SHOWN.items():
        yield from (made.selected(columns).shortened(most) for made in stage_tables(study, [name]))
