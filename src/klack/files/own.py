"""Files that klack reopens: regular files of the caller.

In a folder that others may write to, an expected name may be a symbolic link to a file of the
caller, a named pipe that blocks, or a second name (hard link) of something else.
"""

import os
import stat
from pathlib import Path

from klack.errors import InputError

__all__ = ["SAFELY", "caller", "kind_of", "open_own_file", "planted", "require_own_file"]

SAFELY = (
    getattr(os, "O_NOFOLLOW", 0)
    | getattr(os, "O_NONBLOCK", 0)
    | getattr(os, "O_CLOEXEC", 0)
    | getattr(os, "O_BINARY", 0)
)
"""Flags against following links and waiting for pipes."""
_PRIVATE = 0o600


def caller() -> int | None:
    """User of this process; None without user numbers."""
    return os.geteuid() if hasattr(os, "geteuid") else None


def open_own_file(path: Path | str, flags: int, *, folder: int | None = None) -> int:
    """Open a regular file of the caller, or make it, readable by the caller alone.

    Parameters
    ----------
    path
        Its last part is not followed if it is a link.
    flags
        Of ``os.open``.  What is made here (``os.O_EXCL``) is of the caller, also where the file
        system shows another user.
    folder
        Open folder that a relative path starts at.

    Raises
    ------
    InputError
        For all but a regular file of the caller with a single name.
    """
    try:
        handle = os.open(path, flags | SAFELY, _PRIVATE, dir_fd=folder)
    except OSError:
        try:
            state = os.stat(path, dir_fd=folder, follow_symlinks=False)
        except OSError:
            state = None
        if state is not None:
            require_own_file(path, state)
        raise
    try:
        if not flags & os.O_EXCL:
            require_own_file(path, os.fstat(handle))
    except BaseException:
        os.close(handle)
        raise
    return handle


def require_own_file(path: Path | str, state: os.stat_result) -> None:
    """Raise :class:`InputError` for all but a regular file of the caller."""
    got = None
    if not stat.S_ISREG(state.st_mode):
        got = kind_of(state)
    elif caller() not in (None, state.st_uid):
        got = f"a file of another user (number {state.st_uid})"
    elif state.st_nlink > 1:
        got = f"a file that has {state.st_nlink} names (hard links)"
    if got is not None:
        raise InputError(
            os.fspath(path),
            got=got,
            expected="a regular file of your own, or no file",
            hint="another user may have put it there: check it, then remove it, or choose "
            "another folder.",
        )


def planted(path: Path) -> str | None:
    """Description of a link or pipe that another user has planted; None if there is none.

    Planted is, in a folder that others may write to, what is neither the caller's nor the folder
    owner's: the rule of Linux's ``protected_symlinks``.
    """
    try:
        state, folder = path.lstat(), path.absolute().parent.stat()
    except OSError:
        return None
    if not (stat.S_ISLNK(state.st_mode) or stat.S_ISFIFO(state.st_mode)):
        return None
    if caller() in (None, state.st_uid) or folder.st_uid == state.st_uid:
        return None
    if not folder.st_mode & 0o022:
        return None
    return f"{kind_of(state)} of another user (number {state.st_uid})"


def kind_of(state: os.stat_result) -> str:
    """Description of the entry at a name."""
    kinds = {
        stat.S_IFLNK: "a symbolic link",
        stat.S_IFIFO: "a named pipe",
        stat.S_IFSOCK: "a socket",
        stat.S_IFDIR: "a folder",
        stat.S_IFCHR: "a device",
        stat.S_IFBLK: "a device",
    }
    return kinds.get(stat.S_IFMT(state.st_mode), "a file")
