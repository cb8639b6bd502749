"""Expressions of parameters; truth: Python's arithmetic, dimensions, the list of allowed parts."""

import math
import pickle
import warnings

import pytest
from draws import each
from hypothesis import assume, given
from hypothesis import strategies as st

from klack.case.expressions.expression import Expression, ordered
from klack.errors import InputError

VALUES = {"a": 2.0, "b": 5.0, "c": 0.25}


@each(
    ("text", "expected"),
    [
        ("2 * a", 4.0),
        ("max(a, b) - 0.5*sqrt(c)", 5.0 - 0.5 * math.sqrt(0.25)),
        ("a - b - c", 2.0 - 5.0 - 0.25),
        ("a / b / c", 2.0 / 5.0 / 0.25),
        ("-a**2", -4.0),
        ("2**-a", 0.25),
        ("a**b**c", 2.0 ** (5.0**0.25)),
        ("(a + b) * c", 1.75),
        ("+a", 2.0),
        ("abs(a - b)", 3.0),
        ("min(a, b, c)", 0.25),
        ("exp(log(b))", math.exp(math.log(5.0))),
        ("sin(pi/6)", math.sin(math.pi / 6)),
        ("cos(a)", math.cos(2.0)),
        ("tan(c)", math.tan(0.25)),
        ("1e-3", 1e-3),
        ("  3  \n * a ", 6.0),
        ("(-8)**3", -512.0),
    ],
)
def test_value_is_that_of_arithmetic(text, expected):
    assert Expression.parse(text).value(VALUES) == expected


@st.composite
def arithmetic(draw, depth=4):
    """Text that Python itself can compute as well."""
    if depth == 0 or draw(st.integers(0, 3)) == 0:
        number = st.floats(0.1, 9.9).map(lambda x: f"{x:.3f}")
        return draw(st.one_of(number, st.sampled_from(sorted(VALUES))))
    left = draw(arithmetic(depth=depth - 1))
    right = draw(arithmetic(depth=depth - 1))
    form = draw(
        st.sampled_from(
            ["({} + {})", "{} - {}", "({}) * ({})", "{} / ({})", "max({}, {})", "min({}, {})"]
        )
    )
    return form.format(left, right)


@pytest.mark.slow
@given(arithmetic())
def test_value_is_that_of_python_to_the_bit(text):
    assume(len(text) < 500)
    expression = Expression.parse(text)
    try:
        expected = eval(text, {"max": max, "min": min}, dict(VALUES))
    except ZeroDivisionError:
        with pytest.raises(InputError, match="divides by zero"):
            expression.value(VALUES)
        return
    assert expression.value(VALUES) == expected


def test_names_come_once_in_the_order_of_the_text():
    assert Expression.parse("b * (a + b) + pi * sqrt(c)").names == ("b", "a", "c")


@pytest.mark.parametrize("name", ["höhe", "µ", "µ_1", "Ω", "a_2"])
def test_a_name_is_found_as_written(name):
    expression = Expression.parse(f"2 * {name}")

    assert expression.value({name: 3.0}) == 6.0
    assert ordered({"x": expression}, {name}) == ("x",)


def test_a_refused_text_gives_no_warning_of_python():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(InputError):
            Expression.parse("1if a else 2")


def test_an_expression_goes_to_another_process():
    expression = Expression.parse("2 * a", "study.linked.x")
    copy = pickle.loads(pickle.dumps(expression))

    assert copy == expression
    assert copy.where == "study.linked.x"
    assert copy.value(VALUES) == 4.0


@each(
    "text",
    [
        "",
        "   ",
        "2 *",
        "a b",
        "8 Nn",
        "8 N m",
        "2 (3)",
        "a (2)",
        "a.real",
        "network.spring.preload * 2",
        "a[0]",
        "[a]",
        "{a}",
        "(a, b)",
        "0,5 * a",
        "'a' * 3",
        "b'a'",
        "f'{a}'",
        "True",
        "None",
        "...",
        "1j",
        "a ^^ 2",
        "2 mm^a",
        "2 mm ^ 2",
        "20 degC - 5 K",
        "10 dB",
        "a // 2",
        "a % 2",
        "a @ b",
        "a << 2",
        "~a",
        "not a",
        "a < b",
        "a and b",
        "a if b else c",
        "(x := 2)",
        "lambda: 1",
        "[x for x in (1, 2)]",
        "(yield)",
        "await a",
        "*a",
        "a = 2",
        "import os",
        "__import__('os')",
        "eval(a)",
        "open(a)",
        "pow(a, 2)",
        "sqrt",
        "max * 2",
        "pi(2)",
        "sqrt()",
        "sqrt(a, b)",
        "max(a)",
        "max(*a)",
        "max(a, b, key=c)",
        "sqrt(x=a)",
        "sqrt(a)(b)",
        "(sqrt)(a).real",
        "2(3)",
        "1e999",
        "9" * 400,
        "a; b",
        "a\x00",
        "# a",
        "2 * a # + b",
        "1if a else 2",
        "((" * 150 + "a" + "))" * 150,
        "-" * 450 + "a",
        "a+" * 240 + "a",
        "a" * 501,
        "sqrt(" * 90 + "a" + ")" * 90,
    ],
)
def test_what_is_not_on_the_list_is_one_error(text):
    with pytest.raises(InputError) as caught:
        Expression.parse(text, "study.linked.x").value(dict.fromkeys(("a", "b", "c"), 1.0))

    assert caught.value.where == "study.linked.x"


@given(st.text(max_size=60))
def test_any_text_is_read_or_refused(text):
    try:
        Expression.parse(text)
    except InputError:
        return


@pytest.mark.parametrize(
    ("text", "hint"),
    [
        ("2 a b", r"operator"),
        ("0,5*a", "point"),
        ("sqr(a)", "sqrt"),
        ("body.radius", "without points"),
    ],
)
def test_common_slips_get_their_remedy(text, hint):
    with pytest.raises(InputError, match=hint):
        Expression.parse(text)


def test_no_text_is_run(tmp_path):
    trace = tmp_path / "run"

    with pytest.raises(InputError):
        Expression.parse(f"__import__('pathlib').Path('{trace}').touch()")

    assert not trace.exists()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("a / (b - 5)", "divides by zero"),
        ("0 ** -a", "divides by zero"),
        ("sqrt(-a)", "no real value"),
        ("(-a)**0.5", "no real value"),
        ("log(0 * a)", "no real value"),
        ("exp(1000 * a)", "infinite"),
        ("10**(200 * a)", "infinite"),
        ("1e300 * 1e300 * a", "infinite"),
        ("1 / (1e300 * 1e300 * a)", "infinite"),
        ("max(a, 1e308 * 10)", "infinite"),
        ("9**9**9**9", "infinite"),
    ],
)
def test_no_finite_real_value_is_one_error_with_the_values(text, why):
    with pytest.raises(InputError, match=why) as caught:
        Expression.parse(text, "study.linked.x").value(VALUES)

    assert text in str(caught.value)
    if "a" in Expression.parse(text).names:
        assert "a = 2" in str(caught.value)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_value_that_is_not_finite_is_an_error_also_inside_min(value):
    with pytest.raises(InputError, match="'b' is"):
        Expression.parse("min(a, b)").value({"a": 1.0, "b": value})


def test_a_missing_value_names_the_nearest():
    with pytest.raises(InputError, match="did you mean 'tip_radius'"):
        Expression.parse("2 * tip_radus").value({"tip_radius": 1.0, "gap": 2.0})
    with pytest.raises(InputError, match="did you mean 'pi'"):
        Expression.parse("2 * PI").value({"tip_radius": 1.0})


UNITS = {
    "r": "m",
    "g": "m",
    "F": "N",
    "k": "N/m",
    "m": "kg",
    "A": "m^2",
    "x": "-",
    "y": "-",
    "phi": "rad",
    "f": "Hz",
    "rate": "1/s",
    "t": "s",
    "p": "Pa",
    "T": "K",
    "V": "V",
    "i": "A",
}


@each(
    ("text", "unit"),
    [
        ("2 * r", "m"),
        ("r + g", "m"),
        ("max(r, 2*g, 0)", "m"),
        ("r - 0", "m"),
        ("F / g", "N/m"),
        ("k * r", "N"),
        ("p * A", "N"),
        ("sqrt(A)", "m"),
        ("pi * r**2", "m^2"),
        ("4/3 * pi * r**3", "m^3"),
        ("A**0.5 + r", "m"),
        ("(r**3)**(1/3)", "m"),
        ("sqrt(2 * F * r / m)", "m/s"),
        ("r / g", "-"),
        ("x + 1", "-"),
        ("x**y", "-"),
        ("exp(-x) + log(r / g)", "-"),
        ("sin(phi)", "-"),
        ("sin(2 * pi * f * t)", "-"),
        ("r * tan(phi)", "m"),
        ("r * phi", "m"),
        ("2 * pi * r", "m"),
        ("r / pi", "m"),
        ("2 * phi", "rad"),
        ("pi/2 - phi", "rad"),
        ("pi - 2*phi", "rad"),
        ("pi / 4", "rad"),
        ("pi / 4", "-"),
        ("1 - pi/4", "-"),
        ("phi / phi", "-"),
        ("phi * 180 / pi", "-"),
        ("0.5 * f", "Hz"),
        ("1 / t", "Hz"),
        ("1 / t", "1/s"),
        ("1 / f", "s"),
        ("2 * pi * f", "1/s"),
        ("sqrt(k / m) / (2*pi)", "Hz"),
        ("sqrt(k / m)", "1/s"),
        ("V / i", "ohm"),
        ("V * i", "W"),
        ("T + T", "K"),
        ("0", "m"),
        ("0", "rad"),
        ("7", "-"),
        ("r**2 / r", "m"),
        ("abs(-r)", "m"),
    ],
)
def test_unit_of_the_result(text, unit):
    assert Expression.parse(text).unit(UNITS).fits(unit)


@pytest.mark.parametrize(
    ("text", "unit"),
    [
        ("2 * r", "m^2"),
        ("r", "-"),
        ("7", "m"),
        ("45", "rad"),
        ("phi", "-"),
        ("x", "rad"),
        ("phi * 180 / pi", "rad"),
        ("phi / pi", "rad"),
        ("f", "1/s"),
        ("rate", "Hz"),
        ("sqrt(k / m)", "Hz"),
        ("phi**2", "-"),
        ("phi**2", "rad"),
        ("k", "N"),
    ],
)
def test_another_unit_does_not_fit(text, unit):
    assert not Expression.parse(text).unit(UNITS).fits(unit)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("r + F", "'r' is a length [m] and 'F' is a force [N]"),
        ("r - 5e-6", "'r' is a length [m] and '5e-6' is a number without a unit"),
        ("max(r, g, t)", "'t' is a time [s]"),
        ("phi + 10", "'phi' is an angle [rad] and '10' is a number without a unit"),
        ("x + phi", "'phi' is an angle [rad]"),
        ("f + rate", "'f' is a frequency [Hz] and 'rate' is a rate [1/s]"),
        ("exp(r)", "a length [m] in 'exp(r)'"),
        ("log(F)", "a force [N] in 'log(F)'"),
        ("sin(r)", "a length [m] in 'sin(r)'"),
        ("x ** r", "a length [m] as exponent"),
        ("r ** x", "exponent that is a parameter"),
        ("r ** 0.12345", "to the power 0.12345"),
        ("r ** 100", "to the power 100"),
        ("r ** (1/0)", "divides by zero"),
        ("F * r + k", "a quantity in kg*m^2*s^-2"),
    ],
)
def test_quantities_that_do_not_go_together_are_one_error(text, said):
    with pytest.raises(InputError) as caught:
        Expression.parse(text, "study.linked.x").unit(UNITS)

    assert said in str(caught.value)
    assert caught.value.where == "study.linked.x"


@pytest.mark.parametrize("unit", ["mm", "g", "banana", "m +"])
def test_a_unit_that_is_no_si_unit_is_an_error(unit):
    with pytest.raises(InputError):
        Expression.parse("a").unit({"a": unit})


def test_many_times_pi_is_soon_judged():
    text = "*".join(["pi"] * 49) + "/(" + "*".join(["pi"] * 49) + ")"

    assert Expression.parse(text).unit({}).fits("-")


def test_order_puts_each_after_what_it_needs():
    expressions = {
        name: Expression.parse(text)
        for name, text in {"d": "b + c", "c": "2 * b", "b": "a", "e": "a"}.items()
    }
    order = ordered(expressions, {"a"})

    assert sorted(order) == sorted(expressions)
    for name, expression in expressions.items():
        assert all(order.index(other) < order.index(name) for other in expression.names[1:])
    assert order.index("b") < order.index("c") < order.index("d")
    assert ordered({}, {"a"}) == ()


@pytest.mark.parametrize(
    ("texts", "circle"),
    [
        ({"x": "x + 1"}, "x needs x"),
        ({"x": "y", "y": "x"}, "x needs y needs x"),
        ({"u": "a", "x": "y + u", "y": "z", "z": "x"}, "x needs y needs z needs x"),
    ],
)
def test_a_circle_is_named(texts, circle):
    expressions = {name: Expression.parse(text, f"linked.{name}") for name, text in texts.items()}

    with pytest.raises(InputError) as caught:
        ordered(expressions, {"a"})

    found = caught.value.got.removeprefix("expressions that form a loop: ").split(" needs ")
    wanted = circle.split(" needs ")
    assert found[0] == found[-1]
    start = wanted.index(found[0])
    assert found[:-1] == wanted[start:-1] + wanted[:start]
    assert caught.value.where == f"linked.{found[0]}"


def test_an_unknown_name_and_a_name_twice_are_errors():
    for name, text, known, words in (
        ("x", "2 * radus", "radius", "did you mean 'radius'"),
        ("x", "2", "x", "which is also a parameter"),
        ("max", "2", "x", "which is also a function or pi"),
        ("x", "2 * pi", "pi", "'pi', which is also a function or pi"),
    ):
        with pytest.raises(InputError, match=words):
            ordered({name: Expression.parse(text)}, {known})
