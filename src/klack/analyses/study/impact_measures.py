"""Measures of an impact by their names: of its level, of its noise, and of its shots."""

from collections.abc import Iterable
from dataclasses import dataclass
from operator import attrgetter

from klack.analyses.impact.measures import LEVEL_MEASURES
from klack.analyses.impact.record import LevelResult
from klack.analyses.shots.run import DroppedShots
from klack.analyses.study.chosen_measures import (
    NOISE_NAMES,
    NOISE_WORDS,
    ChosenMeasure,
    PointNoise,
    choose_measures,
    noise_measure,
)
from klack.analyses.study.shot_measures import SHOT_NAMES, SHOT_WORDS, SHOTS, shot_measure
from klack.case.schema import Case
from klack.errors import InputError
from klack.input.problem import one_of

__all__ = ["ImpactOfPoint", "impact_measure_names", "impact_measures"]

_OF_THE_CLOCK = ("wall_time", "setup_time")
"""Differ from run to run."""
_OF_LEVELS = {item.key: item for item in LEVEL_MEASURES if item.key not in _OF_THE_CLOCK}


@dataclass(frozen=True, slots=True, eq=False)
class ImpactOfPoint:
    """What the measures of a point are read from, as far as they ask for it.

    Parameters
    ----------
    level : LevelResult, optional
        Of the impact.
    noise : PointNoise, optional
        Of that impact.
    shots : DroppedShots, optional
    """

    level: LevelResult | None = None
    noise: PointNoise | None = None
    shots: DroppedShots | None = None


def impact_measures(case: Case, names: Iterable[str]) -> tuple[ChosenMeasure, ...]:
    """Find measures of an impact by their names, each once.

    ``"peak_force"`` of the level; ``"noise.radiated_energy"``; ``"shots.restitution.mean"``.

    Raises
    ------
    InputError
        For a name that an impact does not have, with the nearest one; for none at all; for noise
        of bodies without surfaces, and shots of a case without them.
    """
    known, words = impact_measure_names(case), f"one of: {one_of(_OF_LEVELS)}; {NOISE_WORDS}"
    if case.shots is not None:
        words = f"{words}; {SHOT_WORDS}"
    chosen = choose_measures(names, lambda name: _found(case, name), known, words, "peak_force")
    for item in chosen:
        if item.is_noise and not case.has_surfaces:
            raise InputError(
                "measures",
                got=f"'{item.name}', of bodies without surfaces",
                expected=f"one of: {one_of(_OF_LEVELS)}",
                hint="noise needs bodies with meshes.",
            )
    return chosen


def impact_measure_names(case: Case) -> tuple[str, ...]:
    """Names of the measures of an impact, of its noise, and of the shots of a case with them."""
    return (*_OF_LEVELS, *NOISE_NAMES, *(SHOT_NAMES if case.shots is not None else ()))


def _found(case: Case, name: str) -> ChosenMeasure | None:
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
