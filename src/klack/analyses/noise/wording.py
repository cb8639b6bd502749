"""Sentences and words of a noise report."""

from klack.analyses.noise.measures import EXPOSURE_LEVEL_A, FORCE_LEVEL, strongest
from klack.analyses.noise.record import NoiseDesign, NoiseStudy
from klack.report.wording import fixed, listed, quantity, typeset

__all__ = ["noise_answer"]


def noise_answer(study: NoiseStudy) -> str:
    """Say in plain words how loud the first design is, and how the others differ from it."""
    first = study.reference
    stop = strongest(first)
    begin = f"One {first.kind} of '{first.name}'" if len(study.designs) > 1 else f"One {first.kind}"
    where = f" on '{stop.stop}'" if first.kind == "stroke" else ""
    text = f"{begin} has a peak force of {quantity(stop.peak_force, 'N', 3)}{where}. "
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
    peak = fixed(heard.statistics.peak_level, 0, "dB")
    text += (
        f". At {distance} one click is estimated at {peak} peak and "
        f"{_sone(heard.loudness.maximum)} (loudest moment)."
    )
    for other in study.designs[1:]:
        text += f" {_compared(first, other)}"
    return text


def _sone(value: float) -> str:
    return quantity(value, "sone", 2)


def _compared(first: NoiseDesign, other: NoiseDesign) -> str:
    if first.sound is None or other.sound is None:
        difference = typeset(FORCE_LEVEL.apart(other, first))
        return f"The level of the force of '{other.name}' differs by {difference}."
    loudness = other.sound.loudness.maximum
    times = loudness / first.sound.loudness.maximum if first.sound.loudness.maximum else 0.0
    factor = f", {times:.2g} times as loud" if times else ""
    return (
        f"That of '{other.name}' has {_sone(loudness)}{factor}; its A-weighted level differs by "
        f"{typeset(EXPOSURE_LEVEL_A.apart(other, first))}."
    )
