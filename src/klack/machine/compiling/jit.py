"""Marks of functions to be compiled at the first call and kept."""

from collections.abc import Callable
from functools import partial
from typing import Any

from klack.machine.compiling.marked import Marked

__all__ = ["FAST", "inner", "intrinsic", "njit", "of_one_kind"]

FAST = {"contract", "reassoc", "nsz", "arcp"}
"""For sums and products over many numbers: they may use vector registers, in any order."""


def njit(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function to machine code at its first call, or load that of an earlier process.

    numba would take options that are not given here (error model, fast mathematics, inlining,
    runtime) from whichever compiled function calls it first.

    Parameters
    ----------
    options
        Those of :func:`numba.njit`; ``cache`` has no effect, since all are kept.
    """
    return _marked(function, _entry, options)


def inner(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function that only compiled ones call.

    Without an entry from Python and machine code of its own it compiles in a quarter of the
    time, in less where it is given a bundle of arrays.
    """
    return _marked(function, _inner, options)


def of_one_kind(function: Marked) -> Callable[..., Any]:
    """Return a compiled function for one caller, whose arguments never change their types.

    It looks at them in the first call only: bundles of two hundred arrays cost 3 us a call then
    instead of 35 us.
    """
    code: list[Callable[..., Any]] = []

    def call(*arguments: Any) -> Any:
        if not code:
            made = function.made
            code.append(made.compile(tuple(map(made.typeof_pyval, arguments))))
        return code[0](*arguments)

    return call


def intrinsic(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Mark a function that writes the code of its calls: :func:`numba.extending.intrinsic`."""
    return _marked(function, _intrinsic, options)


def _marked(
    function: Callable[..., Any] | None, make: Callable[..., Any], options: dict[str, Any]
) -> Any:
    options.pop("cache", None)
    making = partial(make, **options)
    return partial(Marked, make=making) if function is None else Marked(function, making)


def _entry(function: Callable[..., Any], **options: Any) -> Any:
    from klack.machine.compiling.compilers import EntryCompiler

    return _dispatcher(function, pipeline_class=EntryCompiler, **options)


def _inner(function: Callable[..., Any], **options: Any) -> Any:
    from klack.machine.compiling.compilers import InnerCompiler

    return _dispatcher(function, no_cpython_wrapper=True, pipeline_class=InnerCompiler, **options)


def _intrinsic(function: Callable[..., Any], **options: Any) -> Any:
    from numba.extending import intrinsic

    return (intrinsic(**options) if options else intrinsic)(function)


def _dispatcher(function: Callable[..., Any], **options: Any) -> Any:
    import numba

    from klack.machine.compiling.compiled_store import CompiledStore

    dispatcher = numba.njit(**(_DEFAULTS | options))(function)
    dispatcher._cache = CompiledStore(dispatcher)
    dispatcher.get_call_template = partial(_call_template, dispatcher)
    return dispatcher


def _call_template(dispatcher: Any, args: Any, kws: Any) -> Any:
    """Call template: numba would compile anew for every literal number."""
    from numba import types

    plain = tuple(map(types.unliteral, args))
    named = {name: types.unliteral(kind) for name, kind in kws.items()}
    return type(dispatcher).get_call_template(dispatcher, plain, named)


_DEFAULTS = {
    "error_model": "python",
    "fastmath": False,
    "forceinline": False,
    "_nrt": True,
    "no_cfunc_wrapper": True,  # the C entry, which only step functions need
}
