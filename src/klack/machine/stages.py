"""Stages of a long run: times and warnings."""

import threading
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from time import perf_counter
from typing import Any, TextIO, TypeVar

import numpy as np

from klack.errors import AccuracyWarning, InputError, KlackError
from klack.machine.cache.result_cache import ResultCache
from klack.machine.progress import PointCount, Progress, SoFar, counted, drawn, remark

Found = TypeVar("Found")

__all__ = [
    "FAILURES",
    "WITH_CACHED",
    "StageClock",
    "collected_warnings",
    "for_comparison",
    "show",
    "stages_with_cached",
    "trial",
    "warnings_of",
    "warnings_of_threads",
]

FAILURES = (KlackError, np.linalg.LinAlgError, MemoryError)
"""Errors of a calculation that are not internal errors."""

WITH_CACHED = ", with cached results"
"""Suffix of a stage that used earlier results."""


def stages_with_cached(stage_times: Mapping[str, float]) -> tuple[str, ...]:
    """Stages that used the cache."""
    return tuple(
        name.removesuffix(WITH_CACHED) for name in stage_times if name.endswith(WITH_CACHED)
    )


class StageClock:
    """Passes progress on; measures times and cached results of stages."""

    def __init__(self, progress: Progress, cache: ResultCache | None = None) -> None:
        self._progress, self._cache = progress, cache
        self._served, self._helped = self._count(), set[str]()
        self._stage, self._since = "", perf_counter()
        self._times: dict[str, float] = {}

    def __call__(self, stage: str, fraction: float) -> None:
        """Report the progress of a stage."""
        if stage != self._stage:
            self._book()
            self._stage = stage
        self._progress(stage, fraction)

    def remark(self, line: str) -> None:
        """Pass a line of text on."""
        remark(self._progress, line)

    def counted(self, count: PointCount) -> None:
        """Pass a count of points on."""
        counted(self._progress, count)

    def drawn(self, curves: Callable[[], Sequence[SoFar]]) -> None:
        """Pass curves so far on."""
        drawn(self._progress, curves)

    def _book(self) -> None:
        now = perf_counter()
        if self._stage:
            self._times[self._stage] = self._times.get(self._stage, 0.0) + now - self._since
        self._since = now
        served = self._count()
        if self._stage and served > self._served:
            self._helped.add(self._stage)
        self._served = served

    def _count(self) -> int:
        return 0 if self._cache is None else self._cache.served.total()

    def spent(self, stages: Sequence[str]) -> float:
        """Seconds in these stages so far."""
        self._book()
        return sum(self._times.get(stage, 0.0) for stage in stages)

    def times(self) -> dict[str, float]:
        """Seconds per stage; names show cached results."""
        self._book()
        return {
            f"{stage}{WITH_CACHED if stage in self._helped else ''}": time
            for stage, time in self._times.items()
        }


_of_threads: dict[int, list[warnings.WarningMessage]] | None = None


@contextmanager
def warnings_of_threads() -> Iterator[Callable[[], list[warnings.WarningMessage]]]:
    """Collect warnings of each thread apart from those of the others.

    Yields a function: warnings of the thread that calls it, since it called last.  Within, only
    :func:`trial` may catch warnings: their filters belong to the whole process.
    """
    global _of_threads
    before = _of_threads
    caught: dict[int, list[warnings.WarningMessage]] = {}

    def keep(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        mine = caught.setdefault(threading.get_ident(), [])
        mine.append(warnings.WarningMessage(message, category, filename, lineno, file, line))

    def taken() -> list[warnings.WarningMessage]:
        return caught.pop(threading.get_ident(), [])

    with warnings.catch_warnings():
        warnings.simplefilter("always")
        original: Any = warnings.showwarning
        warnings.showwarning = keep
        _of_threads = caught
        try:
            yield taken
        finally:
            _of_threads = before
            warnings.showwarning = original


@contextmanager
def collected_warnings() -> Iterator[list[str]]:
    """Collect accuracy warnings as notes, each once; show others as usual."""
    notes: list[str] = []
    with trial() as caught:
        yield notes
    for item in caught:
        if issubclass(item.category, AccuracyWarning):
            text = str(item.message)
            if text not in notes:
                notes.append(text)
        else:
            warnings.warn_explicit(item.message, item.category, item.filename, item.lineno)


@contextmanager
def trial() -> Iterator[list[warnings.WarningMessage]]:
    """Keep the warnings of a trial; :func:`show` shows those that count.

    Within :func:`warnings_of_threads` those of this thread alone.
    """
    caught = _of_threads
    if caught is None:
        with warnings.catch_warnings(record=True) as kept:
            warnings.simplefilter("always")
            yield kept
        return
    thread, mine = threading.get_ident(), list[warnings.WarningMessage]()
    before = caught.pop(thread, None)
    caught[thread] = mine
    try:
        yield mine
    finally:
        del caught[thread]
        if before is not None:
            caught[thread] = before


def show(caught: Iterable[warnings.WarningMessage]) -> None:
    """Show warnings that a :func:`trial` has kept."""
    for item in caught:
        warnings.warn_explicit(item.message, item.category, item.filename, item.lineno)


def for_comparison(what: str, compute: Callable[[], Found]) -> Found | None:
    """Compute something used only for comparison: a failure warns and returns None.

    ``what`` is left out then; it begins the sentence of the warning.
    """
    try:
        return compute()
    except InputError as error:
        reason = error.got  # not where: a key that the case may not have
    except FAILURES as error:
        reason = str(error) or type(error).__name__
    warnings.warn(
        f"{what}, which is computed only for comparison, was left out: {reason}",
        AccuracyWarning,
        stacklevel=2,
    )
    return None


@contextmanager
def warnings_of(run: str) -> Iterator[None]:
    """Begin accuracy warnings with their run."""
    with trial() as caught:
        yield
    for item in caught:
        text: Warning | str = item.message
        if issubclass(item.category, AccuracyWarning):
            text = f"{run}: {item.message}"
        warnings.warn_explicit(text, item.category, item.filename, item.lineno)
