"""What a stage of a study is: one entry that states all of it, by the public function that computes it.

The stages are declared in `_surface_stages`, `_joint_stages` and `_domain_stages`: what each needs, its maps,
its table and its caveats. `_stages` has all of them.
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Literal

from fractalcontact.scenes._result_tables import Column, Remarks, Rows, no_remarks
from fractalcontact.scenes._scene import LOADS

CONTACT_MAPS, ISLAND_MAP = ("state", "pressure", "gap"), "label"
SLIP_MAPS = ("slip_state", "traction_x", "traction_y", "slip_x", "slip_y")
MAPS = (*CONTACT_MAPS, *SLIP_MAPS, ISLAND_MAP)
PARTIAL_SLIP = "partial_slip"
# arguments that a scene states elsewhere: surfaces, maps, what to keep, progress bars
FROM_SCENE = frozenset((
    "surface", "crack", "pressed", "signature", "mask", "valid", "gap", "dilatancy", "keep", "progress",
))  # fmt: skip
MATERIAL_ALONE = "basic_friction_angle"  # of bodies: no table of a stage gives one of its own


def public_function(name: str) -> Callable[..., Any]:
    """Return a public function by its name, "contact.press" for example."""
    subpackage, _, function = name.partition(".")
    return getattr(importlib.import_module(f"fractalcontact.{subpackage}"), function)  # type: ignore[no-any-return]


def parameters_of(function: str) -> dict[str, inspect.Parameter]:
    """Return the parameters of a public function."""
    return dict(inspect.signature(public_function(function)).parameters)


@cache
def arguments_of(function: str) -> tuple[tuple[str, ...], frozenset[str]]:
    """Return the arguments of a public function that a scene may give, and those without a default."""
    arguments = {key: value for key, value in parameters_of(function).items() if key not in FROM_SCENE}
    required = frozenset(key for key, value in arguments.items() if value.default is value.empty)
    return tuple(key for key in arguments if key != MATERIAL_ALONE), required


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
    caveats : function
        Yields what limits the result, and what it does to the numbers: of the study and the Dataset.
    whole_path : bool
        It follows the contact set along the load path, or measures all states over one window of lengths, and
        reads the maps of all steps at once. A scene can ask that of other stages too, see `Stage.whole_path`.
    presses : bool
        It solves a contact: it needs elastic constants, and which loads are possible depends on the heights.
    may_be_rigid, refuses_hardness : bool
        It computes rigid faces where the material has no elastic constants; it knows elastic bodies alone.
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
    for_figures: bool = False
    reads: str = ""
    keeps: tuple[str, ...] = ()
    splits: tuple[str, ...] = ()
    rows: Rows | None = None
    caveats: Remarks = no_remarks
    whole_path: bool = False
    presses: bool = False
    may_be_rigid: bool = False
    refuses_hardness: bool = False
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

    @property
    def one_load(self) -> bool:
        """Whether a scene gives it one path of load, of several that the function takes."""
        return sum(key in LOADS for key in self.arguments()) > 1

    @property
    def one_direction(self) -> bool:
        """Whether it takes one direction: its table has no row for each of several."""
        has_rows = self.rows is not None and "direction" in self.rows.over
        return "direction" in self.arguments() and not has_rows

    def needed(self) -> tuple[str, ...]:
        """Return the arguments that a scene must give."""
        without_default = arguments_of(self.function)[1]
        keys = self.keys or parameters_of(self.function)
        return (*self.required, *(key for key in keys if key in without_default))


def stage_type(
    name: str,
    needs: tuple[str, ...],
    function: str,
    title: str = "",
    over: tuple[str, ...] = (),
    *columns: Column,
    remarks: Remarks = no_remarks,
    first_dim: bool = False,
    **fields: Any,
) -> StageType:
    """Return a row of the table of stages; with columns, the table of its result has them (see `Rows`)."""
    if columns:
        fields["rows"] = Rows(title, over, columns, remarks, first_dim)
    return StageType(name, needs, function, **fields)
