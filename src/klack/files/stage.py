"""Hidden folders for new files, and the move to their destination.

A stage is a folder of the caller alone (mode 0700) with a random name::

    .klack-5f0c.../     beside the files that it is for
        seal            an empty file that is never touched again
        manifest        the number and time of change that the file system gave the seal
        new/            files that are being written
        ready/          the same files, complete: from here on they count
        moves           what they replace, and what goes
        old/            what was replaced, until all is in its place

No archive and no copy can bring a seal that fits its manifest, since no user chooses these
numbers. So a stage of the caller, closed to others, whose seal fits was made by klack in this
place. All others are left alone, and named.
"""

import errno
import json
import os
import secrets
import stat
import time
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from klack.files.closing import Closing
from klack.files.held import HeldFolder, Mark, synchronise
from klack.files.locks import try_lock
from klack.files.own import caller, kind_of

__all__ = ["NEW", "PREFIX", "Stage", "dead_stage", "is_stage_content", "name_outdated"]

PREFIX = ".klack-"
NEW = "new"
_READY, _OLD, _SEAL, _MANIFEST, _MOVES, _GONE = "ready", "old", "seal", "manifest", "moves", "gone"
_FORMAT = "klack stage 1"
_KNOWN = frozenset((NEW, _READY, _OLD, _SEAL, _MANIFEST, _MOVES, _GONE))
_LARGEST = 10_000_000  # bytes of a manifest
_TRIES, _PAUSE = 100, 0.01  # [-], [s]: threads that still write end soon


@dataclass(frozen=True, kw_only=True)
class _Moves:
    """Former and new file of each move."""

    put: Mapping[str, tuple[Mark, Mark | None]]
    """New and former name."""
    gone: Mapping[str, Mark]
    beside: Mapping[str, Mark]
    """Former content required for the exchange."""


class Stage(Closing):
    """A new stage, or that of a dead process (:func:`dead_stage`); locked until :meth:`close`.

    ``folder`` is where the files go.
    """

    def __init__(self, folder: HeldFolder) -> None:
        self.folder = folder
        while not self._made():
            self.held.close()

    @classmethod
    def entered(cls, folder: HeldFolder, name: str) -> "Stage":
        """Enter a folder that is there."""
        stage = cls.__new__(cls)
        stage.folder, stage.name, stage.held = folder, name, folder.inner(name)
        return stage

    def close(self) -> None:
        """Give the lock back."""
        self.held.close()

    @property
    def content(self) -> Path:
        """Folder of the new files, safe from other users."""
        return self.held.steady_path / NEW

    # ------------------------------------------------------------------ making and removing

    def _made(self) -> bool:
        """Make it; False if another process removed it as a dead one."""
        self.name = PREFIX + secrets.token_hex(8)
        self.folder.make(self.name, 0o700)
        try:
            self.held = self.folder.inner(self.name)
        except FileNotFoundError:
            return self._made()
        if try_lock(self.held.handle) is False:
            return False
        state = self.folder.state(self.name)
        if state is None or not os.path.samestat(state, self.held.own_state()):
            return False
        if self.held.names():  # what is in it would be removed with it
            self.close()
            raise _swapped()
        try:
            self._write(_SEAL, "")
            seal = self.held.state(_SEAL)
            if seal is None or not _of_one_user(self.held.own_state(), seal):
                raise _swapped()
            self._write(_MANIFEST, json.dumps({"format": _FORMAT, "seal": _seal_of(seal)}))
            self.held.make(NEW)
        except BaseException:
            self.remove()
            self.close()
            raise
        return True

    def remove(self) -> None:
        """Remove all of it that can be removed."""
        for _ in range(_TRIES):
            with suppress(OSError):
                # the seal last: what is left after a crash is known again
                for name in sorted(self.held.names(), key=(_SEAL, _MANIFEST).__contains__):
                    self.held.remove(name)
                self.folder.remove_empty(self.name)
            state = self.folder.state(self.name)
            if state is None or not os.path.samestat(state, self.held.own_state()):
                return
            time.sleep(_PAUSE)

    def refusal(self) -> str | None:
        """Why klack may not have made this folder; None if it has."""
        state = self.held.own_state()
        if state.st_uid != caller():
            return f"of another user (number {state.st_uid})"
        if state.st_mode & 0o022:
            return "others may write to it"
        names = self.held.names()
        if unknown := [name for name in names if name not in _KNOWN]:
            return f"with the unknown entry {unknown[0]!r}"
        if not (self._sealed() or self._barely_begun(names)):
            return "without klack's seal: it was copied or unpacked here"
        return None

    def _sealed(self) -> bool:
        seal = self.held.state(_SEAL)
        return (
            seal is not None
            and stat.S_ISREG(seal.st_mode)
            and seal.st_nlink == 1
            and seal.st_uid == caller()
            and self._read(_MANIFEST) == {"format": _FORMAT, "seal": _seal_of(seal)}
        )

    def _barely_begun(self, names: list[str]) -> bool:
        """Whether it was killed before its seal was complete: it counts as empty."""
        found = {name: self.held.state(name) for name in names}
        return found.keys() <= {_SEAL, _MANIFEST} and all(
            state is not None and stat.S_ISREG(state.st_mode) and state.st_size <= 200
            for state in found.values()
        )

    def _write(self, name: str, text: str) -> None:
        handle = self.held.open(name, os.O_WRONLY | os.O_CREAT | os.O_EXCL)
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            synchronise(file.fileno())

    def _read(self, name: str) -> Any:
        """None if a JSON file is damaged or not there."""
        try:
            with os.fdopen(self.held.open(name, os.O_RDONLY), "rb") as file:
                return json.loads(file.read(_LARGEST))
        except (OSError, ValueError, RecursionError):
            return None

    # ------------------------------------------------------------------ moving

    def put(self, beside: Mapping[str, Mark]) -> None:
        """Bring all new files to their place, as a whole, and remove what is outdated.

        Nothing moves where a file named in ``beside`` has been replaced, or where the system
        refuses.
        """
        with self.held.inner(NEW) as new:
            put = {name: (_mark(new, name), self.folder.mark(name)) for name in new.names()}
        gone = {name: mark for name in self._outdated() if (mark := self.folder.mark(name))}
        moves = _Moves(put=put, gone=gone, beside=beside)
        self._write(_MOVES, json.dumps([moves.put, moves.gone, moves.beside]))
        self.held.make(_OLD)
        self.held.rename(NEW, _READY)
        self.held.synchronise()
        self._move(moves)
        self.folder.synchronise()

    def finish(self) -> None:
        """Complete a killed process's ready files, unless one was replaced since."""
        moves = self._read_moves()
        if moves is not None and self.held.has_folder(_READY) and self.held.has_folder(_OLD):
            self._move(moves)

    def _move(self, moves: _Moves) -> None:
        with self.held.inner(_READY) as ready, self.held.inner(_OLD) as old:
            if not self._as_expected(moves, old):
                return
            try:
                for name in moves.gone:
                    if self.folder.mark(name) is not None:
                        self.folder.move(name, old)
                # folders first: the report of a result never stands beside that of another one
                for name in sorted(moves.put, key=lambda n: (not ready.has_folder(n), n)):
                    self._exchange(name, moves.put[name][0], ready, old)
            except BaseException:
                for name, (new, _) in moves.put.items():
                    self._take_back(name, new, ready, old)
                for name in moves.gone:
                    if self.folder.mark(name) is None and old.mark(name) is not None:
                        old.move(name, self.folder)
                self.held.rename(_READY, NEW)
                raise

    def _as_expected(self, moves: _Moves, old: HeldFolder) -> bool:
        """Whether all is as when the new files became ready."""
        there = self.folder.mark
        if any(there(name) != mark for name, mark in moves.beside.items()):
            return False
        if any(there(name) not in (None, mark) for name, mark in moves.gone.items()):
            return False
        for name, (new, former) in moves.put.items():
            on_its_way = there(name) is None and former is not None and old.mark(name) == former
            if there(name) not in (new, former) and not on_its_way:
                return False
        return True

    def _exchange(self, name: str, new: Mark, ready: HeldFolder, old: HeldFolder) -> None:
        """Move an entry to its place, and what was there to ``old``."""
        state = self.folder.state(name)
        if state is None:
            ready.move(name, self.folder)
        elif self.folder.mark(name) != new:
            _require_replaceable(name, state)
            if not stat.S_ISDIR(state.st_mode) and not ready.has_folder(name):
                self._second_name(name, old)
                ready.move(name, self.folder)
            elif ready.swap(name, self.folder):
                ready.move(name, old)
            else:
                self.folder.move(name, old)
                ready.move(name, self.folder)

    def _second_name(self, name: str, old: HeldFolder) -> None:
        """Keep a file under ``old`` too: its name always has a file."""
        old.remove(name)
        try:
            self.folder.link(name, old)
        except (OSError, NotImplementedError):  # no such links on this file system, or of this user
            self.folder.move(name, old)

    def _take_back(self, name: str, new: Mark, ready: HeldFolder, old: HeldFolder) -> None:
        before = ready if ready.mark(name) not in (None, new) else old  # after a swap: ready
        if self.folder.mark(name) == new:
            if before.mark(name) is not None and before.swap(name, self.folder):
                before.move(name, ready)
            else:
                self.folder.move(name, ready)
        if old.mark(name) is not None:
            if self.folder.mark(name) is None:
                old.move(name, self.folder)
            else:
                old.remove(name)

    def _outdated(self) -> list[str]:
        return [str(name) for name in self._read(_GONE) or []]

    def _read_moves(self) -> _Moves | None:
        """None if unknown or for another folder."""
        try:
            put, gone, beside = self._read(_MOVES)
            moves = _Moves(
                put={
                    _plain(name): (_as_mark(new), None if old is None else _as_mark(old))
                    for name, (new, old) in put.items()
                },
                gone={_plain(name): _as_mark(mark) for name, mark in gone.items()},
                beside={_plain(name): _as_mark(mark) for name, mark in beside.items()},
            )
        except (TypeError, ValueError, AttributeError):
            return None
        return moves


def dead_stage(folder: HeldFolder, name: str) -> Stage | str | None:
    """Stage of a dead process; why it is none; None while the process lives."""
    state = folder.state(name)
    if state is None:
        return None
    if not stat.S_ISDIR(state.st_mode):
        return kind_of(state)
    if state.st_uid != caller():
        return f"of another user (number {state.st_uid})"
    stage = Stage.entered(folder, name)
    reason: str | None = None
    try:
        lock = try_lock(stage.held.handle)
        if lock:
            reason = stage.refusal()
            if reason is None:
                return stage
    except BaseException:
        stage.close()
        raise
    stage.close()
    return reason


def is_stage_content(folder: Path) -> bool:
    """Whether files in this folder are already in a stage."""
    return folder.name == NEW and (folder.parent / _SEAL).is_file()


def name_outdated(content: Path, names: Iterable[str]) -> None:
    """Names to delete when a stage moves."""
    handle = os.open(content.parent / _GONE, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)
    with os.fdopen(handle, "w", encoding="utf-8") as file:
        json.dump(list(names), file)


def _of_one_user(folder: os.stat_result, file: os.stat_result) -> bool:
    """Whether the maker of a file owns the folder and alone can write to it.

    Compared with the file, since some file systems show one user and one mode for everything.
    """
    open_to_others = folder.st_mode & ~file.st_mode & 0o022
    return folder.st_uid == file.st_uid and not open_to_others


def _swapped() -> PermissionError:
    return PermissionError(errno.EPERM, "another folder has replaced klack's own")


def _seal_of(state: os.stat_result) -> list[int]:
    return [state.st_ino, state.st_ctime_ns]


def _mark(folder: HeldFolder, name: str) -> Mark:
    mark = folder.mark(name)
    if mark is None:
        raise FileNotFoundError(errno.ENOENT, "it disappeared while klack wrote it", name)
    return mark


def _as_mark(value: Any) -> Mark:
    number, time_ns = value
    return int(number), int(time_ns)


def _require_replaceable(name: str, state: os.stat_result) -> None:
    if stat.S_IFMT(state.st_mode) not in (stat.S_IFREG, stat.S_IFDIR, stat.S_IFLNK):
        raise FileExistsError(errno.EEXIST, f"{kind_of(state)} has the name {name!r}", name)


def _plain(name: str) -> str:
    """A name that leads nowhere else."""
    if name in ("", ".", "..") or "/" in name or "\0" in name or os.path.basename(name) != name:
        raise ValueError(name)
    return name
