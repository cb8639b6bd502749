"""Which array of a file is its time, in which unit, and when it is zero."""

import re
from calendar import timegm
from collections.abc import Callable, Collection, Mapping

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.measurement.unit_text import no_unit, plain_unit, unit_factor
from klack.units import TIME

__all__ = [
    "PACKED",
    "SLOWEST",
    "clock_factor",
    "instant",
    "is_clock",
    "no_clock",
    "since",
    "unique_names",
    "unknown_scales",
    "unpacked",
]


SLOWEST = 1e-3  # [s]
"""Longest step at which a time without unit passes as seconds."""

_NAME = re.compile(
    r"(t|time|date[ /_-]?time|zeit|timestamps?|time[ _-]?stamp|timechannel|abtastzeit|messzeit|"
    r"abszisse|abscissa|x_value|x[ -]?axis)"
    r"([ _-]?(s|sec|ms|us|ns|abs|rel|axis|vector|\#?\d+))?",
    re.IGNORECASE,
)
_TIME_UNITS = {
    *("s", "sec", "Sec", "second", "Second", "seconds", "Seconds", "Sekunden"),
    *("ms", "msec", "millisecond", "milliseconds"),
    *("us", "usec", "microsecond", "microseconds", "ns"),
}


_INSTANT = re.compile(
    r"(\d{4})[-/.](\d\d?)[-/.](\d\d?)(?:[T\s]+(\d\d?):(\d\d)(?::(\d\d)(?:[.,](\d+))?)?)?"
    r"\s*(?:Z|UTC|GMT|([+-]\d\d?):?(\d\d)?)?"
)


def instant(text: str) -> int | None:
    """Date and time of day since 1970 [ns]; None for other texts.

    Examples
    --------
    >>> instant("1970-01-01T00:00:01.5"), instant("1970/01/02"), instant("1970-01-01 1:00 +01:00")
    (1500000000, 86400000000000, 0)
    """
    found = _INSTANT.fullmatch(text.strip())
    if found is None:
        return None
    *numbers, part, hours, minutes = found.groups(default="")
    year, month, day, hour, minute, second = (int(number or "0") for number in numbers)
    if not (1 <= month <= 12 and 1 <= day <= 31):
        return None
    ahead = 3600 * int(hours or "0")
    ahead += (-60 if hours.startswith("-") else 60) * int(minutes or "0")
    whole = timegm((year, month, day, hour, minute, second)) - ahead
    return 10**9 * whole + int(part[:9].ljust(9, "0"))


def since(unit: str) -> tuple[str, int | None]:
    """Unit and zero [ns] of a time as netCDF has it, ``seconds since 2026-03-02 08:00``."""
    plain, _, zero = unit.partition(" since ")
    return (plain.strip(), instant(zero)) if zero else (unit, None)


def is_clock(name: str, unit: str) -> bool:
    """True for a time by its name, or by a unit of time.

    Examples
    --------
    >>> is_clock("Time", ""), is_clock("t_rel", "ms"), is_clock("x", "s"), is_clock("lift", "um")
    (True, True, True, False)
    """
    plain = plain_unit(unit)
    if plain in _TIME_UNITS:
        return True
    return no_unit(unit) and _NAME.fullmatch(name.strip()) is not None


def clock_factor(unit: str, step: float, where: str) -> tuple[float, str]:
    """Seconds per unit of a stored time, and a note if the unit was assumed.

    Rejects a missing unit where seconds would make a recording slower than 1 kHz.

    Parameters
    ----------
    unit
        Of the file; may be empty.
    step [unit]
        Mean.
    """
    if not no_unit(unit):
        return unit_factor(unit, TIME, where).factor, ""
    if step <= SLOWEST:
        return 1.0, f"{where}: the time has no unit and is taken as seconds."
    raise InputError(
        where,
        got=f"a time without unit, with steps of {step:g}",
        expected="a time with its unit, e.g. 'time [ms]'",
        hint="write the unit into the header of the file, or give 'time_step' in the section "
        "'measurement' of the case.",
    )


def unique_names(names: list[str]) -> list[str]:
    """Number repeated names: ``lift #1``, ``lift #2``.

    Examples
    --------
    >>> unique_names(["lift", "lift", "current"])
    ['lift #1', 'lift #2', 'current']
    """
    seen: dict[str, int] = {}
    result = []
    for name in names:
        seen[name] = seen.get(name, 0) + 1
        result.append(name if names.count(name) == 1 else f"{name} #{seen[name]}")
    return result


def no_clock(where: str, looked_at: str = "") -> InputError:
    """Error of a file without time; names what was looked at."""
    return InputError(
        where,
        got="no time" + looked_at,
        expected="a channel of time with its unit, e.g. 'time [s]'",
        hint="add it to the file, or give 'time_step: 10 us' in the section 'measurement' of the "
        "case.",
    )


Vector = NDArray[np.float64]
About = Mapping[str, str | float]

_FACTOR, _OFFSET = PACKED = "scale_factor", "add_offset"
_MISSING = ("_fillvalue", "missing_value")
_SCALE = re.compile(
    r"(scal(e|ing)|gain|factor|slope|offset|intercept|sensitivity|calib|multipl|coeff|polynom|"
    r"(per|_per_)(bit|count|lsb|volt|digit)|\blsb\b|^_unsigned$)",
    re.IGNORECASE,
)
_NUMBER = re.compile(r"\s*[-+]?[.\d]")
_OF_THE_FILE = re.compile(r"(wf_|ni_|dimension|class$|name$|_netcdf|crest)", re.IGNORECASE)


def unpacked(about: About) -> Callable[[Vector], Vector] | None:
    """Function from stored numbers to values; None if they are the values.

    As netCDF: ``value = stored * scale_factor + add_offset``; ``_FillValue``, ``missing_value``
    and numbers outside ``valid_min`` to ``valid_max`` are missing. Any other key that sounds like
    a scale makes the numbers doubtful: its meaning is not guessed.
    """
    factor, offset = _number(about, _FACTOR, 1.0), _number(about, _OFFSET, 0.0)
    missing = [value for key in _MISSING if isinstance(value := about.get(key), float)]
    low, high = _number(about, "valid_min", -np.inf), _number(about, "valid_max", np.inf)
    if (factor, offset, low, high) == (1.0, 0.0, -np.inf, np.inf) and not missing:
        return None

    def values(stored: Vector) -> Vector:
        absent = np.isin(stored, missing) | (stored < low) | (stored > high)
        return np.where(absent, np.nan, stored * factor + offset)

    return values


def _number(about: About, key: str, otherwise: float) -> float:
    value = about.get(key)
    return value if isinstance(value, float) else otherwise


def unknown_scales(about: Mapping[str, object], known: Collection[str] = ()) -> str:
    """Keys that sound like a scale and change something, with their values.

    Those that are ``known`` are applied, if they are numbers.
    """
    found = []
    for key, value in about.items():
        if _OF_THE_FILE.match(key) or not _SCALE.search(key):
            continue
        if key in known and isinstance(value, float):
            continue
        text = str(value).strip()
        if isinstance(value, str) and (not _NUMBER.match(text) or instant(text) is not None):
            continue
        neutral = 0.0 if re.search("offset|intercept", key, re.IGNORECASE) else 1.0
        if not (isinstance(value, int | float) and float(value) == neutral):
            found.append(f"{key} = {text[:40]}")
    return ", ".join(found)
