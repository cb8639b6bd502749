"""Stored results, of whichever kind."""

from pathlib import Path

from klack.whole_file import completed

__all__ = ["is_result"]


def is_result(path: Path) -> bool:
    """Whether a path is a folder with a result or a store, rather than a case."""
    return (completed(path) / "result.zarr").is_dir() or (path / "zarr.json").is_file()
