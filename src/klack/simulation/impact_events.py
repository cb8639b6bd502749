"""Impacts in a run: when, how fast, how hard, how long, and what was left."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from klack.network.rows import GROUND, BodyRow, InterfaceRow, Rows
from klack.simulation.network_result import ChannelData, ImpactEvent, InterfaceRecord

__all__ = ["impact_events"]

Vector = NDArray[np.float64]

_FILM_PAUSE = 100  # steps; a film is not recorded while its force passes through zero


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
    highest ones while it presses, and within two of these periods while it pulls.
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


def _effective_mass(bodies: Sequence[BodyRow | None]) -> float:
    inverse = sum(1.0 / b.body.mass for b in bodies if b is not None and b.body.rigid_count > 0)
    return 1.0 / inverse if inverse > 0.0 else np.inf


def _longest_period(bodies: Sequence[BodyRow | None]) -> float:
    """Longest period of the moving bodies; 0 for rigid ones."""
    longest = 0.0
    for body in bodies:
        if body is not None and body.body.rigid_count > 0:
            elastic = body.body.omega[body.body.rigid_count :]
            if len(elastic):
                longest = max(longest, 2.0 * np.pi / float(elastic[0]))
    return longest


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
    # a contact runs from a closed step to the next recorded open one: rests may lie between
    edges = np.diff(np.concatenate([[0], closed.astype(np.int8), [0]]))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1)
    begin = record.time[starts]
    stop = record.time[ends - 1] + record.step[ends - 1]
    open_ended = ends == len(closed)
    if open_ended[-1]:
        stop[-1] = np.nan
    period = _longest_period(bodies)
    clusters = _clusters(begin, stop, period, time, gap_rate)
    mass = _effective_mass(bodies)
    total = record.contact_force + record.film_force
    events = []
    for first, last in clusters:
        if begin[first] <= time[0] + record.step[starts[first]]:
            continue  # closed from the start
        t0, t1 = begin[first], stop[last]
        window = slice(_film_start(record, starts[first]), _film_end(record, ends[last]))
        felt = record.time[window.start]
        let_go = record.time[window.stop - 1] + record.step[window.stop - 1]
        before = -max(_fastest(felt, t0, time, -gap_rate), -_at(t0, time, gap_rate, earlier=True))
        if not before < 0.0:
            continue  # trembles while the stop is left: nothing was hit
        after = np.nan
        if np.isfinite(t1):
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
        events.append(
            ImpactEvent(
                stop=row.component,
                time=float(t0),
                approach_speed=-before,
                peak_force=float(force[peak]),
                peak_time=float(record.time[window][peak] + 0.5 * steps[peak]),
                contact_time=float(record.step[closed_steps].sum()),
                separation_time=float(t1),
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


def _film_end(record: InterfaceRecord, end: int) -> int:
    """First step after ``end`` that no longer feels the film that follows the contact."""
    i = end
    while i < len(record.time):
        gapless = record.time[i] - record.time[i - 1] < _FILM_PAUSE * record.step[i]
        if not gapless or record.contact_force[i] > 0.0:
            break
        i += 1
    return i


def _film_start(record: InterfaceRecord, first: int) -> int:
    """First step of the film force that leads into the contact at ``first``."""
    i = first
    while i > 0:
        gapless = record.time[i] - record.time[i - 1] < _FILM_PAUSE * record.step[i]
        if not gapless or record.contact_force[i - 1] > 0.0 or record.film_force[i - 1] <= 0.0:
            break
        i -= 1
    return i
