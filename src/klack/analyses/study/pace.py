"""Lines about a long evaluation of points: how many, how fast, how much longer."""

from time import perf_counter

from klack.progress import PointCount, Progress, counted, remark

__all__ = ["Pace", "duration_text"]

_FIRST, _LONGEST = 5.0, 60.0  # [s] until the first line, and between later ones


class Pace:
    """Tells now and then how an evaluation of points gets on.

    Parameters
    ----------
    progress : Progress
    most : int
        Points that will have been asked for at the end.
    """

    def __init__(self, progress: Progress, most: int) -> None:
        self._progress, self._most = progress, most
        self._begin = self._last = perf_counter()
        self._wait = _FIRST

    def tell(self, done: int, computed: int, best: str = "") -> bool:
        """A line, unless the last one was just now; whether there was one.

        Parameters
        ----------
        done : int
            Points that have their values.
        computed : int
            Of them computed since the begin; the others were there.
        best : str
            The best one so far, in words.
        """
        now = perf_counter()
        rate = computed / max(now - self._begin, 1e-9)
        left = (self._most - done) / rate if computed else None
        counted(self._progress, PointCount(done=done, most=self._most, left=left, best=best))
        if now - self._last < self._wait or done >= self._most:
            return False
        self._last, self._wait = now, min(2.0 * self._wait, _LONGEST)
        text = f"{done} of {self._most} points"
        if left is not None:
            text += f", {3600.0 * rate:.3g} in an hour"
            text += f", {duration_text(left)} left"
        remark(self._progress, f"{text}; {best}" if best else text)
        return True


def duration_text(seconds: float) -> str:
    """``1 h 40 min``, ``5 min``, ``40 s``: to two digits or so."""
    if seconds < 100.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60} min"
