"""Finished parts of long work on disk while others still run, so that interrupted work goes on.

A text file: the first line says what is computed, each further one holds one part as JSON.  It is
only read by the same klack for the same work; otherwise it starts anew.  A line that was cut off by
a crash, and all behind it, is cut off and computed again.
"""

import json
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from typing import Generic, TypeVar

import klack
from klack.case.bodies import CaseBody
from klack.closing import Closing
from klack.errors import InputError
from klack.folder_lock import FolderLock, try_lock

__all__ = ["LogForm", "UnfinishedLog", "fingerprint"]

Key = TypeVar("Key")
Part = TypeVar("Part")


@dataclass(frozen=True, kw_only=True)
class LogForm(Generic[Key, Part]):
    """How the parts of one kind of work are kept.

    Parameters
    ----------
    file : str
        Name in the folder of the results.
    format : str
        With its version; a file of another one is written over.
    parts : str
        In words, for messages.
    line : callable
        Key and part as one line of JSON, without its end.
    read : callable
        The same back; None for a line that is damaged.
    """

    file: str
    format: str
    parts: str
    line: Callable[[Key, Part], str] = field(repr=False)
    read: Callable[[bytes], tuple[Key, Part] | None] = field(repr=False)

    def count(self, folder: Path) -> int:
        """How many finished parts the file in a folder holds."""
        path = folder / self.file
        return max(path.read_bytes().count(b"\n") - 1, 0) if path.is_file() else 0

    def remove(self, folder: Path) -> None:
        """Remove the file: the work is complete and stored elsewhere."""
        path = folder / self.file
        try:
            lock = try_lock(path)
            if lock is None:  # another process goes on with the same work
                return
            path.unlink(missing_ok=True)
            lock.close()
        except OSError:  # it is not there, or stays: the same command finds everything in it
            return


class UnfinishedLog(Closing, Generic[Key, Part]):
    """Finished parts in a file; those of an earlier, interrupted run are there.

    One process at a time: the file is locked until :meth:`close`.

    Parameters
    ----------
    form : LogForm
    folder : Path or None
        Made if it does not exist; None keeps the parts in memory only.
    mark : str
        What :func:`fingerprint` says.  A file with another one is written over.
    """

    def __init__(self, form: LogForm[Key, Part], folder: Path | None, mark: str) -> None:
        self.form = form
        self.done: dict[Key, Part] = {}
        self.path = folder / form.file if folder is not None else None
        self._lock: FolderLock | None = None
        if self.path is None:
            return
        header = (json.dumps({"format": form.format, "fingerprint": mark}) + "\n").encode()
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._lock = self._own(self.path)
            with self.path.open("rb") as file:
                known = file.read(len(header)) == header
            if known:
                self._take_over(self.path, self.path.read_bytes().split(b"\n"))
            else:
                self.path.write_bytes(header)
        except OSError as error:
            self.close()
            raise self._refuse(self.path, error) from error
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Let other processes have the file."""
        if self._lock is not None:
            self._lock.close()
            self._lock = None

    def add(self, key: Key, part: Part) -> None:
        """Keep a finished part.

        Raises
        ------
        InputError
            If it cannot be written; what was written before is kept.
        """
        self.done[key] = part
        if self.path is None:
            return
        try:
            with self.path.open("ab") as file:
                file.write(self.form.line(key, part).encode() + b"\n")
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise self._refuse(self.path, error) from error

    def _own(self, path: Path) -> FolderLock:
        """Lock the file, which is made if it is not there."""
        while True:
            path.open("ab").close()
            lock = try_lock(path)
            if lock is None:
                raise InputError(
                    str(path),
                    got="a file that another klack writes to",
                    expected="one process at a time for one work",
                    hint="wait for it, or give this one another folder with --out.",
                )
            try:
                if lock.handle is None or path.stat().st_ino == os.fstat(lock.handle).st_ino:
                    return lock
            except FileNotFoundError:  # removed by the one that had the lock
                pass
            lock.close()

    def _take_over(self, path: Path, lines: list[bytes]) -> None:
        """Read what an earlier run left, up to the first damaged line, and cut off the rest."""
        whole = len(lines[0]) + 1
        for line in lines[1:-1]:  # what follows the last end of line was cut off
            found = self.form.read(line)
            if found is None:
                break
            self.done[found[0]] = found[1]
            whole += len(line) + 1
        with path.open("r+b") as file:
            file.truncate(whole)

    def _refuse(self, path: Path, error: OSError) -> InputError:
        return InputError(
            str(path),
            got=f"a file that cannot be written ({error.strerror or error})",
            expected=f"a place for {self.form.parts}",
            hint="check the folder given to --out and the space that is left; the same command "
            "goes on from what is there.",
        )


def fingerprint(bodies: Iterable[CaseBody], parts: Iterable[bytes]) -> str:
    """Digest of all that decides the numbers of a work.

    Parameters
    ----------
    bodies : iterable of CaseBody
        Their meshes and drawings are read.
    parts : iterable of bytes
        Text of the case, seeds, versions of libraries, measured values, ...
    """
    digest = sha256()
    for part in parts:
        digest.update(part + b"\0")
    for body in bodies:
        for file in _files_of(body):
            digest.update(file.read_bytes() + b"\0")
    # klack itself, as it is on this machine
    for file in sorted(Path(klack.__file__).parent.rglob("*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest()


def _files_of(body: CaseBody) -> list[Path]:
    """Files that decide what a body is."""
    geometry, matrices = body.geometry, body.matrices
    files = [part.file for part in (geometry.mesh, geometry.step, geometry.nodes) if part]
    if geometry.nodes is not None:
        files += [nodes for nodes in geometry.nodes.sets.values() if isinstance(nodes, Path)]
    if matrices is not None:
        files += [matrices.stiffness, matrices.mass, *([matrices.dofs] if matrices.dofs else [])]
    if body.reduced is not None:
        files.append(body.reduced.file)
    return files
