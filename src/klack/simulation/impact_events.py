"""Impacts in a run: when, how fast, how hard, how long, and what was left."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from klack.network.rows import GROUND, BodyRow, InterfaceRow, Rows
from klack.simulation.network_result import ChannelData, ImpactEvent, InterfaceRecord
from klack.simulation.rest import effective_mass, longest_period, rest_time

__all__ = ["impact_events"]

Vector = NDArray[np.float64]

_PAUSE_STEPS = 100  # a film is not recorded while its force passes through zero: so many steps
_PAUSE_SHARE = 0.04  # or this share of the time to rest, whichever is longer


def impact_events(
    rows: Rows,
    time: Vector,
    channels: Mapping[str, ChannelData],
    interfaces: Mapping[str, InterfaceRecord],
) -> tuple[ImpactEvent, ...]:
    """Find the impacts on all interfaces, in order of time.

    Contacts that follow each other within the longest period of the two bodies are one impact, and
    so are contacts between which the centres of mass do not move apart.  Rigid bodies have no
    period; for it stands half the time of the shorter contact.  A contact that is closed at the
    start is none.  A film acts before the first touch and after the last one: the speeds are the
    highest ones while it presses, and within two of these periods while it pulls.  An impact whose
    last contact lasts until the bodies are at rest ends there; the stop is left later.
    """
    owner = {handle: row for row in rows.bodies for handle in row.ports}
    events: list[ImpactEvent] = []
    for row in rows.interfaces:
        bodies = tuple(owner[h] if h != GROUND else None for h in (row.upper, row.lower))
        speed = _gap_rate(bodies, time, channels)
        events += _of_interface(row, interfaces[row.component], bodies, time, speed)
    return tuple(sorted(events, key=lambda event: event.time))


def _gap_rate(
    bodies: Sequence[BodyRow | None], time: Vector, channels: Mapping[str, ChannelData]
) -> Vector:
    """Relative velocity of the centres of mass, above zero when the gap opens."""
    rate = np.zeros(len(time))
    for body, sign in zip(bodies, (1.0, -1.0), strict=True):
        if body is not None and f"{body.component} velocity" in channels:
            rate += sign * channels[f"{body.component} velocity"].values
    return rate


def _of_interface(
    row: InterfaceRow,
    record: InterfaceRecord,
    bodies: Sequence[BodyRow | None],
    time: Vector,
    gap_rate: Vector,
) -> list[ImpactEvent]:
    closed = record.contact_force > 0.0
    if not np.any(closed):
        return []
    # a contact runs from a closed step to the next recorded open one
    edges = np.diff(np.concatenate([[0], closed.astype(np.int8), [0]]))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    begin = record.time[starts]
    until = record.time[ends - 1] + record.step[ends - 1]
    stop = until.copy()
    open_ended = ends == len(closed)
    if open_ended[-1]:
        stop[-1] = np.nan
    period, rest = longest_period(bodies), rest_time(row, bodies)
    clusters = _clusters(begin, stop, period, time, gap_rate)
    mass = effective_mass(bodies)
    total = record.contact_force + record.film_force
    events = []
    for first, last in clusters:
        if begin[first] <= time[0] + record.step[starts[first]]:
            continue  # closed from the start
        t0, left = begin[first], stop[last]
        rests = [i for i in range(first, last + 1) if until[i] - begin[i] >= rest]
        if rests:  # the impact is over then
            last = rests[0]
            t1 = begin[last] + rest
        else:
            t1 = left
        end = int(np.searchsorted(record.time, t1)) if rests else ends[last]
        pause = _PAUSE_SHARE * rest
        window = slice(
            _film_start(record, starts[first], pause),
            end if rests else _film_end(record, end, pause),
        )
        felt = record.time[window.start]
        let_go = record.time[window.stop - 1] + record.step[window.stop - 1]
        before = -max(_fastest(felt, t0, time, -gap_rate), -_at(t0, time, gap_rate, earlier=True))
        if not before < 0.0:
            continue  # trembles while the stop is left: nothing was hit
        after = 0.0 if rests else np.nan
        if np.isfinite(t1) and not rests:
            leaving = _at(t1, time, gap_rate, earlier=False)
            soon = min(let_go, t1 + 2.0 * (period or t1 - begin[last]))
            after = max(_fastest(t1, soon, time, gap_rate), leaving)
        force, steps = total[window], record.step[window]
        peak = int(np.argmax(force))
        closed_steps = np.concatenate(
            [
                np.arange(s, e)
                for s, e in zip(starts[first : last + 1], ends[first : last + 1], strict=True)
            ]
        )
        closed_steps = closed_steps[closed_steps < end]
        events.append(
            ImpactEvent(
                stop=row.component,
                time=float(t0),
                approach_speed=-before,
                peak_force=float(force[peak]),
                peak_time=float(record.time[window][peak] + 0.5 * steps[peak]),
                contact_time=float(record.step[closed_steps].sum()),
                separation_time=float(left),
                impulse=float(force @ steps),
                restitution=-after / before,
                energy_loss=0.5 * mass * (before**2 - after**2),
            )
        )
    return events


def _at(t: float, time: Vector, rate: Vector, *, earlier: bool) -> float:
    """Rate at ``t`` from the two nearest records on one side, before or after the contact."""
    if earlier:
        i = int(np.searchsorted(time, t, side="right")) - 1
        j = i - 1
    else:
        i = int(np.searchsorted(time, t, side="left"))
        j = i + 1
    if not 0 <= i < len(time):
        return np.nan
    if not 0 <= j < len(time):
        return float(rate[i])
    return float(rate[i] + (rate[i] - rate[j]) / (time[i] - time[j]) * (t - time[i]))


def _clusters(
    begin: Vector, stop: Vector, period: float, time: Vector, gap_rate: Vector
) -> list[tuple[int, int]]:
    """First and last contact of each impact; it lasts until the centres of mass move apart."""
    groups = [[0, 0]]
    for i in range(1, len(begin)):
        shorter = np.fmin(stop[i - 1] - begin[i - 1], stop[i] - begin[i])
        near = begin[i] - stop[i - 1] < (period or 0.5 * shorter)
        if near or _fastest(stop[i - 1], begin[i], time, gap_rate) <= 0.0:
            groups[-1][1] = i
        else:
            groups.append([i, i])
    return [(a, b) for a, b in groups]


def _fastest(begin: float, end: float, time: Vector, speed: Vector) -> float:
    """Highest speed in the records between two times; -infinity without any."""
    first, last = np.searchsorted(time, (begin, end))
    return float(np.max(speed[int(first) : int(last)], initial=-np.inf))


def _film_end(record: InterfaceRecord, end: int, pause: float) -> int:
    """First step after ``end`` that no longer feels the film that follows the contact."""
    i = end
    while i < len(record.time):
        longest = max(pause, _PAUSE_STEPS * record.step[i])
        gapless = record.time[i] - record.time[i - 1] < longest
        if not gapless or record.contact_force[i] > 0.0:
            break
        i += 1
    return i


def _film_start(record: InterfaceRecord, first: int, pause: float) -> int:
    """First step of the film force that leads into the contact at ``first``."""
    i = first
    while i > 0:
        longest = max(pause, _PAUSE_STEPS * record.step[i])
        gapless = record.time[i] - record.time[i - 1] < longest
        if not gapless or record.contact_force[i - 1] > 0.0 or record.film_force[i - 1] <= 0.0:
            break
        i -= 1
    return i
