"""Figures of a stroke report, with the units of the workshop: ms, us, V, A, N, bar, um, m/s.

Long records are thinned to the smallest and the largest value of each pixel column.
"""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from klack.analyses.stroke.analysis import first_impact
from klack.analyses.stroke.delivery import passed_mass
from klack.analyses.stroke.record import (
    LineSummary,
    StopSummary,
    StrokeChannels,
    StrokeStudy,
    StrokeVariant,
)
from klack.report.chart import AxisSpec, Band, BarChart, BarPart, Chart, Curve, Mark, Panel
from klack.report.looks import OTHER, PART_LOOKS, Look, look_of, thinned
from klack.report.wording import listed, quantity
from klack.simulation.network_result import EnergyBooks, ImpactEvent

__all__ = [
    "actuation_chart",
    "delivery_chart",
    "echo_chart",
    "energy_bars",
    "first_impact_chart",
    "loop_chart",
    "mechanical_energy_bars",
    "shown_stops",
    "stop_law_chart",
    "variants_chart",
]


Floats = NDArray[np.float64]

_LOOKS: dict[str, Look] = {
    "wet": Look("black", "solid", 2.2),
    "dry": Look("red", "dashed", 2.0),
    "dry-mounted": Look("green", "dashdot", 2.0),
    "wet-lumped": Look("blue", "dashdot", 2.0),
    "dry-lumped": Look("orange", "dotted", 2.2),
}
_TIME = AxisSpec(label="time", unit="ms")
_ZERO = Mark(value=0.0, axis="y")
_SMALL = 0.01
"""Share of a bar below which a part is "everything else"."""
_MOST_PARTS = 7
_KINDS = {
    "flow": "throttling",
    "film": "squeeze films",
    "damping": "damping of bodies and springs",
    "contact": "contacts",
    "friction": "friction in lines",
    "(stored)": "stored in bodies, springs and fluid",
}
"""Last word of an entry of the energy balance: its kind."""


_INSIDE_LINE = re.compile(r" (?:before|behind) friction \d+ pressure$")

# --------------------------------------------------------------------------- whole stroke


def _drawn_pressures(channels: StrokeChannels) -> tuple[str, ...]:
    """Pressures that differ in their looks: not those between the lumps of a line."""
    outside = [name for name in channels.pressures if not _INSIDE_LINE.search(name)]
    return tuple(outside[:_MOST_PARTS])


def actuation_chart(study: StrokeStudy) -> Chart:
    """Reference on one time axis, from voltage to motion."""
    variant, channels = study.reference, study.channels
    panels = [
        _channel_panel(variant, names, AxisSpec(label=label, unit=unit), factor, share)
        for names, label, unit, factor, share in (
            (channels.voltage, "voltage", "V", 1.0, 0.4),
            (channels.current, "current", "A", 1.0, 0.5),
            (channels.magnetic_force, "magnet", "N", 1.0, 0.5),
            (_drawn_pressures(channels), "pressure", "bar", 1e-5, 0.6),
            ((channels.lift,), "lift", "µm", 1e6, 0.6),
            ((channels.velocity,), "velocity", "m/s", 1.0, 0.6),
        )
    ]
    marks, plain = _moments(study, variant)
    shown = [
        replace(panel, marks=(*(plain if i else marks), _ZERO))
        for i, panel in enumerate(panel for panel in panels if panel.curves)
    ]
    return Chart(
        name="actuation",
        title=f"One actuation: {variant.label}",
        x=_axis_over(variant),
        panels=tuple(shown),
        note=(
            f"Reference variant '{variant.name}'. Pressures are absolute, at most {_MOST_PARTS} "
            "are drawn; forces and flows are "
            "means over a record. Lift is the displacement of "
            f"{channels.lift.removesuffix(' displacement')}, velocity that of the centre of mass "
            f"of the {study.needle}; both positive towards the opening stop."
        ),
    )


def variants_chart(
    study: StrokeStudy, names: Sequence[str], *, name: str, title: str, note: str
) -> Chart:
    """Lift, velocity and stop forces of several variants."""
    variants = [study.variants[key] for key in names]
    panels = [
        _variant_panel(variants, study.channels.lift, AxisSpec(label="lift", unit="µm"), 1e6, 0.6),
        _variant_panel(
            variants, study.channels.velocity, AxisSpec(label="velocity", unit="m/s"), 1.0, 0.5
        ),
    ]
    forces = [
        _variant_panel(
            variants, f"{stop} peak force", AxisSpec(label=stop, unit="N"), 1.0, 0.4, label=False
        )
        for stop in shown_stops(study)
    ]
    tops = [max((float(curve.y.max()) for curve in panel.curves), default=0.0) for panel in forces]
    # a film alone that presses with a fraction of a newton says nothing beside an impact
    panels += [p for p, top in zip(forces, tops, strict=True) if top > _SMALL * max(tops) > 0.0]
    return Chart(
        name=name,
        title=title,
        x=_axis_over(*variants),
        panels=tuple(panel for panel in panels if panel.curves),
        note=f"{note} Forces on the stops: the largest value of every record.",
    )


def delivery_chart(study: StrokeStudy) -> Chart | None:
    """Mass that has passed the restrictions that lead out, and their flow; None without fluid."""
    wet = next((item for item in study.variants.values() if item.restrictions), None)
    if wet is None or wet.result.time.size < 2:
        return None
    shown = [item for item in wet.restrictions if any(item.ends)] or list(wet.restrictions)
    masses, flows = list[Curve](), list[Curve]()
    time = 1e3 * wet.result.time
    for item, look in zip(shown, map(look_of, range(_MOST_PARTS)), strict=False):
        mass = passed_mass(item, wet.result)
        masses.append(look.curve(*thinned(time, 1e6 * mass), item.component))
        flow = np.diff(mass) / np.diff(wet.result.time)
        flows.append(look.curve(*thinned(time[1:], 1e3 * flow), item.component, listed=False))
    lift = _channel_panel(wet, (study.channels.lift,), AxisSpec(label="lift", unit="µm"), 1e6, 0.5)
    panels = (
        Panel(y=AxisSpec(label="mass", unit="mg"), curves=tuple(masses), marks=(_ZERO,), share=0.7),
        Panel(y=AxisSpec(label="flow", unit="g/s"), curves=tuple(flows), marks=(_ZERO,), share=0.6),
        lift,
    )
    return Chart(
        name="delivery",
        title=f"Mass that flows: {wet.label}",
        x=_axis_over(wet),
        panels=tuple(panel for panel in panels if panel.curves),
        note=(
            f"Variant '{wet.name}'; restrictions that lead to ambient or to a prescribed "
            f"pressure, at most {_MOST_PARTS}, positive from port a to port b. Flows are means "
            "over a record."
        ),
    )


def _channel_panel(
    variant: StrokeVariant, names: Iterable[str], axis: AxisSpec, factor: float, share: float
) -> Panel:
    curves: list[Curve] = []
    for name in names:
        data = variant.channel(name)
        if data is None:
            continue
        x, y = thinned(1e3 * variant.result.time, factor * data.values)
        curves.append(look_of(len(curves)).curve(x, y, name))
    if len(curves) == 1:  # the axis says what it is
        curves = [replace(curves[0], listed=False)]
    return Panel(y=axis, curves=tuple(curves), share=share)


def _variant_panel(
    variants: Iterable[StrokeVariant],
    channel: str,
    axis: AxisSpec,
    factor: float,
    share: float,
    *,
    label: bool = True,
) -> Panel:
    curves = []
    for variant in variants:
        data = variant.channel(channel)
        if data is not None:
            x, y = thinned(1e3 * variant.result.time, factor * data.values)
            curves.append(_variant_curve(variant, x, y, label=label))
    return Panel(y=axis, curves=tuple(curves), marks=(_ZERO,), share=share)


def _variant_curve(variant: StrokeVariant, x: Floats, y: Floats, *, label: bool = True) -> Curve:
    return _LOOKS.get(variant.name, OTHER).curve(x, y, variant.label, listed=label)


def _axis_over(*variants: StrokeVariant) -> AxisSpec:
    low = min(float(variant.result.time[0]) for variant in variants)
    high = max(float(variant.result.time[-1]) for variant in variants)
    return AxisSpec(label=_TIME.label, unit=_TIME.unit, range=(1e3 * low, 1e3 * high))


def _moments(
    study: StrokeStudy, variant: StrokeVariant
) -> tuple[tuple[Mark, ...], tuple[Mark, ...]]:
    """Marks at opening, switching off and closing: with and without labels."""
    touches = variant.needle_times
    times = (
        (touches.opening.touch, "opening stop touched"),
        (study.switch_off, "drive ends"),
        (touches.closing.touch, "seat touched"),
    )
    end = float(variant.result.time[-1])
    seen = [(1e3 * time, word) for time, word in times if time is not None and time <= end]
    return (
        tuple(Mark(value=time, label=word) for time, word in sorted(seen)),
        tuple(Mark(value=time) for time, _ in seen),
    )


# --------------------------------------------------------------------------- impacts


def shown_stops(study: StrokeStudy) -> tuple[str, ...]:
    """Both stops, the opening stop first."""
    names = (study.channels.opening_stop, study.channels.seat)
    return tuple(name for name in names if name)


def first_impact_chart(
    study: StrokeStudy, stop: str, names: Sequence[str], *, name: str, title: str
) -> Chart | None:
    """First impact on a stop in fine steps: contact force, film force, gap, velocity.

    None if no variant hits the stop.
    """
    hits = [
        (variant, event)
        for variant in (study.variants[key] for key in names)
        if (event := first_impact(variant, stop)) is not None
    ]
    if not hits:
        return None
    window = _window([event for _, event in hits])
    contact, film, gaps, speeds = [], [], [], []
    for variant, event in hits:
        time, contact_force, film_force = _forces(variant, stop, event, window)
        contact.append(_variant_curve(variant, *thinned(time, contact_force)))
        if np.any(film_force != 0.0):
            film.append(_variant_curve(variant, *thinned(time, film_force), label=False))
        gap = _gap(variant, stop, event, window)
        gaps.append(_variant_curve(variant, *thinned(*gap), label=False))
        speed = variant.channel(study.channels.velocity)
        if speed is not None:
            since = 1e6 * (variant.result.time - event.time)
            curve = thinned(since, speed.values, window=window)
            speeds.append(_variant_curve(variant, *curve, label=False))
    panels = [
        Panel(y=AxisSpec(label=label, unit=unit), curves=tuple(curves), marks=marks, share=share)
        for label, unit, curves, marks, share in (
            ("contact", "N", contact, (), 0.65),
            ("film", "N", film, (_ZERO,), 0.35),
            ("gap", "µm", gaps, (_ZERO,), 0.4),
            ("velocity", "m/s", speeds, (_ZERO,), 0.45),
        )
    ]
    return Chart(
        name=name,
        title=title,
        x=AxisSpec(label="time since first touch", unit="µs", range=window),
        panels=tuple(panel for panel in panels if panel.curves),
        note=(
            "First touch of every variant is placed at zero. Contact force, film force and gap "
            "in fine steps; the squeeze film pushes before the contact and pulls after it. "
            "During contact the gap of the two bodies is minus the indentation of the local "
            f"law. Velocity: centre of mass of the {study.needle}."
        ),
    )


def _window(events: Sequence[ImpactEvent]) -> tuple[float, float]:
    """Time to show about first touch [us]."""
    longest = 1e6 * max(event.contact_time for event in events)
    return -0.5 * longest, 2.0 * longest


def _forces(
    variant: StrokeVariant, stop: str, event: ImpactEvent, window: tuple[float, float]
) -> tuple[Floats, Floats, Floats]:
    """Time since touch [us], contact and film force [N] in fine steps; zero in flight."""
    record = variant.result.interfaces[stop]
    time = 1e6 * (record.time + 0.5 * record.step - event.time)
    seen = (time >= window[0]) & (time <= window[1])
    step = 1e6 * record.step[seen]
    return _with_flights(
        time[seen], step, (record.contact_force[seen], record.film_force[seen]), window
    )


def _with_flights(
    time: Floats, step: Floats, forces: tuple[Floats, Floats], window: tuple[float, float]
) -> tuple[Floats, Floats, Floats]:
    """Zeros at both ends of stretches without a record."""
    if not time.size:
        ends = np.array(window)
        return ends, np.zeros(2), np.zeros(2)
    begins = np.concatenate([[window[0]], time + step])
    ends = np.concatenate([time - step, [window[1]]])
    flights = ends - begins > np.concatenate([step[:1], step])
    quiet = np.concatenate([begins[flights], ends[flights]])
    order = np.argsort(np.concatenate([time, quiet]), kind="stable")
    none = np.zeros(quiet.size)
    contact, film = (np.concatenate([force, none])[order] for force in forces)
    return np.concatenate([time, quiet])[order], contact, film


def _gap(
    variant: StrokeVariant, stop: str, event: ImpactEvent, window: tuple[float, float]
) -> tuple[Floats, Floats]:
    """Time since touch [us] and gap [um]: fine steps, records between them."""
    record = variant.result.interfaces[stop]
    time, gap = 1e6 * (record.time + record.step - event.time), 1e6 * record.gap
    coarse = variant.channel(f"{stop} gap")
    if coarse is not None:
        since = 1e6 * (variant.result.time - event.time)
        spacing = float(since[1] - since[0]) if since.size > 1 else 0.0
        apart = np.full(since.size, np.inf)
        if time.size:
            near = np.clip(np.searchsorted(time, since), 1, time.size - 1) if time.size > 1 else 0
            apart = np.minimum(np.abs(time[near] - since), np.abs(time[near - 1] - since))
        flying = apart > spacing
        time = np.concatenate([time, since[flying]])
        gap = np.concatenate([gap, 1e6 * coarse.values[flying]])
        order = np.argsort(time, kind="stable")
        time, gap = time[order], gap[order]
    seen = (time >= window[0]) & (time <= window[1])
    return time[seen], gap[seen]


def echo_chart(study: StrokeStudy, stop: str, line: LineSummary) -> Chart | None:
    """Velocity and pressures after the first impact on a stop, with the echoes of a line marked.

    A jump of the needle's speed sends a pressure jump into the line; its echo returns after
    ``2 L / a`` and changes the force on the needle stepwise.  None if no variant with fluid hits
    the stop.
    """
    wet = [variant for variant in study.variants.values() if variant.wet and variant.flexible]
    wet = wet or [variant for variant in study.variants.values() if variant.wet]
    event = first_impact(wet[0], stop) if wet else None
    if event is None:
        return None
    variant, channels, echo = wet[0], study.channels, 1e6 * line.echo_time
    since = 1e6 * (variant.result.time - event.time)
    window = (-echo, min(6.0 * echo, float(since[-1])))
    marks = [
        Mark(value=k * echo, label=f"{2 * k}L/a" if k else "touch")
        for k in range(7)
        if k * echo <= window[1]
    ]
    plain = tuple(Mark(value=mark.value) for mark in marks)

    def drawn(named: Iterable[tuple[str, str, Look]], factor: float = 1.0) -> Iterator[Curve]:
        for name, label, look in named:
            data = variant.channel(name)
            if data is not None:
                x, y = thinned(since, factor * data.values, window=window)
                yield look.curve(x, y, label)

    motion = drawn(
        (
            (channels.lift_velocity, channels.lift_velocity, Look("sky", "long", 1.2)),
            (
                channels.velocity,
                f"{channels.velocity} (centre of mass)",
                Look("black", "solid", 2.0),
            ),
        )
    )
    names = _drawn_pressures(channels)
    pressures = drawn(((name, name, look_of(i)) for i, name in enumerate(names)), 1e-5)
    return Chart(
        name=f"echo-{stop}-{line.name}",
        title=f"After the first impact on '{stop}', echoes of the line '{line.name}'",
        x=AxisSpec(label="time since first touch", unit="µs", range=window),
        panels=(
            Panel(
                y=AxisSpec(label="velocity", unit="m/s"),
                curves=tuple(motion),
                bands=_contacts(variant, event.time, window),
                marks=(*_staggered(marks), _ZERO),
                share=0.9,
            ),
            Panel(
                y=AxisSpec(label="pressure", unit="bar"),
                curves=tuple(pressures),
                marks=plain,
                share=0.8,
            ),
        ),
        note=(
            f"Variant '{variant.name}'. Upright lines every 2L/a = "
            f"{quantity(line.echo_time, 's', 3)} (L = {quantity(line.length, 'm', 3)}, a = "
            f"{line.sound_speed:.4g} m/s) from first touch: at these times the pressure wave of "
            "the impact returns from the line and changes the force on the needle in steps, "
            "visible in the rebound velocity. Chambers between needle and line smooth them; "
            "jumps in the shaded intervals are impacts."
        ),
    )


def _contacts(variant: StrokeVariant, zero: float, window: tuple[float, float]) -> tuple[Band, ...]:
    """Stretches in which a stop carries force [us]."""
    spans = [
        (1e6 * (event.time - zero), 1e6 * (event.separation_time - zero))
        for event in variant.result.events
        if event.approach_speed > 0.0
    ]
    seen = [
        (max(low, window[0]), min(high, window[1]) if isfinite(high) else window[1])
        for low, high in spans
        if low < window[1] and not high < window[0]
    ]
    return tuple(
        Band(low=low, high=high, label="contact" if i == 0 else "")
        for i, (low, high) in enumerate(seen)
    )


def _staggered(marks: Sequence[Mark]) -> tuple[Mark, ...]:
    """Only the first marks have labels, else they fill the panel."""
    return tuple(mark if i < 4 else Mark(value=mark.value) for i, mark in enumerate(marks))


# --------------------------------------------------------------------------- laws


def stop_law_chart(stop: StopSummary, *, in_space: bool = False) -> Chart | None:
    """Static approach of the two bodies at a stop and its share in the local law.

    ``in_space`` the law is without the friction of the faces, which contact points have.
    """
    if not stop.force.size:
        return None
    curves = []
    if stop.static_force.size:
        approach, force = np.append(0.0, stop.approach), np.append(0.0, stop.static_force)
        curves.append(Curve(x=1e6 * approach, y=force, label="both bodies, static", width=2.4))
    curves.append(
        Curve(
            x=1e6 * stop.indentation,
            y=stop.force,
            label=f"local law ({stop.kind})",
            colour="red",
            style="dashed",
            width=2.0,
        )
    )
    rubs = stop.friction and not in_space
    kind = f"with friction {stop.friction:g}" if rubs else "without friction"
    note = (
        f"Static contact of the two complete bodies {kind}, counted from first touch, and the "
        "part of it that the local law carries; the kept modes carry the rest."
    )
    if stop.returning.size:
        curves.append(
            Curve(
                x=1e6 * stop.indentation,
                y=stop.returning,
                label="the same, slipping back",
                colour="blue",
                style="dashdot",
                width=1.8,
            )
        )
        note += (
            " On closing, the faces slip along the upper curve of the law; on opening, they "
            "stick first and slip back along the lower curve. The loop between is the lost "
            "energy."
        )
    known = stop.share[np.isfinite(stop.share)]
    if known.size:
        note += f" Share of the law: {100 * known.min():.0f} to {100 * known.max():.0f} %."
    return Chart(
        name=f"law-{stop.name}",
        title=f"Local law of '{stop.name}'",
        x=AxisSpec(label="approach, indentation", unit="µm"),
        panels=(Panel(y=AxisSpec(label="force", unit="N"), curves=tuple(curves)),),
        note=note,
    )


# --------------------------------------------------------------------------- energy


def energy_bars(study: StrokeStudy) -> BarChart:
    """Energy supplies and losses of each run, with the solenoid."""
    return _bars(
        study,
        name="energy",
        title="Energy of the whole valve",
        flows=_flows,
        note=(
            "Over the whole run. Each pair of bars has the same length up to the residual of "
            f"the energy balance, {listed([_residual(v) for v in study.variants.values()])}. "
            "Stores are shown by their change."
        ),
    )


def mechanical_energy_bars(study: StrokeStudy) -> BarChart | None:
    """The same without the circuit: work of the magnet, and its losses."""
    coils = tuple(name.removesuffix("current") for name in study.channels.current)
    if not coils:
        return None
    rubbing = {f"{stop.name} friction": "friction between the faces" for stop in study.stops}
    rubbing["guide friction"] = "friction in the guide"

    def flows(books: EnergyBooks) -> dict[str, float]:
        everything = _flows(books)
        # a list, since the order of a set, and so the last bit of a sum, is another in each process
        circuit = [key for key in everything if key.startswith(coils)]
        work = sum(everything[key] for key in circuit)
        grouped = {"work of the magnet": work}
        for key, value in everything.items():
            if key not in circuit:
                kind = rubbing.get(key) or _KINDS.get(key.rsplit(" ", 1)[-1], key)
                grouped[kind] = grouped.get(kind, 0.0) + value
        return grouped

    return _bars(
        study,
        name="energy-mechanics",
        title="Energy of needle, stops and fluid",
        flows=flows,
        note=(
            "Without the circuit: the work of the magnet is its supply minus ohmic, eddy and "
            "hysteresis losses and the change of the field energy. Entries of one kind are "
            "added up; the table lists each."
        ),
    )


def _flows(books: EnergyBooks) -> dict[str, float]:
    """Entries of the energy balance [J]: positive is a supply."""
    entries = dict(books.supplies)
    for key, value in books.losses.items():
        entries[key] = entries.get(key, 0.0) - value
    for key, value in books.stores_after.items():
        change = value - books.stores_before[key]
        entries[f"{key} (stored)"] = -change
    return entries


def _residual(variant: StrokeVariant) -> str:
    text = f"{variant.result.books.relative_residual:.0e}".replace("-", "\N{MINUS SIGN}")
    return f"{text} of the throughput ({variant.name})"


def _bars(
    study: StrokeStudy,
    *,
    name: str,
    title: str,
    flows: Callable[[EnergyBooks], dict[str, float]],
    note: str,
) -> BarChart:
    rows, entries = [], []
    for variant in study.variants.values():
        found = flows(variant.result.books)  # above zero: came from there
        rows += [f"{variant.name}: from", f"{variant.name}: to"]
        entries.append({key: value for key, value in found.items() if value > 0.0})
        entries.append({key: -value for key, value in found.items() if value < 0.0})
    shares = [sum(entry.values()) or 1.0 for entry in entries]
    weight = {
        key: max(entry.get(key, 0.0) / whole for entry, whole in zip(entries, shares, strict=True))
        for key in dict.fromkeys(key for entry in entries for key in entry)
    }
    ranked = sorted(weight, key=lambda key: -weight[key])
    named = [key for key in ranked if weight[key] > _SMALL][:_MOST_PARTS]
    unit, factor = ("mJ", 1e3) if max(shares) > 2e-3 else ("µJ", 1e6)
    values = [tuple(factor * entry.get(key, 0.0) for entry in entries) for key in named]
    rest = tuple(
        factor * sum(value for key, value in entry.items() if key not in named) for entry in entries
    )
    parts = [
        BarPart(label=key, values=value, colour=colour, hatch=hatch)
        for key, value, (colour, hatch) in zip(named, values, PART_LOOKS, strict=False)
    ]
    if any(rest):
        colour, hatch = PART_LOOKS[-1]
        parts.append(BarPart(label="everything else", values=rest, colour=colour, hatch=hatch))
    return BarChart(
        name=name,
        title=title,
        x=AxisSpec(label="energy", unit=unit),
        rows=tuple(rows),
        parts=tuple(parts),
        note=f"{note} Parts below {100 * _SMALL:g} % appear only in the table.",
    )


_MOST = 2000  # points of a curve
_SHARE = 0.8


def loop_chart(study: StrokeStudy) -> Chart | None:
    """Flux over current of the reference, with hysteresis."""
    variant = study.reference
    losses, channels = variant.result.books.losses, variant.result.channels
    coils = [name.removesuffix(" hysteresis") for name in losses if name.endswith(" hysteresis")]
    curves: list[Curve] = []
    for coil in coils:
        current, flux = channels.get(f"{coil} current"), channels.get(f"{coil} flux")
        if current is None or flux is None:
            continue
        every = max(1, len(flux.values) // _MOST)
        x, y = current.values[::every], 1e6 * flux.values[::every]
        curves.append(look_of(len(curves)).curve(x, y, coil))
        curves.append(
            Curve(
                x=x[:1],
                y=y[:1],
                label=f"start of {coil}",
                drawn="points",
                width=3.5,
                colour="black",
            )
        )
    if not curves:
        return None
    heat = "; ".join(
        f"{coil}: {1e3 * losses[f'{coil} hysteresis']:.3g} mJ lost in hysteresis" for coil in coils
    )
    zero = (Mark(value=0.0, axis="y"), Mark(value=0.0))
    return Chart(
        name="loops",
        title=f"Flux over current: {variant.label}",
        x=AxisSpec(label="current", unit="A"),
        panels=(
            Panel(
                y=AxisSpec(label="flux", unit="µWb"), curves=tuple(curves), marks=zero, share=_SHARE
            ),
        ),
        note=f"Reference variant '{variant.name}'; {heat}. The flux is that of the working gap, "
        "so the loop also contains eddy currents and the motion of the armature.",
    )
