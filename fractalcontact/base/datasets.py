"""Where the shipped surfaces and scenes are: inside the installed package, or beside it in a checkout."""

from pathlib import Path


def datasets_folder() -> Path:
    """Return the folder of the shipped scenes and surfaces."""
    package = Path(__file__).resolve().parent.parent
    installed = package / "datasets"
    return installed if installed.is_dir() else package.parent / "datasets"
