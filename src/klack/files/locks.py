"""Locks that no other user can hold, released by the system however a process ends.

Whoever may read a file can lock it. So klack locks only what it has made for its user alone: in a
folder of results, a hidden file that goes with the lock. Users do not keep each other out.

No process number is stored: one may come again, and containers that share a folder count their
processes apart.
"""

import errno
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass

from klack.errors import InputError
from klack.files.held import HeldFolder
from klack.files.own import caller

__all__ = ["LOCK_NAME", "locked", "own_lock_name", "try_lock"]

LOCK_NAME = ".klack-lock"
"""What the names of lock files begin with."""

_PATIENCE = 30.0  # s; what is done under a lock takes milliseconds
_PAUSE = 0.01  # s


def try_lock(handle: int | None) -> bool | None:
    """Lock an open file or folder until it is closed.

    Returns
    -------
    bool or None
        False if another process has the lock; None without locks, when nothing is known of others.
    """
    try:
        import fcntl
    except ImportError:  # not on Windows
        return None
    if handle is None:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # some network file systems
        return None
    return True


@contextmanager
def locked(folder: HeldFolder, patience: float = _PATIENCE) -> Iterator[None]:
    """Keep other processes of this user out of a folder meanwhile; wait for them.

    Without effect where there are no locks, or another user has taken the name of this one.

    Raises
    ------
    OSError
        If another process does not give it back within ``patience`` [s].
    """
    end = time.monotonic() + patience
    while (lock := _lock_file(folder, own_lock_name())) is None:
        if time.monotonic() > end:
            raise OSError(errno.EBUSY, "another process keeps writing to it", str(folder.path))
        time.sleep(_PAUSE)
    try:
        yield
    finally:
        if lock.handle is not None:
            with suppress(OSError):
                folder.remove(own_lock_name())
            os.close(lock.handle)


def own_lock_name() -> str:
    """Name of the lock file of the caller in any folder."""
    return f"{LOCK_NAME}-{caller()}"


@dataclass(frozen=True, slots=True)
class _LockFile:
    """A locked file; no handle where there are no locks."""

    handle: int | None


def _lock_file(folder: HeldFolder, name: str) -> _LockFile | None:
    """Make and lock the file; None while another process has it."""
    try:
        handle = folder.open_own_file(name, os.O_RDWR | os.O_CREAT)
    except (OSError, InputError):  # a folder that may only be read, or something planted
        return _LockFile(None)
    taken = try_lock(handle)
    if taken:
        state = folder.state(name)
        if state is not None and os.path.samestat(state, os.fstat(handle)):
            return _LockFile(handle)
    os.close(handle)  # locked by another, or removed by the one that had the lock
    if taken is None:
        with suppress(OSError):
            folder.remove(name)
        return _LockFile(None)
    return None
