"""Finished parts of long work on disk, so that interrupted work can be resumed.

A text file: the first line says what is computed, each further one holds one part as JSON.  It is
only read by the same klack for the same work; otherwise it starts anew.  A last line that a crash
has left without its end is cut off; a damaged one between others is told.  Both are computed again.
"""

import json
import os
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from hashlib import sha256
from io import FileIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

import numpy as np

import klack
from klack.case.bodies import CaseBody
from klack.errors import CacheWarning, InputError
from klack.files.closing import Closing
from klack.files.locks import try_lock
from klack.files.own import open_own_file

if TYPE_CHECKING:
    from klack.case.any_case import AnyCase

__all__ = ["LogForm", "UnfinishedLog", "code_of_klack", "fingerprint"]

Key = TypeVar("Key")
Part = TypeVar("Part")


@dataclass(frozen=True, kw_only=True)
class LogForm(Generic[Key, Part]):
    """Storage form of the parts of one kind of work.

    Parameters
    ----------
    file
        Name in the folder of the results.
    format
        With its version; a file of another one is written over.
    parts
        In words, for messages.
    data
        Key and part as JSON has them; the shortest text of a double is read back exactly.
    read
        The same back.
    """

    file: str
    format: str
    parts: str
    data: Callable[[Key, Part], Mapping[str, Any]] = field(repr=False)
    read: Callable[[Mapping[str, Any]], tuple[Key, Part]] = field(repr=False)

    def open(self, folder: Path | None, mark: str) -> "UnfinishedLog[Key, Part]":
        """Open the log in a folder; in memory without one."""
        return UnfinishedLog(self, folder, mark)

    def count(self, folder: Path) -> int:
        """Number of finished parts in the file of a folder."""
        try:
            handle = open_own_file(folder / self.file, os.O_RDONLY)
        except (OSError, InputError):
            return 0
        with os.fdopen(handle, "rb") as file:
            return max(sum(line.endswith(b"\n") for line in file) - 1, 0)

    def remove(self, folder: Path) -> None:
        """Remove the file: the work is stored elsewhere."""
        path = folder / self.file
        try:
            handle = open_own_file(path, os.O_RDONLY)
        except (OSError, InputError):  # it is not there, or none of klack's
            return
        try:
            if try_lock(handle) is not False:  # else another process goes on with the same work
                path.unlink(missing_ok=True)
        except OSError:  # it stays: the same command finds everything in it
            return
        finally:
            os.close(handle)


class UnfinishedLog(Closing, Generic[Key, Part]):
    """Finished parts in a file; those of an earlier, interrupted run are there.

    One process at a time: the file is locked until :meth:`close`.

    Parameters
    ----------
    folder
        Made if it does not exist; None keeps the parts in memory only.
    mark
        What :func:`fingerprint` says.  A file with another one is written over.
    """

    def __init__(self, form: LogForm[Key, Part], folder: Path | None, mark: str) -> None:
        self.form = form
        self.done: dict[Key, Part] = {}
        self.path = folder / form.file if folder is not None else None
        self._file: FileIO | None = None
        if self.path is None:
            return
        header = (json.dumps({"format": form.format, "fingerprint": mark}) + "\n").encode()
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            self._file = file = self._own(self.path)
            if file.read(len(header)) == header:
                self._take_over(file)
            else:
                file.truncate(0)
                _append(file, header)
        except OSError as error:
            self.close()
            raise self._refuse(self.path, error) from error
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Release the file for other processes."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def add(self, key: Key, part: Part) -> None:
        """Keep a finished part.

        InputError if it cannot be written; what was written before is kept.
        """
        self.done[key] = part
        if self.path is None or self._file is None:
            return
        try:
            _append(self._file, json.dumps(self.form.data(key, part)).encode() + b"\n")
        except OSError as error:
            raise self._refuse(self.path, error) from error

    def _own(self, path: Path) -> FileIO:
        """Open and lock the file, which is made if it is not there; writing goes to its end.

        Everything is done through this one handle: what stands under the name later is not ours.
        """
        while True:
            try:
                handle = _opened(path)
            except FileExistsError:  # and it went at this moment
                continue
            if try_lock(handle) is False:
                os.close(handle)
                raise InputError(
                    str(path),
                    got="a file in use by another process of klack",
                    expected="one process at a time",
                    hint="wait for that process, or choose another folder with --out.",
                )
            try:
                if os.path.samestat(path.lstat(), os.fstat(handle)):
                    return FileIO(handle, "r+")
            except FileNotFoundError:  # removed by the one that had the lock
                pass
            os.close(handle)

    def _take_over(self, file: FileIO) -> None:
        """Read what an earlier run left; a damaged line costs no other."""
        start, damaged = file.tell(), list[int]()
        *lines, rest = file.read().split(b"\n")
        for number, line in enumerate(lines, 2):  # after the header
            try:
                key, part = self.form.read(json.loads(line))
            except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
                damaged.append(number)
            else:
                self.done[key] = part
        if rest:  # cut off by a crash
            file.truncate(start + sum(len(line) + 1 for line in lines))
        if damaged:
            warnings.warn(
                f"{self.path}: {len(damaged)} of {len(lines)} lines are damaged, the first is "
                f"line {damaged[0]}. Their {self.form.parts} are computed again.",
                CacheWarning,
                stacklevel=2,
            )

    def _refuse(self, path: Path, error: OSError) -> InputError:
        return InputError(
            str(path),
            got=f"a file that cannot be written ({error.strerror or error})",
            expected=f"a place for {self.form.parts}",
            hint="check the folder given to --out and the free space; the same command then "
            "resumes.",
        )


def _append(file: FileIO, data: bytes) -> None:
    """Write all of it to the disk."""
    rest = memoryview(data)
    while rest:
        rest = rest[file.write(rest) :]
    os.fsync(file.fileno())


def _opened(path: Path) -> int:
    """Handle for the caller alone: who can read a file can lock it."""
    flags = os.O_RDWR | os.O_APPEND
    try:
        return open_own_file(path, flags | os.O_CREAT | os.O_EXCL)
    except FileExistsError as there:
        try:
            handle = open_own_file(path, flags)
        except FileNotFoundError:
            raise there from None
    if hasattr(os, "fchmod"):
        with suppress(OSError):  # some file systems know no modes
            os.fchmod(handle, 0o600)
    return handle


def fingerprint(case: "AnyCase", parts: Iterable[bytes], source: str | None = None) -> str:
    """Digest of all that decides the numbers of a work: case, its files, klack, NumPy, and more.

    Parameters
    ----------
    case
        Meshes and drawings of its bodies are read.
    parts
        Seeds, measured values, ...
    source
        What counts of the text of the case; all of it by default.
    """
    digest = sha256()
    text = case.source if source is None else source
    heads = (word.encode() for word in (klack.__version__, np.__version__, text))
    for part in (*heads, *parts):
        digest.update(part + b"\0")
    for body in case.bodies.values():
        for file in _files_of(body):
            digest.update(file.read_bytes() + b"\0")
    for part in code_of_klack():
        digest.update(part)
    return digest.hexdigest()


def code_of_klack() -> Iterator[bytes]:
    """Files of klack itself, as they are on this machine."""
    for file in sorted(Path(klack.__file__).parent.rglob("*.py")):
        yield file.read_bytes()


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
