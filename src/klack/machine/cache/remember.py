"""Compute once, then take it from the cache."""

import hashlib
import os
import platform
from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TypeVar

import klack
from klack.machine.cache.content import content_key
from klack.machine.cache.entry import Entry
from klack.machine.cache.result_cache import ResultCache
from klack.machine.cores import available_cores

__all__ = ["origin", "remembered", "source_files"]


FORMAT = 1
"""Version of stored results; a new one hides old entries."""

_DISTRIBUTIONS = (
    *("numpy", "scipy", "numba", "netgen-mesher", "netgen-occt"),
    *("mkl", "pypardiso", "ngsolve"),
)
_SOURCES = (
    *("machine/cache", "mesh", "bodies/elasticity", "contact", "bodies/reduction"),
    *("acoustics/boundary", "materials/material.py"),
)
_THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_CBWR")


@cache  # fixed while the process lives
def origin() -> str:
    """Key of klack's own sources, the versions of its libraries, processor and threads.

    Sources count by content, not by version.  Processor and number of threads decide the order
    of sums in the libraries.
    """
    return content_key(
        FORMAT,
        klack.__version__,
        _sources(),
        {name: _version(name) for name in _DISTRIBUTIONS},
        (platform.system(), platform.machine(), platform.python_version(), _instructions()),
        {name: os.environ.get(name) for name in _THREADS},
        available_cores(),
    )


def source_files(place: Path) -> list[Path]:
    """Python files of a folder, or the file; never none, which would change no key."""
    found = [place] if place.is_file() else list(place.rglob("*.py"))
    if not found:
        raise FileNotFoundError(f"no source of klack in {place}")
    return found


def _sources() -> str:
    root = Path(klack.__file__).parent
    digest = hashlib.sha256()
    for path in sorted(path for name in _SOURCES for path in source_files(root / name)):
        digest.update(f"{path.relative_to(root).as_posix()}\n".encode())
        digest.update(hashlib.sha256(path.read_bytes()).digest())
    return digest.hexdigest()


def _version(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return ""


def _instructions() -> tuple[str, ...]:
    module = import_module("numpy._core._multiarray_umath")
    found = getattr(module, "__cpu_features__", {})
    return tuple(sorted(name for name, there in found.items() if there))


Result = TypeVar("Result")


def remembered(
    cache: ResultCache | None,
    kind: str,
    parts: tuple[object, ...],
    compute: Callable[[], Result],
    *,
    pack: Callable[[Result], Entry],
    unpack: Callable[[Entry], Result],
) -> Result:
    """Result of a function, from the cache where it is there.

    Parameters
    ----------
    cache
        None computes.
    kind
        What it is, e.g. ``"modes"``.
    parts
        All that the result depends on, for :func:`~klack.machine.cache.content.content_key`.
    compute
        Must not warn: a warning would come only once.
    pack, unpack
        To arrays and back, bit by bit.
    """
    if cache is None:
        return compute()
    key = content_key(origin(), kind, parts)
    entry = cache.load(key, kind)
    if entry is not None:
        try:
            return unpack(entry)
        except (KeyError, ValueError, TypeError):  # written for another purpose; replaced below
            pass
    result = compute()
    cache.store(key, pack(result))
    return result
