"""Times of opening and closing."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite

import numpy as np
from numpy.typing import NDArray

from klack.network.ranges import Travel
from klack.network.rows import Rows
from klack.simulation.network_result import ImpactEvent, NetworkResult

__all__ = ["LiftTimes", "Passage", "all_lift_times", "lift_times"]

Vector = NDArray[np.float64]
Closes = Callable[[ImpactEvent, tuple[str, ...]], bool]

_MOVED = 0.1  # share of the lift at which a motion begins and ends
_LEAST = 0.01  # share of the lift between stops that is worth times of its own
_NO_LIFT = 1e-8  # [m] less is the elasticity of what is closed


@dataclass(frozen=True, kw_only=True)
class Passage:
    """One passage between the ends of a lift; None where the run does not reach it.

    Parameters
    ----------
    at_10, at_50, at_90 [s]
        From time zero, that of the first run in a series; at shares of the lift: 0 closed, 1 open.
    stop
        End stop, or empty.
    touch [s]
        First contact there, unless a film cushions it; where several stops in a row end the lift,
        the one that closes the last of them.
    """

    at_10: float | None = None
    at_50: float | None = None
    at_90: float | None = None
    stop: str = ""
    touch: float | None = None

    @property
    def moves(self) -> bool:
        """Whether it passes anything."""
        return any(time is not None for time in (self.at_10, self.at_50, self.at_90, self.touch))


@dataclass(frozen=True, kw_only=True)
class LiftTimes:
    """Opening and closing of one body in a run.

    Parameters
    ----------
    starts
        ``"closed"`` or ``"open"``: the nearer end of the lift at the start.  A valve that starts
        open closes first, and its opening is the one after that.
    lift [m]
        Between both ends; None if nothing moved.
    between_stops
        Whether stops end the lift; else it counts to the furthest place of the run, without a stop
        or with less than 10 % of the way to it.
    """

    body: str
    starts: str
    lift: float | None
    between_stops: bool
    opening: Passage
    closing: Passage

    @property
    def in_order(self) -> tuple[tuple[str, Passage], ...]:
        """Both motions, the first one first."""
        both = (("opening", self.opening), ("closing", self.closing))
        return both if self.starts == "closed" else both[::-1]


def all_lift_times(
    result: NetworkResult, rows: Rows, needle: str, point: str, seat: str = ""
) -> tuple[LiftTimes, ...]:
    """Times of the needle first, then of every other body that stops hold on both sides.

    ``point`` is the port of the needle whose displacement is the lift, ``seat`` the stop that it
    closes where that is none of those at the end of its travel.
    """
    travel = Travel.of(rows)
    found = []
    for row in sorted(rows.bodies, key=lambda row: row.component != needle):
        is_needle = row.component == needle
        port = point if is_needle else row.names[0]
        displacement = result.channels[f"{row.component}.{port} displacement"].values
        (low, high), stops = travel.lift(row.component, float(displacement[0]))
        if is_needle and seat and seat not in stops[0]:
            stops = ((seat,), stops[1])
        if row.body.rigid_count == 0 or not (
            is_needle or (isfinite(high - low) and high - low > _NO_LIFT)
        ):
            continue
        found.append(
            lift_times(
                result.time,
                displacement,
                result.events,
                body=row.component,
                ends=(low, high),
                stops=stops,
                gaps={
                    stop: result.channels[f"{stop} gap"].values for side in stops for stop in side
                },
                goes_on=result.start is None,
            )
        )
    return tuple(found)


def lift_times(
    time: Vector,
    displacement: Vector,
    events: Sequence[ImpactEvent],
    *,
    body: str,
    ends: tuple[float, float],
    stops: tuple[tuple[str, ...], tuple[str, ...]],
    gaps: Mapping[str, Vector] | None = None,
    goes_on: bool = False,
) -> LiftTimes:
    """Times of one body: the first stroke that passes 90 % of its lift, else the longest one.

    A stroke begins where 10 % of the lift from the end at rest are passed, and ends where the body
    comes back below them; between two records the displacement is a straight line.  In a run that
    continues another one, the stroke that is under way at its start comes before longer ones.

    Parameters
    ----------
    time (n,) [s]
    displacement (n,) [m]
        Along +z, the direction of opening.
    ends [m]
        Closed and open; infinite without a stop.
    stops
        That end the lift on either side, first the one that stands.
    gaps (n,) [m]
        Of stops, where several end the lift.
    goes_on
        Whether the run begins where another one has ended.
    """
    closed, opened = ends
    free = not (isfinite(closed) and isfinite(opened))
    low = closed if isfinite(closed) else float(displacement.min())
    high = opened if isfinite(opened) else float(displacement.max())
    if high - low <= _NO_LIFT:
        return LiftTimes(
            body=body,
            starts="closed",
            lift=None,
            between_stops=not free,
            opening=Passage(stop="".join(stops[1][:1])),
            closing=Passage(stop="".join(stops[0][:1])),
        )
    share = (displacement - low) / (high - low)
    is_open = bool(share[0] > 0.5)
    moved = float(np.max(1.0 - share if is_open else share))
    if not free and _LEAST <= moved < _MOVED:  # a relief valve that its stop never ends
        free = True
        used = moved * (high - low)
        low, high = (high - used, high) if is_open else (low, low + used)
        share = (displacement - low) / (high - low)
    rest, far = stops[::-1] if is_open else stops

    def closes(event: ImpactEvent, row: tuple[str, ...]) -> bool:
        others = [gaps[stop] for stop in row if gaps and stop != event.stop]
        return all(np.interp(event.time, time, gap) <= 0.0 for gap in others)

    way = 1.0 - share if is_open else share
    away, back = _stroke(time, way, events, (rest, far), closes, goes_on=goes_on)
    if is_open:  # passed 10 % from the open end: 90 % of the lift
        away, back = _mirrored(away), _mirrored(back)
    return LiftTimes(
        body=body,
        starts="open" if is_open else "closed",
        lift=high - low,
        between_stops=not free,
        opening=back if is_open else away,
        closing=away if is_open else back,
    )


def _stroke(
    time: Vector,
    share: Vector,
    events: Sequence[ImpactEvent],
    ends: tuple[tuple[str, ...], tuple[str, ...]],
    closes: Closes,
    *,
    goes_on: bool,
) -> tuple[Passage, Passage]:
    """Away from the end at rest, and back; ``ends`` are the stops there and at the other end."""
    rest, far = ends
    outside = np.concatenate(([False], share >= _MOVED, [False]))
    edges = np.flatnonzero(outside[1:] != outside[:-1])
    strokes = [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    if not strokes:
        return Passage(stop="".join(far[:1])), Passage(stop="".join(rest[:1]))
    peaks = [float(share[a:b].max()) for a, b in strokes]
    whole = [i for i, peak in enumerate(peaks) if peak >= 1.0 - _MOVED]
    under_way = goes_on and strokes[0][0] == 0
    first, end = strokes[whole[0] if whole else 0 if under_way else int(np.argmax(peaks))]
    inside = share[first:end]
    top = first + int(np.argmax(inside >= 1.0 - _MOVED) if whole else np.argmax(inside))

    def leaving(level: float) -> float | None:
        k = first + int(np.argmax(inside >= level))
        return _crossing(time, share, k - 1, level) if k > 0 and share[k] >= level else None

    def returning(level: float) -> float | None:
        at = np.flatnonzero(inside >= level)
        k = first + int(at[-1]) if at.size else time.size
        return _crossing(time, share, k, level) if k + 1 < time.size else None

    until = float(time[end]) if end < time.size else np.inf
    there = _touch(events, far, float(time[max(first - 1, 0)]), until, closes)
    home = _touch(events, rest, float(time[top]), np.inf, closes)
    away = Passage(
        at_10=leaving(0.1),
        at_50=leaving(0.5),
        at_90=leaving(0.9),
        stop=there.stop if there else "".join(far[:1]),
        touch=there.time if there else None,
    )
    back = Passage(
        at_10=returning(0.1),
        at_50=returning(0.5),
        at_90=returning(0.9),
        stop=home.stop if home else "".join(rest[:1]),
        touch=home.time if home else None,
    )
    return away, back


def _mirrored(motion: Passage) -> Passage:
    return Passage(
        at_10=motion.at_90,
        at_50=motion.at_50,
        at_90=motion.at_10,
        stop=motion.stop,
        touch=motion.touch,
    )


def _crossing(time: Vector, share: Vector, k: int, level: float) -> float:
    part = (level - share[k]) / (share[k + 1] - share[k])
    return float(time[k] + part * (time[k + 1] - time[k]))


def _touch(
    events: Sequence[ImpactEvent],
    stops: tuple[str, ...],
    after: float,
    until: float,
    closes: Closes,
) -> ImpactEvent | None:
    """First impact that closes all stops in a row."""
    for event in events:
        if event.stop in stops and after <= event.time <= until and closes(event, stops):
            return event
    return None
