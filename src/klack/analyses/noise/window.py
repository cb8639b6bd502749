"""The part of a long stroke whose noise is followed: as much as fits into memory and time.

Forces are followed to the ear in fine steps, three billion of which make a minute.
"""

from dataclasses import replace

import numpy as np

from klack.errors import InputError
from klack.memory import in_words, require_memory
from klack.simulation.network_result import ChannelData, InterfaceRecord, NetworkResult
from klack.units import format_si

__all__ = ["first_part"]

_MOST_STEPS = 20_000_000  # fine steps: 0.4 s of 20 ns
_PER_STEP = 250.0  # bytes at most while one body is followed, all stops together


def first_part(result: NetworkResult, most: int = _MOST_STEPS) -> tuple[NetworkResult, str]:
    """Cut a run off after so many fine steps; with words for that, empty if it is short enough.

    An impact that the cut leaves without its end is one in which the run ends.

    Parameters
    ----------
    result : NetworkResult
    most : int

    Raises
    ------
    InputError
        If all impacts come later, a single record is longer, or it does not fit into the memory.
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
    if not events and (result.events or not count):
        raise InputError(
            "noise of a stroke",
            got=f"a run of {format_si(whole, 's')} with records of {format_si(spacing, 's')} and "
            f"no impact in its first {length}",
            expected=f"impacts within {length}, {most:,} fine steps",
            hint="shorten the wait before the first actuation, use a shorter record or a longer "
            "step, or continue from a run that ends just before it (klack stroke --continue).",
        )
    note = (
        f"Only the first {format_si(end - float(result.time[0]), 's')} of the run of "
        f"{format_si(whole, 's')} are evaluated, with {len(events)} of its {len(result.events)} "
        "impacts: forces, energies and sound are those of this part. For a later part run "
        "the stroke up to there, continue with klack stroke --continue for some ms, and evaluate "
        "the noise of that."
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
