"""Measures of a point by their names: of its stroke, of single impacts, of its noise."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, TypeVar

from klack.acoustics.signal_statistics import SoundStatistics, sound_statistics
from klack.analyses.measures import Measure
from klack.analyses.noise.body import Transfers
from klack.analyses.noise.measures import CLICK_MEASURES, DESIGN_MEASURES
from klack.analyses.noise.record import NoiseDesign
from klack.analyses.noise.run import click_sound, noise_design
from klack.analyses.noise.source import NoiseSource
from klack.analyses.stroke.measures import EVENT_MEASURES, VARIANT_MEASURES
from klack.analyses.stroke.record import StrokeVariant
from klack.analyses.stroke.summary import first_impact
from klack.case.valve import ValveCase
from klack.case.valve_roles import END_STOP
from klack.errors import InputError, KlackError
from klack.input.problem import nearest, one_of
from klack.signals import TimeSeries

__all__ = ["ChosenMeasure", "PointRun", "chosen_measures"]

Found = TypeVar("Found")

NOISE = "noise"
"""Before the names of measures of noise."""

_OF_VARIANTS = {measure.key: measure for measure in VARIANT_MEASURES}
_OF_IMPACTS = {measure.key: measure for measure in EVENT_MEASURES}
_OF_CLICKS = {measure.key: measure for measure in CLICK_MEASURES}
_OF_DESIGNS = {measure.key: measure for measure in DESIGN_MEASURES}


class PointRun:
    """Stroke of a point, and its noise once a measure asks for it.

    Parameters
    ----------
    variant : StrokeVariant
    source : callable
        Makes what the noise comes from.
    transfers : Transfers
        Of the bodies, as far as they are known.
    """

    def __init__(
        self, variant: StrokeVariant, source: Callable[[], NoiseSource], transfers: Transfers
    ) -> None:
        self.variant, self._make, self._transfers = variant, source, transfers
        self.notes: list[str] = []

    @cached_property
    def _source(self) -> NoiseSource:
        return self._make()

    @cached_property
    def pressure(self) -> TimeSeries | None:
        """Sound of a click; None, with a note, where it cannot be had."""
        return self._noted(lambda: click_sound(self._source, self._transfers))

    @cached_property
    def click(self) -> SoundStatistics | None:
        """Levels of a click; None where there is no sound."""
        return None if self.pressure is None else sound_statistics(self.pressure)

    @cached_property
    def design(self) -> NoiseDesign | None:
        """Noise as a whole; None, with a note, where it cannot be had."""
        return self._noted(lambda: noise_design(self._source))

    def _noted(self, make: Callable[[], Found]) -> Found | None:
        try:
            return make()
        except KlackError as error:  # the measures of the stroke stand
            self.notes.append(f"noise: {error}")
            return None


@dataclass(frozen=True, slots=True)
class ChosenMeasure:
    """A measure of a variant, of one impact on a stop, or of the noise.

    Parameters
    ----------
    name : str
        ``"opening_time"``; ``"seat.peak_force"`` of the first impact on the stop ``seat``;
        ``"seat.2.peak_force"`` of the second one in the list of all impacts;
        ``"noise.sound_exposure_level_weighted"``.
    measure : Measure
    of : str
        What it is of: the ``"variant"``, an ``"impact"``, a ``"click"`` or the noise ``"design"``.
    stop : str
        Of an impact.
    number : int
        Of the impact on that stop, from 1; 0 for the first one that is no mere tremble, see
        :func:`~klack.analyses.stroke.summary.first_impact`.
    """

    name: str
    measure: Measure[Any]
    of: Literal["variant", "impact", "click", "design"] = "variant"
    stop: str = ""
    number: int = 0

    def value(self, run: PointRun) -> float | None:
        """Value in the unit of the measure; None where the run does not have it."""
        of = self._part(run)
        value = None if of is None else self.measure.read(of)
        return None if value is None else float(value)

    def _part(self, run: PointRun) -> Any:
        if self.of == "variant":
            return run.variant
        if self.of == "click":
            return run.click
        if self.of == "design":
            return run.design
        if self.number:
            return next(iter(run.variant.impacts(self.stop)[self.number - 1 :]), None)
        return first_impact(run.variant, self.stop)


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
                return ChosenMeasure(name, _OF_IMPACTS[key], "impact", stop)
            if number[0].isascii() and number[0].isdecimal() and int(number[0]) > 0:
                return ChosenMeasure(name, _OF_IMPACTS[key], "impact", stop, int(number[0]))
        if stop == NOISE and not number:
            if key in _OF_CLICKS:
                return ChosenMeasure(name, _OF_CLICKS[key], "click")
            if key in _OF_DESIGNS:
                return ChosenMeasure(name, _OF_DESIGNS[key], "design")
    names = [
        *_OF_VARIANTS,
        *(f"{stop}.{key}" for stop in stops for key in _OF_IMPACTS),
        *(f"{NOISE}.{key}" for key in _OF_DESIGNS),
    ]
    raise InputError(
        "measures",
        got=f"'{name}'",
        expected=_known_words(stops),
        hint=nearest(str(name), names, "the reference of the measures describes each."),
    )


def _known_words(stops: list[str]) -> str:
    words = f"one of: {one_of(_OF_VARIANTS)}; of the noise {NOISE}.KEY with a key of: "
    words += one_of(_OF_DESIGNS)
    if not stops:
        return words
    return (
        f"{words}; or of the first impact on a stop, {stops[0]}.KEY (of the second one "
        f"{stops[0]}.2.KEY), with a stop of: {one_of(stops)}, and a key of: {one_of(_OF_IMPACTS)}"
    )
