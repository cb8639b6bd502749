"""Measures of a stroke by their names: of all of it, of single impacts, of its noise."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import inf, isnan
from operator import attrgetter

from klack.analyses.stroke.measures import EVENT_MEASURES, VARIANT_MEASURES
from klack.analyses.stroke.record import StrokeVariant
from klack.analyses.stroke.summary import first_impact
from klack.analyses.study.chosen_measures import (
    NOISE_NAMES,
    NOISE_WORDS,
    ChosenMeasure,
    PointNoise,
    choose_measures,
    noise_measure,
)
from klack.analyses.study.shot_measures import SHOTS
from klack.case.valve import ValveCase
from klack.case.valve_roles import END_STOP
from klack.errors import InputError
from klack.input.problem import one_of
from klack.simulation.network_result import ImpactEvent

__all__ = ["TIMES", "StrokeOfPoint", "stroke_measure_names", "stroke_measures", "told_until"]

TIMES = ("opening_time", "closing_time")
"""Measures of a stroke, beside those of its impacts, that end with a touch."""

_OF_VARIANTS = {measure.key: measure for measure in VARIANT_MEASURES}
_OF_IMPACTS = {measure.key: measure for measure in EVENT_MEASURES}


@dataclass(frozen=True, slots=True, eq=False)
class StrokeOfPoint:
    """Stroke of a point, and its noise.

    Parameters
    ----------
    variant : StrokeVariant
    noise : PointNoise
    """

    variant: StrokeVariant
    noise: PointNoise


def stroke_measures(case: ValveCase, names: Iterable[str]) -> tuple[ChosenMeasure, ...]:
    """Find measures of a stroke by their names, each once.

    ``"opening_time"``; ``"seat.peak_force"`` of the first impact on the stop ``seat`` that is no
    mere tremble, see :func:`~klack.analyses.stroke.summary.first_impact`; ``"seat.2.peak_force"``
    of the second one in the list of all impacts; ``"noise.sound_exposure_level_weighted"``.

    Raises
    ------
    InputError
        For a name that a stroke of this case does not have, with the nearest one; for none at all.
    """
    stops, known = _stops(case), stroke_measure_names(case)
    return choose_measures(
        names, lambda name: _found(name, stops), known, _known_words(stops), "opening_time"
    )


def stroke_measure_names(case: ValveCase) -> tuple[str, ...]:
    """Names of the measures of a stroke, of the first impact on each stop, and of the noise."""
    of_impacts = (f"{stop}.{key}" for stop in _stops(case) for key in _OF_IMPACTS)
    return (*_OF_VARIANTS, *of_impacts, *NOISE_NAMES)


def _stops(case: ValveCase) -> list[str]:
    return [name for name, part in case.network.components.items() if part.type == END_STOP]


def _found(name: str, stops: list[str]) -> ChosenMeasure | None:
    if name in _OF_VARIANTS:
        return ChosenMeasure(name, _OF_VARIANTS[name], "variant", attrgetter("variant"))
    stop, _, rest = name.partition(".")
    *number, key = rest.split(".")
    if stop in stops and key in _OF_IMPACTS and len(number) < 2:
        if not number:
            return ChosenMeasure(name, _OF_IMPACTS[key], "impact", _impact_on(stop, 0))
        if number[0].isascii() and number[0].isdecimal() and int(number[0]) > 0:
            return ChosenMeasure(name, _OF_IMPACTS[key], "impact", _impact_on(stop, int(number[0])))
    if stop == SHOTS and stop not in stops:
        raise InputError(
            "measures",
            got=f"'{name}' in the study of a whole valve",
            expected=_known_words(stops),
            hint="shots are drops of two bodies: study a case of an impact with a section 'shots'.",
        )
    return noise_measure(name)


def _impact_on(stop: str, number: int) -> Callable[[StrokeOfPoint], ImpactEvent | None]:
    """Impact on a stop of this number from 1; for 0 the first one that is no mere tremble."""

    def impact(run: StrokeOfPoint) -> ImpactEvent | None:
        if number:
            return next(iter(run.variant.impacts(stop)[number - 1 :]), None)
        return first_impact(run.variant, stop)

    return impact


def _known_words(stops: list[str]) -> str:
    words = f"one of: {one_of(_OF_VARIANTS)}; {NOISE_WORDS}"
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
