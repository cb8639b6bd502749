"""Impacts and strokes of bodies that stay, computed again at each move of a slider.

An impact is that of ``klack impact --level reduced``, bit for bit: static contact, pattern of the
port, modes' share and law are made again. A stroke is that of ``klack stroke``, with the laws of
its stops as built.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from math import isfinite
from pathlib import Path
from time import perf_counter
from typing import Any, cast

import numpy as np
import scipy
from threadpoolctl import ThreadpoolController

from klack.acoustics.drive_pattern import drive_pattern
from klack.acoustics.force_bands import force_bands
from klack.acoustics.loudness import time_varying_loudness
from klack.acoustics.signal_statistics import sound_statistics
from klack.acoustics.third_octave import ENERGY_REFERENCE, ThirdOctaves
from klack.acoustics.wav import full_scale_of, level_statement, wav_bytes
from klack.analyses.contact_doubts import contact_doubt
from klack.analyses.impact.measures import CONTACT_TIME, PEAK_FORCE, RESTITUTION
from klack.analyses.impact.record import ImpactStudy, LevelResult
from klack.analyses.impact.run import ImpactBodies, impact_bodies, impact_of_bodies
from klack.analyses.impact.wording import FAIR, GOOD, estimate_sentence, worst_error
from klack.analyses.measures import json_of
from klack.analyses.noise.body import Transfers
from klack.analyses.noise.run import click_sounds
from klack.analyses.noise.source import NoiseSource, SourceStop, impact_sources, stroke_sources
from klack.analyses.stroke.analysis import first_impact
from klack.analyses.stroke.missing import missing_notes
from klack.analyses.stroke.record import StrokeChannels, StrokeVariant
from klack.analyses.stroke.run import (
    VariantRun,
    body_summaries,
    one_variant,
    stop_summaries,
    stroke_notes,
    study_of_run,
)
from klack.analyses.study.kinds import kind_of
from klack.app.answers import Answer, Curve, Floats, Hearing, Judgement, Number, Opened, Slider
from klack.assembling.problem import contact_problem
from klack.assembling.valve import Valve, build_valve, filled_network
from klack.bodies.elasticity.loads import NearLoads
from klack.case.any_case import AnyCase, CaseTree, tree_of
from klack.case.key_path import quantity_at, written_at
from klack.case.levels import Variant
from klack.case.points import case_at, checked_parts
from klack.case.rewriting import with_values
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.case.valve_roles import ValveRoles, find_roles
from klack.contact.history import ImpactHistory
from klack.errors import InputError, KlackError
from klack.input.problem import CaseProblem, Key
from klack.machine.progress import silent
from klack.machine.stages import collected_warnings
from klack.signals.sampled import TimeSeries
from klack.units import TEMPERATURE, Kind, unit_in

__all__ = [
    "Curves",
    "Explorer",
    "common_scale",
    "drawn",
    "force_levels",
    "has_sliders",
    "impact_curves",
    "impact_numbers",
    "level_numbers",
    "sliders_of",
    "stroke_curves",
    "stroke_numbers",
]


Curves = tuple[tuple[Curve, ...], tuple[Curve, ...]]
"""Force [N] and lift [um], over time in us (impact) or ms (stroke)."""

_HEADROOM = 12.0  # [dB] of the click that others are compared with, for what they add
_DRAWN = 700  # points of a curve; a chart is up to 800 pixels wide


def drawn(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Points of a smooth curve in equal steps, with its ends and extremes."""
    steps = np.linspace(0, x.size - 1, min(x.size, _DRAWN)).round().astype(int)
    shown = np.union1d(steps, [y.argmin(), y.argmax()])
    return x[shown], y[shown]


def _travelled(history: ImpactHistory) -> tuple[Floats, Floats]:
    """Displacement (up is positive) of the centre of mass of the moving body since the start.

    The integral of its velocity, which every level records.
    """
    mean = 0.5 * (history.velocity_a[1:] + history.velocity_a[:-1])
    return history.edges, np.append(0.0, np.cumsum(mean) * history.step)


def _enveloped(force: TimeSeries) -> tuple[Floats, Floats]:
    """Lowest and highest value of each stretch, so that no impact is lost."""
    count = _DRAWN // 2
    size = max(1, -(-force.values.size // count))
    padded = np.pad(force.values, (0, -force.values.size % size), mode="edge").reshape(-1, size)
    at = force.start + force.step * size * (np.arange(padded.shape[0]) + 0.5)
    return np.repeat(at, 2), np.column_stack([padded.min(axis=1), padded.max(axis=1)]).ravel()


def impact_curves(level: LevelResult) -> Curves:
    """Of one level."""
    history = level.history
    force = Curve.scaled("contact force", *drawn(history.time, history.force), 1e6, 1.0)
    return (force,), (Curve.scaled("needle", *drawn(*_travelled(history)), 1e6, 1e6),)


def stroke_curves(
    variant: StrokeVariant, channels: StrokeChannels, stops: Iterable[SourceStop]
) -> Curves:
    """Of one variant, and of the stops of its noise."""
    force = tuple(Curve.scaled(stop.name, *_enveloped(stop.force), 1e3, 1.0) for stop in stops)
    channel = variant.channel(channels.lift)
    if channel is None:
        return force, ()
    lift = drawn(variant.result.time, channel.values)
    return force, (Curve.scaled("lift", *lift, 1e3, 1e6),)


def force_levels(bands: Sequence[ThirdOctaves]) -> Floats:
    """Levels [dB] of all stop forces together."""
    energy = np.sum([band.energy for band in bands], axis=0)
    return np.asarray(10.0 * np.log10(np.maximum(energy, 1e-30) / ENERGY_REFERENCE))


def level_numbers(pressure: TimeSeries | None) -> tuple[Number, ...]:
    """Sound exposure level, where something radiates."""
    if pressure is None:
        return ()
    level = sound_statistics(pressure).exposure_level_A
    name = "sound exposure level"
    return (Number(key="level", name=name, unit="dB(A)", value=level, difference="dB"),)


def common_scale(now: TimeSeries, base: TimeSeries | None) -> float:
    """Full scale [Pa] of two clicks: the base with room above, or the louder one."""
    louder = full_scale_of(now, headroom=0.1)
    return louder if base is None else max(full_scale_of(base, headroom=_HEADROOM), louder)


def impact_numbers(level: LevelResult) -> tuple[Number, ...]:
    """Of an impact; missing ones of a cut-off run have no value."""
    return tuple(
        Number(
            key=measure.key,
            name=measure.name + measure.remark(level),
            unit=unit,
            value=None if value is None else scale * value,
            difference=difference,
        )
        for measure, unit, scale, difference in (
            (PEAK_FORCE, "N", 1.0, "%"),
            (CONTACT_TIME, "us", 1e6, "us"),
            (RESTITUTION, "", 1.0, "1"),
        )
        for value in json_of([measure], level).values()
    )


def stroke_numbers(variant: StrokeVariant, channels: StrokeChannels) -> tuple[Number, ...]:
    """Times of a stroke, and the first impact on each stop."""
    times = (
        ("opening", "opening time", variant.opening_time),
        ("closing", "closing time", variant.closing_time),
    )
    stops = [name for name in (channels.opening_stop, channels.seat) if name]
    firsts = [(stop, first_impact(variant, stop)) for stop in stops]
    return (
        *(
            Number(
                key=key,
                name=name,
                unit="us",
                value=None if value is None else 1e6 * value,
                difference="us",
            )
            for key, name, value in times
        ),
        *(
            Number(
                key=f"peak_{stop}",
                name=f"first peak, {stop}",
                unit="N",
                value=None if event is None else event.peak_force,
            )
            for stop, event in firsts
        ),
    )


_MOST = 60
_WARMER = 80.0  # [K] of sliders of temperatures, up and down
_REACH = 2.5  # times the value of the case, up; to a fifth of it, down
_FIRST: tuple[tuple[str, ...], ...] = (
    ("speed",),
    ("preload",),
    ("gap", "lift"),
    ("force",),
    ("damping", "modal"),
    ("cut_off", "roughness"),
    ("voltage", "current"),
    ("stiffness",),
    ("pressure",),
)
_NEVER = ("study", "calibration", "measurement", "run", "reduction", "include", "lumped", "parts")
_STEPS = 200


def sliders_of(case: AnyCase, tree: CaseTree) -> tuple[Slider, ...]:
    """Quantities in the case, the movable ones first."""
    kind: Any = kind_of(case)
    found = []
    for place in _leaves(tree.data):
        if place[0] in _NEVER:
            continue
        try:
            quantity = quantity_at(case, place)
        except CaseProblem:
            continue
        needs_mesh = any(kind.makes_bodies(case, key) for key in case.behind(place))
        if quantity.value == 0 or not isfinite(quantity.value):
            continue
        text = written_at(tree.data, place)
        found.append(_slider(place, quantity.kind, quantity.value, needs_mesh, text))
    found = _joined(case, found)
    if isinstance(case, Case):
        found += _offered(case, tree)
    moving = _in_turns(s for s in found if not s.needs_mesh)
    fixed = [s for s in found if s.needs_mesh and "profile" not in s.place]
    return tuple(moving[:_MOST] + fixed[:_MOST])


def _joined(case: AnyCase, sliders: Sequence[Slider]) -> list[Slider]:
    """One slider for places that the study of the case links to one word of its own."""
    linked = case.study.linked if case.study is not None else {}
    first: dict[tuple[str, float], int] = {}
    found: list[Slider] = []
    for slider in sliders:
        word = linked.get(slider.key, "")
        at = first.setdefault((word, slider.start), len(found)) if word.isidentifier() else None
        if at is None or at == len(found):
            label = word.replace("_", " ") if at is not None else slider.label
            found.append(replace(slider, label=label))
        else:
            found[at] = replace(found[at], also=(*found[at].also, slider.place))
    return found


def _offered(case: Case, tree: CaseTree) -> Iterator[Slider]:
    if written_at(tree.data, ("motion", "force")) is None:
        yield _from_zero(("motion", "force"), "closing force", "N", 100.0)
    for body in case.bodies:
        if not written_at(tree.data, ("bodies", body, "damping")):
            place = ("bodies", body, "damping", "modal")
            yield _from_zero(place, f"{body} damping modal", "", 0.05)


def _from_zero(place: Key, label: str, unit: str, high: float) -> Slider:
    return Slider(
        key=".".join(map(str, place)),
        place=place,
        label=label,
        unit=unit,
        low=0.0,
        high=high,
        start=0.0,
        step=high / _STEPS,
        needs_mesh=False,
        written="not given",
    )


def written(slider: Slider, value: float) -> str | float:
    """A value as the page shows it and the case file gets it."""
    if not isfinite(value):
        raise InputError(slider.key, got=str(value), expected="a number", hint="move the slider.")
    text = slider.text(value)
    return text if slider.unit or slider.own else float(text)


def _slider(place: Key, kind: Kind, value: float, needs_mesh: bool, text: object) -> Slider:
    unit = "" if kind.bare else kind.unit
    own, size = unit_in(text, kind)
    low, high = sorted((0.2 * value, _REACH * value))
    if kind is TEMPERATURE:
        low, high = max(value - _WARMER, 1.0), value + _WARMER
    if kind.bare and 0 < value < 1:
        high = min(high, 0.99)
    found = Slider(
        key=".".join(map(str, place)),
        place=place,
        label=_label(place),
        unit=unit,
        low=low,
        high=high,
        start=value,
        step=(high - low) / _STEPS,
        needs_mesh=needs_mesh,
        written="",
        own=own,
        size=size,
    )
    return replace(found, written=found.text(value))


def _label(place: Key) -> str:
    """``network.components.spring.preload`` is ``spring preload``."""
    parts = [str(part) for part in place]
    for start in (["network", "components"], ["bodies"], ["parameters"]):
        if parts[: len(start)] == start:
            parts = parts[len(start) :]
    return " ".join(part.replace("_", " ") for part in parts if part != "motion")


def _rank(slider: Slider) -> tuple[int, str]:
    if slider.place[0] == "parameters":  # named by who wrote the case
        return -1, slider.key
    if slider.place[0] == "noise":
        return len(_FIRST) + 1, slider.key
    last = str(slider.place[-1])
    for rank, words in enumerate(_FIRST):
        if any(word in last for word in words):
            return rank, slider.key
    return len(_FIRST), slider.key


def _in_turns(sliders: Iterable[Slider]) -> list[Slider]:
    """Two of each kind of number, then the next two, in the order of :data:`_FIRST`."""
    counted: dict[int, int] = {}
    keyed = []
    for slider in sorted(sliders, key=_rank):
        rank = _rank(slider)[0]
        turn = counted[rank] = counted.get(rank, -1) + 1
        keyed.append(((turn // 2 if rank >= 0 else 0, rank, turn), slider))
    return [slider for _, slider in sorted(keyed, key=lambda item: item[0])]


def _leaves(data: Any, above: Key = ()) -> Iterator[Key]:
    items: Iterable[tuple[Any, Any]] = ()
    if isinstance(data, dict):
        items = data.items()
    elif isinstance(data, list):
        items = enumerate(data)
    else:
        yield above
    for key, value in items:
        yield from _leaves(value, (*above, key))


Values = Mapping[str, float]
"""Of sliders, by their keys, in SI."""

_SHOWN = 0.05  # [s] of the spectrogram
_LONGEST = 5.0  # [s] of a drive pattern
_REFERENCE = 20e-6  # [Pa]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Computed:
    source: NoiseSource
    bands: tuple[ThirdOctaves, ...]
    pressures: Mapping[str, TimeSeries]
    force: tuple[Curve, ...]
    lift: tuple[Curve, ...]
    numbers: tuple[Number, ...]
    doubts: tuple[str, ...]


class Explorer:
    """Object behind a slider page, in its own process."""

    def __init__(self) -> None:
        self._text = ""
        self._tree: CaseTree | None = None
        self._case: AnyCase | None = None
        self._design: _Impacts | _Strokes | None = None
        self._sliders: dict[str, Slider] = {}
        self._parts: tuple[set[Key], CaseTree] | None = None  # of the sliders that move
        self._pinned: Mapping[str, TimeSeries] = {}
        self._last: tuple[dict[str, float], _Computed] | None = None
        self._pinned_loudness: dict[str, Number] = {}
        self._pinned_level: dict[str, tuple[Number, ...]] = {}
        self._pools = ThreadpoolController()

    def open(self, text: str, path: str) -> Opened:
        """Build the bodies of a case and compute it."""
        if self._design is not None:
            self._design.close()
            self._design = None
        self._text, self._tree = text, tree_of(text, Path(path))
        self._parts = None
        with collected_warnings():  # the first position tells them again
            self._case = case = self._tree.any_case()
            found = sliders_of(case, self._tree)
            self._sliders = {slider.key: slider for slider in found}
            if isinstance(case, ValveCase):
                self._design = _Strokes(case)
            else:
                self._design = _Impacts(case, self._hardest(found))
        self._pinned, self._last = {}, None
        self._pools = ThreadpoolController()  # with libraries that came since
        first = self.move({}, pin=True)
        return Opened(
            title=case.title or case.name,
            kind="stroke" if isinstance(case, ValveCase) else "impact",
            sliders=found,
            run=self._design.run,
            first=first,
        )

    def move(self, values: Values, pin: bool = False, ear: str = "") -> Answer:
        """Force, motion, bands and click at a position of the sliders.

        ``values`` are of sliders that are off their place in the case; ``pin`` compares later
        positions with this one. The click is at the ``ear``, or the first one.
        """
        begin = perf_counter()
        design = self._require_open()
        with self._one_thread():
            found = self._computed(values)
        bands = found.bands
        if pin:
            self._pinned, self._pinned_loudness, self._pinned_level = found.pressures, {}, {}
        pressure = _at(found.pressures, ear)
        wav, ghost, scale = _sounds(pressure, _at(self._pinned, ear))
        return Answer(
            force=found.force,
            lift=found.lift,
            time_unit=design.time_unit,
            bands=bands[0].middle,
            levels=force_levels(bands),
            numbers=(*found.numbers, *level_numbers(pressure)),
            wav=wav,
            ghost_wav=ghost,
            scale=scale,
            ears=tuple(filter(None, found.pressures)),
            ghost_level=self._level_pinned(ear),
            doubts=found.doubts,
            seconds=perf_counter() - begin,
        )

    def judge(self, values: Values) -> Judgement:
        """Estimated error, once the sliders rest."""
        design = self._require_open()
        with self._one_thread(), collected_warnings():  # the move has told them
            grade, words = design.judged(self._case_at(values))
        return Judgement(grade=grade, words=words)

    def listen(self, values: Values, ear: str = "") -> Hearing | None:
        """Loudness, spectrogram and drive pattern, once the sliders rest."""
        with self._one_thread():
            found = self._computed(values)
            pressure, drive = _at(found.pressures, ear), found.source.noise.drive
            if pressure is None:
                return None
            pattern = drive_pattern(pressure, drive.rate, min(drive.duration, _LONGEST))
            now = _loudness(pressure)
            pinned = _at(self._pinned, ear)
            if ear not in self._pinned_loudness and pinned is not None:
                self._pinned_loudness[ear] = _loudness(pinned)
        return Hearing(
            number=now,
            pinned=self._pinned_loudness.get(ear, now),
            spectrogram=_spectrogram(pressure),
            pattern_wav=wav_bytes(pattern, full_scale=common_scale(pattern, pinned)),
        )

    def text_at(self, values: Values) -> str:
        """Text of the case with these values, otherwise as written."""
        assert self._tree is not None
        places = {
            place: slider.text(value)
            for key, value in values.items()
            for slider in [self._sliders[key]]
            for place in slider.places
        }
        return with_values(self._tree, places) if places else self._text

    def _computed(self, values: Values) -> _Computed:
        """A position; the last one is kept for what follows."""
        if self._last is None or self._last[0] != values:
            with collected_warnings() as notes:  # of reading it, too
                found = self._require_open().at(self._case_at(values))
            doubts = tuple(filter(None, dict.fromkeys((*notes, *found.doubts))))
            self._last = dict(values), replace(found, doubts=doubts)
        return self._last[1]

    def _level_pinned(self, ear: str) -> tuple[Number, ...]:
        if ear not in self._pinned_level:
            self._pinned_level[ear] = level_numbers(_at(self._pinned, ear))
        return self._pinned_level[ear]

    def _one_thread(self) -> Any:
        """Small matrices: threads would wait for each other."""
        return self._pools.limit(limits=1)

    def _case_at(self, values: Values) -> Any:
        assert self._tree is not None
        assert self._case is not None
        changes: dict[Key, str | float] = {}
        for key, value in values.items():
            slider = self._sliders.get(key)
            if slider is None or slider.needs_mesh:
                raise InputError(
                    key,
                    got="a key without a slider",
                    expected="one of the sliders",
                    hint="change it in the case, and open the case.",
                )
            changes |= dict.fromkeys(slider.places, written(slider, value))
        kind: Any = type(self._case)
        return case_at(kind, self._tree, self._parts_beside(set(changes)), changes)

    def _parts_beside(self, moved: set[Key]) -> CaseTree:
        """The case with what these sliders leave alone checked already."""
        assert self._tree is not None
        if not isinstance(self._case, ValveCase):
            return self._tree
        if self._parts is None or self._parts[0] != moved:
            self._parts = moved, checked_parts(self._tree, self._case, moved)
        return self._parts[1]

    def _hardest(self, sliders: Sequence[Slider]) -> Case | None:
        """Case with all motion sliders at their upper ends, if valid."""
        highest = {
            slider.key: slider.high
            for slider in sliders
            if slider.place[0] == "motion" and not slider.needs_mesh
        }
        try:
            return cast(Case, self._case_at(highest))
        except InputError:
            return None

    def _require_open(self) -> "_Impacts | _Strokes":
        if self._design is None:
            raise InputError("sliders", got="no case", expected="an open one", hint="reload.")
        return self._design


# --------------------------------------------------------------------------- impacts


def has_sliders(case: AnyCase) -> bool:
    """Whether an explorer takes a case: impacts with surfaces, along the axis."""
    if isinstance(case, ValveCase):
        return True
    with suppress(InputError):
        return case.has_surfaces and bool(case.require_levels((_Impacts.run,)))
    return False


class _Impacts:
    run, time_unit = "reduced", "us"

    def __init__(self, case: Case, hardest: Case | None) -> None:
        if not case.has_surfaces:
            raise InputError(
                f"case {case.name}",
                got="bodies given as models, without surfaces",
                expected="bodies with meshes",
                hint="run it, and compare results.",
            )
        self._bodies: ImpactBodies = impact_bodies(case, levels=(self.run,), certify=True)
        if hardest is not None:
            with suppress(KlackError):  # moves tell what is wrong there
                contact_problem(hardest, self._bodies.placed, silent)
        self._bodies.placed.keep_no_more()
        self._transfers = Transfers()
        self._near = {name: NearLoads() for name in self._bodies.pools}

    def close(self) -> None:
        self._bodies.close()

    def at(self, case: Case) -> _Computed:
        study = self._study(case, certify=False)
        level = study.levels[self.run]
        source = impact_sources(study, (self.run,), case)[0]
        force, lift = impact_curves(level)
        bands = tuple(force_bands(stop.force) for stop in source.stops)
        return _Computed(
            source=source,
            bands=bands,
            pressures=click_sounds(source, self._transfers, bands),
            force=force,
            lift=lift,
            numbers=impact_numbers(level),
            doubts=(*study.warnings, contact_doubt(study.contact), *source.notes),
        )

    def judged(self, case: Case) -> tuple[str, str]:
        study = self._study(case, certify=True)
        if self.run not in study.estimates:
            return "none", study.estimate_doubt or "There is no estimate for this case."
        worst = worst_error(study, self.run)
        is_out = worst > FAIR or study.contact.doubts or study.reference != self.run
        grade = "out" if is_out else "good" if worst <= GOOD else "fair"
        return grade, estimate_sentence(study)

    def _study(self, case: Case, *, certify: bool) -> ImpactStudy:
        levels = case.require_levels((self.run,))
        return impact_of_bodies(case, self._bodies, levels=levels, certify=certify, near=self._near)


# --------------------------------------------------------------------------- strokes


class _Strokes:
    time_unit = "ms"

    def __init__(self, case: ValveCase) -> None:
        with collected_warnings() as notes:
            self._valve: Valve = build_valve(case, silent, threads=1)
            self._bodies, self._stops = body_summaries(self._valve), stop_summaries(self._valve)
        self.run = str(case.one_variant(None))
        self._notes = notes
        self._transfers = Transfers()
        self._halvings = 0
        if case.motion == "axial":  # in the steps that the stroke of the case requires
            self._halvings = self._stroke(case, check=True)[-1].variant.halvings

    def close(self) -> None:
        """Nothing has to be freed."""

    def _stroke(
        self, case: ValveCase, *, check: bool = False
    ) -> tuple[Valve, ValveRoles, Variant, VariantRun]:
        network = filled_network(case, self._valve.reduced, self._valve.laws)
        valve = replace(self._valve, case=case, network=network)
        roles, variant = find_roles(case, network), case.one_variant(self.run)
        halvings = self._halvings
        run = one_variant(valve, roles, variant, silent, halvings=halvings, check=check)
        return valve, roles, variant, run

    def at(self, case: ValveCase) -> _Computed:
        with collected_warnings() as caught:
            valve, roles, variant, run = self._stroke(case)
            study = study_of_run(valve, roles, variant, run, self._bodies, self._stops)
            source = stroke_sources(study, case=case)[0]
        found = run.variant
        force, lift = stroke_curves(found, study.channels, source.stops)
        bands = tuple(force_bands(stop.force) for stop in source.stops)
        of_run: dict[str, StrokeVariant] = {variant: found}
        warned = tuple(dict.fromkeys((*self._notes, *caught)))
        return _Computed(
            source=source,
            bands=bands,
            pressures=click_sounds(source, self._transfers, bands),
            force=force,
            lift=lift,
            numbers=stroke_numbers(found, study.channels),
            doubts=(
                *missing_notes(of_run, (), run.failure),
                *stroke_notes(case, of_run, roles, warned),
                *study.warnings,  # of the text of the case
                *map(contact_doubt, self._stops),
                *source.notes,
            ),
        )

    def judged(self, case: ValveCase) -> tuple[str, str]:
        """Whether impacts depend on the steps; no other estimate is known for strokes."""
        steps = None
        if case.motion == "axial":
            steps = self._stroke(case, check=True)[-1].steps
        if steps is not None and steps.doubt:
            return "out", f"{steps.doubt[0].upper()}{steps.doubt[1:]}"
        if steps is not None and steps.halvings:
            return "out", (
                "The time steps of the sliders are too long for this valve: klack stroke halves "
                f"them {steps.halvings} more times. Try: save this case, and open its sliders."
            )
        are_short = "The time steps are short enough. " if steps is not None else ""
        return "none", (
            f"{are_short}klack has no other error estimate for strokes; klack advise gives one for "
            "a step and a mesh."
        )


# --------------------------------------------------------------------------- sounds


def _at(pressures: Mapping[str, TimeSeries], ear: str) -> TimeSeries | None:
    """At an ear, or the first one."""
    return pressures.get(ear, next(iter(pressures.values()), None))


def _loudness(pressure: TimeSeries) -> Number:
    value = time_varying_loudness(pressure).maximum
    return Number(key="loudness", name="loudness, maximum", unit="sone", value=value)


def _sounds(now: TimeSeries | None, pinned: TimeSeries | None) -> tuple[bytes, bytes, str]:
    """Both clicks to the full scale of :func:`common_scale`."""
    if now is None or pinned is None:
        return b"", b"", ""
    scale = common_scale(now, pinned)
    return (
        wav_bytes(now, full_scale=scale),
        wav_bytes(pinned, full_scale=scale),
        level_statement(scale),
    )


def _spectrogram(pressure: TimeSeries) -> tuple[Floats, Floats, Floats]:
    """Level over time [ms] and frequency [kHz], Hann windows of 5.3 ms."""
    first = pressure.values[: int(_SHOWN * pressure.rate)]
    f, t, power = scipy.signal.spectrogram(
        first, pressure.rate, window="hann", nperseg=256, noverlap=208, mode="psd"
    )
    level = 10.0 * np.log10(np.maximum(power, 1e-30) / _REFERENCE**2)
    start = pressure.start
    return 1e3 * (t + start), 1e-3 * f, np.asarray(level, dtype=float)
