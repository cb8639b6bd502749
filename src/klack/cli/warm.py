"""``klack warm``: compile ahead what the commands need."""

from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from klack.terminal.progress import show_progress
from klack.terminal.wanted import SHOWN, Shown

if TYPE_CHECKING:
    from klack.analyses.json_results import WarmJson
    from klack.warming.run import Warmed

__all__ = ["warm"]


def warm(
    *,
    clear: Annotated[
        bool, Parameter(negative="", help="Delete what is there, and compile all of it.")
    ] = False,
    wanted: Shown = SHOWN,
) -> int:
    """Compile ahead what strokes, impacts and derivatives need, once per processor and version.

    Without it the first command compiles, for half a minute to a minute.
    What is there already is not compiled again.
    NUMBA_CACHE_DIR names another folder for compiled functions.
    """
    from klack.compiling.compiled_folder import (
        FOLDER_VARIABLE,
        clear_folder,
        compiled_folder,
        is_usable,
        stored,
    )
    from klack.errors import InputError
    from klack.memory import in_words
    from klack.terminal.tables import TextTable
    from klack.warming.groups import GROUPS
    from klack.warming.run import warm as warm_groups

    folder = compiled_folder()
    if folder is None or not is_usable(folder):
        raise InputError(
            "folder of compiled functions",
            got=str(folder or "no home directory"),
            expected="a folder of your own that can be written to",
            hint=f"set {FOLDER_VARIABLE} to one.",
        )
    if clear:
        try:
            clear_folder(folder)
        except OSError as error:
            raise InputError(
                str(folder),
                got=f"an error: {error.strerror or error}",
                expected="files that may be deleted",
                hint=f"check who owns the folder, or set {FOLDER_VARIABLE} to another one.",
            ) from error
    done: list[Warmed] = []
    with show_progress(wanted.quiet) as progress:
        progress("compile", 0.0)
        for group in warm_groups(tuple(GROUPS)):
            done.append(group)
            progress("compile", len(done) / len(GROUPS))
    count, size = stored(folder)
    rows = [
        [
            GROUPS[group.name].words,
            str(group.functions) if group.functions else "-",
            f"{group.seconds:.1f} s" if group.functions else "was there",
        ]
        for group in done
    ]
    wanted.show(
        [
            TextTable(title="Compiled", columns=["group", "functions", "time"], rows=rows),
            f"Folder: {folder}",
            f"Functions: {count}, {in_words(size)}",
        ]
    )
    wanted.write(lambda: _numbers(done, str(folder), count, size))
    return 0


def _numbers(done: "list[Warmed]", folder: str, count: int, size: int) -> "WarmJson":
    return {
        "schema": "klack-warm/1",
        "folder": folder,
        "count": count,
        "size_B": size,
        "groups": {
            group.name: {
                "compiled": group.functions,
                "compile_time_s": group.seconds,
            }
            for group in done
        },
    }
