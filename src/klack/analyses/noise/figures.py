"""Figures of a noise report.

One colour and dash per design; the first design is the one that the others are compared with.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import ceil, floor

import numpy as np
from numpy.typing import NDArray

from klack.acoustics.signal_statistics import EXPOSURE_REFERENCE
from klack.acoustics.source_levels import FORCE_REFERENCE, VELOCITY_REFERENCE, drive_lines
from klack.acoustics.third_octave import ENERGY_REFERENCE, ThirdOctaves
from klack.analyses.noise.record import BodyNoise, NoiseDesign, NoiseStudy, StopForce
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
)
from klack.report.looks import look_of, thinned
from klack.report.wording import quantity

__all__ = [
    "SOUND_ENERGY_REFERENCE",
    "blocked_charts",
    "click_charts",
    "force_chart",
    "heard_words",
    "machine_charts",
    "mobility_charts",
    "own_sound_charts",
    "radiation_chart",
    "source_charts",
    "spectrum_chart",
    "strongest_chart",
]

Floats = NDArray[np.float64]

SOUND_ENERGY_REFERENCE = 1e-12  # [J], the reference of ISO 3740 for sound energy levels
_SMALLEST = 1e-300
_FREQUENCY = (0.02, 200.0)  # [kHz]
_OCTAVES = (1e3, 2e3, 4e3, 8e3, 16e3)  # [Hz] of the directivity
_UNSEEN = 0.01  # share of a path that a bar does not show
_SILENCE = 60.0  # [dB] below the highest value that a level chart shows


def _designs(study: NoiseStudy) -> list[tuple[int, NoiseDesign]]:
    return list(enumerate(study.designs))


def _stop_names(study: NoiseStudy) -> list[str]:
    return list(dict.fromkeys(stop.stop for design in study.designs for stop in design.stops))


def _body_names(study: NoiseStudy) -> list[str]:
    return list(dict.fromkeys(body.name for design in study.designs for body in design.bodies))


def _bodies(study: NoiseStudy, name: str) -> list[tuple[int, NoiseDesign, BodyNoise]]:
    return [
        (i, design, body)
        for i, design in _designs(study)
        for body in design.bodies
        if body.name == name
    ]


def _of_stops(
    study: NoiseStudy,
    drawn: Callable[[StopForce], tuple[Floats, Floats]],
    *,
    hit: bool = False,
) -> list[tuple[str, list[Curve]]]:
    """Curves of designs on each stop (or ``hit`` ones); each once in the legend."""
    found, named = [], set[str]()
    for name in _stop_names(study):
        curves = []
        for i, design in _designs(study):
            for stop in design.stops:
                if stop.stop == name and (stop.impacts or not hit):
                    listed = design.label not in named
                    named.add(design.label)
                    curves.append(look_of(i).curve(*drawn(stop), design.label, listed=listed))
        if curves:
            found.append((name, curves))
    return found


# --------------------------------------------------------------------------- force over time


def force_chart(study: NoiseStudy) -> Chart:
    """Force of every stop over the whole record."""
    scale, unit = _time_unit(study)
    stops = _of_stops(study, lambda stop: thinned(scale * stop.force.time, stop.force.values))
    panels = [
        Panel(y=AxisSpec(label=name, unit="N"), curves=tuple(curves), share=0.6)
        for name, curves in stops
    ]
    return Chart(
        name="force",
        title="Force of the stops over time",
        x=AxisSpec(label="time", unit=unit),
        panels=tuple(panels),
        note=(
            "Contact and film together, above zero when the stop is pressed. Every impulse is "
            "preserved: fine steps near the impacts, record means between them."
        ),
    )


def _time_unit(study: NoiseStudy) -> tuple[float, str]:
    longest = max(s.force.values.size * s.force.step for d in study.designs for s in d.stops)
    return (1e3, "ms") if longest > 1e-3 else (1e6, "µs")


def strongest_chart(study: NoiseStudy) -> Chart:
    """Strongest impact on every stop, first touch at zero."""
    stops = _of_stops(
        study, lambda stop: thinned(1e6 * stop.first.time, stop.first.values), hit=True
    )
    panels = [
        Panel(y=AxisSpec(label=name, unit="N"), curves=tuple(curves), share=0.7)
        for name, curves in stops
    ]
    return Chart(
        name="strongest",
        title="The strongest impact on every stop",
        x=AxisSpec(label="time since first touch", unit="µs", range=_window(panels)),
        panels=tuple(panels),
        note="First touch is placed at zero.",
    )


def _window(panels: Sequence[Panel]) -> tuple[float, float]:
    """Where the force exceeds a hundredth of its peak, with a margin [us]."""
    begins, ends = [], []
    for panel in panels:
        for curve in panel.curves:
            strong = np.flatnonzero(curve.y > 0.01 * curve.y.max())
            begins.append(curve.x[strong[0]])
            ends.append(curve.x[strong[-1]])
    if not begins:
        return 0.0, 1.0
    margin = 0.15 * (max(ends) - min(begins))
    return float(min(begins) - margin), float(max(ends) + margin)


# --------------------------------------------------------------------------- force over frequency


def spectrum_chart(study: NoiseStudy) -> Chart:
    """Spectra of the strongest impacts; third octaves, difference and cumulated energy of all."""
    stops = _of_stops(study, lambda stop: (1e-3 * stop.frequency, stop.level), hit=True)
    panels = [_level_panel(name, "dB re 1 µN s", curves, 70.0) for name, curves in stops]
    named = {curve.label for _, curves in stops for curve in curves}
    bands, left, gathered, differences = [], [], [], []
    reference = study.reference
    for i, design in _designs(study):
        octaves = design.stops[0].bands
        level = _level(design.band_energy, ENERGY_REFERENCE)
        listed = design.label not in named
        named.add(design.label)
        bands.append(_steps(octaves, level, i, design.label, listed=listed))
        if design.balanced_below:
            unbalanced = _level(design.unbalanced_energy, ENERGY_REFERENCE)
            steps = _steps(octaves, unbalanced, i, "")
            left.append(replace(steps, width=0.9, style="dotted"))
        total = np.cumsum(design.unbalanced_energy)
        x = np.append(1e-3 * octaves.low[0], 1e-3 * octaves.high)
        share = 100.0 * np.append(0.0, total) / max(float(total[-1]), _SMALLEST)
        gathered.append(look_of(i).curve(x, share, design.label, listed=False))
        if design is not reference and _same_bands(design, reference):
            apart = _level(design.unbalanced_energy, ENERGY_REFERENCE) - _level(
                reference.unbalanced_energy, ENERGY_REFERENCE
            )
            differences.append(_steps(octaves, apart, i, design.label))
    curves = [*bands, *left]
    panels += _compared("bands", "dB re 1 pN²s", curves, 70.0, differences, _trusted(study))
    axis = AxisSpec(label="energy below", unit="%", range=(0.0, 103.0))
    panels.append(Panel(y=axis, curves=tuple(gathered), share=0.55))
    note = (
        "Above: magnitude of the Fourier integral of the strongest impact on each stop; its "
        "left end is the impulse. Third octaves: ∫ F² dt of the whole record per band, all "
        "stops together. Bottom: share of this integral below each frequency."
    )
    if left:
        note += (
            " Thin dotted lines: the part that springs, magnet and fluid do not balance within "
            "the valve (mass times acceleration of the needle); difference and share refer to "
            "this part."
        )
    if differences:
        note += f" Difference: minus '{reference.name}', with lines at ±3 dB."
    return Chart(
        name="spectrum",
        title="Spectrum of the force",
        x=_FREQUENCY_AXIS,
        panels=tuple(panels),
        note=f"{note} {_trusted_words(study)}".strip(),
    )


_FREQUENCY_AXIS = AxisSpec(label="frequency", unit="kHz", log=True, range=_FREQUENCY)


def _level(energy: Floats, reference: float) -> Floats:
    return np.asarray(10.0 * np.log10(np.maximum(energy, _SMALLEST) / reference))


def _same_bands(one: NoiseDesign, other: NoiseDesign) -> bool:
    return np.array_equal(one.stops[0].bands.number, other.stops[0].bands.number)


def _steps(
    octaves: ThirdOctaves, values: Floats, index: int, label: str, *, listed: bool = False
) -> Curve:
    edges = 1e-3 * np.append(octaves.low, octaves.high[-1])
    heights = np.append(values, values[-1])
    return look_of(index).curve(edges, heights, label, listed=listed, drawn="steps")


def _level_panel(label: str, unit: str, curves: Sequence[Curve], depth: float) -> Panel:
    highest = max(float(np.nanmax(curve.y)) for curve in curves)
    lowest = max(min(float(np.nanmin(curve.y)) for curve in curves), highest - depth)
    limits = (5.0 * floor((lowest - 2.0) / 5.0), 5.0 * ceil((highest + 3.0) / 5.0))
    return Panel(y=AxisSpec(label=label, unit=unit, range=limits), curves=tuple(curves), share=0.7)


def _compared(
    label: str,
    unit: str,
    curves: Sequence[Curve],
    depth: float,
    differences: Sequence[Curve],
    bands: tuple[Band, ...] = (),
) -> tuple[Panel, ...]:
    levels = replace(_level_panel(label, unit, curves, depth), bands=bands)
    if not differences:
        return (levels,)
    largest = max(float(np.nanmax(np.abs(curve.y))) for curve in differences)
    limit = min(max(1.1 * largest, 5.0), 40.0)
    apart = Panel(
        y=AxisSpec(label="difference", unit="dB", range=(-limit, limit)),
        curves=tuple(differences),
        marks=tuple(Mark(value=value, axis="y") for value in (-3.0, 0.0, 3.0)),
        share=0.5,
    )
    return levels, apart


def _limits(study: NoiseStudy) -> tuple[float, float]:
    """Frequencies [Hz] within which every design is valid; nan without a limit."""
    tops = [d.valid_up_to for d in study.designs if np.isfinite(d.valid_up_to)]
    return max(d.valid_from for d in study.designs), min(tops, default=float("nan"))


def _trusted(study: NoiseStudy) -> tuple[Band, ...]:
    low, high = _limits(study)
    if not np.isfinite(high):
        return ()
    low, high = max(1e-3 * low, _FREQUENCY[0]), min(1e-3 * high, _FREQUENCY[1])
    return (Band(low=low, high=high, label="valid"),) if low < high else ()


def _trusted_words(study: NoiseStudy) -> str:
    low, high = _limits(study)
    if not np.isfinite(high):
        return "Rigid bodies: this force contains no waves, and no limit is known."
    begin = f"from the inverse of the record length, {quantity(low, 'Hz', 3)}, " if low else ""
    return f"Shaded: {begin}up to the highest kept mode, {quantity(high, 'Hz', 3)}."


# --------------------------------------------------------------------------- structure


def mobility_charts(study: NoiseStudy) -> tuple[Chart, ...]:
    """Drive-point and transfer mobility of every hit body."""
    return tuple(_mobility_chart(study, name) for name in _body_names(study))


def _mobility_chart(study: NoiseStudy, name: str) -> Chart:
    curves: list[Curve] = []
    marks: dict[float, Mark] = {}
    bodies = _distinct(_bodies(study, name))
    for design, body in bodies:
        whose = f"{design.name}, " if len(bodies) > 1 else ""
        for p, port in enumerate(body.ports):
            for q in range(p, len(body.ports)):
                values = np.abs(body.mobility[p, q])
                what = f"at '{port}'" if p == q else f"from '{port}' to '{body.ports[q]}'"
                label = f"{whose}{what}"
                curves.append(look_of(len(curves)).curve(1e-3 * body.frequency, values, label))
        top = 1e-3 * body.highest_frequency
        if top < 1e-3 * body.frequency[-1]:
            marks[top] = Mark(value=top, label="highest kept mode")
    low, high = (float(1e-3 * bodies[0][1].frequency[i]) for i in (0, -1))
    values = np.concatenate([curve.y for curve in curves])
    top_value = float(values.max())
    limits = (max(float(values.min()), 1e-7 * top_value), 3.0 * top_value)
    return Chart(
        name=f"mobility-{name}",
        title=f"Mobility of the {name}",
        x=AxisSpec(label="frequency", unit="kHz", log=True, range=(low, high)),
        panels=(
            Panel(
                y=AxisSpec(label="velocity per force", unit="m/(N s)", log=True, range=limits),
                curves=tuple(curves),
                marks=tuple(marks.values()),
            ),
        ),
        note=(
            "Velocity of a contact per harmonic force, at the same contact (drive point) or at "
            "another one (transfer). Rigidly held body, without fluid."
        ),
    )


def _distinct(
    found: Sequence[tuple[int, NoiseDesign, BodyNoise]],
) -> list[tuple[NoiseDesign, BodyNoise]]:
    """Bodies of different mobility; variants of a valve share theirs."""
    result: list[tuple[NoiseDesign, BodyNoise]] = []
    for _, design, body in found:
        if not any(
            body.mobility.shape == other.mobility.shape
            and np.allclose(body.mobility, other.mobility, rtol=1e-9, atol=0.0)
            for _, other in result
        ):
            result.append((design, body))
    return result


def blocked_charts(study: NoiseStudy) -> tuple[Chart, ...]:
    """Force on every support, over time and in third octaves."""
    charts = []
    for name in _body_names(study):
        curves, bands, differences, levels = [], [], [], list[Floats]()
        scale, unit = _time_unit(study)
        for i, design, body in _bodies(study, name):
            x, y = thinned(scale * body.blocked.time, body.blocked.values)
            curves.append(look_of(i).curve(x, y, design.label))
            octaves = body.blocked_bands
            levels.append(_level(octaves.energy, ENERGY_REFERENCE))
            bands.append(_steps(octaves, levels[-1], i, design.label, listed=True))
            if i and levels[0].size == levels[-1].size:
                differences.append(_steps(octaves, levels[-1] - levels[0], i, design.label))
        panel = Panel(y=AxisSpec(label="force", unit="N"), curves=tuple(curves), share=0.8)
        charts.append(
            Chart(
                name=f"blocked-{name}",
                title=f"Force of the {name} on its rigid support",
                x=AxisSpec(label="time", unit=unit),
                panels=(panel,),
                note="Force that a rigid support carries along the axis (blocked force).",
            )
        )
        charts.append(
            Chart(
                name=f"blocked-bands-{name}",
                title=f"Force of the {name} on its rigid support, third octaves",
                x=_FREQUENCY_AXIS,
                panels=_compared(
                    "level", "dB re 1 pN²s", bands, 80.0, differences, _trusted(study)
                ),
                note=(
                    "A record that ends while the body still rings is truncated there: bands "
                    "below the inverse of its length result from the truncation. "
                    f"{_trusted_words(study)}"
                ),
            )
        )
    return tuple(charts)


def source_charts(study: NoiseStudy) -> tuple[Chart, ...]:
    """Free velocity, blocked force and their drive lines, and mobility, by freedom."""
    mounted = [d for d in study.designs if d.at_mounts is not None]
    if not mounted:
        return ()
    velocity: list[Curve] = []
    force: list[Curve] = []
    lines: list[Curve] = []
    mobility: list[Curve] = []
    for design in mounted:
        source, whose = design.at_mounts, f"{design.name}, " if len(mounted) > 1 else ""
        assert source is not None
        f = 1e-3 * source.frequency
        for i, item in enumerate(source.freedoms):
            k, label = len(mobility), f"{whose}{item.name}"
            drive_point = np.abs(source.mobility[:, i, i])
            mobility.append(look_of(k).curve(f, drive_point, label))
            if not item.force_bands.energy.any():
                continue
            for bands, reference, curves in (
                (item.velocity_bands, VELOCITY_REFERENCE, velocity),
                (item.force_bands, FORCE_REFERENCE, force),
            ):
                level = _level(bands.energy, reference**2)
                curves.append(_steps(bands, level, k, label, listed=True))
            at, rms = drive_lines(source.frequency, item.blocked_force, design.settings.rate)
            lines.append(look_of(k).curve(1e-3 * at, _level(rms**2, FORCE_REFERENCE**2), label))
    top = max(1e-3 * float(d.at_mounts.frequency[-1]) for d in mounted if d.at_mounts)
    axis = AxisSpec(label="frequency", unit="kHz", log=True, range=(_FREQUENCY[0], top))

    def chart(name: str, title: str, y: AxisSpec, curves: list[Curve], note: str) -> Chart:
        return Chart(
            name=name,
            title=title,
            x=axis,
            panels=(Panel(y=y, curves=tuple(curves)),),
            note=note,
        )

    rate = mounted[0].settings.rate
    return (
        chart(
            "free-velocity",
            "Free velocity of the mounts",
            AxisSpec(label="exposure", unit="dB re (1 nm/s)² s"),
            velocity,
            "Third octaves of one click, not divided by a duration. Rotations re (1 nrad/s)² s.",
        ),
        chart(
            "mount-force",
            "Blocked force of the mounts",
            AxisSpec(label="exposure", unit="dB re (1 µN)² s"),
            force,
            "Third octaves of one click on fixed mounts. Moments re (1 µN m)² s.",
        ),
        chart(
            "drive-lines",
            "Lines of the drive",
            AxisSpec(label="rms", unit="dB re 1 µN"),
            lines,
            f"Rms of the lines of the blocked force at multiples of {quantity(rate, 'Hz', 3)}.",
        ),
        chart(
            "source-mobility",
            "Mobility of the free valve at its mounts",
            AxisSpec(label="velocity per force", unit="m/(N s), 1/(N m s)", log=True),
            mobility,
            "Drive points; rotations per moment. The files of the source contain the whole matrix.",
        ),
    )


def machine_charts(study: NoiseStudy) -> tuple[AnyChart, ...]:
    """Force on the machine beside the blocked force, energy by freedom, paths to each ear."""
    mounted = [d for d in study.designs if d.machine is not None]
    k, force = -1, list[Curve]()
    energy: list[Curve] = []
    ears: dict[str, list[Curve]] = {}
    bars: list[tuple[str, dict[str, float]]] = []
    for design in mounted:
        found, whose = design.machine, f"{design.name}, " if len(mounted) > 1 else ""
        assert found is not None
        for item in found.freedoms:
            if not item.force.any():
                continue
            k, label = k + 1, f"{whose}{item.name}"
            level = _level(item.force_bands.energy, FORCE_REFERENCE**2)
            force.append(_steps(item.force_bands, level, k, label, listed=True))
            level = _level(item.blocked_bands.energy, FORCE_REFERENCE**2)
            if item.blocked_bands.energy.any():
                blocked = _steps(item.blocked_bands, level, k, "")
                force.append(replace(blocked, width=0.9, style="dotted"))
            taken = item.energy_bands.energy
            if np.any(taken > 0.0):
                level = np.where(taken > 0.0, _level(taken, SOUND_ENERGY_REFERENCE), np.nan)
                energy.append(_steps(item.energy_bands, level, k, label, listed=True))
        for ear in found.ears:
            own = ears.setdefault(ear.name, [])
            level = _level(ear.bands.energy, EXPOSURE_REFERENCE)
            whole = _steps(ear.bands, level, len(own), f"{whose}all paths", listed=True)
            own.append(replace(whole, width=2.6))
            for path in ear.paths:
                if path.bands.energy.any():
                    level = _level(path.bands.energy, EXPOSURE_REFERENCE)
                    own.append(_steps(path.bands, level, len(own), whose + path.name, listed=True))
            bars.append((f"{whose}{ear.name}", {path.name: path.share for path in ear.paths}))
    if not force or not energy:
        return ()
    top = max(1e-3 * float(d.machine.frequency[-1]) for d in mounted if d.machine)
    axis = AxisSpec(label="frequency", unit="kHz", log=True, range=(_FREQUENCY[0], top))

    def chart(name: str, title: str, panel: Panel, note: str) -> Chart:
        return Chart(name=name, title=title, x=axis, panels=(replace(panel, share=1.0),), note=note)

    return (
        chart(
            "machine-force",
            "Force on the machine",
            _level_panel("exposure", "dB re (1 µN)² s", force, 80.0),
            "Third octaves of one click; thin dotted: the blocked force, which an immovable "
            "machine would receive. Moments re (1 µN m)² s.",
        ),
        chart(
            "machine-energy",
            "Energy into the machine",
            _level_panel("energy", "dB re 1 pJ", energy, 80.0),
            "By degree of freedom; gaps where a degree of freedom returns energy.",
        ),
        *(
            chart(
                f"paths-{name}",
                f"Paths to the ear '{name}'",
                _level_panel("level", "dB re (20 µPa)²s", curves, _SILENCE),
                "Sound exposure of one click, without weighting. Paths add with their phases.",
            )
            for name, curves in ears.items()
        ),
        *([] if not bars else [_path_bars(bars)]),
    )


def _path_bars(rows: Sequence[tuple[str, dict[str, float]]]) -> BarChart:
    """Shares of the paths: what raises the sound, and what lowers it."""
    paths = dict.fromkeys(path for _, own in rows for path, share in own.items() if share)
    lowered = any(share < -_UNSEEN for _, own in rows for share in own.values())
    ways = (("raise", 1.0), ("lower", -1.0)) if lowered else (("raise", 1.0),)
    return BarChart(
        name="paths",
        title="Shares of the paths in the sound",
        x=AxisSpec(label="share of the A-weighted exposure", unit="%"),
        rows=tuple(f"{name}: {way}" if lowered else name for name, _ in rows for way, _ in ways),
        parts=tuple(
            BarPart(
                label=path,
                values=tuple(
                    100.0 * max(sign * own.get(path, 0.0), 0.0)
                    for _, own in rows
                    for _, sign in ways
                ),
                colour=look_of(k).colour,
            )
            for k, path in enumerate(paths)
        ),
        note="Each path with its phase; positive minus negative shares give 100 %."
        if lowered
        else "Each path with its phase; none lowers the sound by 1 % or more.",
    )


def radiation_chart(study: NoiseStudy) -> Chart | None:
    """Sound energy per band, that at efficiency 1, and the difference of designs."""
    with_bodies = [(i, design) for i, design in _designs(study) if design.bodies]
    if not with_bodies:
        return None
    curves, bounds, differences = [], [], []
    first = with_bodies[0][1]
    for i, design in with_bodies:
        octaves = design.stops[0].bands
        level = _level(design.radiated_bands, SOUND_ENERGY_REFERENCE)
        curves.append(_steps(octaves, level, i, design.label, listed=True))
        bound = np.sum([body.upper_bound.sum(axis=0) for body in design.bodies], axis=0)
        steps = _steps(octaves, _level(bound, SOUND_ENERGY_REFERENCE), i, "")
        bounds.append(replace(steps, width=0.9, style="dotted"))
        if design is not first and _same_bands(design, first):
            apart = level - _level(first.radiated_bands, SOUND_ENERGY_REFERENCE)
            differences.append(_steps(octaves, apart, i, design.label))
    levels = [*curves, *bounds]
    return Chart(
        name="radiation",
        title="Radiated sound energy of one run, an estimate",
        x=_FREQUENCY_AXIS,
        panels=_compared("energy", "dB re 1 pJ", levels, 80.0, differences, _trusted(study)),
        note=(
            "Thick: as in the case. Thin dotted lines: radiation efficiency 1 in every band, "
            f"which is not a bound. {_trusted_words(study)}"
        ),
    )


def own_sound_charts(study: NoiseStudy) -> tuple[Chart, ...]:
    """Level over polar angle in some bands, and pressure over time, by the valve's own surface."""
    known = [(i, d, d.own_sound) for i, d in _designs(study) if d.own_sound is not None]
    if not known:
        return ()
    curves: list[Curve] = []
    axis: list[Curve] = []
    side: list[Curve] = []
    ends = []
    for i, design, own in known:
        whose = f"{design.name}, " if len(known) > 1 else ""
        level = _level(own.exposure, EXPOSURE_REFERENCE)
        for band in (band for band in _OCTAVES if band < 1.1 * own.middle[-1]):
            n = int(np.argmin(np.abs(np.log(own.middle / band))))
            label = f"{whose}{quantity(band, 'Hz', 2)}"
            curves.append(look_of(len(curves)).curve(np.degrees(own.angle), level[n], label))
        ends.append(_end(own.side.time, own.side.values))
        ends.append(_end(own.axis.time, own.axis.values))
        for found, series in ((axis, own.axis), (side, own.side)):
            x, y = thinned(1e3 * series.time, 1e3 * series.values)
            found.append(look_of(i).curve(x, y, design.label, listed=found is axis))
    if not curves:
        return ()
    first, top = known[0][1], min(float(own.middle[-1]) for *_, own in known)
    where = quantity(first.settings.distance, "m", 3)
    window = (1e3 * min(float(own.axis.time[0]) for *_, own in known), 1e3 * max(ends))
    return (
        Chart(
            name="directivity",
            title=f"Directivity of the valve's own surface at {where}",
            x=AxisSpec(label="angle from +z", unit="degrees", range=(0.0, 180.0)),
            panels=(
                replace(_level_panel("level", "dB re (20 µPa)²s", curves, _SILENCE), share=1.0),
            ),
            note="Sound exposure of one click in third octaves, all bodies with their phases, "
            "far field in free space; symmetric about the axis.",
        ),
        Chart(
            name="own-click",
            title=f"Sound pressure of the valve's own surface at {where}",
            x=AxisSpec(label="time", unit="ms", range=window),
            panels=(
                Panel(y=AxisSpec(label="on the axis", unit="mPa"), curves=tuple(axis), share=0.7),
                Panel(y=AxisSpec(label="beside", unit="mPa"), curves=tuple(side), share=0.7),
            ),
            note=f"By boundary elements with phase, to {quantity(top, 'Hz', 2)}, without the "
            "travel time; 0 degrees is on the axis towards +z, 90 degrees to the side.",
        ),
    )


# --------------------------------------------------------------------------- sound


def heard_words(design: NoiseDesign) -> tuple[str, str]:
    """Where the sound of a design is heard, and what it comes from."""
    if design.settings.ear:
        return (
            f"at '{design.settings.ear}'",
            "From the forces on the machine and its pressures per force.",
        )
    return (
        f"at {quantity(design.settings.distance, 'm', 3)}",
        "Estimate: monopole in a free field with minimum phase; without the travel time.",
    )


def click_charts(study: NoiseStudy) -> tuple[Chart, ...]:
    """Sound pressure of a click, its third octaves, and its loudness."""
    heard = [(i, d, d.sound) for i, d in _designs(study) if d.sound is not None]
    if not heard:
        return ()
    waves, loud, bands, differences = [], [], [], []
    first = heard[0][2]
    ends = [_end(sound.pressure.time, sound.pressure.values) for *_, sound in heard]
    begin = 1e3 * min(float(sound.pressure.time[0]) for *_, sound in heard)
    window = (begin, 1e3 * max(ends))
    for i, design, sound in heard:
        x, y = thinned(1e3 * sound.pressure.time, 1e3 * sound.pressure.values, window=window)
        waves.append(look_of(i).curve(x, y, design.label))
        loud.append(
            look_of(i).curve(
                1e3 * sound.loudness.time, sound.loudness.loudness, design.label, listed=False
            )
        )
        level = _level(sound.bands.energy, EXPOSURE_REFERENCE)
        bands.append(_steps(sound.bands, level, i, design.label, listed=True))
        if sound is not first:
            apart = level - _level(first.bands.energy, EXPOSURE_REFERENCE)
            differences.append(_steps(sound.bands, apart, i, design.label))
    where, how = heard_words(heard[0][1])
    over_time = Chart(
        name="click",
        title=f"One click {where}: sound pressure and loudness",
        x=AxisSpec(label="time", unit="ms", range=window),
        panels=(
            Panel(y=AxisSpec(label="pressure", unit="mPa"), curves=tuple(waves)),
            Panel(y=AxisSpec(label="loudness", unit="sone"), curves=tuple(loud), share=0.6),
        ),
        note=(
            f"{how} Loudness after ISO 532-1 for sounds that vary in time; it decays more slowly "
            "than the sound, as in human hearing."
        ),
    )
    over_bands = Chart(
        name="click-bands",
        title=f"One click {where}, third octaves",
        x=AxisSpec(label="frequency", unit="kHz", log=True, range=(0.02, 20.0)),
        panels=_compared("level", "dB re (20 µPa)²s", bands, _SILENCE, differences),
        note="Sound exposure of one click per band, without weighting. Sound ends at 20 kHz.",
    )
    return over_time, over_bands


def _end(time: Floats, values: Floats) -> float:
    """When the sound is below a hundredth of its peak, with a margin [s]."""
    loud = np.flatnonzero(np.abs(values) > 0.01 * np.abs(values).max())
    last = float(time[loud[-1]]) if loud.size else float(time[-1])
    return min(last + 0.1 * (last - float(time[0])) + 5e-3, float(time[-1]))
