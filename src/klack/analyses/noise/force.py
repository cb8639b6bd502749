"""The force of every stop as one uniform series that keeps each impulse.

A stroke records the force of a stop in every fine step near an impact, and as means over longer
records all the time.  Both are joined on the grid of the fine steps: fine steps as they are, and in
the rest of a record the impulse that is left over from its mean.

Forces of magnets and fluid on the housing are not among them.  Three billion fine steps make a
minute: of a long stroke as much is followed as fits into memory and time.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from klack.acoustics.spectrum import force_series
from klack.arrays import Floats, Index
from klack.contact.history import ImpactHistory
from klack.errors import refuse_if
from klack.machine.compiling.jit import njit
from klack.machine.memory import in_words, require_memory
from klack.signals.sampled import TimeSeries
from klack.simulation.network_result import ChannelData, ImpactEvent, InterfaceRecord, NetworkResult
from klack.units import format_si

__all__ = [
    "before_impact",
    "first_part",
    "impact_force",
    "interrupted_impact",
    "stop_force",
    "stop_forces",
]


_MOST_STEPS = 20_000_000  # fine steps: 0.4 s of 20 ns
_PER_STEP = 250.0  # bytes at most while one body is followed, all stops together


def first_part(result: NetworkResult, most: int = _MOST_STEPS) -> tuple[NetworkResult, str]:
    """Cut a run off after so many fine steps; with words for that, empty if it is short enough.

    An impact that the cut leaves without its end is one in which the run ends.  InputError if all
    impacts come later, a single record is longer, or it does not fit into the memory.
    """
    spacing = float(result.time[1] - result.time[0])
    size, records = round(spacing / result.step), result.time.size - 1
    count = min(records, most // size)
    _require_memory(count * size)
    if count == records:
        return result, ""
    length, whole = format_si(most * result.step, "s"), float(result.time[-1] - result.time[0])
    end = float(result.time[count])
    events = tuple(event for event in result.events if event.time < end)
    refuse_if(
        not events and (result.events or not count),
        "noise of a stroke",
        got=f"a run of {format_si(whole, 's')} with records of {format_si(spacing, 's')} and "
        f"no impact in its first {length}",
        expected=f"impacts within {length}, {most:,} fine steps",
        hint="shorten the time before the first actuation, use a shorter record or a longer "
        "step, or continue from a run that ends just before it (klack stroke --continue).",
    )
    note = (
        f"Only the first {format_si(end - float(result.time[0]), 's')} of the run of "
        f"{format_si(whole, 's')} are evaluated, with {len(events)} of its {len(result.events)} "
        "impacts: forces, energies and sound refer to this part. For a later part run the "
        "stroke up to it, continue with klack stroke --continue for a few ms, and evaluate the "
        "noise of the continuation."
    )
    cut = replace(
        result,
        time=result.time[: count + 1],
        channels={
            name: ChannelData(unit=data.unit, values=data.values[: count + 1])
            for name, data in result.channels.items()
        },
        interfaces={name: _before(record, end) for name, record in result.interfaces.items()},
        events=tuple(
            event if event.separation_time <= end else replace(event, separation_time=np.nan)
            for event in events
        ),
    )
    return cut, note


def _before(record: InterfaceRecord, end: float) -> InterfaceRecord:
    count = int(np.searchsorted(record.time, end))
    return InterfaceRecord(
        time=record.time[:count],
        step=record.step[:count],
        contact_force=record.contact_force[:count],
        film_force=record.film_force[:count],
        gap=record.gap[:count],
        complete=record.complete or count < record.time.size,
    )


def _require_memory(steps: int) -> None:
    require_memory(
        "noise of a stroke",
        _PER_STEP * steps,
        what=f"a force in {steps:,} fine steps",
        hint="run a shorter stroke, or free memory; "
        f"{steps // 10:,} steps need {in_words(0.1 * _PER_STEP * steps)}.",
    )


_AT_REST = 0.05  # net force over the peak of the last impact
_LONG = 5.0  # contact times of earlier impacts after which a contact is rest, though it rings


_ROUND_OFF = 1e-3  # of a fine step, whose parts are longer


def impact_force(history: ImpactHistory) -> TimeSeries:
    """Contact force [N], means over intervals, with a zero before the start."""
    series = force_series(history)
    return TimeSeries(
        step=series.step,
        values=np.concatenate([[0.0], series.values]),
        unit=series.unit,
        start=series.start - series.step,
        name=series.name,
    )


def interrupted_impact(events: Sequence[ImpactEvent], net: TimeSeries | None) -> ImpactEvent | None:
    """Impact in which a run ends, if it does: its force would seem to persist.

    A needle at rest on its stop does not accelerate (``net``: its mass times acceleration [N]);
    without damping it may ring there endlessly, but has then stayed closed for longer than any
    impact before.
    """
    if net is None or not events or np.isfinite(events[-1].separation_time):
        return None
    last = events[-1]
    ended = [
        event.contact_time
        for event in events
        if event.stop == last.stop and np.isfinite(event.separation_time)
    ]
    if ended and float(net.time[-1]) - last.time > _LONG * max(ended):
        return None
    return last if abs(float(net.values[-1])) > _AT_REST * last.peak_force else None


def before_impact(series: TimeSeries, event: ImpactEvent | None) -> TimeSeries:
    """Series up to a contact time before an impact, if there is one."""
    if event is None:
        return series
    end = event.time - event.contact_time
    count = int((end - series.start) / series.step + 0.5)
    return replace(series, values=series.values[: max(count, 2)])


def stop_forces(result: NetworkResult) -> Mapping[str, TimeSeries]:
    """Force [N] of every stop by :func:`stop_force`."""
    return {stop: stop_force(result, stop) for stop in result.interfaces}


def stop_force(result: NetworkResult, stop: str) -> TimeSeries:
    """Contact and film force [N], means over fine steps, positive when it presses."""
    step = result.step
    start, spacing = float(result.time[0]), float(result.time[1] - result.time[0])
    size = round(spacing / step)  # fine steps of a record
    count = (result.time.size - 1) * size
    record = result.interfaces[stop]
    place = np.floor((record.time - start) / step + _ROUND_OFF).astype(np.int64)
    length = np.maximum(1, np.round(record.step / step).astype(np.int64))
    # of a fine step that was cut, each part has its share
    force = (record.contact_force + record.film_force) * np.minimum(record.step / step, 1.0)
    values, known = np.zeros(count), np.zeros(count, dtype=np.bool_)
    _lay_on_steps(place, length, force, values, known)
    mean = _record_means(result, stop)
    if mean is not None:
        _share_out(values.reshape(-1, size), known.reshape(-1, size), mean)
    return TimeSeries(step=step, values=values, unit="N", start=start + 0.5 * step, name=stop)


@njit
def _lay_on_steps(
    place: Index, length: Index, force: Floats, values: Floats, known: NDArray[np.bool_]
) -> None:
    """Add each force to the fine steps from its place on that it lasts."""
    for i in range(place.size):
        for k in range(max(place[i], 0), min(place[i] + length[i], values.size)):
            values[k] += force[i]
            known[k] = True


def _record_means(result: NetworkResult, stop: str) -> Floats | None:
    """Mean of contact and film force of every record; the first value has none."""
    found = [
        result.channels[name].values[1:]
        for name in (f"{stop} contact force", f"{stop} film force")
        if name in result.channels
    ]
    return np.sum(found, axis=0) if found else None


def _share_out(values: Floats, known: NDArray[np.bool_], mean: Floats) -> None:
    """Give unknown steps of each record (row) the rest of its impulse."""
    size = values.shape[1]
    missing = size - known.sum(axis=1)
    left = mean * size - values.sum(axis=1)
    each = np.divide(left, missing, out=np.zeros(mean.size), where=missing > 0)
    each[np.abs(left) <= 1e-12 * np.abs(values).sum(axis=1)] = 0.0  # round-off
    values += np.where(known, 0.0, each[:, None])
