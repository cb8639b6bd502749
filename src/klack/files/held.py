"""A folder held open, safe from renaming or replacing it.

Another user with write access above can put a link in a path after a look at it. So the folder is
opened once, and its entries are reached from there by single names, never through links.
"""

import errno
import os
import shutil
import stat
from contextlib import suppress
from pathlib import Path

from klack.files.closing import Closing
from klack.files.own import SAFELY, open_own_file
from klack.files.swapped_names import swap_names

__all__ = ["HeldFolder", "Mark", "synchronise"]

Mark = tuple[int, int]
"""Number of a file or folder, and its change [ns]: numbers are reused."""

_BY_HANDLE = os.open in os.supports_dir_fd  # not on Windows
_FOLDER = os.O_RDONLY | getattr(os, "O_DIRECTORY", 0) | getattr(os, "O_CLOEXEC", 0)
_NO_LINK = getattr(os, "O_NOFOLLOW", 0)


class HeldFolder(Closing):
    """A folder, held until :meth:`close`; ``path`` may be a link to one.

    Raises
    ------
    OSError
        If it is not there, is no folder or may not be read; of every method, if the system
        refuses.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.handle = os.open(path, _FOLDER) if _BY_HANDLE else None

    def close(self) -> None:
        """Release the folder and its locks."""
        if self.handle is not None:
            os.close(self.handle)
            self.handle = None

    def inner(self, name: str) -> "HeldFolder":
        """A folder in it, held; not behind a link."""
        found = HeldFolder.__new__(HeldFolder)
        found.path = self.path / name
        found.handle = None
        if _BY_HANDLE:
            found.handle = os.open(name, _FOLDER | _NO_LINK, dir_fd=self.handle)
        return found

    @property
    def steady_path(self) -> Path:
        """Path that stays valid for this process if the folder is renamed."""
        if self.handle is not None:
            path = Path(f"/proc/self/fd/{self.handle}")
            with suppress(OSError):
                if os.path.samestat(path.stat(), os.fstat(self.handle)):
                    return path
        return self.path

    def own_state(self) -> os.stat_result:
        """State of the folder itself."""
        return self.path.lstat() if self.handle is None else os.fstat(self.handle)

    def state(self, name: str) -> os.stat_result | None:
        """State of an entry, of the link itself for one."""
        try:
            return os.stat(self._at(name), dir_fd=self.handle, follow_symlinks=False)
        except FileNotFoundError:
            return None

    def mark(self, name: str) -> Mark | None:
        """Identity of an entry, distinct from earlier ones of its name."""
        state = self.state(name)
        return None if state is None else (state.st_ino, state.st_mtime_ns)

    def names(self) -> list[str]:
        """Names of all entries, sorted."""
        return sorted(os.listdir(self.path if self.handle is None else self.handle))

    def has_folder(self, name: str) -> bool:
        """Whether a folder, no link, has this name."""
        state = self.state(name)
        return state is not None and stat.S_ISDIR(state.st_mode)

    def make(self, name: str, mode: int = 0o777) -> None:
        """Make a folder in it."""
        os.mkdir(self._at(name), mode, dir_fd=self.handle)

    def move(self, name: str, to: "HeldFolder") -> None:
        """Move an entry; a file of the same name is replaced."""
        os.replace(self._at(name), to._at(name), src_dir_fd=self.handle, dst_dir_fd=to.handle)

    def rename(self, name: str, new: str) -> None:
        """Give an entry another name."""
        os.rename(self._at(name), self._at(new), src_dir_fd=self.handle, dst_dir_fd=self.handle)

    def link(self, name: str, to: "HeldFolder") -> None:
        """Hard-link a file into another folder; a link itself, not its target."""
        os.link(
            self._at(name),
            to._at(name),
            src_dir_fd=self.handle,
            dst_dir_fd=to.handle,
            follow_symlinks=False,
        )

    def swap(self, name: str, other: "HeldFolder") -> bool:
        """Exchange entries of one name; False where the system cannot."""
        if self.handle is None or other.handle is None:
            return False
        return swap_names(self.handle, name, other.handle, name)

    def remove(self, name: str) -> None:
        """Remove a file, or a folder with its content; follow no links."""
        state = self.state(name)
        if state is None:
            return
        if stat.S_ISDIR(state.st_mode):
            shutil.rmtree(self._at(name), dir_fd=self.handle)
        else:
            os.unlink(self._at(name), dir_fd=self.handle)

    def remove_empty(self, name: str) -> None:
        """Remove a folder that is empty."""
        os.rmdir(self._at(name), dir_fd=self.handle)

    def open(self, name: str, flags: int) -> int:
        """Handle of a file, not behind a link; made readable for the caller alone."""
        return os.open(self._at(name), flags | SAFELY, 0o600, dir_fd=self.handle)

    def open_own_file(self, name: str, flags: int) -> int:
        """Handle by :func:`open_own_file`."""
        return open_own_file(self._at(name), flags, folder=self.handle)

    def synchronise(self) -> None:
        """Write its list of entries to the disk."""
        if self.handle is not None:
            synchronise(self.handle)

    def _at(self, name: str) -> str:
        return name if self.handle is not None else os.fspath(self.path / name)


def synchronise(handle: int) -> None:
    """Write an open file or folder to the disk, if possible."""
    try:
        os.fsync(handle)
    except OSError as error:
        if error.errno not in (errno.EINVAL, errno.ENOTSUP, errno.EROFS):
            raise
