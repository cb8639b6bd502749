"""Show that long work goes on, without a word about short work."""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

__all__ = ["Progress", "show_progress"]

_PATIENCE = 2.0  # s


class Progress(Protocol):
    """What a long calculation is given to report with."""

    def __call__(self, stage: str, fraction: float) -> None:
        """Say what is going on; ``fraction`` of this stage is done, from 0 to 1."""
        ...


@contextmanager
def show_progress(quiet: bool = False) -> Iterator[Progress]:
    """Give a callback that draws a bar on a terminal and writes a line per stage elsewhere."""
    if quiet:
        yield lambda stage, fraction: None
    elif sys.stderr.isatty():
        with _bar() as bar:
            yield bar
    else:
        lines = _Lines()
        yield lines
        lines.finish()


class _Lines:
    """One line on stderr for each stage that took its time."""

    def __init__(self) -> None:
        self.stage, self.start = "", time.perf_counter()

    def __call__(self, stage: str, fraction: float) -> None:
        if stage != self.stage:
            self.finish()
            self.stage, self.start = stage, time.perf_counter()

    def finish(self) -> None:
        """Report the stage that ends, if it took long."""
        elapsed = time.perf_counter() - self.start
        if self.stage and elapsed > _PATIENCE:
            print(f"{self.stage}: {elapsed:.1f} s", file=sys.stderr, flush=True)


@contextmanager
def _bar() -> Iterator[Progress]:
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as RichProgress

    bar = RichProgress(
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        transient=True,
    )
    task = bar.add_task("", total=1.0)
    begun, shown, current = time.perf_counter(), False, ""

    def update(stage: str, fraction: float) -> None:
        nonlocal shown, current
        if not shown and time.perf_counter() - begun > _PATIENCE:
            bar.start()
            shown = True
        if stage != current:
            bar.reset(task, description=stage, total=1.0)
            current = stage
        bar.update(task, completed=min(max(fraction, 0.0), 1.0))

    try:
        yield update
    finally:
        if shown:
            bar.stop()
