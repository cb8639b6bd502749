"""The folder that the application was opened with; nothing outside of it is read or written.

A path that comes from a browser is followed one name at a time from the held folder, never through
a link, so that neither ``..`` nor a link leads out.
"""

import errno
import json
import os
import secrets
import stat
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path, PurePosixPath
from typing import Any

from klack.errors import InputError
from klack.files.held import HeldFolder, synchronise
from klack.files.own import SAFELY, kind_of
from klack.terminal.tables import printable

__all__ = ["OWN", "RESULT_NAME", "Found", "OpenFolder", "replace_file", "result_names"]

OWN = ".klack-app"
"""Folder of the application, inside the opened one."""

RESULT_NAME = "result.zarr"
"""Of :mod:`klack.analyses.store`, whose import takes seconds."""

LARGEST_CASE = 1_000_000  # [byte] of a case file; of klack.case.case_text, which takes its time
LARGEST_FILE = 256 * 2**20  # [byte] of a report or a sound
_DEEPEST, _MOST = 5, 20_000  # levels, and entries that are looked at
_LEFT_OUT = ("node_modules", "__pycache__", "site-packages")
_CASE_ENDINGS = (".yaml", ".yml")
_CHOOSE = "choose one in the list of cases and results; the file may have been moved or removed."
_RENAME = "take another name."
_NOT_OURS = "remove or rename it: klack app makes its own folder of this name."
_NO_WRITING = (errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EACCES, errno.EPERM, errno.EIO)
_STEP_ENDINGS = (".step", ".stp")
_ENDINGS = (*_CASE_ENDINGS, *_STEP_ENDINGS)


@dataclass(frozen=True)
class Found:
    """Cases, results and STEP files below the folder, by their path from it.

    Parameters
    ----------
    is_whole
        False where there is more than was looked at.
    odd
        What has the name of a case, a STEP file or a folder and is not looked into, with the
        reason.
    """

    cases: tuple[str, ...]
    results: tuple[str, ...]
    is_whole: bool
    steps: tuple[str, ...] = ()
    odd: tuple[str, ...] = ()


class OpenFolder:
    """An existing folder and what is below it."""

    def __init__(self, path: Path) -> None:
        if not path.is_dir():
            raise InputError(
                f"FOLDER {path}",
                got="no folder",
                expected="an existing one with case files, or an empty one",
                hint="klack app, in the folder of your cases.",
            )
        self.path = path.resolve()
        if not _is_text(str(self.path)):
            raise InputError(
                f"FOLDER {_shown(str(self.path))}",
                got="a name that is not UTF-8, which no browser can show",
                expected="a folder whose path is UTF-8 text",
                hint="rename it.",
            )

    def look(self) -> Found:
        """Find cases and results; links are not followed."""
        cases: list[str] = []
        results: list[str] = []
        steps: list[str] = []
        odd: list[str] = []
        seen = 0
        waiting = [(str(self.path), 0)]
        start = len(os.path.join(self.path, ""))
        while waiting and seen < _MOST:
            place, depth = waiting.pop()
            try:
                entries = sorted(os.scandir(place), key=lambda entry: entry.name)
            except OSError:  # not for this user, or gone at this moment
                continue
            for entry in entries:
                seen += 1
                if entry.name.startswith(".") or entry.name in _LEFT_OUT:
                    continue
                is_folder = entry.is_dir(follow_symlinks=False)
                named = is_folder or entry.name.lower().endswith(_ENDINGS)
                if not named and not (entry.is_symlink() and entry.is_dir()):
                    continue
                here = entry.path[start:].replace(os.sep, "/")
                if reason := _oddness(entry, is_folder):
                    odd.append(f"{_shown(here)} ({reason})")
                elif is_folder:
                    if entry.name == RESULT_NAME:
                        results.append(str(PurePosixPath(here).parent))
                    elif depth < _DEEPEST:
                        waiting.append((entry.path, depth + 1))
                elif entry.name.endswith(_CASE_ENDINGS) and _is_case(entry.path):
                    cases.append(here)
                elif entry.name.lower().endswith(_STEP_ENDINGS):
                    steps.append(here)
        return Found(
            cases=tuple(sorted(cases)),
            results=tuple(sorted(results)),
            is_whole=seen < _MOST,
            steps=tuple(sorted(steps)),
            odd=tuple(sorted(odd)),
        )

    def require_plain(self, relative: str) -> None:
        """Refuse a folder with pipes, sockets or devices: reading them may never end."""
        for place, _, names in os.walk(self.absolute(relative)):
            for path in (Path(place, name) for name in names):
                try:
                    state = path.stat()
                except OSError:  # gone at this moment, or a link to nothing
                    continue
                if not stat.S_ISREG(state.st_mode):
                    inner = _shown(path.relative_to(self.path).as_posix())
                    raise _refused(inner, kind_of(state), "remove it: no result has such a file.")

    def read(self, relative: str, *, largest: int = LARGEST_FILE) -> bytes:
        """Content of a file below the folder.

        InputError for a path that leads out, is a link, is no plain file, or is larger than is
        read.
        """
        with self._parent(relative) as (held, name):
            handle = held.open(name, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
            with os.fdopen(handle, "rb") as file:
                state = os.fstat(file.fileno())
                if not stat.S_ISREG(state.st_mode):
                    raise _refused(relative, "no plain file")
                if state.st_size > largest:
                    raise _too_large(relative, state.st_size, largest)
                return file.read(largest + 1)

    def case_text(self, relative: str) -> str:
        """Text of a case file."""
        if not relative.endswith(_CASE_ENDINGS):
            raise _refused(relative, "no .yaml file")
        try:
            return self.read(relative, largest=LARGEST_CASE).decode("utf-8")
        except UnicodeDecodeError:
            raise _refused(relative, "bytes that are not UTF-8 text") from None

    def write(self, relative: str, text: str) -> None:
        """Replace or make a text file, whole at every moment."""
        data = text.encode()
        if len(data) > LARGEST_CASE:
            raise _too_large(relative, len(data), LARGEST_CASE)
        with self._parent(relative) as (held, name):
            state = held.state(name)
            if state is not None and not stat.S_ISREG(state.st_mode):
                raise _refused(relative, "a link or a folder")
            replace_file(held, name, data)

    def make_file(self, relative: str, text: str) -> None:
        """Make a new text file, and its folder; nothing is replaced."""
        parent, _, _ = relative.rpartition("/")
        if parent and not self.exists(parent):
            with self._parent(parent) as (held, name):
                held.make(name)
        if self.exists(relative):
            raise _refused(relative, "a file that already exists", _RENAME)
        self.write(relative, text)

    def make_folder(self, name: str, files: Mapping[str, bytes]) -> None:
        """Make a new folder with files, all or nothing."""
        if self.exists(name):
            raise _refused(name, "a file or folder that already exists", _RENAME)
        new = f".klack-{secrets.token_hex(8)}"
        with self._parent(name) as (held, last):
            held.make(new)
            try:
                with held.inner(new) as inner:
                    for file, data in files.items():
                        replace_file(inner, file, data)
                held.rename(new, last)
            except BaseException:
                held.remove(new)
                raise
            held.synchronise()

    @contextmanager
    def own(self, *names: str) -> Iterator[HeldFolder]:
        """The application's own folder, or one in it, made where it is not there, held.

        InputError where a link or a file has taken its name: what is behind it is not ours.
        """
        with self._parent(OWN) as (held, _), ExitStack() as stack:
            for name in (OWN, *names):
                with suppress(FileExistsError):
                    held.make(name, 0o700)
                if not held.has_folder(name):
                    raise _refused("/".join((OWN, *names)), "a link or a file", _NOT_OURS)
                held = stack.enter_context(held.inner(name))
            yield held

    def require_own(self, relative: str) -> None:
        """Refuse a result behind a link."""
        path = PurePosixPath(relative)
        for place in (path, *path.parents[:-1]):
            if (self.path / place).is_symlink():
                raise _refused(str(place), "a link", "remove the link, or move its target here.")

    def keep(self, name: str, data: bytes | None) -> None:
        """Replace a file of the application; None removes it."""
        with self.own() as held:
            if data is None:
                held.remove(name)
            else:
                replace_file(held, name, data)

    def own_json(self, *names: str) -> dict[str, Any]:
        """Content of a file of the application; nothing if it is missing or bad."""
        try:
            found = json.loads(self.read("/".join((OWN, *names))))
        except (InputError, ValueError, RecursionError):
            return {}
        return found if isinstance(found, dict) else {}

    def absolute(self, relative: str) -> Path:
        """Path of an existing entry below the folder, no link."""
        with self._parent(relative) as (held, name):
            state = held.state(name)
            if state is None or stat.S_ISLNK(state.st_mode):
                raise _refused(relative, "nothing there" if state is None else "a link")
        return self.path / relative

    def exists(self, relative: str) -> bool:
        """Whether there is an entry, of whatever kind."""
        try:
            with self._parent(relative) as (held, name):
                return held.state(name) is not None
        except InputError:
            return False

    @contextmanager
    def _parent(self, relative: str) -> Iterator[tuple[HeldFolder, str]]:
        """Folder of an entry, held without links, and its name."""
        parts = relative.split("/")
        is_odd = "\0" in relative or "\\" in relative or not _is_text(relative)
        if not relative or is_odd or {"", ".", ".."} & set(parts):
            raise _refused(relative, "a path that is not below the folder")
        with ExitStack() as stack:
            try:
                held = stack.enter_context(HeldFolder(self.path))
                for part in parts[:-1]:
                    held = stack.enter_context(held.inner(part))
                yield held, parts[-1]
            except OSError as error:
                self.require_here()
                raise _failed(relative, error) from None

    def require_here(self) -> None:
        """Refuse to continue in a renamed or removed folder."""
        if not self.path.is_dir():
            raise InputError(
                f"folder {self.path}",
                got="a folder that no longer exists",
                expected="the folder opened by klack app",
                hint="restore its former name, or start klack app with the new one. This page "
                "keeps your text until then.",
            )


def result_names(cases: Iterable[str]) -> dict[str, str]:
    """Name of the result of each case: no two cases of a folder write to one place.

    >>> result_names(["valve/case.yaml", "valve/soft.yaml", "other/soft.yaml"])
    {'valve/case.yaml': 'valve', 'valve/soft.yaml': 'valve-soft', 'other/soft.yaml': 'other-soft'}
    """
    paths = {case: PurePosixPath(case) for case in cases}
    short = {
        case: path.parent.name if path.stem == "case" and path.parent.name else path.stem
        for case, path in paths.items()
    }
    long = {case: "-".join(path.with_suffix("").parts) for case, path in paths.items()}
    counts = Counter(short.values())
    names = {case: short[case] if counts[short[case]] == 1 else long[case] for case in paths}
    again = Counter(names.values())
    return {
        case: name if again[name] == 1 else f"{name}-{sha256(case.encode()).hexdigest()[:8]}"
        for case, name in names.items()
    }


def replace_file(held: HeldFolder, name: str, data: bytes) -> None:
    """Replace a file by one rename, after the new one is on the disk."""
    new = f".klack-{secrets.token_hex(8)}"
    try:
        with os.fdopen(held.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL), "wb") as file:
            file.write(data)
            file.flush()
            synchronise(file.fileno())
        state = held.state(name)
        if state is not None:
            os.chmod(held.steady_path / new, stat.S_IMODE(state.st_mode))
        held.rename(new, name)
    except BaseException:
        held.remove(new)
        raise
    held.synchronise()


def _is_text(name: str) -> bool:
    """Whether a name is text: other bytes are lone surrogates."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def _shown(name: str) -> str:
    """A name in printable signs, whatever its bytes."""
    return printable(os.fsencode(name).decode("utf-8", "backslashreplace"))


def _oddness(entry: "os.DirEntry[str]", is_folder: bool) -> str:
    if not _is_text(entry.name):
        return "a name that is not UTF-8"
    if is_folder or entry.is_file(follow_symlinks=False):
        return ""
    try:
        return kind_of(entry.stat(follow_symlinks=False))
    except OSError:
        return "gone at this moment"


_MARKS = b"\xef\xbb\xbf\xff\xfe"  # that editors put in front of a text


def _is_case(path: str) -> bool:
    """Whether a file begins with the version of a case."""
    try:
        with os.fdopen(os.open(path, os.O_RDONLY | SAFELY), "rb") as file:
            is_file = stat.S_ISREG(os.fstat(file.fileno()).st_mode)  # it was one, as it was listed
            head = file.read(4096) if is_file else b""
    except OSError:
        return False
    text = head.replace(b"\0", b"").lstrip(_MARKS)  # UTF-16 is refused when it is opened
    return any(line.startswith(b"klack:") for line in text.splitlines())


def _too_large(relative: str, size: int, largest: int) -> InputError:
    return InputError(
        f"file {relative[:200]!r}",
        got=f"{size} bytes",
        expected=f"at most {largest}",
        hint="is it a mesh or a result? A case names such files and stays small.",
    )


def _failed(relative: str, error: OSError) -> InputError:
    """Error of a full disk, or of a folder without the right to write."""
    if error.errno not in _NO_WRITING:
        return _refused(relative, error.strerror or str(error))
    return InputError(
        f"file {relative[:200]!r}",
        got=error.strerror or str(error),
        expected="free disk space, and permission to read and write there",
        hint=(
            "free some space, or change the permissions, then try again; keep the page open "
            "until then."
        ),
    )


def _refused(relative: str, got: str, hint: str = _CHOOSE) -> InputError:
    return InputError(
        f"file {relative[:200]!r}",
        got=got,
        expected="a file below the folder of the application",
        hint=hint,
    )
