"""The decorator of the parts that a compiled time loop is made of."""

from numba import njit

__all__ = ["phase"]

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
phases.  Not to be called from Python.
"""
