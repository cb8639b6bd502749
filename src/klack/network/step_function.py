"""The one signature of everything that acts in a time step, compiled or in plain Python.

A component hands the solver functions ``step(par, state, inp, out) -> status``; all four are
pointers to ``float64``.

===========  =====================================================================================
``par``      constants that the component chose
``state``    its state at the start of the step; never written
``inp``      element: ``t, h, y0, y1`` and ``y0, y1`` of further ports;
             branch: ``t, h, p_a, p_b, rho_a, rho_b``, then ``y0, y1`` of each mechanical port
``out``      element: ``forces | next state | books``;
             branch: ``mdot, dmdot/dp_a, dmdot/dp_b | forces | next state | books``
===========  =====================================================================================

The step begins at ``t`` [s] and is ``h`` [s] long; ``y0`` and ``y1`` [m] are the displacements of a
port along +z at its ends.  A force [N] is the mean over the step, positive along +z, *on the body*:
the work on the body is exactly ``F (y1 - y0)``.  Pressures [Pa] are absolute and, like their
densities [kg/m^3], those that *act in the step*: between its middle and its end, implicit.  The
mass flow ``mdot`` [kg/s], the mean over the step, runs from a to b.

Energies [J]: a *store* is held at the end of the step; a *supply* came in from outside during it; a
*loss* was turned into heat.  An element must satisfy, to round-off, ``sum F (y1 - y0) + change of
stores = supplies - losses``.  A branch gives only what it stores; the solver adds the rest of the
hydraulic power to its supply, if it names one (a pump), else to its loss.

A function is called several times in a step, with better and better ``y1`` and pressures; the next
state of the last call counts.  Before the first step it is called with ``h = 0`` and ``y0 = y1``,
for the stores only: nothing may be divided by ``h``; and with short steps up to the time zero (``t
= -h``), for the static equilibrium and the first record, without a next state.  Status 0 is
success; any other number stops the run, and the component gives its meaning.
"""

import ctypes
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Vector
from klack.machine.compiling.jit import intrinsic, njit
from klack.machine.compiling.marked import Marked

__all__ = [
    "StepFunction",
    "address_of",
    "call",
    "carray",
    "compile_step",
    "evaluate",
    "first",
    "is_step_function",
    "pointer",
    "pointers",
    "python_step",
    "shift",
    "step_function",
]

StepFunction = Any
"""What :func:`step_function` and :func:`python_step` return."""

PythonStep = Callable[
    [NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    int | None,
]


def step_function(function: Callable[..., int]) -> StepFunction:
    """Compile a step function when a network first has it, not at import.

    It may call other compiled functions and index its pointers.
    """
    step = njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=False)(function)
    step.is_klack_step = True
    return step


@intrinsic
def pointer(typingctx: Any, array: Any, offset: Any) -> Any:
    """Pointer to ``array[offset]``, in compiled code."""
    from numba import types

    signature = types.CPointer(types.float64)(array, offset)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        view = context.make_array(sig.args[0])(context, builder, args[0])
        return builder.gep(view.data, [args[1]])

    return signature, codegen


@intrinsic
def first(typingctx: Any, array: Any) -> Any:
    """Pointer to the first number of a contiguous array, in compiled code.

    Indexing it costs one load: no bounds, no negative indices, no strides.
    """
    from numba import types

    signature = types.CPointer(array.dtype)(array)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return context.make_array(sig.args[0])(context, builder, args[0]).data

    return signature, codegen


@intrinsic
def pointers(typingctx: Any, bundle: Any) -> Any:
    """Named tuple with :func:`first` of every array in it, in compiled code."""
    from numba import types

    members = [types.CPointer(t.dtype) if isinstance(t, types.Array) else t for t in bundle]
    signature = types.BaseTuple.from_types(members, bundle.instance_class)(bundle)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        values = []
        for place, member in enumerate(sig.args[0]):
            value = builder.extract_value(args[0], place)
            if isinstance(member, types.Array):
                value = context.make_array(member)(context, builder, value).data
            values.append(value)
        return context.make_tuple(builder, sig.return_type, values)

    return signature, codegen


@intrinsic
def shift(typingctx: Any, start: Any, offset: Any) -> Any:
    """Pointer ``offset`` numbers further on, in compiled code."""
    signature = start(start, offset)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return builder.gep(args[0], [args[1]])

    return signature, codegen


@intrinsic
def call(typingctx: Any, address: Any, par: Any, state: Any, inp: Any, out: Any) -> Any:
    """Call the step function at an address of :func:`address_of`, in compiled code."""
    from llvmlite import ir
    from numba import types

    signature = types.int64(address, par, state, inp, out)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        kinds = [context.get_value_type(kind) for kind in sig.args[1:]]
        prototype = ir.FunctionType(context.get_value_type(types.int64), kinds)
        function = builder.inttoptr(args[0], prototype.as_pointer())
        return builder.call(function, args[1:])

    return signature, codegen


def _array(make: Any) -> Any:
    import numba

    return numba.carray


carray = Marked(lambda pointer, shape: None, _array)
"""Array of a shape at a pointer, in compiled code: :func:`numba.carray`."""


def is_step_function(found: object) -> bool:
    """Whether something is what :func:`step_function` returned."""
    return getattr(found, "is_klack_step", False) is True


def compile_step(step: StepFunction) -> None:
    """Compile a step function, or load it."""
    _compiled(step)


def _compiled(step: StepFunction) -> Any:
    from numba import types

    return step.get_compile_result(types.int64(*4 * [types.CPointer(types.float64)]))


def address_of(step: StepFunction) -> int:
    """Address of the C entry of a step function; valid as long as the function is kept.

    Compiles it, or loads it, the first time.
    """
    if isinstance(step, _PythonStep):
        return step.address
    if "address" not in vars(step):
        result = _compiled(step)
        name = result.fndesc.llvm_cfunc_wrapper_name
        step.address = int(result.library.get_pointer_to_function(name))
    return int(step.address)


@njit
def _call(address: int, par: Vector, state: Vector, inp: Vector, out: Vector) -> int:
    return int(call(address, first(par), first(state), first(inp), first(out)))


def evaluate(
    step: StepFunction, parameters: Any, state: Any, inputs: Any, outputs: int
) -> tuple[int, Vector]:
    """Call a step function once from Python, for tests and pictures: its status and ``out``."""
    arrays = [np.array([*values, 0.0], dtype=float) for values in (parameters, state, inputs)]
    out = np.zeros(outputs)
    return _call(address_of(step), *arrays, out), out


class _PythonStep:
    """A Python function behind a C address for the solver."""

    def __init__(self, function: PythonStep, sizes: tuple[int, int, int, int]) -> None:
        self.errors: list[BaseException] = []
        pointer = ctypes.POINTER(ctypes.c_double)
        prototype = ctypes.CFUNCTYPE(ctypes.c_int64, pointer, pointer, pointer, pointer)

        def call(*addresses: Any) -> int:
            arrays = [
                np.ctypeslib.as_array(address, (size,))
                for address, size in zip(addresses, sizes, strict=True)
            ]
            for array in arrays[:3]:
                array.flags.writeable = False
            try:
                return int(function(*arrays) or 0)
            except BaseException as error:  # an exception cannot pass through the compiled loop
                self.errors.append(error)
                return -1

        self._callback = prototype(call)

    @property
    def address(self) -> int:
        """Where the compiled loop calls it."""
        address = ctypes.cast(self._callback, ctypes.c_void_p).value
        assert address is not None
        return address


def python_step(
    function: PythonStep, *, parameters: int, states: int, inputs: int, outputs: int
) -> StepFunction:
    """Use a plain Python function in the time loop: about 2 us per call.

    ``function(par, state, inp, out)`` has numpy arrays of these lengths, the first three read-only;
    it writes ``out`` and returns a status or None.  An exception stops the run and is raised again.
    """
    return _PythonStep(function, (parameters, states, inputs, outputs))
