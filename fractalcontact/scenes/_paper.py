"""The claims of Borri-Brunetto, Carpinteri and Chiaia (1998), each tested on a study and able to fail."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import xarray as xr

from fractalcontact.base.tables import Note, Part, Table, table, text_of
from fractalcontact.base.validation import Problems
from fractalcontact.scenes import _paper_findings as findings
from fractalcontact.scenes._caveats import member_count, of_member
from fractalcontact.scenes._paper_study import NO, NOT_TESTED, YES, Finding, with_whole_block


class Claim(NamedTuple):
    """One claim of the paper: its section, the claim, when the verdict is "yes", and the test of a study."""

    section: str
    claim: str
    criterion: str
    test: Callable[[xr.DataTree], Finding | None]


def paper_table(tree: xr.DataTree) -> str:
    """Test every claim of the 1998 paper on a study.

    Parameters
    ----------
    tree : DataTree
        From `fractalcontact.scenes.run` or `fractalcontact.open`; nothing else is read.

    Returns
    -------
    str
        A row for every claim: section of the paper, claim, result of the study, and verdict: "yes", "no",
        "not tested" where the study lacks the results or the shears and loads that the paper compares, or "by
        construction" where the claim follows from the model. Of an ensemble the result is that of member 0,
        and the verdict the number of members that say "yes". Empty where there is no joint.

    Notes
    -----
    `paper_criteria` lists the criterion of every verdict. The claims are tested at the paper's own shears
    (.40, .80 and 8 mm) and nominal pressures (2.5, 25 and 75 MPa), and at the other shears between them.
    `summary` prints this table for a scene with ``paper = true``. The surface and the modulus of the paper
    are not published: an unlike surface may rightly say "no".

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> result = fc.scenes.run("rigid_sliding", progress=False)
    >>> lines = fc.scenes.paper_table(result).splitlines()
    >>> [line[-2:] for line in lines if "about 2 mm" in line]
    ['no']
    """
    with Problems("fractalcontact.scenes.paper_table") as problems:
        problems.tree("tree", tree)
    return text_of(paper_parts(tree))


def paper_parts(tree: xr.DataTree) -> list[Part]:
    """Return the table of the claims of the paper, with a remark; nothing without a joint."""
    if "joints" not in tree.children:
        return []
    members = member_count(tree)
    studies = [of_member(tree, number) for number in range(members)] if members else [tree]
    studies = [with_whole_block(study) for study in studies]
    column = f"member 0 of {members}" if members else "this study"
    rows = [("section", "claim of the paper", column, "verdict")]
    for claim in CLAIMS:
        found = [claim.test(study) or Finding("", NOT_TESTED) for study in studies]
        rows.append((claim.section, claim.claim, found[0].result, _verdict(found)))
    remark = (
        "The paper states orders of magnitude and trends; neither its surface nor its modulus is published. "
        "fractalcontact.scenes.paper_criteria() states when each verdict is yes."
    )
    return [Table(rows), Note(remark)]


def _verdict(findings_of_members: Sequence[Finding]) -> str:
    """Return the verdict of a study; of an ensemble the number of members that say "yes"."""
    verdicts = [finding.verdict for finding in findings_of_members]
    tested = [verdict for verdict in verdicts if verdict in (YES, NO)]
    if len(verdicts) == 1 or not tested:
        return verdicts[0]
    return f"{YES} in {tested.count(YES)} of {len(tested)}"


def paper_criteria() -> str:
    """Return the criterion of every verdict of `paper_table`.

    Returns
    -------
    str
        A table: section of the paper, claim, and when the verdict is "yes".

    References
    ----------
    Borri-Brunetto, Carpinteri and Chiaia (1998), FRAMCOS-3.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> lines = fc.scenes.paper_criteria().splitlines()
    >>> [line[-14:] for line in lines if "about 2 mm" in line]
    ['tolerance 25 %']
    """
    rows = [(claim.section, claim.claim, claim.criterion) for claim in CLAIMS]
    return table([("section", "claim of the paper", 'verdict "yes"'), *rows])


CLAIMS = (
    Claim(
        "1",
        "codes: coefficient of friction 1.0 to 1.4",
        "tan(basic angle + mean dilatancy angle over .8 mm), tolerance .2, at every force",
        findings.coefficient,
    ),
    Claim(
        "1",
        "dilatancy strongly affects the leakage",
        "transmissivity grows tenfold up to .8 mm, at the greatest force",
        findings.leakage,
    ),
    Claim(
        "1",
        "frictional strength grows as the size",
        "exponent 1 under self-weight, tolerance .1, at every shear and direction",
        findings.self_weight,
    ),
    Claim("2", "face: dimension 2.15 to 2.29", "every method, tolerance .05", findings.face_dimension),
    Claim(
        "2",
        "a finer spacing hardly alters the contact",
        "w_int within 10 % of that at the next spacing, at 2.5, 25 and 75 MPa and every shear",
        findings.refinement,
    ),
    Claim(
        "3",
        "delta-surface: dimension above 2",
        "by its area, above 2.005 at the greatest shear",
        findings.delta_above_two,
    ),
    Claim("3", "... that grows with v", "by its area, from each shear to the next", findings.delta_grows),
    Claim(
        "3",
        "elimination converges in a few steps",
        "at most 6 at every load, on a part of the block",
        findings.elimination,
    ),
    Claim(
        "4",
        "closing stage lengthens with v",
        "w_int at 2.5, 25 and 75 MPa, from each shear to the next",
        findings.longer_closing,
    ),
    Claim(
        "4",
        "interface compliance grows with v",
        "secants of w_int(F) from 0 to 2.5, 25 and 75 MPa, from each shear to the next",
        findings.compliance,
    ),
    Claim(
        "4",
        "contact area at equal F falls with v",
        "at 2.5, 25 and 75 MPa, from each shear to the next up to .4 mm",
        findings.area_falls,
    ),
    Claim(
        "4",
        "... and is nearly the same at .4 and .8 mm",
        "within 10 % at 2.5, 25 and 75 MPa",
        findings.area_constant,
    ),
    Claim(
        "4",
        "contact area nearly proportional to F",
        "exponent 1, tolerance .1, where 30 cells or more touch",
        findings.area_proportional,
    ),
    Claim(
        "4",
        "contact area depends on the spacing",
        "10 % less at the finest than at the coarsest, at 2.5, 25 and 75 MPa and every shear",
        findings.resolution,
    ),
    Claim(
        "4",
        "domain: dimension below 2",
        "below 1.95 at every shear and force, and so are the 95 % intervals at the greatest force",
        findings.domain_lacunar,
    ),
    Claim(
        "4",
        "... from 0, single points",
        "at most .2 at the least force of every shear",
        findings.domain_pointwise,
    ),
    Claim(
        "4",
        "... growing with F",
        "default window of each domain, never falls by more than .02 to the next force, at any shear",
        findings.domain_grows,
    ),
    Claim(
        "4",
        "... growing with F, over the whole block",
        "the same, boxes from one cell to the block",
        findings.domain_grows_whole,
    ),
    Claim(
        "4",
        "... to islands, not random points",
        "above its random null at the greatest force of every shear, and differs from it",
        findings.domain_structured,
    ),
    Claim("4", "... to more than 1", "at some force of every shear", findings.domain_above_one),
    Claim(
        "4",
        "domain: dimension at equal F falls with v",
        "at 75 MPa, default window of each domain, from each shear to the next up to .8 mm",
        findings.domain_falls,
    ),
    Claim(
        "4",
        "... counted over the whole block",
        "the same, boxes from one cell to the block",
        findings.domain_falls_whole,
    ),
    Claim(
        "4",
        "... by more than its coverage explains",
        "the random null of equal coverage falls by less than half as much",
        findings.domain_falls_beyond_null,
    ),
    Claim(
        "4",
        "domain at 8 mm differs from the others",
        "dimension at 75 MPa outside the range up to .8 mm by .1 or more",
        findings.far_domain,
    ),
    Claim(
        "4",
        "no correlation left at 8 mm",
        "decorrelation length below 8 mm, and correlation below 1/e at 8 mm",
        findings.decorrelation,
    ),
    Claim(
        "4",
        "delta_r: a marked anisotropy",
        "at the greatest shear the four directions differ by more than 25 % of the greatest delta_r",
        findings.anisotropy,
    ),
    Claim("4", "delta_r about 2 mm at .8 mm (W, N)", "tolerance 25 %", findings.steep_rise),
    Claim(
        "4",
        "... then a plateau (W, N)",
        "within 25 % of the value at .8 mm, to the greatest shear",
        findings.plateau,
    ),
    Claim(
        "4",
        "delta_r keeps rising (E, S)",
        "25 % or more after .8 mm, and still rising in the second half",
        findings.keeps_rising,
    ),
    Claim(
        "4",
        "... because of the mean slope",
        "slope of the second half equals that of the face, tolerance 50 %",
        findings.by_mean_slope,
    ),
    Claim(
        "4",
        "dilatancy is less the greater F",
        "by construction: closure grows with force",
        findings.less_under_force,
    ),
    Claim(
        "4",
        "friction angle = basic + dilatancy angle",
        "by construction: a definition",
        findings.friction_angle,
    ),
)
