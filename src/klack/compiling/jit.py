"""Mark functions that are compiled when they are first called, and kept for later processes."""

from collections.abc import Callable
from typing import Any

import numba

from klack.compiling.compiled_store import CompiledStore

__all__ = ["njit"]


def njit(function: Callable[..., Any] | None = None, **options: Any) -> Any:
    """Compile a function to machine code at its first call, or load that of an earlier process.

    Parameters
    ----------
    function : callable
    options
        Those of :func:`numba.njit`; ``cache=True`` has no meaning of its own: all are kept, in the
        store of :mod:`klack.compiling.compiled_store`.  A function that only compiled ones call
        takes ``no_cpython_wrapper=True, no_cfunc_wrapper=True``: a fifth of the time to compile
        where it is given a bundle of arrays.
    """
    if function is None:
        return lambda given: njit(given, **options)
    options.pop("cache", None)
    dispatcher = numba.njit(**options)(function)
    dispatcher._cache = CompiledStore(dispatcher)
    return dispatcher
