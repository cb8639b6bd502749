"""Quantities with units on input: text such as ``80 um`` in, SI numbers inside.

A number without a unit is refused where a unit matters, because a wrong guess there is a factor of
a thousand that is never noticed.  Units that differ by 2 pi (rad/s and Hz) or are all "without
dimension" (deg, rad, %) are taken from short tables instead of by dimension, so that one cannot
pass for the other.
"""

import re
from dataclasses import dataclass, field
from fractions import Fraction
from functools import cache, lru_cache, partial
from math import inf, isfinite, pi
from typing import Annotated, Any

from pydantic import BeforeValidator, ValidationInfo, WithJsonSchema

from klack.errors import InputError, refuse_if
from klack.input.section import Computed

__all__ = [
    "CELSIUS",
    "KINDS",
    "Acceleration",
    "Angle",
    "AngularVelocity",
    "Area",
    "BedStiffness",
    "Capacitance",
    "Compliance",
    "Conductivity",
    "Current",
    "DampingCoefficient",
    "Density",
    "DynamicViscosity",
    "Expansion",
    "FieldStrength",
    "Flux",
    "FluxDensity",
    "Force",
    "Frequency",
    "GasConstant",
    "HeatCapacity",
    "HeatTransfer",
    "Inertia",
    "Kind",
    "KinematicViscosity",
    "Length",
    "LengthUnit",
    "Level",
    "Mass",
    "Modulus",
    "Permeance",
    "Power",
    "Pressure",
    "QuantityError",
    "Rate",
    "Ratio",
    "Resistance",
    "Rotation",
    "SonicConductance",
    "SpecificHeat",
    "Speed",
    "Stiffness",
    "Temperature",
    "TemperatureRise",
    "ThermalConductance",
    "Time",
    "Voltage",
    "Volume",
    "VolumeFlow",
    "base_powers",
    "format_in",
    "format_si",
    "is_level",
    "parse_quantity",
    "parse_temperature",
    "percent_text",
    "powers_of_unit",
    "size_of_unit",
    "takes_prefix",
    "typed",
    "unit_in",
]

_NUMBER = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_ATOM = r"[A-Za-zµμ°%]+(?:(?:\^|\*\*)-?\d(?:\.\d)?)?"
# no brackets and no powers of powers: the unit is evaluated, and 9**9**9 would take for ever
_UNIT = rf"(?:1 ?/ ?)?{_ATOM}(?: ?[*/·] ?{_ATOM}| {_ATOM})*"
_QUANTITY = re.compile(rf"(?P<number>{_NUMBER}) ?(?P<unit>{_UNIT})?")
_LONGEST = 60
_ZERO_CELSIUS = 273.15
_PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "u", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}


def _with_prefixes(unit: str) -> dict[str, float]:
    """Size of a unit under each prefix of :func:`format_si`."""
    return {prefix + unit: float(f"1e{power}") for power, prefix in _PREFIXES.items()}


@dataclass(frozen=True, slots=True)
class Kind:
    """A physical kind of quantity.

    Parameters
    ----------
    name
        With its article: ``"a length"``.
    unit
        SI unit that klack computes with.
    common
        Units that an error proposes.
    factors
        All accepted units, where the dimension does not decide.
    bare
        Whether a number without a unit is accepted.
    smallest, largest
        Of a value that is not zero, in ``unit``: wider than anything in a valve, a building or a
        laboratory, and so narrow that areas, volumes, energies and their quotients stay far from
        the ends of double precision.
    """

    name: str
    unit: str
    example: str
    common: tuple[str, ...]
    factors: dict[str, float] = field(default_factory=dict)
    bare: bool = False
    smallest: float = 1e-15
    largest: float = 1e12

    def holds(self, value: float) -> bool:
        """Whether a value is zero, or of a size that this kind can have."""
        return value == 0 or self.smallest <= abs(value) <= self.largest


LENGTH = Kind(
    "a length", "m", "80 um", ("m", "cm", "mm", "um", "nm", "inch"), smallest=1e-12, largest=1e6
)
SPEED = Kind("a speed", "m/s", "0.5 m/s", ("m/s", "mm/s", "km/h"), largest=1e6)
TIME = Kind("a time", "s", "40 us", ("s", "ms", "us", "ns", "min"), smallest=1e-18, largest=1e9)
FORCE = Kind("a force", "N", "12 N", ("N", "kN", "mN", "lbf"))
STIFFNESS = Kind("a stiffness", "N/m", "5 N/mm", ("N/m", "N/mm", "N/um", "kN/mm"), largest=1e18)
BED_STIFFNESS = Kind(
    "a stiffness per area",
    "N/m^3",
    "20 N/mm^3",
    ("N/m^3", "N/mm^3", "MPa/mm", "N/um/mm^2"),
    largest=1e24,
)
_PRESSURES = ("Pa", "kPa", "MPa", "GPa", "bar", "N/mm^2", "psi")
PRESSURE = Kind("a pressure", "Pa", "5 bar", _PRESSURES, smallest=1e-12)
MODULUS = Kind("a modulus", "Pa", "210 GPa", _PRESSURES, smallest=1e-12)
DENSITY = Kind("a density", "kg/m^3", "7850 kg/m^3", ("kg/m^3", "g/cm^3", "kg/dm^3"))
ANGLE = Kind(
    "an angle",
    "rad",
    "40 deg",
    ("deg", "rad"),
    {"deg": pi / 180, "degree": pi / 180, "°": pi / 180, **_with_prefixes("rad")},
    largest=1e6,
)
FREQUENCY = Kind(
    "a frequency", "Hz", "900 kHz", ("Hz", "kHz", "MHz"), _with_prefixes("Hz"), largest=1e15
)
RATE = Kind(
    "a rate",
    "1/s",
    "50 1/s",
    ("1/s", "1/ms"),
    {"1/s": 1.0, "s^-1": 1.0, "1/ms": 1e3, "1/us": 1e6},
    largest=1e15,
)
ROTATION = Kind(
    "a rotational speed",
    "1/s",
    "2000 rpm",
    ("rpm", "1/min", "1/s"),
    {"rpm": 1.0 / 60.0, "1/min": 1.0 / 60.0, "min^-1": 1.0 / 60.0, "1/s": 1.0},
)
ANGULAR_VELOCITY = Kind(
    "an angular velocity",
    "rad/s",
    "100 rad/s",
    ("rad/s",),
    _with_prefixes("rad/s"),
    largest=1e9,
)
AREA = Kind("an area", "m^2", "12 mm^2", ("m^2", "cm^2", "mm^2", "um^2"), smallest=1e-24)
VOLUME = Kind(
    "a volume", "m^3", "50 mm^3", ("m^3", "cm^3", "mm^3", "l", "ml"), smallest=1e-36, largest=1e18
)
MASS = Kind("a mass", "kg", "3 g", ("kg", "g", "mg"), smallest=1e-21)
INERTIA = Kind(
    "a moment of inertia",
    "kg*m^2",
    "2 kg*cm^2",
    ("kg*m^2", "kg*cm^2", "g*mm^2"),
    smallest=1e-33,
)
ACCELERATION = Kind("an acceleration", "m/s^2", "9.81 m/s^2", ("m/s^2",))
DAMPING = Kind("a damping coefficient", "N*s/m", "0.5 N*s/m", ("N*s/m", "N*s/mm"))
COMPLIANCE = Kind("a compliance", "m/N", "1 nm/N", ("m/N", "um/N", "nm/N"), smallest=1e-21)
VOLUME_FLOW = Kind(
    "a volume flow", "m^3/s", "1 l/min", ("m^3/s", "l/min", "l/h", "mm^3/s"), smallest=1e-24
)
SONIC_CONDUCTANCE = Kind(
    "a sonic conductance",
    "m^3/s/Pa",
    "0.2 l/s/bar",
    ("l/s/bar", "l/min/bar", "m^3/s/Pa"),
    smallest=1e-30,
)
GAS_CONSTANT = Kind("a specific gas constant", "J/kg/K", "287.05 J/kg/K", ("J/kg/K", "kJ/kg/K"))
DYNAMIC_VISCOSITY = Kind("a dynamic viscosity", "Pa*s", "0.4 mPa*s", ("Pa*s", "mPa*s"))
KINEMATIC_VISCOSITY = Kind("a kinematic viscosity", "m^2/s", "46 mm^2/s", ("m^2/s", "mm^2/s"))
VOLTAGE = Kind("a voltage", "V", "14 V", ("V", "mV", "kV"))
CURRENT = Kind("a current", "A", "2.5 A", ("A", "mA"))
RESISTANCE = Kind("a resistance", "ohm", "1.2 ohm", ("ohm", "mohm"))
CAPACITANCE = Kind("a capacitance", "F", "220 uF", ("F", "mF", "uF"), smallest=1e-15)
POWER = Kind("a power", "W", "12 W", ("W", "mW", "kW"))
CONDUCTIVITY = Kind("a conductivity", "S/m", "2 MS/m", ("S/m", "MS/m"), smallest=1e-24)
FLUX_DENSITY = Kind("a flux density", "T", "1.5 T", ("T", "mT"))
FIELD_STRENGTH = Kind("a field strength", "A/m", "120 A/m", ("A/m", "kA/m"))
PERMEANCE = Kind("a permeance", "H", "20 nH", ("H", "uH", "nH"), smallest=1e-21)
FLUX = Kind("a magnetic flux", "Wb", "20 uWb", ("Wb", "mWb", "uWb"), smallest=1e-21)
CELSIUS = "degC"
TEMPERATURE = Kind("a temperature", "K", "20 degC", ("degC", "K"), {"K": 1.0}, largest=1e6)
TEMPERATURE_RISE = Kind(
    "a temperature difference", "K", "5 K", ("K", "mK"), {"K": 1.0, "mK": 1e-3}, largest=1e6
)
HEAT_CAPACITY = Kind("a heat capacity", "J/K", "14 J/K", ("J/K", "kJ/K"))
SPECIFIC_HEAT = Kind("a specific heat", "J/kg/K", "385 J/kg/K", ("J/kg/K", "kJ/kg/K"))
CONDUCTANCE = Kind("a thermal conductance", "W/K", "0.6 W/K", ("W/K", "mW/K"))
HEAT_TRANSFER = Kind("a heat transfer coefficient", "W/m^2/K", "12 W/m^2/K", ("W/m^2/K",))
EXPANSION = Kind("a temperature coefficient", "1/K", "12e-6 1/K", ("1/K", "um/m/K"))
LEVEL = Kind("a level", "dB", "35 dB", ("dB",), {"dB": 1.0, "dBA": 1.0, "dB(A)": 1.0})
RATIO = Kind(
    "a number without a unit",
    "-",
    "0.3",
    ("%",),
    {"%": 0.01, "percent": 0.01, "ppm": 1e-6},
    bare=True,
    smallest=1e-30,
    largest=1e15,
)

KINDS = (
    LENGTH,
    SPEED,
    TIME,
    FORCE,
    STIFFNESS,
    BED_STIFFNESS,
    PRESSURE,
    MODULUS,
    DENSITY,
    ANGLE,
    FREQUENCY,
    RATE,
    ROTATION,
    ANGULAR_VELOCITY,
    AREA,
    VOLUME,
    MASS,
    INERTIA,
    ACCELERATION,
    DAMPING,
    COMPLIANCE,
    VOLUME_FLOW,
    SONIC_CONDUCTANCE,
    GAS_CONSTANT,
    DYNAMIC_VISCOSITY,
    KINEMATIC_VISCOSITY,
    VOLTAGE,
    CURRENT,
    RESISTANCE,
    CAPACITANCE,
    POWER,
    CONDUCTIVITY,
    FLUX_DENSITY,
    FIELD_STRENGTH,
    PERMEANCE,
    FLUX,
    TEMPERATURE,
    RATIO,
    HEAT_CAPACITY,
    SPECIFIC_HEAT,
    CONDUCTANCE,
    HEAT_TRANSFER,
    EXPANSION,
)


class QuantityError(InputError):
    """Something that is no quantity of its kind.

    Parameters
    ----------
    hint
        May hold the example of the kind, which whoever knows the key can exchange.
    came
        More about ``value``.
    """

    def __init__(
        self, where: str, value: object, kind: Kind, hint: str, came: str = "", expected: str = ""
    ) -> None:
        self.kind = kind
        shown = f"'{value}'" if isinstance(value, str) else str(value)
        if len(shown) > _LONGEST + 20:
            shown = shown[:_LONGEST] + "...'"
        with_unit = kind.name if kind.bare else f"{kind.name} with its unit"
        super().__init__(where, got=f"{shown}{came}", expected=expected or with_unit, hint=hint)


def parse_quantity(value: object, kind: Kind, where: str = "quantity") -> float:
    """Turn ``"80 um"`` into SI; a bare 0 passes, any other bare number needs a unit.

    ``where`` is the key or argument, for the error.

    Examples
    --------
    >>> parse_quantity("80 um", LENGTH)
    8e-05
    >>> parse_quantity("7.85 g/cm^3", DENSITY)
    7850.0
    """
    if isinstance(value, Computed):
        return _of_expression(value, kind, where)
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise QuantityError(
            where, value, kind, f"write a number and its unit, e.g. {kind.example}."
        )
    if isinstance(value, str):
        number, unit = _split(value, kind, where)
    else:
        number, unit = _number(value), ""
    if not isfinite(number):
        raise QuantityError(where, value, kind, f"write a finite number, e.g. {kind.example}.")
    if not unit:
        if number != 0 and not kind.bare:
            raise QuantityError(
                where, value, kind, f'add a unit, e.g. "{kind.example}".', " without unit"
            )
        return _in_range(number, value, kind, where)
    result = _in_range(number * _factor(value, unit, kind, where), value, kind, where)
    # a decimal input stays decimal: 80 * 1e-6 must read 8e-05, not 7.999999999999999e-05
    return result if kind.factors else float(f"{result:.15g}")


def _of_expression(value: Computed, kind: Kind, where: str) -> float:
    """Value of an expression of fitting dimension, rounded like a written one."""
    if not value.dimension.fits(kind.unit):
        raise InputError(
            where,
            got=str(value),
            expected=kind.name if kind.bare else f"{kind.name} [{kind.unit}]",
            hint="check the exponents and the units in the expression.",
        )
    result = value.value if kind.factors else float(f"{value.value:.15g}")
    return _in_range(result, value, kind, where)


def _number(value: float) -> float:
    """Float of a number; infinite for 400 digits."""
    try:
        return float(value)
    except OverflowError:
        return inf


def _in_range(result: float, value: object, kind: Kind, where: str) -> float:
    """Value, or an error with the range of its kind."""
    if kind.holds(result):
        return result
    unit = "" if kind.unit == "-" else f" {kind.unit}"
    sizes = f" of a magnitude between {kind.smallest:g} and {kind.largest:g}{unit}, or 0"
    raise QuantityError(
        where, value, kind, "check the power of ten and the unit.", expected=f"{kind.name}{sizes}"
    )


def _split(text: str, kind: Kind, where: str) -> tuple[float, str]:
    squeezed = " ".join(text.split())
    match = _QUANTITY.fullmatch(squeezed) if len(squeezed) <= _LONGEST else None
    if match is None:
        hint = f'write one number and one unit, e.g. "{kind.example}".'
        if re.match(r"[+-]?\d+,\d", squeezed):
            hint = f'use a decimal point: "{squeezed.replace(",", ".", 1)}".'
        elif re.search(r"[A-Za-z][23²³]$", squeezed):
            power = {"²": "2", "³": "3"}.get(squeezed[-1], squeezed[-1])
            hint = f"write a power with ^: {squeezed[:-1]}^{power}."
        raise QuantityError(where, text, kind, hint)
    return float(match["number"]), match["unit"] or ""


def _factor(value: object, unit: str, kind: Kind, where: str) -> float:
    """SI value of one ``unit``."""
    if kind.factors:
        known = {name.replace(" ", ""): factor for name, factor in kind.factors.items()}
        plain = unit.replace(" ", "").replace("**", "^")
        if plain in known:
            return known[plain]
        raise QuantityError(
            where, value, kind, f"use one of: {', '.join(kind.common)}.", _came(unit)
        )
    if unit == kind.unit:
        return 1.0
    if unit in kind.common and unit in _SIZES:
        return _SIZES[unit]
    import pint

    try:
        return _in_si(unit, kind.unit)
    except pint.DimensionalityError:
        hint = f"use one of: {', '.join(kind.common)}."
        raise QuantityError(where, value, kind, hint, _came(unit)) from None
    except Exception:  # pint evaluates the text and lets errors of tokenize and others through
        hint = f"use one of: {', '.join(kind.common)} (upper and lower case matter)."
        raise QuantityError(where, value, kind, hint, f" with the unknown unit '{unit}'") from None


_BASE = {
    "[mass]": "kg",
    "[length]": "m",
    "[time]": "s",
    "[current]": "A",
    "[temperature]": "K",
    "[substance]": "mol",
    "[luminosity]": "cd",
}


@cache
def base_powers(unit: str) -> tuple[tuple[str, Fraction], ...]:
    """Powers of the SI base units in a coherent SI unit, ordered by name.

    A number without unit, ``"-"`` or ``"1"``, has none; Hz is 1/s and rad is 1.  InputError for an
    unknown unit, or one of another size than 1 in base units (``mm``).

    >>> [f"{base}^{power}" for base, power in base_powers("N/m")]
    ['kg^1', 's^-2']
    """
    if unit in ("", "-", "1"):
        return ()
    hint = f"use an SI unit without a prefix, e.g. {LENGTH.unit} or {STIFFNESS.unit}."
    try:
        size = _registry().Quantity(1.0, unit).to_base_units()
        dimension = _registry().get_dimensionality(size.units)
        coherent = abs(float(size.magnitude) - 1.0) < 1e-12
    except Exception:  # pint evaluates the text and lets errors of tokenize and others through
        raise InputError(
            "unit", got=f"the unknown unit '{unit}'", expected="an SI unit", hint=hint
        ) from None
    refuse_if(
        not coherent,
        "unit",
        got=f"'{unit}'",
        expected="a coherent SI unit (kg, m, s, A, K)",
        hint=hint,
    )
    powers = {
        _BASE[name]: Fraction(power).limit_denominator(12) for name, power in dimension.items()
    }
    return tuple(sorted(powers.items()))


@lru_cache(maxsize=1000)
def powers_of_unit(unit: str) -> tuple[tuple[str, Fraction], ...] | None:
    """Powers of the SI base units in any unit; None for an unknown one and one with an offset.

    >>> [f"{base}^{power}" for base, power in powers_of_unit("bar")]
    ['kg^1', 'm^-1', 's^-2']
    """
    registry = _registry()
    try:
        one = registry.Quantity(1.0, unit)
        if not one._is_multiplicative or one.magnitude != 1.0:  # degC and dB; numbers
            return None
        dimension = registry.get_dimensionality(one.units)
        powers = [(_BASE[name], Fraction(p).limit_denominator(12)) for name, p in dimension.items()]
    except Exception:  # pint evaluates the text and lets errors of tokenize and others through
        return None
    return tuple(sorted(powers))


@lru_cache(maxsize=1000)
def size_of_unit(unit: str, si: str = "") -> float:
    """Size of a unit that :func:`powers_of_unit` knows in another one, or in SI base units.

    >>> size_of_unit("bar"), size_of_unit("N/mm", "N/m")
    (100000.0, 1000.0)
    """
    if si:
        return _in_si(unit, si)
    return float(_registry().Quantity(1.0, unit).to_base_units().magnitude)


_SIZES = {
    unit: size
    for size, units in (
        (1e9, "GPa"),
        (1e6, "N/um kN/mm MPa N/mm^2 MS/m"),
        (1e5, "bar"),
        (6894.7572931683635, "psi"),
        (1e3, "kN N/mm kPa N*s/mm kJ/kg/K kV kW kA/m kJ/K"),
        (999.9999999999999, "g/cm^3 kg/dm^3"),
        (60.0, "min"),
        (4.4482216152605005, "lbf"),
        (0.2777777777777778, "km/h"),
        (0.0254, "inch"),
        (0.01, "cm"),
        (0.0010000000000000002, "l"),
        (1e-3, "mm mm/s ms mN g mPa*s mV mA mohm mF mW mT mWb mW/K"),
        (1e-4, "cm^2"),
        (1.666666666666667e-05, "l/min"),
        (1.0000000000000002e-06, "cm^3 ml"),
        (1e-06, "um us mm^2 mg um/N mm^2/s uF uH uWb um/m/K"),
        (2.7777777777777787e-07, "l/h"),
        (1.0000000000000004e-08, "l/s/bar"),
        (1e-09, "nm ns mm^3 nm/N mm^3/s nH"),
        (1.666666666666667e-10, "l/min/bar"),
        (1e-12, "um^2"),
    )
    for unit in units.split()
}
"""Sizes in SI of proposed units, to the last digit those of pint, which takes 0.7 s to load."""


@lru_cache(maxsize=1000)
def _in_si(unit: str, si: str) -> float:
    """Size of a unit in another; cached, since a calibration reads it often."""
    return float(_registry().Quantity(1.0, unit).to(si).magnitude)


def _came(unit: str) -> str:
    """Kind of ``unit``, as `` (a pressure)``."""
    plain = unit.replace(" ", "")
    for kind in KINDS:
        if plain in kind.factors:
            return f" ({kind.name})"
    registry = _registry()
    try:
        dimension = registry.parse_units(unit).dimensionality
    except Exception:  # pint evaluates the text and lets errors of tokenize and others through
        return f" with the unknown unit '{unit}'"
    for kind in KINDS:
        if not kind.factors and registry.parse_units(kind.unit).dimensionality == dimension:
            return f" ({kind.name})"
    return ""


@cache
def _registry() -> Any:
    """Registry of pint, built for the first unit (0.4 s with its import)."""
    import pint

    return pint.UnitRegistry()


def takes_prefix(unit: str) -> bool:
    """Whether a decimal prefix before an SI unit multiplies it as it stands.

    Not before a power, where it is raised too (1 mm^2 is 1e-6 m^2), before kg, rates and
    temperatures.

    >>> [takes_prefix(unit) for unit in ("N/m", "m^2", "kg/m^3", "1/s", "N/m^2")]
    [True, False, False, False, True]
    """
    plain = unit in ("", "-", "K", "degC", "deg", "%") or unit.startswith(("kg", "1/"))
    return not plain and "^" not in unit.split("/")[0]


def is_level(unit: str) -> bool:
    """Whether a unit is that of a level, relative already: ``"dB"``, ``"dBA"``."""
    return unit.startswith("dB")


def percent_text(share: float) -> str:
    """Write a share without powers of ten, and nothing huge exactly.

    >>> percent_text(0.0473), percent_text(0.9996), percent_text(2.8e5)
    ('4.7 %', '100 %', 'more than 1000 %')
    """
    percent = 100.0 * share
    if percent > 1000.0:
        return "more than 1000 %"
    return f"{percent:.0f} %" if percent >= 10.0 else f"{percent:.2g} %"


def format_si(value: float, unit: str, digits: int = 4) -> str:
    """Write a number with a decimal prefix; :func:`parse_quantity` reads it.

    ``unit`` is SI without prefix; ``"-"`` or ``""`` writes the plain number.  Temperatures, rates
    (1/s), powers (m^2) and what is counted in kg get no prefix.  Digits are significant ones.

    >>> format_si(3.6e-6, "m"), format_si(1.25e9, "N/m"), format_si(0.0, "N")
    ('3.6 um', '1.25 GN/m', '0 N')
    >>> format_si(4.51e-7, "m", 2)
    '450 nm'
    >>> format_si(7.27e-24, "J", 3)
    '7.27e-24 J'
    """
    if unit in ("", "-"):
        return f"{value:.{digits}g}"
    if value == 0 and unit == "m":
        return "0 um"  # no length of a valve is told in metres
    if value == 0 or not isfinite(value):
        return f"{value:g} {unit}"
    rounded = abs(float(f"{value:.{digits}g}"))
    if not takes_prefix(unit):
        return f"{value:.{digits}g} {unit}"
    power = next((p for p in sorted(_PREFIXES, reverse=True) if rounded >= 10.0**p), 0)
    scaled = float(f"{value / 10.0**power:.{digits}g}")
    return f"{scaled:.{max(digits, 3)}g} {_PREFIXES[power]}{unit}"  # 450 nm, not 4.5e+02 nm


def unit_in(text: object, kind: Kind) -> tuple[str, float]:
    """Unit that a file has at a quantity, and its size in SI; none for a number or an expression.

    >>> unit_in("601.3 kPa", PRESSURE), unit_in("20 °C", TEMPERATURE), unit_in("= lift", LENGTH)
    (('kPa', 1000.0), ('degC', 1.0), ('', 1.0))
    """
    if not isinstance(text, str):
        return "", 1.0
    try:
        if kind is TEMPERATURE and _celsius(text, kind) is not None:
            return CELSIUS, 1.0
        unit = _split(text, kind, "quantity")[1]
        return (unit, _factor(text, unit, kind, "quantity")) if unit else ("", 1.0)
    except InputError:
        return "", 1.0


def format_in(value: float, unit: str, size: float, digits: int = 4) -> str:
    """Write a value in SI in a unit of this size; :func:`parse_quantity` reads it.

    >>> format_in(6.013e5, "bar", 1e5), format_in(2e-7, "mm^3", 1e-9), format_in(1e4, "N/mm", 1e3)
    ('6.013 bar', '200 mm^3', '10 N/mm')
    >>> format_in(293.15, CELSIUS, 1.0)
    '20 degC'
    """
    if unit == CELSIUS:  # digits of the difference, not of K
        return f"{round(value - _ZERO_CELSIUS, 1):g} {unit}"
    return f"{float(f'{value / size:.{digits}g}'):.{max(digits, 6)}g} {unit}"


def typed(kind: Kind) -> tuple[BeforeValidator, WithJsonSchema]:
    """Pydantic metadata for a field of this kind, in SI."""
    schema = {
        "type": ["string", "number"],
        "description": f"{kind.name}, e.g. {kind.example}",
        "examples": [kind.example],
        "$comment": kind.name,
    }
    return BeforeValidator(partial(_read, kind=kind)), WithJsonSchema(schema)


def _read(value: object, info: ValidationInfo, *, kind: Kind) -> float:
    """In files every number needs a unit; numbers from Python (no context) are SI."""
    if info.context is None and isinstance(value, int | float) and not isinstance(value, bool):
        return _number(value)
    return parse_quantity(value, kind)


def _temperature() -> tuple[BeforeValidator, WithJsonSchema]:
    """Metadata of a temperature in K; files may write ``20 degC``."""
    metadata = {
        "type": ["string", "number"],
        "description": "a temperature, e.g. 20 degC",
    }
    return (
        BeforeValidator(partial(_read_temperature, kind=TEMPERATURE)),
        WithJsonSchema(
            {**metadata, "examples": ["20 degC", "293 K"], "$comment": TEMPERATURE.name}
        ),
    )


def _read_temperature(value: object, info: ValidationInfo, *, kind: Kind) -> float:
    found = _celsius(value, kind)
    return _read(value, info, kind=kind) if found is None else found


def _celsius(value: object, kind: Kind) -> float | None:
    """Temperature [K] of degrees Celsius; None for other texts."""
    if isinstance(value, str):
        match = re.fullmatch(rf"({_NUMBER}) ?(?:degC|°C)", " ".join(value.split()))
        if match:
            return _in_range(round(float(match[1]) + _ZERO_CELSIUS, 6), value, kind, "temperature")
    return None


def parse_temperature(value: str, where: str = "temperature") -> float:
    """Turn ``"20 degC"`` or ``"293 K"`` into K, above 0.

    >>> parse_temperature("-30 degC")
    243.15
    """
    found = _celsius(value, TEMPERATURE)
    found = parse_quantity(value, TEMPERATURE, where) if found is None else found
    if not found > 0.0:
        raise QuantityError(
            where, value, TEMPERATURE, "check the sign and the unit.", expected="one above 0 K"
        )
    return found


def _length_unit(value: object) -> float:
    """Metres in the unit of a file or outline: ``mm`` -> 0.001."""
    if not isinstance(value, str) or not re.fullmatch(_ATOM, value):
        hint = "write only the unit: mm."
        raise InputError("unit", got=f"'{value}'", expected="a unit of length", hint=hint)
    return parse_quantity(f"1 {value}", LENGTH)


Length = Annotated[float, *typed(LENGTH)]
Speed = Annotated[float, *typed(SPEED)]
Time = Annotated[float, *typed(TIME)]
Force = Annotated[float, *typed(FORCE)]
Stiffness = Annotated[float, *typed(STIFFNESS)]
BedStiffness = Annotated[float, *typed(BED_STIFFNESS)]
Pressure = Annotated[float, *typed(PRESSURE)]
Modulus = Annotated[float, *typed(MODULUS)]
Density = Annotated[float, *typed(DENSITY)]
Angle = Annotated[float, *typed(ANGLE)]
Frequency = Annotated[float, *typed(FREQUENCY)]
Rate = Annotated[float, *typed(RATE)]
Rotation = Annotated[float, *typed(ROTATION)]
AngularVelocity = Annotated[float, *typed(ANGULAR_VELOCITY)]
Area = Annotated[float, *typed(AREA)]
Volume = Annotated[float, *typed(VOLUME)]
Mass = Annotated[float, *typed(MASS)]
Inertia = Annotated[float, *typed(INERTIA)]
Acceleration = Annotated[float, *typed(ACCELERATION)]
DampingCoefficient = Annotated[float, *typed(DAMPING)]
Compliance = Annotated[float, *typed(COMPLIANCE)]
VolumeFlow = Annotated[float, *typed(VOLUME_FLOW)]
SonicConductance = Annotated[float, *typed(SONIC_CONDUCTANCE)]
GasConstant = Annotated[float, *typed(GAS_CONSTANT)]
DynamicViscosity = Annotated[float, *typed(DYNAMIC_VISCOSITY)]
KinematicViscosity = Annotated[float, *typed(KINEMATIC_VISCOSITY)]
Voltage = Annotated[float, *typed(VOLTAGE)]
Current = Annotated[float, *typed(CURRENT)]
Resistance = Annotated[float, *typed(RESISTANCE)]
Capacitance = Annotated[float, *typed(CAPACITANCE)]
Power = Annotated[float, *typed(POWER)]
Conductivity = Annotated[float, *typed(CONDUCTIVITY)]
FluxDensity = Annotated[float, *typed(FLUX_DENSITY)]
FieldStrength = Annotated[float, *typed(FIELD_STRENGTH)]
Permeance = Annotated[float, *typed(PERMEANCE)]
Flux = Annotated[float, *typed(FLUX)]
Temperature = Annotated[float, *_temperature()]
TemperatureRise = Annotated[float, *typed(TEMPERATURE_RISE)]
HeatCapacity = Annotated[float, *typed(HEAT_CAPACITY)]
SpecificHeat = Annotated[float, *typed(SPECIFIC_HEAT)]
ThermalConductance = Annotated[float, *typed(CONDUCTANCE)]
HeatTransfer = Annotated[float, *typed(HEAT_TRANSFER)]
Expansion = Annotated[float, *typed(EXPANSION)]
Level = Annotated[float, *typed(LEVEL)]
Ratio = Annotated[float, *typed(RATIO)]
LengthUnit = Annotated[
    float,
    BeforeValidator(_length_unit),
    WithJsonSchema({"type": "string", "examples": ["mm", "m", "inch"]}),
]
