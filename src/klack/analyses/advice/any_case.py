"""Advice for a case of either kind."""

from dataclasses import replace
from typing import cast

from klack.analyses.advice.advice import Advice
from klack.analyses.advice.impact import AdviceLevel, advise_impact
from klack.analyses.advice.stroke import advise_stroke
from klack.case.schema import Case
from klack.case.valve import ValveCase
from klack.errors import InputError
from klack.progress import Progress, silent
from klack.units import format_si

__all__ = ["advise_case"]


def advise_case(
    case: Case | ValveCase,
    *,
    error: float = 0.01,
    level_error: float = 1.0,
    up_to: float | None = None,
    level: str | None = None,
    confirm: bool = True,
    progress: Progress = silent,
    threads: int | None = None,
) -> Advice:
    """Advise an impact of two bodies, or the stroke of a whole valve.

    Parameters are those of :func:`klack.analyses.advice.impact.advise_impact`; a stroke is judged
    by its first impacts, without a band and without levels.
    """
    if isinstance(case, Case):
        advice = advise_impact(
            case,
            error=error,
            level_error=level_error,
            up_to=up_to,
            level=cast(AdviceLevel | None, level),
            confirm=confirm,
            progress=progress,
            threads=threads,
        )
    else:
        _refuse_options(("--up-to", up_to and format_si(up_to, "Hz", 3)), ("--level", level))
        advice = advise_stroke(
            case, error=error, confirm=confirm, progress=progress, threads=threads
        )
    return replace(advice, notes=(*advice.notes, *case.input_notes))


def _refuse_options(*given: tuple[str, object]) -> None:
    """Refuse options that a stroke does not have."""
    for option, value in given:
        if value is not None:
            raise InputError(
                option,
                got=f"{value} for the case of a whole valve",
                expected="no such option: a stroke is judged by its first impacts",
                hint="use it for a case of two bodies, e.g. klack advise demo-valve-axisymmetric.",
            )
