"""How numba compiles klack's functions: its own steps, with three of their costs left out.

- numba compares the options of the function that it compiles with those of every function that it
  has compiled before, one option after another: a tenth of all compiling.
- The garbage collector searches the many objects of a compiler, which live until its end, again and
  again: another tenth.
- Inner functions are optimised and turned into machine code on their own, and then once more in
  each function that calls them (:mod:`klack.compiling.inner_code`).
"""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba.core.compiler import Compiler, Flags

from klack.compiling.inner_code import InnerCode

__all__ = ["EntryCompiler", "InnerCompiler"]


class _Options(Flags):
    """Options of a function, equal if the same ones were given."""

    def __eq__(self, other: object) -> bool:
        if isinstance(other, _Options):
            return bool(self._values == other._values)
        return bool(super().__eq__(other))

    __hash__ = Flags.__hash__


class EntryCompiler(Compiler):
    """Compile a function that Python calls."""

    def __init__(
        self,
        typingctx: Any,
        targetctx: Any,
        library: Any,
        args: Any,
        return_type: Any,
        flags: Any,
        locals: Any,
    ) -> None:
        options = _Options(flags)
        super().__init__(typingctx, targetctx, library, args, return_type, options, locals)

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        """Compile a plain function."""
        with _uncollected():
            return super().compile_extra(func)


class InnerCompiler(EntryCompiler):
    """Compile a function that only compiled ones call."""

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        """Compile a plain function as far as its callers need it."""
        self.state.library = InnerCode(self.state.targetctx.codegen(), func.__qualname__)
        return super().compile_extra(func)


@contextmanager
def _uncollected() -> Iterator[None]:
    """Without the garbage collector."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()
