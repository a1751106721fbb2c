"""Compare a study of a concrete crack with the paper of 1998: its claims, and its figures 1 to 5.

    fractalcontact run concrete_crack_1998 -o out
    python gallery/paper_1998/paper_1998.py out/result.nc -o figures

The paper is Borri-Brunetto, Carpinteri and Chiaia, "Contact, closure and friction behaviour of rough crack
concrete surfaces", FRAMCOS-3 (1998). It publishes neither its surface nor its elastic modulus: orders of
magnitude and trends can be compared, single numbers cannot. A "no" is a result, not an error.

Each claim is a function of the study, below its section, its words and the condition of a "yes". It returns
what the study gives and whether the condition holds: "yes" or "no"; "depends on the window" where windows of
lengths disagree; "cannot tell" where domains are not resolved, or an interval holds both answers. A study
that lacks a result, a shear or a load that a claim is about does not have it among its labels: that KeyError
of xarray is the answer "not tested".
"""

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib import pyplot as plt
from scipy.special import stdtrit
from tabulate import tabulate

import fractalcontact as fc

# what the paper states
DIMENSION = (2.15, 2.29)  # of the scanned face
PRESSURES = (2.5e6, 25e6, 75e6)  # Pa: 1, 10 and 30 kN on 2 x 2 cm
MIDDLE, PLATEAU, FAR = 4e-4, 8e-4, 8e-3  # m: the shears that it compares
PLATEAU_DILATANCY = 2e-3  # m
COEFFICIENTS = (1.0, 1.4)  # of friction, from Park and Paulay (1975)
FLAT, RISING = ("W", "N"), ("E", "S")  # directions of a plateau, and of a mean slope

SAME_POINT = 0.01  # relative difference of a load or a shear from that of the paper
FEWEST_ISLANDS = 30  # of a domain that has a dimension: with fewer it is that of the realisation
YES, NO, NOT_TESTED, BY_CONSTRUCTION = "yes", "no", "not tested", "by construction"
DEPENDS, CANNOT_TELL = "depends on the window", "cannot tell"


class Claim(NamedTuple):
    """One claim: section of the paper, the claim, when the verdict is "yes", and the test of a study."""

    section: str
    words: str
    condition: str
    test: Callable


CLAIMS: list[Claim] = []


def claim(section, words, condition):
    """Add the decorated function to the claims of the paper."""

    def register(test):
        CLAIMS.append(Claim(section, words, condition, test))
        return test

    return register


def findings(study, claims=CLAIMS):
    """Return a row for each claim: section, claim, what the study gives, verdict, condition of a "yes"."""
    rows = []
    for section, words, condition, test in claims:
        try:
            result, verdict = test(study)
        except KeyError:
            result, verdict = "", NOT_TESTED
        if not isinstance(verdict, str):
            verdict = YES if verdict else NO
        rows.append((section, words, result, verdict, condition))
    return rows


# Reading a study ------------------------------------------------------------------------------------------


def group(study, path):
    """Return a group of the study; KeyError where it has none."""
    return study[path].to_dataset()


def toward_west(data):
    """Return the results of sliding to the west; of the only direction where there is one."""
    return data.sel(direction="W") if "direction" in data.dims else data


def sheared(study, path, shears=2):
    """Return results over (shear, step) at shears above zero; KeyError where there are too few of them."""
    data = toward_west(group(study, path))
    if not {"shear", "step"} <= set(data.dims):
        raise KeyError("shear, step")
    data = data.isel(shear=np.flatnonzero(data["shear"].values > 0))
    if data.sizes["shear"] < shears:
        raise KeyError("shear")
    return data


def nearest(values, wanted):
    """Return the place of a value; KeyError where no value is the wanted one."""
    place = int(np.argmin(np.abs(np.asarray(values) - wanted)))
    if abs(values[place] - wanted) > SAME_POINT * wanted:
        raise KeyError(wanted)
    return place


def pressure_of(data):
    """Return the nominal pressure of every step (Pa)."""
    pressure = data["nominal_pressure"]
    return (pressure.isel(shear=-1) if "shear" in pressure.dims else pressure).values


def at_pressures(data, name, pressures=PRESSURES):
    """Return a variable over (shear, step) at the pressures of the paper, as an array."""
    steps = [nearest(pressure_of(data), pressure) for pressure in pressures]
    return data[name].isel(step=steps).transpose("shear", "step", ...).values


def full(data, name):
    """Return a variable over all of (shear, step), also where it is the same for every shear."""
    return data[name].broadcast_like(data["contact_fraction"]).transpose("shear", "step")


def up_to(data, shear):
    """Return the results at shears up to this one."""
    return data.isel(shear=np.flatnonzero(data["shear"].values <= shear * (1 + SAME_POINT)))


def block_cells(data):
    """Return the number of cells of the block that was pressed."""
    return int(np.prod(json.loads(data.attrs["provenance"])["parameters"]["crack"]["block_cells"]))


def listed(values, form=".2f"):
    """Return values in one form."""
    return ", ".join(f"{value:{form}}" for value in np.ravel(values))


def span(values):
    """Return the least and the greatest value, once where both read the same; nothing of no value."""
    if not np.isfinite(values).any():
        return "-"
    return " ... ".join(dict.fromkeys(f"{end:.2f}" for end in (np.nanmin(values), np.nanmax(values))))


def mm(length):
    """Return a length in millimetres."""
    return f"{1e3 * length:.3g} mm"


def trend(text, values, sign, columns="pressures", against=0.1):
    """Return whether columns of values grow (+1) or fall (-1): their ends do, and nine of ten steps.

    Steps from or to NaN do not count; where they leave less than half of the columns, nothing can be told.
    """
    if len(values) < 2:
        raise KeyError("a second value")
    steps = sign * np.diff(values, axis=0)
    known = np.isfinite(steps)
    columns_known = known.any(axis=0)
    if 2 * columns_known.sum() < columns_known.size:
        return f"{text}; steps at {columns_known.sum()} of {columns_known.size} {columns}", CANNOT_TELL
    word, rises = "grows" if sign > 0 else "falls", (steps[known] > 0).sum()
    over = f" over {columns_known.sum()} {columns}" if columns_known.size > 1 else ""
    ends = np.nansum(steps, axis=0)[columns_known] > 0
    holds = known.sum() - rises <= against * known.sum() and ends.all()
    return f"{text}; {word} in {rises} of {known.sum()} steps{over}", bool(holds)


# Section 1: codes, leakage, size effect -------------------------------------------------------------------


@claim(
    "1", "codes: coefficient of friction 1.0 to 1.4",
    "tan(basic angle + mean dilatancy angle over .8 mm), tolerance .2, at every force",
)  # fmt: skip
def coefficient(study, tolerance=0.2):
    elastic = toward_west(group(study, "joints/elastic_dilatancy"))
    shear = elastic["shear"].values
    opening = elastic["dilatancy"].transpose("shear", "step").values
    rise = opening[nearest(shear, PLATEAU)] - opening[nearest(shear, 0.0)]
    angle = float(elastic["basic_friction_angle"]) + np.degrees(np.arctan2(rise, PLATEAU))
    locked = int((angle >= 90.0).sum())
    if locked:
        return f"none: the faces lock at {locked} of {angle.size} forces", False
    values = np.tan(np.radians(angle))
    low, high = COEFFICIENTS[0] - tolerance, COEFFICIENTS[1] + tolerance
    return f"{listed(values)}, tolerance {tolerance:g}", ((values >= low) & (values <= high)).all()


@claim(
    "1", "dilatancy strongly affects the leakage",
    "transmissivity grows tenfold up to .8 mm, at the greatest force",
)  # fmt: skip
def leakage(study, factor=10.0):
    flow = sheared(study, "joints/transmissivity")
    along = flow["transmissivity"].isel(step=-1).transpose("shear", "axis").values.min(axis=1)
    first, last = along[0], along[nearest(flow["shear"].values, PLATEAU)]
    return f"{first:.2g} to {last:.2g} m3 from {mm(flow['shear'][0])} to .8 mm", last >= factor * first > 0


@claim(
    "1", "frictional strength grows as the size",
    "exponent 1 under self-weight, tolerance .1, at every shear and direction",
)  # fmt: skip
def self_weight(study, tolerance=0.1):
    strength = group(study, "joints/self_weight")
    if strength.sizes["structure_size"] < 2:
        raise KeyError("a second size")
    exponents = np.ravel(strength["strength_exponent"].values)
    locked = int(np.isnan(exponents).sum())
    text = f"the faces lock in {locked} of {exponents.size} directions and shears" if locked else ""
    if locked < exponents.size:
        grows = f"tau ~ L^{np.nanmin(exponents):.2f} to L^{np.nanmax(exponents):.2f}"
        text = f"{grows}; {text}" if locked else grows
    return text, (np.abs(exponents - 1.0) <= tolerance).all()  # NaN is not near


# Section 2: the scanned face ------------------------------------------------------------------------------


@claim("2", "face: dimension 2.15 to 2.29", "every method, tolerance .05")
def face_dimension(study, tolerance=0.05):
    dimension = np.ravel(group(study, "dimensions")["fractal_dimension"].values)
    inside = (dimension >= DIMENSION[0] - tolerance) & (dimension <= DIMENSION[1] + tolerance)
    methods = f"{dimension.size} methods" if dimension.size > 1 else "one method"
    return f"{span(dimension)} by {methods}, tolerance {tolerance:g}", inside.all()


@claim(
    "2", "a finer spacing hardly alters the contact",
    "w_int within 10 % of that at the next spacing, at 2.5, 25 and 75 MPa and every shear",
)  # fmt: skip
def refinement(study, tolerance=0.1):
    areas = sheared(study, "joints/area_by_resolution", shears=1)
    closure, spacing = at_pressures(areas, "interface_closure"), areas["resolution"].values
    with np.errstate(divide="ignore", invalid="ignore"):
        change = closure[..., 0] / closure[..., 1] - 1.0
    text = f"w_int {100 * np.nanmin(change):+.0f} ... {100 * np.nanmax(change):+.0f} %"
    return f"{text} from {mm(spacing[1])} to {mm(spacing[0])}", (np.abs(change) <= tolerance).all()


# Section 3: the delta-surface and the method --------------------------------------------------------------


def delta_dimension(study):
    """Return the shears above zero and the dimension of the delta-surface by its area."""
    delta = group(study, "joints/delta_dimension")
    delta = delta.isel(shear=np.flatnonzero(delta["shear"].values > 0))
    if not delta.sizes["shear"]:
        raise KeyError("shear")
    return delta["shear"].values, delta["covering_dimension"].values


@claim("3", "delta-surface: dimension above 2", "by its area, above 2.005 at the greatest shear")
def delta_above_two(study, rounding=0.005):
    shear, dimension = delta_dimension(study)
    return f"{dimension[-1]:.3f} at {mm(shear[-1])}", dimension[-1] > 2.0 + rounding


@claim("3", "... that grows with v", "by its area, from each shear to the next")
def delta_grows(study):
    _, dimension = delta_dimension(study)
    if dimension.size < 2:
        raise KeyError("a second shear")
    return listed(dimension, ".3f"), (np.diff(dimension) > 0).all()


@claim(
    "3", "elimination converges in a few steps", "at most 6 at every load, on a part of the block"
)  # fmt: skip
def elimination(study, few=6):
    result = group(study, "joints/elimination")
    rounds, converged = result["iterations"].values, bool(result["converged"].all())
    text = f"{rounds.min()} to {rounds.max()} on {block_cells(result)} points"
    return text if converged else f"{text}; not converged", converged and (rounds <= few).all()


# Section 4: closure and real contact area -----------------------------------------------------------------


@claim("4", "closing stage lengthens with v", "w_int at 2.5, 25 and 75 MPa, from each shear to the next")
def longer_closing(study):
    lengths = at_pressures(sheared(study, "joints/closure"), "interface_closure")
    return trend(f"{listed(1e6 * lengths[:, -1], '.4g')} µm at 75 MPa", lengths, +1)


@claim(
    "4", "interface compliance grows with v",
    "secants of w_int(F) from 0 to 2.5, 25 and 75 MPa, from each shear to the next",
)  # fmt: skip
def compliance(study):
    closure = sheared(study, "joints/closure")
    closure = closure.assign(force=full(closure, "normal_force"))
    closed, force = (at_pressures(closure, name) for name in ("interface_closure", "force"))
    # secants, exact at any spacing of the loads; from no force, which has no closure
    softness = 1e9 * np.diff(closed, axis=1, prepend=0.0) / np.diff(force, axis=1, prepend=0.0)  # µm/kN
    ends = ", ".join(f"{a:.3g} to {b:.3g}" for a, b in zip(softness[0], softness[-1], strict=True))
    return trend(f"{ends} µm/kN", softness, +1)


@claim(
    "4", "contact area at equal F falls with v",
    "at 2.5, 25 and 75 MPa, from each shear to the next up to .4 mm",
)  # fmt: skip
def area_falls(study):
    area = 100 * at_pressures(up_to(sheared(study, "joints/closure"), MIDDLE), "contact_fraction")
    return trend(f"{listed(area[:, -1])} % at 75 MPa", area, -1)


@claim("4", "... and is nearly the same at .4 and .8 mm", "within 10 % at 2.5, 25 and 75 MPa")
def area_constant(study, tolerance=0.1):
    closure = sheared(study, "joints/closure")
    area = 100 * at_pressures(closure, "contact_fraction")
    before, after = (area[nearest(closure["shear"].values, shear)] for shear in (MIDDLE, PLATEAU))
    change = after / before - 1.0
    text = f"{before[-1]:.2f} and {after[-1]:.2f} % at 75 MPa; {listed(100 * change, '+.0f')} %"
    return text, (np.abs(change) <= tolerance).all()


@claim(
    "4", "contact area nearly proportional to F", "exponent 1, tolerance .1, where 30 cells or more touch"
)  # fmt: skip
def area_proportional(study, tolerance=0.1, fewest=30):
    closure = sheared(study, "joints/closure")
    area, force = (full(closure, name).values for name in ("contact_fraction", "normal_force"))
    resolved = (force > 0) & (area * block_cells(closure) >= fewest)
    exponents = np.array(
        [
            np.polyfit(np.log(force[i, rows]), np.log(area[i, rows]), 1)[0]
            for i, rows in enumerate(resolved)
            if rows.sum() > 2
        ]
    )
    if not exponents.size:
        raise KeyError("three resolved loads")
    text = f"A ~ F^{exponents.min():.2f} to F^{exponents.max():.2f}"
    return text, (np.abs(exponents - 1.0) <= tolerance).all()


@claim(
    "4", "contact area depends on the spacing",
    "10 % less at the finest than at the coarsest, at 2.5, 25 and 75 MPa and every shear",
)  # fmt: skip
def resolution(study, share=0.1):
    areas = sheared(study, "joints/area_by_resolution", shears=1)
    area = at_pressures(areas, "contact_fraction")
    falls = area[..., 0] <= (1 - share) * area[..., -1]
    spacing = listed(1e3 * areas["resolution"].values, ".3g")
    text = f"{listed(100 * area[0, -1])} % at {spacing} mm and 75 MPa"
    return f"{text}: {int(falls.sum())} of {falls.size} areas", falls.all()


# Section 4: contact domains -------------------------------------------------------------------------------

# P(s), the share of positions at which a square of side s meets a domain, has a dimension over every window
# of lengths, and its trend may depend on the window even in its sign. So a trend is judged over all windows
# that begin below the gap of every domain: beyond it squares meet any set, and the dimension is 2.


def domains(study):
    """Return the signature of the domains, over (shear, step, ...)."""
    return sheared(study, "domains/signature").transpose("shear", "step", ...)


def dimension(data, window, curve="hit_fraction"):
    """Return 2 less the slope of ln P over ln s in a window (m), over (shear, step); NaN if empty."""
    side = data["side"].values
    inside = (side >= window[0] * (1 - SAME_POINT)) & (side <= window[1] * (1 + SAME_POINT))
    x = np.log(side[inside])
    with np.errstate(divide="ignore", invalid="ignore"):
        slope = np.log(data[curve].values[..., inside]) @ (x - x.mean()) / np.sum((x - x.mean()) ** 2)
    return 2.0 - slope


def whole_block(data):
    """Return the window from one cell to half the block, the longest that P has."""
    return data["side"].values[[0, -1]]


def windows(data, ratio=8.0):
    """Return the windows of this ratio that begin by octaves from one cell to the smallest gap."""
    first, last = whole_block(data)
    end = min(np.nanmin(data["gap_size"].values, initial=np.inf), last / ratio)
    starts = [first * 2.0**k for k in range(32) if first * 2.0**k <= end]
    return [(start, ratio * start) for start in starts] or [(first, last)]


def over_windows(data, judge):
    """Judge a trend over every window: "yes" or "no" where all agree. `judge` returns words and a verdict."""
    found = [(window, *judge(window)) for window in windows(data)]
    words = "; ".join(f"{text} over {mm(low)} to {mm(high)}" for (low, high), text, _ in found)
    verdicts = {verdict for *_, verdict in found}
    return words, verdicts.pop() if len(verdicts) == 1 else DEPENDS


def with_enough_islands(data, values):
    """Return values, NaN where a domain has too few islands to have a dimension."""
    return np.where(data["n_islands"].values >= FEWEST_ISLANDS, values, np.nan)


def growth(values):
    """Return whether values over (shear, step) grow with the force."""
    return trend(f"{span(values[:, 0])} to {span(values[:, -1])}", values.T, +1, "shears")


@claim(
    "4", "domain: dimension below 2",
    "below 1.95 from one cell to half the block at every shear and force, as are the intervals of the window",
)  # fmt: skip
def domain_lacunar(study, gap=0.05):
    data = domains(study)
    largest, end = np.nanmax(dimension(data, whole_block(data))), data["domain_dimension_high"].max().item()
    text = f"at most {largest:.2f} from one cell to {mm(whole_block(data)[1])}"
    if np.isfinite(end):
        text = f"{text}; the intervals of the window reach {end:.2f}"
    if largest < 2.0 - gap <= end:
        return text, CANNOT_TELL
    return text, largest < 2.0 - gap


@claim(
    "4", "... from 0, single points",
    "nearer to points than to lines at the least force of every shear, from four spots to the gap",
)  # fmt: skip
def domain_pointwise(study, few=0.5, ratio=4.0):
    data = domains(study).isel(step=[0])
    last = whole_block(data)[1]
    low = 4.0 * data["spot_size"].max().item()  # from one spot on, a single disc has D = .7; from four .2
    high = min(np.nanmin(data["gap_size"].values, initial=last), last)
    if not ratio * low <= high * (1 + SAME_POINT):
        return f"four spots reach {mm(low)}, the gap is {mm(high)}", CANNOT_TELL
    values = dimension(data, (low, high))
    # finite elastic energy makes the dimension of the limit 1 or more: this is about the window alone
    text = f"{span(values)} over {mm(low)} to {mm(high)} at {pressure_of(data)[0] / 1e6:.3g} MPa"
    return text, (values <= few).all()


@claim(
    "4", "... growing with F",
    "in every window of ratio 8, from each force to the next, where 30 islands or more touch",
)  # fmt: skip
def domain_grows(study):
    data = domains(study)
    return over_windows(data, lambda window: growth(with_enough_islands(data, dimension(data, window))))


@claim("4", "... growing with F, over the whole block", "the same, from one cell to half the block")
def domain_grows_whole(study):
    data = domains(study)
    text, verdict = growth(dimension(data, whole_block(data)))
    spots = growth(dimension(data, whole_block(data), "spots_fraction"))[0]
    return f"{text}; random spots {spots}", verdict


@claim(
    "4", "... to islands, not random points",
    "clustering above 1 by its interval, at the greatest force of every shear, at a scale below the gap",
)  # fmt: skip
def domain_structured(study, marked=1.1):
    data = domains(study).isel(step=-1)
    values = [below_gap(state) for _, state in data.groupby("shear")]
    known = np.array([value for value in values if np.isfinite(value).all()])
    if len(known) < len(values):
        missing = len(values) - len(known)
        return f"{missing} of {len(values)} domains have no resolved spots, or no gap", CANNOT_TELL
    text = f"clustering {listed(known[:, 0])} ({span(known[:, 1:])})"
    if (known[:, 1] > 1).all():
        return text, True
    return text, False if (known[:, 2] < marked).any() else CANNOT_TELL


def below_gap(state):
    """Return the clustering of a state, with its interval, at its longest scale below the gap."""
    state = state.squeeze("shear")
    below = np.flatnonzero(state["scale"].values <= state["gap_size"].fillna(np.inf).item())
    names = ("clustering", "clustering_low", "clustering_high")
    return [state[name].values[below[-1]] if below.size else np.nan for name in names]


@claim(
    "4", "... to more than 1",
    "from one cell to half the block, at some force of every shear; spots of a few cells are no evidence",
)  # fmt: skip
def domain_above_one(study, resolved=10):
    data = domains(study)
    above = np.nanmax(dimension(data, whole_block(data)), axis=1) > 1
    text = f"at {int(above.sum())} of {above.size} shears"
    cells = data["median_cells"].isel(step=-1).values[~above]
    if (cells < resolved).any():
        return f"{text}; elsewhere the median island has {np.nanmin(cells):g} cells", CANNOT_TELL
    return text, above.all()


def falls_with_shear(data, window, curve="hit_fraction"):
    """Return dimensions at the greatest pressure of the paper, over the shears up to .80 mm."""
    near = up_to(data, PLATEAU)
    return dimension(near, window, curve)[:, nearest(pressure_of(near), PRESSURES[-1])]


@claim(
    "4", "domain: dimension at equal F falls with v",
    "at 75 MPa, in every window of ratio 8, from each shear to the next up to .8 mm",
)  # fmt: skip
def domain_falls(study):
    data = domains(study)

    def judge(window):
        values = falls_with_shear(data, window)
        return trend(listed(values), values[:, None], -1)

    return over_windows(data, judge)


@claim("4", "... counted over the whole block", "the same, from one cell to half the block")
def domain_falls_whole(study):
    data = domains(study)
    values = falls_with_shear(data, whole_block(data))
    return trend(listed(values), values[:, None], -1)


@claim(
    "4", "... by more than its coverage and spots explain",
    "random spots of equal area, widths and number fall by less than half as much",
)  # fmt: skip
def domain_falls_beyond_null(study):
    data = domains(study)
    pair = [falls_with_shear(data, whole_block(data), curve) for curve in ("hit_fraction", "spots_fraction")]
    if pair[0].size < 2:
        raise KeyError("a second shear")
    fall, null = (values[0] - values[-1] for values in pair)
    return f"falls by {fall:.2f}, random spots by {null:.2f}", fall > 0 and null < fall / 2


@claim(
    "4", "domain at 8 mm differs from the others",
    "at 75 MPa its integral range or clustering lies outside the range up to .8 mm, by its interval",
)  # fmt: skip
def far_domain(study):
    data = domains(study).isel(scale=-1)
    data = data.isel(step=nearest(pressure_of(data), PRESSURES[-1]))
    last = data.isel(shear=nearest(data["shear"].values, FAR))
    texts, verdicts = [], []
    for name, unit in (("integral_range", 1e6), ("clustering", 1.0)):
        near = unit * up_to(data, PLATEAU)[name].values
        value, low, high = (unit * last[f"{name}{end}"].item() for end in ("", "_low", "_high"))
        if not np.isfinite([*near, value]).all():
            continue
        texts.append(f"{name.replace('_', ' ')} {value:.2g} ({low:.2g} to {high:.2g}) beside {span(near)}")
        if near.min() <= value <= near.max():
            verdicts.append(False)
        else:
            verdicts.append(True if low > near.max() or high < near.min() else CANNOT_TELL)
    if not verdicts:
        return "no scale is common to the domains", CANNOT_TELL
    return "; ".join(texts), next((each for each in (True, CANNOT_TELL) if each in verdicts), False)


@claim(
    "4", "no correlation left at 8 mm", "decorrelation length below 8 mm, and correlation below 1/e at 8 mm"
)  # fmt: skip
def decorrelation(study):
    result = toward_west(group(study, "joints/decorrelation_length"))
    length = float(np.ravel(result["decorrelation_length"].values)[0])
    shear, correlation = (np.ravel(result[name].values) for name in ("shear", "correlation"))
    if shear[-1] < FAR * (1 - SAME_POINT):
        raise KeyError(FAR)
    if not np.isfinite(length):
        return "none", False
    left = np.interp(FAR, shear, correlation / correlation[0])
    return f"length {mm(length)}; correlation {left:.2f} at {mm(FAR)}", length < FAR and left < np.exp(-1.0)


# Section 4: dilatancy and strength ------------------------------------------------------------------------


def rigid(study, directions, shear=PLATEAU):
    """Return the rigid dilatancy of some directions (direction, shear), which has to reach a shear."""
    data = group(study, "joints/rigid_dilatancy").sel(direction=list(directions))
    if data["shear"].values[-1] < shear * (1 - SAME_POINT):
        raise KeyError(shear)
    return data, data["shear"].values, data["rigid_dilatancy"].transpose("direction", "shear").values


def named(data, values, form=".2f"):
    """Return values by direction."""
    return ", ".join(
        f"{name} {value:{form}}" for name, value in zip(data["direction"].values, values, strict=True)
    )


@claim(
    "4", "delta_r: a marked anisotropy",
    "at the greatest shear the four directions differ by more than 25 % of the greatest delta_r",
)  # fmt: skip
def anisotropy(study, share=0.25):
    data, shear, dilatancy = rigid(study, FLAT + RISING, FAR)
    last = dilatancy[:, -1]
    return f"{named(data, 1e3 * last)} mm at {mm(shear[-1])}", np.ptp(last) > share * dilatancy.max()


@claim("4", "delta_r about 2 mm at .8 mm (W, N)", "tolerance 25 %")
def steep_rise(study, tolerance=0.25):
    data, shear, dilatancy = rigid(study, FLAT)
    reached = dilatancy[:, nearest(shear, PLATEAU)]
    near = np.abs(reached / PLATEAU_DILATANCY - 1.0) <= tolerance
    return f"{named(data, 1e3 * reached)} mm", near.all()


@claim("4", "... then a plateau (W, N)", "within 25 % of the value at .8 mm, to the greatest shear")
def plateau(study, tolerance=0.25):
    data, shear, dilatancy = rigid(study, FLAT, FAR)
    first = nearest(shear, PLATEAU)
    reached, later = dilatancy[:, first], dilatancy[:, first:]
    if not (reached > 0).all():
        return f"{named(data, 1e3 * reached)} mm at .8 mm", False
    low, high = later.min(axis=1) / reached - 1, later.max(axis=1) / reached - 1
    ranges = zip(FLAT, 100 * low, 100 * high, strict=True)
    values = ", ".join(f"{name} {least:+.0f} to {most:+.0f} %" for name, least, most in ranges)
    return f"{values} after .8 mm", ((low >= -tolerance) & (high <= tolerance)).all()


def asymptote(shear, dilatancy, pieces=4):
    """Return the slopes of straight lines through the second half of the path, with 95 % intervals.

    The interval is that of the mean of the slopes of four pieces (Student's t).
    """
    half = np.flatnonzero(shear >= shear[-1] / 2)
    slope = np.polyfit(shear[half], dilatancy[:, half].T, 1)[0]
    parts = [np.polyfit(shear[part], dilatancy[:, part].T, 1)[0] for part in np.array_split(half, pieces)]
    return slope, stdtrit(pieces - 1, 0.975) * np.std(parts, axis=0, ddof=1) / np.sqrt(pieces)


@claim("4", "delta_r keeps rising (E, S)", "25 % or more after .8 mm, and still rising in the second half")
def keeps_rising(study, more=0.25):
    data, shear, dilatancy = rigid(study, RISING, FAR)
    first, last = dilatancy[:, nearest(shear, PLATEAU)], dilatancy[:, -1]
    rises = (last >= (1 + more) * first) & (last > first) & (asymptote(shear, dilatancy)[0] > 0)
    return f"{named(data, 1e3 * first)}; {named(data, 1e3 * last)} mm at {mm(shear[-1])}", rises.all()


@claim(
    "4", "... because of the mean slope",
    "slope of the second half equals that of the face, tolerance 50 %, by its interval",
)  # fmt: skip
def by_mean_slope(study, tolerance=0.5):
    data, shear, dilatancy = rigid(study, RISING, FAR)
    (slope, width), mean = asymptote(shear, dilatancy), data["mean_slope"].values
    text = f"{named(data, slope, '+.3f')}; mean {named(data, mean, '+.3f')}"
    near = (mean > 0) & (np.abs(slope - mean) <= tolerance * mean)
    inside = np.abs(np.abs(slope - mean) - tolerance * np.abs(mean)) < width
    return f"{text}, each within {width.max():.3f}", CANNOT_TELL if inside.any() else near.all()


@claim("4", "dilatancy is less the greater F", "by construction: closure grows with force")
def less_under_force(study):
    opening = toward_west(group(study, "joints/elastic_dilatancy")).isel(shear=-1)
    return f"{listed(1e6 * opening['dilatancy'].values, '.4g')} µm at {mm(opening['shear'])}", BY_CONSTRUCTION


@claim("4", "friction angle = basic + dilatancy angle", "by construction: a definition")
def friction_angle(study):
    basic = float(group(study, "joints/friction")["basic_friction_angle"])
    return f"basic angle {basic:g} degree", BY_CONSTRUCTION


# Figures --------------------------------------------------------------------------------------------------

HEIGHTS_TIMES = 2.0  # of the section in figure 2
ARROWS = {"E": (1, 0), "N": (0, 1), "W": (-1, 0), "S": (0, -1)}


def figure_1(study):
    """Crack surface with the block, and the delta-surface of the largest shear."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(8.0, 3.2), layout="constrained")
    delta = last_delta(study)
    fc.plotting.surface(
        group(study, "surfaces"), block=delta["height"], title="crack surface and block", ax=left
    )
    title = f"delta-surface, v = {mm(delta['shear'])} {delta['direction'].item()}"
    fc.plotting.surface(delta["height"], title=title, ax=right)
    return figure


def figure_2(study):
    """Scheme of the simulation: the block from above, and a section along the sliding direction."""
    figure, (plan, section) = plt.subplots(
        1, 2, figsize=(8.0, 3.0), layout="constrained", width_ratios=(1, 1.9)
    )
    surface, delta = group(study, "surfaces"), last_delta(study)
    shear, direction = 1e3 * float(delta["shear"]), str(delta["direction"].item())
    along_x, along_y = ARROWS[direction]
    fc.plotting.surface(
        surface, block=delta["height"], title="plan view", units={"x": "mm", "y": "mm"}, ax=plan
    )
    x, y = (1e3 * delta[dim].values for dim in ("x", "y"))
    corner = (x[0] + along_x * shear, y[0] + along_y * shear)
    plan.add_patch(plt.Rectangle(corner, np.ptp(x), np.ptp(y), fill=False, edgecolor="white", linewidth=1.6))
    for name, (east, north) in ARROWS.items():
        reach = 0.34 * min(np.ptp(x), np.ptp(y))
        tip = (x.mean() + reach * east, y.mean() + reach * north)
        weight = "bold" if name == direction else "normal"
        plan.annotate(
            name, (x.mean(), y.mean()), tip, color="white", weight=weight,
            ha="center", va="center", arrowprops={"arrowstyle": "<|-", "color": "white"},
        )  # fmt: skip
    axis, across = ("x", "y") if along_x else ("y", "x")
    line = {across: float(delta[across][delta.sizes[across] // 2])}
    sign, lift = along_x + along_y, 1e3 * float(delta["height"].max())
    lower = surface["height"].sel(line, method="nearest")
    upper = lower.sel({axis: delta[axis]}, method="nearest")
    ground = 1e3 * sign * lower[axis].values, 1e3 * lower.values
    block = 1e3 * sign * upper[axis].values + shear, 1e3 * upper.values + lift
    section.fill_between(*ground, ground[1].min() - 1.0, color="#BDB8AB", lw=0)
    section.fill_between(*block, block[1].max() + 1.0, color="#8C9DAE", lw=0)
    section.plot(*ground, color="black", lw=0.9, label="lower face")
    section.plot(*block, color="black", lw=0.9, label="upper face")
    section.set(
        aspect=HEIGHTS_TIMES, xlabel="position along the sliding direction (mm)", ylabel="height (mm)",
        title=f"section, v = {shear:g} mm {direction}, lift {lift:.2f} mm, heights × {HEIGHTS_TIMES:g}",
    )  # fmt: skip
    return figure


def last_delta(study):
    """Return the delta-surface of the largest shear."""
    return group(study, "joints/delta_surface").isel(shear=-1)


def figure_3(study):
    """Closure laws and real contact area, over the shears."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(9.4, 3.3), layout="constrained")
    closure = group(study, "joints/closure")
    fc.plotting.plot(closure, shear=MIDDLE, ax=left)
    fc.plotting.plot(closure, "contact_area", ax=right)
    left.set_title("closure laws")
    right.set_title("real contact area")
    return figure


def figure_4(study):
    """Contact domains for increasing force at one shear."""
    return fc.plotting.plot(group(study, "joints/closure"), "contact_domains", shear=MIDDLE)[0].figure


def figure_5(study):
    """Rigid and elastic dilatancy, above the contact domains for increasing shear."""
    elastic, closure = group(study, "joints/elastic_dilatancy"), group(study, "joints/closure")
    sheet = plt.figure(figsize=(9.4, 7.6), layout="constrained")
    top, below = sheet.subfigures(2, 1, height_ratios=(3.1, 4.5))
    left, right = top.subplots(1, 2)
    fc.plotting.dilatancy(group(study, "joints/rigid_dilatancy"), ax=left)
    fc.plotting.dilatancy(elastic, reach=PLATEAU, ax=right)
    left.set_title("rigid surfaces")
    right.set_title("elastic bodies")
    force = float(closure["normal_force"].max())
    fc.plotting.plot(closure, "contact_domains", normal_force=force, axes=below)
    return sheet


FIGURES = {
    "figure_1_surface": figure_1,
    "figure_2_scheme": figure_2,
    "figure_3_closure": figure_3,
    "figure_4_domains": figure_4,
    "figure_5_dilatancy": figure_5,
}


# The program ----------------------------------------------------------------------------------------------


def table(study):
    """Return the claims with what the study gives, as text."""
    rows = [row[:-1] for row in findings(study)]
    heads = ("section", "claim of the paper", "this study", "verdict")
    return tabulate(rows, headers=heads, disable_numparse=True, maxcolwidths=[None, 40, 46, 15])


def main(arguments=None):
    """Print the table of the claims and draw the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("result", type=Path, help="the result.nc of the scene concrete_crack_1998")
    parser.add_argument("-o", "--out", type=Path, help="folder for the figures; without it none are drawn")
    parser.add_argument("--conditions", action="store_true", help='also print when each verdict is "yes"')
    options = parser.parse_args(arguments)
    study = fc.open(options.result)
    print(table(study))
    if options.conditions:
        rows = [(each.section, each.words, each.condition) for each in CLAIMS]
        print(
            "\n" + tabulate(rows, headers=("section", "claim", 'verdict "yes"'), maxcolwidths=[None, 40, 60])
        )
    if options.out is not None:
        options.out.mkdir(parents=True, exist_ok=True)
        with plt.style.context("fractalcontact.plotting.report"):
            for name, draw in FIGURES.items():
                draw(study).savefig(options.out / f"{name}.png", dpi=150)
                plt.close("all")
        print(f"\nwritten to {options.out}: {', '.join(FIGURES)}")


if __name__ == "__main__":
    main()
