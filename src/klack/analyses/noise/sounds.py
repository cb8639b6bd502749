"""Sound files of a noise study, to one scale."""

import re
from collections.abc import Iterator
from pathlib import Path

from klack.acoustics.drive_pattern import drive_pattern
from klack.acoustics.wav import full_scale_of, write_wav
from klack.analyses.noise.record import NoiseDesign, NoiseStudy
from klack.signals.sampled import TimeSeries

__all__ = ["StudySound", "common_full_scale", "study_sounds", "write_sounds"]

StudySound = tuple[str, NoiseDesign, TimeSeries]
"""File name, design, and sound pressure."""


def study_sounds(study: NoiseStudy) -> tuple[StudySound, ...]:
    """Clicks of each design and its drive pattern [Pa]; see :func:`_of_design`."""
    return tuple(
        (_file_name(what, study, design), design, pressure)
        for design in study.designs
        for what, pressure in _of_design(design)
    )


def _of_design(design: NoiseDesign) -> Iterator[tuple[str, TimeSeries]]:
    """One click, its pattern, clicks at further ears and of the own surface."""
    if design.sound is not None:
        click, settings = design.sound.pressure, design.settings
        yield "click", click
        yield "pattern", drive_pattern(click, settings.rate, settings.duration)
        for ear in design.machine.ears[1:] if design.machine else ():
            if ear.sound is not None:
                yield f"click-at-{ear.name}", ear.sound.pressure
    if design.own_sound is not None:
        yield "own-surface-on-the-axis", design.own_sound.axis
        yield "own-surface-beside", design.own_sound.side


def common_full_scale(sounds: tuple[StudySound, ...]) -> float:
    """Full scale [Pa] of all files, so that designs compare by ear."""
    return full_scale_of(*(pressure for *_, pressure in sounds))


def write_sounds(study: NoiseStudy, folder: Path) -> tuple[str, ...]:
    """Write WAV files of 24 bit and 48 kHz to one full scale; return the names."""
    sounds = study_sounds(study)
    scale = common_full_scale(sounds)
    for name, _, pressure in sounds:
        write_wav(folder / name, pressure, full_scale=scale)
    return tuple(name for name, *_ in sounds)


def _file_name(what: str, study: NoiseStudy, design: NoiseDesign) -> str:
    """``click.wav`` alone, ``click-<design>.wav`` among several."""
    if len(study.designs) == 1:
        return f"{what}.wav"
    words = [re.sub(r"[^A-Za-z0-9_-]+", "-", d.name).strip("-") for d in study.designs]
    k = study.designs.index(design)
    word = words[k] if words.count(words[k]) == 1 else f"{words[k]}-{k + 1}"
    return f"{what}-{word}.wav"
