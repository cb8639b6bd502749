"""Measures of many shots by their names: statistics, the centred shot, the rule of the highest.

A statistic holds for all shots of a point.  Where one of them ended too early to have the number,
there is none: shots without a rebound are mostly those that rebound highest, and a mean over the
others would be too low.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np

from klack.analyses.measures import Measure
from klack.analyses.sample import STATISTICS, Statistic
from klack.analyses.shots.measures import RESULTS, RULE_MEASURES
from klack.analyses.shots.record import RuleVerdict
from klack.analyses.shots.run import DroppedShots, highest_of, judge_rule
from klack.analyses.study.chosen_measures import ChosenMeasure
from klack.errors import InputError
from klack.input.problem import one_of

__all__ = ["SHOTS", "SHOT_NAMES", "SHOT_WORDS", "shot_measure", "shot_notes"]

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
    ``"shots.rule.relative_restitution_bias"``.

    Raises
    ------
    InputError
        For a result of the shots without a statistic.
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
    if of in _RESULTS and not key:
        raise InputError(
            "measures",
            got=f"'{name}', which every shot has",
            expected=f"a statistic behind it: {one_of(_STATISTICS)}",
            hint=f"write {name}.mean, or {SHOTS}.{_CENTRIC}.{of} of the centred shot.",
        )
    return None


def shot_notes(names: Iterable[str], found: DroppedShots) -> tuple[str, ...]:
    """Why measures of these names have no value, or tell less than they are called.

    Parameters
    ----------
    names : iterable of str
        Of measures of the shots.
    found : DroppedShots
    """
    parts = [name.split(".")[1:] for name in names]
    columns = dict.fromkeys(of for of, _ in parts if of in _RESULTS)
    single = dict.fromkeys(key for of, key in parts if of == _CENTRIC)
    if any(of == _RULE for of, _ in parts):
        columns, single = columns | dict.fromkeys(_JUDGED), single | dict.fromkeys(_JUDGED)
    statistics = dict.fromkeys(_STATISTICS[key] for of, key in parts if of in _RESULTS)
    return (
        *_missing(columns, found),
        *(
            f"The centred shot ended before its {_RESULTS[key].name} was known. "
            "Try: a longer shots.duration."
            for key in single
            if not np.isfinite(found.centric.row(0)[key])
        ),
        *_too_few(statistics, found.shots.count),
    )


def _chosen(
    name: str, measure: Measure[Any], words: str, read: Callable[[DroppedShots], float | None]
) -> ChosenMeasure:
    titled = replace(measure, name=f"{measure.name}, {words}", read=read)
    return ChosenMeasure(name, titled, "shots", lambda run: run.shots)


def _judged(found: DroppedShots, measure: Measure[RuleVerdict]) -> float | None:
    """Number of the rule; None unless all shots and the centred one have a rebound."""
    every = (getattr(columns, key) for columns in (found.shots, found.centric) for key in _JUDGED)
    highest = highest_of(found.shots)
    if highest is None or not all(np.isfinite(values).all() for values in every):
        return None
    value = measure.read(judge_rule(found.shots, found.centric, highest))
    return None if value is None else float(value)


def _missing(columns: Iterable[str], found: DroppedShots) -> Iterable[str]:
    count = found.shots.count
    for key in columns:
        missing = int(np.sum(~np.isfinite(getattr(found.shots, key))))
        if missing:
            yield (
                f"{missing} of {count} shots ended before their {_RESULTS[key].name} was known: "
                "there are no statistics of the others alone. Try: a longer shots.duration."
            )


def _too_few(statistics: Iterable[Statistic], count: int) -> Iterable[str]:
    for item in statistics:
        if count < item.fewest:
            yield (
                f"{count} shots are too few for their {item.name}, which takes {item.fewest}. "
                "Try: a larger shots.count."
            )
