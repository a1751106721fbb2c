"""What a study says: small tables and what limits them, on the screen and on the page of a joint."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr

from fractalcontact.base.file_contents import stage_rows
from fractalcontact.base.grid import EXCESS_PER_EDGE, read_grid
from fractalcontact.base.numbers import Array
from fractalcontact.base.schema import STEEP
from fractalcontact.base.study import group_of, member_count, of_member, scene_of
from fractalcontact.base.tables import note, table
from fractalcontact.base.units import number, quantity_text, span, without_rounding
from fractalcontact.base.validation import NONE, Problems
from fractalcontact.scenes._result_tables import ResultTable, finite, length, share_of, table_of
from fractalcontact.scenes._result_tree import OVERVIEW, scan_facts, scan_tables
from fractalcontact.scenes._stages import STAGES

Rule = Callable[[xr.DataTree], Iterator[str]]
PRESSED = {"contact": "the surface", "joints/closure": "the delta-surface"}
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
    mean, smallest = without_rounding([aperture.mean(), aperture.min()], "m")
    lifted = (
        f"; rigid, the faces first touch with the upper one lifted by {length(-smallest)}, at a mean "
        f"aperture of {length(mean - smallest)}"
    )
    place = "in mated position" if "shift_x" in tree["joints/faces"] else "as given"
    opening = f"aperture {place}: mean {length(mean)}, smallest {length(smallest)}"
    yield opening + (lifted if smallest < 0.0 else "")


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

    Where the tables do not fit, caveats are left out before tables, all but the first. A command adds what it
    has written, 40 lines in all.
    """
    tables = joined_tables([each.selected(each.on_screen) for each in whole.tables if each.on_screen])
    single = [_as_line(each) for each in tables if not each.key_heads]
    tables = [each for each in tables if each.key_heads]
    head = "\n".join([whole.title, *(note(fact, indent=0) for fact in whole.facts), *single])
    for count in range(most, 0, -1):
        ends = [note(caveat, indent=0) for caveat in whole.caveats[:count]]
        left_out = len(whole.caveats) - count
        ends += [f"caveats left out: {left_out}; {MORE}"] if left_out > 0 else []
        foot = ["\n".join(ends)] if ends else []
        shown = _fitted(tables, lines + 1 - _height([head, *foot]))  # the last has no empty line
        if len(shown) == len(tables):
            break
    left_out = len(tables) - len(shown)
    words = [f"tables left out: {left_out}; {MORE}"] if left_out else []
    return "\n\n".join([head, *shown, *words, *foot])


def _height(parts: Iterable[str]) -> int:
    """Return the lines of parts of a text, with an empty one after each."""
    return sum(part.count("\n") + 2 for part in parts)


def _fitted(tables: Sequence[ResultTable], lines: int) -> list[str]:
    """Return tables that fit so many lines: they lose rows first, then columns, then the last are left out.

    Those of strength are left out after all others: a scene has them where its user gives the strength of the
    walls or the friction angle, to ask for them.
    """
    kept = list(tables)
    while kept:
        words = 2 if len(kept) < len(tables) else 0  # lines of what is said of those left out
        for each in (kept, [_narrowed(one) for one in kept]):
            if shown := _thinned(each, lines - words):
                return shown
        del kept[max(range(len(kept)), key=lambda i: (not _has_strength(kept[i]), i))]
    return []


def _thinned(tables: Sequence[ResultTable], lines: int, fewest: int = 3) -> list[str]:
    """Return tables in so many lines, the longest with fewer rows; nothing where that is not possible."""
    rows = [len(each.keys) for each in tables]
    shown = [table(each.rows, rule=False) for each in tables]
    while _height(shown) > lines:
        longest = int(np.argmax(rows))
        if rows[longest] <= fewest:
            return []
        rows[longest] -= 1
        shown[longest] = table(tables[longest].shortened(rows[longest]).rows, rule=False)
    return shown


def _narrowed(each: ResultTable) -> ResultTable:
    """Return a table without its last columns where cells of it would take several lines each."""
    while len(each.heads) > 1:
        lines = table(each.rows).splitlines()
        rule = next(place for place, line in enumerate(lines) if not line.strip("- "))
        if len(lines) - rule - 1 <= len(each.keys):
            break
        each = each.selected(each.heads[:-1])
    return each


def _has_strength(each: ResultTable) -> bool:
    return any("strength" in head for head in each.heads)


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
    "joints/directional_roughness": (
        "roughness metric",
        "largest roughness metric",
        "smallest roughness metric",
    ),
    "joints/strength_envelope": (),  # its remarks alone: the page has its curves
    "joints/direct_shear": ("peak strength", "friction angle", "strength at the end", "end at shear"),
    "joints/uplift": ("uplift", "of the linear diagram"),
    "joints/shear_curve": (),  # its remark: the page has its curves
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

    study, members = of_member(tree, 0), member_count(tree)
    if members:
        study.attrs["title"] = f"{tree.attrs.get('title') or tree.name or 'joint'}: member 0 of {members}"
    pairs = ((columns, made) for name, columns in SHOWN.items() for made in stage_tables(study, [name]))
    shown = [made.selected(columns).shortened(4) for columns, made in pairs]
    # the page has room for so many rows, and for so many characters beside the strength
    texts = [f"{each.title}\n{table(written_rows(each), 74, rule=False)}" for each in shown if each.heads]
    remarks = [remark for each in shown for remark in each.remarks]
    lines = "\n\n".join(texts).splitlines()
    return draw_page(study, lines, [*caveats(study), *remarks], figure)


def caveats(tree: xr.DataTree) -> list[str]:
    """Return what limits the results of a study, and what it does to the numbers.

    Parameters
    ----------
    tree : DataTree
        From `fractalcontact.scenes.run` or `fractalcontact.open`; nothing else is read.

    Returns
    -------
    list of str
        One sentence each, the most important first: a dimension without an interval, spikes of a scan, a
        tilted surface below a flat, islands of too few cells, pressures and strengths beyond those of the
        material, slopes beyond small strains, uplift that did not come to balance. Empty where the results
        have no such limit.
    """
    if group_of(tree, OVERVIEW) is not None:  # of many scans: it has the caveats of each
        return []
    sentences = [sentence for rule in RULES for sentence in rule(tree)]
    for name, stage in STAGES.items():
        if (data := group_of(tree, name)) is not None:
            sentences += (f"{name}: {text}" for text in stage.caveats(tree, data))
    return sentences


def _of_contacts(rule: Callable[[xr.DataTree, str, xr.Dataset], Iterator[str]]) -> Rule:
    """Return the rule for every contact of a study, from that for one group of results."""

    def of_all(tree: xr.DataTree) -> Iterator[str]:
        for path in PRESSED:
            data = group_of(tree, path)
            if data is not None and "contact_fraction" in data:
                yield from rule(tree, path, data)

    return of_all


def _no_interval(tree: xr.DataTree) -> Iterator[str]:
    """Yield why the fractal dimension has no interval, each reason once."""
    estimates = group_of(tree, "dimensions")
    if estimates is None or "default" not in estimates["method"].values:
        return
    reasons = [str(text) for text in np.ravel(estimates["reason"].sel({"method": "default"}).values)]
    for reason in dict.fromkeys(filter(None, reasons)):
        yield f"D has no interval{share_of(reasons.count(reason), len(reasons))}: {reason}."


def _spikes(tree: xr.DataTree) -> Iterator[str]:
    """Yield what spikes of the scans do to the results, which the run has compared."""
    if text := tree.attrs.get("spikes"):
        yield text


def aperture_as_placed(tree: xr.DataTree) -> xr.DataArray | None:
    """Return the upper less the lower of two measured faces, where they lie; None where they are not kept."""
    upper, lower = group_of(tree, "joints/faces"), group_of(tree, "surfaces")
    if upper is None or lower is None or "height" not in upper or "height" not in lower:
        return None
    return upper["height"] - lower["height"]


def _tilt(tree: xr.DataTree) -> Iterator[str]:
    """Yield that a flat presses a tilted surface at one edge."""
    shares = np.atleast_1d(tree.attrs.get("plane_share", 0.0))  # of an ensemble one for each member
    tilted = shares[shares > 0.5]
    if tilted.size and group_of(tree, "contact") is not None:  # the flat touches one edge
        where = f" in {tilted.size} of {shares.size} members" if shares.size > 1 else ""
        carried = span(tilted, lambda share: f"{100 * share:.0f}")
        yield (
            f"the surface is tilted{where}: its mean plane carries {carried} % of Sq², so that the flat "
            "touches one edge first, and area and closure are those of a wedge. Remedy: level = 1."
        )


def _cells_per_island(pressed: xr.Dataset) -> xr.DataArray:
    """Return the median number of cells of the islands of contact, over the dims of the contact area.

    Where no map of the contact is stored, it is the number of cells of square islands with the same ratio of
    perimeter to area, and more where a hardness bounds the corrected area. NaN where nothing touches.
    """
    fraction = pressed["contact_fraction"]
    if "state" in pressed:
        planes = pressed["state"].transpose(*fraction.dims, "y", "x")
        masks = np.asarray(planes.values).reshape(-1, *planes.shape[-2:]) > 0
        wraps = read_grid(planes).periodic if {"y", "x"} <= planes.coords.keys() else (False, False)
        medians = np.array([_median_cells(mask, wraps) for mask in masks])
        return fraction.copy(data=medians.reshape(fraction.shape))
    edges = (fraction - pressed["corrected_contact_fraction"]) / (EXCESS_PER_EDGE * fraction)
    return (4.0 / edges.where(edges > 0)) ** 2


def _median_cells(mask: Array, wraps: Sequence[bool]) -> float:
    """Return the median number of cells of the islands, which go on across periodic edges."""
    from scipy import ndimage  # only for this caveat: other summaries need no scipy
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    labels, count = ndimage.label(mask)
    if not count:
        return float("nan")
    pairs = [(labels.take(0, axis), labels.take(-1, axis)) for axis in (0, 1) if wraps[axis]]
    first, last = np.concatenate([np.zeros((2, 0), int), *map(np.array, pairs)], axis=1)
    meet = (first > 0) & (last > 0)
    links = coo_array((np.ones(meet.sum()), (first[meet] - 1, last[meet] - 1)), shape=(count, count))
    _, island = connected_components(links, directed=False)
    return float(np.median(np.bincount(island, np.bincount(labels.ravel())[1:])))


@_of_contacts
def _resolution(_: xr.DataTree, path: str, pressed: xr.Dataset, least: int = 30) -> Iterator[str]:
    """Yield in how many states the contacts have too few cells, and what the grid does to their areas.

    An island of fewer than `least` cells has the area and the shape of the grid: a disc of 30
    cells is counted a tenth too large, by `EXCESS_PER_EDGE`.
    """
    cells = _cells_per_island(pressed)
    others = [dim for dim in cells.dims if dim != "step"]
    unresolved = cells.where(cells < least)
    few, all_states = (int(each.notnull().sum()) for each in (unresolved, cells))
    if not few:
        return
    low, high = (np.atleast_1d(getattr(unresolved, end)(others).values) for end in ("min", "max"))
    greatest = int(np.flatnonzero(np.isfinite(low))[-1])
    sizes = span((low[greatest], high[greatest]), lambda size: number(size, 2))
    sizes += " cell" if sizes == "1" else " cells"
    sizes = f"median island {sizes}" if "state" in pressed else f"{sizes} an island, from their perimeter"
    where = f"in {few} of {all_states} states" if others else f"at {few} of {all_states} loads"
    where = "at any load" if few == all_states else where
    ratio = pressed["contact_fraction"] / pressed["corrected_contact_fraction"].where(cells < least) - 1.0
    excess = float(ratio.where(np.isfinite(ratio)).max())
    counted = (
        f"counted areas are up to {number(100 * excess, 2)} % above the corrected ones, and "
        if excess > 0
        else ""
    )
    yield (
        f"{path}: contacts are not resolved {where} ({sizes}, {least} needed): {counted}the "
        f"shapes and the dimension of islands are those of the grid."
    )


@_of_contacts
def _true_pressure(tree: xr.DataTree, path: str, pressed: xr.Dataset) -> Iterator[str]:
    """Yield that true pressures are beyond the one at which the material yields."""
    if "plastic_work" in pressed:  # a hardness limits the pressure
        return
    true = pressed["nominal_pressure"] / pressed["contact_fraction"].where(pressed["contact_fraction"] > 0)
    low, high = (number(float(end) / 1e9, 3) for end in (true.min(), true.max()))
    limits = scene_table(tree, "material").get("yield_pressure")
    if limits is not None and float(true.max()) > 1.005 * np.min(limits):  # seen with three digits
        limit = span(limits, lambda pressure: number(pressure / 1e9))
        factor = float(true.max()) / float(np.max(limits))
        times = f", by a factor of up to {number(factor, 3)}" if factor > 1.005 else ""
        yield (
            f"{path}: the true mean pressure is {low} to {high} GPa, and the material yields at {limit} GPa: "
            f"elastic contact areas are too small{times}, and so are closures under a load; a hardness "
            "limits the pressure."
        )


@_of_contacts
def _slopes(_: xr.DataTree, path: str, pressed: xr.Dataset) -> Iterator[str]:
    """Yield that slopes are beyond small strains."""
    if "rms_slope" not in pressed:
        return
    slope = float(pressed["rms_slope"].max())
    if slope > STEEP:
        yield (
            f"{path}: {PRESSED[path]} has an rms slope of up to {number(slope, 2)}; beyond {STEEP:g} strains "
            "are not small, and the closures and areas of linear elasticity are approximations."
        )


def _strength(tree: xr.DataTree) -> Iterator[str]:
    """Yield that the peak strength is beyond the pressure at which the material yields."""
    friction = group_of(tree, "joints/friction")
    limits = scene_table(tree, "material").get("yield_pressure")
    if friction is None or limits is None or "peak_shear_strength" not in friction:
        return
    strengths = finite(friction["peak_shear_strength"])
    if strengths.size and strengths.max() > np.min(limits):
        strength, limit = (quantity_text(value, "Pa") for value in (strengths.max(), np.min(limits)))
        yield (
            f"joints/friction: the peak shear strength is up to {strength}, and the material yields at "
            f"{limit}: asperities break before the faces climb over them, and the joint is weaker."
        )


def scene_table(tree: xr.DataTree, name: str) -> dict[str, Any]:
    """Return a table of the scene of a study, empty where there is none."""
    table = scene_of(tree).get(name)
    return table if isinstance(table, dict) else {}


# the most important first; behind them come those that the entry of a stage names
RULES: tuple[Rule, ...] = (_no_interval, _spikes, _tilt, _resolution, _true_pressure, _strength, _slopes)
