"""The decorator of the parts that a compiled time loop is made of."""

from klack.machine.compiling.jit import FAST, inner, njit

__all__ = [
    "STATUS_BRANCH",
    "STATUS_DONE",
    "STATUS_ELEMENT",
    "STATUS_FORCES",
    "STATUS_MET",
    "STATUS_PRESSURES",
    "STATUS_REFUSED",
    "STATUS_REPEAT",
    "compiled",
    "phase",
    "sums",
]


phase = inner(_nrt=False, error_model="numpy", forceinline=True)
"""Compile a function into the compiled ones that call it; it makes no array.

Without the runtime of numba: counting the references of all arrays of a bundle costs more than most
phases.  Not to be called from Python.  The loop of networks gives bundles as
:func:`klack.network.step_function.pointers`, since access to an array checks for a negative index
and loads a stride.
"""

sums = inner(_nrt=False, error_model="numpy", forceinline=True, fastmath=FAST)
"""The same for one that sums over many numbers, in any order."""

compiled = inner
"""Compile a function that phases call without inlining it.  Not to be called from Python."""

unfolded = njit(inline="always")
"""Inline a function made of phases, which would else be optimised once for each of them that
contains the other.
"""


STATUS_DONE, STATUS_ELEMENT, STATUS_BRANCH, STATUS_PRESSURES, STATUS_FORCES = 0, 1, 2, 3, 4

STATUS_REFUSED = -1
"""Of a macro step: elements and fluid need fine steps."""

STATUS_MET = -2
"""Of a step that met a touch or a release: bodies need finer ones."""

STATUS_REPEAT = -3
"""Of a step whose guess of the forces of elements and fluid missed too much."""
