"""How numba compiles klack's functions: its own steps, with four of their costs left out.

- numba compares the options of a function with those of every one before, one by one: a tenth of
  all compiling.
- The garbage collector searches the many objects of a compiler, which live to its end, again and
  again: another tenth.
- Inner functions, which only compiled ones call, become machine code on their own, and again in
  each function that they are linked into.
- They are optimised on their own, and again in each function that they are linked into, though most
  stay what they are: too long to be taken into their caller.
"""

import gc
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import llvmlite.binding as llvm
from numba.core.codegen import CPUCodeLibrary, JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult, Flags

__all__ = ["EntryCompiler", "InnerCode", "InnerCompiler"]


_KIND = "klack inner"


_SHORT = 100
"""Instructions beyond its arguments up to which LLVM may take a function into its callers."""


class _Code(CPUCodeLibrary):
    """A function, and optimised ones that it calls, which it is not optimised with."""

    def __init__(self, codegen: Any, name: str) -> None:
        super().__init__(codegen, name)
        self._reload_init: set[Any] = getattr(self, "_reload_init", set())  # numba 0.60 has none
        self._beside: dict[str, Any] = {}  # each after its callers: LLVM links what is called

    def add_linking_library(self, library: Any) -> None:
        """Take in a library that the function calls."""
        if not isinstance(library, InnerCode):
            super().add_linking_library(library)
            return
        library._ensure_finalized()
        for name, module in library.parts():
            self._beside.pop(name, None)
            self._beside[name] = module
        self._reload_init.update(library._reload_init)
        self._dynamic_globals += library._dynamic_globals
        if library.is_short:
            super().add_linking_library(library)


class EntryCode(_Code, JITCodeLibrary):
    """Machine code of a function and all that it calls."""

    def _optimize_final_module(self) -> None:
        super()._optimize_final_module()
        for module in self._beside.values():
            self._final_module.link_in(module, preserve=True)


class InnerCode(_Code):
    """A function for linking into other functions.

    numba takes it for a library of machine code; what it asks only of those has no effect.
    """

    is_short = True
    """Whether it is to be optimised with its callers."""

    def parts(self) -> Iterator[tuple[str, Any]]:
        """Modules by name that its callers are not optimised with."""
        if not self.is_short:
            yield self._symbol, self._get_module_for_linking()
        yield from self._beside.items()

    def serialize_using_object_code(self) -> tuple[str, str, Any]:
        """Name, kind and content, as numba stores them."""
        self._ensure_finalized()
        beside = {name: module.as_bitcode() for name, module in self._beside.items()}
        own = self._get_module_for_linking().as_bitcode()
        return self.name, _KIND, (own, beside, self.is_short, self._symbol)

    @staticmethod
    def is_stored_in(state: tuple[Any, ...]) -> bool:
        """Whether a stored result is an inner function."""
        return bool(state[0][1] == _KIND)

    @classmethod
    def restored(cls, target_context: Any, state: tuple[Any, ...]) -> CompileResult:
        """Compiled result, from storage."""
        (name, _, content), fndesc, environment, signature, _, lifted, words, reload_init, _ = state
        for prepare in reload_init:
            prepare()
        library = cls(target_context.codegen(), name)
        own, beside, library.is_short, library._symbol = content
        library._final_module = llvm.parse_bitcode(own)
        library._beside = {part: llvm.parse_bitcode(code) for part, code in beside.items()}
        library._reload_init.update(reload_init)
        library._finalize_final_module()
        return CompileResult(
            target_context=target_context,
            typing_context=target_context.typing_context,
            library=library,
            environment=environment,
            entry_point=target_context.get_executable(library, fndesc, environment),
            fndesc=fndesc,
            type_annotation=words,
            signature=signature,
            objectmode=False,
            lifted=lifted,
            typing_error=None,
            call_helper=None,
            metadata=None,
            reload_init=reload_init,
            referenced_envs=(),
        )

    @property
    def codegen(self) -> "InnerCode":
        """Where numba would note objects of machine code."""
        return self

    def set_env(self, name: str, environment: Any) -> None:
        """Refuse Python objects, which need machine code."""
        if environment.consts:
            raise AssertionError(f"inner functions use no objects of Python: {self.name}")

    def get_pointer_to_function(self, name: str) -> int:
        """No address."""
        return 0

    def _optimize_final_module(self) -> None:
        """Optimise once.

        numba's first round, for counted references, comes in the callers.  Without vectorising
        here the time loop is a third slower: loops that are put into a large function first are
        not vectorised there.
        """
        match self._codegen._module_pass_manager():
            case (passes, builder):
                passes.run(self._final_module, builder)
            case passes:  # LLVM 14, of numba 0.60
                passes.run(self._final_module)
        (own,) = filter(_is_new, self._final_module.functions)
        lines, arguments = str(own).count("\n"), len(list(own.arguments))
        self._symbol = own.name
        self.is_short = b"alwaysinline" in b" ".join(own.attributes) or (
            lines <= arguments + _SHORT
        )

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._finalized = True


class _Options(Flags):
    """Options, equal if given alike."""

    def __eq__(self, other: object) -> bool:
        if isinstance(other, _Options):
            return bool(self._values == other._values)
        return bool(super().__eq__(other))

    __hash__ = Flags.__hash__


def _is_new(function: Any) -> bool:
    """Whether a module defines a function, and has not linked it in."""
    return not function.is_declaration and function.linkage == llvm.Linkage.external


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

    code: type[_Code] = EntryCode

    def compile_extra(self, func: Callable[..., Any]) -> Any:
        """Compile a plain function."""
        if self.state.library is None:
            self.state.library = self.code(self.state.targetctx.codegen(), func.__qualname__)
            self.state.library.enable_object_caching()
        with _uncollected():
            return super().compile_extra(func)


class InnerCompiler(EntryCompiler):
    """Compiler of functions that only compiled ones call."""

    code = InnerCode


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
