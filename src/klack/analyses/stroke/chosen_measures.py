"""Measures of a stroke by their names, those of a variant and those of its impacts."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from klack.analyses.measures import Measure
from klack.analyses.stroke.measures import EVENT_MEASURES, VARIANT_MEASURES
from klack.analyses.stroke.record import StrokeVariant
from klack.analyses.stroke.summary import first_impact
from klack.case.valve import ValveCase
from klack.case.valve_roles import END_STOP
from klack.errors import InputError
from klack.input.problem import nearest, one_of

__all__ = ["ChosenMeasure", "chosen_measures"]

_OF_VARIANTS = {measure.key: measure for measure in VARIANT_MEASURES}
_OF_IMPACTS = {measure.key: measure for measure in EVENT_MEASURES}


@dataclass(frozen=True, slots=True)
class ChosenMeasure:
    """A measure of a variant, or of one impact on a stop.

    Parameters
    ----------
    name : str
        ``"opening_time"``; ``"seat.peak_force"`` of the first impact on the stop ``seat``;
        ``"seat.2.peak_force"`` of the second one in the list of all impacts.
    measure : Measure
    stop : str
        Empty for a measure of the variant.
    number : int
        Of the impact on that stop, from 1; 0 for the first one that is no mere tremble, see
        :func:`~klack.analyses.stroke.summary.first_impact`.
    """

    name: str
    measure: Measure[Any]
    stop: str = ""
    number: int = 0

    def of(self, variant: StrokeVariant) -> float | None:
        """Value in the unit of the measure; None where the run does not have it."""
        of: Any = variant
        if self.number:
            of = next(iter(variant.impacts(self.stop)[self.number - 1 :]), None)
        elif self.stop:
            of = first_impact(variant, self.stop)
        value = None if of is None else self.measure.read(of)
        return None if value is None else float(value)


def chosen_measures(case: ValveCase, names: Iterable[str]) -> tuple[ChosenMeasure, ...]:
    """Find measures by their names, each once.

    Raises
    ------
    InputError
        For a name that a stroke of this case does not have, with the nearest one; for none at all.
    """
    wanted = list(dict.fromkeys([names] if isinstance(names, str) else names))
    stops = [name for name, part in case.network.components.items() if part.type == END_STOP]
    if not wanted:
        raise InputError(
            "measures",
            got="no measure",
            expected=_known_words(stops),
            hint='write e.g. measures=["opening_time"].',
        )
    return tuple(_chosen(name, stops) for name in wanted)


def _chosen(name: object, stops: list[str]) -> ChosenMeasure:
    if isinstance(name, str) and name in _OF_VARIANTS:
        return ChosenMeasure(name, _OF_VARIANTS[name])
    if isinstance(name, str) and "." in name:
        stop, *number, key = name.split(".")
        if stop in stops and key in _OF_IMPACTS and len(number) < 2:
            if not number:
                return ChosenMeasure(name, _OF_IMPACTS[key], stop)
            if number[0].isascii() and number[0].isdecimal() and int(number[0]) > 0:
                return ChosenMeasure(name, _OF_IMPACTS[key], stop, int(number[0]))
    names = [*_OF_VARIANTS, *(f"{stop}.{key}" for stop in stops for key in _OF_IMPACTS)]
    raise InputError(
        "measures",
        got=f"'{name}'",
        expected=_known_words(stops),
        hint=nearest(str(name), names, "the reference of the measures describes each."),
    )


def _known_words(stops: list[str]) -> str:
    words = f"one of: {one_of(_OF_VARIANTS)}"
    if not stops:
        return words
    return (
        f"{words}; or of the first impact on a stop, {stops[0]}.KEY (of the second one "
        f"{stops[0]}.2.KEY), with a stop of: {one_of(stops)}, and a key of: {one_of(_OF_IMPACTS)}"
    )
