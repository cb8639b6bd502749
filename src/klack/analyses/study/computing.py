"""Points of one case on the threads of this process, those with the same bodies together.

Meshes, modes and contact laws are made once for all points that leave them as they are.  Every
point is computed from rest, by the very functions that compute a single run: its numbers depend
neither on who computes it nor on the other points.
"""

import threading
import warnings
from abc import abstractmethod
from collections import OrderedDict, deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import cache
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

from threadpoolctl import ThreadpoolController

from klack.analyses.study.asked_points import AskedPoints, PointGroup, PointRow, groups_of
from klack.case.points import case_at, with_changes
from klack.errors import InputError, KlackError
from klack.files.closing import Closing
from klack.machine.cores import available_cores
from klack.machine.progress import Progress, silent
from klack.machine.stages import FAILURES, show, warnings_of_threads
from klack.signals.sampled import TimeSeries

__all__ = [
    "Agenda",
    "Builds",
    "PointWorkers",
    "Stopped",
    "Tally",
    "ThreadWorkers",
    "compute_alone",
    "never_stopped",
    "on_threads",
    "sounds_of",
]


Item = TypeVar("Item")
Result = TypeVar("Result")

_LOOK = 0.2  # [s] between two looks for Ctrl-C: a wait without end lets none through on Windows


class Stopped(Exception):
    """A thread was asked to stop."""


def on_threads(
    items: Sequence[Item],
    compute: Callable[[Item, Callable[[], None]], Result],
    threads: int,
    keep: Callable[[Item, Result], None],
    tell: Callable[[], None],
) -> None:
    """Compute something for every item on threads.

    The processes of :mod:`klack.analyses.workers` each load klack and hold their own arrays.

    Parameters
    ----------
    compute
        Gets an item and a function to call now and then, which raises :class:`Stopped` once the
        work has been given up.  Must not raise anything else.
    keep
        Called in this thread with an item and its result, in the order of their end.
    tell
        Called after it.

    Raises
    ------
    BaseException
        Of ``tell``, or Ctrl-C: after all threads have ended and ``keep`` has got what they had
        finished.
    """
    left, answers = iter(items), SimpleQueue[tuple[Item, Result]]()
    guard, stop = threading.Lock(), threading.Event()

    def check() -> None:
        if stop.is_set():
            raise Stopped

    def work() -> None:
        while not stop.is_set():
            with guard:
                item = next(left, nothing)
            if item is nothing:
                return
            try:
                answers.put((item, compute(item, check)))  # type: ignore[arg-type]
            except Stopped:
                return

    nothing = object()
    crew = [threading.Thread(target=work) for _ in range(min(threads, len(items)))]
    open_items = len(items)
    try:
        for thread in crew:
            thread.start()
        while open_items and any(thread.is_alive() for thread in crew):
            if _taken(answers, keep, _LOOK):
                open_items -= 1
                tell()
    finally:
        stop.set()
        for thread in crew:
            if thread.ident is not None:
                thread.join()
        while _taken(answers, keep, 0.0):
            pass


def _taken(
    answers: "SimpleQueue[tuple[Item, Result]]",
    keep: Callable[[Item, Result], None],
    patience: float,
) -> bool:
    try:
        item, result = answers.get(timeout=patience) if patience else answers.get_nowait()
    except Empty:
        return False
    keep(item, result)
    return True


def never_stopped() -> None:
    """Check of work that nothing stops."""


@contextmanager
def one_thread_of_blas() -> Iterator[None]:
    """NumPy and SciPy on one thread each: points run side by side."""
    with _controller().limit(limits=1, user_api="blas"):
        yield


@cache  # it looks at all libraries of the process, which takes milliseconds
def _controller() -> ThreadpoolController:
    return ThreadpoolController()


class Agenda:
    """Hands out points, by their groups of the same bodies.

    A worker gets the next points of the bodies that it has; then bodies that no worker has begun
    with; then those that others have begun with the longest ago.
    """

    def __init__(self, groups: Sequence[Sequence[int]]) -> None:
        self._groups = [deque(group) for group in groups]
        self._open = deque(range(len(groups)))
        self._last: dict[object, int] = {}
        self.left = sum(map(len, self._groups))

    def take(self, worker: object = None, most: int = 1) -> tuple[int, ...]:
        """Next points for a worker, all with the same bodies; none if no point is left.

        ``worker`` is compared with those of other calls; None for one that has no bodies yet.
        """
        group = self._group_for(worker)
        if group is None:
            return ()
        if worker is not None:
            self._last[worker] = group
        left = self._groups[group]
        taken = tuple(left.popleft() for _ in range(min(most, len(left))))
        self.left -= len(taken)
        return taken

    def _group_for(self, worker: object) -> int | None:
        last = self._last.get(worker)
        if last is not None and self._groups[last]:
            return last
        while self._open:
            group = self._open.popleft()
            if self._groups[group]:
                self._open.append(group)
                return group
        return None


_STAGE = "points"


class Tally(Closing):
    """Hands rows on to ``keep`` as they come, and shows their warnings at the end, each once.

    ``wanted`` are those points, of the ``whole`` study, that are not known yet.
    """

    def __init__(
        self,
        whole: int,
        wanted: int,
        keep: Callable[[int, PointRow], None],
        progress: Progress,
    ) -> None:
        self._whole, self._done = whole, whole - wanted
        self._keep, self._progress = keep, progress
        self._others: dict[str, warnings.WarningMessage] = {}

    def __call__(self, place: int, row: PointRow) -> None:
        """Take the row of a point."""
        self._keep(place, row)
        self._done += 1
        self._others.update({str(item.message): item for item in row.others})

    def tell(self) -> None:
        """Report the share of the points that are done."""
        self._progress(_STAGE, self._done / self._whole)

    def close(self) -> None:
        """Show warnings that are no doubts."""
        show(self._others.values())


class Builds(Closing):
    """Bodies and laws of the latest groups."""

    def __init__(self) -> None:
        self._found: OrderedDict[tuple[object, ...], tuple[AskedPoints, Any]] = OrderedDict()

    def find(self, asked: AskedPoints, group: PointGroup) -> Any:
        """What a group needs, if it is there."""
        return self._found.get(self._key(asked, group), (None, None))[1]

    def keep(self, asked: AskedPoints, group: PointGroup, built: Any) -> None:
        """Keep it, and let go of the oldest."""
        key = self._key(asked, group)
        self._found[key] = asked, built
        self._found.move_to_end(key)
        while len(self._found) > asked.kind.builds:
            self._forget(*self._found.popitem(last=False)[1])

    def close(self) -> None:
        """Let go of all of them."""
        while self._found:
            self._forget(*self._found.popitem()[1])

    def _forget(self, asked: AskedPoints, built: Any) -> None:
        asked.kind.close(built)

    def _key(self, asked: AskedPoints, group: PointGroup) -> tuple[object, ...]:
        touched = tuple(key.place for key in asked.points.keys)
        return (id(asked.tree), asked.variant, touched, tuple(group.made.items()))


def compute_points(
    asked: AskedPoints,
    places: Iterable[int],
    keep: Callable[[int, PointRow], None],
    threads: int | None,
    progress: Progress,
    builds: Builds,
) -> int:
    """Compute some of the points, those with the same bodies one after another.

    Calls ``keep`` in this thread with each place and its row, in the order of their end, and
    returns how many were computed at a time, at most.  InputError where so many do not fit into the
    memory; Ctrl-C after finished rows have been kept.
    """
    wanted, most = list(places), 0
    tally = Tally(len(asked.points), len(wanted), keep, progress)
    with tally, one_thread_of_blas():
        for group in groups_of(asked, wanted):
            tally.tell()
            most = max(most, _run_group(asked, group, tally, threads, progress, builds))
    return most


def _run_group(
    asked: AskedPoints,
    group: PointGroup,
    tally: Tally,
    threads: int | None,
    progress: Progress,
    builds: Builds,
) -> int:
    built, left = builds.find(asked, group), group.places
    if built is None:
        built, left = _build(asked, group, tally, progress)
    if built is None:
        return 0
    builds.keep(asked, group, built)
    with warnings_of_threads() as taken:
        crew = asked.kind.crew(asked, built, left, threads)
        taken()
        on_threads(
            left,
            lambda i, check: asked.kind.row(asked, built, i, check, taken),
            crew,
            tally,
            tally.tell,
        )
    return crew


def compute_alone(asked: AskedPoints, builds: Builds) -> list[PointRow]:
    """Compute all points in this thread, one after another, from bodies that were made before.

    Warnings of the bodies go with the last row.
    """
    found: dict[int, PointRow] = {}
    with warnings.catch_warnings(record=True) as caught, one_thread_of_blas():
        warnings.simplefilter("always")
        for group in groups_of(asked, range(len(asked.points))):
            _run_alone(asked, group, found, builds)
    rows = [found[i] for i in range(len(found))]
    if caught and rows:
        rows[-1] = replace(rows[-1], others=(*rows[-1].others, *caught))
    return rows


def _run_alone(
    asked: AskedPoints, group: PointGroup, found: dict[int, PointRow], builds: Builds
) -> None:
    built, left = builds.find(asked, group), group.places
    is_new = built is None
    if built is None:
        built, left = _build(asked, group, found.__setitem__, silent)
    if built is None:
        return
    with warnings_of_threads() as taken:
        if is_new:
            try:
                asked.kind.crew(asked, built, left, 1)
            except InputError as error:  # the memory is full at this moment
                found.update(dict.fromkeys(left, replace(asked.failed(error), by_chance=True)))
                return
            taken()
            builds.keep(asked, group, built)
        for i in left:
            found[i] = asked.kind.row(asked, built, i, never_stopped, taken)


def _build(
    asked: AskedPoints, group: PointGroup, keep: Callable[[int, PointRow], None], progress: Progress
) -> tuple[Any, tuple[int, ...]]:
    """Bodies and laws for the first point that the case allows, and the points that are left.

    None if it allows none.  Points that cannot be computed have their rows.
    """
    tree = replace(asked.tree, data=with_changes(asked.tree.data, group.made))
    for k, i in enumerate(group.places):
        try:
            case = case_at(type(asked.case), tree, tree, asked.points.changes(i))
        except InputError as error:
            keep(i, asked.failed(error))
            continue
        left = group.places[k:]
        try:
            return asked.kind.build(asked, group, tree, case, progress), left
        except FAILURES as error:
            for place in left:
                keep(place, asked.failed(error))
            return None, ()
    return None, ()


def sounds_of(asked: AskedPoints, progress: Progress) -> tuple[TimeSeries | None, ...]:
    """Clicks of every point, computed once more."""
    found: list[TimeSeries | None] = [None] * len(asked.points)
    done = 0
    with warnings.catch_warnings(), one_thread_of_blas():
        warnings.simplefilter("ignore")  # the points have been computed, and their doubts told
        for group in groups_of(asked, range(len(found))):
            built, left = _build(asked, group, lambda place, row: None, silent)
            if built is None:
                continue
            for i in left:
                progress("sounds", done / len(found))
                with suppress(KlackError):
                    found[i] = asked.kind.pressure(asked, built, i)
                done += 1
            asked.kind.close(built)
    return tuple(found)


class PointWorkers(Closing):
    """Threads, processes or a cluster for points; closing ends them."""

    count: int
    """Points that are computed at a time."""
    words: str
    """What they are: ``threads``, ``processes``."""

    @abstractmethod
    def compute(
        self,
        asked: AskedPoints,
        places: Sequence[int],
        keep: Callable[[int, PointRow], None],
        progress: Progress,
    ) -> None:
        """Compute some of the points, and keep each row once, as :func:`compute_points` does.

        InputError where no point can be computed: the memory is too small, a file is missing there.
        """


class ThreadWorkers(PointWorkers):
    """Threads of this process, all cores by default: strokes run outside of the interpreter."""

    words = "threads"

    def __init__(self, threads: int | None = None) -> None:
        self._threads, self._builds, self._most = threads, Builds(), 0
        self.count = threads or available_cores()

    def compute(
        self,
        asked: AskedPoints,
        places: Sequence[int],
        keep: Callable[[int, PointRow], None],
        progress: Progress,
    ) -> None:
        """Compute some of the points; ``count`` becomes the number of threads."""
        most = compute_points(asked, places, keep, self._threads, progress, self._builds)
        self._most = max(self._most, most)
        self.count = self._most or self.count

    def close(self) -> None:
        """Forget the bodies."""
        self._builds.close()
