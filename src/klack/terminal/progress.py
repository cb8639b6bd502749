"""Progress of long work, from its first second; short work shows nothing."""

import json
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict
from functools import partial
from math import inf
from pathlib import Path
from time import monotonic
from typing import Any

from klack.machine.progress import PointCount, Progress, SoFar, silent

__all__ = ["CURVES_FILE", "PROGRESS_FILE", "show_progress"]

PROGRESS_FILE = "KLACK_PROGRESS_FILE"
"""Variable: file for the progress instead of the terminal."""

CURVES_FILE = "curves.json"
"""Beside that file: curves so far."""

_PATIENCE = 2.0  # s that a stage may take without a line
_LASTS = 5.0  # s after which a stage that has not ended is named
_AGAIN = 30.0  # s between two lines of a stage that lasts
_OFTEN = 0.2  # s between two lines of one stage in a file
_DRAWN = 1.0  # s between two drawings
_SHARE = 0.005  # of the time of a run that drawing may take
_COLUMNS = 300  # of a drawing
_SOON = 0.5  # s until the bar is there
_KINDS = {
    "klack:wait": "waiting while another process compiles",
    "numba:compile": "compiling (once)",
}
"""Events and words, the first active one wins."""


@contextmanager
def show_progress(quiet: bool = False) -> Iterator[Progress]:
    """Give a callback: bar on a terminal, line per stage elsewhere."""
    if file := os.environ.get(PROGRESS_FILE):
        yield _ToFile(Path(file))
    elif quiet:
        yield silent
    elif sys.stderr.isatty():
        with _bar() as bar:
            yield bar
    else:
        lines = _Lines()
        try:
            yield lines
        finally:
            lines.compiling.forget()
            lines.stop()
        lines.finish()


class _ToFile:
    """Stage, fraction, points and the seconds of earlier stages in a file, for ``klack app``."""

    def __init__(self, path: Path) -> None:
        self._path, self._stage, self._next = path, "", 0.0
        self._points: dict[str, Any] = {}
        self._since, self._spent = time.time(), dict[str, float]()
        self._draws = time.monotonic() + _DRAWN

    def counted(self, count: PointCount) -> None:
        """Points that go with the next stage or fraction."""
        self._points = {"points": asdict(count)}

    def __call__(self, stage: str, fraction: float) -> None:
        now = time.monotonic()
        if stage == self._stage and now < self._next:
            return
        if stage != self._stage:
            clock = time.time()
            ended = self._stage or "starting"
            self._spent[ended] = self._spent.get(ended, 0.0) + clock - self._since
            self._since = clock
        self._stage, self._next = stage, now + _OFTEN
        told = {"stage": stage, "fraction": fraction, "since": self._since, "spent": self._spent}
        self._write(self._path, told | self._points)

    def drawn(self, curves: Callable[[], Sequence[SoFar]]) -> None:
        """Curves so far, thinned; so rarely that the work is hardly slower for it."""
        if time.monotonic() < self._draws:
            return
        from klack.report.looks import thinned

        begin = time.monotonic()  # the import is once
        told = []
        for one in curves():
            x, y = thinned(one.x, one.y, columns=_COLUMNS)
            told.append(vars(one) | {"x": x.tolist(), "y": y.tolist()})
        self._write(self._path.with_name(CURVES_FILE), {"curves": told})
        end = time.monotonic()
        self._draws = end + max(_DRAWN, (end - begin) / _SHARE)

    @staticmethod
    def _write(path: Path, told: Any) -> None:
        new = path.with_suffix(".new")
        with suppress(OSError):  # the work goes on without being watched
            new.write_text(json.dumps(told), encoding="utf-8")
            new.replace(path)


class _Lines:
    """Lines on stderr for each stage that takes its time, and one if something is compiled.

    A stage is named when it has begun to last, again every 30 s with how far it is, and at its end.
    """

    def __init__(self) -> None:
        self.stage, self.start, self.fraction = "", time.perf_counter(), 0.0
        self.compiling = _Compiling(self._tell)
        self._told = {""}
        self._ended = threading.Event()
        threading.Thread(target=self._watch, daemon=True).start()

    def _watch(self) -> None:
        """Report what lasts, from a thread: long steps are silent for minutes."""
        stage, since, due = "", monotonic(), inf
        while not self._ended.wait(_OFTEN):
            now = monotonic()
            if self.stage != stage:
                stage, since, due = self.stage, now, now + _LASTS
            elif now > due:
                begins, due = due == since + _LASTS, now + _AGAIN
                far = f", {100 * self.fraction:.0f} %" if self.fraction else ""
                self._print(
                    f"{stage} ..." if begins else f"{stage}: {now - since:.0f} s so far{far}"
                )

    def _print(self, line: str) -> None:
        with suppress(OSError, ValueError):  # nobody listens any more
            print(line, file=sys.stderr, flush=True)

    def stop(self) -> None:
        self._ended.set()

    def _tell(self, words: str) -> None:
        if words not in self._told:
            self._told.add(words)
            print(f"{words}; 'klack warm' does this in advance", file=sys.stderr, flush=True)

    def __call__(self, stage: str, fraction: float) -> None:
        self.compiling.watch()
        if stage != self.stage:
            self.finish()
            self.stage, self.start = stage, time.perf_counter()
        self.fraction = fraction

    def remark(self, line: str) -> None:
        print(line, file=sys.stderr, flush=True)

    def finish(self) -> None:
        elapsed = time.perf_counter() - self.start
        if self.stage and elapsed > _PATIENCE:
            print(f"{self.stage}: {elapsed:.1f} s", file=sys.stderr, flush=True)


@contextmanager
def _bar() -> Iterator[Progress]:
    """Bar that shows itself: imports, compiling and meshing report little."""
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
    from rich.progress import Progress as RichProgress

    bar = RichProgress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=Console(stderr=True),
        transient=True,
    )
    now = "starting"
    task = bar.add_task(now, total=1.0)
    soon = threading.Timer(_SOON, bar.start)
    soon.daemon = True
    compiling = _Compiling(lambda words: bar.update(task, description=_described(now, words)))

    def update(stage: str, fraction: float) -> None:
        nonlocal now
        compiling.watch()
        if stage != now:
            now = stage
            bar.reset(task, description=_described(stage, compiling.words), total=1.0)
        bar.update(task, completed=min(max(fraction, 0.0), 1.0))

    # names of bodies may hold brackets, which rich would take for its own
    update.remark = partial(bar.console.print, markup=False)  # type: ignore[attr-defined]
    soon.start()
    try:
        yield update
    finally:
        compiling.forget()
        soon.cancel()
        soon.join()
        if bar.live.is_started:
            bar.stop()


def _described(stage: str, words: str) -> str:
    return f"{stage}: {words}" if words else stage


class _Compiling:
    """Detects when numba, or another process, compiles a function that is not cached.

    ``tell`` is called with the words for what begins, and with none when it is over.
    """

    def __init__(self, tell: Callable[[str], None]) -> None:
        self._tell, self._depth = tell, dict.fromkeys(_KINDS, 0)
        self._listener: Any = None

    @property
    def words(self) -> str:
        return next((_KINDS[kind] for kind, depth in self._depth.items() if depth), "")

    def watch(self) -> None:
        """Listen from now on, if numba is imported, which takes a second."""
        if self._listener is not None or "numba" not in sys.modules:
            return
        from numba.core import event

        outer = self

        class Listener(event.Listener):
            def on_start(self, event: Any) -> None:
                outer._count(event.kind, 1)

            def on_end(self, event: Any) -> None:
                outer._count(event.kind, -1)

        self._listener = Listener()
        for kind in _KINDS:
            event.register(kind, self._listener)

    def forget(self) -> None:
        if self._listener is not None:
            from numba.core import event

            for kind in _KINDS:
                event.unregister(kind, self._listener)

    def _count(self, kind: str, change: int) -> None:
        before = self.words
        self._depth[kind] += change
        if self.words != before:
            self._tell(self.words)
