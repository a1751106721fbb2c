"""The stages of a study as one static table: what each needs, its public function, the maps it reads.

The rows stand in an order in which they can run. `_plan` selects the rows that the wanted results of a scene
need, `_parts` carries them out.
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from fractalcontact.scenes import _rows
from fractalcontact.scenes._result_tables import Rows

CONTACT_MAPS, ISLAND_MAP = ("state", "pressure", "gap"), "label"
SLIP_MAPS = ("slip_state", "traction_x", "traction_y", "slip_x", "slip_y")
PRESS, PARTIAL_SLIP = "press", "partial_slip"
FIGURES = "figures"
PART_SIZE = 1 << 23  # nodes times steps of one part: seconds of work, and maps of at most 64 MB each

# stages of a joint with one path of load, and with one direction
ONE_LOAD = ("closure", "elimination", "area_dimension", PARTIAL_SLIP)
ONE_DIRECTION = (*ONE_LOAD, "delta_surface", "delta_dimension", "decorrelation_length")
FROM_RESULTS = ("friction", "closure_laws")  # stages of a joint that take a result alone

# arguments that a scene states elsewhere: surfaces, maps, what to keep, the material, progress bars
_FROM_SCENE = frozenset(
    (
        "surface",
        "crack",
        "pressed",
        "mask",
        "valid",
        "gap",
        "dilatancy",
        "keep",
        "progress",
        "basic_friction_angle",
    )
)


@dataclass(frozen=True)
class StageType:
    """One row of the table of stages.

    Attributes
    ----------
    name : str
        Group of its result, "joints/closure" for example.
    needs : tuple of str
        Stages whose results it takes, where the study has them; of "a or b" the first that the study has.
    function : str
        The public function that computes it, for example "joints.closure".
    table : str
        Table of the scene with the arguments of the function.
    reads : str
        The map that it reads from the stage it needs.
    keeps : tuple of str
        The maps that it can store.
    splits : tuple of str
        Arguments whose values are computed apart, each by a call of its own (a part of the stage) that may
        run anywhere; "step" is the path of the load, cut into sections.
    rows : Rows, optional
        The table of its result in the summary and the report.
    takes_surface : bool
        It describes the lower face, not the crack.
    whole_path : bool
        It follows the contact set along the load path, or measures all states over one window of lengths, and
        reads the maps of all steps at once. A scene can ask that of other stages too, see `Stage.whole_path`.
    """

    name: str
    needs: tuple[str, ...]
    function: str
    table: str = ""
    reads: str = ""
    keeps: tuple[str, ...] = ()
    splits: tuple[str, ...] = ()
    rows: Rows | None = None
    takes_surface: bool = False
    whole_path: bool = False

    @property
    def subpackage(self) -> str:
        """The subpackage that holds the function."""
        return self.name.partition("/")[0]

    @property
    def word(self) -> str:
        """The name without its group."""
        return self.name.partition("/")[2]

    def arguments(self) -> tuple[str, ...]:
        """Return the arguments of the function that a scene may give."""
        if self.name == "joints/rigid_dilatancy":
            return ("shear", "direction")
        if self.name == "joints/closure_laws":  # its closure is the result of another stage, not a load
            return ("seating_pressure",)
        allowed = arguments_of(self.function)[0]
        if self.name == "joints/elimination":  # of a part of the block, and elastic
            return ("block", *(key for key in allowed if key not in ("method", "hardness")))
        return allowed

    def required(self) -> tuple[str, ...]:
        """Return the arguments that a scene must give."""
        own = ("block",) if self.name == "joints/elimination" else ()
        return (*own, *(key for key in self.arguments() if key in arguments_of(self.function)[1]))


_SURFACE = ("surfaces",)
_FACES = ("surfaces", "joints/faces")


def _curve(method: str) -> StageType:
    return StageType(f"dimensions/{method}", _SURFACE, f"dimensions.{method}")


def _joint(
    name: str, rows: Rows | None, needs: tuple[str, ...] = _FACES, function: str = "", **more: Any
) -> StageType:
    return StageType(
        f"joints/{name}", needs, f"joints.{function or name}", f"joint.{name}", rows=rows, **more
    )


def _domain(name: str, rows: Rows | None = None, **more: Any) -> StageType:
    source = ("contact or joints/closure",)
    table = f"domains.{name}"
    return StageType(f"domains/{name}", source, table, table, reads="state", rows=rows, **more)


_ROWS = (
    StageType("surfaces", (), "surfaces.read", "surface", rows=_rows.surfaces),  # with its description
    StageType("surfaces/description", _SURFACE, "surfaces.describe"),
    StageType("surfaces/texture", _SURFACE, "surfaces.texture", rows=_rows.texture),
    StageType("dimensions", _SURFACE, "dimensions.estimate", "dimensions", rows=_rows.dimensions),
    _curve("spectrum"),
    _curve("variogram"),
    _curve("cube_counts"),
    _curve("roughness_length"),
    _curve("variation"),
    _curve("higuchi"),
    _curve("detrended_fluctuation"),
    _curve("divider"),
    _curve("covering"),
    StageType(
        "contact",
        _SURFACE,
        "contact.press",
        "contact",
        keeps=CONTACT_MAPS,
        splits=("step",),
        rows=_rows.contact,
    ),
    # not below contact: its steps are others than those of the load path
    StageType(
        PARTIAL_SLIP,
        _SURFACE,
        "contact.partial_slip",
        "contact.partial_slip",
        keeps=SLIP_MAPS,
        rows=_rows.partial_slip,
    ),
    StageType("joints/faces", _SURFACE, "joints.register", "upper", rows=_rows.faces),
    _joint("delta_surface", None),
    _joint("delta_dimension", _rows.delta_dimension),
    _joint("rigid_dilatancy", _rows.rigid_dilatancy, function="dilatancy"),
    _joint("closure", _rows.closure, keeps=CONTACT_MAPS, splits=("shear", "step")),
    _joint("closure_laws", _rows.closure_laws, ("joints/closure",)),
    _joint("elimination", _rows.elimination, function="closure", splits=("shear", "step")),
    _joint("area_dimension", _rows.area_dimension, splits=("shear",)),
    _joint(PARTIAL_SLIP, _rows.partial_slip, keeps=SLIP_MAPS, splits=("shear",)),
    _joint(
        "elastic_dilatancy",
        _rows.elastic_dilatancy,
        (*_FACES, "joints/closure"),
        function="dilatancy",
        splits=("direction", "shear"),
    ),
    _joint("friction", _rows.friction, ("joints/elastic_dilatancy or joints/rigid_dilatancy",)),
    _joint("roughness_coefficient", _rows.roughness_coefficient, _SURFACE, takes_surface=True),
    _joint("directional_roughness", _rows.directional_roughness, _SURFACE, takes_surface=True),
    _joint("direct_shear", _rows.direct_shear, splits=("nominal_pressure",)),
    _joint("shear_curve", _rows.shear_curve, _SURFACE, takes_surface=True),
    _joint("strength_envelope", _rows.strength_envelope, _SURFACE, takes_surface=True),
    _joint("self_weight", _rows.self_weight),
    _joint("decorrelation_length", _rows.decorrelation_length),
    _joint("transmissivity", _rows.transmissivity, ("joints/closure",), reads="gap"),
    _joint("uplift", _rows.uplift, ("joints/closure",), reads="gap"),
    # one window of lengths for all states
    _domain("signature", _rows.signature, whole_path=True),
    _domain("box_dimension", _rows.box_dimension, whole_path=True),
    _domain("box_counts"),
    _domain("minkowski_dimension", _rows.minkowski_dimension),
    _domain("correlation_dimension", _rows.correlation_dimension),
    _domain("generalised_dimensions", _rows.generalised_dimensions),
    _domain("boundary_dimension", _rows.boundary_dimension),
    _domain("lacunarity", _rows.lacunarity),
    _domain("islands", _rows.islands, keeps=(ISLAND_MAP,), whole_path=True),
    _domain("percolation", _rows.percolation),
    _domain("hausdorff_content"),
    _domain("describe", _rows.describe, whole_path=True),
    _domain("evolution", _rows.evolution, whole_path=True),
    _domain("lineage", whole_path=True),
)
STAGES: Mapping[str, StageType] = {row.name: row for row in _ROWS}


def _words(subpackage: str, leave_out: Iterable[str] = ()) -> tuple[str, ...]:
    rows = (row for row in _ROWS if row.subpackage == subpackage and row.word)
    return tuple(row.word for row in rows if row.word not in leave_out)


CURVES = _words("dimensions")
JOINT_STAGES = _words("joints", leave_out=("faces",))
# what the datasheet of a joint shows at least
DATASHEET = (
    "roughness_coefficient", "directional_roughness", "strength_envelope", "closure", "closure_laws",
    "transmissivity",
)  # fmt: skip
DOMAIN_STAGES = _words("domains")
READ_THE_GAP = tuple(row.word for row in _ROWS if row.reads == "gap")
# the words of [want]; those of its `dimensions` are the names of the estimators
WANTED: Mapping[str, tuple[str, ...]] = {
    "surfaces": ("height", "describe", "texture"),
    "contact": (PRESS, PARTIAL_SLIP),
    "joints": JOINT_STAGES,
    "domains": DOMAIN_STAGES,
    "keep": (*CONTACT_MAPS, *SLIP_MAPS, ISLAND_MAP),
}


@dataclass(frozen=True)
class Stage:
    """One stage of a plan.

    Attributes
    ----------
    name : str
        Group of its result, "joints/closure" for example.
    needs : tuple of str
        Stages that run before it.
    reason : str
        Why the plan has it.
    keep : tuple of str
        Maps that it has to return.
    stored : bool
        False where the result file does not contain it.
    whole_path : bool
        Whether it reads the maps of all steps at once.
    """

    name: str
    needs: tuple[str, ...]
    reason: str
    keep: tuple[str, ...] = ()
    stored: bool = True
    whole_path: bool = False

    @property
    def row(self) -> StageType:
        """Its row in the table of stages."""
        return STAGES[self.name]

    @property
    def reads_map(self) -> bool:
        """Whether it reads a map of the stage it needs."""
        return self.name != FIGURES and bool(self.row.reads)

    @property
    def reads_part(self) -> bool:
        """Whether it reads that map plane by plane, so that the map does not have to be kept."""
        return self.reads_map and not self.whole_path


def section_length(steps: int, nodes: int, *, has_hardness: bool) -> int:
    """Return how many steps of a load path a part holds: all where the state depends on the history."""
    return steps if has_hardness else min(steps, max(1, PART_SIZE // nodes))


def public_function(name: str) -> Callable[..., Any]:
    """Return a public function by the name under which users call it, "contact.press" for example."""
    subpackage, _, function = name.partition(".")
    return getattr(importlib.import_module(f"fractalcontact.{subpackage}"), function)  # type: ignore[no-any-return]


def arguments_of(function: str) -> tuple[tuple[str, ...], frozenset[str]]:
    """Return the arguments of a public function that a scene may give, and those without a default."""
    parameters = inspect.signature(public_function(function)).parameters
    allowed = {key: value for key, value in parameters.items() if key not in _FROM_SCENE}
    required = frozenset(key for key, value in allowed.items() if value.default is value.empty)
    return tuple(allowed), required
