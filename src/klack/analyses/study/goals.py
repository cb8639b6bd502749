"""Goals of an optimisation: objectives and bounds."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.analyses.measures import Measure
from klack.case.study import Written
from klack.case.study_source import StudySource
from klack.errors import refuse_if
from klack.units import KINDS, RATIO, Kind, format_si, parse_quantity

__all__ = [
    "Bound",
    "Goals",
    "Side",
    "bound_text",
    "bounds_of",
    "goals_of",
    "is_by_today",
    "require_objectives",
]

Side = tuple[str, bool]
"""Measure, and whether high is worse."""

_LEVELS = ("dB", "dBA", "phon", "sone", "acum")
_TODAY = re.compile(r"today(?:\s*(?P<sign>[+-])\s*(?P<change>\S.*))?")


@dataclass(frozen=True, slots=True, kw_only=True)
class Bound:
    """A bound, in the unit of a measure: the largest (``is_most``) or smallest allowed value."""

    measure: str
    value: float
    is_most: bool

    def violation(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Excess over a bound, relative to it; zero or less where it is kept."""
        past = values - self.value if self.is_most else self.value - values
        return past / (abs(self.value) or 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Goals:
    """Objectives and bounds; ``signs`` are 1 for an objective to minimise, -1 to maximise."""

    objectives: tuple[str, ...]
    signs: tuple[float, ...]
    bounds: tuple[Bound, ...]

    @property
    def sides(self) -> tuple[Side, ...]:
        """Measures of the goals, and whether high is worse."""
        own = zip(self.objectives, (sign > 0.0 for sign in self.signs), strict=True)
        return tuple(dict.fromkeys([*own, *((b.measure, b.is_most) for b in self.bounds)]))

    @property
    def ways(self) -> tuple[str, ...]:
        """``"minimise"`` or ``"maximise"``, of each objective."""
        return tuple("minimise" if sign > 0.0 else "maximise" for sign in self.signs)

    def bound_texts(
        self, units: Mapping[str, str], name: Callable[[str, bool], str]
    ) -> tuple[str, ...]:
        """Bounds in words, with the units of the measures.

        ``name`` gives the name of the column of a measure and side.
        """
        named = [(name(bound.measure, bound.is_most), bound) for bound in self.bounds]
        return tuple(
            f"{column} {bound_text(bound, units[bound.measure])}" for column, bound in named
        )

    def objective_values(self, of: Mapping[Side, NDArray[np.float64]]) -> NDArray[np.float64]:
        """Numbers (points, objectives) to minimise."""
        pairs = zip(self.signs, self.objectives, strict=True)
        return np.column_stack([sign * of[name, sign > 0.0] for sign, name in pairs])

    def violations(self, of: Mapping[Side, NDArray[np.float64]]) -> NDArray[np.float64]:
        """Shape (points, bounds), zero or less where kept."""
        count = len(next(iter(of.values())))
        found = [bound.violation(of[bound.measure, bound.is_most]) for bound in self.bounds]
        return np.column_stack(found) if found else np.zeros((count, 0))


def require_objectives(source: StudySource) -> None:
    """Refuse a study without objectives before its first point."""
    refuse_if(
        not source.study.objectives,
        source.where(()),
        got="no objectives",
        expected="one to four measures to minimise or maximise",
        hint="add 'objectives: {closing_time: minimise}' to the study.",
    )


def goals_of(
    source: StudySource, measures: Mapping[str, Measure[object]], today: Mapping[str, float]
) -> Goals:
    """Objectives and bounds of a study.

    ``measures`` are all that are computed, by their names in the study; ``today`` their values in
    the case as it is, which a bound may count from.
    """
    study = source.study
    return Goals(
        objectives=tuple(study.objectives),
        signs=tuple(1.0 if way == "minimise" else -1.0 for way in study.objectives.values()),
        bounds=bounds_of(source, measures, today),
    )


def bounds_of(
    source: StudySource, measures: Mapping[str, Measure[object]], today: Mapping[str, float]
) -> tuple[Bound, ...]:
    """Bounds of a study, as for :func:`goals_of`."""
    bounds = []
    for name, limit in source.study.constraints.items():
        ends = {}
        for key, written in (("most", limit.most), ("least", limit.least)):
            if written is not None:
                where = source.where(("constraints", name, key))
                ends[key] = _bound(where, written, measures[name].unit, today[name])
                bounds.append(Bound(measure=name, value=ends[key], is_most=key == "most"))
        refuse_if(
            ends.get("least", -np.inf) > ends.get("most", np.inf),
            source.where(("constraints", name)),
            got=f"least: {limit.least} above most: {limit.most}",
            expected="a least value below the greatest",
            hint="exchange them.",
        )
    return tuple(bounds)


def is_by_today(written: Written | None) -> bool:
    """Whether a bound counts from the case: ``today + 2 %``."""
    return written is not None and _TODAY.fullmatch(str(written).strip()) is not None


def _bound(where: str, written: Written, unit: str, today: float) -> float:
    kind = _kind(unit)
    by_today = _TODAY.fullmatch(str(written).strip())
    if by_today is None:
        return parse_quantity(written, kind, where)
    refuse_if(
        not np.isfinite(today),
        where,
        got=f"'{written}', but today's case has no value of this measure",
        expected="a bound with its unit",
        hint="write a number, or let the case compute this measure.",
    )
    if by_today["sign"] is None:
        return today
    sign = 1.0 if by_today["sign"] == "+" else -1.0
    change = by_today["change"]
    if change.rstrip().endswith("%"):
        return today + sign * abs(today) * parse_quantity(change, RATIO, where)
    return today + sign * parse_quantity(change, kind, where)


def _kind(unit: str) -> Kind:
    """Kind of an SI unit; a level has its own unit."""
    if unit in ("", "1"):
        return RATIO
    plain = unit.replace(" ", "*")
    for kind in KINDS:
        if kind.unit in (unit, plain):
            return kind
    factors = {unit: 1.0} if unit in _LEVELS else {}
    if unit == "dBA":
        factors["dB(A)"] = 1.0
    return Kind(f"a value in {unit}", plain, f"1 {unit}", (unit,), factors, smallest=0.0)


def bound_text(bound: Bound, unit: str) -> str:
    """``at most 400 N``."""
    text = format_si(bound.value, "" if unit == "1" else unit)
    return f"at {'most' if bound.is_most else 'least'} {text}"
