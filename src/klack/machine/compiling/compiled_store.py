"""Store of machine code: a file per function, signature and kind of processor.

numba's own store looks only at the file that a function is written in; code that was compiled in
from other files would stay when these change. Here the key holds code, constants and options of all
functions that one reaches, not docstrings or comments. A file is written under another name and
renamed, and begins with a checksum: it is whole, or counts as absent.
"""

import hashlib
import inspect
import os
import pickle
import platform
import secrets
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from types import BuiltinFunctionType, CodeType, ModuleType
from typing import Any

import llvmlite
import numba
import numpy as np
from numba import types
from numba.core import config
from numba.core.caching import _Cache
from numba.core.compiler import CompileResult
from numba.core.dispatcher import Dispatcher
from numba.core.serialize import dumps

from klack.errors import InputError
from klack.files.own import caller
from klack.machine.compiling.compiled_folder import compiled_folder, is_trusted, warn_once
from klack.machine.compiling.compilers import InnerCode
from klack.machine.compiling.marked import Marked
from klack.machine.compiling.turn import Turn, take_turn

__all__ = ["CompiledStore"]


_SETTINGS = (
    *("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "LLVM_REFPRUNE_PASS", "BOUNDSCHECK"),
    *("DEBUGINFO_DEFAULT", "ENABLE_AVX", "DISABLE_INTEL_SVML", "CPU_NAME", "CPU_FEATURES"),
)
_COMPILERS = ("klack.machine.compiling.compilers",)
_PLAIN = (bool, int, float, complex, str, bytes, type(None), np.generic)


def code_key(dispatcher: Any, signature: Any, target: tuple[Any, ...]) -> str:
    """Key, 64 hexadecimal digits, of a function for one signature on one kind of processor.

    ``target``: operating system, processor and instruction sets, as numba names them.
    """
    arguments = getattr(signature, "args", signature)
    returns = getattr(signature, "return_type", None)
    parts = [
        _origin(dispatcher),
        *map(_type_words, arguments),
        str(returns),
        repr(target),
        _surroundings(),
    ]
    return _digest(parts)


def _digest(parts: Iterable[str]) -> str:
    found = hashlib.sha256()
    for part in parts:
        found.update(part.encode("utf-8", "surrogatepass") + b"\0")
    return found.hexdigest()


@cache  # fixed while the process lives
def _surroundings() -> str:
    """Versions and settings that decide which code is made."""
    settings = {name: repr(getattr(config, name, None)) for name in _SETTINGS}
    versions = (numba.__version__, llvmlite.__version__, np.__version__, platform.python_version())
    return repr((versions, settings, *map(_file_digest, _COMPILERS)))


def _type_words(kind: Any) -> str:
    """Name of a numba type, with class and fields of a named tuple."""
    if isinstance(kind, types.BaseNamedTuple):
        cls = kind.instance_class
        inner = ", ".join(map(_type_words, kind.types))
        return f"{cls.__module__}.{cls.__qualname__}{cls._fields}({inner})"
    if isinstance(kind, types.BaseTuple):
        return f"({', '.join(map(_type_words, kind))})"
    if isinstance(kind, types.Dispatcher):
        return _origin(kind.dispatcher)
    return str(kind)


@cache  # functions are not rewritten while the process lives
def _origin(dispatcher: Any) -> str:
    """Digest of a function and all that it reaches."""
    known: dict[Any, str] = {}
    left = [dispatcher]
    while left:
        function = left.pop()
        if function not in known:
            known[function], calls = _own_words(function)
            left += calls
    return _digest([known.pop(dispatcher), *sorted(known.values())])


@cache
def _own_words(dispatcher: Any) -> tuple[str, tuple[Any, ...]]:
    """Digest of a function alone, and the compiled ones that it names."""
    function = dispatcher.py_func
    calls: list[Any] = []
    words = [
        _name(dispatcher),
        _value(dispatcher.targetoptions, calls),
        _value(function.__defaults__, calls),
        *_code_words(function.__code__, function.__doc__),
        *(f"{name}={_value(value, calls)}" for name, value in _outside(function)),
    ]
    return _digest(words), tuple(calls)


def _name(dispatcher: Any) -> str:
    return f"{dispatcher.py_func.__module__}.{dispatcher.py_func.__qualname__}"


def _code_words(code: CodeType, text: str | None) -> Iterator[str]:
    yield code.co_code.hex()
    yield repr((code.co_names, code.co_varnames, code.co_freevars, code.co_argcount))
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _code_words(constant, None)
        elif constant != text:
            yield _value(constant, [])


def _outside(function: Any) -> Iterator[tuple[str, Any]]:
    """What a function takes from outside."""
    known = inspect.getclosurevars(function)
    for name in sorted(known.nonlocals):
        yield name, known.nonlocals[name]
    for name in sorted(known.globals):
        value = known.globals[name]
        yield name, value
        if isinstance(value, ModuleType) and _is_own(value.__name__):
            for part in sorted(known.unbound):
                if hasattr(value, part):
                    yield f"{name}.{part}", getattr(value, part)


def _value(value: Any, calls: list[Any]) -> str:
    """Words for a value; compiled functions are added to ``calls``."""
    if isinstance(value, Marked):
        value = value.made
    if isinstance(value, Dispatcher):
        calls.append(value)
        return _name(value)
    if isinstance(value, _PLAIN):
        return f"{type(value).__name__} {value!r}"
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
    if isinstance(value, Mapping):
        return repr(sorted((_value(k, calls), _value(v, calls)) for k, v in value.items()))
    if isinstance(value, (set, frozenset)):
        return repr(sorted(_value(part, calls) for part in value))
    if isinstance(value, (tuple, list)):
        return f"{type(value).__name__} {[_value(part, calls) for part in value]}"
    if isinstance(value, ModuleType):
        return value.__name__
    if isinstance(value, (types.Type, BuiltinFunctionType, np.ufunc)):
        return repr(value)
    fields = getattr(value, "_fields", None)
    if isinstance(value, type) and fields is not None:
        defaults = _value(getattr(value, "_field_defaults", {}), calls)
        return f"{value.__module__}.{value.__qualname__}{fields}{defaults}"
    return _of_file(value)


def _of_file(value: Any) -> str:
    """Class, intrinsic or plain function, by name and content of its file."""
    plain = getattr(value, "_defn", value)  # of an intrinsic
    module = getattr(plain, "__module__", "") or ""
    name = getattr(plain, "__qualname__", type(plain).__qualname__)
    return f"{module}.{name} {_file_digest(module) if _is_own(module) else ''}"


def _is_own(module: str) -> bool:
    return module.partition(".")[0] not in ("numpy", "numba", "math", "cmath", "builtins", "")


@cache
def _file_digest(module: str) -> str:
    file = getattr(sys.modules.get(module), "__file__", None)
    try:
        return hashlib.sha256(Path(file).read_bytes()).hexdigest() if file else module
    except OSError:
        return module


_CHECKSUM = 32  # bytes
_FORMAT = b"klack code 1\n"
_UNREADABLE = (
    *(AttributeError, ImportError, LookupError, TypeError, ValueError, EOFError),
    *(RuntimeError, pickle.PickleError),  # of LLVM, of pickle
)


class CompiledStore(_Cache):
    """Machine code of one function, as numba asks for it."""

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
        """Compiled function, also from a process that compiles it now, or None."""
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
        """Keep compiled code, if possible."""
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
    """Make the folder; return whether code may be kept in it."""
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
    """None for a file that is damaged, or may be another user's."""
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
