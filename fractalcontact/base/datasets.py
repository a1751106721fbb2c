"""Folder of the surfaces and scenes that are installed with the package."""

from pathlib import Path

SCHEMA = "fractalcontact.schema.json"  # of scenes, for editors


def datasets_folder() -> Path:
    """Return the folder: inside the installed package, or beside it in a checkout."""
    package = Path(__file__).resolve().parent.parent
    installed = package / "datasets"
    return installed if installed.is_dir() else package.parent / "datasets"
