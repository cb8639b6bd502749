"""Watching a long run: how long each stage takes, and what it warns of."""

import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from time import perf_counter

from klack.errors import AccuracyWarning
from klack.workflow.progress import Progress

__all__ = ["LIBRARIES", "StageClock", "collected_warnings"]

LIBRARIES = ("numpy", "scipy", "numba", "netgen-mesher")
"""Distributions whose versions belong to a result."""


class StageClock:
    """Passes progress on and measures how long each stage takes."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._stage, self._since = "", perf_counter()
        self._times: dict[str, float] = {}

    def __call__(self, stage: str, fraction: float) -> None:
        """Pass on how far a stage is."""
        if stage != self._stage:
            self._book()
            self._stage = stage
        self._progress(stage, fraction)

    def _book(self) -> None:
        now = perf_counter()
        if self._stage:
            self._times[self._stage] = self._times.get(self._stage, 0.0) + now - self._since
        self._since = now

    def spent(self, stages: Sequence[str]) -> float:
        """Seconds in these stages so far."""
        return sum(self.times().get(stage, 0.0) for stage in stages)

    def times(self) -> dict[str, float]:
        """Seconds per stage."""
        self._book()
        return dict(self._times)


@contextmanager
def collected_warnings() -> Iterator[list[str]]:
    """Collect accuracy warnings as notes of the study, each once; show all others as usual."""
    notes: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield notes
    for item in caught:
        if issubclass(item.category, AccuracyWarning):
            text = str(item.message)
            if text not in notes:
                notes.append(text)
        else:
            warnings.warn_explicit(item.message, item.category, item.filename, item.lineno)
