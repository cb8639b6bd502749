"""The decorator of the parts that the time loop of a network is made of."""

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
"""Compile a function into those compiled ones that call it, without the runtime of numba.

Bundles of arrays come as :func:`klack.network.step_function.pointers`: an access to an array checks
for a negative index and loads a stride, and handing it over counts references.
"""
