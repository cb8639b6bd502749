"""What a noise report says, before it is laid out: the same words for screen and paper."""

from collections.abc import Callable
from math import isfinite

import numpy as np

from klack.acoustics.third_octave import ENERGY_REFERENCE, nominal_label
from klack.acoustics.wav import level_statement, wav_bytes
from klack.analyses.noise.body import ASSUMED_DAMPING
from klack.analyses.noise.figures import (
    blocked_charts,
    click_charts,
    force_chart,
    mobility_charts,
    radiation_chart,
    spectrum_chart,
    strongest_chart,
)
from klack.analyses.noise.record import BodyNoise, ClickSound, NoiseDesign, NoiseStudy
from klack.analyses.noise.sounds import common_full_scale, study_sounds
from klack.analyses.noise.surface import surface_figure
from klack.analyses.noise.wording import decibels, force_level, noise_answer
from klack.analyses.page import page_of
from klack.report.chart import Chart
from klack.report.page import Content, Section, Sound, Table
from klack.report.wording import listed, quantity, share, signed

__all__ = ["noise_content"]

_LONGEST = 10.0  # [s] of sound within the page
_NONE = "–"


def noise_content(study: NoiseStudy) -> Content:
    """Put a study into words, tables and figures."""
    sections = [
        _listen(study),
        Section(title="Force of the stops", charts=_forces(study)),
        Section(
            title="Spectrum of the force",
            charts=(spectrum_chart(study),),
            tables=(_force_table(study),),
        ),
        _energy(study),
        Section(title="Mobility at the contacts", charts=mobility_charts(study)),
        Section(title="Force on the support", charts=blocked_charts(study)),
        _radiation(study),
        Section(title="How the surfaces move", picture=surface_figure(study)),
        Section(title="The click", charts=click_charts(study)),
        _assumptions(study),
    ]
    return page_of(
        study,
        "Noise",
        answer=noise_answer(study),
        numbers=_number_table(study),
        sections=sections,
        definitions=_DEFINITIONS,
        limits=_limits(study),
    )


def _forces(study: NoiseStudy) -> tuple[Chart, ...]:
    over_time, strongest = force_chart(study), strongest_chart(study)
    alone = all(design.kind == "impact" for design in study.designs)
    return (over_time,) if alone or not strongest.panels else (over_time, strongest)


# --------------------------------------------------------------------------- numbers


Cell = Callable[[NoiseDesign], float]


def _number_table(study: NoiseStudy) -> Table:
    """Quantities down, designs across; the difference from the first one stands below."""
    rows = []
    for title, value, unit, difference in _ROWS:
        values = [value(design) for design in study.designs]
        if not np.isfinite(values).any():
            continue
        cells = [_text(values[0], unit)]
        for other in values[1:]:
            cells.append(_text(other, unit) + _difference(other, values[0], difference))
        rows.append((title, *cells))
    heads = [
        f"{design.name}{' (reference)' if i == 0 and len(study.designs) > 1 else ''}\n"
        f"{design.detail}"
        for i, design in enumerate(study.designs)
    ]
    return Table(columns=("", *heads), rows=tuple(rows))


def _text(value: float, unit: str) -> str:
    if not isfinite(value):
        return _NONE
    if unit == "dB":
        return decibels(value)
    if unit in ("sone", "acum", "phon", ""):
        return f"{value:.3g}" + (f"\N{NO-BREAK SPACE}{unit}" if unit else "")
    return quantity(value, unit, 3)


def _difference(value: float, first: float, kind: str) -> str:
    """Difference from the first design: of levels in dB, of the rest as level or as factor."""
    if not (isfinite(value) and isfinite(first)) or not kind:
        return ""
    if kind == "level":
        return "\n" + signed(value - first, 1, "dB")
    if not (value > 0.0 and first > 0.0):
        return ""
    if kind == "factor":
        return f"\n× {value / first:.3g}"
    factor = 10.0 if kind == "energy" else 20.0
    return "\n" + signed(float(factor * np.log10(value / first)), 1, "dB")


def _of_sound(read: Callable[[ClickSound], float]) -> Cell:
    return lambda design: read(design.sound) if design.sound is not None else float("nan")


_ROWS: tuple[tuple[str, Cell, str, str], ...] = (
    ("peak force", lambda d: max(stop.peak_force for stop in d.stops), "N", "amplitude"),
    ("level of the unbalanced force", force_level, "dB", "level"),
    (
        "structure-borne energy injected, bodies rigidly held",
        lambda d: d.injected_energy,
        "J",
        "energy",
    ),
    ("energy into mount and plate besides", lambda d: d.support_energy, "J", "energy"),
    ("sound energy radiated (estimate)", lambda d: d.radiated_energy, "J", "energy"),
    (
        "in the audible range (estimate)",
        lambda d: float(d.radiated_bands[d.band_middle <= 20e3].sum()),
        "J",
        "energy",
    ),
    ("sound energy, upper bound", lambda d: d.upper_bound, "J", "energy"),
    ("peak level of a click", _of_sound(lambda s: s.statistics.peak_level), "dB", "level"),
    (
        "sound exposure level of a click",
        _of_sound(lambda s: s.statistics.exposure_level),
        "dB",
        "level",
    ),
    ("the same, A-weighted", _of_sound(lambda s: s.statistics.exposure_level_A), "dB", "level"),
    (
        "level of the drive pattern, A-weighted",
        _of_sound(lambda s: s.pattern.equivalent_level_A),
        "dB",
        "level",
    ),
    ("loudness, loudest moment", _of_sound(lambda s: s.loudness.maximum), "sone", "factor"),
    ("loudness level there", _of_sound(lambda s: s.loudness.level), "phon", ""),
    ("sharpness", _of_sound(lambda s: s.loudness.sharpness), "acum", "factor"),
    ("kurtosis of the drive pattern", _of_sound(lambda s: s.pattern.kurtosis), "", "factor"),
    (
        "crest factor of the drive pattern",
        _of_sound(lambda s: s.pattern.crest_factor),
        "",
        "factor",
    ),
    ("force valid up to", lambda d: d.valid_up_to, "Hz", ""),
)


# --------------------------------------------------------------------------- sections


def _listen(study: NoiseStudy) -> Section:
    sounds = study_sounds(study)
    if not sounds:
        return Section(title="Listen")
    scale = common_full_scale(sounds)
    players = []
    for name, design, pressure in sounds:
        length = pressure.values.size * pressure.step
        what = "one click"
        if name.startswith("pattern"):
            what = f"{design.settings.rate:.4g} clicks per second"
        whose = f"{design.name}, " if len(study.designs) > 1 else ""
        fits = length <= _LONGEST
        players.append(
            Sound(
                title=f"{whose}{what}",
                wav=wav_bytes(pressure, full_scale=scale) if fits else b"",
                note=f"File {name}, {quantity(length, 's', 2)}.",
            )
        )
    return Section(
        title="Listen",
        paragraphs=(
            f"All files share one scale: {level_statement(scale)}. To hear the level of the "
            "estimate, set the volume so that a sine at full scale has the level said here; "
            "otherwise only the character and the differences are real.",
        ),
        sounds=tuple(players),
    )


def _force_table(study: NoiseStudy) -> Table:
    """Per stop and design: impacts, impulse, level, where most of the energy is."""
    rows = []
    for design in study.designs:
        for stop in design.stops:
            whose = f"{design.name}, " if len(study.designs) > 1 else ""
            energy = stop.bands.energy * design.net_share
            level = 10.0 * np.log10(max(float(energy.sum()), 1e-300) / ENERGY_REFERENCE)
            top = nominal_label(int(stop.bands.number[int(np.argmax(energy))]))
            gathered = np.cumsum(energy) / max(float(energy.sum()), 1e-300)
            below = float(np.interp(0.9, gathered, stop.bands.high))
            rows.append(
                (
                    f"{whose}{stop.stop}",
                    str(stop.impacts),
                    quantity(stop.peak_force, "N", 4),
                    quantity(stop.impulse, "N s", 4),
                    decibels(level),
                    top,
                    quantity(below, "Hz", 2),
                )
            )
    return Table(
        columns=(
            "stop",
            "impacts",
            "peak force",
            "impulse of the record",
            "unbalanced level",
            "highest band",
            "90 % of it below",
        ),
        rows=tuple(rows),
    )


def _energy(study: NoiseStudy) -> Section:
    """Structure-borne energy of every body, by time and by frequency."""
    rows = []
    for design, body in _bodies(study):
        whose = f"{design.name}, " if len(study.designs) > 1 else ""
        for port, stop, injected in zip(body.ports, body.stops, body.injected, strict=True):
            through = f"through '{port}'" + (f" by '{stop}'" if stop != port else "")
            rows.append(
                (
                    f"{whose}{body.name}\n{through}",
                    quantity(float(injected), "J", 4),
                    quantity(body.vibration_energy, "J", 4),
                    quantity(body.vibration_spectral, "J", 4),
                    quantity(body.dissipated, "J", 3),
                    quantity(body.ringing, "J", 3),
                    quantity(body.static_energy, "J", 3),
                )
            )
    if not rows:
        return Section(title="Structure-borne energy")
    columns = (
        "body",
        "injected\n∫ F v dt",
        "vibration\nby time",
        "vibration\n∫ 2 Re(Y) |F|² df",
        "lost by the end",
        "still ringing",
        "stored more at rest",
    )
    worst = max(body.residual for _, body in _bodies(study))
    return Section(
        title="Structure-borne energy",
        paragraphs=(
            "What the contact forces bring into the rigidly held bodies: most of it is lost in "
            "their damping or still rings at the end of the record; the rest is stored while a "
            f"stop stays pressed. The balance closes to {abs(worst):.0e} of it.".replace(
                "e-", "e\N{MINUS SIGN}"
            ),
        ),
        tables=(Table(columns=columns, rows=tuple(rows)),),
    )


def _bodies(study: NoiseStudy) -> list[tuple[NoiseDesign, BodyNoise]]:
    return [(design, body) for design in study.designs for body in design.bodies]


def _radiation(study: NoiseStudy) -> Section:
    chart = radiation_chart(study)
    if chart is None:
        return Section(title="Radiated sound")
    rows: list[tuple[str, ...]] = []
    groups = dict.fromkeys((body.name, name) for _, body in _bodies(study) for name in body.groups)
    for body_name, group in groups:
        cells = []
        area = float("nan")
        for design in study.designs:
            found = [b for b in design.bodies if b.name == body_name and group in b.groups]
            if not found:
                cells += [_NONE, _NONE]
                continue
            i = found[0].groups.index(group)
            area = float(found[0].area[i])
            heard = design.band_middle <= 20e3
            total = float(found[0].radiated[i, heard].sum())
            whole = float(design.radiated_bands[heard].sum())
            cells += [quantity(total, "J", 3), share(total / whole) if whole > 0.0 else _NONE]
        size = f"{1e6 * area:.3g} mm²" if isfinite(area) else _NONE
        rows.append((f"{body_name}: {group}", size, *cells))
    heads = []
    for design in study.designs:
        whose = f"{design.name}\n" if len(study.designs) > 1 else ""
        heads += [f"{whose}radiated up to 20 kHz", "share"]
    return Section(
        title="Radiated sound",
        paragraphs=(
            "An estimate per surface: density and speed of sound in air times the radiation "
            "efficiency times the squared normal velocity, over time and area. Elements that move "
            "against each other are added as if they did not cancel: an upper bound for bodies "
            "smaller than the wavelength.",
        ),
        charts=(chart,),
        tables=(Table(columns=("surface", "area", *heads), rows=tuple(rows)),),
    )


def _assumptions(study: NoiseStudy) -> Section:
    rows: list[tuple[str, ...]] = []
    for title, text in (
        ("mount", lambda d: d.settings.mount or "rigid"),
        ("plate", lambda d: d.settings.plate or "none"),
        ("radiation efficiency", lambda d: _EFFICIENCY[d.settings.radiation]),
        ("distance", lambda d: quantity(d.settings.distance, "m", 3)),
        (
            "air",
            lambda d: f"{d.settings.air_density:.4g} kg/m³, {d.settings.sound_speed:.4g} m/s",
        ),
        ("drive pattern", lambda d: f"{d.settings.rate:.4g} strokes per second"),
        ("force from", lambda d: f"{d.kind} '{d.run}' of case {d.case}"),
        ("modes of the bodies", _modes),
    ):
        rows.append((title, *(text(design) for design in study.designs)))
    return Section(
        title="What was assumed",
        tables=(
            Table(
                columns=("", *(design.name for design in study.designs)),
                rows=tuple(rows),
            ),
        ),
    )


_EFFICIENCY = {
    "piston": "of a baffled piston of the same area",
    "unity": "1 (equivalent radiated power)",
}


def _modes(design: NoiseDesign) -> str:
    return (
        listed(
            [
                f"{body.name} {body.modes} up to {quantity(body.highest_frequency, 'Hz', 3)}"
                for body in design.bodies
            ]
        )
        if design.bodies
        else _NONE
    )


# --------------------------------------------------------------------------- words


_DEFINITIONS: tuple[tuple[str, str], ...] = (
    (
        "level of the force",
        "Third octaves after IEC 61260-1 (base ten) of ∫ F² dt, in dB re 1 pN² s = (1 µN)² s: the "
        "level re 1 µN of a steady force with the same energy in one second. The force is held at "
        "its first and last value outside the record.",
    ),
    (
        "unbalanced force",
        "Springs, magnet and fluid push the needle from the housing that it hits; below about one "
        "over the time of flight they balance the contact forces. The rest is mass times "
        "acceleration of the needle. Sound and surface motion include this share of every "
        "band; injected energy, mobility and blocked force the contact forces alone.",
    ),
    (
        "structure-borne energy",
        "Work of the contact and film forces on the modes of the rigidly held bodies, ∫ F v dt. "
        "The same from the real part of the drive-point mobility: ∫ 2 Re(Y) |F|² df. The energy "
        "that the valve as a whole passes to its mount and plate is additional.",
    ),
    (
        "blocked force",
        "Axial force of the body on a rigid support. A softer structure receives less.",
    ),
    (
        "radiated sound energy",
        "Estimate, over one run. Upper bound: equivalent radiated power, radiation efficiency 1.",
    ),
    (
        "sound pressure",
        "All radiated power as a monopole in a free field, with minimum phase. Reflections, "
        "directivity and the travel time are neglected.",
    ),
    (
        "peak level, sound exposure level",
        "Largest pressure re 20 µPa; ∫ p² dt re (20 µPa)² s. Unweighted unless stated.",
    ),
    (
        "loudness, sharpness",
        "ISO 532-1 for sounds that vary in time (Zwicker), free field, largest value of one click; "
        "DIN 45692 for the sharpness. 1 sone is the loudness of 40 dB at 1 kHz; twice the number "
        "is twice as loud.",
    ),
    (
        "kurtosis, crest factor",
        "Of the drive pattern over whole periods: 3 for Gaussian noise; high for rare clicks.",
    ),
)


def _limits(study: NoiseStudy) -> tuple[tuple[str, str], ...]:
    begins = max(design.valid_from for design in study.designs)
    short = ""
    if begins:
        short = (
            f"Below {quantity(begins, 'Hz', 2)} the record, which does not end as it began, is "
            "shorter than a period. "
        )
    limits = [
        (
            "Estimate",
            "Levels in dB, not tenths of them: mount, plate and damping decide, and they are known "
            "roughly. Differences between two designs on the same mount are better than levels.",
        ),
        (
            "Click",
            "All of a click is heard at once here, where a real plate rings on: peak level, crest "
            "factor, kurtosis and loudest moment are on the high side; exposure levels are not.",
        ),
        (
            "Force",
            "Of the rigidly held bodies; the mount does not act back on the impact. Magnetic and "
            "pressure forces on the housing are left out, and so is sound through the fluid.",
        ),
        (
            "Direction",
            "Forces along the axis only. Bending of a tilted or eccentric impact is not there.",
        ),
        (
            "Frequency",
            f"{short}Above the highest kept mode a body follows through its static "
            "compliance. Sound files end at 20 kHz.",
        ),
    ]
    if any(design.kind == "impact" for design in study.designs):
        limits.append(
            (
                "Impact alone",
                "Nothing pushes the needle of an impact back, as springs and magnets of a valve "
                "do: its impulse stays unbalanced, and the bands below about one over the time of "
                "flight, some kilohertz in a valve, are too loud. klack stroke knows better.",
            )
        )
    if any(body.assumed for _, body in _bodies(study)):
        limits.append(
            (
                "Damping",
                f"Bodies without damping in the case sound with {100 * ASSUMED_DAMPING:g} % of "
                "critical damping, an assumption: the level of a resonance follows it.",
            )
        )
    return tuple(limits)
