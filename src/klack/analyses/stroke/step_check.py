"""How much impacts depend on the time steps: against a run with all steps twice as long.

An error of first order in the steps doubles with them, and one of second order becomes four times
as large: the difference of the two runs is the error of the shorter steps, or three times that.  It
is no bound: an error that depends on where a step happens to lie may differ less, and what both
runs share, the model and what counts as an impact, is not seen.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from math import inf, isnan, nan
from operator import attrgetter
from typing import NamedTuple

from klack.analyses.measures import Column, Measure, described_in
from klack.network.accuracy import PROMISED, Accuracy
from klack.simulation.network_result import ImpactEvent, NetworkResult
from klack.simulation.network_run import Watch

__all__ = [
    "CHANGE_MEASURES",
    "NOTICED",
    "SHARE",
    "CheckedSteps",
    "ImpactChange",
    "checked_steps",
    "impact_changes",
    "not_checked",
    "told",
    "watched",
]

NOTICED = 0.02
"""Share of the fastest impact on a stop from which one counts."""

SHARE = 0.5
"""Share of the promise: such differences went with errors above it."""

_PROMISED = 3  # impacts on each stop
_TOLD = 3  # impacts in a sentence
_PARTS = 4  # of a run that may end early after each but the last two: a look takes 0.3 ms
_SLOW = "slower than 2 % of the fastest impact on this stop"
_AFTER = "after all requested impacts"
_OPEN = "not finished when the run ends"


@dataclass(frozen=True, slots=True, kw_only=True)
class ImpactChange:
    """Change of one impact when all steps are doubled.

    Parameters
    ----------
    number
        On its stop, from 1; 0 for a touch that is too slow or too late to count.
    time [s]
        Of the first touch, positive if later; nan, as those below, if missing.
    approach_speed, peak_force, impulse [-]
        Relative.
    reason
        Reason why a number is missing.
    """

    number: int
    time: float = nan
    approach_speed: float = nan
    peak_force: float = nan
    impulse: float = nan
    reason: str = ""

    @property
    def promised(self) -> bool:
        """Whether klack promises its accuracy: the first three on each stop."""
        return 1 <= self.number <= _PROMISED

    def over_promise(self, accuracy: Accuracy) -> float:
        """Change of peak or time over the promised accuracy; inf without a pair."""
        if not self.promised:
            return 0.0
        if self.reason not in ("", _OPEN):
            return inf
        peak, time = PROMISED[accuracy]
        return max(
            0.0 if isnan(self.peak_force) else abs(self.peak_force) / peak, abs(self.time) / time
        )

    def doubtful(self, accuracy: Accuracy) -> bool:
        """Whether it changes by more than half of the promise, or has no pair."""
        return self.over_promise(accuracy) > SHARE


CHANGE_MEASURES: tuple[Measure[ImpactChange], ...] = described_in(
    "theory/stroke",
    Measure(
        key="time_change",
        name="change of first touch",
        unit="s",
        definition="Delay of the first touch with all steps twice as long.",
        read=attrgetter("time"),
        column=Column("us", 1e6, "+.4f", "touch"),
        digits=2,
        page=True,
    ),
    *(
        Measure(
            key=f"{key}_change",
            name=f"change of {name}",
            definition=f"Relative change of the {name} with all steps twice as long.",
            read=attrgetter(key),
            column=Column("%", 100.0, "+.4f", head),
            form="signed share",
            digits=4,
            page=True,
        )
        for key, name, head in (
            ("peak_force", "peak force", "peak force"),
            ("approach_speed", "approach speed", "speed"),
            ("impulse", "impulse", "impulse"),
        )
    ),
)
"""Of an impact whose steps were checked."""


def impact_changes(
    events: Sequence[ImpactEvent], others: Sequence[ImpactEvent]
) -> tuple[ImpactChange, ...]:
    """Changes between impacts of two runs, in order and near in time."""
    found: dict[int, ImpactChange] = {}
    for counted, of_other in _by_stop(events, others).values():
        found |= {
            id(event): change
            for event, change in zip(counted, _pairs(counted, of_other), strict=True)
        }
    return tuple(found.get(id(e), ImpactChange(number=0, reason=_SLOW)) for e in events)


def _by_stop(*runs: Sequence[ImpactEvent]) -> dict[str, tuple[list[ImpactEvent], ...]]:
    fastest: dict[str, float] = {}
    for event in chain(*runs):
        fastest[event.stop] = max(fastest.get(event.stop, 0.0), event.approach_speed)
    return {
        stop: tuple(
            [e for e in run if e.stop == stop and e.approach_speed > NOTICED * speed]
            for run in runs
        )
        for stop, speed in fastest.items()
    }


class CheckedSteps(NamedTuple):
    """What a check of the steps has found: ``changes`` of impacts, ``halvings`` of all steps.

    ``doubt`` says what still depends on the steps, or why they were not checked.
    """

    changes: tuple[ImpactChange, ...] = ()
    doubt: str = ""
    halvings: int = 0

    def largest(self, accuracy: Accuracy) -> float:
        """Largest change over what is promised."""
        return max((change.over_promise(accuracy) for change in self.changes), default=0.0)

    def certificate(self, accuracy: Accuracy) -> tuple[int, float]:
        """Halvings, and change over the promise: inf in other doubt."""
        largest = self.largest(accuracy)
        return self.halvings, inf if self.doubt and largest <= SHARE else largest


def checked_steps(
    run: NetworkResult, longer: NetworkResult, accuracy: Accuracy, halvings: int, until: float = inf
) -> CheckedSteps:
    """Compare a run with one in steps twice as long, up to where the first of them ends.

    Only what comes before ``until`` [s] counts.
    """
    end = min(until, *(float(one.time[-1]) for one in (run, longer)))
    late = ImpactChange(number=0, reason=_AFTER)
    changes = tuple(
        change if event.time <= until else late
        for event, change in zip(run.events, impact_changes(run.events, longer.events), strict=True)
    )
    doubt = told(run.events, changes, accuracy, longer.events, end)
    return CheckedSteps(changes, doubt, halvings)


def watched(run: NetworkResult, accuracy: Accuracy, until: float | None) -> Watch:
    """End a run in longer steps where nothing of it can change what is to be done.

    That is so as soon as an impact that is over changes too much: steps are halved then.  With
    ``until`` [s], where changes of later impacts are not asked for, also where those that count are
    over.
    """
    end = inf if until is None else until

    def enough(now: float, settled: Sequence[ImpactEvent]) -> bool:
        is_over = until is not None
        stops = _by_stop(run.events, settled)
        for stop in run.interfaces:
            counted, others = stops.get(stop, ([], []))
            both = min(len(counted), len(others), _PROMISED)
            asked = [event for event in counted[:_PROMISED] if event.time <= end]
            changes = list(_pairs(counted[:both], others[:both]))
            if any(change.doubtful(accuracy) for change in changes[: len(asked)]):
                return True
            is_over &= both >= len(asked) and (both == _PROMISED or now > end)
        return is_over

    first = [runs[0][: _PROMISED + 1] for runs in _by_stop(run.events).values()]
    times = [event.time + 2.0 * event.contact_time for event in chain(*first)]
    times += [] if end == inf else [(1.0 + NOTICED) * end]
    part = float(run.time[-1] - run.time[0]) / _PARTS
    pauses = {int(t / part): t for t in sorted(times) if t < (_PARTS - 1) * part}
    return Watch(tuple(pauses.values()), enough)


def not_checked(events: Sequence[ImpactEvent], reason: str) -> CheckedSteps:
    """Changes without numbers: there is no other run."""
    numbers = [change.number for change in impact_changes(events, events)]
    changes = tuple(ImpactChange(number=number, reason="no other run") for number in numbers)
    return CheckedSteps(changes, f"the time steps were not checked: {reason}")


def _pairs(run: Sequence[ImpactEvent], other: Sequence[ImpactEvent]) -> Iterator[ImpactChange]:
    """Changes on one stop, up to the first impact without a counterpart."""
    reason = ""
    for k, event in enumerate(run):
        if not reason:
            reason = _unlike(run, other, k)
        if reason:
            yield ImpactChange(number=k + 1, reason=reason)
            reason = "an earlier impact has no counterpart"
        else:
            yield _change(event, other[k], k + 1)


def _change(event: ImpactEvent, other: ImpactEvent, number: int) -> ImpactChange:
    """Change of one impact, without what the end cuts off."""
    both = (event, other)
    over = all(e.is_over for e in both)
    grows = any(e.grows for e in both)
    return ImpactChange(
        number=number,
        time=other.time - event.time,
        approach_speed=other.approach_speed / event.approach_speed - 1.0,
        peak_force=nan if grows else other.peak_force / event.peak_force - 1.0,
        impulse=other.impulse / event.impulse - 1.0 if over else nan,
        reason=_OPEN if grows else "",
    )


def _unlike(run: Sequence[ImpactEvent], other: Sequence[ImpactEvent], k: int) -> str:
    if k >= len(other):
        return "missing with longer steps"
    if not _near(run, other, k):
        return "at another time with longer steps"
    if not _near(run, other, k + 1):
        for one, two in ((run, other), (other, run)):
            # what comes next in one run falls into the impact of the other, or nan: into its rest
            if k + 1 < len(one) and not one[k + 1].time > two[k].separation_time:
                return "one impact in one run, several in the other"
    return ""


def _near(run: Sequence[ImpactEvent], other: Sequence[ImpactEvent], k: int) -> bool:
    """Whether impacts ``k`` are nearest to each other, and nearer than they last."""
    if k >= min(len(run), len(other)):
        return False
    apart = abs(run[k].time - other[k].time)
    beside = [
        abs(one[j].time - two[k].time)
        for one, two in ((run, other), (other, run))
        for j in (k - 1, k + 1)
        if 0 <= j < len(one)
    ]
    return apart < min([max(run[k].contact_time, other[k].contact_time), *beside])


def told(
    events: Sequence[ImpactEvent],
    changes: Sequence[ImpactChange],
    accuracy: Accuracy,
    others: Sequence[ImpactEvent] = (),
    end: float = inf,
) -> str:
    """Sentence on the promised impacts that depend on the steps; empty if none does.

    ``others`` are those with longer steps, of which all before ``end`` [s] have to be there.
    """
    found = [
        f"impact {change.number} on '{event.stop}' {_words(change)}"
        for event, change in zip(events, changes, strict=True)
        if change.doubtful(accuracy)
    ]
    found += [
        f"there is an impact {len(counted) + 1} on '{stop}'"
        for stop, (counted, of_other) in _by_stop(events, others).items()
        if len(counted) < min(sum(event.time < end for event in of_other), _PROMISED)
    ]
    if not found:
        return ""
    peak, time = PROMISED[accuracy]
    more = f"; and {len(found) - _TOLD} more" if len(found) > _TOLD else ""
    return (
        f"with all time steps twice as long {'; '.join(found[:_TOLD])}{more}. Steps are short "
        f"enough for accuracy: {accuracy} if these changes are below {100 * SHARE * peak:g} % "
        f"and {1e6 * SHARE * time:g} us. Try: a shorter run.step; or run.coarse: 1, which takes "
        "many times as long."
    )


def _words(change: ImpactChange) -> str:
    if change.reason:
        return f"cannot be compared ({change.reason})"
    peak, touch = 100.0 * change.peak_force, 1e6 * change.time
    return f"changes by {peak:+.2g} % of its peak force and {touch:+.2g} us"
