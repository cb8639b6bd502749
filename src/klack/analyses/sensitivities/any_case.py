"""Derivatives of whatever a case is of."""

from collections.abc import Callable
from functools import partial

from klack.analyses.sensitivities.differences import run_differences
from klack.analyses.sensitivities.record import SensitivityRecord
from klack.analyses.sensitivities.run import run_sensitivities
from klack.analyses.study.run_points import require_way
from klack.case.any_case import AnyCase
from klack.case.schema import Case

__all__ = ["sensitivities_of"]


def sensitivities_of(
    case: AnyCase, variant: str | None = None, level: str | None = None
) -> Callable[..., SensitivityRecord]:
    """Return what differentiates a case: a stroke by exact tangents, an impact by differences.

    Parameters
    ----------
    case : Case or ValveCase
    variant : str, optional
        Of a stroke.
    level : str, optional
        Of an impact.

    Returns
    -------
    callable
        :func:`~klack.analyses.sensitivities.run.run_sensitivities` or
        :func:`~klack.analyses.sensitivities.differences.run_differences`, which take the rest.

    Raises
    ------
    InputError
        For a variant of an impact, or a level of a stroke.
    """
    require_way(case, variant, level)
    if isinstance(case, Case):
        return partial(run_differences, level=level)
    return partial(run_sensitivities, variant=variant)
