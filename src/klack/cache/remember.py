"""Compute once, and take it from the cache ever after."""

from collections.abc import Callable
from typing import TypeVar

from klack.cache.content import content_key
from klack.cache.entry import Entry
from klack.cache.origin import origin
from klack.cache.result_cache import ResultCache

__all__ = ["remembered"]

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
    cache : ResultCache or None
        None computes.
    kind : str
        What it is, e.g. ``"modes"``.
    parts : tuple
        Everything that the result depends on; see :func:`klack.cache.content.content_key`.
    compute : callable
        Must depend on nothing else and warn of nothing: a warning would come only once.
    pack, unpack : callable
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
