"""The few numbers of a noise study that a script or a terminal wants."""

from collections.abc import Iterator, Sequence
from typing import cast

import numpy as np

from klack.acoustics.third_octave import ENERGY_REFERENCE, ThirdOctaves, nominal_label
from klack.analyses.analysis import TextTable
from klack.analyses.json_results import (
    BandJson,
    BodyNoiseJson,
    ClickJson,
    DesignNoiseJson,
    NoiseJson,
)
from klack.analyses.measures import number_or_none
from klack.analyses.noise.record import BodyNoise, ClickSound, NoiseDesign, NoiseStudy

__all__ = ["NOISE_COLUMNS", "noise_rows", "noise_to_json", "noise_told"]

# dBA: A-weighted, dBZ: unweighted (IEC 61672-1)
NOISE_COLUMNS = (
    "design",
    "peak force [N]",
    "force [dB]",
    "injected [uJ]",
    "to mount, plate [uJ]",
    "radiated [nJ]",
    "SEL [dBA]",
    "SEL [dBZ]",
    "peak [dBZ]",
    "loudness [sone]",
    "sharpness [acum]",
    "up to [kHz]",
)


def noise_told(study: NoiseStudy) -> Iterator[TextTable | str]:
    """What a terminal shows: the designs side by side."""
    yield TextTable(title=study.title, columns=NOISE_COLUMNS, rows=noise_rows(study))


def noise_rows(study: NoiseStudy) -> tuple[tuple[str, ...], ...]:
    """Rows of :data:`NOISE_COLUMNS` as text: one per design, then how far each is from the first.

    Differences are levels; those of loudness and sharpness are factors.
    """
    first, *others = study.designs
    return (
        *(_row(design) for design in study.designs),
        *(_difference_row(design, first) for design in others),
    )


def _difference_row(design: NoiseDesign, first: NoiseDesign) -> tuple[str, ...]:
    now, then = design.sound, first.sound
    heard = (
        ("–",) * 5
        if now is None or then is None
        else (
            _decibels(now.statistics.exposure_level_A - then.statistics.exposure_level_A),
            _decibels(now.statistics.exposure_level - then.statistics.exposure_level),
            _decibels(now.statistics.peak_level - then.statistics.peak_level),
            _factor(now.loudness.maximum, then.loudness.maximum),
            _factor(now.loudness.sharpness, then.loudness.sharpness),
        )
    )
    return (
        f"{design.name} - {first.name}",
        _decibels(_ratio_level(_peak(design), _peak(first), 20.0)),
        _decibels(_force_level(design) - _force_level(first)),
        _decibels(_ratio_level(design.injected_energy, first.injected_energy, 10.0)),
        _decibels(_ratio_level(design.support_energy, first.support_energy, 10.0)),
        _decibels(_ratio_level(design.radiated_energy, first.radiated_energy, 10.0)),
        *heard,
        "",
    )


def _ratio_level(value: float, other: float, factor: float) -> float:
    """Level of a ratio [dB], ``factor`` 20 of forces and 10 of energies; nan unless both are."""
    return factor * float(np.log10(value / other)) if value > 0.0 and other > 0.0 else float("nan")


def _decibels(value: float) -> str:
    return f"{round(value, 1) + 0.0:+.1f} dB" if np.isfinite(value) else "–"


def _factor(value: float, other: float) -> str:
    return f"x {value / other:.3g}" if value > 0.0 and other > 0.0 else "–"


def _peak(design: NoiseDesign) -> float:
    return max(stop.peak_force for stop in design.stops)


def _force_level(design: NoiseDesign) -> float:
    return float(10.0 * np.log10(max(design.unbalanced_energy.sum(), 1e-300) / ENERGY_REFERENCE))


def _row(design: NoiseDesign) -> tuple[str, ...]:
    sound = design.sound
    heard = (
        ("–",) * 5
        if sound is None
        else (
            f"{sound.statistics.exposure_level_A:.1f}",
            f"{sound.statistics.exposure_level:.1f}",
            f"{sound.statistics.peak_level:.1f}",
            f"{sound.loudness.maximum:.3g}",
            f"{sound.loudness.sharpness:.3g}",
        )
    )
    return (
        design.name,
        f"{_peak(design):.4g}",
        f"{_force_level(design):.1f}",
        _number(1e6 * design.injected_energy),
        _number(1e6 * design.support_energy),
        _number(1e9 * design.radiated_energy),
        *heard,
        _number(1e-3 * design.valid_up_to),
    )


def _number(value: float) -> str:
    return f"{value:.4g}" if np.isfinite(value) else "–"


def noise_to_json(study: NoiseStudy) -> NoiseJson:
    """Plain numbers in SI, the unit in the key.

    Returns
    -------
    dict
        The numbers of the first design (``third_octave``: level of the force of all its stops in
        dB re (1 uN)^2 s; ``injected_energy_J``, ``loudness_max_sone`` and so on), and ``designs``:
        the same for every design by name.  Numbers that do not exist are None.
    """
    designs = {design.name: _design(design) for design in study.designs}
    return {
        "schema": "klack-noise/1",
        "case": study.case,
        **designs[study.reference.name],
        "designs": designs,
    }


def _design(design: NoiseDesign) -> DesignNoiseJson:
    bands = design.stops[0].bands
    return {
        "kind": design.kind,
        "run": design.run,
        "own_components": dict(design.own_components),
        "third_octave": _bands(bands, design.band_energy),
        "injected_energy_J": number_or_none(design.injected_energy),
        "support_energy_J": number_or_none(design.support_energy),
        "radiated_energy_J": number_or_none(design.radiated_energy),
        "radiated_energy_upper_bound_J": number_or_none(design.upper_bound),
        "valid_from_Hz": number_or_none(design.valid_from),
        "balanced_below_Hz": number_or_none(design.balanced_below),
        "valid_up_to_Hz": number_or_none(design.valid_up_to),
        **_sound(design.sound),
        "stops": {
            stop.stop: {
                "impacts": stop.impacts,
                "peak_force_N": number_or_none(stop.peak_force),
                "impulse_Ns": number_or_none(stop.impulse),
                "third_octave": _bands(stop.bands, stop.bands.energy),
            }
            for stop in design.stops
        },
        "bodies": {body.name: _body(body) for body in design.bodies},
    }


def _bands(bands: ThirdOctaves, energy: Sequence[float] | np.ndarray) -> list[BandJson]:
    return [
        {
            "center_Hz": float(middle),
            "nominal": nominal_label(int(number)),
            "level_dB": float(10.0 * np.log10(max(float(value), 1e-300) / ENERGY_REFERENCE)),
        }
        for number, middle, value in zip(bands.number, bands.middle, energy, strict=True)
    ]


def _body(body: BodyNoise) -> BodyNoiseJson:
    radiated = body.radiated.sum(axis=1)
    return {
        "highest_mode_Hz": number_or_none(body.highest_frequency),
        "injected_energy_J": dict(zip(body.ports, map(number_or_none, body.injected), strict=True)),
        "vibration_energy_J": number_or_none(body.vibration_energy),
        "vibration_energy_by_mobility_J": number_or_none(body.vibration_spectral),
        "radiated_energy_J": dict(zip(body.groups, map(number_or_none, radiated), strict=True)),
    }


def _sound(sound: ClickSound | None) -> ClickJson:
    if sound is None:
        return cast(ClickJson, dict.fromkeys(_SOUND_KEYS))
    one, pattern = sound.statistics, sound.pattern
    values = (
        sound.loudness.maximum,
        sound.loudness.level,
        sound.loudness.sharpness,
        pattern.kurtosis,
        pattern.crest_factor,
        one.exposure_level,
        one.exposure_level_A,
        one.peak_level,
        pattern.equivalent_level_A,
    )
    numbers = {key: number_or_none(value) for key, value in zip(_SOUND_KEYS, values, strict=True)}
    return cast(ClickJson, numbers)


_SOUND_KEYS = (
    "loudness_max_sone",
    "loudness_level_phon",
    "sharpness_acum",
    "kurtosis",
    "crest_factor",
    "sound_exposure_level_dB",
    "sound_exposure_level_dBA",
    "peak_level_dB",
    "pattern_level_dBA",
)
