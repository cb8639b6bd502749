"""Derivatives of whatever a case is of."""

from collections.abc import Sequence

from klack.analyses.sensitivities.differences import run_differences
from klack.analyses.sensitivities.record import SensitivityRecord
from klack.analyses.sensitivities.run import run_sensitivities
from klack.analyses.study.run_points import require_way
from klack.case.any_case import AnyCase
from klack.case.case_tree import CaseTree
from klack.case.schema import Case
from klack.case.study_source import StudySource
from klack.progress import Progress, silent

__all__ = ["run_any_sensitivities"]


def run_any_sensitivities(
    case: AnyCase,
    tree: CaseTree,
    source: StudySource | None = None,
    *,
    parameters: Sequence[str] = (),
    measures: Sequence[str] = (),
    variant: str | None = None,
    level: str | None = None,
    check: bool = True,
    threads: int | None = None,
    progress: Progress = silent,
) -> SensitivityRecord:
    """Differentiate a stroke by exact tangents, an impact of two bodies by differences.

    Parameters
    ----------
    variant : str, optional
        Of a stroke.
    level : str, optional
        Of an impact.
    case, tree, source, parameters, measures, check, threads, progress
        See :func:`~klack.analyses.sensitivities.run.run_sensitivities`.
    """
    require_way(case, variant, level)
    if isinstance(case, Case):
        return run_differences(
            case,
            tree,
            source,
            parameters=parameters,
            measures=measures,
            level=level,
            check=check,
            threads=threads,
            progress=progress,
        )
    return run_sensitivities(
        case,
        tree,
        source,
        parameters=parameters,
        measures=measures,
        variant=variant,
        check=check,
        threads=threads,
        progress=progress,
    )
