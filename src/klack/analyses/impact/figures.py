"""Figures of an impact report, in workshop units: us, N, um, kHz."""

from dataclasses import replace
from math import ceil, floor

import numpy as np
from numpy.typing import NDArray

from klack.acoustics.comparison import first_impact, impact_third_octaves
from klack.acoustics.spectrum import impulse_level, impulse_spectrum
from klack.acoustics.third_octave import ThirdOctaves
from klack.analyses.impact.record import BackingContact, ImpactStudy, LevelResult
from klack.bodies.gauges.gauge import GaugeKind
from klack.bodies.reduction.transfer import TransferComparison
from klack.contact.history import ImpactHistory
from klack.report.chart import (
    AnyChart,
    AxisSpec,
    Band,
    BarChart,
    BarPart,
    Chart,
    Curve,
    Mark,
    Panel,
    stems,
)
from klack.report.looks import OTHER, PART_LOOKS, Look, look_of
from klack.report.wording import quantity, sentence

__all__ = [
    "OUTPUT_UNITS",
    "approach_chart",
    "backing_chart",
    "charts",
    "energy_bars",
    "force_chart",
    "law_chart",
    "modal_energy_chart",
    "motion_chart",
    "output_charts",
    "spectrum_chart",
    "transfer_chart",
]

Floats = NDArray[np.float64]

_LOOKS: dict[str, Look] = {
    "full": Look("black", "solid", 2.4),
    "interface": Look("sky", "solid", 1.6),
    "reduced": Look("red", "dashed", 2.2),
    "reduced-participation": Look("green", "long", 1.9),
    "reduced-attachment": Look("blue", "dashdot", 1.9),
    "reduced-none": Look("orange", "dotted", 1.9),
    "lumped": Look("pink", "sparse", 2.1),
}
_THIN = 0.7  # [px]
_LOW_FREQUENCY, _TOP_FREQUENCY, _RESOLUTION = 1e3, 1e6, 250.0  # [Hz]
OUTPUT_UNITS: dict[GaugeKind, tuple[str, float]] = {
    "displacement": ("µm", 1e6),
    "velocity": ("m/s", 1.0),
    "strain": ("µm/m", 1e6),
    "stress": ("MPa", 1e-6),
}
"""Unit of a chart of each kind of output, and the factor from SI."""

_TIME = AxisSpec(label="time since first touch", unit="µs")


def charts(study: ImpactStudy) -> tuple[AnyChart, ...]:
    """Every figure that the study has data for, in the order of the report."""
    found: list[AnyChart] = [force_chart(study), spectrum_chart(study)]
    found.append(motion_chart(study))
    found += [backing_chart(one, one.backing) for one in study.ordered if one.backing is not None]
    found += output_charts(study)
    found += [transfer_chart(comparison) for comparison in study.transfer]
    found += [law_chart(study), approach_chart(study), energy_bars(study)]
    if any(result.modal_energy for result in study.levels.values()):
        found.append(modal_energy_chart(study))
    return tuple(found)


def _look(level: str) -> Look:
    return _LOOKS.get(level, OTHER)


def _level_curve(x: Floats, y: Floats, result: LevelResult, label: bool = True) -> Curve:
    return _look(result.level).curve(x, y, result.label if label else "")


def _thin(curve: Curve) -> Curve:
    return replace(curve, width=_THIN, style="solid")


def _since_touch(result: LevelResult, time: Floats) -> Floats:
    return 1e6 * (time - result.measures.first_touch)


# --------------------------------------------------------------------------- time


def force_chart(study: ImpactStudy) -> Chart:
    """Contact force of all levels, and differences of the compared ones."""
    results = study.ordered
    longest = max(result.measures.total_contact_time for result in results)
    limits = (-0.08e6 * longest, 1.25e6 * longest)
    curves, differences = [], []
    reference = results[0]
    peak = reference.measures.peak_force
    # a level that chatters fills a band: thin, below the others
    for result in sorted(results, key=lambda one: not _chatters(one, reference)):
        time = _since_touch(result, result.history.time)
        seen = (time >= limits[0]) & (time <= limits[1])
        curve = _level_curve(time[seen], result.history.force[seen], result)
        curves.append(_thin(curve) if _chatters(result, reference) else curve)
        if result is not reference and result.level in study.deviations:
            expected = np.interp(
                time[seen], _since_touch(reference, reference.history.time), reference.history.force
            )
            apart = 100 * (result.history.force[seen] - expected) / peak
            curve = _level_curve(time[seen], apart, result, label=False)
            differences.append(_thin(curve) if _chatters(result, reference) else curve)
    panels = [Panel(y=AxisSpec(label="contact force", unit="N"), curves=tuple(curves))]
    note = "First touch of every level is placed at zero."
    if differences:
        panels.append(
            Panel(
                y=AxisSpec(label="difference", unit="%", range=_span(differences, 0.5, 30.0)),
                curves=tuple(differences),
                marks=(Mark(value=0.0, axis="y"),),
                share=0.5,
            )
        )
        note += (
            f" Below: difference from '{reference.label}', in per cent of its peak force; "
            "a level with a large deviation leaves the panel."
        )
    return Chart(
        name="force",
        title="Contact force over time",
        x=AxisSpec(label=_TIME.label, unit=_TIME.unit, range=limits),
        panels=tuple(panels),
        note=note,
    )


def _chatters(result: LevelResult, reference: LevelResult) -> bool:
    return result.measures.sub_contacts > reference.measures.sub_contacts


def _span(curves: list[Curve], least: float, most: float) -> tuple[float, float]:
    """Symmetric range for all curves that stay within ``most``."""
    tops = [float(np.max(np.abs(curve.y), initial=0.0)) for curve in curves]
    limit = max([least, *(1.15 * top for top in tops if top <= most)])
    if min(tops) > most:
        limit = 1.15 * max(tops)
    return -limit, limit


def backing_chart(result: LevelResult, contact: BackingContact) -> Chart:
    """Forces above and below the struck body, and the gap below it where it lifts."""
    time = _since_touch(result, result.history.time)
    below, above = _look(result.level), OTHER
    curves = (
        above.curve(time, result.history.force, "on the struck body"),
        below.curve(time, contact.history.force, contact.surfaces),
    )
    marks = (Mark(value=contact.preload, axis="y", label="preload"),) if contact.preload else ()
    panels = [Panel(y=AxisSpec(label="contact force", unit="N"), curves=curves, marks=marks)]
    if contact.open_time > 0.0:
        gap = below.curve(time, 1e6 * np.maximum(contact.history.gap, 0.0))
        panels.append(Panel(y=AxisSpec(label="gap", unit="µm"), curves=(gap,), share=0.5))
    return Chart(
        name="backing",
        title="Forces on both sides of the struck body",
        x=_TIME,
        panels=tuple(panels),
        note=f"From the start to the end of the run. Gap: at {contact.surfaces}, where it is open."
        if contact.open_time > 0.0
        else "From the start to the end of the run; the lower contact stays closed.",
    )


def motion_chart(study: ImpactStudy) -> Chart:
    """Velocity and displacement of the needle's centre of mass."""
    velocities, ways = [], []
    for result in study.ordered:
        history = result.history
        time = _since_touch(result, history.edges)
        velocities.append(_level_curve(time, history.velocity_a, result))
        ways.append(_level_curve(time, 1e6 * _way(history, time), result, label=False))
    needle = study.bodies[0].name
    return Chart(
        name="motion",
        title=f"Motion of the centre of mass of the {needle}",
        x=_TIME,
        panels=(
            Panel(
                y=AxisSpec(label="velocity", unit="m/s"),
                curves=tuple(velocities),
                marks=(Mark(value=0.0, axis="y"),),
            ),
            Panel(
                y=AxisSpec(label="lift", unit="µm"),
                curves=tuple(ways),
                marks=(Mark(value=0.0, axis="y"),),
                share=0.8,
            ),
        ),
        note=(
            f"Negative velocity: the {needle} moves down, towards the other body. Lift is counted "
            "from the position at first touch; the ratio of the velocities after and before the "
            "contact is the restitution."
        ),
    )


def _way(history: ImpactHistory, time: Floats) -> Floats:
    """Integral of the velocity, zero at first touch [m]."""
    mean = 0.5 * (history.velocity_a[1:] + history.velocity_a[:-1])
    way = np.concatenate([[0.0], np.cumsum(mean) * history.step])
    return way - np.interp(0.0, time, way)


def output_charts(study: ImpactStudy) -> tuple[Chart, ...]:
    """Outputs of the sensors at every level."""
    names = dict.fromkeys(record.name for level in study.ordered for record in level.gauges)
    found = []
    for name in names:
        pairs = [
            (level, record)
            for level in study.ordered
            for record in level.gauges
            if record.name == name
        ]
        record = pairs[0][1]
        unit, factor = OUTPUT_UNITS[record.kind]
        curves = [
            _level_curve(_since_touch(level, one.time), factor * one.values, level)
            for level, one in pairs
        ]
        found.append(
            Chart(
                name=f"output-{name}",
                title=f"Output {name}",
                x=_TIME,
                panels=(
                    Panel(
                        y=AxisSpec(label=record.kind, unit=unit),
                        curves=tuple(curves),
                        marks=(Mark(value=0.0, axis="y"),),
                    ),
                ),
                note=sentence(f"{record.label[:1].upper()}{record.label[1:]}"),
            )
        )
    return tuple(found)


# --------------------------------------------------------------------------- frequency


def spectrum_chart(study: ImpactStudy) -> Chart:
    """Force spectrum of the first impact: narrow band, third octaves, difference."""
    results = study.ordered
    reference = results[0]
    top = min(_TOP_FREQUENCY, *(0.1 / result.history.step for result in results))
    frequency = np.geomspace(_LOW_FREQUENCY, top, 800)
    narrow, bands, differences = [], [], []
    levels = [impact_third_octaves(result.history, high=top) for result in results]
    for result, octaves in zip(results, levels, strict=True):
        spectrum = impulse_spectrum(first_impact(result.history), resolution=_RESOLUTION)
        level = np.interp(frequency, spectrum.frequency, impulse_level(spectrum))
        narrow.append(_level_curve(1e-3 * frequency, level, result))
        bands.append(_steps(octaves, octaves.level, result))
        if result is not reference:
            differences.append(_steps(octaves, octaves.level - levels[0].level, result))
    panels = [
        _level_panel("level", "dB re 1 µN s", narrow, 60.0),
        _level_panel("bands", "dB re 1 pN²s", bands, 50.0),
    ]
    trusted = _kept_up_to(study)
    if trusted > _LOW_FREQUENCY:
        label = f"below the highest kept mode, {quantity(trusted, 'Hz', 3)}"
        band = Band(low=1e-3 * _LOW_FREQUENCY, high=1e-3 * min(trusted, top), label=label)
        panels[0] = replace(panels[0], bands=(band,))
    if differences:
        panels.append(
            Panel(
                y=AxisSpec(label="difference", unit="dB", range=_span(differences, 1.5, 10.0)),
                curves=tuple(differences),
                marks=tuple(Mark(value=value, axis="y") for value in (-1.0, 0.0, 1.0)),
                share=0.55,
            )
        )
    note = (
        "Above: magnitude of the Fourier integral of the first impact, no window; its left end is "
        "the impulse. Middle: energy in third octaves."
    )
    if differences:
        note += (
            f" Below: third-octave levels minus those of '{reference.label}', with lines at ±1 dB."
        )
    if trusted > _LOW_FREQUENCY:
        note += " Shaded: frequencies below the highest kept mode of both bodies."
    return Chart(
        name="spectrum",
        title="Spectrum of the contact force",
        x=AxisSpec(
            label="frequency", unit="kHz", log=True, range=(1e-3 * _LOW_FREQUENCY, 1e-3 * top)
        ),
        panels=tuple(panels),
        note=note,
    )


def _level_panel(label: str, unit: str, curves: list[Curve], depth: float) -> Panel:
    """Panel down to ``depth`` below the highest level; deeper notches mean nothing."""
    highest = max(float(np.max(curve.y)) for curve in curves)
    limits = (5 * floor((highest - depth) / 5), 5 * ceil((highest + 3) / 5))
    return Panel(y=AxisSpec(label=label, unit=unit, range=limits), curves=tuple(curves), share=0.8)


def _steps(octaves: ThirdOctaves, values: Floats, result: LevelResult) -> Curve:
    seen = octaves.low >= 0.99 * _LOW_FREQUENCY / 10**0.05
    edges = np.append(octaves.low[seen], octaves.high[-1])
    heights = np.append(values[seen], values[-1])
    return replace(_level_curve(1e-3 * edges, heights, result, label=False), drawn="steps")


def _kept_up_to(study: ImpactStudy) -> float:
    """Lower of the highest kept frequencies of the bodies [Hz]."""
    tops = [float(body.frequencies[-1]) for body in study.bodies if body.frequencies.size]
    return min(tops) if tops else 0.0


# --------------------------------------------------------------------------- reduction


def transfer_chart(comparison: TransferComparison) -> Chart:
    """Receptance of full and reduced bodies, and the difference."""
    frequency = 1e-3 * comparison.frequencies
    curves, differences, marks = [], [], []
    for i, label in enumerate(comparison.labels):
        curves.append(look_of(i).curve(frequency, 1e9 * np.abs(comparison.curves[i]), label))
        if i == 0:
            continue
        deviation = np.maximum(comparison.mean_deviations[i], 1e-3)
        differences.append(look_of(i).curve(frequency, deviation))
        limit = 1e-3 * float(comparison.valid_up_to[i])
        if frequency[0] < limit < frequency[-1]:
            marks.append(Mark(value=limit, label=quantity(1e3 * limit, "Hz", 3)))
    top = max(float(curve.y.max()) for curve in differences) if differences else 10.0
    return Chart(
        name=f"transfer-{comparison.body}-{comparison.port}",
        title=f"Transfer function of the {comparison.body} at '{comparison.port}'",
        x=AxisSpec(
            label="frequency",
            unit="kHz",
            log=True,
            range=(float(frequency[0]), float(frequency[-1])),
        ),
        panels=(
            Panel(
                y=AxisSpec(label="displacement per force", unit="nm/N", log=True),
                curves=tuple(curves),
            ),
            Panel(
                y=AxisSpec(
                    label="deviation", unit="dB", log=True, range=(0.01, max(10.0, 1.5 * top))
                ),
                curves=tuple(differences),
                marks=(Mark(value=comparison.tolerance, axis="y"), *marks),
                share=0.6,
            ),
        ),
        note=(
            "Above: displacement of the contact per harmonic force on it. Below: magnitude of the "
            "level difference from the full body, averaged over a sliding third octave; the level "
            f"line is at {comparison.tolerance:g} dB, a vertical line marks where a reduced body "
            "first exceeds it. Structural damping with a loss factor of "
            f"{comparison.loss_factor:g} in every curve. {sentence(comparison.reference_note)}"
        ),
    )


def law_chart(study: ImpactStudy) -> Chart:
    """Local contact law, its straight line and the classical stiffness."""
    law = study.law
    indentation, load = 1e6 * np.append(0.0, law.indentation), np.append(0.0, law.force)
    curves = [
        Curve(
            x=indentation,
            y=load,
            label=f"local law ({law.kind})",
            colour="black",
            width=2.4,
        )
    ]
    low, high = law.fit_range
    if np.isfinite(law.linear_stiffness) and law.linear_stiffness > 0:
        force = np.array([low, high])
        near = float(np.interp(0.5 * (low + high), load, indentation))
        along = near + 1e6 * (force - force.mean()) / law.linear_stiffness
        curves.append(
            Curve(
                x=along,
                y=force,
                label=f"straight line, {quantity(law.linear_stiffness, 'N/m', 3)}",
                colour="red",
                style="dashed",
                width=2.0,
            )
        )
    if np.isfinite(law.classical_stiffness) and law.classical_stiffness > 0:
        force = np.array([0.0, float(law.force[-1])])
        curves.append(
            Curve(
                x=1e6 * force / law.classical_stiffness,
                y=force,
                label=f"classical submodel, {quantity(law.classical_stiffness, 'N/m', 3)}",
                colour="blue",
                style="dashdot",
                width=1.8,
            )
        )
    note = (
        "The law carries exactly the residual compliance of the kept modes. "
        if study.contact.points
        else "The law of the case, in series with the residual compliance of both bodies. "
    )
    note += f"The straight line is fitted between {low:.3g} and {high:.3g} N."
    if len(curves) == 3 or np.isfinite(law.classical_stiffness):
        note += (
            " The classical stiffness is that of a static submodel of only the contact region "
            f"(radius {quantity(law.classical_size, 'm', 3)}); it belongs to modes with static "
            "correction, not to bare modes."
        )
    return Chart(
        name="law",
        title="Local contact law of the reduced model",
        x=AxisSpec(label="indentation", unit="µm"),
        panels=(Panel(y=AxisSpec(label="force", unit="N"), curves=tuple(curves)),),
        note=note,
    )


def approach_chart(study: ImpactStudy) -> Chart:
    """Approach under a static force, split into law and kept modes."""
    contact, law = study.contact, study.law
    force = np.append(0.0, contact.force)
    total = 1e6 * np.append(0.0, contact.approach)
    local = 1e6 * np.interp(force, np.append(0.0, law.force), np.append(0.0, law.indentation))
    local[force > law.force[-1]] = np.nan
    panels = [
        Panel(
            y=AxisSpec(label="approach", unit="µm"),
            curves=(
                Curve(x=force, y=total, label="both bodies, static", width=2.4),
                Curve(
                    x=force,
                    y=local,
                    label="of it in the local law",
                    colour="red",
                    style="dashed",
                    width=2.0,
                ),
            ),
        )
    ]
    if np.size(law.share):
        panels.append(
            Panel(
                y=AxisSpec(label="law share", unit="%", range=(0.0, 100.0)),
                curves=(
                    Curve(x=law.force, y=100 * law.share, colour="red", style="dashed", width=2.0),
                ),
                share=0.5,
            )
        )
    return Chart(
        name="approach",
        title="Static approach of the two bodies",
        x=AxisSpec(label="contact force", unit="N"),
        panels=tuple(panels),
        note=(
            "Frictionless static contact of the two complete bodies, counted from first touch. "
            "The rest of the compliance is in the kept modes; a share of 20 to 80 % in the law "
            "is good."
            if contact.points
            else "Local law and modes of both bodies at their ports, in series."
        ),
    )


# --------------------------------------------------------------------------- energy


def energy_bars(study: ImpactStudy) -> BarChart:
    """Shares of the initial kinetic energy after separation, by level."""
    results = study.ordered
    initial = [next(iter(result.energies.values())) for result in results]
    names = dict.fromkeys(name for result in results for name in list(result.energies)[1:])
    parts: list[BarPart] = []
    for name in names:
        values = tuple(
            100 * float(result.energies.get(name, 0.0)) / start
            for result, start in zip(results, initial, strict=True)
        )
        if max(map(abs, values)) > 0.05:
            colour, hatch = PART_LOOKS[len(parts) % len(PART_LOOKS)]
            parts.append(BarPart(label=name, values=values, colour=colour, hatch=hatch))
    return BarChart(
        name="energy",
        title="Energy balance",
        x=AxisSpec(label=f"share of the {next(iter(results[0].energies))} energy", unit="%"),
        rows=tuple(result.label for result in results),
        parts=tuple(parts),
        note="After separation. Shares below 0.05 % appear only in the table.",
    )


def modal_energy_chart(study: ImpactStudy) -> Chart:
    """Energy left in each mode, of the reference and the reduced level."""
    results = [result for result in study.ordered if result.modal_energy]
    results = [r for r in results if r.level in (results[0].level, "reduced")]
    initial = next(iter(results[0].energies.values()))
    stems_of = results[0]
    largest = max(float(np.max(m.energy, initial=0.0)) for r in results for m in r.modal_energy)
    top = 100 * largest / initial if largest > 0 else 1.0
    floor = 1e-4 * top
    panels = []
    for body in (item.body for item in stems_of.modal_energy):
        curves: list[Curve] = []
        for result in results:
            colour = _look(result.level).colour
            for item in result.modal_energy:
                if item.body != body:
                    continue
                frequency = 1e-3 * item.frequency
                energy = 100 * item.energy / initial
                energy = np.where(energy > floor, energy, np.nan)
                if result is stems_of:
                    x, y = stems(frequency, energy, floor)
                    curves.append(Curve(x=x, y=y, colour=colour, width=1.4))
                curves.append(
                    Curve(
                        x=frequency,
                        y=energy,
                        label=result.label,
                        colour=colour,
                        drawn="points",
                        width=2.0 if result is stems_of else 1.3,
                    )
                )
        panels.append(
            Panel(
                y=AxisSpec(label=body, unit="%", log=True, range=(floor, 2 * top)),
                curves=tuple(curves),
                share=0.6,
            )
        )
    return Chart(
        name="modes",
        title="Energy left in the modes",
        x=AxisSpec(label="eigenfrequency", unit="kHz"),
        panels=tuple(panels),
        note=f"Share of the {next(iter(results[0].energies))} energy in each elastic mode at the "
        "end of the run.",
    )
