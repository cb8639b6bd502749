"""Locks on files and folders that the system gives back when a process ends, however it ends.

No process number is stored: one may come again, and a folder may be shared by containers that
count their processes apart.  The lock is that of ``flock``, on the file or folder itself, so that
no file of its own is left behind.  It only keeps klack from klack.
"""

import errno
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

__all__ = ["FolderLock", "locked", "try_lock"]

_PATIENCE = 30.0  # s; what is done under a lock takes milliseconds
_PAUSE = 0.01  # s


@dataclass(frozen=True, kw_only=True, slots=True)
class FolderLock:
    """A lock that this process has until it closes it or ends.

    Parameters
    ----------
    handle : int or None
        Of the open file; None where folders cannot be opened.
    certain : bool
        False on file systems and systems that know no such locks: then nobody is kept out, and
        nothing is known of other processes.
    """

    handle: int | None
    certain: bool

    def close(self) -> None:
        """Give the lock back."""
        if self.handle is not None:
            os.close(self.handle)


def try_lock(path: Path) -> FolderLock | None:
    """Lock a file or folder that exists; None while another process has it.

    Raises
    ------
    OSError
        If there is no such file or folder, or it may not be opened.
    """
    try:
        import fcntl
    except ImportError:  # not on Windows
        return FolderLock(handle=None, certain=False)
    handle = os.open(path, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(handle)
        return None
    except OSError:  # some network file systems
        return FolderLock(handle=handle, certain=False)
    return FolderLock(handle=handle, certain=True)


@contextmanager
def locked(path: Path, patience: float = _PATIENCE) -> Iterator[None]:
    """Do something while no other process has the lock on ``path``; wait for it.

    Raises
    ------
    OSError
        If another process does not give it back within ``patience`` [s].
    """
    end = time.monotonic() + patience
    while (lock := try_lock(path)) is None:
        if time.monotonic() > end:
            raise OSError(errno.EBUSY, "another process writes to it and does not end", str(path))
        time.sleep(_PAUSE)
    try:
        yield
    finally:
        lock.close()
