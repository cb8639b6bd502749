"""What a finished run says of its impacts: peaks that steps do not resolve or its end cuts off.

A peak force is the largest mean of a step.  Two things make it too low:

- *A narrow peak*: low restitution, a stiff stop, a film that closes fast.  A cubic through the
  impulse at the ends of the step and its neighbours has a parabola as its slope; where little is
  missing, its highest point is better by two orders in the step.
- *A film that is hardest at the moment of touch*, where the model ends it.  Its force rises by the
  same factor from step to step; the step that closes the contact tells how far away the touch is.

Where the needle swings on its stop until a load is taken away, the first impact depends on the
phase of that swing.  Steps of length ``h`` make each period ``T`` late by ``(2 pi h / T)^2 / 12``
of it, and steps in which the force rises and falls by ``(2 pi h / T)^4 / 720``.
"""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from math import exp, floor, isfinite, log, log10, nan, pi, sqrt

import numpy as np

from klack.arrays import Vector
from klack.hydraulics.pipe_friction import LAMINAR, laminar_doubts
from klack.network.accuracy import PROMISED
from klack.simulation.network_compile import CompiledNetwork
from klack.simulation.network_result import ImpactEvent, InterfaceRecord
from klack.simulation.wave_rows import wave_store
from klack.units import format_si

__all__ = ["cut_doubts", "impact_doubts", "late_by_swinging", "line_doubts", "missing_peak"]


_PEAK, _LATE = PROMISED["normal"]  # of a peak force, and of the time [s] of a first impact
_AIM = 0.7  # of that, for the step that is advised
_SHORTEST = 1e-9  # [s] shorter ones take too long
_FEWEST = 8  # steps of a contact; in fewer there is no peak to speak of
_RESOLVED = 100  # steps of a contact that is as short as those tell
_BESIDE = 5  # steps before and after a peak that may tell of it
_FIRST = 3  # impacts on a stop that people look at
_TRUSTED = 0.02  # of a narrow peak; where more is missing, three steps do not tell how much


def impact_doubts(
    events: Sequence[ImpactEvent],
    interfaces: Mapping[str, InterfaceRecord],
    step: float,
    rising: Collection[str] = (),
) -> Iterator[str]:
    """Sentences on the first complete impact on each stop that the steps do not resolve.

    That is, the peak misses 0.05 % or more, or the impact starts 0.05 us or more off, because the
    stop swung before.

    Parameters
    ----------
    step [s]
        Fine step.
    rising
        Stops whose force rises and falls within steps while they are closed.
    """
    seen = set[str]()
    for event in events:
        if event.stop in seen:
            continue
        seen.add(event.stop)
        record = interfaces[event.stop]
        since = _last(events, event.time)
        rises = event.stop in rising
        late, times, period = late_by_swinging(record, event.time, since, rises=rises)
        if late > _LATE:
            shorter = min(_rounded_down(step * sqrt(_AIM * _LATE / late)), step)
            yield (
                f"{_named(event)} depends on the steps: before leaving the stop the needle "
                f"oscillated on it {times} times, each {format_si(period, 's', 2)} long, and the "
                f"steps shift this by about {format_si(late, 's', 1)} in total. Try: run.step: "
                f"{format_si(shorter, 's', 3)}; or a restitution of the stop, which damps the "
                "oscillation."
            )
        if event.contact_time < _FEWEST * _step_at(record, event.peak_time):
            yield _unresolved(event, _step_at(record, event.peak_time))
            continue
        mean_alone = nan if rises else event.restitution
        share, at_touch, length = missing_peak(record, event.peak_time, mean_alone)
        if not share > _PEAK:
            continue
        aim = _AIM * _PEAK / share
        shorter = max(_rounded_down(step * (aim if at_touch else sqrt(aim))), _SHORTEST)
        shorter = min(shorter, step)
        cause = (
            "the film presses hardest at the moment of touch"
            if at_touch
            else "the force rises and falls within a few steps"
        )
        better = f"; or assume about {format_si(event.peak_force * (1.0 + share), 'N', 4)}"
        is_known = at_touch or share <= _TRUSTED
        yield (
            f"{_named(event)} is too low by {'about ' if is_known else ''}{100.0 * share:.2g} %"
            f"{'' if is_known else ' or more'}: {cause}, in steps of "
            f"{format_si(length, 's', 3)}. Try: run.step: {format_si(shorter, 's', 3)}"
            f"{better if is_known else ''}."
        )


def cut_doubts(events: Sequence[ImpactEvent]) -> Iterator[str]:
    """Sentences on impacts, the first three on each stop, whose peak the end of a run cuts off."""
    count = Counter[str]()
    for event in events:
        count[event.stop] += 1
        if event.grows and count[event.stop] <= _FIRST:
            yield (
                f"the run ends during impact {count[event.stop]} on '{event.stop}', "
                f"{format_si(event.contact_time, 's', 3)} after its first touch, while its force "
                f"grows: {format_si(event.peak_force, 'N', 4)} is not its peak, and contact time "
                "and impulse are not complete. Try: a longer run.duration."
            )


def _unresolved(event: ImpactEvent, step: float) -> str:
    shorter = max(_rounded_down(event.contact_time / _RESOLVED), _SHORTEST)
    return (
        f"{_named(event)} is not resolved: its contact lasts {event.contact_time / step:.0f} "
        f"{'step' if round(event.contact_time / step) == 1 else 'steps'} of "
        f"{format_si(step, 's', 3)}. Try: run.step: {format_si(shorter, 's', 3)}."
    )


def _last(events: Sequence[ImpactEvent], time: float) -> float:
    return max((event.time for event in events if event.time < time), default=0.0)


def _named(event: ImpactEvent) -> str:
    return (
        f"the peak force of the first impact on '{event.stop}', "
        f"{format_si(event.peak_force, 'N', 4)} at {format_si(event.peak_time, 's', 5)},"
    )


def _step_at(record: InterfaceRecord, time: float) -> float:
    """Length of the recorded step with this time [s]; 0 where none has it."""
    k = int(np.searchsorted(record.time, time, side="right")) - 1
    inside = k >= 0 and time <= record.time[k] + record.step[k]
    return float(record.step[k]) if inside and record.contact_force[k] > 0.0 else 0.0


def missing_peak(
    record: InterfaceRecord, peak_time: float, restitution: float = 0.0
) -> tuple[float, bool, float]:
    """How much the largest mean of a step misses of a peak.

    Parameters
    ----------
    peak_time [s]
        Middle of the step with the peak.
    restitution [-]
        Of the impact; nan where it is not over, or where its force rises and falls within steps.

    Returns
    -------
    share : float [-]
        Over the peak; 0 where the record does not tell.
    at_touch : bool
        Whether a film is hardest at the moment of touch.
    step : float [s]
        With the peak.
    """
    record = _about(record, peak_time)
    middle = record.time + 0.5 * record.step
    k = int(np.searchsorted(middle, peak_time - 1e-3 * float(np.min(record.step, initial=1.0))))
    if not 0 < k < len(middle) - 1:
        return 0.0, False, 0.0
    h, force = record.step, record.contact_force + record.film_force
    whole = _adjacent(record, k) and force[k] > 0.0
    share, at_touch = 0.0, False
    closing = k if record.contact_force[k] > 0.0 else k + 1
    if whole and closing > 1 and _closes(record, closing):
        share, at_touch = _at_touch(record, force, closing) / float(force[k]) - 1.0, True
    elif whole:
        near = slice(k - 1, k + 2)
        returned = min(restitution, 1.0) ** 2 if isfinite(restitution) else 0.0
        share = _highest(h[near], force[near], returned) / float(force[k]) - 1.0
    return max(share, 0.0), at_touch, float(h[k])


def late_by_swinging(
    record: InterfaceRecord, time: float, since: float = 0.0, *, rises: bool = False
) -> tuple[float, int, float]:
    """Delay [s] of the last contact before ``time``, a first touch, by its swings.

    None where that contact had ended before ``since`` [s], when a stop was touched.

    Parameters
    ----------
    rises
        Whether the force rises and falls within steps.

    Returns
    -------
    late : float [s]
    swings : int
        Of more than half of the largest.
    period : float [s]
        Their mean.
    """
    force = record.contact_force[: np.searchsorted(record.time, time)]
    closed = np.flatnonzero(force > 0.0)
    if not closed.size or record.time[closed[-1]] < since:
        return 0.0, 0, 0.0
    last = int(closed[-1])
    opened = np.flatnonzero(force[:last] <= 0.0)
    part = slice(int(opened[-1]) + 1 if opened.size else 0, last + 1)
    force, middle = force[part], (record.time + 0.5 * record.step)[part]
    turns = np.sign(np.diff(force))
    ends = np.flatnonzero(turns[1:] * turns[:-1] < 0.0) + 1
    if len(ends) < 3:
        return 0.0, 0, 0.0
    share = np.abs(np.diff(force[ends])) / (force[ends[1:]] + force[ends[:-1]])
    share = np.minimum(share, np.append(0.0, share[:-1]))  # rest before it is no swing
    periods = 2.0 * np.diff(middle[ends])
    step = record.step[part][ends[0] : ends[-1]]
    angle = 2.0 * pi * step / np.repeat(periods, np.diff(ends))
    shift = angle**4 / 720.0 if rises else angle**2 / 12.0
    each = share * np.add.reduceat(shift * step, ends[:-1] - ends[0])
    if not share.any():
        return 0.0, 0, 0.0
    swings = round(0.5 * float(np.sum(share > 0.5 * share.max())))
    return float(each.sum()), swings, float(np.average(periods, weights=share))


def _about(record: InterfaceRecord, time: float) -> InterfaceRecord:
    """Some steps about a time [s]; the first of all is behind one without force."""
    begin = max(int(np.searchsorted(record.time, time)) - _BESIDE, 0)
    columns = record.time, record.step, record.contact_force, record.film_force, record.gap
    at, step, contact, film, gap = (x[begin : begin + 2 * _BESIDE] for x in columns)
    if begin == 0:  # where a peak may be in it
        none = np.zeros(len(step[:1]))
        at, step, gap = (np.append(x[:1], x) for x in (at, step, gap))
        at[:1] -= step[:1]
        contact, film = np.append(none, contact), np.append(none, film)
    return replace(record, time=at, step=step, contact_force=contact, film_force=film, gap=gap)


def _adjacent(record: InterfaceRecord, k: int) -> bool:
    """Whether no step is missing between this one and its neighbours."""
    t, h = record.time[k - 1 : k + 2], record.step[k - 1 : k + 2]
    return bool(np.all(np.abs(t[1:] - t[:-1] - h[:-1]) <= 0.01 * h[:-1]))


def _closes(record: InterfaceRecord, k: int) -> bool:
    """Whether a contact closes in this step out of a film that rises until then."""
    contact, film = record.contact_force, record.film_force
    touches = contact[k - 1] == 0.0 and contact[k] > 0.0 and record.gap[k - 1] > record.gap[k]
    return bool(touches and contact[k - 2] == 0.0 and film[k - 1] > film[k - 2] > 0.0)


def _at_touch(record: InterfaceRecord, force: Vector, k: int) -> float:
    before, after, h = float(record.gap[k - 1]), float(record.gap[k]), record.step
    share = min(max(before / (before - after), 0.0), 1.0)
    growth = 2.0 * log(force[k - 1] / force[k - 2]) / (h[k - 2] + h[k - 1])
    return float(force[k - 1] * exp(growth * (0.5 * h[k - 1] + share * h[k])))


def _highest(h: Vector, mean: Vector, returned: float) -> float:
    """Highest force about three steps with these means [N]; ``returned``: share of the energy."""
    begin = 0.5 * h[1]  # time counts from the middle of the middle step
    edges = np.array([-begin - h[0], -begin, begin, begin + h[2]])
    moments = np.column_stack([np.diff(edges ** (n + 1)) / ((n + 1) * h) for n in range(3)])
    a, b, c = np.linalg.solve(moments, mean)
    if not c < 0.0:
        return float(mean[1])
    place = min(max(-0.5 * b / c, edges[0]), edges[3])
    return float(a + b * place + c * place**2 - returned * c * h[1] ** 2 / 6.0)


def _rounded_down(step: float) -> float:
    decade = 10.0 ** floor(log10(step))
    return max(n for n in (1.0, 2.0, 5.0) if n <= step / decade * (1.0 + 1e-9)) * decade


def line_doubts(network: CompiledNetwork, begin: float) -> Iterator[str]:
    """Sentences on all lines of a run that began at this time [s]."""
    rows, lines, state = network.rows, network.lines, network.line_state
    for k, row in enumerate(rows.lines):
        reynolds = LAMINAR * float(state.fastest[k]) / row.laminar_flow
        time = begin + lines.step * float(state.moment[k, 0])
        drop = row.resistance * float(state.fastest[k])
        yield from laminar_doubts(row.component, reynolds, time, drop)
    for k, wave in enumerate(rows.waves):
        _, _, reynolds, time = wave_store(network.waves, rows.waves, k)
        yield from wave.doubts(network.accounts.waves[k], float(reynolds), float(time))
