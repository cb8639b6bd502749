"""Words for the columns and points of a study."""

import re
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from math import isfinite

import numpy as np

from klack.analyses.stroke.step_check import SHARE
from klack.analyses.study.record import (
    MissedBound,
    Screening,
    Sensitivity,
    StudyColumn,
    StudyRecord,
    StudySurrogate,
)
from klack.machine.progress import per_hour
from klack.report.wording import fixed, quantity
from klack.units import format_si, is_level

__all__ = [
    "EFFECT_COLUMNS",
    "MISSED_COLUMNS",
    "SHARE_COLUMNS",
    "SURROGATE_COLUMNS",
    "alike",
    "change",
    "effect_cells",
    "in_words",
    "index_cells",
    "largest_first",
    "missed_cells",
    "number_text",
    "numberless",
    "on_page",
    "rate_text",
    "short_labels",
    "shown_unit",
    "steps_texts",
    "surrogate_cells",
    "variant_words",
]


_TOLD = 8  # points in a sentence
_NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def numberless(note: str) -> str:
    """What notes of one kind have in common: they differ in numbers only."""
    return _NUMBER.sub("#", note)


def alike(notes: Iterable[Iterable[str]]) -> dict[str, Counter[str]]:
    """How many points have each note, by kind."""
    found: dict[str, Counter[str]] = {}
    for of_point in notes:
        for kind, note in {numberless(note): note for note in of_point}.items():
            found.setdefault(kind, Counter())[note] += 1
    return found


def shown_unit(unit: str) -> tuple[str, float]:
    """Unit for prefixes, and the factor from SI: masses and their flows in g, numbers bare."""
    if unit in ("kg", "kg/s"):
        return unit[1:], 1e3
    return ("", 1.0) if unit in ("1", "-") else (unit, 1.0)


def in_words(item: StudyColumn, value: float, digits: int = 4) -> str:
    """Value with unit; a dash without one."""
    if not isfinite(value):
        return "–"
    if item.words:
        return item.words[int(value)]
    return number_text(value, item.unit, digits)


def number_text(value: float, unit: str, digits: int = 4) -> str:
    """A number [SI] with its unit; levels to a tenth."""
    if is_level(unit):
        return f"{value:.1f} {unit}"
    shown, factor = shown_unit(unit)
    return format_si(factor * value, shown, digits)


def change(item: StudyColumn, value: float) -> str:
    """Change from today: in per cent, of levels the difference."""
    if item.words or not (isfinite(value) and isfinite(item.today)):
        return "–"
    if is_level(item.unit):
        return f"{value - item.today:+.1f} {item.unit}"
    if item.today == 0.0:
        return "–"
    return f"{100.0 * (value - item.today) / abs(item.today):+.1f} %"


def on_page(item: StudyColumn, value: float, digits: int = 4) -> str:
    """Value of a column as a report prints it."""
    if item.words or not isfinite(value):
        return in_words(item, value)
    if is_level(item.unit):
        return fixed(value, 1, item.unit)
    unit, factor = shown_unit(item.unit)
    return quantity(factor * value, unit, digits)


def variant_words(record: StudyRecord) -> str:
    """Variant, level, shots, or both."""
    if not record.model:
        return record.variant
    level, _, shots = record.variant.partition(" + ")
    if level == "shots":
        return level
    return f"level '{level}' and {shots}" if shots else f"level '{level}'"


EFFECT_COLUMNS = ("parameter", "size", "standard error", "mean", "scatter", "effects")


def largest_first(item: Screening) -> list[int]:
    """Parameters by falling effect."""
    return [int(k) for k in np.argsort(-np.nan_to_num(item.size), kind="stable")]


def effect_cells(
    measure: StudyColumn, item: Screening, k: int, text: Callable[[StudyColumn, float], str]
) -> tuple[str, ...]:
    """Size, error, mean, scatter and number of the effects of a parameter."""
    numbers = (item.size[k], item.size_error[k], item.mean[k], item.scatter[k])
    return (*(text(measure, float(number)) for number in numbers), str(int(item.effects[k])))


MISSED_COLUMNS = ("bound", "points", "missed", "probability", "95 % interval", "without a value")


def missed_cells(item: MissedBound) -> tuple[str, ...]:
    """A row of the table of missed bounds."""
    if not item.points:
        return (item.bound, "0", "0", "–", "–", str(item.failed))
    likely = f"{100.0 * item.probability:.3g} %"
    if not item.missed:
        likely = f"below {100.0 * item.at_most:.2g} %"
    low, high = item.low, item.high
    if item.failed:  # they may all have missed it, or none
        low, high = item.low_if_none, item.high_if_all
    interval = f"{100.0 * low:.3g} % to {100.0 * high:.3g} %"
    return (item.bound, str(item.points), str(item.missed), likely, interval, str(item.failed))


SHARE_COLUMNS = ("alone", "", "with interactions", "")


def index_cells(item: Sensitivity | StudySurrogate, k: int) -> tuple[str, ...]:
    """Indices of a parameter with intervals: alone, and with interactions."""
    return (
        _index(item.first[k]),
        f"{_index(item.first_low[k])} to {_index(item.first_high[k])}",
        _index(item.total[k]),
        f"{_index(item.total_low[k])} to {_index(item.total_high[k])}",
    )


SURROGATE_COLUMNS = ("measure", "points", "Q2", "root mean square", "largest", "made of")


def surrogate_cells(
    measure: StudyColumn, item: StudySurrogate, text: Callable[[StudyColumn, float], str]
) -> tuple[str, ...]:
    """Leave-one-out error of a surrogate, and its make-up, or that nothing follows."""
    known = isfinite(item.predictivity)
    errors = (text(measure, item.error), text(measure, item.largest))
    if known and is_level(measure.unit):
        errors = (f"{item.error:.2g} {measure.unit}", f"{item.largest:.2g} {measure.unit}")
    return (
        str(item.points),
        _predictivity(item.predictivity),
        *errors,
        "not used" if item.reason else item.made_of,
    )


def _predictivity(value: float) -> str:
    """Q2 with three digits, or as many as distinguish it from 1."""
    if not isfinite(value):
        return "–"
    return f"{value:.3f}" if value < 0.999 else f"1 − {1.0 - value:.1g}"


def _index(value: float) -> str:
    return f"{value:.3f}" if isfinite(value) else "–"


def rate_text(record: StudyRecord) -> str:
    """How many points were computed, and how fast."""
    parts = [f"{record.computed} points computed"]
    if record.computed and record.point_time > 0.0:
        crew = f"{record.threads} {record.workers}" if record.threads > 1 else "one core"
        parts[0] += f" in {format_si(record.point_time, 's', 3)} on {crew}"
        parts.append(per_hour(record.computed / record.point_time))
    if record.kept:
        parts.append(f"{record.kept} were there")
    failed = int(record.failed.sum())
    if failed:
        parts.append(f"{failed} have no measures")
    return "; ".join(parts) + "."


def steps_texts(record: StudyRecord) -> Iterator[str]:
    """Findings of the check of steps; nothing for impacts."""
    known = ~np.isnan(record.step_changes)
    if not known.any():
        if len(known) > record.failed.sum():
            yield "Time steps unchecked: their effect on the measures is unknown."
        return
    halved = int(np.sum(record.halvings[known] > 0))
    doubtful = np.flatnonzero(known & (record.step_changes > SHARE))
    text = f"Time steps checked at {known.sum()} of {len(known)} points, halved at {halved}; "
    if not len(doubtful):
        yield f"{text}their measures are certified."
        return
    named = ", ".join(map(str, doubtful[:_TOLD]))
    more = f" and {len(doubtful) - _TOLD} more" if len(doubtful) > _TOLD else ""
    yield f"{text}{len(doubtful)} not certified: {named}{more}."


def short_labels(record: StudyRecord) -> dict[str, str]:
    """Names of measures, and the shortest unique end of each key: ``spring preload``."""
    found = {item.name: item.name.replace(".", " ").replace("_", " ") for item in record.measures}
    names = [item.name for item in (*record.parameters, *record.linked)]
    for name in names:
        parts = name.split(".")
        ends = [".".join(parts[k:]) for k in range(len(parts) - 1, -1, -1)]
        alone = (
            end
            for end in ends
            if not end[0].isdigit()
            and not any(other != name and f".{other}".endswith(f".{end}") for other in names)
        )
        found[name] = next(alone, name).replace(".", " ").replace("_", " ")
    return found
