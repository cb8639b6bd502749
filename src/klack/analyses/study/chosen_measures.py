"""Measures of a point by their names, and its noise, whatever is computed there."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import attrgetter
from typing import Any, Literal, TypeVar

from klack.acoustics.signal_statistics import SoundStatistics, sound_statistics
from klack.analyses.measures import Measure
from klack.analyses.noise.body import Transfers
from klack.analyses.noise.measures import CLICK_MEASURES, DESIGN_MEASURES
from klack.analyses.noise.record import NoiseDesign
from klack.analyses.noise.run import click_sound, noise_design
from klack.analyses.noise.source import NoiseSource
from klack.errors import InputError, KlackError
from klack.input.problem import nearest, one_of
from klack.signals import TimeSeries

__all__ = [
    "NOISE_NAMES",
    "NOISE_WORDS",
    "ChosenMeasure",
    "PointNoise",
    "choose_measures",
    "noise_measure",
]

Found = TypeVar("Found")

_NOISE = "noise"
"""Before the names of measures of noise."""

_OF_CLICKS = {measure.key: measure for measure in CLICK_MEASURES}
_OF_DESIGNS = {measure.key: measure for measure in DESIGN_MEASURES}
NOISE_NAMES = tuple(f"{_NOISE}.{key}" for key in _OF_DESIGNS)
NOISE_WORDS = f"of the noise {_NOISE}.KEY with a key of: {one_of(_OF_DESIGNS)}"


class PointNoise:
    """Noise of a point, computed once a measure asks for it.

    Parameters
    ----------
    source : callable
        Makes what the noise comes from.
    transfers : Transfers
        Of the bodies, as far as they are known.
    """

    def __init__(self, source: Callable[[], NoiseSource], transfers: Transfers) -> None:
        self._make, self._transfers = source, transfers
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
        except KlackError as error:  # the other measures stand
            self.notes.append(f"noise: {error}")
            return None


@dataclass(frozen=True, slots=True)
class ChosenMeasure:
    """A measure of the run of a point.

    Parameters
    ----------
    name : str
        In the study.
    measure : Measure
    of : str
        What it is of: the ``"variant"`` of a stroke or one ``"impact"`` in it, the ``"level"`` of
        an impact, all of its ``"shots"``, a ``"click"`` or the noise ``"design"``.
    part : callable
        Of a run, what the measure is read from; None where the run does not have it.
    """

    name: str
    measure: Measure[Any]
    of: Literal["variant", "impact", "level", "shots", "click", "design"]
    part: Callable[[Any], Any]

    @property
    def is_noise(self) -> bool:
        """Whether it takes the noise."""
        return self.of in ("click", "design")

    def value(self, run: object) -> float | None:
        """Value in the unit of the measure; None where the run does not have it."""
        part = self.part(run)
        if part is None or not self.measure.given(part):
            return None
        value = self.measure.read(part)
        return None if value is None else float(value)


def noise_measure(name: str) -> ChosenMeasure | None:
    """Measure of the noise of a run, which has a :class:`PointNoise`; None for another name."""
    stem, _, key = name.partition(".")
    if stem == _NOISE and key in _OF_CLICKS:
        return ChosenMeasure(name, _OF_CLICKS[key], "click", attrgetter("noise.click"))
    if stem == _NOISE and key in _OF_DESIGNS:
        return ChosenMeasure(name, _OF_DESIGNS[key], "design", attrgetter("noise.design"))
    return None


def choose_measures(
    names: Iterable[str],
    find: Callable[[str], ChosenMeasure | None],
    known: Sequence[str],
    words: str,
    example: str,
) -> tuple[ChosenMeasure, ...]:
    """Find measures by their names, each once.

    Parameters
    ----------
    names : iterable of str
    find : callable
        Of a name; None where there is no such measure.
    known : sequence of str
        All names, for the nearest one.
    words : str
        What names are known.
    example : str
        One of them.

    Raises
    ------
    InputError
        For a name that does not exist, with the nearest one; for none at all.
    """
    wanted = list(dict.fromkeys([names] if isinstance(names, str) else names))
    if not wanted:
        raise InputError(
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
