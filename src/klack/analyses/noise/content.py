"""Content of a noise report."""

from math import isfinite

import numpy as np

from klack.acoustics.third_octave import ENERGY_REFERENCE, nominal_label
from klack.acoustics.wav import level_statement, wav_bytes
from klack.analyses.measures import glossary, page_cells, page_heads
from klack.analyses.noise.body import ASSUMED_DAMPING
from klack.analyses.noise.figures import (
    blocked_charts,
    click_charts,
    force_chart,
    heard_words,
    machine_charts,
    mobility_charts,
    own_sound_charts,
    radiation_chart,
    source_charts,
    spectrum_chart,
    strongest_chart,
)
from klack.analyses.noise.measures import (
    BODY_MEASURES,
    DESIGN_MEASURES,
    EAR_MEASURES,
    EXPOSURE_LEVEL_A,
    FORCE_LEVEL,
    IN_SITU_MEASURES,
    INTERFACE_MEASURES,
    MOUNT_MEASURES,
    PATH_MEASURES,
    STOP_MEASURES,
    strongest,
)
from klack.analyses.noise.record import BodyNoise, NoiseDesign, NoiseStudy
from klack.analyses.noise.sounds import common_full_scale, study_sounds
from klack.analyses.noise.surface import surface_figure
from klack.analyses.page import page_of
from klack.report.chart import Chart
from klack.report.page import Content, Section, Sound, Table
from klack.report.wording import fixed, listed, quantity, share, typeset

__all__ = ["noise_content"]


def noise_answer(study: NoiseStudy) -> str:
    """How loud the first design is, and how the others differ."""
    first = study.reference
    stop = strongest(first)
    begin = f"One {first.kind} of '{first.name}'" if len(study.designs) > 1 else f"One {first.kind}"
    where = f" on '{stop.stop}'" if first.kind == "stroke" else ""
    text = f"{begin} has a peak force of {quantity(stop.peak_force, 'N', 3)}{where}. "
    if not first.bodies:
        return text + "There is no elastic held body, so no statement about sound is possible."
    bodies = listed([f"the {body.name}" for body in first.bodies])
    text += (
        f"It brings {quantity(first.injected_energy, 'J', 3)} of structure-borne energy into "
        f"{bodies}"
    )
    if first.sound is None:
        return text + "; no surface radiates."
    heard, where = first.sound, heard_words(first)[0]
    peak = fixed(heard.statistics.peak_level, 0, "dB")
    text += (
        f". {where[0].upper()}{where[1:]} one click is estimated at {peak} peak and "
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
        f"The click of '{other.name}' has {_sone(loudness)}{factor}; its A-weighted level "
        f"differs by {typeset(EXPOSURE_LEVEL_A.apart(other, first))}."
    )


_LONGEST = 10.0  # [s] of sound within the page
_NONE = "–"


def noise_content(study: NoiseStudy) -> Content:
    """Texts, tables and figures of a study."""
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
        *_source_sheet(study),
        *_machine(study),
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
        definitions=_definitions(study),
        limits=_limits(study),
    )


def _forces(study: NoiseStudy) -> tuple[Chart, ...]:
    over_time, strongest = force_chart(study), strongest_chart(study)
    alone = all(design.kind == "impact" for design in study.designs)
    return (over_time,) if alone or not strongest.panels else (over_time, strongest)


# --------------------------------------------------------------------------- numbers


def _number_table(study: NoiseStudy) -> Table:
    first, *others = study.designs
    rows = []
    for measure in DESIGN_MEASURES:
        values = [measure.read(design) for design in study.designs]
        if not measure.page or not any(map(_known, values)):
            continue
        cells = [measure.on_page(first)]
        for other in others:
            apart = measure.apart(other, first).replace(measure.absent, "")
            cells.append(f"{measure.on_page(other)}\n{typeset(apart)}".rstrip())
        rows.append((measure.name, *cells))
    heads = [
        f"{design.name}{' (reference)' if i == 0 and len(study.designs) > 1 else ''}\n"
        f"{design.detail}"
        for i, design in enumerate(study.designs)
    ]
    return Table(columns=("", *heads), rows=tuple(rows))


# --------------------------------------------------------------------------- sections


def _source_sheet(study: NoiseStudy) -> tuple[Section, ...]:
    """What a supplier hands to the maker of a machine."""
    mounted = [design for design in study.designs if design.at_mounts is not None]
    if not mounted:
        return ()
    rows, words = [], []
    for design in mounted:
        source = design.at_mounts
        assert source is not None
        whose = f"{design.name}, " if len(mounted) > 1 else ""
        for item in source.freedoms:
            place = ", ".join(f"{1e3 * x:.4g}" for x in item.position)
            rows.append((f"{whose}{item.name}", place, *page_cells(MOUNT_MEASURES, item)))
        balance = (
            "only the contact force acts"
            if np.isnan(source.balance)
            else f"forces and m a balance within {source.balance:.1g} of the largest force, "
            f"apart from {source.repaid:.1g} that corrected the energy of the time steps; fluid "
            f"and surroundings contribute {quantity(source.entering, 'N', 2)} at most"
        )
        words.append(f"{whose}{quantity(source.mass, 'kg', 3)} of held bodies; {balance}.")
    return (
        Section(
            title="Source at its mounts",
            paragraphs=(
                "Independent of the machine: free velocity, blocked force and mobility of the "
                "free valve (files source.nc and source.uff). Forces act along the axis; a body "
                "of revolution moves across the axis only where a machine pushes back.",
                *words,
            ),
            tables=(
                Table(
                    columns=("freedom", "x, y, z in mm", *page_heads(MOUNT_MEASURES)),
                    rows=tuple(rows),
                ),
            ),
            charts=source_charts(study),
        ),
    )


def _machine(study: NoiseStudy) -> tuple[Section, ...]:
    """What the machine makes of the source."""
    rows, ears, tests, words = [], [], [], []
    for design in study.designs:
        found, whose = design.machine, f"{design.name}, " if len(study.designs) > 1 else ""
        if found is None:
            continue
        for item in found.freedoms:
            if item.force.any():
                rows.append((f"{whose}{item.name}", *page_cells(INTERFACE_MEASURES, item)))
        for ear in found.ears:
            ears.append((f"{whose}{ear.name}", *page_cells(EAR_MEASURES, ear), *[_NONE] * 2))
            blank = [_NONE] * len(page_heads(EAR_MEASURES))
            for path in ear.paths:
                if path.exposure_A > 0.0:
                    cells = page_cells(PATH_MEASURES, path)
                    ears.append((f"by {path.name}", *blank, *cells))
        lost = f", {quantity(found.element_loss, 'J', 3)} are lost in elements"
        words.append(
            f"{whose}{design.settings.machine}. {quantity(found.energy, 'J', 3)} of one click go "
            f"into the machine{lost if found.elements else ''}; at each line all powers add up "
            f"to zero within {found.balance:.1g} of the largest."
        )
        words.append(
            f"{whose}this is the work of all forces (contacts, magnet, springs, with their "
            "reactions) at the mounts, where the valve moves as a whole. The "
            f"{quantity(design.injected_energy, 'J', 3)} above are the work of only the contacts "
            "on the modes of bodies with fixed mounts, and stay in them: neither is part of the "
            "other, and either may be larger."
        )
        if isfinite(found.motion):
            words.append(
                f"{whose}the mounts move with up to {share(found.motion)} of the speed of the "
                "needle."
            )
        if found.in_situ is not None:
            test = found.in_situ
            words.append(
                f"{whose}a virtual test with {listed(list(test.indicators))} finds the blocked "
                f"force within {test.deviation:.1g} (condition {test.condition:.2g}, without "
                "noise)."
            )
            for one in test.freedoms:
                tests.append((f"{whose}{one.name}", *page_cells(IN_SITU_MEASURES, one)))
    if not words:
        return ()
    tables = [
        Table(columns=(head, *(c for m in measures for c in page_heads(m))), rows=tuple(cells))
        for head, measures, cells in (
            ("freedom", (INTERFACE_MEASURES,), rows),
            ("ear", (EAR_MEASURES, PATH_MEASURES), ears),
            ("freedom", (IN_SITU_MEASURES,), tests),
        )
        if cells
    ]
    return (
        Section(
            title="In the machine",
            paragraphs=tuple(text[0].upper() + text[1:] for text in words),
            tables=tuple(tables),
            charts=machine_charts(study),
        ),
    )


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
        elif name.startswith("click-at-"):
            what = f"one click {name.removesuffix('.wav').removeprefix('click-').replace('-', ' ')}"
        elif name.startswith("own-surface"):
            what = f"one click of the valve's own surface, {pressure.name}"
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
            "estimate, set the volume to give a full-scale sine the level stated here; "
            "otherwise only the character and the differences are real.",
        ),
        sounds=tuple(players),
    )


def _force_table(study: NoiseStudy) -> Table:
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
                    *page_cells(STOP_MEASURES, stop),
                    fixed(level, 1, "dB"),
                    top,
                    quantity(below, "Hz", 2),
                )
            )
    return Table(
        columns=(
            "stop",
            *page_heads(STOP_MEASURES),
            "unbalanced level",
            "highest band",
            "90 % of it below",
        ),
        rows=tuple(rows),
    )


def _energy(study: NoiseStudy) -> Section:
    rows = []
    for design, body in _bodies(study):
        whose = f"{design.name}, " if len(study.designs) > 1 else ""
        for port, stop, injected in zip(body.ports, body.stops, body.injected, strict=True):
            through = f"through '{port}'" + (f" by '{stop}'" if stop != port else "")
            rows.append(
                (
                    f"{whose}{body.name}\n{through}",
                    quantity(float(injected), "J", 4),
                    *page_cells(BODY_MEASURES, body),
                )
            )
    if not rows:
        return Section(title="Structure-borne energy")
    columns = ("body", "injected\n∫ F v dt", *page_heads(BODY_MEASURES))
    worst = max(body.residual for _, body in _bodies(study))
    return Section(
        title="Structure-borne energy",
        paragraphs=(
            "Work of the contact forces on the rigidly held bodies: most of it is lost in their "
            "damping or still rings at the end of the record; the rest is stored while a stop "
            f"stays pressed. The balance closes to {abs(worst):.0e} of this work.".replace(
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
            *dict.fromkeys(_RADIATED[design.settings.radiation] for design in study.designs),
            *[_BESIDE] * any(design.machine is not None for design in study.designs),
        ),
        charts=(chart, *own_sound_charts(study)),
        tables=(Table(columns=("surface", "area", *heads), rows=tuple(rows)),),
    )


def _assumptions(study: NoiseStudy) -> Section:
    rows: list[tuple[str, ...]] = []
    estimated = (
        ("mount", lambda d: d.settings.mount or "rigid"),
        ("plate", lambda d: d.settings.plate or "none"),
    )
    coupled = (("machine", lambda d: d.settings.machine or "none described"),)
    alone = all(design.machine is None for design in study.designs)
    together = all(design.machine is not None for design in study.designs)
    for title, text in (
        *(() if together else estimated),
        *(() if alone else coupled),
        ("sound", lambda d: heard_words(d)[0]),
        ("radiation", lambda d: _EFFICIENCY[d.settings.radiation] + d.settings.outside),
        (
            "air",
            lambda d: f"{d.settings.air_density:.4g} kg/m³, {d.settings.sound_speed:.4g} m/s",
        ),
        ("drive pattern", lambda d: f"{d.settings.rate:.4g} strokes per second"),
        (
            "steady noise besides",
            lambda d: (
                "none"
                if d.settings.background is None
                else quantity(d.settings.background, "dBA", 3)
            ),
        ),
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
    "piston": "efficiency of a baffled piston of the same area",
    "unity": "efficiency 1 (equivalent radiated power)",
    "elements": "boundary elements",
}
_ESTIMATED = (
    "An estimate per surface: density and speed of sound in air times the radiation efficiency "
    "times the squared normal velocity, over time and area. Parts that move against each other "
    "are added without cancellation: too loud for bodies smaller than the wavelength, by 17 dB "
    "and more where a small valve shakes as a whole."
)
_BESIDE = (
    "In a machine: radiation of the surfaces of the valve itself, held rigidly. The radiation "
    "of the machine is the sound at its ears."
)
_RADIATED = {
    "piston": _ESTIMATED,
    "unity": _ESTIMATED,
    "elements": "Boundary elements on the outside of all held bodies: parts that move against "
    "each other cancel as they do in air. The energy of a surface is the energy that leaves "
    "through it, below zero where the surface absorbs more than it radiates. The rest of the "
    "outside closes bores and mounting faces, and includes other bodies that move along.",
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


def _definitions(study: NoiseStudy) -> tuple[tuple[str, str], ...]:
    """Of the words in the report, each once."""
    design = study.reference
    shown = [m for m in DESIGN_MEASURES if any(_known(m.read(d)) for d in study.designs)]
    found = [
        *glossary(shown),
        (
            "blocked force",
            "Axial force of the body on a rigid support. A softer structure receives a "
            "smaller force.",
        ),
    ]
    if any(design.machine is not None for design in study.designs):
        for measures in (INTERFACE_MEASURES, EAR_MEASURES, PATH_MEASURES):
            found += glossary(measures)
    pressure = (
        "Sound at an ear from the forces on the machine."
        if design.settings.ear
        else "All radiated power as a monopole in a free field, with minimum phase. Reflections, "
        "directivity and the travel time are neglected."
    )
    once: dict[str, str] = {}
    for name, words in (*found, ("sound pressure", pressure)):
        once.setdefault(name, words)
    return tuple(once.items())


def _known(value: float | None) -> bool:
    return value is not None and isfinite(value)


def _limits(study: NoiseStudy) -> tuple[tuple[str, str], ...]:
    begins = max(design.valid_from for design in study.designs)
    short = ""
    if begins:
        short = (
            f"Below {quantity(begins, 'Hz', 2)} the record, which does not return to its initial "
            "state, is shorter than a period. "
        )
    click = (
        "Click",
        "The whole click is emitted at once here, while a real plate rings on: peak level, "
        "crest factor, kurtosis and loudest moment are on the high side; exposure levels are "
        "not.",
    )
    limits = [
        (
            "Estimate",
            "Levels are meaningful in whole dB, not in tenths: mount, plate and damping decide, "
            "and they are only roughly known. Differences between two designs on the same mount "
            "are more accurate than levels.",
        ),
        *([click] if any(not design.settings.ear for design in study.designs) else []),
        (
            "Force",
            "Noise of the rigidly held bodies; the mount does not react on the impact. Without "
            "noise.mounts magnetic and pressure forces on the housing are left out; sound "
            "through the fluid always is.",
        ),
        (
            "Direction",
            "Only forces along the axis. Bending by a tilted or eccentric impact is not included.",
        ),
        (
            "Frequency",
            f"{short}Above the highest kept mode a body responds only with its static "
            "compliance. Sound files end at 20 kHz.",
        ),
    ]
    if any(design.kind == "impact" for design in study.designs):
        limits.append(
            (
                "Impact alone",
                "In an impact no spring or magnet pushes the needle back: its impulse stays "
                "unbalanced, and the bands below about one over the time of flight, a few "
                "kilohertz in a valve, are too loud. klack stroke includes these forces.",
            )
        )
    if any(body.assumed for _, body in _bodies(study)):
        limits.append(
            (
                "Damping",
                f"For bodies without damping in the case {100 * ASSUMED_DAMPING:g} % of critical "
                "damping is assumed: the level of a resonance depends on it.",
            )
        )
    return tuple(limits)
