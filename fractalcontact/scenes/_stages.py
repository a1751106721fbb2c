"""The stages of a study as one static table: what each needs, its public function, its maps, its rows.

The rows stand in an order in which they can run. `_plan` selects those that the wanted results of a scene
need, `_options` gives the arguments of their calls, `_parts` carries them out. The tables of their results
are in `_surface_rows`, `_joint_rows` and `_domain_rows`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from fractalcontact.scenes import _domain_rows as of_domain
from fractalcontact.scenes import _joint_rows as of_joint
from fractalcontact.scenes import _surface_rows as of_surface
from fractalcontact.scenes._functions import arguments_of, parameters_of
from fractalcontact.scenes._result_tables import Rows
from fractalcontact.scenes._scene import LOADS, PRESS, Scene

CONTACT_MAPS, ISLAND_MAP = ("state", "pressure", "gap"), "label"
SLIP_MAPS = ("slip_state", "traction_x", "traction_y", "slip_x", "slip_y")
PARTIAL_SLIP, SIGNATURE = "partial_slip", "domains/signature"
FIGURES = "figures"
PART_SIZE = 1 << 23  # nodes times steps of one part: seconds of work, and maps of at most 64 MB each


@dataclass(frozen=True)
class StageType:
    """One row of the table of stages.

    Attributes
    ----------
    name : str
        Group of its result, "joints/closure" for example.
    needs : tuple of str
        Stages whose results it takes, where the study has them; of "a or b" the first that the study has. A
        stage that takes a map or a result brings the last of its first need into the study, if it has none.
    function : str
        The public function that computes it, for example "joints.closure".
    table : str
        Table of the scene with the arguments of the function.
    wanted : str
        List and word of `[want]` that ask for it, "joints.closure" for example.
    takes : {"surface", "crack", "map", "result", "file", "study"}
        The first argument of the function: the lower face, the crack, a map or the whole result of the stage
        it needs, a file of the scene, or all results.
    why : str
        Why it needs another stage, for the plan.
    for_figures : bool
        It is computed only where figures are wanted.
    reads : str
        The map that it reads from the stage it needs.
    keeps : tuple of str
        The maps that it can store.
    splits : tuple of str
        Arguments whose values are computed apart, each by a call of its own (a part of the stage) that may
        run anywhere; "step" is the path of the load, cut into sections.
    rows : Rows, optional
        The table of its result in the summary and the report.
    whole_path : bool
        It follows the contact set along the load path, or measures all states over one window of lengths, and
        reads the maps of all steps at once. A scene can ask that of other stages too, see `Stage.whole_path`.
    presses : bool
        It solves a contact: it needs elastic constants, and which loads are possible depends on the heights.
    may_be_rigid, refuses_hardness : bool
        It computes rigid faces where the material has no elastic constants; it knows elastic bodies alone.
    one_load, one_direction : bool
        It takes one path of load, one direction.
    keys, own : tuple of str
        The arguments that a scene may give, where they are not all of the function; and those of them that
        only its own table gives.
    required : tuple of str
        Arguments that a scene must give beside those without a default.
    fixed : mapping
        Arguments that no scene gives.
    """

    name: str
    needs: tuple[str, ...]
    function: str
    table: str = ""
    wanted: str = ""
    takes: Literal["surface", "crack", "map", "result", "file", "study"] = "surface"
    why: str = ""
    for_figures: bool = False
    reads: str = ""
    keeps: tuple[str, ...] = ()
    splits: tuple[str, ...] = ()
    rows: Rows | None = None
    whole_path: bool = False
    presses: bool = False
    may_be_rigid: bool = False
    refuses_hardness: bool = False
    one_load: bool = False
    one_direction: bool = False
    keys: tuple[str, ...] = ()
    own: tuple[str, ...] = ()
    required: tuple[str, ...] = ()
    fixed: Mapping[str, Any] = field(default_factory=dict)

    @property
    def subpackage(self) -> str:
        """The subpackage that holds the function."""
        return self.function.partition(".")[0]

    @property
    def group(self) -> str:
        """The group of the result in which it stands, "joints" for example."""
        return self.name.partition("/")[0]

    @property
    def word(self) -> str:
        """The name without its group."""
        return self.name.partition("/")[2]

    def arguments(self) -> tuple[str, ...]:
        """Return the arguments of the function that a scene may give."""
        return self.keys or arguments_of(self.function)[0]

    def needed(self) -> tuple[str, ...]:
        """Return the arguments that a scene must give."""
        without_default = arguments_of(self.function)[1]
        known = self.keys or parameters_of(self.function)
        return (*self.required, *(key for key in known if key in without_default))


_SURFACE = ("surfaces",)
_FACES = ("surfaces", "joints/faces")


def _curve(method: str) -> StageType:
    name = f"dimensions.{method}"
    return StageType(f"dimensions/{method}", _SURFACE, name, wanted=name, for_figures=True)


def _joint(
    name: str, rows: Rows | None, needs: tuple[str, ...] = _FACES, function: str = "", **more: Any
) -> StageType:
    options: dict[str, Any] = {"takes": "crack"} | more
    function = f"joints.{function or name}"
    return StageType(
        f"joints/{name}", needs, function, f"joint.{name}", f"joints.{name}", rows=rows, **options
    )


def _of_surface(name: str, rows: Rows, **more: Any) -> StageType:
    return _joint(name, rows, _SURFACE, takes="surface", **more)


def _of_gap(name: str, rows: Rows) -> StageType:
    return _joint(name, rows, ("joints/closure",), takes="map", reads="gap", why=f"{name} needs the gap")


def _domain(name: str, rows: Rows | None = None, needs: tuple[str, ...] = (), **more: Any) -> StageType:
    source = ("contact or joints/closure", *needs)
    table, why = f"domains.{name}", "the contact set is analysed"
    return StageType(
        f"domains/{name}", source, table, table, table, "map", why, reads="state", rows=rows, **more
    )


_ONE: dict[str, Any] = {"one_load": True, "one_direction": True}
_ROWS = (
    StageType(
        "surfaces",
        (),
        "surfaces.read",
        "surface",
        "surfaces.height",
        takes="file",
        rows=of_surface.surfaces,
    ),  # with its description
    StageType("surfaces/description", _SURFACE, "surfaces.describe", wanted="surfaces.describe"),
    StageType(
        "surfaces/texture",
        _SURFACE,
        "surfaces.texture",
        wanted="surfaces.texture",
        rows=of_surface.texture,
    ),
    StageType("dimensions", _SURFACE, "dimensions.estimate", "dimensions", rows=of_surface.dimensions),
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
        keeps=CONTACT_MAPS,
        splits=("step",),
        presses=True,
        one_load=True,
        rows=of_surface.contact,
    ),
    # not below contact: its steps are others than those of the load path
    StageType(
        PARTIAL_SLIP,
        _SURFACE,
        "contact.partial_slip",
        "contact.partial_slip",
        f"contact.{PARTIAL_SLIP}",
        keeps=SLIP_MAPS,
        presses=True,
        refuses_hardness=True,
        one_load=True,
        rows=of_surface.partial_slip,
    ),
    StageType("joints/faces", _SURFACE, "joints.register", "upper", takes="file", rows=of_joint.faces),
    _joint("delta_surface", None, one_direction=True),
    _joint("delta_dimension", of_joint.delta_dimension, one_direction=True),
    _joint("rigid_dilatancy", of_joint.rigid_dilatancy, function="dilatancy", keys=("shear", "direction")),
    _joint("closure", of_joint.closure, keeps=CONTACT_MAPS, splits=("shear", "step"), presses=True, **_ONE),
    _joint(
        "closure_laws",
        of_joint.closure_laws,
        ("joints/closure",),
        takes="result",
        why="closure_laws needs it",
        keys=("seating_pressure",),  # its closure is the result of another stage, not a load
    ),
    _joint(
        "elimination",
        of_joint.elimination,
        function="closure",
        splits=("shear", "step"),
        presses=True,
        # of a part of the block, and elastic
        keys=("block", "shear", "direction", *LOADS, "bulk", "influence", "disc_radius", "tolerance"),
        required=("block",),
        fixed={"method": "elimination"},
        **_ONE,
    ),
    _joint("area_dimension", of_joint.area_dimension, splits=("shear",), presses=True, **_ONE),
    _joint(
        PARTIAL_SLIP,
        of_surface.partial_slip,
        keeps=SLIP_MAPS,
        splits=("shear",),
        presses=True,
        refuses_hardness=True,
        **_ONE,
    ),
    _joint(
        "elastic_dilatancy",
        of_joint.elastic_dilatancy,
        (*_FACES, "joints/closure"),
        function="dilatancy",
        splits=("direction", "shear"),
        required=("normal_force",),
        presses=True,
    ),
    _joint(
        "friction",
        of_joint.friction,
        ("joints/elastic_dilatancy or joints/rigid_dilatancy",),
        takes="result",
        why="friction needs a dilatancy",
        own=("nominal_pressure",),  # in [joint] it is the load of the closure
    ),
    _of_surface("roughness_coefficient", of_joint.roughness_coefficient),
    _of_surface("directional_roughness", of_joint.directional_roughness),
    _joint(
        "direct_shear",
        of_joint.direct_shear,
        splits=("nominal_pressure",),
        one_direction=True,
        presses=True,
    ),
    _of_surface("shear_curve", of_joint.shear_curve, one_direction=True),
    _of_surface("strength_envelope", of_joint.strength_envelope, one_direction=True),
    _joint("self_weight", of_joint.self_weight, presses=True, may_be_rigid=True),
    _joint("decorrelation_length", of_joint.decorrelation_length, one_direction=True),
    _of_gap("transmissivity", of_joint.transmissivity),
    _of_gap("uplift", of_joint.uplift),
    # one window of lengths for all states
    _domain("signature", of_domain.signature, whole_path=True),
    _domain("box_dimension", of_domain.box_dimension, whole_path=True),
    _domain("box_counts"),
    _domain("minkowski_dimension", of_domain.minkowski_dimension),
    _domain("correlation_dimension", of_domain.correlation_dimension),
    _domain("generalised_dimensions", of_domain.generalised_dimensions),
    _domain("boundary_dimension", of_domain.boundary_dimension),
    _domain("lacunarity", of_domain.lacunarity),
    _domain("islands", of_domain.islands, keeps=(ISLAND_MAP,), whole_path=True),
    _domain("percolation", of_domain.percolation),
    _domain("hausdorff_content"),
    _domain("describe", of_domain.describe, whole_path=True),
    _domain("evolution", of_domain.evolution, (SIGNATURE,), whole_path=True),
    _domain("lineage", whole_path=True),
    StageType(FIGURES, (), "plotting.draw", takes="study"),
)
STAGES: Mapping[str, StageType] = {row.name: row for row in _ROWS}


# the words of [want]; those of its `dimensions` are the names of the estimators
WANTED: Mapping[str, tuple[str, ...]] = {
    name: tuple(word for table, _, word in (row.wanted.partition(".") for row in _ROWS) if table == name)
    for name in ("surfaces", "contact", "joints", "domains")
} | {"keep": (*CONTACT_MAPS, *SLIP_MAPS, ISLAND_MAP)}


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
    internal, dropped : tuple of str
        Those of them that the result file does not contain; and of these those that nothing needs once they
        have been read plane by plane.
    stored : bool
        False where the result file does not contain it.
    whole_path : bool
        Whether it reads the maps of all steps at once.
    """

    name: str
    needs: tuple[str, ...]
    reason: str
    keep: tuple[str, ...] = ()
    internal: tuple[str, ...] = ()
    dropped: tuple[str, ...] = ()
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
