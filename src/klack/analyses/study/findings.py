"""Findings from all points of a study."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from klack.analyses.study.goals import Bound, bound_text
from klack.analyses.study.points import StudyPoints, require_varied
from klack.analyses.study.record import (
    MissedBound,
    Screening,
    Sensitivity,
    StudyColumn,
    StudySurrogate,
    SurrogateEffect,
)
from klack.case.study_source import StudySource
from klack.errors import InputError, refuse_if
from klack.input.problem import one_of
from klack.machine.progress import Progress
from klack.studies.designs import Listed, unevenness
from klack.studies.samples import exceedance_of
from klack.studies.sensitivity import CONFIDENCE, elementary_effects, sobol_indices
from klack.studies.surrogate import Surrogate, SurrogateKind, fit_surrogate
from klack.studies.surrogate_model import SurrogateAxis, require_scikit_learn

__all__ = [
    "missed_bound",
    "require_surrogates",
    "screening_of",
    "sensitivity_of",
    "surrogate_warnings",
    "surrogates_of",
]


def sensitivity_of(item: StudyColumn, parameters: tuple[str, ...]) -> Sensitivity:
    """Indices over the points of Saltelli's design, in its order."""
    found = sobol_indices(item.values, len(parameters))
    return Sensitivity(
        measure=item.name,
        parameters=parameters,
        first=found.first.value,
        first_low=found.first.low,
        first_high=found.first.high,
        total=found.total.value,
        total_low=found.total.low,
        total_high=found.total.high,
        rows=found.rows,
        discarded=found.discarded,
        confidence=CONFIDENCE,
        reason=found.reason,
    )


def screening_of(
    item: StudyColumn, parameters: tuple[str, ...], cube: NDArray[np.float64]
) -> Screening:
    """Elementary effects over the trajectories of Morris."""
    found = elementary_effects(cube, item.values)
    return Screening(
        measure=item.name,
        parameters=parameters,
        size=found.mean_size,
        size_error=found.mean_size_error,
        mean=found.mean,
        scatter=found.scatter,
        effects=found.effects,
    )


def missed_bound(bound: Bound, column: StudyColumn) -> MissedBound:
    """Share of points that miss a bound, with its interval.

    The interval takes the points for independent draws; Sobol points and a Latin hypercube scatter
    less, so that it tends to be wider than claimed.
    """
    sign = 1.0 if bound.is_most else -1.0
    found = exceedance_of(sign * column.values, sign * bound.value)
    return MissedBound(
        bound=f"{bound.measure} {bound_text(bound, column.unit)}",
        missed=found.exceeded,
        points=found.runs,
        failed=found.failed,
        probability=found.estimate,
        low=found.low,
        high=found.high,
        at_most=found.at_most,
        low_if_none=found.low_if_none,
        high_if_all=found.high_if_all,
    )


_DESIGNS = ("sobol", "latin-hypercube", "made", "file")
"""Designs that may fill ranges evenly; a grid has gaps between levels."""
_MOST = {"polynomial-chaos": 10_000, "gaussian-process": 500}
_UNEVEN = 4.0
_OUTSIDE = 1e-9
_CURVE = 41
_STAGE = "surrogates"


def require_surrogates(source: StudySource, points: StudyPoints) -> None:
    """Refuse, before the first run, surrogates that could not tell how wrong they are.

    These are of designs that do not fill the ranges, too many points, and points of a file that lie
    outside of the ranges, on few levels, or crowded.
    """
    if (asked := source.study.surrogate) is None:
        return
    kind, design = asked.kind, source.study.design.kind
    refuse_if(
        design not in _DESIGNS,
        source.where(("surrogate",)),
        got=f"a surrogate of the design {design}",
        expected=f"a design that fills the ranges: {one_of(_DESIGNS)}",
        hint="use kind: sobol; on few levels, or around few points, the error of a surrogate "
        "elsewhere is unknown.",
    )
    refuse_if(
        len(points.values) > _MOST[kind],
        source.where(("surrogate", "kind")),
        got=f"a {kind} of {len(points.values)} points",
        expected=f"at most {_MOST[kind]} points",
        hint="use kind: polynomial-chaos, or fewer points.",
    )
    require_varied(source, points.space.varied)
    require_scikit_learn()
    if design == "file":
        _require_even(source, points)


def _require_even(source: StudySource, points: StudyPoints) -> None:
    """Points of a file lie in the ranges and fill them as random ones do."""
    where = str(source.study.design.file)
    shares = []
    for item, axis in zip(points.space.varied, _axes(points), strict=True):
        values = [point[item.name] for point in points.values]
        outside = [value for value in values if not _is_inside(axis, value)]
        if outside:
            raise InputError(
                where,
                got=f"{item.name}: {len(outside)} values such as {outside[0]!r} (SI)",
                expected=f"values of the study: {item.text()}",
                hint="widen the range, or remove these rows; a surrogate does not extrapolate.",
            )
        if isinstance(axis.spread, Listed):
            continue
        refuse_if(
            2 * len(set(values)) < len(values),
            where,
            got=f"{item.name}: {len(set(values))} different values in {len(values)} points",
            expected="a different value in most points",
            hint="use kind: sobol; between few levels the error of a surrogate is unknown.",
        )
        shares.append([axis.spread.share(float(value)) for value in values])
    found = unevenness(np.array(shares).T) if shares else 0.0
    refuse_if(
        found > _UNEVEN,
        where,
        got=f"points with {found:.3g} times the squared discrepancy of random points",
        expected=f"points that fill the ranges: at most {_UNEVEN:g} times",
        hint="use kind: sobol, or give the ranges or distributions that the points have.",
    )


def _is_inside(axis: SurrogateAxis, value: float | str) -> bool:
    spread = axis.spread
    if axis.words:
        return str(value) in axis.words
    if isinstance(spread, Listed):
        return bool(np.isclose(float(value), np.array(spread.values, dtype=float)).any())
    return bool(np.abs(axis.coordinate([value])[0]) <= 1.0 + _OUTSIDE)


def _axes(points: StudyPoints) -> list[SurrogateAxis]:
    return [SurrogateAxis.of(item.spread) for item in points.space.varied]


def surrogates_of(
    kind: SurrogateKind, points: StudyPoints, measures: Sequence[StudyColumn], progress: Progress
) -> tuple[StudySurrogate, ...]:
    """Fit a surrogate to each measure."""
    axes, names = _axes(points), tuple(item.name for item in points.space.varied)
    values = [[point[name] for point in points.values] for name in names]
    t = np.column_stack([axis.coordinate(own) for axis, own in zip(axes, values, strict=True)])
    found = []
    for k, item in enumerate(measures):
        progress(_STAGE, k / len(measures))
        fitted = fit_surrogate(kind, axes, t, item.values)
        found.append(_recorded(kind, item.name, names, axes, fitted))
    progress(_STAGE, 1.0)
    return tuple(found)


def _recorded(
    kind: str,
    measure: str,
    names: tuple[str, ...],
    axes: Sequence[SurrogateAxis],
    fitted: Surrogate,
) -> StudySurrogate:
    none = np.full(len(names), np.nan)
    first, total = fitted.first, fitted.total
    return StudySurrogate(
        measure=measure,
        kind=kind,
        made_of=fitted.model.made_of if fitted.model else "",
        points=fitted.points,
        failed=fitted.failed,
        repeated=fitted.repeated,
        predictivity=fitted.predictivity,
        error=fitted.error,
        largest=fitted.largest,
        residuals=fitted.residuals,
        reason=fitted.reason,
        parameters=names,
        first=first.value if first else none,
        first_low=first.low if first else none,
        first_high=first.high if first else none,
        total=total.value if total else none,
        total_low=total.low if total else none,
        total_high=total.high if total else none,
        effects=tuple(_effect(fitted, axes, names, k) for k in range(len(names)))
        if fitted.model
        else (),
    )


def _effect(
    fitted: Surrogate, axes: Sequence[SurrogateAxis], names: Sequence[str], k: int
) -> SurrogateEffect:
    axis, t = axes[k], axes[k].shown(_CURVE)
    assert fitted.model is not None
    at: NDArray[np.float64] = t if axis.words else np.array([axis.value(float(x)) for x in t])
    return SurrogateEffect(
        parameter=names[k],
        at=at,
        words=axis.words,
        mean=fitted.model.main_effect(k, t),
    )


def surrogate_warnings(surrogates: Sequence[StudySurrogate]) -> tuple[str, ...]:
    """Measures without a surrogate, and points that surrogates leave out."""
    found = [
        f"The surrogate gives no shares and no main effects of '{item.measure}': {item.reason}."
        for item in surrogates
        if item.reason
    ]
    found += [
        f"The surrogate of '{item.measure}' is fitted without {item.failed} points that have no "
        "value: near these it extrapolates."
        for item in surrogates
        if item.failed and not item.reason
    ]
    return tuple(found)
