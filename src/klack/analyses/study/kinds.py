"""Kind of calculation of the points of a case."""

from collections.abc import Iterable
from typing import Any

from klack.analyses.study.asked_points import AskedPoints, PointKind
from klack.analyses.study.impacts import IMPACTS
from klack.analyses.study.measures import impact_measure_names, stroke_measure_names
from klack.analyses.study.strokes import STROKES
from klack.case.any_case import AnyCase, CaseTree
from klack.case.points import GivenPoints, points_of
from klack.case.schema import Case

__all__ = ["ask", "kind_of", "measure_names"]


def kind_of(case: AnyCase) -> PointKind[Any, Any]:
    """Impacts and shots of two bodies, or strokes of a valve."""
    return IMPACTS if isinstance(case, Case) else STROKES


def measure_names(case: AnyCase) -> tuple[str, ...]:
    """Measures that points of a case can have."""
    return impact_measure_names(case) if isinstance(case, Case) else stroke_measure_names(case)


def ask(
    case: AnyCase,
    tree: CaseTree,
    points: GivenPoints,
    measures: Iterable[str],
    variant: str | None,
) -> AskedPoints:
    """Check all that can be known before the first run; ``variant`` may be a level."""
    kind = kind_of(case)
    chosen = kind.measures(case, measures)
    asked = points_of(case, tree, points)
    kind.require_keys(asked.keys)
    return AskedPoints(
        kind=kind,
        case=case,
        tree=tree,
        points=asked,
        chosen=chosen,
        variant=kind.variant(case, variant, chosen),
    )
