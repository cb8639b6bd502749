"""Numbers as engineers write them, and the answer of a study in one paragraph."""

from collections.abc import Mapping
from math import floor, isfinite, log10

from klack.contact.restitution import Deviation, ImpactMeasures
from klack.workflow.study import ImpactStudy, LevelResult
from klack.workflow.summary import contact_doubt

__all__ = [
    "answer",
    "count",
    "listed",
    "own_code",
    "quantity",
    "sentence",
    "share",
    "signed",
    "signed_share",
    "verdict",
    "which_contact",
]

_PREFIXES = {-15: "f", -12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}
_MINUS, _NONE = "\N{MINUS SIGN}", "–"
_SAME_SPEED = 5e-4
"""Relative change of the approach speed that three digits do not show."""

_THIN, _FIXED = "\N{NARROW NO-BREAK SPACE}", "\N{NO-BREAK SPACE}"


def quantity(value: float, unit: str, digits: int = 4) -> str:
    """Value with a prefix that keeps the number between 1 and 1000; no line breaks within.

    >>> quantity(1.4823e-5, "s").split(), quantity(0.99996e3, "N").split()
    (['14.82', 'µs'], ['1.000', 'kN'])
    """
    if not isfinite(value):
        return _NONE if value != value else "∞"
    if value == 0.0:
        return f"0{_space(unit)}"
    rounded = float(f"{value:.{digits - 1}e}")
    power = min(max(3 * floor(log10(abs(rounded)) / 3 + 1e-12), -15), 9)
    scaled = rounded / 10.0**power
    decimals = max(0, digits - 1 - floor(log10(abs(scaled)) + 1e-12))
    return f"{scaled:.{decimals}f}".replace("-", _MINUS) + _space(_PREFIXES[power] + unit)


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
    """Words with commas and a last 'and'.

    >>> listed(["a", "b", "c"]), listed(["a"])
    ('a, b and c', 'a')
    """
    return " and ".join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def sentence(text: str) -> str:
    """Begin with a capital letter and end with a full stop.

    >>> sentence("full order")
    'Full order.'
    """
    text = text.strip()
    return text[:1].upper() + text[1:] + ("" if text.endswith((".", "!", "?")) or not text else ".")


def answer(study: ImpactStudy) -> str:
    """Say what happened in plain words, and how close the reduced level comes to the reference."""
    needle, partner = study.bodies[0], study.bodies[1]
    reference = study.levels[study.reference]
    numbers = reference.measures
    text = (
        f"The {needle.name} ({quantity(1e3 * needle.mass, 'g', 3)}, "
        f"{numbers.approach_speed:.3g} m/s at first touch{_started(study, numbers)}) hits the "
        f"{partner.name} "
    )
    if numbers.cut_off:
        text += (
            "and is still in contact when the record ends, "
            f"{quantity(numbers.contact_time, 's', 3)} after first touch: the force has reached "
            f"{quantity(numbers.peak_force, 'N', 3)} by then, and peak force, contact time, "
            "impulse and restitution are cut off. "
        )
    else:
        text += (
            f"with a peak force of {quantity(numbers.peak_force, 'N', 3)}"
            f"{which_contact(numbers, numbers.strongest)}, stays in contact for "
            f"{quantity(numbers.contact_time, 's', 3)}{which_contact(numbers, 1)} and rebounds "
            f"with {share(numbers.restitution, 2)} of its speed at first touch; "
            f"{share(numbers.vibration_share)} of the impact energy is left behind as vibration. "
        )
    text += f"These numbers come from the {_called(study.reference)} run"
    if study.reference == "full":
        text += ", which follows every degree of freedom and every contact point"
    elif study.reference == "interface":
        text += ", which keeps the bodies as modes and decides the contact point by point"
    text += "."
    if doubt := contact_doubt(study.contact):
        text += f" {doubt}"
    if "reduced" in study.deviations:
        text += f" {verdict(study.levels['reduced'], study.deviations['reduced'])}"
    elif study.reference == "reduced" and "reduced" in study.estimates and study.estimates_settled:
        text += f" {_estimated(study.estimates['reduced'])}"
    return text


def which_contact(numbers: ImpactMeasures, number: int) -> str:
    """Which contact of several in one impact a number belongs to, in brackets; empty for one."""
    if numbers.sub_contacts < 2:
        return ""
    return f" (contact {number} of {numbers.sub_contacts} in quick succession)"


def _started(study: ImpactStudy, numbers: ImpactMeasures) -> str:
    """Speed at the start, where forces have changed it on the way."""
    if abs(numbers.approach_speed / study.speed - 1.0) < _SAME_SPEED:
        return ""
    return f", {study.speed:.3g} m/s at the start"


def verdict(result: LevelResult, deviation: Deviation) -> str:
    """How far one level is from the reference, in one sentence."""
    return (
        f"The {_called(result.level)} model ({count(result.degrees_of_freedom)} degrees of "
        f"freedom, computed in {quantity(result.wall_time, 's', 2)}) deviates from them by "
        f"{signed_share(deviation.peak_force)} in peak force, "
        f"{signed_share(deviation.contact_time)} in contact time and "
        f"{signed(deviation.restitution, 4)} in restitution; its force over time by "
        f"{share(deviation.history_l2, 2)} (root mean square)."
    )


def _estimated(estimate: Deviation) -> str:
    """Errors that one run of the interface level gives the reduced level."""
    return (
        f"Estimated error of this level: {signed_share(estimate.peak_force)} in peak force, "
        f"{signed_share(estimate.contact_time)} in contact time and "
        f"{signed(estimate.restitution, 4)} in restitution."
    )


def _called(level: str) -> str:
    return {"full": "full-order", "interface": "interface-level"}.get(level, level)
