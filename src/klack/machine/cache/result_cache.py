"""Results under keys: bounded, safe to delete, never the reason of a failure."""

import os
import re
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from threading import Lock

from klack.errors import CacheWarning, InputError
from klack.machine.cache.entry import DamagedEntry, Entry, read_entry, write_entry

__all__ = ["FOLDER_VARIABLE", "SIZE_VARIABLE", "CacheContent", "ResultCache", "result_cache"]


_NAME = re.compile(r"[0-9a-f]{64}\.entry")
_UNFINISHED = re.compile(r"new-[^.]*\.entry\.part")
_FORGOTTEN = 3600.0  # s after which an unfinished file is deleted
_SPARE = 1.0 / 32.0  # of the limit: left free by who deletes, so that not every entry makes it look
_WRITERS = 8.0  # processes that may write at once without a look, and stay below the limit
_TRIES = 3  # to write while others delete
_TAG = "Signature: 8a477f597d28d172789f06886806bc55\n# Results of klack; safe to delete.\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class CacheContent:
    """Number of entries and their size [byte], unfinished files included."""

    count: int
    size: int


class ResultCache:
    """Results in a folder; several processes may use it at once.

    An entry is written beside its place and renamed, so that a reader finds all of it or
    nothing. What is damaged counts as absent and is written anew.  A folder that cannot be
    written to costs one note and is then only read.

    Parameters
    ----------
    folder
        Made when the first result is stored.  Only files named like entries are ever deleted.
    limit [byte]
        Above it the least recently used entries go.
    """

    def __init__(self, folder: Path, limit: int) -> None:
        self.folder, self.limit = folder, limit
        self.served: Counter[str] = Counter()
        """Results of earlier processes, by kind."""
        self.missed: Counter[str] = Counter()
        """Results that it did not have."""
        self._lock = Lock()
        self._own: set[str] = set()
        self._writable = True
        self._room = 0.0  # [byte] that may be written before the next look at the folder

    def load(self, key: str, kind: str) -> Entry | None:
        """Whole entry of a key."""
        path = self._path(key)
        entry = None
        with suppress(OSError, DamagedEntry, MemoryError):
            entry = read_entry(path, key)
        with self._lock:
            if entry is None:
                self.missed[kind] += 1
            elif key not in self._own:
                self.served[kind] += 1
        if entry is not None:
            with suppress(OSError):
                os.utime(path, follow_symlinks=os.utime not in os.supports_follow_symlinks)  # used
        return entry

    def store(self, key: str, entry: Entry) -> None:
        """Keep a result, if possible."""
        if not self._writable:
            return
        try:
            for _ in range(_TRIES):
                with suppress(FileNotFoundError):  # another process deletes what is there
                    size = self._write(key, entry)
                    break
            else:
                return
            self._own.add(key)
            self._room -= size
            if self._room <= 0.0:
                self._keep_within_limit()
        except OSError as error:
            self._give_up(error)

    def content(self) -> CacheContent:
        """Count what is there."""
        files = list(self._files())
        count = sum(1 for path, _, _ in files if _NAME.fullmatch(path.name))
        return CacheContent(count=count, size=sum(size for _, size, _ in files))

    def clear(self) -> CacheContent:
        """Delete all entries, and return what was deleted."""
        count = size = 0
        for path, length, _ in list(self._files()):
            path.unlink(missing_ok=True)
            count, size = count + bool(_NAME.fullmatch(path.name)), size + length
        return CacheContent(count=count, size=size)

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}.entry"

    def _write(self, key: str, entry: Entry) -> int:
        """Write an entry; return its size [byte]."""
        self._prepare()
        part = None
        try:
            with tempfile.NamedTemporaryFile(
                dir=self.folder, prefix="new-", suffix=".entry.part", delete=False
            ) as file:
                part = Path(file.name)
                write_entry(file, key, entry)
                size = file.tell()
            os.replace(part, self._path(key))
            return size
        except BaseException:
            if part is not None:
                with suppress(OSError):
                    part.unlink(missing_ok=True)
            raise

    def _prepare(self) -> None:
        if self.folder.is_dir():
            return
        self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with suppress(OSError):  # tells backups to leave it out
            with (self.folder / "CACHEDIR.TAG").open("x", encoding="ascii") as file:
                file.write(_TAG)

    def _files(self) -> Iterator[tuple[Path, int, float]]:
        """Entries, with size [byte] and time of the last use [s]."""
        try:
            places = list(os.scandir(self.folder))
        except OSError:
            return
        for place in places:
            if not (_NAME.fullmatch(place.name) or _UNFINISHED.fullmatch(place.name)):
                continue
            with suppress(OSError):  # another process may just have deleted it
                if place.is_file(follow_symlinks=False):
                    state = place.stat(follow_symlinks=False)
                    yield Path(place.path), state.st_size, state.st_mtime

    def _keep_within_limit(self) -> None:
        """Delete the least recently used; looking at a file takes 10 us."""
        files = sorted(self._files(), key=lambda file: file[2])
        old = time.time() - _FORGOTTEN
        total = sum(size for _, size, _ in files)
        most = self.limit if total <= self.limit else (1.0 - _SPARE) * self.limit
        for path, size, used in files:
            forgotten = _UNFINISHED.fullmatch(path.name) and used < old
            if total > most or forgotten:
                with suppress(OSError):
                    path.unlink()
                    total -= size
        self._room = max(self.limit - total, 0.0) / _WRITERS

    def _give_up(self, error: OSError) -> None:
        with self._lock:
            first, self._writable = self._writable, False
        if first:
            warnings.warn(
                f"results are not cached: {error.strerror or error} ({self.folder}). Try: "
                "'klack cache --clear', or KLACK_CACHE with another folder, or 'off'.",
                CacheWarning,
                stacklevel=3,
            )


FOLDER_VARIABLE, SIZE_VARIABLE = "KLACK_CACHE", "KLACK_CACHE_SIZE"
_OFF = ("off", "0", "no", "false", "none")
_DEFAULT_SIZE = 5_000_000_000
_UNITS = {"": 1, "B": 1, "KB": 10**3, "MB": 10**6, "GB": 10**9, "TB": 10**12}


def result_cache() -> ResultCache | None:
    """Cache by the environment, else of the user; None if off."""
    text = os.environ.get(FOLDER_VARIABLE, "").strip()
    if text.lower() in _OFF:
        return None
    folder = _folder(text)
    limit = _size(os.environ.get(SIZE_VARIABLE, ""))
    return None if folder is None else _at(folder, limit)


@cache  # one object per folder, so that it knows that it could not write before
def _at(folder: Path, limit: int) -> ResultCache:
    return ResultCache(folder, limit)


def _folder(text: str) -> Path | None:
    """None for a user without a home."""
    if text:
        return Path(os.path.expanduser(text)).absolute()
    from platformdirs import user_cache_path

    try:
        folder = user_cache_path("klack", appauthor=False) / "results"
    except RuntimeError:  # newer releases refuse where older ones leave "~"
        return None
    return folder if folder.is_absolute() else None


def _size(text: str) -> int:
    if not text.strip():
        return _DEFAULT_SIZE
    found = re.fullmatch(r"\s*(\d+(?:\.\d*)?)\s*([kMGT]?B?)\s*", text, re.IGNORECASE)
    unit = found[2].upper() if found else "?"
    if found is None or unit not in _UNITS:
        raise InputError(
            SIZE_VARIABLE,
            got=f"'{text}'",
            expected="a size in bytes, or with a unit, such as 2 GB",
            hint="leave it out for 5 GB; KLACK_CACHE=off turns the cache off.",
        )
    return int(float(found[1]) * _UNITS[unit])
