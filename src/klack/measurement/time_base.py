"""How uniform a stored time is, and how it is brought onto one uniform time.

Stored times jitter with the clock, by few digits, or by lost samples. Rounding makes steps of two
lengths only.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, refuse_if

__all__ = ["TimeBase", "survey_time", "uniform_step"]


Vector = NDArray[np.float64]

_BLOCK = 1 << 20
_UNIFORM = 0.01  # of a step
_GAP = 1.5  # steps
_LARGE_GAP = 5.5  # steps: more than five samples lost
_LENGTHS = 6  # distinct lengths of steps that are kept


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeBase:
    """Channel times, compared with ``start + step * k``.

    Parameters
    ----------
    start, end [s]
        Of the first and last sample.
    step [s]
        Mean of a uniform time, median of an uneven one.
    uniform
        Samples can be taken as they are.
    note
        What is not perfect, to follow the names of channels.
    marks (m,) [s]
        Every 2^20th sample, to find windows of uneven times.
    """

    start: float
    end: float
    step: float
    count: int
    uniform: bool
    note: str = ""
    marks: Vector

    def moved(self, later: float) -> "TimeBase":
        """The same samples, ``later`` [s]."""
        return replace(
            self, start=self.start + later, end=self.end + later, marks=self.marks + later
        )

    def samples(self, begin: float, end: float) -> tuple[int, int]:
        """Samples that cover ``begin`` to ``end``, and a few more."""
        if self.uniform:
            first = int(np.floor((begin - self.start) / self.step)) - 1
            last = int(np.ceil((end - self.start) / self.step)) + 2
        else:
            first = (int(np.searchsorted(self.marks, begin, "right")) - 1) * _BLOCK - 1
            last = int(np.searchsorted(self.marks, end, "left")) * _BLOCK + 2
        return max(first, 0), min(max(last, 0), self.count)


def survey_time(
    read: Callable[[int, int], Vector], count: int, where: str, place: Callable[[int], str]
) -> TimeBase:
    """Go through a stored time once, in blocks.

    Rejects a time that stands still, goes back, has no value, or leaves out more than five
    samples.

    Parameters
    ----------
    read
        Times [s] of samples first to before last.
    place
        A sample in words.
    """
    refuse_if(
        count < 2,
        where,
        got=f"{count} sample",
        expected="at least two",
        hint="check that the file was exported completely.",
    )
    start, end = float(read(0, 1)[0]), float(read(count - 1, count)[0])
    step = (end - start) / (count - 1)
    marks, lengths = [], set[float]()
    deviation, longest, usual, previous, widest = 0.0, 0.0, step, np.empty(0), 0
    for first in range(0, count, _BLOCK):
        time = read(first, min(first + _BLOCK, count))
        steps = np.diff(np.concatenate((previous, time)))
        _check_order(steps, time, first, where, place)
        if first == 0:
            usual = float(np.median(steps))
        marks.append(float(time[0]))
        previous = time[-1:]
        uniform = start + step * np.arange(first, first + time.size)
        deviation = max(deviation, float(np.max(np.abs(time - uniform))) / step)
        if float(np.max(steps, initial=0.0)) / usual > longest:
            longest = float(np.max(steps)) / usual
            widest = first + int(np.argmax(steps)) + time.size - steps.size
        if len(lengths) <= _LENGTHS:
            lengths.update(np.unique(np.round(steps / usual, 4)).tolist()[: _LENGTHS + 1])
    base = TimeBase(
        start=start, end=end, step=step, count=count, uniform=True, marks=np.array(marks)
    )
    if deviation <= _UNIFORM:
        return base
    if longest > _LARGE_GAP:
        raise InputError(
            where,
            got=f"a gap of {longest * usual:.3g} s in its time before {place(widest)}, with steps "
            f"of {usual:.3g} s",
            expected="gaps of at most five samples",
            hint="export the parts between the gaps into separate files or channels.",
        )
    if _two_lengths(sorted(lengths)) and deviation < 1.0 and longest < _GAP:
        return replace(base, note="the time in the file is rounded and is taken as uniform.")
    what = "leaves out samples" if longest > _GAP else "jitters"
    note = (
        f"time {what} (longest step {longest:.2f} times the usual step); resampled by linear "
        "interpolation."
    )
    return replace(base, step=usual, uniform=False, note=note)


def _check_order(
    steps: Vector, time: Vector, first: int, where: str, place: Callable[[int], str]
) -> None:
    """Reject constant, decreasing, missing or endless times."""
    wrong = np.flatnonzero(~((steps > 0) & (steps < np.inf)))
    if wrong.size == 0:
        return
    k = int(wrong[0]) + time.size - steps.size
    came = f"{time[k]:.9g} s" if np.isfinite(time[k]) else "no value"
    raise InputError(
        where,
        got=f"a time that does not increase: {came} at {place(first + k)}",
        expected="times that increase from sample to sample",
        hint="correct it, or write each stroke into its own file or channel; a table whose time "
        "restarts is cut if all parts are alike.",
    )


def _two_lengths(lengths: list[float]) -> bool:
    """True if steps have two lengths, by rounding."""
    return len(lengths) <= _LENGTHS and np.count_nonzero(np.diff(lengths) > 2e-3) == 1


_JITTER = 0.01
"""Largest deviation of a sample from a uniform axis, in steps."""


def uniform_step(time: NDArray[np.float64], where: str) -> float:
    """Step of a uniform time axis [s].

    Rejects a time more than 1 % of a step beside the uniform axis, or not rising.

    Parameters
    ----------
    time (n,) [s]
        Two at least.
    """
    n = time.size
    step = float(time[-1] - time[0]) / (n - 1) if time.ndim == 1 and n > 1 else 0.0
    refuse_if(
        not step > 0.0,
        where,
        got=f"{n} times from {time[0] if n else 0:g} s",
        expected="at least two ascending times",
        hint="check the time channel and its unit.",
    )
    worst = float(np.max(np.abs(time - time[0] - step * np.arange(n)))) / step
    if not worst <= _JITTER:  # also nan
        raise InputError(
            where,
            got=f"samples up to {worst:.2g} steps off a uniform axis",
            expected="uniform sampling",
            hint="interpolate the record to one step first.",
        )
    return step
