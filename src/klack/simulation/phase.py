"""The decorator of the parts that a compiled time loop is made of."""

from functools import partial

from klack.compiling.jit import njit

__all__ = ["compiled", "phase"]

phase = njit(
    cache=True,
    _nrt=False,
    error_model="numpy",
    forceinline=True,
    no_cpython_wrapper=True,
    no_cfunc_wrapper=True,
)
"""Compile a function into the compiled ones that call it; it makes no array.

Without the runtime of numba: counting the references of all arrays of a bundle costs more than most
phases.  Not to be called from Python.  In the loop of networks bundles of arrays come as
:func:`klack.network.step_function.pointers`: an access to an array also checks for a negative index
and loads a stride.
"""

compiled = partial(njit, cache=True, _nrt=True, error_model="python", forceinline=False)
"""Compile a function that phases call but do not contain.

Says what numba would else take over from whichever function calls it first.
"""

unfolded = njit(inline="always")
"""Write a function out in the one that calls it: for those made of phases, which would else be
optimised once for each of them that contains the other."""
