"""Record of ``klack study``, in columns."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from klack.analyses.point_table import PointColumn, PointTable, column_of
from klack.analyses.record import CaseRecord
from klack.signals.sampled import TimeSeries

__all__ = [
    "NOT_YET",
    "MissedBound",
    "Optimum",
    "PointSound",
    "Screening",
    "Sensitivity",
    "StudyColumn",
    "StudyRecord",
    "StudySurrogate",
    "SurrogateEffect",
    "steps_of",
    "study_table",
]


Column = NDArray[np.float64]

NOT_YET = "not computed yet"
"""Failure of a point of a study that still runs."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyColumn:
    """A parameter, what follows from parameters, or a measure: one number for every point.

    Parameters
    ----------
    name
        Key, word of the study, or measure.
    unit
        SI; ``"1"`` for a pure number, empty for words.
    spread
        Distribution or expression; empty for a measure.
    today
        In the case; nan where it has none.
    values (points,)
        Nan if missing; places in ``words``, if any.
    is_whole
        Whether the case has whole numbers there.
    """

    name: str
    title: str
    unit: str
    spread: str
    today: float
    values: Column
    words: tuple[str, ...] = ()
    is_whole: bool = False

    @property
    def varies(self) -> bool:
        """Whether two points differ in it."""
        known = self.values[np.isfinite(self.values)]
        return bool(known.size) and bool(np.ptp(known) > 0.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sensitivity:
    """Shares of the variance of one measure that each parameter causes (Sobol's indices).

    Parameters
    ----------
    first, first_low, first_high (parameters,)
        By a parameter alone, with interval.
    total, total_low, total_high (parameters,)
        What vanishes once the parameter is known.
    rows, discarded
        Base points used, and left out for a missing value.
    reason
        Why there are no numbers.
    """

    measure: str
    parameters: tuple[str, ...]
    first: Column
    first_low: Column
    first_high: Column
    total: Column
    total_low: Column
    total_high: Column
    rows: int
    discarded: int
    confidence: float
    reason: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Screening:
    """Elementary effects (parameters,) on one measure: its change over a whole range.

    Parameters
    ----------
    size, size_error [unit of the measure]
        Mean size, mu*, and its standard error.
    mean
        With signs, mu.
    scatter
        Standard deviation, sigma: of a parameter that acts differently at other places, by itself
        or through others.
    effects
        How many; those next to a failed point are left out.
    """

    measure: str
    parameters: tuple[str, ...]
    size: Column
    size_error: Column
    mean: Column
    scatter: Column
    effects: NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class SurrogateEffect:
    """Mean of a surrogate over all parameters except one.

    ``mean`` is in the unit of the measure; ``at`` [SI] are values of the parameter, or places in
    ``words``.
    """

    parameter: str
    at: Column
    words: tuple[str, ...]
    mean: Column


@dataclass(frozen=True, kw_only=True, eq=False)
class StudySurrogate:
    """Surrogate of one measure over all points: its leave-one-out error, and what follows from it.

    Parameters
    ----------
    points, failed, repeated
        Different points of the fit; points without a value, and repeating ones.
    predictivity
        Q2 of the points, each predicted from the others.
    error, largest [unit of the measure]
        Root mean square and largest of the leave-one-out residuals.
    residuals (points of the study,)
        Value minus prediction from the other points; nan where there is none.
    reason
        Why nothing follows from it.
    first, first_low, first_high, total, total_low, total_high (parameters,)
        As of :class:`Sensitivity`, with the largest change by the error; nan with a reason.
    effects
        By parameter.
    """

    measure: str
    kind: str
    made_of: str
    points: int
    failed: int
    repeated: int
    predictivity: float
    error: float
    largest: float
    residuals: Column
    reason: str
    parameters: tuple[str, ...]
    first: Column
    first_low: Column
    first_high: Column
    total: Column
    total_low: Column
    total_high: Column
    effects: tuple[SurrogateEffect, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Optimum:
    """What a search among the points of a study has found.

    Parameters
    ----------
    algorithm, bounds
        In words.
    objectives
        Measures; ``ways`` says whether each is minimised or maximised.
    kept (points,)
        Points that keep all bounds.
    front
        Unbeaten points, by the first objective.
    best
        Nearest of the front to the ideal point, in ranges of the front; -1 without a front.
    feasible
        False if no point keeps all bounds: the front then misses them least.
    """

    algorithm: str
    objectives: tuple[str, ...]
    ways: tuple[str, ...]
    bounds: tuple[str, ...]
    kept: NDArray[np.bool_]
    front: NDArray[np.int64]
    best: int
    feasible: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class PointSound:
    """Sound pressure [Pa] of a click; point -1 is the case as it is."""

    point: int
    pressure: TimeSeries


@dataclass(frozen=True, kw_only=True)
class MissedBound:
    """Share of drawn points that miss a bound.

    Parameters
    ----------
    missed, points, failed
        Points that miss it, with a value, and without.
    probability, low, high
        Share that misses it, with its interval of 95 %.
    at_most
        One-sided bound of 95 %, to state where none missed it.
    low_if_none, high_if_all
        Ends of the interval if none or all of the points without a value miss it.
    """

    bound: str
    missed: int
    points: int
    failed: int
    probability: float
    low: float
    high: float
    at_most: float
    low_if_none: float
    high_if_all: float


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyRecord(CaseRecord):
    """Measures of a case at many points.

    Parameters
    ----------
    study_text
        Of a study in its own file.
    variant
        Of a stroke; or level of an impact, ``"shots"``, or both.
    design
        In words.
    threads
        Points at a time.
    computed, kept
        Points computed now, and left by an earlier run.
    point_time [s]
        Wall time of the points computed now.
    failures
        Why a point has no measures.
    notes
        Doubts about the numbers of each point.
    sensitivities, screenings
        Of each measure, from the design of Saltelli, and from the trajectories of Morris.
    workers
        Threads, processes, or workers of dask.
    model
        Of impacts: level, modes and meshes of the case, and at how many points they differ.
    halvings, step_changes (points,)
        Of strokes, see :class:`~klack.analyses.study.asked_points.PointSteps`; nan without one, and
        empty for impacts.
    """

    study_text: str
    variant: str
    design: str
    threads: int
    computed: int
    kept: int
    point_time: float
    parameters: tuple[StudyColumn, ...]
    linked: tuple[StudyColumn, ...]
    measures: tuple[StudyColumn, ...]
    failures: tuple[str, ...]
    notes: tuple[str, ...]
    sensitivities: tuple[Sensitivity, ...] = ()
    screenings: tuple[Screening, ...] = ()
    surrogates: tuple[StudySurrogate, ...] = ()
    optimum: Optimum | None = None
    missed: tuple[MissedBound, ...] = ()
    sounds: tuple[PointSound, ...] = ()
    workers: str = "threads"
    model: str = ""
    halvings: Column = field(default_factory=lambda: np.zeros(0))
    step_changes: Column = field(default_factory=lambda: np.zeros(0))

    @property
    def count(self) -> int:
        """Number of points."""
        return len(self.failures)

    def measure(self, name: str) -> StudyColumn:
        """Measure of this name."""
        return next(item for item in self.measures if item.name == name)

    @property
    def columns(self) -> tuple[StudyColumn, ...]:
        """Parameters, what follows from them, measures."""
        return (*self.parameters, *self.linked, *self.measures)

    @property
    def designed(self) -> tuple[StudyColumn, ...]:
        """Parameters with several values, and measures."""
        return (*(item for item in self.parameters if item.varies), *self.measures)

    @property
    def failed(self) -> NDArray[np.bool_]:
        """Points without measures."""
        return np.array([bool(text) for text in self.failures], dtype=bool)


def study_table(record: StudyRecord) -> PointTable:
    """Points in order of the design: parameters, linked keys, measures."""
    return PointTable(
        case=record.case,
        variant=record.variant,
        points=tuple(_column(item) for item in (*record.parameters, *record.linked)),
        measures=tuple(_column(item) for item in record.measures),
        failures=record.failures,
        warnings=tuple(tuple(text.splitlines()) for text in record.notes),
        steps=steps_of(record.halvings, record.step_changes),
    )


def steps_of(
    halvings: NDArray[np.float64], changes: NDArray[np.float64]
) -> tuple[PointColumn, ...]:
    """Columns of the check of steps; none of impacts."""
    named = (("halvings", halvings), ("step_change", changes))
    return tuple(PointColumn(name, "1", values) for name, values in named if len(values))


def _column(item: StudyColumn) -> PointColumn:
    if item.words:
        return column_of(item.name, "", [item.words[int(value)] for value in item.values])
    return column_of(item.name, item.unit, item.values.tolist())
