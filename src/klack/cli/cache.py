"""``klack cache``: results that earlier runs have left for later ones."""

import sys
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.terminal.options import Json
from klack.terminal.output import require_json_target, write_json

if TYPE_CHECKING:
    from klack.analyses.json_results import CacheJson

__all__ = ["cache"]


def cache(
    *,
    clear: Annotated[bool, Parameter(negative="", help="Delete everything in it.")] = False,
    json: Json = None,
) -> int:
    """Show where results are kept for later runs, and how much; KLACK_CACHE=off turns that off.

    KLACK_CACHE names another folder.
    KLACK_CACHE_SIZE is the size at which the oldest results go (5 GB).
    Meshes, modes and static solutions are kept, under a key of all that matters.
    Deleting them costs nothing but time.
    """
    from klack.cache.setting import result_cache
    from klack.errors import InputError
    from klack.memory import in_words

    require_json_target(json)
    results = result_cache()
    stream = sys.stderr if str(json) == "-" else sys.stdout
    if results is None:
        print("The cache is off (KLACK_CACHE, or a user without a home).", file=stream)
        if json is not None:
            write_json(json, _numbers(None, 0, 0, 0))
        return 0
    if clear:
        try:
            gone = results.clear()
        except OSError as error:
            raise InputError(
                f"klack cache {results.folder}",
                got=f"an error: {error.strerror or error}",
                expected="files that may be deleted",
                hint="check who owns the folder, or set KLACK_CACHE to another one.",
            ) from error
        print(f"Deleted {gone.count} results, {in_words(gone.size)}.", file=stream)
    there = results.content()
    print(f"Folder: {results.folder}", file=stream)
    print(
        f"Results: {there.count}, {in_words(there.size)} of at most {in_words(results.limit)}",
        file=stream,
    )
    if json is not None:
        write_json(json, _numbers(str(results.folder), there.count, there.size, results.limit))
    return 0


def _numbers(folder: str | None, count: int, size: int, limit: int) -> "CacheJson":
    return {
        "schema": "klack-cache/1",
        "folder": folder,
        "count": count,
        "size_B": size,
        "limit_B": limit,
    }
