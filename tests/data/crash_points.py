"""Crash a process at every operation on files that it does, one after another.

``python crash_points.py small FOLDER EVERY``, ``python crash_points.py stopped FOLDER LATER`` (with
Ctrl-C instead of crashes, twice) or ``python crash_points.py WORDS FOLDER COUNT``; a program of its
own, since it forks.  A child works in FOLDER and is gone, without a word and unflushed, just before
its n-th operation (opening for writing, mkdir, rename, link, unlink, truncate, ...).  For the
small work n runs over all operations; for a command of klack, given as a JSON list of words, over
COUNT of them: half of these spread over the run, half at its very end.  Prints one JSON object: how
many operations there are, and what is found after each crash.
"""

import json
import os
import shutil
import signal
import sys
from collections.abc import Callable
from pathlib import Path

CRASHED, STOPPED = 99, 130
OPERATIONS = {
    *("os.mkdir", "os.rename", "os.link", "os.symlink", "os.remove", "os.rmdir", "os.truncate"),
    "klack.swap_names",
}
os.fsync = lambda handle: None  # type: ignore[assignment]  # matters to power cuts, not to crashes
WRITING = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC


def changes_files(event: str, given: tuple) -> bool:
    """Tell whether an event of the interpreter is about to change something on the disk."""
    if event == "open":
        return isinstance(given[2], int) and bool(given[2] & WRITING) and given[0] != os.devnull
    return event in OPERATIONS


def forked(
    act: Callable[[], object], crash_at: int | None, stop_at: tuple[int, ...] = ()
) -> tuple[int, int]:
    """Exit code of a child that does something, and how many operations it did.

    It is gone before one operation, or gets Ctrl-C before some of them.
    """
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        count = 0

        def note(event: str, given: tuple) -> None:
            nonlocal count
            if changes_files(event, given):
                if count == crash_at:
                    os._exit(CRASHED)
                count += 1
                if count - 1 in stop_at:
                    signal.raise_signal(signal.SIGINT)

        code = 1
        signal.signal(signal.SIGINT, signal.default_int_handler)
        signal.alarm(300)  # s; a child that hangs shall not hold up the others
        try:
            sys.addaudithook(note)
            found = act()
            code = found if isinstance(found, int) else 0
            os.write(writer, b"%d" % count)
        except KeyboardInterrupt:
            code = STOPPED
        except BaseException:
            import traceback

            traceback.print_exc()
        finally:
            os._exit(code)
    os.close(writer)
    with os.fdopen(reader) as stream:
        text = stream.read()
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), int(text or -1)


# --------------------------------------------------------------------------- a small folder


def put(folder: Path, word: str) -> None:
    """Write a folder and a file whose contents say ``word``; a note of the time before goes."""
    from klack.files.whole import outdated, whole_files

    with whole_files(folder) as stage:
        (stage / "store").mkdir()
        for name in ("a", "b"):
            (stage / "store" / name).write_text(word)
        (stage / "page").write_text(word)
        outdated(stage, ["note"])


def seen(folder: Path) -> list[str]:
    """Words that a reader finds."""
    from klack.files.whole import completed

    return in_place(completed(folder), "store/a", "store/b", "page")


def in_place(folder: Path, *names: str) -> list[str]:
    """Words that stand there, also for those who may not finish what another user began."""
    return sorted({(folder / name).read_text() for name in names})


def fresh(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    put(folder, "old")
    (folder / "note").write_text("of the time before")
    (folder / "mine.txt").write_text("of the user")


def litter(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def small(folder: Path, every: int) -> dict:
    """Crash at every point, and after some of these crashes at every point of the next run."""
    fresh(folder)
    total = forked(lambda: put(folder, "new"), None)[1]
    rows = []
    for n in range(total):
        fresh(folder)
        code = forked(lambda: put(folder, "new"), n)[0]
        store, page = in_place(folder, "store/a", "store/b"), in_place(folder, "page")
        found = seen(folder)
        put(folder, "newer")
        row = {"at": n, "code": code, "found": found, "next": seen(folder), "left": litter(folder)}
        row |= {"store": store, "page": page}
        row["twice"] = [] if n % every else twice(folder, n)
        rows.append(row)
    return {"operations": total, "rows": rows}


def stopped(folder: Path, again: int) -> dict:
    """Press Ctrl-C at every point, and once more some operations later."""
    fresh(folder)
    total = forked(lambda: put(folder, "new"), None)[1]
    rows = []
    for n in range(total):
        fresh(folder)
        code = forked(lambda: put(folder, "new"), None, (n, n + again))[0]
        words = in_place(folder, "store/a", "store/b", "page")
        rows.append({"at": n, "code": code, "found": words, "left": litter(folder)})
    return {"operations": total, "rows": rows}


def twice(folder: Path, first: int) -> list[str]:
    """Words found after a second crash anywhere in the run that follows one with a first crash.

    The first crash is done again each time: stages of a copied folder are not those of klack.
    """
    found: set[str] = set()
    n, code = 0, CRASHED
    while code == CRASHED:
        fresh(folder)
        forked(lambda: put(folder, "new"), first)
        code = forked(lambda: put(folder, "newer"), n)[0]
        found.add("+".join(seen(folder)))
        put(folder, "last")
        if seen(folder) != ["last"] or litter(folder) != ["mine.txt", "page", "store"]:
            found.add(f"broken after {n}: {seen(folder)}, {litter(folder)}")
        n += 1
    return sorted(found)


# --------------------------------------------------------------------------- commands of klack


def command(words: list[str], folder: Path, most: int) -> dict:
    """Crash a command at ``most`` of its operations; the earlier result is there."""
    from klack.cli.main import main

    folder = folder.absolute()
    os.chdir(folder)
    run = [*words, "--out", "out", "--quiet"]
    numbers = ["--json", "numbers.json"] if words[0] != "export" else []
    out = folder / "out"
    log = os.open(folder / "words.txt", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    os.dup2(log, 2)
    code, _ = forked(lambda: main([*run, *numbers]), None)
    if code:
        return {"operations": -1, "rows": [], "code": code}
    before = contents(out)
    former = plain(folder)
    kept = Path(f"{out}-kept")
    shutil.copytree(out, kept)
    total = forked(lambda: main([*run, *numbers]), None)[1]
    spread = {total * i // (most // 2) for i in range(most // 2)}
    rows = []
    for n in sorted(spread | set(range(max(total - most // 2, 0), total))):
        shutil.rmtree(out, ignore_errors=True)
        shutil.copytree(kept, out)
        code = forked(lambda n=n: main([*run, *numbers]), n)[0]
        row: dict = {"at": n, "code": code, "readable": readable(out), "torn": torn(out, before)}
        row["next"] = forked(lambda: main([*run, *numbers]), None)[0]
        row["left"] = sorted(set(litter(out)) ^ set(litter(kept)))
        row["same"] = plain(folder) == former and readable(out)
        row["beside"] = [name for name in litter(folder) if name.startswith(".")]
        rows.append(row)
    return {"operations": total, "rows": rows}


def readable(out: Path) -> bool:
    """Tell whether the result in a folder, if there is one, can be read; zarr starts threads."""
    return forked(lambda: 0 if can_be_read(out) else 1, None)[0] == 0


def can_be_read(out: Path) -> bool:
    from klack.analyses.catalogue import load_result
    from klack.analyses.ending import is_result
    from klack.errors import InputError

    if not is_result(out):
        return True
    try:
        load_result(out)
    except InputError as error:
        print(error, file=sys.stderr)
        return False
    return True


def contents(out: Path) -> dict[str, bytes]:
    return {
        str(path.relative_to(out)): path.read_bytes() for path in out.rglob("*") if path.is_file()
    }


def torn(out: Path, before: dict[str, bytes]) -> list[str]:
    """Files in their place (not in a stage) that are empty, though they were not before."""
    return [
        name
        for name, data in contents(out).items()
        if not data and before.get(name) and not name.startswith(".klack-")
    ]


def plain(folder: Path) -> object:
    """Numbers of the JSON file, without times that the clock of the computer gave."""

    def without(value: object) -> object:
        if isinstance(value, dict):
            clocks = ("stage_times_s", "setup_time_s", "created", "resumed", "real_time_factor")
            return {
                key: without(item)
                for key, item in value.items()
                if key not in clocks and "time" not in key.split("_")[:1] and "wall" not in key
            }
        return [without(item) for item in value] if isinstance(value, list) else value

    path = folder / "numbers.json"
    return without(json.loads(path.read_text())) if path.exists() else None


def main(arguments: list[str]) -> None:
    folder = Path(arguments[1])
    folder.mkdir(parents=True, exist_ok=True)
    if arguments[0] == "small":
        found = small(folder, int(arguments[2]))
    elif arguments[0] == "stopped":
        found = stopped(folder, int(arguments[2]))
    else:
        words = json.loads(arguments[0])
        warm()
        found = command(words, folder, int(arguments[2]))
    print(json.dumps(found))


def warm() -> None:
    """Load what takes long, once for all children: modules, and the code of both time loops.

    No mesh is made: threads, such as those of OpenCASCADE, do not come along into a child.
    """
    import importlib

    modules = [
        "scipy.sparse.linalg",
        "zarr",
        "klack.analyses.ending",
        "klack.case.any_case",
    ]
    stored = ("impact", "stroke", "shots", "noise")
    for analysis in (*stored, "reduction", "calibration"):
        modules += [f"klack.analyses.{analysis}.run"]
    modules += [f"klack.analyses.{analysis}.analysis" for analysis in stored]
    for name in modules:
        importlib.import_module(name)
    importlib.import_module("klack.warming.small_impact").plain_impacts()
    importlib.import_module("klack.warming.groups").GROUPS["rest"].compute()


if __name__ == "__main__":
    main(sys.argv[1:])
