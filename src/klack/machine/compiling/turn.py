"""One process compiles a function, others that need it wait for it.

A file beside the code is locked while its function is compiled; the system releases it however
a process ends.  Functions are compiled with all that they call; as none calls itself, two
processes never wait for each other.
"""

import os
import time
from contextlib import suppress
from pathlib import Path

from numba.core import event

from klack.errors import InputError
from klack.files.locks import try_lock
from klack.files.own import open_own_file

__all__ = ["WAITING", "Turn", "take_turn"]

WAITING = "klack:wait"
"""Event of numba's kind while another process compiles."""

_PAUSE = 0.02  # [s]
_PATIENCE = 60.0
"""Age of a lock [s] from which a process compiles itself: twice what the longest function takes.

The other one may be stopped (Ctrl-Z) or starved; what it has compiled is in the store.
"""


class Turn:
    """Locked file; without one, no process is kept out."""

    def __init__(self, path: Path, handle: int | None) -> None:
        self._path, self._handle = path, handle

    def end(self) -> None:
        """Give the lock back."""
        if self._handle is not None:
            with suppress(OSError):
                self._path.unlink()
            os.close(self._handle)
            self._handle = None


def take_turn(path: Path, done: Path, patience: float = _PATIENCE) -> Turn | None:
    """Lock a file; None if another process has written ``done`` meanwhile.

    Parameters
    ----------
    path
        Made, and removed at the end.
    done
        What the process that has the lock writes.
    patience [s]
        Since the other process took the lock, so that nested waits end together.
    """
    turn = _try(path)
    end = time.monotonic() + patience - _age(path)
    if turn is None:
        with event.trigger_event(WAITING, data={"file": str(done)}):
            while turn is None and not done.exists():
                if time.monotonic() > end:
                    return Turn(path, None)
                time.sleep(_PAUSE)
                turn = _try(path)
    if done.exists():  # written between our look and our lock
        if turn is not None:
            turn.end()
        return None
    return turn


def _age(path: Path) -> float:
    """Time since the lock was taken [s]."""
    with suppress(OSError):
        return max(0.0, time.time() - path.stat().st_mtime)
    return 0.0


def _try(path: Path) -> Turn | None:
    try:
        handle = open_own_file(path, os.O_RDWR | os.O_CREAT)
    except (OSError, InputError):  # a folder that may only be read
        return Turn(path, None)
    taken = try_lock(handle)
    if taken is None:
        os.close(handle)
        return Turn(path, None)
    if taken:
        with suppress(OSError):
            if os.path.samestat(path.stat(), os.fstat(handle)):
                os.utime(path)  # the file may be that of a process that was killed
                return Turn(path, handle)
    os.close(handle)  # locked by another, or removed by the one that had the lock
    return None
