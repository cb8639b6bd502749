"""Folder for machine code: the caller's, not writable for others."""

import os
import shutil
import stat
import warnings
from contextlib import suppress
from functools import cache
from pathlib import Path

from klack.errors import CacheWarning
from klack.files.own import caller

__all__ = [
    "FOLDER_VARIABLE",
    "bytecode_folder",
    "clear_folder",
    "compiled_folder",
    "is_trusted",
    "is_usable",
    "stored",
    "warn_once",
]

FOLDER_VARIABLE = "NUMBA_CACHE_DIR"
"""Variable for another parent folder, also of numba."""
_NAME, _BYTECODE = "klack-compiled", "bytecode"


def compiled_folder() -> Path | None:
    """None for a user without a home."""
    given = os.environ.get(FOLDER_VARIABLE, "").strip()
    if given:
        return Path(os.path.expanduser(given)).absolute() / _NAME
    from platformdirs import user_cache_path

    try:
        folder = user_cache_path("klack", appauthor=False) / "compiled"
    except RuntimeError:  # newer releases refuse where older ones leave "~"
        return None
    return folder if folder.is_absolute() else None


def is_trusted(state: os.stat_result) -> bool:
    """Whether only caller or administrator can have written a file or folder."""
    if caller() is None:
        return True
    return state.st_uid in (0, caller()) and not state.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def bytecode_folder() -> Path | None:
    """Folder for what Python compiles, made if absent; None where another user could write to it.

    Python runs files of any owner, so no other user may enter the folder, nor replace it.
    """
    folder = compiled_folder()
    if folder is None or caller() is None:
        return None
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        (folder / _BYTECODE).mkdir(mode=0o700, exist_ok=True)
        found = (folder / _BYTECODE).resolve()
        own, *above = (path.stat() for path in (found, *found.parents))
    except OSError:
        return None
    if own.st_uid != caller() or own.st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        return None
    kept = all(is_trusted(state) or _is_sticky(state) for state in above)
    return found if kept and os.access(found, os.W_OK | os.X_OK) else None


def _is_sticky(state: os.stat_result) -> bool:
    """Whether others may add to a folder but rename nothing (``/tmp``)."""
    return bool(state.st_uid in (0, caller()) and state.st_mode & stat.S_ISVTX)


def is_usable(folder: Path | None) -> bool:
    """Whether code can be written there, now or once it is made."""
    if folder is None:
        return False
    there = next((path for path in (folder, *folder.parents) if path.exists()), None)
    if there is None or not there.is_dir() or not os.access(there, os.W_OK | os.X_OK):
        return False
    return there != folder or is_trusted(folder.stat())


def stored(folder: Path) -> tuple[int, int]:
    """Count functions, and bytes of all files of the folder."""
    count = size = 0
    with suppress(OSError):
        for entry in os.scandir(folder):
            with suppress(OSError):
                size += entry.stat(follow_symlinks=False).st_size
                count += entry.name.endswith(".code")
    return count, size


def clear_folder(folder: Path) -> None:
    """Delete all, bytecode too, except what another process is writing."""
    with suppress(FileNotFoundError):
        for entry in os.scandir(folder):
            if entry.name.endswith((".code", ".part")):
                Path(entry.path).unlink(missing_ok=True)
    shutil.rmtree(folder / _BYTECODE, ignore_errors=True)


@cache
def warn_once(folder: Path | None, reason: str) -> None:
    """Say once per process why nothing is kept."""
    warnings.warn(
        f"compiled functions are not cached: {reason} ({folder or 'no home directory'}), so every "
        f"command compiles them again. Try: {FOLDER_VARIABLE} with a folder of your own.",
        CacheWarning,
        stacklevel=2,
    )
