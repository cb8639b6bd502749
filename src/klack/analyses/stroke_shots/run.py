"""``klack shots`` of a whole valve, in three dimensions."""

import pickle
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from time import perf_counter

import numpy as np

from klack.analyses.record import case_fields, run_fields
from klack.analyses.shots.draw import runs_asked
from klack.analyses.shots.run import friction_in_words, guide_in_words, position_in_words
from klack.analyses.stroke.run import body_summaries, stop_summaries
from klack.analyses.stroke_shots.one_stroke import (
    CENTRED,
    STROKE_LOG,
    Starts,
    StrokeKey,
    StrokeLog,
    StrokeOutcome,
    StrokeSetup,
    StrokeStart,
    StrokeTask,
    run_one_stroke,
    shots_of_valve,
    strokes_mark,
)
from klack.analyses.stroke_shots.record import (
    StopColumns,
    StrokeColumns,
    StrokeShotsStudy,
    VariantShots,
)
from klack.analyses.workers import LoggedWork, grouped_doubts
from klack.assembling.bolts import opening_doubts
from klack.assembling.valve import Valve, build_valve
from klack.case.levels import Variant
from klack.case.placed_errors import tells_place
from klack.case.valve import ValveCase
from klack.case.valve_roles import ValveRoles, find_roles
from klack.errors import ConvergenceError, InputError
from klack.machine.cache.result_cache import result_cache
from klack.machine.progress import (
    PointCount,
    Progress,
    SoFar,
    counted,
    drawn,
    duration_text,
    remark,
    silent,
)
from klack.machine.stages import StageClock, collected_warnings
from klack.schematic.picture import schematic_svg
from klack.transient.spatial_run import SpatialValve
from klack.units import format_si

__all__ = ["compute_strokes", "missing_notes", "run_stroke_shots", "stroke_setup"]

_SLOW = 0.2
"""Share of the median speed below which an impact is of another kind."""


@tells_place
def run_stroke_shots(
    case: ValveCase,
    *,
    variants: Sequence[str] = (),
    count: int | None = None,
    seed: int | None = None,
    workers: int | None = None,
    folder: Path | None = None,
    progress: Progress = silent,
    threads: int | None = None,
) -> StrokeShotsStudy:
    """Compute many strokes of one valve, in several variants with the same draws.

    Parameters
    ----------
    variants
        ``wet``, ``dry``; those of the case by default.
    count, seed, workers, folder
        As for :func:`klack.analyses.shots.run.run_shots`.

    Raises
    ------
    ConvergenceError
        Where no stroke of a variant can be computed, or one on which the next ones depend.
    """
    begin = perf_counter()
    stated = shots_of_valve(case)
    wanted = case.require_variants(tuple(variants) or case.run.variants)
    count, seed, workers = runs_asked(stated, count, seed, workers, "strokes")
    roles = find_roles(case)
    clock = StageClock(progress, result_cache())
    with STROKE_LOG.open(folder, strokes_mark(case, seed, threads)) as log:
        with collected_warnings() as notes:
            valve = build_valve(case, clock, threads=threads)
            setup = stroke_setup(valve, roles)
            starts = Starts.of(valve, _body(case, roles), seed)
        resumed = sum(key in log.done for key in _keys(wanted, count))
        compute_strokes(setup, starts, wanted, count, workers, log, clock)
        found: dict[str, VariantShots] = {
            name: _variant(setup, name, count, log) for name in wanted
        }
        _require_some(found)
        clock("strokes", 1.0)
    return StrokeShotsStudy(
        **case_fields(case),
        **run_fields(begin, clock, "mosqito"),
        seed=seed,
        workers=workers,
        carry=stated.carry,
        resumed=resumed,
        stroke_time=clock.spent(("strokes",)),
        duration=case.run.duration,
        needle=roles.needle,
        seat=roles.seat,
        opening_stop=roles.opening_stop,
        guide=guide_in_words(case.guide),
        distributions=_distributions(case),
        largest_eccentricity=_largest(case, setup.spatial),
        mass=next(body.mass for body in setup.bodies if body.name == _body(case, roles)),
        points={name: b - a for name, a, b in setup.spatial.model.contacts},
        variants=found,
        schematic=schematic_svg(case.network.network()),
        warnings=tuple(
            dict.fromkeys(
                [
                    *notes,
                    *missing_notes(found),
                    *_doubts(wanted, count, log),
                    *opening_doubts(case, _peaks(found)),
                ]
            )
        ),
    )


def _peaks(found: Mapping[str, VariantShots]) -> Iterator[float]:
    for shots in found.values():
        for columns in shots.stops.values():
            yield from columns.peak_force


def _keys(variants: Sequence[Variant], count: int) -> Iterator[tuple[str, int]]:
    for name in variants:
        yield name, CENTRED
        for index in range(count):
            yield name, index


def stroke_setup(valve: Valve, roles: ValveRoles) -> StrokeSetup:
    """What strokes need of a valve, laid out as in any other process.

    Arrays that have been sent lie in memory in another order than those of views: the same bits in
    every process take the same layout.
    """
    if valve.spatial is None:
        raise InputError(
            "motion", got="axial", expected="three-dimensional", hint="set it in the case."
        )
    slim = Valve(
        case=valve.case,
        bodies={},
        reduced={},
        contacts={},
        laws=valve.laws,
        network=valve.network,
        structures=valve.structures,
    )
    setup = StrokeSetup(
        valve=slim,
        spatial=valve.spatial,
        roles=roles,
        bodies=body_summaries(valve),
        stops=stop_summaries(valve),
    )
    try:
        sent: StrokeSetup = pickle.loads(pickle.dumps(setup))
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise InputError(
            "network.components",
            got=f"a component that other processes cannot import ({error})",
            expected="classes of a module",
            hint="move your own class to a module that --component names.",
        ) from error
    return sent


def _body(case: ValveCase, roles: ValveRoles) -> str:
    return str(getattr(case.network.components[roles.needle], "body", ""))


def compute_strokes(
    setup: StrokeSetup,
    starts: Starts,
    variants: Sequence[Variant],
    count: int,
    workers: int,
    log: StrokeLog,
    progress: Progress,
) -> None:
    """Compute the strokes that the log does not have, the centred one first, and keep them there.

    ConvergenceError for a failed stroke from whose end the next one starts.
    """
    carry = shots_of_valve(starts.case).carry
    total = len(variants) * (count + 1)
    progress("strokes", 0.0)
    pace = _Pace(progress, total, len(log.done))
    first = [starts.centred()] + ([] if carry else [starts.drawn(i) for i in range(count)])
    with LoggedWork(
        run_one_stroke, setup, workers, log, lambda key: f"stroke {key[1]} ({key[0]})"
    ) as work:
        _complete(work, dict.fromkeys(variants, first), pace)
        for index in range(count if carry else 0):
            following = {name: [_next(starts, name, index, log)] for name in variants}
            _complete(work, following, pace)


def _next(starts: Starts, variant: Variant, index: int, log: StrokeLog) -> StrokeStart:
    """Start where the stroke before ended; the first one as drawn."""
    if index == 0:
        return starts.drawn(0)
    before = log.done[variant, index - 1]
    if before.failure:
        raise ConvergenceError(
            f"stroke {index - 1} ({variant}): {before.failure}\n"
            "The next one would start where it ends. Try: fewer --shots, or shots.carry: false."
        )
    return starts.after(index, before.end)


def _complete(
    work: LoggedWork[StrokeKey, StrokeOutcome],
    starts: Mapping[Variant, Sequence[StrokeStart]],
    pace: "_Pace",
) -> None:
    tasks: dict[StrokeKey, StrokeTask] = {
        (name, start.index): StrokeTask(variant=name, start=start)
        for name, items in starts.items()
        for start in items
    }
    for key in work.completed(tasks):
        pace.tell(key, work.log)


class _Pace:
    """Says of each stroke that it is done, how long one takes, and how long all others will."""

    def __init__(self, progress: Progress, total: int, before: int) -> None:
        self._progress, self._total, self._before = progress, total, before
        self._begin = perf_counter()

    def tell(self, key: StrokeKey, log: StrokeLog) -> None:
        """A line for a stroke, the last of those that are done."""
        (variant, index), done = key, len(log.done)
        each = (perf_counter() - self._begin) / max(done - self._before, 1)
        left = max(self._total - done, 0)
        which = "centred stroke" if index == CENTRED else f"stroke {index}"
        text = f"{which} ({variant}): {done} of {self._total}, {each:.2g} s each"
        if left:
            text += f", {duration_text(each * left)} left"
        counted(self._progress, PointCount(done=done, most=self._total, left=each * left))
        remark(self._progress, text)
        self._progress("strokes", min(done / self._total, 1.0))
        drawn(self._progress, partial(_so_far, log))


def _so_far(log: StrokeLog) -> list[SoFar]:
    """First peak force of each stop in the strokes that are done, by their numbers."""
    found: dict[str, list[tuple[int, float]]] = {}
    for (variant, index), outcome in sorted(log.done.items()):
        for stop, numbers in outcome.stops.items() if index != CENTRED else ():
            found.setdefault(f"{stop} ({variant})", []).append((index, numbers["peak_force"]))
    curves = {name: np.array(each).T for name, each in found.items()}
    return [
        SoFar(title="peak force [N]", x=x, y=y, x_label="stroke", name=name, dots=True)
        for name, (x, y) in curves.items()
    ]


def _variant(setup: StrokeSetup, name: Variant, count: int, log: StrokeLog) -> VariantShots:
    outcomes = [log.done[name, index] for index in range(count)]
    alone = log.done[name, CENTRED]
    order = sorted(setup.spatial.stops, key=lambda stop: stop != setup.roles.seat)
    begun = [item for item in (*outcomes, alone) if item.label != name]
    return VariantShots(
        name=name,
        label=begun[0].label if begun else name,
        strokes=StrokeColumns.of([item.stroke for item in outcomes]),
        stops={stop: StopColumns.of([item.stops[stop] for item in outcomes]) for stop in order},
        centric=StrokeColumns.of([alone.stroke]),
        centric_stops={stop: StopColumns.of([alone.stops[stop]]) for stop in order},
        time=setup.trace_time,
        lift=np.stack([item.lift for item in outcomes]),
        centric_lift=alone.lift,
        failures={str(item.index): item.failure for item in outcomes if item.failure},
    )


def _require_some(found: Mapping[str, VariantShots]) -> None:
    for name, shots in found.items():
        if len(shots.failures) == shots.strokes.count:
            first, text = next(iter(shots.failures.items()))
            raise ConvergenceError(
                f"stroke {first} ({name}), and all others: {text}\n"
                "Try: klack stroke with the same case, which reports more details."
            )


def _largest(case: ValveCase, spatial: SpatialValve) -> dict[str, float]:
    found = {}
    for stop, arm, pair in zip(spatial.stops, spatial.arms, spatial.pairings, strict=True):
        body = spatial.model.moving[pair.mover]
        name = spatial.model.bodies[body.number]
        guide = case.guides.get(name) if pair.mover else case.guide
        if guide is not None:
            found[stop] = guide.largest_eccentricity(float(body.centre[2] + arm[2]))
    return found


def _distributions(case: ValveCase) -> dict[str, str]:
    shots = shots_of_valve(case)
    words = position_in_words(shots, case.guide)
    if case.placement is not None:
        words = {"eccentricity and tilt": "the placement of the case, for the first stroke"}
    if shots.carry:
        words["later strokes"] = (
            "start at the position across the axis where the previous stroke left the needle"
        )
    words |= friction_in_words(shots, case.guide)
    given = {name: stop.friction for name, stop in case.stops.items() if stop.friction > 0.0}
    if shots.contact_friction is not None:
        words["friction between the faces"] = shots.contact_friction.text("")
    elif given:
        each = (f"{format_si(mu, '')} at '{name}'" for name, mu in given.items())
        words["friction between the faces"] = ", ".join(each)
    return words


def _doubts(variants: Sequence[Variant], count: int, log: StrokeLog) -> Iterator[str]:
    for name in variants:
        alone = log.done[name, CENTRED]
        for text in [*alone.doubts, *filter(None, [alone.failure])]:
            yield f"'{name}': the centred stroke: {text}"
        outcomes = [log.done[name, index] for index in range(count)]
        doubts = [(item.index, item.doubts) for item in outcomes]
        yield from (f"'{name}': {text}" for text in grouped_doubts(doubts, "strokes"))
        failed = [(i.index, [f"it failed: {i.failure}"] if i.failure else []) for i in outcomes]
        yield from (f"'{name}': {text}" for text in grouped_doubts(failed, "strokes"))


def missing_notes(found: Mapping[str, VariantShots]) -> Iterator[str]:
    """What strokes did not reach, and statistics leave out."""
    for name, shots in found.items():
        count = shots.strokes.count
        for stop, columns in shots.stops.items():
            touched = np.isfinite(columns.eccentricity)
            if not np.all(touched):
                yield (
                    f"'{name}': {count - int(np.sum(touched))} of {count} strokes do not hit "
                    f"'{stop}'. Try: a longer run.duration, if they are meant to."
                )
            if not np.any(touched):
                continue
            speed = columns.approach_speed
            slow = touched & (speed < _SLOW * float(np.median(speed[touched])))
            if np.any(slow):
                first = int(np.flatnonzero(slow)[0])
                yield (
                    f"'{name}': the first impact on '{stop}' is a mere touch in "
                    f"{int(np.sum(slow))} of {count} strokes, "
                    f"{format_si(speed[first], 'm/s', 3)} in stroke {first} against a median of "
                    f"{format_si(float(np.median(speed[touched])), 'm/s', 3)}: the statistics "
                    "mix both. Check the lift; another duration of the drive may avoid the "
                    "touch."
                )
            unturned = touched & ~np.isfinite(columns.rebound_height)
            if np.any(unturned):
                yield (
                    f"'{name}': {int(np.sum(unturned))} of {count} strokes have no rebound height "
                    f"at '{stop}', and are not compared by it: the stroke ends, or another stop is "
                    "touched, before the needle turns back. Try: a longer run.duration."
                )
