"""Mark functions that are compiled when they are first called, and kept for later processes."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numba
from numba import types

from klack.compiling.compiled_store import CompiledStore
from klack.compiling.compilers import EntryCompiler, InnerCompiler

__all__ = ["inner", "njit"]


def njit(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function to machine code at its first call, or load that of an earlier process.

    What is not given is fixed here: numba would take the error model, fast mathematics, inlining
    and the runtime over from whichever compiled function calls it first, so that the code would
    depend on the order in which functions are compiled.

    Parameters
    ----------
    function : callable
    options
        Those of :func:`numba.njit`; ``cache=True`` has no meaning of its own: all are kept, in the
        store of :mod:`klack.compiling.compiled_store`.
    """
    if function is None:
        return partial(njit, **options)
    options.pop("cache", None)
    dispatcher = numba.njit(**(_DEFAULTS | options))(function)
    dispatcher._cache = CompiledStore(dispatcher)
    dispatcher.get_call_template = partial(_call_template, dispatcher)
    return dispatcher


def _call_template(dispatcher: Any, args: Any, kws: Any) -> Any:
    """Template of a call from compiled code: numba would compile anew for every literal number."""
    plain = tuple(map(types.unliteral, args))
    named = {name: types.unliteral(kind) for name, kind in kws.items()}
    return type(dispatcher).get_call_template(dispatcher, plain, named)


_DEFAULTS = {
    "error_model": "python",
    "fastmath": False,
    "forceinline": False,
    "_nrt": True,
    "pipeline_class": EntryCompiler,
    "no_cfunc_wrapper": True,  # the C entry, which only step functions need
}

inner = partial(njit, no_cpython_wrapper=True, pipeline_class=InnerCompiler)
"""Compile a function that only compiled ones call.

Without an entry from Python and machine code of its own it compiles in a quarter of the time, in
less where it is given a bundle of arrays.
"""
