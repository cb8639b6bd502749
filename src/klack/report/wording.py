"""Numbers as engineers write them."""

import re
from collections.abc import Mapping
from math import floor, isfinite, log10

import numpy as np
from numpy.typing import ArrayLike

from klack.units import takes_prefix

__all__ = [
    "count",
    "file_word",
    "fixed",
    "listed",
    "own_code",
    "power",
    "printed_unit",
    "quantity",
    "sentence",
    "share",
    "signed",
    "signed_share",
    "spelled",
    "typeset",
]

_PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
_WITHOUT_PREFIX = ("", "dB", "dBA", "sone", "phon", "acum")
_PURE_POWER = re.compile(r"m\^(?P<power>[23])")
_SMALL = 0.1  # [m] areas and volumes of less than its power are in mm^2, mm^3
_MINUS, _NONE = "\N{MINUS SIGN}", "–"
_BRACES = re.compile(r"(\{[^{}]*\})")
_MICRO = re.compile(
    r"(?:(?<=\d[ \u00a0\u202f])|(?<=[\[/*\u00b7]))u(?=(?:m|s|N|J|A|F|H|V|W|Wb|Pa)\b)"
)
_POWER = re.compile(r"(\b(?:[mcuµkn]?m|s|N|A|Pa))\^(-?[1-9])\b")
_EXPONENT = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?)e([+\-\u2212]?\d+)(?!\w|\.\d)")
_NEGATIVE = re.compile(r"(?<![^\s(\[])-(?=\d)")
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_THIN, _FIXED = "\N{NARROW NO-BREAK SPACE}", "\N{NO-BREAK SPACE}"


def quantity(value: float, unit: str, digits: int = 4) -> str:
    """Value with a prefix that keeps the number between 1 and 1000; no line breaks within.

    Pure numbers, levels, measures of sound and units that no prefix multiplies
    (:func:`klack.units.takes_prefix`) have none; masses are in grams, areas in mm^2 or m^2.

    >>> quantity(1.4823e-5, "s").split(), quantity(0.99996e3, "N").split()
    (['14.82', 'µs'], ['1.000', 'kN'])
    >>> quantity(7e-5, "m^2").split(), quantity(3e-3, "kg").split(), quantity(2e4, "1/s").split()
    (['70', 'mm^2'], ['3.000', 'g'], ['2e+04', '1/s'])
    >>> quantity(0.0123, "sone", 2).split(), quantity(-0.0123, "", 2)
    (['0.012', 'sone'], '−0.012')
    >>> quantity(7.27e-24, "J", 3).split()
    ['7.27e−24', 'J']
    """
    if not isfinite(value):
        return _NONE if value != value else "∞"
    if value == 0.0:
        return f"0{_space('µm' if unit == 'm' else unit)}"
    if unit in ("kg", "kg/s"):
        return quantity(1e3 * value, unit[1:], digits)
    pure = _PURE_POWER.fullmatch(unit)
    if pure is not None and abs(value) < _SMALL ** int(pure["power"]):
        value, unit = value * 1e3 ** int(pure["power"]), f"m{unit}"
    if unit in _WITHOUT_PREFIX or not takes_prefix(unit):
        return f"{value:.{digits}g}".replace("-", _MINUS) + _space(unit)
    rounded = float(f"{value:.{digits - 1}e}")
    power = min(max(3 * floor(log10(abs(rounded)) / 3 + 1e-12), -15), 9)
    if abs(rounded) < 10.0**power:  # smaller than all prefixes
        return f"{rounded:.{digits - 1}e}".replace("-", _MINUS) + _space(unit)
    scaled = rounded / 10.0**power
    decimals = max(0, digits - 1 - floor(log10(abs(scaled)) + 1e-12))
    return f"{scaled:.{decimals}f}".replace("-", _MINUS) + _space(_PREFIXES[power] + unit)


def printed_unit(values: ArrayLike, unit: str) -> tuple[str, float]:
    """Unit with the prefix that keeps the largest value between 1 and 1000, and its factor.

    >>> printed_unit([2e-5, -8e-5], "m")
    ('µm', 1000000.0)
    """
    if unit in _WITHOUT_PREFIX:
        return unit, 1.0
    largest = float(np.nanmax(np.abs(values), initial=0.0))
    if not largest > 0.0 or not takes_prefix(unit):
        return unit, 1.0
    power = min(max(3 * floor(log10(largest) / 3 + 1e-12), -12), 9)
    return _PREFIXES[power] + unit, float(f"1e{-power}")


def _space(unit: str) -> str:
    return _FIXED + unit.replace(" ", _FIXED) if unit else ""


def own_code(components: Mapping[str, str]) -> list[str]:
    """Name components that are not part of klack, with the first digits of their SHA-256.

    >>> own_code({"eddy_brake:EddyBrake": "0f3c5a7be912"})
    ['own component eddy_brake:EddyBrake (0f3c5a7be912)']
    """
    return [f"own component {word} ({digest})" for word, digest in components.items()]


def signed(value: float, decimals: int, unit: str = "") -> str:
    """With sign, also a plus.

    >>> signed(0.00114, 4), signed(-0.31, 2, "dB").split()
    ('+0.0011', ['−0.31', 'dB'])
    """
    if not isfinite(value):
        return _NONE
    text = _signless_zero(f"{value:+.{decimals}f}")
    return text.replace("-", _MINUS) + _space(unit)


def _signless_zero(text: str) -> str:
    return text.lstrip("+-") if float(text) == 0.0 else text


def share(value: float, decimals: int = 1) -> str:
    """Fraction as a percentage.

    >>> share(0.653).split()
    ['65.3', '%']
    """
    if not isfinite(value):
        return _NONE
    return _signless_zero(f"{100 * value:.{decimals}f}").replace("-", _MINUS) + _space("%")


def signed_share(value: float, decimals: int = 2) -> str:
    """Relative difference as a percentage with its sign.

    >>> signed_share(-0.0067).split()
    ['−0.67', '%']
    """
    return signed(100 * value, decimals, "%")


def count(value: int) -> str:
    """Whole number in groups of three digits."""
    return f"{value:,}".replace(",", _THIN)


def listed(words: list[str]) -> str:
    """List of words with commas and a final 'and'.

    >>> listed(["a", "b", "c"]), listed(["a"])
    ('a, b and c', 'a')
    """
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def file_word(text: str) -> str:
    """Word for links and file names.

    >>> file_word("Loop (spring.end force)")
    'loop-spring-end-force'
    """
    return re.sub(r"[^A-Za-z0-9]+", "-", text).strip("-").lower()


def sentence(text: str) -> str:
    """Begin with a capital letter and end with a full stop.

    >>> sentence("full order")
    'Full order.'
    """
    text = text.strip()
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", "!", "?")) or not text else ".")


def fixed(value: float, decimals: int, unit: str = "") -> str:
    """Number with fixed decimals.

    >>> fixed(-0.31, 1)
    '−0.3'
    """
    if not isfinite(value):
        return _NONE
    return _signless_zero(f"{value:.{decimals}f}").replace("-", _MINUS) + _space(unit)


def power(value: float) -> str:
    """One decimal and a power of ten.

    >>> power(3.2e-13)
    '3.2e−13'
    """
    return f"{value:.1e}".replace("-", _MINUS)


def spelled(text: str) -> str:
    r"""Words of klack as a page spells units and powers: one micro, minus and way of exponents.

    Braces hold keys of a case, to be copied as they are.

    >>> spelled("12 us on 5 N/um, 47.2 mm^3 {volume: 47.2 mm^3}").replace("\xa0", " ")
    '12 µs on 5 N/µm, 47.2 mm³ {volume: 47.2 mm^3}'
    >>> spelled("5.7e−15, at 2e+04 1/s: 0.0e+00."), spelled("stop 1e5b and 'us'")
    ('5.7·10⁻¹⁵, at 2·10⁴ 1/s: 0.', "stop 1e5b and 'us'")
    >>> spelled("-0.34 % off, -30 to (-5) in steel-1 of 2026-11-29")
    '−0.34 % off, −30 to (−5) in steel-1 of 2026-11-29'
    """
    parts = _BRACES.split(text)
    for k in range(0, len(parts), 2):
        plain = _MICRO.sub("µ", parts[k])
        plain = _POWER.sub(lambda found: found[1] + found[2].translate(_RAISED), plain)
        parts[k] = _NEGATIVE.sub(_MINUS, _EXPONENT.sub(_power_of_ten, plain))
    return "".join(parts)


def _power_of_ten(found: re.Match[str]) -> str:
    if float(found[1]) == 0.0:
        return "0"
    exponent = str(int(found[2].replace(_MINUS, "-"))).translate(_RAISED)
    return f"{found[1]}\N{MIDDLE DOT}10{exponent}"


def typeset(text: str) -> str:
    r"""What a terminal shows, with the signs of a page.

    >>> typeset("-3.0 dB").split(), typeset("x 1.2"), typeset("height [um]")
    (['−3.0', 'dB'], '×\xa01.2', 'height [µm]')
    """
    text = text.replace("[us]", "[µs]").replace("[um]", "[µm]")
    if text[:1] in ("-", "+", "x") and text[1:2] in " 0123456789":
        text = text.replace(" ", _FIXED).replace("x", "\N{MULTIPLICATION SIGN}", 1)
    return text.replace("-", _MINUS) if text[:1] == "-" else text
