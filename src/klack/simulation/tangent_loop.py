"""The time loop of a network with derivatives beside all its numbers."""

from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from klack.machine.compiling.jit import njit
from klack.machine.compiling.tangent_number import tangent_number, with_tangents
from klack.network.step_function import StepFunction
from klack.simulation.network_kernel import run_network
from klack.simulation.network_record import record_moment
from klack.simulation.phase import unfolded

__all__ = ["LANES", "lanes_of", "run_with_tangents", "start_with_tangents", "tangent_address"]

LANES = 8
"""Numbers of a number with its derivatives: a vector register, or two."""

_ALIGNED = 8 * LANES  # bytes
_POINTER = types.CPointer(tangent_number(LANES))
_STEP = types.int64(_POINTER, _POINTER, _POINTER, _POINTER)

# called as it is, the loop would be optimised and turned into machine code once more for itself
_run = unfolded(run_network.__wrapped__)


@njit(_nrt=False, error_model="numpy")
def run_with_tangents(
    macros: int,
    per_record: int,
    clock: Any,
    M: int,
    near: int,
    R: int,
    origin: Any,
    h: Any,
    allow_macro: bool,
    network: Any,
    recording: Any,
    scratch: Any,
    report: Any,
) -> int:
    """:func:`klack.simulation.network_kernel.run_network` with derivatives.

    Every array of floats, and every float but for those of the compiled code itself, has a last
    axis of :data:`LANES`, made by :func:`lanes_of`; the step functions are those of
    :func:`tangent_address`.
    """
    return _run(
        macros,
        per_record,
        clock,
        M,
        near,
        R,
        with_tangents(LANES, origin),
        with_tangents(LANES, h),
        allow_macro,
        with_tangents(LANES, network),
        with_tangents(LANES, recording),
        with_tangents(LANES, scratch),
        with_tangents(LANES, report),
    )


@njit
def start_with_tangents(recording: Any, now: Any) -> None:
    """:func:`klack.simulation.network_record.record_moment` of the start, with derivatives."""
    record_moment(with_tangents(LANES, recording), 0, with_tangents(LANES, now))


def lanes_of(shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Zeros for numbers with derivatives, aligned for vector registers."""
    count = int(np.prod(shape)) * LANES
    raw = np.zeros(count + LANES)
    first = (-raw.ctypes.data % _ALIGNED) // 8
    return raw[first : first + count].reshape(*shape, LANES)


def tangent_address(step: StepFunction) -> int:
    """Address of a step function for numbers with derivatives; compiled the first time."""
    result = step.get_compile_result(_STEP)
    name = result.fndesc.llvm_cfunc_wrapper_name
    return int(result.library.get_pointer_to_function(name))
