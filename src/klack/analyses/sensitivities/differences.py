r"""Derivatives of an impact of two bodies, by impacts on both sides.

Static contact, pressure pattern and contact law of an impact are solved anew for its speed, its
forces and its bodies; there is no compiled step that derivatives could be carried through.  Each
parameter is changed by :math:`h` = 1 % and by 2 % of its size, up and down,

.. math::

    D_h = \frac{m(p + h) - m(p - h)}{2 h}, \qquad
    \frac{\mathrm dm}{\mathrm dp} = \frac{4 D_h - D_{2h}}{3} + O(h^4)

(Richardson 1911).  Both differences disagree where meshes, modes or contacts change by jumps, and
this is told.
"""

from collections.abc import Callable, Sequence
from functools import partial
from math import isfinite
from time import perf_counter, process_time

from klack.analyses.point_table import PointTable
from klack.analyses.record import case_fields, run_fields
from klack.analyses.sensitivities.parameters import SlopeSpace, asked_measures, slope_space
from klack.analyses.sensitivities.record import HOLDS, MeasureSlopes, SensitivityRecord
from klack.analyses.sensitivities.run import run_sensitivities
from klack.analyses.study.kinds import kind_of
from klack.analyses.study.measures import impact_measures
from klack.analyses.study.run_points import require_way, run_points
from klack.analyses.study.where import Where
from klack.case.any_case import AnyCase, CaseTree
from klack.case.schema import Case
from klack.case.study_source import StudySource
from klack.errors import ConvergenceError
from klack.input.problem import one_of
from klack.machine.progress import Progress, silent
from klack.machine.stages import StageClock, collected_warnings

__all__ = ["sensitivities_of"]


_CHANGE = 0.01
_WAYS = (1.0, -1.0, 2.0, -2.0)
_USUAL = ("peak_force", "contact_time", "impulse", "restitution")
_RESOLVED = 1e-4  # of a measure: what the time of touch within a step changes


def run_differences(
    case: Case,
    tree: CaseTree,
    source: StudySource | None = None,
    *,
    parameters: Sequence[str] = (),
    measures: Sequence[str] = (),
    level: str | None = None,
    check: bool = True,
    threads: int | None = None,
    progress: Progress = silent,
) -> SensitivityRecord:
    """Differentiate measures of an impact by differences.

    Parameters as of :func:`~klack.analyses.sensitivities.run.run_sensitivities`; they may be any
    numbers of the case, also of its bodies.  ``level`` is that of the study, or ``reduced``, by
    default.
    """
    begin = perf_counter()
    space = slope_space(case, source, parameters)
    chosen = impact_measures(case, asked_measures(source, measures) or _USUAL)
    kind = kind_of(case)
    asked = level or (kind.asked_variant(source.study) if source is not None else None)
    shifts = [{item.name: way * _CHANGE * item.size} for item in space.varied for way in _WAYS]
    together = [space.together(way * _CHANGE) for way in (1.0, -1.0)]
    points = [space.written(shift) for shift in ({}, *shifts, *(together if check else ()))]
    clock = StageClock(progress)
    spent = process_time()
    with collected_warnings() as notes:
        table = run_points(
            case,
            tree,
            points,
            [item.name for item in chosen],
            variant=asked,
            where=Where(threads=threads),
            progress=clock,
        )
    spent = process_time() - spent
    if table.failures[0]:
        raise ConvergenceError(table.failures[0])
    doubts: list[str] = []
    found = tuple(
        _slopes(table, item.name, item.measure.name, item.measure.unit, space, check, doubts)
        for item in chosen
    )
    wrong = [item.name for item in found if item.is_doubtful]
    if wrong:
        doubts.append(
            f"The derivatives of {one_of(wrong)} do not predict impacts with all parameters "
            f"changed by {_CHANGE:.0%}."
        )
    failed = sum(1 for failure in table.failures if failure)
    if failed:
        first = next(failure for failure in table.failures if failure).partition("\n")[0]
        doubts.append(f"{failed} of {len(points)} impacts could not be computed: {first}")
    return SensitivityRecord(
        **case_fields(case),
        **run_fields(begin, clock),
        variant=table.variant,
        parameters=space.described,
        measures=found,
        impacts=(),
        share=_CHANGE if check else 0.0,
        runs_time=spent,
        run_time=spent / len(points),
        by_differences=True,
        warnings=(*dict.fromkeys((*table.warnings[0], *notes)), *doubts),
    )


def _slopes(
    table: PointTable,
    name: str,
    title: str,
    unit: str,
    space: SlopeSpace,
    check: bool,
    doubts: list[str],
) -> MeasureSlopes:
    values = [float(value) for value in table[name]]
    slopes: list[float | None] = []
    resolution = _RESOLVED * abs(values[0]) if isfinite(values[0]) else 0.0
    for k, item in enumerate(space.varied):
        h = _CHANGE * item.size
        up, down, far_up, far_down = values[1 + 4 * k : 5 + 4 * k]
        near, far = (up - down) / (2.0 * h), (far_up - far_down) / (4.0 * h)
        slope = (4.0 * near - far) / 3.0
        slopes.append(slope if isfinite(slope) else None)
        apart = abs(near - far)
        if apart > HOLDS * abs(slope) and apart * h > resolution:
            doubts.append(
                f"The derivative of {name} with respect to {item.name} is {near:.4g} from "
                f"changes of {_CHANGE:.0%} and {far:.4g} from changes twice as large: it is not "
                "reliable."
            )
    predicted, scale = space.change_together(_CHANGE, slopes)
    secant = 0.5 * (values[-2] - values[-1]) if check else float("nan")
    return MeasureSlopes(
        name=name,
        title=title,
        unit=unit,
        value=values[0] if isfinite(values[0]) else None,
        slopes=tuple(slopes),
        predicted=predicted,
        secant=secant if isfinite(secant) else None,
        scale=scale,
        resolution=resolution,
    )


def sensitivities_of(
    case: AnyCase, variant: str | None = None, level: str | None = None
) -> Callable[..., SensitivityRecord]:
    """What differentiates a case: a stroke by exact tangents, an impact by differences.

    Returns :func:`~klack.analyses.sensitivities.run.run_sensitivities` or :func:`run_differences`,
    which take the rest.  InputError for a variant of an impact, or a level of a stroke.
    """
    require_way(case, variant, level)
    if isinstance(case, Case):
        return partial(run_differences, level=level)
    return partial(run_sensitivities, variant=variant)
