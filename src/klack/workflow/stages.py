"""Watching a long run: how long each stage takes, and what it warns of."""

import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from time import perf_counter

from klack.cache.result_cache import ResultCache
from klack.errors import AccuracyWarning
from klack.workflow.progress import Progress

__all__ = ["FROM_CACHE", "LIBRARIES", "StageClock", "collected_warnings", "from_cache"]

LIBRARIES = ("numpy", "scipy", "numba", "netgen-mesher")
"""Distributions whose versions belong to a result."""

FROM_CACHE = "from the cache"
"""Ends the name of a stage whose results were computed by a run before."""


def from_cache(stage_times: Mapping[str, float]) -> tuple[str, ...]:
    """Stages of a run whose results came from the cache, all of them or in part."""
    whole, part = f", {FROM_CACHE}", f", partly {FROM_CACHE}"
    return tuple(
        name.removesuffix(whole) if name.endswith(whole) else f"{name.removesuffix(part)} (partly)"
        for name in stage_times
        if name.endswith(FROM_CACHE)
    )


class StageClock:
    """Passes progress on and measures how long each stage takes, and what it took from the cache.

    Parameters
    ----------
    progress : callable
    cache : ResultCache, optional
    """

    def __init__(self, progress: Progress, cache: ResultCache | None = None) -> None:
        self._progress, self._cache = progress, cache
        self._served, self._missed = self._counts()
        self._answers: dict[str, list[int]] = {}
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
        served, missed = self._counts()
        if self._stage:
            answers = self._answers.setdefault(self._stage, [0, 0])
            answers[0] += served - self._served
            answers[1] += missed - self._missed
        self._served, self._missed = served, missed

    def _counts(self) -> tuple[int, int]:
        if self._cache is None:
            return 0, 0
        return self._cache.served.total(), self._cache.missed.total()

    def spent(self, stages: Sequence[str]) -> float:
        """Seconds in these stages so far."""
        self._book()
        return sum(self._times.get(stage, 0.0) for stage in stages)

    def times(self) -> dict[str, float]:
        """Seconds per stage; its name tells when its results came from the cache."""
        self._book()
        return {f"{stage}{self._source(stage)}": time for stage, time in self._times.items()}

    def _source(self, stage: str) -> str:
        served, missed = self._answers.get(stage, (0, 0))
        if not served:
            return ""
        return f", partly {FROM_CACHE}" if missed else f", {FROM_CACHE}"


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
