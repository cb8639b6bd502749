"""Sound files of a noise study, to one scale."""

import re
from pathlib import Path

from klack.acoustics.drive_pattern import drive_pattern
from klack.acoustics.wav import full_scale_of, write_wav
from klack.analyses.noise.record import NoiseDesign, NoiseStudy
from klack.signals.sampled import TimeSeries

__all__ = ["StudySound", "common_full_scale", "study_sounds", "write_sounds"]

StudySound = tuple[str, NoiseDesign, TimeSeries]
"""File name, design, and sound pressure."""


def study_sounds(study: NoiseStudy) -> tuple[StudySound, ...]:
    """One click of each design, then its drive pattern [Pa]; at further ears clicks."""
    found: list[StudySound] = []
    for design in study.designs:
        if design.sound is None:
            continue
        click, settings = design.sound.pressure, design.settings
        pattern = drive_pattern(click, settings.rate, settings.duration)
        found.append((_file_name("click", study, design), design, click))
        found.append((_file_name("pattern", study, design), design, pattern))
        for ear in design.machine.ears[1:] if design.machine else ():
            if ear.sound is not None:
                name = _file_name(f"click-at-{ear.name}", study, design)
                found.append((name, design, ear.sound.pressure))
    return tuple(found)


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
