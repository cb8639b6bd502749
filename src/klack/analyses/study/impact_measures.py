"""Measures of an impact by their names: of its level, and of its noise."""

from collections.abc import Iterable
from dataclasses import dataclass
from operator import attrgetter

from klack.analyses.impact.measures import LEVEL_MEASURES
from klack.analyses.impact.record import LevelResult
from klack.analyses.study.chosen_measures import (
    NOISE_NAMES,
    NOISE_WORDS,
    ChosenMeasure,
    PointNoise,
    choose_measures,
    noise_measure,
)
from klack.case.schema import Case
from klack.errors import InputError
from klack.input.problem import one_of

__all__ = ["ImpactOfPoint", "impact_measures"]

_OF_THE_CLOCK = ("wall_time", "setup_time")
"""Differ from run to run."""
_OF_LEVELS = {item.key: item for item in LEVEL_MEASURES if item.key not in _OF_THE_CLOCK}


@dataclass(frozen=True, slots=True, eq=False)
class ImpactOfPoint:
    """Impact of a point at one level, and its noise.

    Parameters
    ----------
    level : LevelResult
    noise : PointNoise
    """

    level: LevelResult
    noise: PointNoise


def impact_measures(case: Case, names: Iterable[str]) -> tuple[ChosenMeasure, ...]:
    """Find measures of an impact by their names, each once: ``"peak_force"``, ``"restitution"``.

    Raises
    ------
    InputError
        For a name that an impact does not have, with the nearest one; for none at all; for noise
        of bodies without surfaces.
    """
    words = f"one of: {one_of(_OF_LEVELS)}; {NOISE_WORDS}"
    chosen = choose_measures(names, _found, [*_OF_LEVELS, *NOISE_NAMES], words, "peak_force")
    for item in chosen:
        if item.is_noise and not case.has_surfaces:
            raise InputError(
                "measures",
                got=f"'{item.name}', of bodies without surfaces",
                expected=f"one of: {one_of(_OF_LEVELS)}",
                hint="noise needs bodies with meshes.",
            )
    return chosen


def _found(name: str) -> ChosenMeasure | None:
    if name in _OF_LEVELS:
        return ChosenMeasure(name, _OF_LEVELS[name], "level", attrgetter("level"))
    noise = noise_measure(name)
    own = name.rpartition(".")[2]
    if noise is None and own in _OF_LEVELS:
        raise InputError(
            "measures",
            got=f"'{name}', as measures of a stroke are called",
            expected="a measure of an impact, which has one contact",
            hint=f"write {own}.",
        )
    return noise
