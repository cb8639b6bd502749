"""Two derivatives that do not follow from the operations."""

from typing import Any

from klack.machine.compiling.jit import intrinsic

__all__ = ["constant", "with_slope_of"]


@intrinsic
def constant(typingctx: Any, number: Any) -> Any:
    """The same number without its derivatives; in compiled code.

    For a first guess, or the length of a piece: a solution has the same derivatives from any guess,
    and so has a sum over any pieces but for the error of the method. Where a guess or a length
    follows from the step before, the rest of their own derivatives would grow from step to step
    without bound.
    """
    from llvmlite import ir

    lanes = getattr(number, "lanes", 0)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        if not lanes:
            return args[0]
        kind, place = ir.VectorType(ir.DoubleType(), lanes), ir.Constant(ir.IntType(32), 0)
        value = builder.extract_element(args[0], place)
        return builder.insert_element(ir.Constant(kind, [0.0] * lanes), value, place)

    return number(number), codegen


@intrinsic
def with_slope_of(typingctx: Any, number: Any, twin: Any) -> Any:
    """The same number with the derivatives of its twin, another way to write it; compiled.

    For a number whose own way loses them, as a root at zero that is multiplied by itself does.
    """
    from llvmlite import ir

    lanes = getattr(number, "lanes", 0)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        if not lanes:
            return args[0]
        place = ir.Constant(ir.IntType(32), 0)
        return builder.insert_element(args[1], builder.extract_element(args[0], place), place)

    return number(number, twin), codegen
