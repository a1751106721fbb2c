"""The stages of a study as one static table: what each needs, its public function, the maps it reads.

The rows stand in an order in which they can run. `_plan` selects the rows that the wanted results of a scene
need, `_parts` carries them out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from fractalcontact.scenes import _inputs, _rows
from fractalcontact.scenes._result_tables import Rows
from fractalcontact.scenes._scene import LOADS, PRESS, Scene
from fractalcontact.scenes._stage_type import StageType, stage_options

CONTACT_MAPS, ISLAND_MAP = ("state", "pressure", "gap"), "label"
SLIP_MAPS = ("slip_state", "traction_x", "traction_y", "slip_x", "slip_y")
PARTIAL_SLIP = "partial_slip"
FIGURES = "figures"
PART_SIZE = 1 << 23  # nodes times steps of one part: seconds of work, and maps of at most 64 MB each

_SURFACE = ("surfaces",)
_FACES = ("surfaces", "joints/faces")


def _curve(method: str) -> StageType:
    return StageType(f"dimensions/{method}", _SURFACE, f"dimensions.{method}")


def _joint(
    name: str, rows: Rows | None, needs: tuple[str, ...] = _FACES, function: str = "", **more: Any
) -> StageType:
    words: dict[str, Any] = {"takes": "crack", "options": _inputs.joint_options} | more
    word, function = f"joints.{name}", f"joints.{function or name}"
    return StageType(f"joints/{name}", needs, function, f"joint.{name}", word, rows=rows, **words)


def _of_surface(name: str, rows: Rows, **more: Any) -> StageType:
    return _joint(name, rows, _SURFACE, takes="surface", **more)


def _of_gap(name: str, rows: Rows) -> StageType:
    return _joint(name, rows, ("joints/closure",), takes="map", reads="gap", options=stage_options)


def _domain(name: str, rows: Rows | None = None, **more: Any) -> StageType:
    source = ("contact or joints/closure",)
    table = f"domains.{name}"
    return StageType(
        f"domains/{name}", source, table, table, table, takes="map", reads="state", rows=rows, **more
    )


_ONE: dict[str, Any] = {"one_load": True, "one_direction": True}
_ROWS = (
    StageType(
        "surfaces", (), "surfaces.read", "surface", "surfaces.height", takes="file", rows=_rows.surfaces
    ),  # with its description
    StageType("surfaces/description", _SURFACE, "surfaces.describe", wanted="surfaces.describe"),
    StageType(
        "surfaces/texture", _SURFACE, "surfaces.texture", wanted="surfaces.texture", rows=_rows.texture
    ),
    StageType(
        "dimensions",
        _SURFACE,
        "dimensions.estimate",
        "dimensions",
        options=_inputs.dimension_options,
        rows=_rows.dimensions,
    ),
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
        f"contact.{PRESS}",
        options=_inputs.contact_options,
        keeps=CONTACT_MAPS,
        splits=("step",),
        presses=True,
        one_load=True,
        rows=_rows.contact,
    ),
    # not below contact: its steps are others than those of the load path
    StageType(
        PARTIAL_SLIP,
        _SURFACE,
        "contact.partial_slip",
        "contact.partial_slip",
        f"contact.{PARTIAL_SLIP}",
        options=_inputs.slip_options,
        keeps=SLIP_MAPS,
        presses=True,
        one_load=True,
        rows=_rows.partial_slip,
    ),
    StageType("joints/faces", _SURFACE, "joints.register", "upper", takes="file", rows=_rows.faces),
    _joint("delta_surface", None, one_direction=True),
    _joint("delta_dimension", _rows.delta_dimension, one_direction=True),
    _joint("rigid_dilatancy", _rows.rigid_dilatancy, function="dilatancy", keys=("shear", "direction")),
    _joint("closure", _rows.closure, keeps=CONTACT_MAPS, splits=("shear", "step"), presses=True, **_ONE),
    _joint(
        "closure_laws",
        _rows.closure_laws,
        ("joints/closure",),
        takes="result",
        keys=("seating_pressure",),  # its closure is the result of another stage, not a load
    ),
    _joint(
        "elimination",
        _rows.elimination,
        function="closure",
        splits=("shear", "step"),
        presses=True,
        # of a part of the block, and elastic
        keys=("block", "shear", "direction", *LOADS, "bulk", "influence", "disc_radius", "tolerance"),
        required=("block",),
        fixed={"method": "elimination"},
        **_ONE,
    ),
    _joint("area_dimension", _rows.area_dimension, splits=("shear",), presses=True, **_ONE),
    _joint(PARTIAL_SLIP, _rows.partial_slip, keeps=SLIP_MAPS, splits=("shear",), presses=True, **_ONE),
    _joint(
        "elastic_dilatancy",
        _rows.elastic_dilatancy,
        (*_FACES, "joints/closure"),
        function="dilatancy",
        splits=("direction", "shear"),
        required=("normal_force",),
        presses=True,
    ),
    _joint(
        "friction",
        _rows.friction,
        ("joints/elastic_dilatancy or joints/rigid_dilatancy",),
        takes="result",
        own=("nominal_pressure",),  # in [joint] it is the load of the closure
    ),
    _of_surface("roughness_coefficient", _rows.roughness_coefficient),
    _of_surface("directional_roughness", _rows.directional_roughness),
    _joint(
        "direct_shear", _rows.direct_shear, splits=("nominal_pressure",), one_direction=True, presses=True
    ),
    _of_surface(
        "shear_curve", _rows.shear_curve, one_direction=True, friction_angle="residual_friction_angle"
    ),
    _of_surface(
        "strength_envelope",
        _rows.strength_envelope,
        one_direction=True,
        friction_angle="basic_friction_angle",
    ),
    _joint("self_weight", _rows.self_weight, presses=True),
    _joint("decorrelation_length", _rows.decorrelation_length, one_direction=True),
    _of_gap("transmissivity", _rows.transmissivity),
    _of_gap("uplift", _rows.uplift),
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
    StageType(FIGURES, (), "plotting.draw", takes="study"),
)
STAGES: Mapping[str, StageType] = {row.name: row for row in _ROWS}


CURVES = tuple(row.word for row in _ROWS if row.group == "dimensions" and row.word)
READ_THE_GAP = tuple(row.word for row in _ROWS if row.reads == "gap")
# the words of [want]; those of its `dimensions` are the names of the estimators
WANTED: Mapping[str, tuple[str, ...]] = {
    name: tuple(word for table, _, word in (row.wanted.partition(".") for row in _ROWS) if table == name)
    for name in ("surfaces", "contact", "joints", "domains")
} | {"keep": (*CONTACT_MAPS, *SLIP_MAPS, ISLAND_MAP)}
JOINT_STAGES, DOMAIN_STAGES = WANTED["joints"], WANTED["domains"]


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
        return bool(self.row.reads)

    @property
    def reads_part(self) -> bool:
        """Whether it reads that map plane by plane, so that the map does not have to be kept."""
        return self.reads_map and not self.whole_path


def section_length(steps: int, nodes: int, *, has_hardness: bool) -> int:
    """Return how many steps of a load path a part holds: all where the state depends on the history."""
    return steps if has_hardness else min(steps, max(1, PART_SIZE // nodes))


def only_describes_surface(scene: Scene) -> bool:
    """Return whether the study presses nothing, and describes the surface alone."""
    of_crack = [name for name in scene.want.joints if STAGES[f"joints/{name}"].takes != "surface"]
    return not (scene.want.contact or scene.want.domains or of_crack)
