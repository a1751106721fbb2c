"""Sources of methods, as the attribute `references` of a result names them."""

from __future__ import annotations

PAPER = (
    "Borri-Brunetto, Carpinteri and Chiaia, Contact, closure and friction behaviour of rough crack concrete "
    "surfaces, FRAMCOS-3 (1998)"
)
NO_REFERENCES = "none"


def joined_references(*texts: str) -> str:
    """Return the sources of several methods, each once."""
    sources = dict.fromkeys(source for text in texts for source in text.split("; ") if text != NO_REFERENCES)
    return "; ".join(sources) or NO_REFERENCES
