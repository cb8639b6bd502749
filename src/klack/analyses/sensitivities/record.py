"""Record of ``klack sensitivities``."""

from dataclasses import dataclass

from klack.analyses.record import CaseRecord
from klack.errors import InputError
from klack.input.problem import nearest, one_of
from klack.units import is_level

__all__ = ["HOLDS", "MISSED", "ImpactSlope", "MeasureSlopes", "SensitivityRecord", "SlopeParameter"]

HOLDS = 0.25
"""Deviation from two runs above which a derivative says nothing."""

MISSED = 0.05
"""Deviation from two runs that is reported."""


@dataclass(frozen=True, slots=True, kw_only=True)
class SlopeParameter:
    """Parameter: path of its key, or a word of the study; value in SI."""

    name: str
    unit: str
    value: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasureSlopes:
    """A measure and its derivatives.

    Parameters
    ----------
    slopes
        By parameter, per its unit; None where a little further on has no value.
    predicted, secant
        Change of the measure under :meth:`SlopeSpace.together`: from the derivatives, and from two
        runs.
    scale
        Root sum of squares of the parts of ``predicted``.
    resolution
        Of the steps of a run: a smaller difference is no doubt.
    strayed
        Difference by round-off between runs with and without derivatives; 0 without a check.
    """

    name: str
    title: str
    unit: str
    value: float | None
    slopes: tuple[float | None, ...]
    predicted: float | None
    secant: float | None
    scale: float
    resolution: float
    strayed: float = 0.0

    def elasticity(self, k: int, parameter: SlopeParameter) -> float | None:
        """Relative change of the measure over that of a parameter.

        None at a value of zero, and of a level, which is relative already.
        """
        slope = self.slopes[k]
        if slope is None or not self.value or parameter.value == 0.0 or is_level(self.unit):
            return None
        return slope * parameter.value / self.value

    @property
    def deviation(self) -> float | None:
        """Difference of both predictions over the scale of the change."""
        if self.predicted is None or self.secant is None or self.scale == 0.0:
            return None
        return abs(self.predicted - self.secant) / self.scale

    @property
    def has_strayed(self) -> bool:
        """Whether round-off changes the value by more than the steps resolve."""
        return self.strayed > self.resolution

    @property
    def is_doubtful(self) -> bool:
        """Whether other runs tell something else."""
        if self.has_strayed:
            return True
        return self._is_apart and (self.deviation is None or self.deviation > HOLDS)

    @property
    def is_rough(self) -> bool:
        """Whether two runs miss it by more than :data:`MISSED`, but not doubtfully."""
        return self._is_apart and self._is_missed and not self.is_doubtful

    @property
    def is_unconfirmed(self) -> bool:
        """Whether the steps resolve the change worse than :data:`MISSED` of it."""
        return self._is_missed and not self._is_apart and not self.is_doubtful

    @property
    def _is_missed(self) -> bool:
        return self.deviation is not None and self.deviation > MISSED

    @property
    def _is_apart(self) -> bool:
        if self.predicted is None or self.secant is None:
            return False
        return abs(self.predicted - self.secant) > self.resolution


@dataclass(frozen=True, slots=True, kw_only=True)
class ImpactSlope:
    """Time of an impact, and how well its derivatives predict another run.

    Parameters
    ----------
    number
        On its stop, from 1.
    time [s]
    growth [s]
        Change of the time for all parameters changed by their size, root sum of squares: how
        strongly the motion answers.
    is_doubtful
        Whether two runs differ.
    """

    stop: str
    number: int
    time: float
    growth: float
    deviation: float | None
    is_doubtful: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class SensitivityRecord(CaseRecord):
    """Derivatives of the measures of a stroke or an impact.

    Parameters
    ----------
    variant
        Of a stroke, or level of an impact.
    share
        Change of each parameter in the check; 0 without.
    runs_time, run_time [s]
        Processor time of the derivatives, and of one run without them.
    by_differences
        From runs with changed parameters, not exact tangents.
    """

    variant: str
    parameters: tuple[SlopeParameter, ...]
    measures: tuple[MeasureSlopes, ...]
    impacts: tuple[ImpactSlope, ...]
    share: float
    runs_time: float
    run_time: float
    by_differences: bool = False

    def derivative(self, measure: str, parameter: str) -> float | None:
        """Derivative in SI units."""
        of, k = self._at(measure, parameter)
        return of.slopes[k]

    def elasticity(self, measure: str, parameter: str) -> float | None:
        """Relative change over that of a parameter; None at a value of zero."""
        of, k = self._at(measure, parameter)
        return of.elasticity(k, self.parameters[k])

    def _at(self, measure: str, parameter: str) -> tuple[MeasureSlopes, int]:
        measures = {item.name: item for item in self.measures}
        places = {item.name: k for k, item in enumerate(self.parameters)}
        for what, name, known in (("measure", measure, measures), ("parameter", parameter, places)):
            if name not in known:
                raise InputError(
                    what,
                    got=f"'{name}'",
                    expected=f"one of: {one_of(known)}",
                    hint=nearest(name, known, "names are those of the record."),
                )
        return measures[measure], places[parameter]
