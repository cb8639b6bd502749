"""A number with its derivatives in some directions, as a type of compiled code.

Compiled for such numbers in place of plain ones, a function carries exact tangents (forward
mode): every operation follows the rules of calculus beside the value, and every decision is
that of the value alone.  No derivative is written by hand.

Value and derivatives are the lanes of one vector register, the value first.
"""

import math
import operator
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed, lower_builtin, lower_cast
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, models, register_model

__all__ = ["TangentNumber", "tangent_number", "with_tangents"]

_RULES = sha256(Path(__file__).read_bytes()).hexdigest()[:12]
"""Part of the type name, and so of all keys of its machine code."""


class TangentNumber(types.Type):  # as a number, numba would ask NumPy for its kind
    """Numba type of a number with derivatives; ``lanes`` is their count plus one."""

    def __init__(self, lanes: int) -> None:
        self.lanes = lanes
        super().__init__(name=f"tangent{lanes}x{_RULES}")

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        """A plain number is one whose derivatives are zero.

        The conversion is never exact: a function compiled for both would take the tangents.
        """
        if isinstance(other, types.Integer | types.Float):
            return max(typingctx.can_convert(other, types.float64), Conversion.safe)
        return None

    def unify(self, typingctx: Any, other: Any) -> Any:
        """Common type with a plain number."""
        return self if isinstance(other, types.Integer | types.Float) else None


@cache  # numba compares types by identity
def tangent_number(lanes: int) -> TangentNumber:
    """Type of a number with ``lanes - 1`` derivatives."""
    return TangentNumber(lanes)


@register_model(TangentNumber)
class _Model(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: TangentNumber) -> None:
        super().__init__(dmm, fe_type, ir.VectorType(ir.DoubleType(), fe_type.lanes))


_INDEX = ir.IntType(32)
_REAL = ir.DoubleType()


class _Lanes:
    """Rules of calculus for vectors of one length."""

    def __init__(self, context: Any, builder: Any, kind: TangentNumber) -> None:
        self.context, self.builder, self.count = context, builder, kind.lanes
        self.vector = ir.VectorType(_REAL, kind.lanes)

    def value(self, x: Any) -> Any:
        """First lane."""
        return self.builder.extract_element(x, ir.Constant(_INDEX, 0))

    def spread(self, a: Any) -> Any:
        """A plain number in all lanes."""
        undefined = ir.Constant(self.vector, ir.Undefined)
        one = self.builder.insert_element(undefined, a, ir.Constant(_INDEX, 0))
        mask = ir.Constant(ir.VectorType(_INDEX, self.count), [0] * self.count)
        return self.builder.shuffle_vector(one, undefined, mask)

    def with_value(self, x: Any, a: Any) -> Any:
        """The same derivatives with another value."""
        return self.builder.insert_element(x, a, ir.Constant(_INDEX, 0))

    def plain(self, a: Any) -> Any:
        """A plain number: its derivatives are zero."""
        return self.with_value(ir.Constant(self.vector, [0.0] * self.count), a)

    def scaled(self, x: Any, a: Any) -> Any:
        """All lanes times a plain number."""
        return self.builder.fmul(x, self.spread(a))

    def follow(self, value: Any, x: Any, slope: Any) -> Any:
        """``f(x)`` from its value and its slope."""
        return self.with_value(self.scaled(x, slope), value)

    def add(self, x: Any, y: Any) -> Any:
        """Sum."""
        return self.builder.fadd(x, y)

    def sub(self, x: Any, y: Any) -> Any:
        """Difference."""
        return self.builder.fsub(x, y)

    def mul(self, x: Any, y: Any) -> Any:
        """Product."""
        b, a, c = self.builder, self.value(x), self.value(y)
        tangents = b.fadd(b.fmul(self.spread(a), y), b.fmul(self.spread(c), x))
        return self.with_value(tangents, b.fmul(a, c))

    def div(self, x: Any, y: Any) -> Any:
        """Quotient."""
        b, a, c = self.builder, self.value(x), self.value(y)
        quotient = b.fdiv(a, c)
        left = b.fsub(x, self.scaled(y, quotient))
        return self.with_value(b.fdiv(left, self.spread(c)), quotient)

    def call(self, function: Any, *args: Any) -> Any:
        """A function of plain numbers."""
        plain = signature(types.float64, *([types.float64] * len(args)))
        self.context.typing_context.resolve_function_type(
            self.context.typing_context.resolve_value_type(function), plain.args, {}
        )
        return self.context.get_function(function, plain)(self.builder, args)

    def chosen(self, condition: Any, a: Any, c: Any) -> Any:
        """``a`` where it is true, else ``c``."""
        return self.builder.select(condition, a, c)


def _real(value: float) -> Any:
    return ir.Constant(_REAL, value)


# --------------------------------------------------------------------------- arithmetic


def _lifted(args: Any) -> TangentNumber | None:
    found = [kind for kind in args if isinstance(kind, TangentNumber)]
    others = [kind for kind in args if not isinstance(kind, TangentNumber)]
    if not found or not all(isinstance(k, types.Integer | types.Float) for k in others):
        return None
    return found[0]


def _typed(function: Any, resolve: Callable[[Any], Any]) -> None:
    """Give a function the signature that ``resolve`` finds, or None."""

    @infer_global(function)
    class _Template(AbstractTemplate):
        key = function

        def generic(self, args: Any, kws: Any) -> Any:
            return resolve(args)


def _of_two(args: Any) -> Any:
    kind = _lifted(args)
    if kind is None or len(args) != 2:
        return None
    return signature(kind, *(types.float64 if _is_plain(a) else a for a in args))


def _of_one(result: Any) -> Callable[[Any], Any]:
    """Signature of a function of one number; ``result`` None: the same type."""
    return lambda args: (
        signature(result or args[0], args[0])
        if len(args) == 1 and isinstance(args[0], TangentNumber)
        else None
    )


def _lowered(rule: Callable[..., Any], *functions: Any) -> None:
    """Both operands with derivatives, or one plain."""
    pairs = ((TangentNumber, TangentNumber), (TangentNumber, types.Float))
    for function in functions:
        for pair in (*pairs, (types.Float, TangentNumber)):

            @lower_builtin(function, *pair)
            def _impl(context: Any, builder: Any, sig: Any, args: Any) -> Any:
                return rule(_Lanes(context, builder, sig.return_type), sig.args, args)


def _is_plain(kind: Any) -> bool:
    return not isinstance(kind, TangentNumber)


def _add(of: _Lanes, kinds: Any, args: Any) -> Any:
    x, y = args
    if _is_plain(kinds[0]):
        x, y = y, x
    if _is_plain(kinds[0]) or _is_plain(kinds[1]):
        return of.with_value(x, of.builder.fadd(of.value(x), y))
    return of.add(x, y)


def _sub(of: _Lanes, kinds: Any, args: Any) -> Any:
    x, y = args
    if _is_plain(kinds[1]):
        return of.with_value(x, of.builder.fsub(of.value(x), y))
    if _is_plain(kinds[0]):
        x = of.plain(x)
    return of.sub(x, y)


def _mul(of: _Lanes, kinds: Any, args: Any) -> Any:
    x, y = args
    if _is_plain(kinds[0]):
        return of.scaled(y, x)
    if _is_plain(kinds[1]):
        return of.scaled(x, y)
    return of.mul(x, y)


def _div(of: _Lanes, kinds: Any, args: Any) -> Any:
    x, y = args
    if _is_plain(kinds[1]):
        return of.builder.fdiv(x, of.spread(y))
    if _is_plain(kinds[0]):
        x = of.plain(x)
    return of.div(x, y)


def _pow(of: _Lanes, kinds: Any, args: Any) -> Any:
    """``x^y``; a base of zero has the slope of a constant exponent."""
    x, y = args
    a = x if _is_plain(kinds[0]) else of.value(x)
    c = y if _is_plain(kinds[1]) else of.value(y)
    value = of.call(operator.pow, a, c)
    found = of.plain(value)
    b = of.builder
    if not _is_plain(kinds[0]):
        slope = b.fmul(c, of.call(operator.pow, a, b.fsub(c, _real(1.0))))
        found = of.follow(value, x, slope)
    if not _is_plain(kinds[1]):
        positive = b.fcmp_ordered(">", a, _real(0.0))
        safe = of.chosen(positive, a, _real(1.0))
        slope = b.fmul(value, of.call(math.log, safe))
        found = of.with_value(b.fadd(found, of.scaled(y, slope)), value)
    return found


for _rule, _functions in (
    (_add, (operator.add, operator.iadd)),
    (_sub, (operator.sub, operator.isub)),
    (_mul, (operator.mul, operator.imul)),
    (_div, (operator.truediv, operator.itruediv)),
    (_pow, (operator.pow, operator.ipow)),
):
    for _function in _functions:
        _typed(_function, _of_two)
    _lowered(_rule, *_functions)


def _compared(function: Any, sign: str) -> None:
    def resolve(args: Any) -> Any:
        kinds = (types.float64 if _is_plain(a) else a for a in args)
        return None if _lifted(args) is None else signature(types.boolean, *kinds)

    _typed(function, resolve)

    def impl(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        plain = [
            arg if _is_plain(kind) else _Lanes(context, builder, kind).value(arg)
            for kind, arg in zip(sig.args, args, strict=True)
        ]
        compare = builder.fcmp_unordered if sign == "!=" else builder.fcmp_ordered
        return compare(sign, *plain)

    for pair in (
        (TangentNumber, TangentNumber),
        (TangentNumber, types.Float),
        (types.Float, TangentNumber),
    ):
        lower_builtin(function, *pair)(impl)


for _operator, _sign in (
    (operator.lt, "<"),
    (operator.le, "<="),
    (operator.gt, ">"),
    (operator.ge, ">="),
    (operator.eq, "=="),
    (operator.ne, "!="),
):
    _compared(_operator, _sign)


# --------------------------------------------------------------------------- functions


def _absolute(of: _Lanes, x: Any) -> Any:
    below = of.builder.fcmp_ordered("<", of.value(x), _real(0.0))
    found = of.chosen(below, of.builder.fneg(x), x)
    return of.with_value(found, of.call(abs, of.value(x)))


def _smooth(
    function: Any, slope: Callable[[_Lanes, Any, Any], Any]
) -> Callable[[_Lanes, Any], Any]:
    """Rule of a function whose slope follows from argument and value."""

    def rule(of: _Lanes, x: Any) -> Any:
        a = of.value(x)
        value = of.call(function, a)
        return of.follow(value, x, slope(of, a, value))

    return rule


def _slope_of_root(of: _Lanes, a: Any, root: Any) -> Any:
    """Zero, without a slope, gets zero, as where a product has one."""
    slope = of.builder.fdiv(_real(0.5), root)
    return of.chosen(of.builder.fcmp_ordered(">", root, _real(0.0)), slope, _real(0.0))


def _lowered_alone(function: Any, result: Any, rule: Callable[[_Lanes, Any], Any]) -> None:
    _typed(function, _of_one(result))

    @lower_builtin(function, TangentNumber)
    def _impl(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        return rule(_Lanes(context, builder, sig.args[0]), args[0])


_ONE = _real(1.0)
_SLOPES: tuple[tuple[Any, Callable[[_Lanes, Any, Any], Any]], ...] = (
    (math.sqrt, _slope_of_root),
    (math.exp, lambda of, a, value: value),
    (math.log, lambda of, a, value: of.builder.fdiv(_ONE, a)),
    (math.log1p, lambda of, a, value: of.builder.fdiv(_ONE, of.builder.fadd(_ONE, a))),
    (math.expm1, lambda of, a, value: of.builder.fadd(value, _ONE)),
    (math.sin, lambda of, a, value: of.call(math.cos, a)),
    (math.cos, lambda of, a, value: of.builder.fneg(of.call(math.sin, a))),
    (math.tanh, lambda of, a, value: of.builder.fsub(_ONE, of.builder.fmul(value, value))),
    (
        math.atan,
        lambda of, a, value: of.builder.fdiv(_ONE, of.builder.fadd(_ONE, of.builder.fmul(a, a))),
    ),
)
for _plain, _result, _alone in (
    (operator.neg, None, lambda of, x: of.builder.fneg(x)),
    (operator.pos, None, lambda of, x: x),
    (float, None, lambda of, x: x),
    (abs, None, _absolute),
    (math.fabs, None, _absolute),
    (bool, types.boolean, lambda of, x: of.builder.fcmp_unordered("!=", of.value(x), _real(0.0))),
    (
        int,
        types.intp,
        lambda of, x: of.context.cast(of.builder, of.value(x), types.float64, types.intp),
    ),
    *((function, None, _smooth(function, slope)) for function, slope in _SLOPES),
):
    _lowered_alone(_plain, _result, _alone)


@lower_cast(types.Integer, TangentNumber)
@lower_cast(types.Float, TangentNumber)
def _from_plain(context: Any, builder: Any, fromty: Any, toty: Any, value: Any) -> Any:
    number = context.cast(builder, value, fromty, types.float64)
    return _Lanes(context, builder, toty).plain(number)


def _extreme(function: Any, sign: str) -> None:
    def resolve(args: Any) -> Any:
        kind = _lifted(args)
        return None if kind is None or len(args) < 2 else signature(kind, *([kind] * len(args)))

    _typed(function, resolve)

    @lower_builtin(function, types.VarArg(TangentNumber))
    def _impl(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        of = _Lanes(context, builder, sig.return_type)
        found = args[0]
        for arg in args[1:]:  # as Python: the first of equal ones, and not what is no number
            better = builder.fcmp_ordered(sign, of.value(arg), of.value(found))
            found = of.chosen(better, arg, found)
        return found


_extreme(max, ">")
_extreme(min, "<")


# --------------------------------------------------------------------------- arrays and bundles


def _with(kind: Any, number: TangentNumber) -> Any:
    """Type of a bundle whose float arrays have lanes along the last axis."""
    if isinstance(kind, types.Array) and kind.dtype == types.float64:
        return number if kind.ndim == 1 else types.Array(number, kind.ndim - 1, "C")
    if isinstance(kind, types.NamedTuple | types.NamedUniTuple):
        parts = [_with(part, number) for part in kind.types]
        return types.BaseTuple.from_types(parts, kind.instance_class)
    return kind


@intrinsic(prefer_literal=True)
def with_tangents(typingctx: Any, lanes: Any, given: Any) -> Any:
    """Take arrays of floats as arrays of numbers with derivatives, in compiled code.

    ``lanes`` (a literal) is the length of the last axis of each; the memory stays the same, and
    must begin at a multiple of the size of a vector.  An array with this axis alone is one
    number. ``given`` is an array or a named tuple of arrays and of such bundles; what is whole
    stays.
    """
    if not isinstance(lanes, types.IntegerLiteral):
        return None
    number = tangent_number(lanes.literal_value)

    def codegen(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        found = _taken(context, builder, sig.args[1], sig.return_type, args[1])
        return impl_ret_borrowed(context, builder, sig.return_type, found)

    return _with(given, number)(lanes, given), codegen


def _taken(context: Any, builder: Any, was: Any, kind: Any, value: Any) -> Any:
    if was == kind:
        return value
    if isinstance(was, types.NamedTuple | types.NamedUniTuple):
        parts = [
            _taken(context, builder, a, b, builder.extract_value(value, place))
            for place, (a, b) in enumerate(zip(was.types, kind.types, strict=True))
        ]
        return context.make_tuple(builder, kind, parts)
    old = context.make_array(was)(context, builder, value)
    if not isinstance(kind, types.Array):
        return builder.load(builder.bitcast(old.data, context.get_value_type(kind).as_pointer()))
    new = context.make_array(kind)(context, builder)
    size = context.get_abi_sizeof(context.get_data_type(kind.dtype))
    shape = cgutils.unpack_tuple(builder, old.shape, was.ndim)[:-1]
    strides = cgutils.unpack_tuple(builder, old.strides, was.ndim)[:-1]
    lanes = ir.Constant(old.nitems.type, kind.dtype.lanes)
    new.data = builder.bitcast(old.data, new.data.type)
    new.nitems = builder.sdiv(old.nitems, lanes)
    new.itemsize = ir.Constant(old.itemsize.type, size)
    new.shape = cgutils.pack_array(builder, shape)
    new.strides = cgutils.pack_array(builder, strides)
    new.meminfo, new.parent = old.meminfo, old.parent
    return new._getvalue()
