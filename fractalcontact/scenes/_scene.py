"""A study as its TOML file declares it: typed tables, and the `Scene` that holds them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any

from fractalcontact.base.tables import html_table

Table = Mapping[str, Any]
OF_SURFACE = "surface"  # plane of an upper face: plane and cells of the table [surface]
LOADS = ("closure", "normal_force", "nominal_pressure")
PRESS = "press"
# what the datasheet of a joint shows at least
DATASHEET = (
    "roughness_coefficient", "directional_roughness", "strength_envelope", "closure", "closure_laws",
    "transmissivity",
)  # fmt: skip


@dataclass(frozen=True)
class SurfaceTable:
    """`[surface]` or `[upper]`: the source of the heights and how they are prepared.

    Attributes
    ----------
    read, sample, generate : str, optional
        One of them is given: a file (of many scans a pattern or a list), a shipped surface, or the generator.
    level, despike, fill
        Preparation of the heights.
    members, member : int, optional
        Size of an ensemble of generated surfaces, or the number of one of its members.
    options : mapping
        The other keys: arguments of `surfaces.read` or of the generator.
    """

    read: str | list[str] | None = None
    sample: str | None = None
    generate: str | None = None
    level: int | None = None
    despike: bool = False
    fill: bool = False
    members: int | None = None
    member: int | None = None
    options: Table = field(default_factory=dict)


@dataclass(frozen=True)
class MaterialTable:
    """`[material]`: elastic constants (Pa, 1), basic friction angle (degree) and hardness (Pa).

    `young` and `poisson` are one value, or that of the lower and that of the upper body.
    `yield_pressure` (Pa, one value or a range) changes no result: true pressures are compared with it.
    """

    young: float | Sequence[float] | None = None
    poisson: float | Sequence[float] | None = None
    basic_friction_angle: float | None = None
    hardness: float | None = None
    yield_pressure: float | Sequence[float] | None = None


@dataclass(frozen=True)
class JointTable:
    """`[joint]`: the block that slides, and how measured faces come into place.

    Attributes
    ----------
    block : float or pair of float, optional
        Edges of the upper block, m.
    register : bool
        Bring two measured faces into mated position first.
    turn_upper : str, optional
        The axis about which an upper body that was scanned face up is turned over.
    """

    block: Any = None
    register: bool = False
    turn_upper: str | None = None


@dataclass(frozen=True)
class WantTable:
    """`[want]`: the results to compute, the maps to store, whether to draw figures and a datasheet."""

    surfaces: tuple[str, ...] = ()
    dimensions: tuple[str, ...] = ()
    contact: tuple[str, ...] = ()
    joints: tuple[str, ...] = ()
    domains: tuple[str, ...] = ()
    keep: tuple[str, ...] = ()
    figures: bool = False
    datasheet: bool = False


@dataclass(frozen=True, repr=False)
class Scene:
    """A study as it was declared: the input and the wanted results.

    Attributes
    ----------
    name : str
        Stem of the scene file.
    tables : mapping
        The file as parsed; ranges are expanded to lists.
    folder : Path
        Relative paths of the scene start here.

    Examples
    --------
    >>> import fractalcontact as fc
    >>> scene = fc.scenes.load("rigid_sliding")
    >>> scene.name, scene.want.joints
    ('rigid_sliding', ('rigid_dilatancy',))
    >>> scene.material.young
    30000000000.0
    """

    name: str
    tables: Table
    folder: Path

    def __repr__(self) -> str:
        """Return the name, then each table on a line."""
        return "\n".join([f"Scene {self.name!r}", *(f"  {name}: {text}" for name, text in self._facts())])

    def _repr_html_(self) -> str:
        """Return a table of the tables of the scene, which a notebook shows."""
        return html_table(f"Scene {self.name!r}", self._facts())

    def _facts(self) -> list[tuple[str, str]]:
        """Return the settings and tables with their values in short."""
        return [(key, _short(value)) for key, value in self.tables.items()]

    def table(self, name: str) -> Table:
        """Return one table as parsed; empty if the scene has none, or a value in its place."""
        table = self.tables.get(name)
        return table if isinstance(table, Mapping) else {}

    @cached_property
    def surface(self) -> SurfaceTable:
        """The lower, or only, surface."""
        return _surface_table(self.table("surface"))

    @cached_property
    def upper(self) -> SurfaceTable | None:
        """The upper face of a joint; None where it is the mated copy of the lower one."""
        return _surface_table(self.table("upper")) if "upper" in self.tables else None

    @cached_property
    def material(self) -> MaterialTable:
        """The material of both bodies."""
        return MaterialTable(**_typed(MaterialTable, self.table("material")))

    @cached_property
    def joint(self) -> JointTable:
        """The joint."""
        return JointTable(**_typed(JointTable, self.table("joint")))

    @cached_property
    def want(self) -> WantTable:
        """The wanted results."""
        table = self.table("want")
        figures, datasheet = (table.get(key, False) is True for key in ("figures", "datasheet"))
        lists = ("surfaces", "dimensions", "contact", "joints", "domains", "keep")
        words = {key: self.wanted(key) for key in lists}
        if datasheet:
            words["joints"] = tuple(dict.fromkeys((*words["joints"], *DATASHEET)))
        if words["domains"] and "contact" in self.tables and "joint" not in self.tables:
            words["contact"] = tuple(dict.fromkeys((*words["contact"], PRESS)))  # the set to analyse
        return WantTable(**words, figures=figures, datasheet=datasheet)

    @property
    def is_pressed(self) -> bool:
        """Whether the surface is pressed along a load path, which the domains then analyse."""
        return PRESS in self.want.contact

    def wanted(self, subpackage: str) -> tuple[str, ...]:
        """Return the words that `[want]` gives for a subpackage."""
        words = self.table("want").get(subpackage, ())
        return (
            (words,) if isinstance(words, str) else tuple(words) if isinstance(words, (list, tuple)) else ()
        )


def _short(value: Any) -> str:
    """Return a value of a scene in words; of a long list the ends and the length."""
    if isinstance(value, Mapping):
        parts = (
            f"{key} {{ {_short(item)} }}" if isinstance(item, Mapping) else f"{key} = {_short(item)}"
            for key, item in value.items()
        )
        return ", ".join(parts)
    if isinstance(value, (list, tuple)):
        if len(value) > 6:  # more than fit beside the other keys
            return f"[{_short(value[0])}, {_short(value[1])} ... {_short(value[-1])}] ({len(value)} values)"
        return f"[{', '.join(map(_short, value))}]"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _surface_table(table: Table) -> SurfaceTable:
    own = _typed(SurfaceTable, table)
    return SurfaceTable(**own, options={key: value for key, value in table.items() if key not in own})


def _typed(kind: Any, table: Table) -> dict[str, Any]:
    """Return the values of a table that a typed one has; unknown keys are reported where a scene is read."""
    names = {entry.name for entry in fields(kind)} - {"options"}  # these are the other keys
    return {key: value for key, value in table.items() if key in names}
