"""The shipped study of the 1998 paper, computed once and read by every example that shows a part of it."""

import os
import tempfile
from pathlib import Path

import fractalcontact as fc

HERE = Path(__file__).parent


def study():
    """Return the study as a DataTree; it is stored in a temporary folder until the code changes."""
    sources = Path(fc.__file__).parent.rglob("*.py")
    age = max(int(path.stat().st_mtime) for path in sources)
    default = Path(tempfile.gettempdir(), f"fractalcontact-study-{age}")
    folder = Path(os.environ.get("FRACTALCONTACT_GALLERY", default))
    if not (folder / "result.nc").exists():
        fc.scenes.run("concrete_crack", out=folder, progress=False)
    return fc.open(folder / "result.nc")
