"""Sentences and words of a noise report."""

from math import isfinite, log10

from klack.acoustics.third_octave import ENERGY_REFERENCE
from klack.analyses.noise.record import NoiseDesign, NoiseStudy
from klack.report.wording import listed, quantity, signed

__all__ = ["decibels", "force_level", "noise_answer"]


def force_level(design: NoiseDesign) -> float:
    """Level of all bands of the unbalanced force together [dB re (1 uN)^2 s]."""
    return 10.0 * log10(max(float(design.unbalanced_energy.sum()), 1e-300) / ENERGY_REFERENCE)


def decibels(value: float, decimals: int = 1) -> str:
    """Level with its unit.

    >>> decibels(61.25).split()
    ['61.2', 'dB']
    """
    return signed(value, decimals, "dB").lstrip("+") if isfinite(value) else "–"


def noise_answer(study: NoiseStudy) -> str:
    """Say in plain words how loud the first design is, and how the others differ from it."""
    first = study.reference
    strongest = max(first.stops, key=lambda stop: stop.peak_force)
    begin = f"One {first.kind} of '{first.name}'" if len(study.designs) > 1 else f"One {first.kind}"
    where = f" on '{strongest.stop}'" if first.kind == "stroke" else ""
    text = f"{begin} has a peak force of {quantity(strongest.peak_force, 'N', 3)}{where}. "
    if not first.bodies:
        return text + "There is no elastic held body, so nothing can be said about sound."
    bodies = listed([f"the {body.name}" for body in first.bodies])
    text += (
        f"It brings {quantity(first.injected_energy, 'J', 3)} of structure-borne energy into "
        f"{bodies}"
    )
    if first.sound is None:
        return text + "; no surface radiates."
    heard, distance = first.sound, quantity(first.settings.distance, "m", 3)
    peak = decibels(heard.statistics.peak_level, 0)
    text += (
        f". At {distance} one click is estimated at {peak} peak and "
        f"{_sone(heard.loudness.maximum)} (loudest moment)."
    )
    for other in study.designs[1:]:
        text += f" {_compared(first, other)}"
    return text


def _sone(value: float) -> str:
    return f"{value:.2g}\N{NO-BREAK SPACE}sone"


def _compared(first: NoiseDesign, other: NoiseDesign) -> str:
    if first.sound is None or other.sound is None:
        difference = signed(force_level(other) - force_level(first), 1, "dB")
        return f"The level of the force of '{other.name}' differs by {difference}."
    level = other.sound.statistics.exposure_level_A - first.sound.statistics.exposure_level_A
    loudness = other.sound.loudness.maximum
    times = loudness / first.sound.loudness.maximum if first.sound.loudness.maximum else 0.0
    factor = f", {times:.2g} times as loud" if times else ""
    return (
        f"That of '{other.name}' has {_sone(loudness)}{factor}; its A-weighted level differs by "
        f"{signed(level, 1, 'dB')}."
    )
