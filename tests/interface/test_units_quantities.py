"""Quantities, numbers and equations as text.

Quantities: truth = definitions of the units (SI brochure; NIST SP 811 for inch and psi).

Numbers of a text: all of them, or none where anything else stands among them.

Equations as text; truth: the equations themselves, written by hand.
"""

import math
import subprocess
import sys
from pathlib import Path

import pint
import pytest
from draws import each

from klack import units
from klack.errors import InputError
from klack.input.plain_numbers import plain_numbers
from klack.network.catalogue import component_classes
from klack.network.described import described_type
from klack.terminal.tables import plain_math
from klack.units import base_powers, format_si, parse_quantity

# kind, text, SI value; exact definitions, so the tolerance is round-off
GOOD = [
    ("LENGTH", "80 um", 80e-6),
    ("LENGTH", "80um", 80e-6),
    ("LENGTH", "80 µm", 80e-6),  # micro sign
    ("LENGTH", "80 μm", 80e-6),  # Greek mu
    ("LENGTH", "-1.2e-1 mm", -1.2e-4),
    ("LENGTH", ".5 inch", 0.0127),
    ("LENGTH", 0, 0.0),
    ("LENGTH", "0", 0.0),
    ("SPEED", "0.5 m/s", 0.5),
    ("SPEED", "36 km/h", 10.0),
    ("TIME", "40 us", 40e-6),
    ("FORCE", "1.5 kN", 1500.0),
    ("RATE", "5 1/ms", 5e3),
    ("RATE", "5 1/us", 5e6),
    ("ROTATION", "3000 1/min", 50.0),
    ("ANGULAR_VELOCITY", "3 rad/s", 3.0),
    ("STIFFNESS", "5 N/mm", 5000.0),
    ("STIFFNESS", "5 N·mm^-1", 5000.0),
    ("PRESSURE", "210 GPa", 210e9),
    ("PRESSURE", "1 N/mm^2", 1e6),
    ("PRESSURE", "1 N/mm**2", 1e6),
    ("PRESSURE", "1 psi", 6894.757293168361),
    ("DENSITY", "7.85 g/cm^3", 7850.0),
    ("ANGLE", "40 deg", math.radians(40)),
    ("ANGLE", "40°", math.radians(40)),
    ("FREQUENCY", "900 kHz", 9e5),
    ("RATE", "50 1/s", 50.0),
    ("RATIO", "5 %", 0.05),
    ("RATIO", 0.3, 0.3),
    ("RATIO", "0.3", 0.3),
]


@each(("kind", "text", "expected"), GOOD)
def test_quantity_becomes_si(kind, text, expected):
    assert parse_quantity(text, getattr(units, kind)) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("text", [60, "60", "60 C", "140 degF"])
def test_a_temperature_that_cannot_be_read_is_told_of_degc(text):
    """Celsius is what everybody has; a hint that knows kelvin only sends people to a table."""
    with pytest.raises(InputError, match="degC"):
        parse_quantity(text, units.TEMPERATURE)


BAD = [
    ("LENGTH", "80 bar", "a pressure"),  # the error names what came
    ("PRESSURE", "80 um", "a length"),
    ("LENGTH", 80, "without unit"),
    ("LENGTH", "80", "without unit"),
    ("LENGTH", "1,5 mm", '"1.5 mm"'),  # pint itself would read 15 mm
    ("LENGTH", "5 m m", "a length"),  # not 5 mm
    ("LENGTH", "5 foo", "unknown unit 'foo'"),
    ("PRESSURE", "210 gpa", "upper and lower case"),
    ("DENSITY", "7850 kg/m3", "kg/m^3"),
    ("FREQUENCY", "5 rad/s", "a frequency"),  # 2 pi apart; pint itself would read 5 Hz
    ("FREQUENCY", "5 rpm", "a frequency"),
    ("RATE", "5 Hz", "a rate"),
    ("ANGLE", 40, "without unit"),
    ("ANGLE", "40 %", "an angle"),
    ("RATIO", "40 deg", "an angle"),
    ("LENGTH", True, "True"),
    ("LENGTH", None, "None"),
    ("LENGTH", [1], "[1]"),
    ("LENGTH", math.nan, "finite"),
    ("LENGTH", "nan m", "one number and one unit"),
    ("LENGTH", "1e400 m", "finite"),
    ("LENGTH", "1e308 km", "between 1e-12 and 1e+06 m"),
    ("LENGTH", "4.5e28 mm", "between 1e-12 and 1e+06 m"),
    ("LENGTH", "-1e-13 m", "between 1e-12 and 1e+06 m"),
    ("SPEED", 10**400, "finite"),
    ("RATIO", 1e300, "1e+15"),
    ("TEMPERATURE", "1e300 K", "1e+06 K"),
    ("LENGTH", "", "one number and one unit"),
    ("LENGTH", "m", "one number and one unit"),
    ("LENGTH", "1 mm + 2 mm", "one number and one unit"),
    ("LENGTH", "1 m/", "one number and one unit"),
    ("LENGTH", "5 class", "unknown unit"),
]


@each(("kind", "value", "words"), BAD)
def test_what_is_no_such_quantity_is_refused(kind, value, words):
    with pytest.raises(InputError) as caught:
        parse_quantity(value, getattr(units, kind), "gap")

    text = str(caught.value)
    assert text.startswith("gap: got ")
    assert words in text
    assert "\nTry: " in text


@pytest.mark.parametrize("text", ["9**9**9", "m**9**9**9", "1 m**9**9**9", "1 m^9^9^9"])
def test_towers_of_powers_are_not_evaluated(text):
    # pint evaluates 9**9**9, which has 369 million digits; the test would not end
    with pytest.raises(InputError):
        parse_quantity(text, units.LENGTH)


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (3.6e-6, "m", "3.6 um"),
        (-3.6e-6, "m", "-3.6 um"),
        (1.25e9, "N/m", "1.25 GN/m"),
        (0.0, "N", "0 N"),
        (999.99, "N", "1 kN"),  # rounding may not give 1000 N
        (7850.0, "kg/m^3", "7850 kg/m^3"),
        (0.9871, "-", "0.9871"),
        (1e-20, "s", "1e-20 s"),
        (math.nan, "s", "nan s"),
    ],
)
def test_si_numbers_are_written_with_a_prefix(value, unit, text):
    assert format_si(value, unit) == text


@pytest.mark.slow
def test_pint_waits_until_a_rare_unit_is_read():
    case = Path(__file__).parents[1] / "data" / "tiny_rods.yaml"
    code = f"import sys; from klack.case import load_case; load_case({str(case)!r}); "
    code += "sys.exit('pint' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_common_units_have_the_size_that_pint_gives_them_to_the_last_digit():
    registry = pint.UnitRegistry()
    for kind in units.KINDS:
        for unit in () if kind.factors else kind.common:
            size = float(registry.Quantity(1.0, unit).to(kind.unit).magnitude)
            assert units._factor(f"1 {unit}", unit, kind, "length") == size, unit


# SI brochure, table 4: derived units in base units
BASE = [
    ("-", {}),
    ("1", {}),
    ("rad", {}),
    ("m", {"m": 1}),
    ("N", {"kg": 1, "m": 1, "s": -2}),
    ("Hz", {"s": -1}),
    ("Pa*s", {"kg": 1, "m": -1, "s": -1}),
    ("ohm", {"kg": 1, "m": 2, "s": -3, "A": -2}),
    ("H", {"kg": 1, "m": 2, "s": -2, "A": -2}),
    ("K", {"K": 1}),
]


@pytest.mark.parametrize(("unit", "powers"), BASE)
def test_powers_of_base_units(unit, powers):
    assert dict(base_powers(unit)) == powers


def test_every_kind_has_a_coherent_unit():
    for kind in units.KINDS:
        assert base_powers(kind.unit) is not None


@pytest.mark.parametrize("unit", ["mm", "g", "bar", "degC", "banana", "m +", "%"])
def test_powers_need_a_coherent_unit(unit):
    with pytest.raises(InputError, match="SI unit"):
        base_powers(unit)


@pytest.mark.parametrize("text", [b"1 2,3", b"1.5D+03", b"2x", b"1 two", b"1e", b"0x10", b"1-3"])
def test_anything_else_is_no_list_of_numbers(text: bytes) -> None:
    """What other readers take for 1.5, 2 and 0."""
    assert plain_numbers(text) is None


@pytest.mark.parametrize("text", [b"", b" \n\t "])
@pytest.mark.parametrize("kind", [int, float])
def test_nothing_is_no_number(text: bytes, kind: type) -> None:
    found = plain_numbers(text, kind)
    assert found is not None
    assert found.shape == (0,)
    assert found.dtype == kind


def test_whole_numbers_stay_exact() -> None:
    found = plain_numbers(b"9007199254740993\n-7", int)
    assert found is not None
    assert found.tolist() == [9007199254740993, -7]


@pytest.mark.parametrize(
    ("latex", "text"),
    [
        (r"m \ddot y = \sum_p F_p", "m y'' = Σ_p F_p"),
        (r"\frac{dm}{dt} = \sum \dot m, \qquad V \varrho(p) = m", "dm/dt = Σ m',  V ρ(p) = m"),
        (r"C_\infty \tanh\frac{2\lambda}{\lambda_c}", "C_∞ tanh(2λ/λ_c)"),
        (r"\frac{\pi d c^3}{12 \mu l}\,(1 + \tfrac32 e)", "(π d c^3)/(12 µ l) (1 + 3/2 e)"),
        (r"e^{-(v/v_s)^2}", "e^(-(v/v_s)^2)"),
        (r"\sqrt{\frac{2 |p|}{\varrho}}", "sqrt((2 |p|)/ρ)"),
        (r"y_\text{end} - y_\text{base}", "y_end - y_base"),
        (r"\frac{\partial p}{\partial t}", "∂p/∂t"),
    ],
)
def test_equations_read_as_they_are_spoken(latex, text):
    assert plain_math(latex) == text


def test_no_equation_of_a_component_keeps_a_mark_of_latex():
    found = [described_type(kind) for kind in component_classes()]

    assert sum(bool(item.equation) for item in found) >= 17
    for item in found:
        assert not set(plain_math(item.equation)) & set("\\{}$"), item.word
        assert item.summary.endswith("."), item.word
        assert "`" not in item.summary + item.source, item.word
