"""Content of a mesh file, as long as it is no larger than a mesh can be."""

from pathlib import Path

from klack.errors import InputError

__all__ = ["LARGEST_BYTES", "read_bytes"]

LARGEST_BYTES = 2_000_000_000
"""Largest size of a mesh file, or of all files of one model together."""


def read_bytes(path: Path, kind: str) -> bytes:
    """Content of a mesh file; raise if it is missing, empty or too large."""
    if not path.is_file():
        raise InputError(
            str(path),
            got="no such file",
            expected=kind,
            hint="check the path; it is relative to where you started the program.",
        )
    size = path.stat().st_size
    if not 0 < size <= LARGEST_BYTES:
        raise InputError(
            str(path),
            got="an empty file" if size == 0 else f"{size / 1e9:.3g} GB",
            expected=f"{kind}, at most {LARGEST_BYTES / 1e9:.3g} GB",
            hint="write the mesh only, without results or steps.",
        )
    return path.read_bytes()
