"""Impacts in a run: when, how fast, how hard, how long, and what was left.

:class:`ImpactFinder` finds them during the run with a few numbers per interface, so its memory
does not grow with time.  Where the run is cut into parts changes nothing, not even the last bit.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import isfinite, nan
from typing import Any

import numpy as np

from klack.arrays import Matrix, Vector
from klack.machine.compiling.jit import inner, njit
from klack.network.rows import Rows
from klack.simulation.network_interfaces import FORCE_ROUND_OFF
from klack.simulation.network_result import ChannelData, ImpactEvent, InterfaceRecord
from klack.simulation.rest import (
    effective_mass,
    longest_period,
    mobility,
    port_mobility,
    rest_time,
)

__all__ = ["ROTATION", "ImpactFinder", "judged"]


_PAUSE_STEPS = 100  # a film is not recorded while its force passes through zero: so many fine steps
_PAUSE_SHARE = 0.04  # or this share of the time to rest, whichever is longer
_STRIKES = 1e-6  # [m/s] closing speed at the start: less is rest
_BEND = 0.25  # of what other forces do between two records: more from one to the next is a jump

_KNOWN = 3.0  # of the records after a contact: none is needed
_BESIDES = 0.01  # of the change of speed by an impact: more by another stop, and it is not its own
_TURNED = 0.1  # of the energy of approach: more into or out of rotation, and a speed tells nothing

ROTATION = "rotation"
"""What acts besides where bodies turn."""

_PART = ("impulse", "peak", "peak_time")
_STATE = np.dtype(
    [
        (name, np.float64)
        for name in (
            # the run: its start, the end of the last step with a force, and the last record
            *("run_start", "row_end", "time", "rate"),
            # impulse of the interface since then; what all other forces did before it
            *("carried", "span", "trend", "bend"),
            # film that may lead into a contact
            *("lead", "lead_fastest", *(f"lead_{part}" for part in _PART)),
            # the contact that is closed now
            *(
                "closed",
                "begin",
                "until",
                "steps",
                "rests",
                "before",
                "touch",
                "from_start",
                "opened",
            ),
            *("news", *(f"contact_{part}" for part in _PART)),
            # the impact that it may belong to: all contacts before it
            *("impact", "first", "impact_before", "impact_touch", "impact_from_start"),
            *("impact_steps", "impact_rests", "stop", "last", "impact_news"),
            *(f"impact_{part}" for part in _PART),
            # what followed the last contact of this impact
            *("tail", *(f"tail_{part}" for part in _PART), *(f"flight_{part}" for part in _PART)),
            *("between", "between_earlier", "candidate", "fastest"),
            *("leaves", "leave_time0", "leave_rate0", "leave_time1", "leave_rate1"),
        )
    ]
)
_EVENT = ("time", "before", "touch", "after", "peak", "peak_time", "steps", "stop", "impulse")


class ImpactFinder:
    """Finds the impacts on all interfaces of a network.

    Contacts that follow each other within the longest period of the two bodies are one impact, and
    so are contacts between which the centres of mass (of levers the faces) do not move apart.  For
    rigid bodies half the time of the shorter contact stands for that period.  A contact that is
    closed at the start is no impact, unless a body has a speed towards it.  A film acts before the
    first touch and after the last one: the speeds are the highest ones while it presses, and within
    two of these periods while it pulls.  An impact whose last contact lasts until the bodies are at
    rest ends there.

    Where a step does not know the speed of the gap at its start, it follows between two records
    from the impulse of the interface itself, step by step (a film stops a body within less than
    their spacing); all other forces change evenly.

    Parameters
    ----------
    start [s]
        Of the run.
    step [s]
        The shortest of the run, but for parts of one that is cut.
    """

    def __init__(self, rows: Rows, start: float, step: float) -> None:
        met = list(zip(rows.interfaces, rows.meeting, strict=True))
        self._stops = [row.component for row in rows.interfaces]
        self._period = [longest_period(bodies) for _, bodies in met]
        self._mass = [effective_mass(*pair) for pair in met]
        self._mobility = [mobility(*pair) for pair in met]
        self._rest = [rest_time(*pair) for pair in met]
        self._state = np.zeros(len(self._stops), dtype=_STATE)
        for name in ("row_end", "time"):
            self._state[name] = -np.inf
        self._state["run_start"] = start
        self._pause = _PAUSE_STEPS * step
        self._found: list[ImpactEvent] = []

    @property
    def state(self) -> Vector:
        """State of unfinished impacts, shape (interfaces, n), to continue from."""
        return self._state.copy().view(np.float64).reshape(len(self._stops), _STATE.itemsize // 8)

    @state.setter
    def state(self, values: Vector) -> None:
        self._state = np.ascontiguousarray(values, dtype=float).copy().view(_STATE).reshape(-1)

    def feed(self, time: Vector, rates: Matrix, steps: Sequence[Vector]) -> None:
        """Take in what followed in the run.

        Parameters
        ----------
        time (n,) [s]
            After the last time that was fed.
        rates (interfaces, n) [m/s]
            Speed of each gap, positive when it opens: of the centres of mass, or of the faces of
            levers and of bodies that follow a course.
        steps (k, 6)
            Per interface, of every step in which it carried force: start, length [s], contact
            force, film force [N], gap [m], speed of the gap at the start [m/s], needed where the
            contact is open or closes; nan where not known.
        """
        for c, (rate, rows) in enumerate(zip(rates, steps, strict=True)):
            out = np.empty((len(rows) // 2 + 2, len(_EVENT)))
            pause = max(_PAUSE_SHARE * self._rest[c], self._pause)
            count = _feed(
                *(self._state, c, self._period[c], self._rest[c], pause, self._mobility[c]),
                *(rows, time, rate, out),
            )
            self._found += [self._event(c, row) for row in out[:count]]

    def events(self, channels: Mapping[str, ChannelData]) -> tuple[ImpactEvent, ...]:
        """All impacts so far, in order of time, complete or not.

        An unfinished one is reported again, whole, by a finder that resumes from :attr:`state`,
        with the same stop and time.  Impacts no harder than the round-off of the largest force in
        the ``channels`` are left out.
        """
        forces = [np.abs(data.values).max() for data in channels.values() if data.unit == "N"]
        least = FORCE_ROUND_OFF * float(max(forces, default=0.0))
        out = np.empty((2, len(_EVENT)))
        open_ones: list[ImpactEvent] = []
        for c in range(len(self._stops)):
            count = _unfinished(self._state, c, self._period[c], out)
            open_ones += [self._event(c, row) for row in out[:count]]
        found = sorted((*self._found, *open_ones), key=lambda event: event.time)
        return tuple(event for event in found if not event.peak_force <= least)

    @property
    def settled(self) -> tuple[ImpactEvent, ...]:
        """Impacts since the last report that nothing can change any more: another one came."""
        return tuple(self._found)

    def told(self) -> None:
        """Mark all impacts so far as reported; only those that change are reported again."""
        self._found.clear()
        self._state["news"] = self._state["impact_news"] = 0.0

    def _event(self, c: int, row: Vector) -> ImpactEvent:
        found = dict(zip(_EVENT, row.tolist(), strict=True))
        before, after = found["before"], found["after"]
        return ImpactEvent(
            stop=self._stops[c],
            time=found["time"],
            approach_speed=-before,
            touch_speed=max(-found["touch"], 0.0),
            peak_force=found["peak"],
            peak_time=found["peak_time"],
            contact_time=found["steps"],
            separation_time=found["stop"],
            impulse=found["impulse"],
            restitution=-after / before,
            energy_loss=0.5 * self._mass[c] * (before**2 - after**2),
        )


def judged(
    events: Sequence[ImpactEvent],
    rows: Rows,
    interfaces: Mapping[str, InterfaceRecord],
    until: float,
    before: Vector,
    turning: Mapping[str, tuple[Vector, Vector]],
) -> tuple[tuple[ImpactEvent, ...], Vector]:
    r"""Impacts without restitution and energy loss where more than they change the motion.

    Both compare the motion of two bodies before and after their impact, and mean something where
    this impact alone changes it.  From first touch to the end of the last contact another stop
    changes the relative speed by :math:`J' \mu'`, of its impulse and the mobility of the body that
    both share; 1 % of what the impact itself changes, :math:`J \mu`, is too much.  Bodies that turn
    keep energy which the speeds of their centres do not show: a tenth of that of the approach is
    too much.

    Limits: other forces (springs, pressures, magnets) count as part of the impact; where the fine
    record of a stop is full, what it does is not known, and nothing is blanked for it.

    Parameters
    ----------
    until [s]
        End of the run.
    before (stops, 2 + stops)
        What the run before found of its last impact on each stop: its time, the impulse of each
        stop since then, and the energy that went into rotation; shape (0, 0) for none.
    turning
        Times [s] and energies of rotation [J], of components that may turn.

    Returns
    -------
    events
    after
        The same for a run that continues this one.
    """
    stops = {row.component: c for c, row in enumerate(rows.interfaces)}
    share = np.zeros((len(stops), len(stops)))
    meeting: list[set[str]] = []
    masses = []
    for c, (row, sides) in enumerate(zip(rows.interfaces, rows.meeting, strict=True)):
        meeting.append({side.component for side in sides if side is not None})
        masses.append(effective_mass(row, sides))
        own = mobility(row, sides)
        for k, other in enumerate(rows.interfaces):
            if k != c and own > 0.0:
                shared = [
                    abs(port_mobility(face, pushed, side))
                    for face, side in zip((row.upper, row.lower), sides, strict=True)
                    for pushed in (other.upper, other.lower)
                    if side is not None and pushed in side.ports
                ]
                share[c, k] = sum(shared) / own
    after = before.copy()
    if not before.size:
        after = np.column_stack([np.full(len(stops), -np.inf), 0.0 * share, np.zeros(len(stops))])
    found = []
    for event in events:
        c = stops[event.stop]
        end = min(x for x in (event.separation_time, until) if x == x)
        if event.restitution == 0.0:
            end = min(end, event.time + event.contact_time)  # up to rest
        impulses = np.array(
            [
                _impulse(interfaces[stop], event.time, end) if share[c, k] else 0.0
                for stop, k in stops.items()
            ]
        )
        turned = sum(_turned(*turning[name], event.time, end) for name in meeting[c] & set(turning))
        if before.size and before[c, 0] == event.time:
            impulses += before[c, 1:-1]
            turned += before[c, -1]
        after[c] = (event.time, *impulses, turned)
        most = _BESIDES * abs(event.impulse)
        besides = [stop for stop, k in stops.items() if share[c, k] * abs(impulses[k]) > most]
        if abs(turned) > _TURNED * 0.5 * masses[c] * event.approach_speed**2:
            besides.append(ROTATION)
        if besides and isfinite(event.restitution):
            found.append(
                replace(event, restitution=nan, energy_loss=nan, besides=", ".join(besides))
            )
        else:
            found.append(event)
    return tuple(found), after


def _turned(time: Vector, energy: Vector, begin: float, end: float) -> float:
    """Energy that the rotation of a body takes up between two times [J]."""
    first = max(int(np.searchsorted(time, begin, side="right")) - 1, 0)
    last = min(int(np.searchsorted(time, end)), len(time) - 1)
    return float(energy[last] - energy[first])


def _impulse(record: InterfaceRecord, begin: float, end: float) -> float:
    """Of contact and film between two times [N s]; the force is even within a step."""
    first = int(np.searchsorted(record.time, begin, side="right")) - 1
    part = slice(max(first, 0), int(np.searchsorted(record.time, end)))
    start, step = record.time[part], record.step[part]
    inside = np.maximum(np.minimum(start + step, end) - np.maximum(start, begin), 0.0)
    return float(np.sum((record.contact_force[part] + record.film_force[part]) * inside))


@njit
def _feed(
    state: Any,
    c: int,
    period: float,
    rest: float,
    pause: float,
    mobility: float,
    rows: Any,
    times: Vector,
    rates: Vector,
    out: Any,
) -> int:
    """Steps and records in order of time; a record precedes the step that starts then."""
    s = state[c]
    count, place = 0, 0
    for i in range(rows.shape[0]):
        t, h, contact, film = rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3]
        while place < times.size and times[place] <= t:
            _record(s, period, mobility, times[place], rates[place])
            place += 1
        closing = _closing(s, mobility, t, h, contact, film, rows[i, 5])
        if contact > 0.0:
            _closed_step(s, rest, pause, t, h, contact + film, closing)
        else:
            if s.closed > 0.0:
                count += _contact_over(s, period, mobility, t, rows[i, 5], out, count)
            _open_step(s, period, pause, t, h, film, closing)
            s.carried += film * h
        s.row_end = t + h
    while place < times.size:
        _record(s, period, mobility, times[place], rates[place])
        place += 1
    return count


@inner
def _record(s: Any, period: float, mobility: float, time: float, rate: float) -> None:
    if s.time > -np.inf:
        before, had_one = s.trend, s.span > 0.0
        s.span = time - s.time
        s.trend = (rate - s.rate - mobility * s.carried) / s.span
        if had_one:  # a jump of another force does not go on
            most = _BEND * abs(s.trend)
            s.bend = max(-most, min(most, s.trend - before)) / s.span
    s.time, s.rate, s.carried = time, rate, 0.0
    if s.closed > 0.0:
        return
    if s.lead > 0.0:
        s.lead_fastest = max(s.lead_fastest, -rate)
    if s.impact > 0.0:
        _after_contact(s, period, mobility, time, rate)


@inner
def _rate_at(s: Any, mobility: float, time: float) -> float:
    """Speed of the gap after the last record: by the interface, and by all other forces.

    These changed it at the mean rate ``trend`` in the middle of the last interval, ``bend`` more
    per time since then.
    """
    if s.time == -np.inf:
        return np.inf
    late = time - s.time
    trend = s.trend + 0.5 * s.bend * (s.span + late)
    return float(s.rate + mobility * s.carried + trend * late)


@inner
def _closing(
    s: Any, mobility: float, t: float, h: float, contact: float, film: float, opening: float
) -> float:
    """Closing speed of a gap at the start of a step, the highest in one that is open."""
    if np.isfinite(opening):
        return -opening  # the next step tells of its end
    begin = _rate_at(s, mobility, t)
    if contact > 0.0:
        return -begin
    return -min(begin, _rate_at(s, mobility, t + h) + mobility * film * h)


@inner
def _after_contact(s: Any, period: float, mobility: float, time: float, rate: float) -> None:
    """Speed of the gap after the last contact of an impact, and what it were without its film."""
    s.between_earlier = s.between
    s.between = max(s.between, rate)
    pull = s.last
    if period > 0.0:
        pull = period
    if s.tail > 0.0 and time < s.stop + 2.0 * pull:
        s.candidate = max(s.candidate, rate)
    free = rate - mobility * (s.tail_impulse + s.flight_impulse)
    if s.leaves == 0.0:
        s.leave_time0, s.leave_rate0 = time, free
    elif s.leaves == 1.0:
        s.leave_time1, s.leave_rate1 = time, free
    if s.leaves < 2.0:
        s.leaves += 1.0
        s.impact_news = 1.0


@inner
def _closed_step(
    s: Any, rest: float, pause: float, t: float, h: float, force: float, closing: float
) -> None:
    if s.closed == 0.0:
        if not t - s.row_end < pause:
            s.lead = 0.0
        s.closed, s.begin = 1.0, t
        s.steps = s.rests = 0.0
        s.contact_impulse, s.contact_peak, s.contact_peak_time = 0.0, -np.inf, t
        at_start = t <= s.run_start + h and not closing > _STRIKES
        s.from_start = 1.0 if at_start else 0.0
        s.touch = -closing
        if s.lead > 0.0:
            closing = max(closing, s.lead_fastest)
        s.before = -closing
        # the speed at the moment of touch is that of the approach
        s.opened = s.between_earlier if s.time == t else s.between
    s.until = t + h
    s.carried += force * h
    if s.rests == 0.0:
        s.contact_impulse += force * h
        if force > s.contact_peak:
            s.contact_peak, s.contact_peak_time = force, t + 0.5 * h
        s.steps += h
        s.news = 1.0
        if s.until - s.begin >= rest:
            s.rests = 1.0


@inner
def _contact_over(
    s: Any, period: float, mobility: float, t: float, opening: float, out: Any, count: int
) -> int:
    """End the contact at ``t``: part of the impact so far, or the start of the next one.

    Where the speed at that moment is not known it follows from two records after it.
    """
    s.until = t
    emitted = 0
    if s.impact > 0.0 and not _joins(s, period, t - s.begin):
        emitted = _emit(s, out, count)
        s.impact = 0.0
    _merge(s)
    s.closed = 0.0
    s.stop, s.last = t, t - s.begin
    s.lead = 0.0
    s.impact_news = 1.0
    s.tail = 1.0
    s.tail_impulse, s.tail_peak = 0.0, -np.inf
    s.flight_impulse, s.flight_peak = 0.0, -np.inf
    s.between = s.between_earlier = s.candidate = s.fastest = -np.inf
    s.leaves = 0.0
    if np.isfinite(opening):
        s.leaves, s.leave_rate0 = _KNOWN, opening
    if s.time == t:
        _after_contact(s, period, mobility, t, s.rate)
    return emitted


@inner
def _joins(s: Any, period: float, duration: float) -> bool:
    """Whether the present contact belongs to the impact before it."""
    if s.opened <= 0.0:
        return True
    pause = period
    if period == 0.0:
        pause = 0.5 * min(s.last, duration)
    return bool(s.begin - s.stop < pause)


@inner
def _merge(s: Any) -> None:
    """Add the present contact to the impact, or begin one with it and its film."""
    if s.impact == 0.0:
        s.impact, s.first = 1.0, s.begin
        s.impact_before, s.impact_touch = s.before, s.touch
        s.impact_from_start = s.from_start
        s.impact_rests = s.impact_steps = s.impact_impulse = 0.0
        s.impact_peak, s.impact_peak_time = -np.inf, s.begin
        if s.lead > 0.0:
            s.impact_impulse = s.lead_impulse
            s.impact_peak, s.impact_peak_time = s.lead_peak, s.lead_peak_time
    elif s.impact_rests > 0.0:
        return  # it was over before
    else:
        _add_tail(s)
        s.impact_impulse += s.flight_impulse
        if s.flight_peak > s.impact_peak:
            s.impact_peak, s.impact_peak_time = s.flight_peak, s.flight_peak_time
    s.impact_impulse += s.contact_impulse
    if s.contact_peak > s.impact_peak:
        s.impact_peak, s.impact_peak_time = s.contact_peak, s.contact_peak_time
    s.impact_steps += s.steps
    s.impact_rests = s.rests


@inner
def _add_tail(s: Any) -> None:
    s.impact_impulse += s.tail_impulse
    if s.tail_peak > s.impact_peak:
        s.impact_peak, s.impact_peak_time = s.tail_peak, s.tail_peak_time


@inner
def _open_step(
    s: Any, period: float, pause: float, t: float, h: float, film: float, closing: float
) -> None:
    """Film between two contacts: the end of one impact, the beginning of another, or both."""
    gapless = t - s.row_end < pause
    if s.impact > 0.0 and s.impact_rests == 0.0:
        if not gapless:
            s.tail = 0.0
        if s.tail > 0.0:
            s.tail_impulse += film * h
            if film > s.tail_peak:
                s.tail_peak, s.tail_peak_time = film, t + 0.5 * h
            s.fastest = max(s.fastest, s.candidate)
            s.impact_news = 1.0
        else:
            s.flight_impulse += film * h
            if film > s.flight_peak:
                s.flight_peak, s.flight_peak_time = film, t + 0.5 * h
    if film <= 0.0:
        s.lead = 0.0
        return
    if s.lead == 0.0 or not gapless:
        s.lead = 1.0
        s.lead_fastest = -np.inf
        s.lead_impulse, s.lead_peak = 0.0, -np.inf
    s.lead_fastest = max(s.lead_fastest, closing)
    s.lead_impulse += film * h
    if film > s.lead_peak:
        s.lead_peak, s.lead_peak_time = film, t + 0.5 * h


@inner
def _emit(s: Any, out: Any, count: int) -> int:
    """Write the impact as a row of ``_EVENT``; 0 if there is none, or nothing new."""
    if s.impact_from_start > 0.0 or s.impact_news == 0.0:
        return 0
    if not s.impact_before < 0.0:
        return 0  # trembles while the stop is left: nothing was hit
    impulse, peak, peak_time = s.impact_impulse, s.impact_peak, s.impact_peak_time
    after = 0.0
    if s.impact_rests == 0.0:
        if np.isfinite(s.stop):
            impulse += s.tail_impulse
            if s.tail_peak > peak:
                peak, peak_time = s.tail_peak, s.tail_peak_time
        after = np.nan
        if s.leaves > 0.0:
            after = s.leave_rate0
            if s.leaves == 2.0:
                slope = (s.leave_rate1 - s.leave_rate0) / (s.leave_time1 - s.leave_time0)
                after += slope * (s.stop - s.leave_time0)
            after = max(after, s.fastest)
    speeds = (s.impact_before, s.impact_touch, after)
    event = (s.first, *speeds, peak, peak_time, s.impact_steps, s.stop, impulse)
    for j, value in enumerate(event):
        out[count, j] = value
    return 1


@njit
def _unfinished(state: Any, c: int, period: float, out: Any) -> int:
    """Unfinished impacts as if nothing followed; the state stays."""
    copy = state[c : c + 1].copy()
    s = copy[0]
    count = 0
    if s.closed > 0.0:
        news = max(s.news, 0.0)
        # how long it will last is not known: as long as the contact before it
        if s.impact > 0.0 and not _joins(s, period, np.inf):
            count += _emit(s, out, count)
            s.impact = 0.0
        if s.impact > 0.0:
            news = max(news, s.impact_news)
        _merge(s)
        s.impact_news = news
        s.stop = np.nan
        s.leaves = 0.0
    if s.impact > 0.0:
        count += _emit(s, out, count)
    return count
