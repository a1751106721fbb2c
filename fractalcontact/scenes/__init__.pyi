from ._export import export as export
from ._export import tables as tables
from ._html_report import report as report
from ._reproduce import reproduce as reproduce
from ._run import run as run
from ._scene import Scene as Scene
from ._scene_file import load as load
from ._scene_keys import json_schema as json_schema
from ._stages import plan as plan
from ._summary import datasheet as datasheet
from ._summary import summary as summary
from ._template import template as template
from ._validation import validate as validate

__all__ = [
    "Scene",
    "datasheet",
    "export",
    "json_schema",
    "load",
    "plan",
    "report",
    "reproduce",
    "run",
    "summary",
    "tables",
    "template",
    "validate",
]
