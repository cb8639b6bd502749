"""Expressions with units; truth: exact fractions, Python's arithmetic, powers of base units."""

import math
import random
import time
from fractions import Fraction

import pytest
from draws import each

from klack.case.expressions.dimension import dimension_of
from klack.case.expressions.expression import Expression
from klack.errors import InputError
from klack.units import KINDS, parse_quantity

# unit: exact size in SI, powers of (m, kg, s)
UNITS = {
    "mm": (Fraction(1, 1000), (1, 0, 0)),
    "um": (Fraction(1, 10**6), (1, 0, 0)),
    "g": (Fraction(1, 1000), (0, 1, 0)),
    "ms": (Fraction(1, 1000), (0, 0, 1)),
    "bar": (Fraction(10**5), (-1, 1, -2)),
    "N/mm": (Fraction(1000), (0, 1, -2)),
    "g/cm^3": (Fraction(1000), (-3, 1, 0)),
    "mm^2": (Fraction(1, 10**6), (2, 0, 0)),
    "l/min": (Fraction(1, 60000), (3, 0, -1)),
}
NAMES = {"a": (Fraction(3, 2), "mm"), "p": (Fraction(25), "bar"), "n": (Fraction(4), "")}
KNOWN = {
    "a": dimension_of("m"),
    "p": dimension_of("Pa"),
    "n": dimension_of("-"),
}
SI = {"a": 1.5e-3, "p": 25e5, "n": 4.0}
ZERO = (0, 0, 0)


def drawn(rng: random.Random, depth: int) -> tuple[str, Fraction, tuple]:
    """Text, exact value and powers of (m, kg, s) of a random expression that is valid."""
    kind = rng.choice(["number", "quantity", "name"]) if depth == 0 else rng.choice("+-*/^(fs")
    if kind == "number":
        number = Fraction(rng.randint(1, 999), rng.choice([1, 10, 100]))
        return f"{float(number):g}", number, ZERO
    if kind == "quantity":
        unit = rng.choice(list(UNITS))
        number = Fraction(rng.randint(1, 999), rng.choice([1, 10, 100]))
        blank = rng.choice(["", " "])
        return f"{float(number):g}{blank}{unit}", number * UNITS[unit][0], UNITS[unit][1]
    if kind == "name":
        name = rng.choice(list(NAMES))
        number, unit = NAMES[name]
        size, powers = UNITS.get(unit, (Fraction(1), ZERO))
        return name, number * size, powers
    left, x, of_x = drawn(rng, depth - 1)
    if kind == "(":
        return f"({left})", x, of_x
    if kind == "s":
        return f"-({left})", -x, of_x
    if kind == "^":
        power = rng.choice([2, 3, -1])
        if x == 0:
            return left, x, of_x
        return f"({left})^{power}", x**power, tuple(power * p for p in of_x)
    right, y, of_y = drawn(rng, depth - 1)
    if kind == "*":
        return f"({left}) * ({right})", x * y, tuple(p + q for p, q in zip(of_x, of_y, strict=True))
    if kind == "/" and y != 0:
        return f"({left}) / ({right})", x / y, tuple(p - q for p, q in zip(of_x, of_y, strict=True))
    if of_x != of_y:  # made of one kind, by a factor of the size of the other
        right, y, of_y = f"2 * ({left})", 2 * x, of_x
    if kind == "f":
        word, pick = rng.choice([("min", min), ("max", max)])
        return f"{word}({left}, {right})", pick(x, y), of_x
    sign = rng.choice("+-")
    return f"({left}) {sign} ({right})", x + y if sign == "+" else x - y, of_x


def base_powers_of(found: Expression) -> tuple:
    powers = dict(found.dimension(KNOWN).powers)
    return tuple(powers.get(base, 0) for base in ("m", "kg", "s"))


@pytest.mark.slow
def test_thousands_of_valid_expressions_have_their_exact_value_and_dimension():
    rng = random.Random(7)
    seen = 0
    for _ in range(4000):
        text, exact, powers = drawn(rng, rng.randint(0, 4))
        if len(text) > 450 or (exact != 0 and not 1e-200 < abs(exact) < 1e200):
            continue
        expression = Expression.parse(text)
        try:
            value = expression.value(SI)
        except InputError:  # a difference that is zero but for rounding, and divided by
            continue
        seen += 1
        if "-" not in text:
            assert value == pytest.approx(float(exact), rel=1e-13, abs=0.0), text
        if exact != 0:
            assert base_powers_of(expression) == powers, text
    assert seen > 3000


@each("kind", KINDS)
def test_a_literal_is_the_quantity_of_a_case_to_the_bit(kind):
    rng = random.Random(3)
    for unit in kind.common:
        for _ in range(20):
            text = f"{rng.randint(1, 99999) / 100:g} {unit}"
            found = Expression.parse(text)
            if unit == "degC":
                assert found.value({}) == round(float(text.split()[0]) + 273.15, 6)
                continue
            assert found.value({}) == parse_quantity(text, kind), text
            assert found.unit({}).fits(kind.unit), text


@each(
    ("text", "value", "unit"),
    [
        ("2 * 0.3 mm + 10 um", 6.1e-4, "m"),
        ("pi/4 * (1.3 mm)^2", math.pi / 4 * 1.3e-3**2, "m^2"),
        ("sqrt(2 * 9.81 m/s^2 * 1 m)", math.sqrt(19.62), "m/s"),
        ("(8 mm^3)^(1/3)", 2e-3, "m"),
        ("3 mm / 2 mm", 1.5, "-"),
        ("10 N / 5 N/mm", 2e-3, "m"),
        ("1 / 50 Hz", 0.02, "s"),
        ("2 * pi * 50 Hz", 100 * math.pi, "1/s"),
        ("sin(30 deg)", 0.5, "-"),
        ("2 * asin(0.5)", math.pi / 3, "rad"),
        ("atan(1) * 4", math.pi, "-"),
        ("ln(exp(2))", 2.0, "-"),
        ("log10(1000)", 3.0, "-"),
        ("acos(0)", math.pi / 2, "rad"),
        ("5 %", 0.05, "-"),
        ("2000 1/min", 2000 / 60, "1/s"),
        ("20 degC", 293.15, "K"),
        ("300 K - 10 K", 290.0, "K"),
        ("2mm^2", 2e-6, "m^2"),
        ("-2 mm", -2e-3, "m"),
        ("2 kg*m/s^2", 2.0, "N"),
    ],
)
def test_value_and_unit(text, value, unit):
    found = Expression.parse(text)

    assert found.value({}) == pytest.approx(value, rel=1e-14, abs=0.0)
    assert found.unit({}).fits(unit)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1 mm + 1 bar", "'1 mm' is a length [m] and '1 bar' is a pressure [Pa]"),
        ("2 + 1 mm", "'2' is a number without a unit and '1 mm' is a length [m]"),
        ("max(1 mm, 2 N)", "'2 N' is a force [N]"),
        ("sqrt(2 mm) + 1 mm", "a quantity in m^"),
        ("exp(1 mm)", "a length [m] in 'exp(1 mm)'"),
        ("2 ^ 1 mm", "a length [m] as exponent"),
        ("1 Hz + 1 1/s", "a frequency [Hz]"),
        ("1 deg + 1", "an angle [rad]"),
        ("(1 mm)^13", "to the power 13"),
    ],
)
def test_what_does_not_go_together_names_both_and_the_place(text, said):
    with pytest.raises(InputError) as caught:
        Expression.parse("0 * (" + text + ")", "case.yaml:3: key").unit({})

    assert said in caught.value.got
    assert "(character 6 of" in caught.value.got
    assert caught.value.where == "case.yaml:3: key"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("2 * m", ""),
        ("3 m * 2", "'m' is a unit and a parameter"),
        ("1 N/m", "'m' is a unit and a parameter"),
        ("1 N/ m", ""),
    ],
)
def test_a_word_that_is_unit_and_parameter_has_one_meaning(text, said):
    found = Expression.parse(text)
    if said:
        with pytest.raises(InputError) as caught:
            found.require_clear({"m"})
        assert said in caught.value.got
    else:
        found.require_clear({"m"})
        assert found.names == ("m",)


HOSTILE = [
    "2^2^2^2^2^2",
    "9^9^9^9^9",
    "(" * 10_000 + "1" + ")" * 10_000,
    "(" * 249 + "1" + ")" * 249,
    "-" * 499 + "1",
    "2^" * 249 + "2",
    "sqrt(" * 80 + "1" + ")" * 80,
    "1+" * 249 + "1",
    "1e999",
    "1" * 499,
    "1e308 * 10",
    "1 / 0",
    "1 mm / 0 mm",
    "0 ^ -1",
    "sqrt(-1)",
    "(-1)^0.5",
    "ln(0)",
    "ln(-1)",
    "log10(0)",
    "asin(2)",
    "acos(-2)",
    "tan(1e999)",
    "exp(1000)",
    "nan",
    "inf",
    "1 nan",
    "\0",
    "1\0",
    "1 mm\0",
    "\u2028 1 + 1 \u0000",
    "１ + １",
    "²",
    "2²",
    "2 µµµ",
    "½",
    "∞",
    "√2",
    "💧",
    "1 💧",
    "__import__('os')",
    "().__class__",
    "1 if 1 else 2",
    "1 mm.real",
    "1 eval",
    "1 9^9^9",
    "1 mm^9999",
    "1 mm^-9.9.9",
    "1 (mm)",
    "1 mm/(s)",
    "1 dB",
    "1 degF",
    "5 degC * 2",
    "1 mm/s/",
    "1 mm mm",
    "min()",
    "min(1)",
    "min(1, 2",
    "min 1, 2",
    ")",
    "(",
    "()",
    "1 2",
    "1 + + ",
    "* 1",
    "^",
    "=1",
    "== 1",
    ",",
    "a" * 500,
    "a." * 200,
    "1 " + "m" * 400,
    "1 " + "mm*" * 150 + "mm",
]


def _computed(text: str) -> float:
    found = Expression.parse(text, "w")
    found.dimension({})
    return found.value({})


@each("text", HOSTILE)
def test_hostile_text_is_one_error_at_once(text):
    begin = time.process_time()
    with pytest.raises(InputError) as caught:
        _computed(text)

    assert caught.value.where == "w"
    assert len(caught.value.got) < 1500
    assert time.process_time() - begin < 5.0  # the unit registry may be made meanwhile


def test_random_text_is_read_or_refused_with_one_error():
    rng = random.Random(11)
    words = '** mm N/mm 1 2e 1e5 a sqrt( max( pi é µ ° % # " [ deg 1/s 0x1 1_0 e E degC ²'
    pieces = [*"+-*/^(),. =\t\n\0", "\ud800", " 1", *words.split()]
    good = 0
    for _ in range(6000):
        text = "".join(rng.choice(pieces) for _ in range(rng.randint(1, 12)))
        try:
            found = Expression.parse(text)
            found.dimension({"a": dimension_of("m")})
            value = found.value({"a": 2.0})
        except InputError:
            continue
        good += 1
        assert math.isfinite(value)
    assert good > 50
