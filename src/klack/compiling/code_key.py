"""Key of machine code: everything that it was made from.

What a function calls is compiled into it.  So its key holds the code, the constants and the options
of all functions that it reaches, wherever they are written; a file that only differs in its texts
keeps the key.
"""

import hashlib
import inspect
import platform
import sys
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from types import BuiltinFunctionType, CodeType, ModuleType
from typing import Any

import llvmlite
import numba
import numpy as np
from numba import types
from numba.core import config
from numba.core.dispatcher import Dispatcher

from klack.compiling.marked import Marked

__all__ = ["code_key"]

_SETTINGS = (
    *("OPT", "LOOP_VECTORIZE", "SLP_VECTORIZE", "LLVM_REFPRUNE_PASS", "BOUNDSCHECK"),
    *("DEBUGINFO_DEFAULT", "ENABLE_AVX", "DISABLE_INTEL_SVML", "CPU_NAME", "CPU_FEATURES"),
)
_COMPILERS = ("klack.compiling.compilers", "klack.compiling.inner_code")
_PLAIN = (bool, int, float, complex, str, bytes, type(None), np.generic)


def code_key(dispatcher: Any, signature: Any, target: tuple[Any, ...]) -> str:
    """Key of a function for one signature on one kind of processor.

    Parameters
    ----------
    dispatcher : numba.core.dispatcher.Dispatcher
    signature : tuple of numba types, or a numba signature
    target : tuple
        Operating system, processor and instruction sets, as numba names them.

    Returns
    -------
    str
        64 hexadecimal digits.
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
    """Name of a numba type; of a named tuple also its class and fields, which numba leaves out."""
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
    """Digest of a function and of all that it reaches."""
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
    """Digest of a function alone, and the compiled functions that it names."""
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
    """Words for what is behind a name; compiled functions are added to ``calls``."""
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
    """A class, an intrinsic or a plain function: by its name and the content of its file."""
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
