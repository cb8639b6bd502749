"""Measures of noise."""

from collections.abc import Callable
from dataclasses import replace
from math import log10, nan
from typing import Any, cast

from klack.acoustics.signal_statistics import PRESSURE_REFERENCE, SoundStatistics
from klack.acoustics.source_levels import FORCE_REFERENCE, VELOCITY_REFERENCE
from klack.acoustics.third_octave import ENERGY_REFERENCE
from klack.analyses.measures import Column, Measure, Value, described_in
from klack.analyses.noise.record import (
    BodyNoise,
    ClickSound,
    EarSound,
    InSituFreedom,
    InterfaceFreedom,
    MountFreedom,
    MountSource,
    NoiseDesign,
    PathSound,
    StopForce,
)

__all__ = [
    "AT_MOUNTS",
    "BODY_MEASURES",
    "CLICK_MEASURES",
    "DESIGN_MEASURES",
    "EAR_MEASURES",
    "EXPOSURE_LEVEL_A",
    "FORCE_LEVEL",
    "INTERFACE_MEASURES",
    "IN_SITU_MEASURES",
    "MOUNT_MEASURES",
    "PATH_MEASURES",
    "STOP_MEASURES",
    "strongest",
]

_THEORY, _SOUND = "theory/noise", "theory/sound"
_COUPLING = "theory/structure-borne-source"
_AUDIBLE = 20e3  # [Hz]
_NOTHING = 1e-10  # of the square of a reference


def strongest(design: NoiseDesign) -> StopForce:
    """Stop with the highest force."""
    return max(design.stops, key=lambda stop: stop.peak_force)


def _heard(read: Callable[[ClickSound], Value]) -> Callable[[NoiseDesign], Value]:
    return lambda design: None if design.sound is None else read(design.sound)


def _too_faint(design: NoiseDesign) -> str:
    return "too faint" if design.sound is not None and design.sound.loudness.note else ""


_LEVEL = Measure[Any](key="level", definition="", unit="dB", form="fixed", digits=1, page=True)
"""What all levels have: one decimal, and a row of the report."""


def _column(head: str = "", unit: str = "dB") -> Column:
    return Column(unit, 1.0, ".1f", head)


FORCE_LEVEL: Measure[NoiseDesign] = replace(
    _LEVEL,
    key="force_level",
    name="level of the unbalanced force",
    symbol="L_F",
    definition="Level of ∫ F² dt over all bands, re 1 pN² s = (1 µN)² s: the level re 1 µN of a "
    "steady force with the same energy in one second.",
    note="Springs, magnet and fluid act between the needle and the housing that it hits; below "
    "about one over the time of flight they balance the contact forces. The rest is mass times "
    "acceleration of the needle. Sound and surface motion include this share of every band, or "
    "with noise.mounts all forces; injected energy, mobility and blocked force include only the "
    "contact forces. Third octaves follow IEC 61260-1 (base ten); outside the record the force "
    "keeps its first and last value.",
    read=lambda design: (
        10.0 * log10(max(float(design.unbalanced_energy.sum()), 1e-300) / ENERGY_REFERENCE)
    ),
    column=_column("force"),
    deviation="difference",
)
CLICK_MEASURES: tuple[Measure[SoundStatistics], ...] = described_in(
    _SOUND,
    replace(
        _LEVEL,
        key="sound_exposure_level_weighted",
        json_name="sound_exposure_level_dBA",
        name="sound exposure level of a click, A-weighted",
        symbol="L_AE",
        unit="dBA",
        definition="Level of ∫ p² dt of one click with weighting A, re (20 µPa)² s.",
        read=lambda click: click.exposure_level_A,
        column=_column("SEL", "dBA"),
        deviation="difference",
    ),
    replace(
        _LEVEL,
        key="sound_exposure_level",
        name="sound exposure level of a click",
        symbol="L_E",
        definition="Level of ∫ p² dt of one click without weighting, re (20 µPa)² s.",
        read=lambda click: click.exposure_level,
        column=_column("SEL", "dBZ"),
        deviation="difference",
    ),
    replace(
        _LEVEL,
        key="peak_level",
        name="peak level of a click",
        symbol="L_peak",
        definition="Level of the largest pressure of one click without weighting, re 20 µPa.",
        read=lambda click: click.peak_level,
        column=_column("peak", "dBZ"),
        deviation="difference",
    ),
    replace(
        _LEVEL,
        key="peak_level_weighted",
        json_name="peak_level_dBC",
        name="peak level of a click, C-weighted",
        symbol="L_Cpeak",
        unit="dBC",
        definition="Level of the largest pressure of one click with weighting C, re 20 µPa.",
        read=lambda click: click.peak_level_C,
        deviation="difference",
    ),
    replace(
        _LEVEL,
        key="fast_level",
        json_name="fast_level_dBA",
        name="highest level of a click, A-weighted, fast",
        symbol="L_AFmax",
        unit="dBA",
        definition="Highest level of one click with the frequency weighting A and the time "
        "weighting F (125 ms), re 20 µPa, as shown by a sound level meter.",
        read=lambda click: click.fast_level_A,
        deviation="difference",
    ),
)
"""Of one click, from its pressure alone."""


def _of_design(measure: Measure[SoundStatistics]) -> Measure[NoiseDesign]:
    read = _heard(lambda sound: measure.read(sound.statistics))
    return replace(cast(Measure[NoiseDesign], measure), read=read)


_OF_DESIGNS = tuple(map(_of_design, CLICK_MEASURES))
EXPOSURE_LEVEL_A = _OF_DESIGNS[0]


def _mounted(
    read: Callable[[MountSource], float], reference: float
) -> Callable[[NoiseDesign], Value]:
    def level(design: NoiseDesign) -> Value:
        if design.at_mounts is None:
            return None
        found = read(design.at_mounts)
        return 10.0 * log10(found / reference**2) if found > 0.0 else None

    return level


AT_MOUNTS: tuple[Measure[NoiseDesign], ...] = tuple(
    replace(
        _LEVEL,
        key=key,
        name=name,
        symbol=symbol,
        definition=definition,
        source=_COUPLING,
        read=_mounted(read, reference),
        deviation="difference",
    )
    for key, name, symbol, definition, read, reference in (
        (
            "mount_velocity_level",
            "free velocity at all mounts",
            "L_vf",
            "Exposure of one click, ∫ v² dt to 20 kHz, over all directions of all free mounts, re "
            "(1 nm/s)² s.",
            lambda source: source.along(lambda item: item.velocity_bands),
            VELOCITY_REFERENCE,
        ),
        (
            "mount_force_level",
            "blocked force at all mounts",
            "L_Fb",
            "Exposure of one click, ∫ F² dt to 20 kHz, over all directions of all held mounts, re "
            "(1 µN)² s.",
            lambda source: source.along(lambda item: item.force_bands),
            FORCE_REFERENCE,
        ),
        (
            "equivalent_force_level",
            "equivalent blocked force (EN 15657)",
            "L_Fb,eq",
            "Exposure of one click to 20 kHz of the single force that gives a concrete reception "
            "plate of 100 mm the same power, re (1 µN)² s.",
            lambda source: source.equivalent_force,
            FORCE_REFERENCE,
        ),
        (
            "equivalent_velocity_level",
            "equivalent free velocity (EN 15657)",
            "L_vf,eq",
            "Exposure of one click to 20 kHz of the single free velocity that gives a steel "
            "reception plate of 0.3 mm the same power, re (1 nm/s)² s.",
            lambda source: source.equivalent_velocity,
            VELOCITY_REFERENCE,
        ),
    )
)
"""Single numbers of the source at its mounts; none without."""
DESIGN_MEASURES: tuple[Measure[NoiseDesign], ...] = described_in(
    _THEORY,
    Measure(
        key="peak_force",
        symbol="F_max",
        unit="N",
        definition="Largest force of any stop, mean over a time step.",
        source="theory/impact",
        read=lambda design: strongest(design).peak_force,
        digits=3,
        column=Column("N", 1.0, ".4g"),
        deviation="amplitude",
        page=True,
    ),
    FORCE_LEVEL,
    Measure(
        key="injected_energy",
        name="structure-borne energy injected, bodies rigidly held",
        symbol="W_in",
        unit="J",
        definition="Work of contact and film forces on the modes of the rigidly held bodies, "
        "∫ F v dt.",
        note="The same from the real part of the drive-point mobility: ∫ 2 Re(Y) |F|² df.",
        digits=3,
        column=Column("uJ", 1e6, ".4g", "injected"),
        deviation="energy",
        page=True,
    ),
    Measure(
        key="support_energy",
        name="energy through the mounts",
        symbol="W_s",
        unit="J",
        definition="Energy that all forces together transmit through the held surfaces into "
        "mount and plate, or into the machine and its elements.",
        note="Here the valve moves as a whole. The injected energy is the work of the contacts "
        "on bodies with fixed held surfaces, and stays in them: neither is part of the other.",
        digits=3,
        column=Column("uJ", 1e6, ".4g", "to the mount"),
        deviation="energy",
        page=True,
    ),
    Measure(
        key="radiated_energy",
        name="sound energy radiated (estimate)",
        symbol="W_rad",
        unit="J",
        definition="Sound energy that the surfaces radiate during one run, estimated.",
        digits=3,
        column=Column("nJ", 1e9, ".4g", "radiated"),
        deviation="energy",
        page=True,
    ),
    Measure(
        key="audible_energy",
        name="sound energy up to 20 kHz (estimate)",
        symbol="W_aud",
        unit="J",
        definition="Part of the radiated sound energy up to 20 kHz, estimated.",
        read=lambda design: float(design.radiated_bands[design.band_middle <= _AUDIBLE].sum()),
        digits=3,
        deviation="energy",
        page=True,
    ),
    Measure(
        key="equivalent_radiated_energy",
        name="sound energy at radiation efficiency 1",
        symbol="W_erp",
        unit="J",
        definition="Equivalent radiated energy, radiation efficiency 1.",
        read=lambda design: design.equivalent_energy,
        digits=3,
        deviation="energy",
        page=True,
    ),
    *_OF_DESIGNS,
    replace(
        _LEVEL,
        key="pattern_level",
        name="level of the drive pattern, A-weighted",
        symbol="L_Aeq",
        unit="dBA",
        definition="Equivalent level of the drive pattern over whole periods with weighting A, "
        "re 20 µPa.",
        source=_SOUND,
        read=_heard(lambda sound: sound.pattern.equivalent_level_A),
        deviation="difference",
    ),
    Measure(
        key="loudness_max",
        name="loudness, loudest moment",
        symbol="N_max",
        unit="sone",
        definition="Loudness of one click at its loudest moment, ISO 532-1 for sounds that vary in "
        "time (Zwicker), free field.",
        note="1 sone is the loudness of 40 dB at 1 kHz; twice the number is twice as loud.",
        source=_SOUND,
        read=_heard(lambda sound: sound.loudness.maximum),
        digits=3,
        column=Column("sone", 1.0, ".3g", "loudness"),
        deviation="factor",
        page=True,
    ),
    Measure(
        key="loudness_level",
        name="loudness level, loudest moment",
        symbol="L_N",
        unit="phon",
        definition="Loudness level of the loudest moment.",
        source=_SOUND,
        read=_heard(lambda sound: sound.loudness.level),
        digits=3,
        page=True,
    ),
    Measure(
        key="sharpness",
        symbol="S",
        unit="acum",
        definition="Sharpness of one click, DIN 45692; missing where it is too faint for one.",
        source=_SOUND,
        read=_heard(lambda sound: sound.loudness.sharpness or nan),  # 0 up to klack 0.2
        digits=3,
        column=Column("acum", 1.0, ".3g"),
        why=_too_faint,
        deviation="factor",
        page=True,
    ),
    Measure(
        key="impulsive_prominence",
        name="impulsive prominence of the drive pattern",
        symbol="P",
        definition="3 lg(OR/(dB/s)) + 2 lg(LD/dB) of the most prominent rise of the level with "
        "the weightings A and F in steps of 20 ms, ISO/PAS 1996-3; above the steady noise of "
        "the case, or above the remainder of the previous click.",
        source=_SOUND,
        read=_heard(
            lambda sound: None if sound.prominence is None else sound.prominence.prominence
        ),
        form="fixed",
        digits=2,
        deviation="difference",
        page=True,
    ),
    replace(
        _LEVEL,
        key="impulse_adjustment",
        name="adjustment for impulsive sound",
        symbol="K_I",
        definition="1.8 (P - 5) dB of an impulsive prominence P above 5, otherwise 0: added to "
        "the equivalent level where a noise is rated; above 9 dB beyond the usual range of the "
        "method.",
        source=_SOUND,
        read=_heard(
            lambda sound: None if sound.prominence is None else sound.prominence.adjustment
        ),
        deviation="difference",
    ),
    Measure(
        key="kurtosis",
        name="kurtosis of the drive pattern",
        symbol="k",
        definition="Fourth moment of the drive pattern over whole periods, over the squared "
        "second: 3 for Gaussian noise, high for rare clicks.",
        source=_SOUND,
        read=_heard(lambda sound: sound.pattern.kurtosis),
        digits=3,
        deviation="factor",
        page=True,
    ),
    Measure(
        key="crest_factor",
        name="crest factor of the drive pattern",
        symbol="p_max/p_rms",
        definition="Largest over root mean square pressure of the drive pattern.",
        source=_SOUND,
        read=_heard(lambda sound: sound.pattern.crest_factor),
        digits=3,
        deviation="factor",
        page=True,
    ),
    *AT_MOUNTS,
    Measure(
        key="valid_from",
        symbol="f_1",
        unit="Hz",
        definition="One over the length of the record; 0 where every force ends at its initial "
        "value.",
        source="theory/spectra",
        digits=3,
    ),
    Measure(
        key="balanced_below",
        symbol="f_b",
        unit="Hz",
        definition="Frequency below which at least half of the forces is balanced within the "
        "valve.",
        digits=3,
    ),
    Measure(
        key="valid_up_to",
        name="force valid up to",
        symbol="f_2",
        unit="Hz",
        definition="Lowest of the highest kept modes of the bodies.",
        source="theory/reduction",
        digits=3,
        column=Column("kHz", 1e-3, ".4g", "up to"),
        page=True,
    ),
)
"""Of one design, from the force of the stops to the sound."""

STOP_MEASURES: tuple[Measure[StopForce], ...] = described_in(
    _THEORY,
    Measure(
        key="impacts",
        symbol="n",
        definition="Impacts on the stop.",
        source="theory/stroke",
        kind="whole",
        page=True,
    ),
    Measure(
        key="peak_force",
        symbol="F_max",
        unit="N",
        definition="Largest force of the stop, mean over a time step.",
        source="theory/impact",
        page=True,
    ),
    Measure(
        key="impulse",
        name="impulse of the record",
        symbol="J",
        unit="N s",
        definition="Integral of the force over the whole record, including the force at rest.",
        source="theory/impact",
        page=True,
    ),
)
"""Of the force of one stop."""

BODY_MEASURES: tuple[Measure[BodyNoise], ...] = described_in(
    _THEORY,
    Measure(
        key="highest_mode",
        symbol="f_max",
        unit="Hz",
        definition="Frequency of the highest kept mode.",
        source="theory/reduction",
        read=lambda body: body.highest_frequency,
        digits=3,
    ),
    Measure(
        key="vibration_energy",
        title="vibration\nby time",
        symbol="E_v",
        unit="J",
        definition="Energy lost in the modes or still ringing when the record ends, from the "
        "motion over time.",
        page=True,
    ),
    Measure(
        key="vibration_energy_by_mobility",
        title="vibration\n∫ 2 Re(Y) |F|² df",
        symbol="E_v",
        unit="J",
        definition="The same over frequency, ∫ 2 Re(Y) |F|² df; missing for a body without "
        "damping.",
        read=lambda body: body.vibration_spectral,
        page=True,
    ),
    Measure(
        key="dissipated_energy",
        title="lost by the end",
        symbol="E_d",
        unit="J",
        definition="Part of the vibration energy that is lost by the end of the record.",
        read=lambda body: body.dissipated,
        digits=3,
        page=True,
    ),
    Measure(
        key="ringing_energy",
        title="still ringing",
        symbol="E_r",
        unit="J",
        definition="Part of the vibration energy that still rings at the end of the record.",
        read=lambda body: body.ringing,
        digits=3,
        page=True,
    ),
    Measure(
        key="static_energy",
        title="stored more at rest",
        symbol="E_s",
        unit="J",
        definition="Energy stored statically in the modes at the end, minus the energy at the "
        "start.",
        digits=3,
        page=True,
    ),
)
"""Of one rigidly held body."""


def _exposure_level(energy: float, reference: float) -> float | None:
    """None of what does not move, and of its round-off."""
    return 10.0 * log10(energy / reference**2) if energy > _NOTHING * reference**2 else None


MOUNT_MEASURES: tuple[Measure[MountFreedom], ...] = described_in(
    "theory/structure-borne-source",
    replace(
        _LEVEL,
        key="free_velocity_level",
        name="free velocity",
        symbol="L_vf",
        definition="Exposure of one click, ∫ v² dt over the bands to 20 kHz, of mounts that are "
        "free, re (1 nm/s)² s; of rotations re (1 nrad/s)² s.",
        note="ISO 9611 refers to 50 nm/s, which gives levels 34 dB lower.",
        read=lambda freedom: _exposure_level(
            float(freedom.velocity_bands.energy.sum()), VELOCITY_REFERENCE
        ),
        column=_column(),
    ),
    replace(
        _LEVEL,
        key="blocked_force_level",
        name="blocked force",
        symbol="L_Fbl",
        definition="Exposure of one click, ∫ F² dt over the bands to 20 kHz, on mounts that are "
        "held, re (1 µN)² s; of moments re (1 µN m)² s.",
        read=lambda freedom: _exposure_level(
            float(freedom.force_bands.energy.sum()), FORCE_REFERENCE
        ),
        column=_column(),
    ),
)

INTERFACE_MEASURES: tuple[Measure[InterfaceFreedom], ...] = described_in(
    _COUPLING,
    replace(
        _LEVEL,
        key="force_on_machine_level",
        name="force on the machine",
        symbol="L_g",
        definition="Exposure of one click, ∫ F² dt over the known bands, on the machine, re (1 "
        "µN)² s; of moments re (1 µN m)² s.",
        read=lambda freedom: _exposure_level(
            float(freedom.force_bands.energy.sum()), FORCE_REFERENCE
        ),
        column=_column(),
    ),
    replace(
        _LEVEL,
        key="blocked_force_beside_level",
        name="blocked force in the same bands",
        symbol="L_Fbl",
        definition="Exposure of the blocked force of the same degree of freedom in the same "
        "bands, which an immovable machine would receive.",
        read=lambda freedom: _exposure_level(
            float(freedom.blocked_bands.energy.sum()), FORCE_REFERENCE
        ),
        column=_column("if blocked"),
    ),
    Measure(
        key="energy_into_machine",
        name="energy into the machine",
        symbol="W_i",
        unit="J",
        definition="∫ g v dt of one click through one degree of freedom; below 0 where it "
        "returns energy, although the sum of all is not.",
        read=lambda freedom: freedom.energy,
        digits=3,
        column=Column("uJ", 1e6, ".4g"),
        deviation="energy",
        page=True,
    ),
)
"""Of one freedom between valve and machine."""


def _at_ear(measure: Measure[SoundStatistics]) -> Measure[EarSound]:
    def read(ear: EarSound) -> Value:
        return None if ear.sound is None else measure.read(ear.sound.statistics)

    column = Column(measure.unit, 1.0, ".1f", measure.symbol[2:])
    return replace(cast(Measure[EarSound], measure), read=read, column=column)


EAR_MEASURES: tuple[Measure[EarSound], ...] = described_in(
    _COUPLING,
    replace(
        _LEVEL,
        key="ear_exposure_level_weighted",
        json_name="ear_exposure_level_dBA",
        name="sound exposure level at the ear, A-weighted",
        symbol="L_AE",
        unit="dBA",
        definition="Level of ∫ p_A² dt of one click from its spectrum, in the known band, re "
        "(20 µPa)² s.",
        read=lambda ear: _exposure_level(ear.exposure_A, PRESSURE_REFERENCE),
        column=_column("SEL", "dBA"),
        deviation="difference",
    ),
    *(_at_ear(measure) for measure in CLICK_MEASURES[3:]),
    Measure(
        key="loudness_max",
        name="loudness, loudest moment",
        symbol="N_max",
        unit="sone",
        definition="Loudness of one click at its loudest moment, ISO 532-1, free field.",
        source=_SOUND,
        read=lambda ear: None if ear.sound is None else ear.sound.loudness.maximum,
        digits=3,
        column=Column("sone", 1.0, ".3g", "loudness"),
        deviation="factor",
        page=True,
    ),
)
"""Of one ear in the machine."""

PATH_MEASURES: tuple[Measure[PathSound], ...] = described_in(
    _COUPLING,
    replace(
        _LEVEL,
        key="path_exposure_level_weighted",
        json_name="path_exposure_level_dBA",
        name="level of the single path",
        symbol="L_AE,i",
        unit="dBA",
        definition="A-weighted sound exposure level from only one degree of freedom at the ear, "
        "re (20 µPa)² s.",
        read=lambda path: _exposure_level(path.exposure_A, PRESSURE_REFERENCE),
        column=_column("alone", "dBA"),
    ),
    Measure(
        key="path_share",
        name="share of the path",
        symbol="s_i",
        definition="∫ Re(p* p_i) df over ∫ p* p df, A-weighted: parts with their phases add up "
        "to 100 %; below 0 where a path lowers the sound.",
        read=lambda path: path.share,
        form="share",
        digits=1,
        column=Column("%", 100.0, ".1f", "share"),
        page=True,
    ),
)
"""Of one path to an ear."""

IN_SITU_MEASURES: tuple[Measure[InSituFreedom], ...] = described_in(
    _COUPLING,
    replace(
        _LEVEL,
        key="blocked_force_in_situ_level",
        name="blocked force, found in situ",
        symbol="L_Fbl",
        definition="Exposure of the blocked force that a test on the running machine finds (ISO "
        "20270), re (1 µN)² s; of moments re (1 µN m)² s.",
        read=lambda freedom: _exposure_level(float(freedom.found.energy.sum()), FORCE_REFERENCE),
        column=_column("found"),
    ),
    replace(
        _LEVEL,
        key="blocked_force_of_source_level",
        name="blocked force of the source",
        symbol="L_Fbl",
        definition="The same for the source, in the degrees of freedom that the machine carries.",
        read=lambda freedom: _exposure_level(float(freedom.exact.energy.sum()), FORCE_REFERENCE),
        column=_column("of the source"),
    ),
)
"""Of one freedom in a virtual test."""
