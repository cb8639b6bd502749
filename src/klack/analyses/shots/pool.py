"""Many shots on all cores: one process per core, one thread each."""

from collections.abc import Sequence

from klack.analyses.shots.draw import ShotDraw
from klack.analyses.shots.log import ShotLog
from klack.analyses.shots.one_shot import ShotOutcome, ShotSetup, run_shot
from klack.analyses.workers import Failure, WorkerDied, WorkerPool, answer, shared, unwrapped
from klack.errors import ConvergenceError
from klack.progress import Progress

__all__ = ["run_shots_on"]

_FEWEST = 3  # shots that make up for the start of a second process


def run_shots_on(
    workers: int, setup: ShotSetup, draws: Sequence[ShotDraw], log: ShotLog, progress: Progress
) -> None:
    """Run the shots missing in the log, and add them.

    The numbers do not depend on ``workers``: every shot is computed by one thread, from the same
    arrays.

    Raises
    ------
    InputError, ConvergenceError
        Of the first shot that fails; it is named.
    """
    left = [draw for draw in draws if draw.index not in log.done]
    total = len(draws)
    progress("shots", (total - len(left)) / total)
    workers = min(workers, len(left))
    if workers <= 1 or len(left) < _FEWEST:
        for draw in left:
            log.add(draw.index, unwrapped(_name(draw.index), _answer(setup, draw)))
            progress("shots", len(log.done) / total)
        return
    try:
        with WorkerPool(workers, setup) as pool:
            for draw, found in pool.completed(_run, left):
                log.add(draw.index, unwrapped(_name(draw.index), found))
                progress("shots", len(log.done) / total)
    except WorkerDied as error:
        raise ConvergenceError(
            f"shots: {error}; {len(log.done)} of {total} shots are finished.\n"
            "Try: fewer --workers if the memory was full; the same command resumes from here."
        ) from None


def _run(draw: ShotDraw) -> ShotOutcome | Failure:
    return _answer(shared(), draw)


def _answer(setup: ShotSetup, draw: ShotDraw) -> ShotOutcome | Failure:
    return answer(lambda: run_shot(setup, draw))


def _name(index: int) -> str:
    return f"shot {index}" if index >= 0 else "the centred shot"
