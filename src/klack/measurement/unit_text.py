"""Units as people write them into measured files: ``[µm]``, ``mm``, ``m/s²``, ``bar(g)``.

The usual spellings are in a table, others go through :func:`klack.units.parse_quantity`. Case
matters: mN is not MN.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from klack.errors import InputError
from klack.measurement.channels import ROLES, Role
from klack.units import TIME, Kind, parse_quantity

__all__ = ["UnitFactor", "is_unit", "no_unit", "plain_unit", "roles_of_unit", "unit_factor"]

_STANDARD_GRAVITY = 9.80665  # [m/s^2]
_ATMOSPHERE = 101325.0  # [Pa]
_LONGEST = 40

_SIGNS = str.maketrans(
    {"µ": "u", "μ": "u", "²": "^2", "³": "^3", "⁻": "^-", "¹": "1", "·": "*", "−": "-", "⋅": "*"}
)
_NONE = {"", "-", "--", "1", "none", "n/a", "unknown", "null", "?"}

_TABLE: Mapping[Role, Mapping[str, float]] = {
    "lift": {
        **dict.fromkeys(("m", "meter", "metre", "Meter"), 1.0),
        "cm": 1e-2,
        **dict.fromkeys(("mm", "millimeter", "millimetre"), 1e-3),
        **dict.fromkeys(("um", "micron", "microns", "micrometer", "micrometre", "mikron"), 1e-6),
        "nm": 1e-9,
        **dict.fromkeys(("in", "inch"), 25.4e-3),
        "mil": 25.4e-6,
    },
    "velocity": {
        **dict.fromkeys(("m/s", "m*s^-1", "m s^-1", "mps"), 1.0),
        **dict.fromkeys(("mm/s", "m/s*1e-3"), 1e-3),
        "um/s": 1e-6,
        "um/us": 1.0,
        "mm/ms": 1.0,
        "km/h": 1 / 3.6,
    },
    "current": {
        **dict.fromkeys(("A", "Amp", "Amps", "amp", "amps", "Ampere", "ampere"), 1.0),
        "mA": 1e-3,
        "uA": 1e-6,
        "kA": 1e3,
    },
    "voltage": {
        **dict.fromkeys(("V", "Volt", "volt", "Volts", "volts"), 1.0),
        "mV": 1e-3,
        "uV": 1e-6,
        "kV": 1e3,
    },
    "pressure": {
        **dict.fromkeys(("Pa", "N/m^2", "pascal", "Pascal"), 1.0),
        "hPa": 1e2,
        "kPa": 1e3,
        **dict.fromkeys(("MPa", "N/mm^2"), 1e6),
        **dict.fromkeys(("bar", "Bar", "BAR", "bara", "barA", "bar(a)", "bar abs"), 1e5),
        **dict.fromkeys(("barg", "barG", "bar(g)", "bar g", "bar rel"), 1e5),
        "mbar": 1e2,
        **dict.fromkeys(("psi", "psia"), 6894.757293168361),
        "psig": 6894.757293168361,
    },
    "acceleration": {
        **dict.fromkeys(("m/s^2", "m/s2", "m/s**2", "m/s/s", "m*s^-2", "m s^-2", "m/(s^2)"), 1.0),
        **dict.fromkeys(("mm/s^2", "mm/s2"), 1e-3),
        **dict.fromkeys(("g", "G", "gn", "g_n", "g0"), _STANDARD_GRAVITY),
        "mg": 1e-3 * _STANDARD_GRAVITY,
    },
    "force": {
        **dict.fromkeys(("N", "Newton", "newton"), 1.0),
        "mN": 1e-3,
        "kN": 1e3,
        "lbf": 4.4482216152605,
    },
}
"""Factors to SI by role; g (acceleration) is no mass in other roles."""

_TIMES: Mapping[str, float] = {
    **dict.fromkeys(
        ("s", "sec", "Sec", "second", "Second", "seconds", "Seconds", "Sekunden", "sek"), 1.0
    ),
    **dict.fromkeys(("ms", "msec", "millisecond", "milliseconds"), 1e-3),
    **dict.fromkeys(("us", "usec", "microsecond", "microseconds"), 1e-6),
    "ns": 1e-9,
    "min": 60.0,
    "h": 3600.0,
}
_GAUGE = {"barg", "barG", "bar(g)", "bar g", "bar rel", "psig"}


@dataclass(frozen=True, slots=True)
class UnitFactor:
    """Numbers of a file to SI: ``factor * number + offset``.

    Parameters
    ----------
    factor [SI unit per unit of the file]
    offset [SI unit]
        As of gauge pressure.
    """

    factor: float
    offset: float = 0.0


def plain_unit(text: str) -> str:
    """Unit without brackets and special signs.

    Examples
    --------
    >>> plain_unit("[µm]"), plain_unit(" (m/s²) "), plain_unit("bar(g)")
    ('um', 'm/s^2', 'bar(g)')
    """
    text = " ".join(text.split())
    while len(text) > 1 and (text[0], text[-1]) in (("[", "]"), ("(", ")"), ("{", "}"), ('"', '"')):
        text = text[1:-1].strip()
    return text.translate(_SIGNS).replace("^-^", "^-")


def no_unit(text: str) -> bool:
    """True for a text that means no unit, or nothing."""
    return plain_unit(text).lower() in _NONE


def unit_factor(text: str, quantity: Role | Kind, where: str) -> UnitFactor:
    """Read a unit of a file for a known quantity.

    Parameters
    ----------
    text
        With or without brackets.
    quantity
        Of the channel; ``klack.units.TIME`` for a time.

    Examples
    --------
    >>> unit_factor("[µm]", "lift", "bench.csv").factor
    1e-06
    >>> unit_factor("g", "acceleration", "bench.csv").factor
    9.80665
    """
    kind = quantity if isinstance(quantity, Kind) else ROLES[quantity]
    unit = plain_unit(text)
    table = (
        _TIMES
        if kind is TIME
        else next((units for role, units in _TABLE.items() if ROLES[role] is kind))
    )
    if unit in table:
        return UnitFactor(table[unit], _ATMOSPHERE if unit in _GAUGE else 0.0)
    if no_unit(text):
        raise InputError(
            where,
            got="no unit",
            expected=f"the unit of {kind.name}, e.g. {kind.common[0]}",
            hint="write the unit into the file, or as 'unit' of the channel in the section "
            "'measurement' of the case.",
        )
    try:
        return UnitFactor(parse_quantity(f"1 {unit[:_LONGEST]}", kind, where))
    except InputError as error:
        others = [ROLES[role].name for role in roles_of_unit(unit)]
        came = f" ({' or '.join(others)})" if others else ""
        raise InputError(
            where,
            got=f"the unit '{text[:_LONGEST]}'{came}",
            expected=f"a unit of {kind.name}: {', '.join(kind.common)}",
            hint="check that it is the right channel; 'unit' of the channel in the section "
            "'measurement' of the case overrides the file, and 'scale' is the number of "
            f"{kind.common[0]} per '{text[:_LONGEST]}' of a sensor.",
        ) from error


def roles_of_unit(text: str) -> tuple[Role, ...]:
    """Roles whose usual units include this one.

    Examples
    --------
    >>> roles_of_unit("[mm]"), roles_of_unit("s"), roles_of_unit("")
    (('lift',), (), ())
    """
    unit = plain_unit(text)
    return tuple(role for role in ROLES if unit in _TABLE[role])


def is_unit(text: str) -> bool:
    """True for a usual unit of time or of any role."""
    return plain_unit(text) in _TIMES or bool(roles_of_unit(text))
