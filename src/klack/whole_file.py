"""Files and folders of files that are either complete or as they were before.

New files are written into a hidden folder ``.klack-...`` beside their place, the *stage*:

1. ``new/`` is filled, and the disk is told to keep it (fsync), since a power cut may otherwise
   leave the new name with an empty file behind it;
2. one rename turns ``new/`` into ``ready/``: from here on the new files count;
3. what is replaced moves to ``old/``, what is new to its place, and the stage goes.

A process that is killed before step 2 changes nothing.  Killed after it, its stage is read in the
place of the files themselves (:func:`standing`), and the next that writes into the folder brings
step 3 to its end.  Stages of dead processes are removed then; those of living ones are locked.
"""

import errno
import os
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import mkdtemp

from klack.errors import InputError
from klack.folder_lock import FolderLock, locked, try_lock

__all__ = ["in_exchange", "outdated", "standing", "whole_file", "whole_files"]

Refusal = Callable[[Path, OSError], InputError]

_STAGE = ".klack-"
_NEW, _READY, _OLD, _GONE = "new", "ready", "old", "gone"


@contextmanager
def whole_file(path: Path, refuse: Refusal | None = None) -> Iterator[Path]:
    """Give a path of the same name that takes the place of ``path`` when all went well.

    Parameters
    ----------
    path : Path
    refuse : callable, optional
        Turns the error of the system into that of the caller.

    Raises
    ------
    InputError
        If the place cannot be written to.
    """
    say = refuse or _refuse
    with whole_files(path.parent, lambda _, error: say(path, error)) as stage:
        yield stage / path.name


@contextmanager
def whole_files(folder: Path, refuse: Refusal | None = None) -> Iterator[Path]:
    """Give a hidden folder whose contents move into ``folder`` when all of it is complete.

    Files and folders of the same names are replaced, everything else in ``folder`` stays, but for
    names given to :func:`outdated`.  Folders that were made for it go again where nothing came into
    them.  Of two processes that write the same names, the one that ends last stays, as a whole.

    Parameters
    ----------
    folder : Path
    refuse : callable, optional
        Turns the error of the system into that of the caller.

    Raises
    ------
    InputError
        If the place cannot be written to.
    """
    made = [p for p in (folder, *folder.absolute().parents) if not p.exists()]
    stage: Path | None = None
    lock: FolderLock | None = None
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with locked(folder):
            _clear(folder)
            stage = Path(mkdtemp(prefix=_STAGE, dir=folder))
            lock = try_lock(stage)
            (stage / _NEW).mkdir()
        yield stage / _NEW
        if not _inside_a_stage(folder):
            _keep(stage)
        with locked(folder):
            _clear(folder)
            (stage / _NEW).rename(stage / _READY)
            if not _inside_a_stage(folder):
                _synchronise(stage)
            _move(stage, folder)
        if not _inside_a_stage(folder):
            _synchronise(folder)
    except OSError as error:
        if _inside_a_stage(folder):  # the outer stage knows the name that the user gave
            raise
        raise (refuse or _refuse)(folder, error) from error
    finally:
        if stage is not None and not (stage / _READY).is_dir():
            shutil.rmtree(stage, ignore_errors=True)
        if lock is not None:
            lock.close()
        for path in made:  # innermost first; stays if the results are inside
            try:
                path.rmdir()
            except OSError:
                break


def outdated(stage: Path, names: Iterable[str]) -> None:
    """Let files of these names go from the folder when the contents of the stage come into it."""
    gone = stage.parent / _GONE
    gone.mkdir(exist_ok=True)
    for name in names:
        (stage / name).unlink(missing_ok=True)
        (gone / name).touch()


def standing(folder: Path, name: str) -> Path:
    """Where a file or folder of a name stands, also if its writer was killed while it moved it."""
    try:
        stages = sorted(folder.glob(f"{_STAGE}*/{_READY}/{name}"))
    except OSError:
        stages = []
    return stages[0] if stages else folder / name


def in_exchange(folder: Path) -> bool:
    """Tell whether somebody writes into a folder at this moment, or was killed while he did."""
    try:
        return any(True for _ in folder.glob(f"{_STAGE}*"))
    except OSError:
        return True


# --------------------------------------------------------------------------- moving


def _move(stage: Path, folder: Path) -> None:
    """Bring what is ready to its place; all of it, or nothing where the system refuses one part.

    It may have begun before, and goes on then.
    """
    ready, old = stage / _READY, stage / _OLD
    old.mkdir(exist_ok=True)
    done: list[str] = []
    try:
        for item in sorted(ready.iterdir()):
            done.append(item.name)
            _exchange(item, folder / item.name, old / item.name)
        gone = stage / _GONE
        for name in sorted(path.name for path in gone.iterdir()) if gone.is_dir() else ():
            (folder / name).unlink(missing_ok=True)
    except BaseException:  # also Ctrl-C
        for name in reversed(done):
            _take_back(ready / name, folder / name, old / name)
        ready.rename(stage / _NEW)
        raise
    ready.rmdir()


def _exchange(new: Path, target: Path, old: Path) -> None:
    """Move a file or folder to its place, and what was there to ``old``."""
    if os.path.lexists(target):
        if not _is_folder(target) and not _is_folder(new):
            _second_name(target, old)
        else:
            target.rename(old)
    os.replace(new, target)


def _second_name(target: Path, old: Path) -> None:
    """Keep a file under ``old`` as well: its name is never without a file."""
    old.unlink(missing_ok=True)
    try:
        os.link(target, old, follow_symlinks=False)
    except (OSError, NotImplementedError):  # no such links on this file system, or of this user
        target.rename(old)


def _take_back(new: Path, target: Path, old: Path) -> None:
    if not os.path.lexists(new) and os.path.lexists(target):
        target.rename(new)
    if os.path.lexists(old):
        if os.path.lexists(target) and os.path.samestat(old.lstat(), target.lstat()):
            old.unlink()  # the new one did not come: both names are of the old file
        else:
            os.replace(old, target)


def _is_folder(path: Path) -> bool:
    return path.is_dir() and not path.is_symlink()


def _clear(folder: Path) -> None:
    """Bring what killed processes left to its end; the folder is locked."""
    for stage in sorted(folder.glob(f"{_STAGE}*")):
        if not _is_folder(stage):
            continue
        try:
            lock = try_lock(stage)
        except OSError:  # of another user
            continue
        if lock is None:  # its process lives
            continue
        try:
            if lock.certain:
                if (stage / _READY).is_dir():
                    _move(stage, folder)
                shutil.rmtree(stage, ignore_errors=True)
        finally:
            lock.close()


# --------------------------------------------------------------------------- the disk


def _inside_a_stage(folder: Path) -> bool:
    """Tell whether the outer stage looks after the disk."""
    return folder.name == _NEW and folder.parent.name.startswith(_STAGE)


def _keep(folder: Path) -> None:
    """Have everything below a folder on the disk."""
    for place, _, files in os.walk(folder, topdown=False):
        for name in files:
            _synchronise(Path(place, name))
        _synchronise(Path(place))


def _synchronise(path: Path) -> None:
    try:
        handle = os.open(path, os.O_RDONLY)
    except (IsADirectoryError, PermissionError):  # Windows opens no folders
        return
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.EROFS):  # not on this file system
            raise
    finally:
        os.close(handle)


def _refuse(path: Path, error: OSError) -> InputError:
    return InputError(
        str(path),
        got=f"an error: {error.strerror or error}",
        expected="a place to write to",
        hint="check the path and the space that is left.",
    )
