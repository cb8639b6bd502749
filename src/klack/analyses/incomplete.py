"""Incomplete results: failed levels beside those that ran."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from klack.analyses.impact.record import ImpactStudy
from klack.analyses.stroke.missing import missing_notes
from klack.analyses.stroke.record import StrokeStudy
from klack.errors import ConvergenceError
from klack.machine.stages import FAILURES

__all__ = ["Attempts", "IncompleteImpactError", "failure_notes", "missing_in"]


class IncompleteImpactError(ConvergenceError):
    """A level of an impact failed; ``study`` holds those that did not.

    Its ``failures`` and warnings say what is missing.
    """

    def __init__(self, study: ImpactStudy) -> None:
        super().__init__("\n".join(failure_notes(study.failures)))
        self.study = study


class Attempts:
    """Levels one after another; a failure costs the others nothing."""

    def __init__(self) -> None:
        self.errors: dict[str, Exception] = {}

    @contextmanager
    def at(self, name: str) -> Iterator[None]:
        """Keep the error of a level and continue."""
        try:
            yield
        except FAILURES as error:
            self.errors[name] = error

    @property
    def texts(self) -> dict[str, str]:
        """Which levels failed, and why."""
        return {
            name: str(error) or f"it ended with a {type(error).__name__}"
            for name, error in self.errors.items()
        }

    def require_one(self, levels: Mapping[str, object]) -> None:
        """Raise the first error if no level has a result."""
        if not levels:
            raise next(iter(self.errors.values()))


def failure_notes(failures: Mapping[str, str]) -> tuple[str, ...]:
    """Notes on missing levels of an impact, with reasons."""
    return tuple(
        f"level '{name}' failed and has no results: {' '.join(text.split())}"
        for name, text in failures.items()
    )


def missing_in(study: object) -> tuple[str, ...]:
    """What is missing in a stored result."""
    if isinstance(study, ImpactStudy):
        return failure_notes(study.failures)
    if isinstance(study, StrokeStudy):
        return missing_notes(study.variants, (), None)
    return ()
