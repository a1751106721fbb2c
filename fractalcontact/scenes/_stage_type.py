"""What one row of the table of stages states."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from fractalcontact.scenes._functions import arguments_of, parameters_of
from fractalcontact.scenes._result_tables import Rows
from fractalcontact.scenes._scene import LOADS, Scene


def stage_options(scene: Scene, row: StageType, keys: Iterable[str] | None = None) -> dict[str, Any]:
    """Return the arguments that the tables of a scene give to a stage.

    Those of its own table (`[joint.closure]`) come before those of the whole table (`[joint]`).
    """
    name, _, word = row.table.partition(".")
    table = scene.table(name)
    # a stage may have the name of an argument ([joint.closure]), so sub-tables are not values; the block
    # of a joint is that of its crack, and only one in the table of a stage is an argument
    options = {k: value for k, value in table.items() if not isinstance(value, dict) and k != "block"}
    own = table.get(word)
    options |= own if isinstance(own, dict) else {}
    allowed = () if not options else row.arguments() if keys is None else tuple(keys)
    return {key: options[key] for key in allowed if key in options}


def loads_of(scene: Scene, row: StageType) -> list[str]:
    """Return the loads of a stage: those of its own table, else those of the whole table."""
    name, _, word = row.table.partition(".")
    table = scene.table(name)
    own = table.get(word)
    allowed = [key for key in LOADS if key in row.arguments()]
    first = [key for key in allowed if isinstance(own, dict) and key in own]
    return first or [key for key in allowed if key in table and not isinstance(table[key], dict)]


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
    wanted : str
        List and word of `[want]` that ask for it, "joints.closure" for example.
    takes : {"surface", "crack", "map", "result", "file", "study"}
        The first argument of the function: the lower face, the crack, a map or the whole result of the stage
        it needs, a file of the scene, or all results.
    options : function
        Returns the arguments that the scene gives to the function, by scene and row.
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
    one_load, one_direction : bool
        It takes one path of load, one direction.
    keys, own : tuple of str
        The arguments that a scene may give, where they are not all of the function; and those of them that
        only its own table gives.
    required : tuple of str
        Arguments that a scene must give beside those without a default.
    friction_angle : str
        The argument that is the basic friction angle of the material; there is no residual one in a scene.
    fixed : mapping
        Arguments that no scene gives.
    """

    name: str
    needs: tuple[str, ...]
    function: str
    table: str = ""
    wanted: str = ""
    takes: Literal["surface", "crack", "map", "result", "file", "study"] = "surface"
    options: Callable[[Scene, StageType], dict[str, Any]] = stage_options
    reads: str = ""
    keeps: tuple[str, ...] = ()
    splits: tuple[str, ...] = ()
    rows: Rows | None = None
    whole_path: bool = False
    presses: bool = False
    one_load: bool = False
    one_direction: bool = False
    keys: tuple[str, ...] = ()
    own: tuple[str, ...] = ()
    required: tuple[str, ...] = ()
    friction_angle: str = ""
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
        return (*self.required, *(key for key in self.arguments() if key in arguments_of(self.function)[1]))

    def call_options(self, scene: Scene, keep: tuple[str, ...] = ()) -> dict[str, Any]:
        """Return all arguments of the call but the first one; `keep` are the maps that it returns."""
        maps = {"keep": keep} if "keep" in parameters_of(self.function) else {}
        return self.options(scene, self) | maps
