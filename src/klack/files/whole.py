"""Files and folders that are either complete or unchanged.

New files are written into a hidden folder beside their place (:mod:`klack.files.stage`):

1. they are filled in and synchronised (fsync), since a power cut may otherwise leave an empty file;
2. one rename makes them *ready*: from here on they count;
3. what is replaced moves out of the way, what is new to its place, and the stage goes.

A process that is killed before step 2 changes nothing.  Killed after it, the next klack of the
same user that reads or writes the folder completes step 3 first (:func:`completed`), unless the
files have been replaced since.  Nothing is ever read from a stage.

Packages for atomic writing replace one file; here several that belong together change at once.
"""

import errno
import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path

from klack.errors import InputError, LeftAloneWarning
from klack.files.held import HeldFolder, Mark, synchronise
from klack.files.locks import LOCK_NAME, locked
from klack.files.own import planted
from klack.files.stage import PREFIX, Stage, dead_stage, is_stage_content, name_outdated
from klack.files.uninterrupted import uninterrupted

__all__ = ["completed", "in_exchange", "mark_of", "outdated", "whole_file", "whole_files"]

Refusal = Callable[[Path, OSError], InputError]

_MOST_NAMED = 3


@contextmanager
def whole_file(path: Path, refuse: Refusal | None = None) -> Iterator[Path]:
    """Temporary path of the same name that replaces ``path`` on success.

    ``refuse`` turns the error of the system into that of the caller, InputError by default.
    """
    say = refuse or _refuse
    with whole_files(path.parent, lambda _, error: say(path, error)) as stage:
        yield stage / path.name


@contextmanager
def whole_files(
    folder: Path, refuse: Refusal | None = None, beside: Mapping[str, Mark] | None = None
) -> Iterator[Path]:
    """Give a hidden folder whose contents move into ``folder`` when all of it is complete.

    Entries of the same names are replaced, others stay, but for names given to :func:`outdated`.
    Folders made for it go if they stay empty. Of two processes with the same names, the last one
    stays, as a whole.

    Parameters
    ----------
    refuse
        See :func:`whole_file`.
    beside
        Nothing moves where one of these files (:func:`mark_of`) has been replaced.
    """
    made = [p for p in (folder, *folder.absolute().parents) if not p.exists()]
    held: HeldFolder | None = None
    stage: Stage | None = None
    try:
        with uninterrupted():
            if found := planted(folder):
                raise PermissionError(errno.EPERM, f"it is {found}")
            folder.mkdir(parents=True, exist_ok=True)
            held = HeldFolder(folder)
            _complete(held)
            stage = Stage(held)
        yield stage.content
        if not is_stage_content(folder):  # the outer stage looks after the disk
            _keep(stage.content)
        with uninterrupted():
            _complete(held)
            with locked(held):
                stage.put(beside or {})
    except OSError as error:
        if is_stage_content(folder):  # the outer stage knows the name that the user gave
            raise
        raise (refuse or _refuse)(folder, error) from error
    finally:
        with uninterrupted():
            if stage is not None:
                stage.remove()
                stage.close()
            if held is not None:
                held.close()
            for path in made:  # innermost first; stays if the results are inside
                try:
                    path.rmdir()
                except OSError:
                    break


def outdated(stage: Path, names: Iterable[str]) -> None:
    """Delete these names when the stage moves."""
    gone = tuple(names)
    for name in gone:
        (stage / name).unlink(missing_ok=True)
    name_outdated(stage, gone)


def completed(folder: Path) -> Path:
    """The folder, with ready files of a killed klack in place."""
    try:
        with HeldFolder(folder) as held, uninterrupted():
            _complete(held)
    except OSError:  # it is not there, or may only be read: what stands there counts
        pass
    return folder


def mark_of(path: Path) -> Mark | None:
    """Identity of a file or folder, distinct from others of its name."""
    try:
        state = path.lstat()
    except OSError:
        return None
    return state.st_ino, state.st_mtime_ns


def in_exchange(folder: Path) -> bool:
    """Whether a process writes to a folder, or was killed doing so."""
    try:
        return any(True for _ in folder.glob(f"{PREFIX}*"))
    except OSError:
        return True


def _complete(folder: HeldFolder) -> None:
    """Complete what killed processes left; name what looks like it."""
    if not _stage_names(folder):
        return
    with locked(folder):
        found = {name: _brought_to_end(folder, name) for name in _stage_names(folder)}
    left = [f"{name!r} ({reason})" for name, reason in found.items() if reason]
    if left:
        more = f" and {len(left) - _MOST_NAMED} more" if len(left) > _MOST_NAMED else ""
        warnings.warn(
            f"{str(folder.path)!r} has an entry that your klack did not make; it is left "
            f"unchanged: {', '.join(left[:_MOST_NAMED])}{more}. Remove it if you know its origin.",
            LeftAloneWarning,
            stacklevel=4,
        )


def _stage_names(folder: HeldFolder) -> list[str]:
    return [
        name
        for name in folder.names()
        if name.startswith(PREFIX) and not name.startswith(LOCK_NAME)
    ]


def _brought_to_end(folder: HeldFolder, name: str) -> str | None:
    """Finish and remove a dead stage, or say why it is left alone."""
    try:
        found = dead_stage(folder, name)
        if not isinstance(found, Stage):
            return found
        with found:
            found.finish()
            found.remove()
    except FileNotFoundError:  # removed by its own process at this moment
        return None
    except OSError as error:
        return error.strerror or str(error)
    return None


def _keep(folder: Path) -> None:
    """Write everything below a folder to the disk."""
    for place, _, files in os.walk(folder, topdown=False):
        for path in (*(Path(place, name) for name in files), Path(place)):
            with suppress(IsADirectoryError, PermissionError):  # Windows opens no folders
                handle = os.open(path, os.O_RDONLY)
                try:
                    synchronise(handle)
                finally:
                    os.close(handle)


def _refuse(path: Path, error: OSError) -> InputError:
    return InputError(
        str(path),
        got=f"an error: {error.strerror or error}",
        expected="a writable path",
        hint="check the path and the free space.",
    )
