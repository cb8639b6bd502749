"""The store of machine code: one file for each function, signature and kind of processor.

numba's own store looks only at the file that a function is written in; code that was compiled into
it from other files would stay when these change, for instance with a new release.  Here the key is
that of :mod:`klack.compiling.code_key`.  A file is written under another name and renamed, and
begins with a checksum: it is whole, or it counts as absent.
"""

import hashlib
import os
import pickle
import secrets
from contextlib import suppress
from pathlib import Path
from typing import Any

from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps

from klack.compiling.code_key import code_key
from klack.compiling.compiled_folder import compiled_folder, is_trusted, warn_once
from klack.compiling.inner_code import InnerCode
from klack.compiling.turn import Turn, take_turn
from klack.errors import InputError
from klack.own_file import caller

__all__ = ["CompiledStore"]

_CHECKSUM = 32  # bytes
_FORMAT = b"klack code 1\n"
_UNREADABLE = (
    *(AttributeError, ImportError, LookupError, TypeError, ValueError, EOFError),
    *(RuntimeError, pickle.PickleError),  # of LLVM, of pickle
)


class CompiledStore(_Cache):
    """Machine code of one function; what numba asks before and after it compiles.

    Parameters
    ----------
    dispatcher : numba.core.dispatcher.Dispatcher
    """

    def __init__(self, dispatcher: Any) -> None:
        self._dispatcher = dispatcher
        self._turns: dict[str, Turn] = {}
        self._is_on = True

    @property
    def cache_path(self) -> str:
        """Folder, as numba wants it."""
        return str(compiled_folder() or "")

    def enable(self) -> None:
        """Use the store, the default."""
        self._is_on = True

    def disable(self) -> None:
        """Keep nothing, and look for nothing."""
        self._is_on = False

    def flush(self) -> None:
        """Nothing is dropped: another key is another file."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Compiled function for a signature; None if this process has to compile it.

        Waits while another process compiles it.
        """
        folder = compiled_folder()
        if not self._is_on or folder is None:
            return None
        target_context.refresh()
        path = self._path(folder, sig, target_context.codegen())
        if path.name in self._turns:  # compiled here before, and failed
            return None
        found = self._read(path, target_context)
        if found is not None or not _prepared(folder):
            return found
        turn = take_turn(path.with_suffix(".lock"), path)
        if turn is None:
            found = self._read(path, target_context)
            if found is not None:
                return found
            with suppress(OSError):
                path.unlink()  # damaged
            turn = take_turn(path.with_suffix(".lock"), path)
        if turn is not None:
            self._turns[path.name] = turn
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what was compiled for a signature; without effect where that is not possible."""
        folder = compiled_folder()
        if not self._is_on or folder is None:
            return
        path = self._path(folder, sig, data.codegen)
        turn = self._turns.pop(path.name, None)
        try:
            if not data.lifted and not data.library.has_dynamic_globals and _prepared(folder):
                _write(path, dumps(data._reduce()))
        except OSError as error:
            warn_once(folder, error.strerror or str(error))
        finally:
            if turn is not None:
                turn.end()

    def _path(self, folder: Path, sig: Any, codegen: Any) -> Path:
        key = code_key(self._dispatcher, sig, codegen.magic_tuple())
        function = self._dispatcher.py_func
        name = f"{function.__module__.rpartition('.')[2]}.{function.__name__}"
        return folder / f"{name}-{key[:40]}.code"

    def _read(self, path: Path, target_context: Any) -> Any:
        content = _read_whole(path)
        if content is None:
            return None
        try:
            state = pickle.loads(content)
            if InnerCode.is_stored_in(state):
                return InnerCode.restored(target_context, state)
            return CompileResult._rebuild(target_context, *state)
        except _UNREADABLE:
            return None  # of another numba that calls itself the same


def _prepared(folder: Path) -> bool:
    """Make the folder; whether code may be kept in it."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        state = folder.stat()
    except OSError as error:
        warn_once(folder, error.strerror or str(error))
        return False
    if not is_trusted(state) or state.st_uid not in (caller(), None, 0):
        warn_once(folder, "other users may write to it")
        return False
    if not os.access(folder, os.W_OK | os.X_OK):
        warn_once(folder, "the folder is read-only")
        return False
    return True


def _read_whole(path: Path) -> bytes | None:
    """Content of a file that is whole and that only the caller can have written; None without."""
    try:
        with path.open("rb") as file:
            if not (is_trusted(os.fstat(file.fileno())) and is_trusted(path.parent.stat())):
                return None
            content = file.read()
    except (OSError, InputError):
        return None
    head = len(_FORMAT) + _CHECKSUM
    checksum, code = content[len(_FORMAT) : head], content[head:]
    if not content.startswith(_FORMAT) or hashlib.sha256(code).digest() != checksum:
        return None
    return code


def _write(path: Path, code: bytes) -> None:
    part = path.with_name(f"{path.stem}-{secrets.token_hex(4)}.part")
    try:
        handle = os.open(part, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(handle, "wb") as file:
            file.write(_FORMAT + hashlib.sha256(code).digest() + code)
        os.replace(part, path)
    except BaseException:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        raise
