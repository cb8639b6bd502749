"""Sizes of the steps of a network, from the accuracy and what its parts allow."""

from dataclasses import dataclass, replace
from math import inf, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.errors import refuse_if
from klack.network.accuracy import ACCURACIES, Accuracy, fine_step
from klack.network.rows import LineRow, Rows
from klack.simulation.network_arrays import PARTS
from klack.simulation.rest import bounce_time
from klack.units import format_si

__all__ = ["StepSizes", "kinks", "largest_divisor", "scaled", "step_sizes"]

_MOST_COARSE = 256
_MIDDLE = 4  # fine steps of a sub-step while films are smooth
_OF_BOUNCE = 0.01  # such a sub-step over the time of an impact: 4e-5 of the peak force
_WHOLE = 1e-6  # of a step
_SHARP = 0.005  # of the range of a table: what a bend changes in it within a macro step
_MOST_KINKS = 32  # of a table; a noisy one has no steps of its own at each point


@dataclass(frozen=True, slots=True, kw_only=True)
class StepSizes:
    """Steps of a run.

    Parameters
    ----------
    step [s]
        Fine step of bodies, contacts and films.
    coarse
        Fine steps of a macro step in flight, after which elements and fluid answer; 1 for none.
    near
        Fine steps of a macro step about a touch; divides ``coarse``.
    middle
        Fine steps of a sub-step while films are smooth; divides ``near``.
    """

    step: float
    coarse: int
    near: int
    middle: int

    @property
    def seconds(self) -> tuple[float, ...]:
        """Lengths [s] in the order of the sizes of the time loop."""
        whole = (1, self.coarse, self.near, self.middle)
        return (*(count * self.step for count in whole), self.step / PARTS)


def step_sizes(
    rows: Rows, accuracy: Accuracy, *, step: float | None = None, coarse: int | None = None
) -> StepSizes:
    """Choose the steps for a network; ``step`` [s] and ``coarse`` replace those of the accuracy.

    Macro steps are as long as the accuracy has them, but no longer than any segment of a line; if
    possible a whole number of them makes the exchange interval of a row that has one.
    """
    refuse_if(
        accuracy not in ACCURACIES,
        "accuracy",
        got=repr(accuracy),
        expected="one of: " + ", ".join(ACCURACIES),
        hint="'normal' suits most cases; 'fine' takes about four times as long.",
    )
    refuse_if(
        coarse is not None and coarse < 1,
        "coarse",
        got=str(coarse),
        expected="1 or more",
        hint="1 switches macro steps off; without the key, klack chooses.",
    )
    h = fine_step(accuracy, step)
    chosen = _chosen(rows, ACCURACIES[accuracy][1], h) if coarse is None else coarse
    near = largest_divisor(chosen, max(1, chosen // 4))
    return StepSizes(step=h, coarse=chosen, near=near, middle=_middle(rows, h, near))


def scaled(rows: Rows, sizes: StepSizes, factor: float) -> StepSizes:
    """Sizes of steps all longer by a factor, whatever parts of the network ask for.

    Longer steps have fine sub-steps throughout, so that errors of sub-steps are not those of the
    run that they are compared with.  An exchange interval that would no longer hold whole steps
    raises InputError.
    """
    macro = sizes.coarse * sizes.step
    for interval in _intervals(rows):
        refuse_if(
            _is_whole(interval / macro) and not _is_whole(interval / (factor * macro)),
            "steps twice as long",
            got=f"an exchange every {format_si(interval, 's')}",
            expected=f"whole steps of {format_si(factor * macro, 's')} in it",
            hint="choose run.coarse to fit an even number of macro steps into the interval.",
        )
    return replace(sizes, step=factor * sizes.step, middle=1 if factor > 1.0 else sizes.middle)


def _intervals(rows: Rows) -> list[float]:
    found = [row.interval for row in rows.elements if row.interval is not None]
    return found + [row.period for row in rows.controllers]


def _chosen(rows: Rows, macro: float, h: float) -> int:
    """Fine steps of a macro step: a power of two, unless an exchange interval needs another."""
    longest = min([macro, *(_segment(line) for line in rows.lines)])
    longest = min([longest, *(wave.crossing for wave in rows.waves)])
    intervals = _intervals(rows)
    longest = min([longest, *intervals])
    most = min(int(longest / h * (1.0 + _WHOLE)), _MOST_COARSE)
    if most < 2:
        return 1
    for count in range(most, 1, -1):
        if intervals and all(_is_whole(interval / (count * h)) for interval in intervals):
            return count
    return 1 << (most.bit_length() - 1)


def kinks(rows: Rows, macro: float) -> NDArray[np.float64]:
    """Times [s] at which a table of forces or pressures bends sharply, then infinity.

    The macro steps of ``macro`` [s] that hold one are divided: a force within a step is a
    straight line.
    """
    tables: list[tuple[ArrayLike, ArrayLike]] = [row.table for row in rows.elements]
    tables += [(node.time, node.pressure) for node in rows.nodes.values() if node.prescribed]
    found = [np.array([inf])]
    for points, values in (map(np.asarray, table) for table in tables):
        if len(points) > 1:
            slope = np.concatenate([[0.0], np.diff(values) / np.diff(points), [0.0]])
            bend = np.abs(np.diff(slope)) * macro
            sharpest = np.argsort(-bend, kind="stable")[:_MOST_KINKS]
            sharp = sharpest[bend[sharpest] > _SHARP * np.ptp(values)]
            found.append(points[sharp])
    return np.unique(np.concatenate(found))


def _segment(line: LineRow) -> float:
    return line.delay / line.segments


def _is_whole(number: float) -> bool:
    return abs(number - round(number)) <= _WHOLE * number


def _middle(rows: Rows, h: float, near: int) -> int:
    shortest = inf
    for row, bodies in zip(rows.interfaces, rows.meeting, strict=True):
        if row.law is not None:
            sharper = sqrt(1.0 + 2.0 * row.law.flat().dissipation)  # in time, of a damped peak
            shortest = min(shortest, bounce_time(row, bodies) / sharper)
    most = min(_MIDDLE, near // 2, int(_OF_BOUNCE * min(shortest, 1.0) / h))
    return largest_divisor(near, max(1, most))


def largest_divisor(number: int, most: int) -> int:
    """Largest divisor of a number that is at most ``most``."""
    return next((size for size in range(most, 1, -1) if number % size == 0), 1)
