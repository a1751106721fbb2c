"""How much a packed file may unpack to: a file of a few megabytes must not fill the memory."""

from __future__ import annotations

from fractalcontact.base.errors import UnreadableFile

SMALL = 1 << 28  # bytes that any file may unpack to


def unpacked_limit(size: int, ratio: int) -> int:
    """Return the number of bytes that a file of this size may unpack to."""
    return max(SMALL, ratio * size)


def require_unpacked(where: str, name: str, unpacked: int, limit: int) -> None:
    """Raise `UnreadableFile` if the bytes that a file unpacks to exceed its limit."""
    if unpacked > limit:
        expected = f"at most {limit / 2**20:.0f} MiB when unpacked, for its size"
        raise UnreadableFile(where, [f"path: {name!r}: expected {expected}, got {unpacked / 2**20:.0f} MiB"])
