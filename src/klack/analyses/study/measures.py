"""Measures of a point by their names: of strokes, impacts and shots, and of the noise of each.

A statistic of shots holds for all shots of a point.  Where one of them ended too early to have the
number, there is none: shots without a rebound are mostly those that rebound highest, and a mean
over the others would be too low.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, isnan
from operator import attrgetter
from typing import Any, Literal, TypeVar

import numpy as np

from klack.acoustics.signal_statistics import SoundStatistics, sound_statistics
from klack.analyses.impact.measures import BACKING_MEASURES, LEVEL_MEASURES, OBLIQUE_MEASURES
from klack.analyses.impact.record import LevelResult
from klack.analyses.measures import Measure
from klack.analyses.noise.body import Transfers
from klack.analyses.noise.measures import AT_MOUNTS, CLICK_MEASURES, DESIGN_MEASURES
from klack.analyses.noise.record import NoiseDesign
from klack.analyses.noise.run import click_sound, noise_design
from klack.analyses.noise.source import NoiseSource
from klack.analyses.sample import STATISTICS
from klack.analyses.shots.record import RESULTS, RULE_MEASURES, RuleVerdict
from klack.analyses.shots.run import DroppedShots, highest_of, judge_rule
from klack.analyses.stroke.analysis import first_impact
from klack.analyses.stroke.delivery import Delivery, restriction_names
from klack.analyses.stroke.measures import DELIVERY_MEASURES, EVENT_MEASURES, VARIANT_MEASURES
from klack.analyses.stroke.record import StrokeVariant
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.case.valve_roles import END_STOP
from klack.errors import InputError, KlackError, refuse_if
from klack.input.problem import nearest, one_of
from klack.signals.sampled import TimeSeries
from klack.simulation.network_result import ImpactEvent

__all__ = [
    "SHOTS",
    "SHOT_NAMES",
    "TIMES",
    "ChosenMeasure",
    "ImpactOfPoint",
    "PointNoise",
    "StrokeOfPoint",
    "impact_measure_names",
    "impact_measures",
    "shot_measure",
    "shot_notes",
    "stroke_measure_names",
    "stroke_measures",
    "told_until",
]


Found = TypeVar("Found")

_NOISE = "noise"
"""Before the names of measures of noise."""

_OF_DESIGNS = [measure.key for measure in DESIGN_MEASURES]
_OF_FORCE = ("peak_force", "force_level", "valid_from", "balanced_below")
_OF_MOUNTS = tuple(measure.key for measure in AT_MOUNTS)
NOISE_WORDS = f"of the noise {_NOISE}.KEY with a key of: {one_of(_OF_DESIGNS)}"


class PointNoise:
    """Noise of a point, computed once a measure asks for it.

    ``source`` makes what the noise comes from; ``transfers`` are those of the bodies, where known.
    """

    def __init__(self, source: Callable[[], NoiseSource], transfers: Transfers) -> None:
        self._make, self._transfers = source, transfers
        self.notes: list[str] = []

    @cached_property
    def _source(self) -> NoiseSource:
        return self._make()

    @cached_property
    def pressure(self) -> TimeSeries | None:
        """Sound of a click, or None with a note."""
        return self._noted(lambda: click_sound(self._source, self._transfers))

    @cached_property
    def click(self) -> SoundStatistics | None:
        """Levels of a click, if it has a sound."""
        return None if self.pressure is None else sound_statistics(self.pressure)

    @cached_property
    def design(self) -> NoiseDesign | None:
        """Noise as a whole, or None with a note."""
        return self._noted(lambda: noise_design(self._source))

    def _noted(self, make: Callable[[], Found]) -> Found | None:
        try:
            return make()
        except KlackError as error:  # the other measures stand
            self.notes.append(f"noise: {error}")
            return None


@dataclass(frozen=True, slots=True)
class ChosenMeasure:
    """A measure of the run of a point, by its name in the study.

    Parameters
    ----------
    of
        The ``"variant"`` of a stroke, one ``"impact"`` in it or the ``"delivery"`` of a
        restriction, the ``"level"`` of an impact, all
        of its ``"shots"``, a ``"click"`` or the noise ``"design"``.
    part
        Of a run, what the measure is read from.
    """

    name: str
    measure: Measure[Any]
    of: Literal["variant", "impact", "delivery", "level", "shots", "click", "design"]
    part: Callable[[Any], Any]

    @property
    def is_noise(self) -> bool:
        """Whether it takes the noise."""
        return self.of in ("click", "design")

    def value(self, run: object) -> float | None:
        """Value in the unit of the measure, if the run has it."""
        part = self.part(run)
        if part is None or not self.measure.given(part):
            return None
        value = self.measure.read(part)
        return None if value is None else float(value)


_NOISES: tuple[tuple[Literal["design", "click"], Sequence[Measure[Any]]], ...] = (
    ("design", DESIGN_MEASURES),
    ("click", CLICK_MEASURES),
)
_OF_NOISE = {
    name: ChosenMeasure(name, measure, of, attrgetter(f"noise.{of}"))
    for of, measures in _NOISES
    for measure in measures
    for name in [f"{_NOISE}.{measure.key}"]
}
"""Measures of the noise of a run with :class:`PointNoise`."""
for _former, _present in {"radiated_energy_upper_bound": "equivalent_radiated_energy"}.items():
    # studies of former versions: the same number by another name
    _OF_NOISE[f"{_NOISE}.{_former}"] = replace(
        _OF_NOISE[f"{_NOISE}.{_present}"], name=f"{_NOISE}.{_former}"
    )


def choose_measures(
    names: Iterable[str],
    find: Callable[[str], ChosenMeasure | None],
    known: Sequence[str],
    words: str,
    example: str,
) -> tuple[ChosenMeasure, ...]:
    """Find measures by their names, each once; an error names the nearest of all ``known``.

    ``words`` say what names are known, ``example`` is one of them.
    """
    wanted = list(dict.fromkeys([names] if isinstance(names, str) else names))
    refuse_if(
        not wanted,
        "measures",
        got="no measure",
        expected=words,
        hint=f'write e.g. measures=["{example}"].',
    )
    chosen = []
    for name in wanted:
        found = find(name) if isinstance(name, str) else None
        if found is None:
            raise InputError(
                "measures",
                got=f"'{name}'",
                expected=words,
                hint=nearest(str(name), known, "the reference of the measures describes each."),
            )
        chosen.append(found)
    return tuple(chosen)


SHOTS = "shots"
"""Before the names of measures of shots."""
_CENTRIC, _RULE = "centric", "rule"
_JUDGED = ("restitution", "rebound_height")
"""What the rule compares."""

_RESULTS = {item.key: item for item in RESULTS}
_RULES = {item.key: item for item in RULE_MEASURES}
_STATISTICS = {item.key: item for item in STATISTICS}

SHOT_NAMES = (
    *(f"{SHOTS}.{key}.{statistic}" for key in _RESULTS for statistic in _STATISTICS),
    *(f"{SHOTS}.{_CENTRIC}.{key}" for key in _RESULTS),
    *(f"{SHOTS}.{_RULE}.{key}" for key in _RULES),
)
SHOT_WORDS = (
    f"of the shots {SHOTS}.KEY.STATISTIC with a key of: {one_of(_RESULTS)}, and a statistic of: "
    f"{one_of(_STATISTICS)}; of the centred shot {SHOTS}.{_CENTRIC}.KEY; of the highest rebound "
    f"{SHOTS}.{_RULE}.KEY with a key of: {one_of(_RULES)}"
)


def shot_measure(name: str) -> ChosenMeasure | None:
    """Measure of the shots of a point; None for another name.

    ``"shots.restitution.mean"``, ``"shots.centric.restitution"``,
    ``"shots.rule.relative_restitution_bias"``.  InputError for a result without a statistic.
    """
    stem, _, rest = name.partition(".")
    of, _, key = rest.partition(".")
    if stem != SHOTS:
        return None
    if of == _CENTRIC and key in _RESULTS:
        return _chosen(name, _RESULTS[key], "centred shot", lambda found: found.centric.row(0)[key])
    if of == _RULE and key in _RULES:
        rule = _RULES[key]
        return _chosen(name, rule, "highest of the shots", lambda found: _judged(found, rule))
    if of in _RESULTS and key in _STATISTICS:
        statistic = _STATISTICS[key]
        return _chosen(
            name,
            _RESULTS[of],
            f"{statistic.name} of the shots",
            lambda found: statistic.of(getattr(found.shots, of)),
        )
    refuse_if(
        of in _RESULTS and not key,
        "measures",
        got=f"'{name}', which has a value for every shot",
        expected=f"a statistic after it: {one_of(_STATISTICS)}",
        hint=f"write {name}.mean, or {SHOTS}.{_CENTRIC}.{of} of the centred shot.",
    )
    return None


def shot_notes(names: Iterable[str], found: DroppedShots) -> tuple[str, ...]:
    """Why measures of shots have no value, or say less than their name."""
    parts = [name.split(".")[1:] for name in names]
    columns = dict.fromkeys(of for of, _ in parts if of in _RESULTS)
    single = dict.fromkeys(key for of, key in parts if of == _CENTRIC)
    if any(of == _RULE for of, _ in parts):
        columns, single = columns | dict.fromkeys(_JUDGED), single | dict.fromkeys(_JUDGED)
    statistics = dict.fromkeys(_STATISTICS[key] for of, key in parts if of in _RESULTS)
    count = found.shots.count
    return (
        *(
            f"{missing} of {count} shots ended before their {_RESULTS[key].name} was known, and "
            "statistics of only the others would be biased. Try: a longer shots.duration."
            for key in columns
            if (missing := int(np.sum(~np.isfinite(getattr(found.shots, key)))))
        ),
        *(
            f"The centred shot ended before its {_RESULTS[key].name} was known. "
            "Try: a longer shots.duration."
            for key in single
            if not np.isfinite(found.centric.row(0)[key])
        ),
        *(
            f"{count} shots are too few for their {item.name}, which needs {item.fewest}. Try: a "
            "larger shots.count."
            for item in statistics
            if count < item.fewest
        ),
    )


def _chosen(
    name: str, measure: Measure[Any], words: str, read: Callable[[DroppedShots], float | None]
) -> ChosenMeasure:
    titled = replace(measure, name=f"{measure.name}, {words}", read=read)
    return ChosenMeasure(name, titled, "shots", lambda run: run.shots)


def _judged(found: DroppedShots, measure: Measure[RuleVerdict]) -> float | None:
    """Number of the rule, if all shots and the centred one rebound."""
    every = (getattr(columns, key) for columns in (found.shots, found.centric) for key in _JUDGED)
    highest = highest_of(found.shots)
    if highest is None or not all(np.isfinite(values).all() for values in every):
        return None
    value = measure.read(judge_rule(found.shots, found.centric, highest))
    return None if value is None else float(value)


_OF_THE_CLOCK = ("wall_time", "setup_time")
"""Differ from run to run."""
_OF_LEVELS = {
    item.key: item
    for item in (*LEVEL_MEASURES, *OBLIQUE_MEASURES, *BACKING_MEASURES)
    if item.key not in _OF_THE_CLOCK
}


@dataclass(frozen=True, slots=True, eq=False)
class ImpactOfPoint:
    """Source of the measures of a point, as far as they need it."""

    level: LevelResult | None = None
    noise: PointNoise | None = None
    shots: DroppedShots | None = None


def impact_measures(case: Case, names: Iterable[str]) -> tuple[ChosenMeasure, ...]:
    """Find measures of an impact by their names, each once.

    ``"peak_force"`` of the level; ``"noise.radiated_energy"``; ``"shots.restitution.mean"``.
    InputError also for noise of bodies without surfaces.
    """
    known, words = impact_measure_names(case), f"one of: {one_of(_OF_LEVELS)}; "
    if case.shots is not None:
        words += f"{SHOT_WORDS}; "
    words += NOISE_WORDS
    chosen = choose_measures(
        names, lambda name: _impact_measure(case, name), known, words, "peak_force"
    )
    for item in chosen:
        refuse_if(
            item.is_noise and not case.has_surfaces,
            "measures",
            got=f"'{item.name}', of bodies without surfaces",
            expected=f"one of: {one_of(_OF_LEVELS)}",
            hint="noise needs bodies with meshes.",
        )
        refuse_if(
            item.is_noise and case.backing is not None,
            "measures",
            got=f"'{item.name}', of three bodies in a row",
            expected=f"one of: {one_of(_OF_LEVELS)}",
            hint="klack noise accepts three bodies only in a stroke (klack stroke).",
        )
    return chosen


def impact_measure_names(case: Case) -> tuple[str, ...]:
    """Measures of an impact, its noise, and its shots if there are any."""
    shots = SHOT_NAMES if case.shots is not None else ()
    return (*_OF_LEVELS, *_noise_names(case, has_surfaces=case.has_surfaces), *shots)


def _noise_names(case: Case | ValveCase, *, has_surfaces: bool) -> Iterator[str]:
    """Measures of noise that a case can have: without surfaces to radiate those of the force."""
    has_mounts = case.noise is not None and case.noise.mounts is not None
    for key in _OF_DESIGNS if has_surfaces else _OF_FORCE:
        if has_mounts or key not in _OF_MOUNTS:
            yield f"{_NOISE}.{key}"


def _impact_measure(case: Case, name: str) -> ChosenMeasure | None:
    if name in _OF_LEVELS:
        return ChosenMeasure(name, _OF_LEVELS[name], "level", attrgetter("level"))
    if name.partition(".")[0] == SHOTS:
        if case.shots is None:
            raise InputError(
                "measures",
                got=f"'{name}', of a case without the section 'shots'",
                expected=f"one of: {one_of(_OF_LEVELS)}; {NOISE_WORDS}",
                hint="add 'shots: {count: 50}' to the case, and a 'guide', or 'eccentricity' and "
                "'tilt'.",
            )
        return shot_measure(name)
    noise = _OF_NOISE.get(name)
    own = name.rpartition(".")[2]
    refuse_if(
        noise is None and own in _OF_LEVELS,
        "measures",
        got=f"'{name}', the name of a measure of a stroke",
        expected="a measure of an impact, which has one contact",
        hint=f"write {own}.",
    )
    return noise


TIMES = ("opening_time", "closing_time")
"""Stroke measures, beside those of impacts, that end with a touch."""

_OF_VARIANTS = {measure.key: measure for measure in VARIANT_MEASURES}
_OF_IMPACTS = {measure.key: measure for measure in EVENT_MEASURES}
_OF_DELIVERIES = {measure.key: measure for measure in DELIVERY_MEASURES}


@dataclass(frozen=True, slots=True, eq=False)
class StrokeOfPoint:
    """Stroke of a point, and its noise."""

    variant: StrokeVariant
    noise: PointNoise


def stroke_measures(case: ValveCase, names: Iterable[str]) -> tuple[ChosenMeasure, ...]:
    """Find measures of a stroke by their names, each once.

    ``"opening_time"``; ``"seat.peak_force"`` of the first impact on the stop ``seat`` that is no
    mere tremble, see :func:`~klack.analyses.stroke.analysis.first_impact`; ``"seat.2.peak_force"``
    of the second one in the list of all impacts; ``"nozzle.mass"`` of a restriction in the whole
    run, ``"nozzle.2.mass"`` of the second command; ``"noise.sound_exposure_level_weighted"``.
    """
    stops, ways, known = _stops(case), _restrictions(case), stroke_measure_names(case)
    return choose_measures(
        names,
        lambda name: _stroke_measure(name, stops, ways),
        known,
        _known_words(stops, ways),
        "opening_time",
    )


def stroke_measure_names(case: ValveCase) -> tuple[str, ...]:
    """Measures of a stroke, first impacts on each stop, restrictions, and noise."""
    stops = _stops(case)
    of_impacts = (f"{stop}.{key}" for stop in stops for key in _OF_IMPACTS)
    of_ways = (f"{name}.{key}" for name in _restrictions(case) for key in _OF_DELIVERIES)
    has_surfaces = any(body.has_surfaces for body in case.bodies.values())
    noise = _noise_names(case, has_surfaces=has_surfaces) if stops else ()
    return (*_OF_VARIANTS, *of_impacts, *of_ways, *noise)


def _stops(case: ValveCase) -> list[str]:
    return [name for name, part in case.network.components.items() if part.type == END_STOP]


def _restrictions(case: ValveCase) -> tuple[str, ...]:
    return restriction_names(case.network.components)


def _stroke_measure(name: str, stops: list[str], ways: Sequence[str]) -> ChosenMeasure | None:
    if name in _OF_VARIANTS:
        return ChosenMeasure(name, _OF_VARIANTS[name], "variant", attrgetter("variant"))
    stop, _, rest = name.partition(".")
    *numbers, key = rest.split(".")
    is_number = len(numbers) == 1 and numbers[0].isascii() and numbers[0].isdecimal()
    number = int(numbers[0]) if is_number else 0
    if bool(numbers) == (number > 0):
        if stop in stops and key in _OF_IMPACTS:
            return ChosenMeasure(name, _OF_IMPACTS[key], "impact", _impact_on(stop, number))
        if stop in ways and key in _OF_DELIVERIES:
            return ChosenMeasure(name, _OF_DELIVERIES[key], "delivery", _by(stop, number))
    if stop == SHOTS and stop not in stops:
        raise InputError(
            "measures",
            got=f"'{name}' in the study of a whole valve",
            expected=_known_words(stops, ways),
            hint="shots are drops of two bodies: study a case of an impact with a section 'shots'.",
        )
    return _OF_NOISE.get(name)


def _impact_on(stop: str, number: int) -> Callable[[StrokeOfPoint], ImpactEvent | None]:
    """Impact of this number from 1; 0: the first that is no mere tremble."""

    def impact(run: StrokeOfPoint) -> ImpactEvent | None:
        if number:
            return next(iter(run.variant.impacts(stop)[number - 1 :]), None)
        return first_impact(run.variant, stop)

    return impact


def _by(restriction: str, command: int) -> Callable[[StrokeOfPoint], Delivery | None]:
    """What a restriction passes after the command of this number; 0: in the whole run."""
    name = f"{restriction}.{command}" if command else restriction
    return lambda run: run.variant.deliveries.get(name)


def _known_words(stops: list[str], ways: Sequence[str]) -> str:
    words = f"one of: {one_of(_OF_VARIANTS)}; {NOISE_WORDS}"
    if ways:
        words += (
            f"; of a restriction, {ways[0]}.KEY (from its second command on {ways[0]}.2.KEY), with "
            f"a restriction of: {one_of(ways)}, and a key of: {one_of(_OF_DELIVERIES)}"
        )
    if not stops:
        return words
    return (
        f"{words}; or of the first impact on a stop, {stops[0]}.KEY (of the second one "
        f"{stops[0]}.2.KEY), with a stop of: {one_of(stops)}, and a key of: {one_of(_OF_IMPACTS)}"
    )


def told_until(chosen: Iterable[ChosenMeasure], run: StrokeOfPoint) -> float:
    """Time [s] of a stroke until which its measures depend on impacts: later ones do not matter.

    The end of the last impact that one is of, or a time of opening or closing between stops; inf
    for all others, and for a measure without a value.
    """
    ends = [0.0]
    for item in chosen:
        end = None
        if item.of == "impact":
            event: ImpactEvent | None = item.part(run)
            end = None if event is None else event.separation_time
        elif item.name.partition("_at_")[0] in TIMES and run.variant.needle_times.between_stops:
            end = item.measure.read(run.variant)
        ends.append(inf if end is None or isnan(end) else end)
    return max(ends)
