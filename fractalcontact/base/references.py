"""What the attributes of a result state of its origin: provenance, scene, and sources of methods."""

from __future__ import annotations

import json
from typing import Any

PAPER = (
    "Borri-Brunetto, Carpinteri and Chiaia, Contact, closure and friction behaviour of rough crack concrete "
    "surfaces, FRAMCOS-3 (1998)"
)
NO_REFERENCES = "none"


def joined_references(*texts: str) -> str:
    """Return the sources of several methods, each once."""
    sources = dict.fromkeys(source for text in texts for source in text.split("; ") if text != NO_REFERENCES)
    return "; ".join(sources) or NO_REFERENCES


def provenance_of(data: Any) -> dict[str, Any]:
    """Return the provenance of a result, as `provenance.stamp` wrote it; empty for other data."""
    try:
        entry = json.loads(data.attrs.get("provenance", "{}"))
    except (AttributeError, TypeError, ValueError):
        return {}
    return entry if isinstance(entry, dict) else {}


def scene_of(data: Any) -> dict[str, Any]:
    """Return the scene of a study, from the provenance of its root; empty for other data."""
    parameters = provenance_of(data).get("parameters")
    scene = parameters.get("scene") if isinstance(parameters, dict) else None
    return scene if isinstance(scene, dict) else {}
