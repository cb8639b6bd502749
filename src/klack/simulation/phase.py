"""The decorator of the parts that a compiled time loop is made of."""

from klack.compiling.jit import inner, njit

__all__ = ["compiled", "phase"]

phase = inner(_nrt=False, error_model="numpy", forceinline=True)
"""Compile a function into the compiled ones that call it; it makes no array.

Without the runtime of numba: counting the references of all arrays of a bundle costs more than most
phases.  Not to be called from Python.  In the loop of networks bundles of arrays come as
:func:`klack.network.step_function.pointers`: an access to an array also checks for a negative index
and loads a stride.
"""

compiled = inner
"""Compile a function that phases call but do not contain.  Not to be called from Python."""

unfolded = njit(inline="always")
"""Write a function out in the one that calls it: for those made of phases, which would else be
optimised once for each of them that contains the other."""
