"""Where the cache is: the environment variables ``KLACK_CACHE`` and ``KLACK_CACHE_SIZE``."""

import os
import re
from functools import cache
from pathlib import Path

from klack.cache.result_cache import ResultCache
from klack.errors import InputError

__all__ = ["FOLDER_VARIABLE", "SIZE_VARIABLE", "result_cache"]

FOLDER_VARIABLE, SIZE_VARIABLE = "KLACK_CACHE", "KLACK_CACHE_SIZE"
_OFF = ("off", "0", "no", "false", "none")
_DEFAULT_SIZE = 5_000_000_000
_UNITS = {"": 1, "B": 1, "KB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12}


def result_cache() -> ResultCache | None:
    """Cache that the environment names; that of the user without; None where it is off.

    Raises
    ------
    InputError
        For a size that is none.
    """
    text = os.environ.get(FOLDER_VARIABLE, "").strip()
    if text.lower() in _OFF:
        return None
    folder = _folder(text)
    limit = _size(os.environ.get(SIZE_VARIABLE, ""))
    return None if folder is None else _at(folder, limit)


@cache  # one object per folder, so that it knows that it could not write before
def _at(folder: Path, limit: int) -> ResultCache:
    return ResultCache(folder, limit)


def _folder(text: str) -> Path | None:
    """Folder of the cache; None for a user without a home."""
    if text:
        return Path(os.path.expanduser(text)).absolute()
    from platformdirs import user_cache_path

    try:
        folder = user_cache_path("klack", appauthor=False) / "results"
    except RuntimeError:  # newer releases refuse where older ones leave "~"
        return None
    return folder if folder.is_absolute() else None


def _size(text: str) -> int:
    if not text.strip():
        return _DEFAULT_SIZE
    found = re.fullmatch(r"\s*(\d+(?:\.\d*)?)\s*([kMGT]?B?)\s*", text, re.IGNORECASE)
    unit = found[2].upper() if found else "?"
    if found is None or unit not in _UNITS:
        raise InputError(
            SIZE_VARIABLE,
            got=f"'{text}'",
            expected="a size in bytes, or with a unit, such as 2 GB",
            hint="leave it out for 5 GB; KLACK_CACHE=off turns the cache off.",
        )
    return int(float(found[1]) * _UNITS[unit])
