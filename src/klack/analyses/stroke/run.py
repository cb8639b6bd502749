"""``klack stroke``: one actuation in requested variants."""

import warnings
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from math import inf, isfinite
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from klack.analyses.impact.contact_check import check_contact
from klack.analyses.record import case_fields, run_fields
from klack.analyses.stroke.acting import acting_forces, fluid_passages, moving_bodies
from klack.analyses.stroke.controllers import controller_notes
from klack.analyses.stroke.delivery import restrictions_of
from klack.analyses.stroke.missing import cut_records, missing_notes, rest_note
from klack.analyses.stroke.mounted import moving_note, seen_from_valve, standing_network
from klack.analyses.stroke.record import (
    FluidSummary,
    IncompleteStrokeError,
    LineSummary,
    StopSummary,
    StrokeChannels,
    StrokeStudy,
    StrokeVariant,
)
from klack.analyses.stroke.stairs import line_ends
from klack.analyses.stroke.step_check import CheckedSteps, checked_steps, not_checked, watched
from klack.analyses.stroke.times import all_lift_times
from klack.assembling.body_summary import BodySummary, summarise_body
from klack.assembling.bolts import opening_doubts
from klack.assembling.valve import Valve, build_valve
from klack.case.any_case import read_valve_case
from klack.case.levels import Variant
from klack.case.placed_errors import tells_place
from klack.case.valve import ValveCase
from klack.case.valve_roles import ValveRoles, find_roles
from klack.contact.rubbing_law import RubbingLaw
from klack.contact.yielding_law import YieldingLaw
from klack.control.controlled import Controlled
from klack.errors import AccuracyWarning, ConvergenceError, InputError, KlackError, refuse_if
from klack.machine.cache.result_cache import result_cache
from klack.machine.progress import Progress, SoFar, StageProgress, drawn, silent
from klack.machine.stages import StageClock, collected_warnings, show, trial
from klack.magnetics.driver import Driver
from klack.mechanics.end_stop import EndStop
from klack.network.network import Network
from klack.network.ranges import Travel
from klack.network.rows import Rows
from klack.schematic.picture import schematic_svg
from klack.simulation.displaced_liquid import told_once
from klack.simulation.network_result import IncompleteRunError, NetworkResult
from klack.simulation.network_run import SpatialMotion, State, Watch, simulate_network
from klack.simulation.step_sizes import StepSizes, scaled, step_sizes
from klack.units import format_si

__all__ = [
    "VariantRun",
    "body_summaries",
    "halved",
    "one_variant",
    "run_stroke",
    "run_variant",
    "stop_summaries",
    "stroke_notes",
    "stroke_study",
    "study_of_run",
    "variant_network",
    "variant_of",
]

Warned = list[warnings.WarningMessage]

_HALVINGS = 3  # of all steps: errors of first order are an eighth then, those of second a 64th
_MOST_HALVINGS = 6  # of short runs
_SHORT_RUN = 100_000  # steps
_FALLING_RUN = 400_000  # where changes fall: the next takes 1 s
_OF_THE_VALVE = ("bodies", "materials", "stops", "reduction", "lumped", "motion", "guide", "guides")
_NAMED = 3  # keys in a sentence
_NEAR = 0.3  # share of what is asked that the spacing of records may be off by: 1 us is 1.28 us


@tells_place
def run_stroke(
    case: ValveCase,
    *,
    variants: Sequence[str] = (),
    after: StrokeStudy | None = None,
    progress: Progress = silent,
    threads: int | None = None,
) -> StrokeStudy:
    """Compute one actuation in several variants and compare them.

    ``variants`` are by default those of the case, among :data:`klack.case.levels.VARIANTS`;
    ``after`` continues the same case for another duration.  IncompleteStrokeError, with the study
    up to there, when a variant fails on its way.
    """
    begin = perf_counter()
    wanted = case.require_variants(tuple(variants) or case.run.variants)
    begins = {name: _begin(case, after, name) for name in wanted}
    roles = find_roles(case)
    clock = StageClock(progress, result_cache())
    with collected_warnings() as notes:
        valve = build_valve(case, clock, threads=threads)
        computed, failure = _runs(valve, roles, begins, clock)
        runs = {name: _without_path(run) for name, run in computed.items()}
        stops = stop_summaries(valve)
    results: dict[str, StrokeVariant] = {name: run.variant for name, run in runs.items()}
    missing = missing_notes(results, [name for name in wanted if name not in results], failure)
    study = stroke_study(
        valve,
        roles,
        runs,
        run_fields(begin, clock),
        bodies=body_summaries(valve),
        stops=stops,
        warnings=(*missing, *_other_case(case, after), *stroke_notes(case, results, roles, notes)),
        schematic=schematic_svg(case.network.network()),
    )
    if failure is not None:
        raise IncompleteStrokeError(str(failure), study) from failure
    return study


def stroke_notes(
    case: ValveCase, variants: Mapping[str, StrokeVariant], roles: ValveRoles, warned: Sequence[str]
) -> tuple[str, ...]:
    """Notes on computed variants, and warnings on the way."""
    begun = [
        f"'{name}': {note}"
        for name, variant in variants.items()
        for note in (variant.result.start.notes if variant.result.start else ())
        if not any(note in other for other in warned)  # a warning already
    ]
    at_rest = [rest_note(name, variant.result, roles) for name, variant in variants.items()]
    moving = [moving_note(name, variant.result) for name, variant in variants.items()]
    peaks = [event.peak_force for v in variants.values() for event in v.result.events]
    return (
        *controller_notes(case),
        *told_once(warned),
        *opening_doubts(case, peaks),
        *begun,
        *filter(None, [*at_rest, *moving]),
        *_record_notes(case, variants),
    )


def _record_notes(case: ValveCase, variants: Mapping[str, StrokeVariant]) -> Iterator[str]:
    """Where records are not as far apart as the case asks: macro steps are not divided."""
    asked = case.run.record
    if "record" not in case.run.model_fields_set:
        return
    for name, variant in variants.items():
        spacing = float(variant.result.time[1] - variant.result.time[0])
        if abs(spacing - asked) > _NEAR * asked:
            yield (
                f"'{name}': records are {format_si(spacing, 's')} apart instead of run.record: "
                f"{format_si(asked, 's')}, because they contain whole steps of the network. "
                "Impacts do not depend on it. Try: a whole multiple of their spacing, or "
                "run.coarse: 1, which takes many times as long."
            )


def variant_network(valve: Valve, variant: Variant) -> Network:
    """Network of a variant: without fluid, with rigid bodies or on a machine."""
    network = valve.network
    if variant.startswith("dry"):
        network = network.dry()
    if variant.endswith("mounted"):
        return standing_network(valve, network)
    lumped = valve.case.lumped
    if variant.endswith("lumped"):
        if lumped is None:  # refused by require_variants already
            raise InputError(
                "lumped", got="no stiffness", expected="lumped.stiffness", hint="add it."
            )
        network = network.lumped(lumped.stiffness, lumped.restitution)
    return network


@dataclass(frozen=True, kw_only=True, eq=False)
class VariantRun:
    """One variant of a stroke, the rows that it ran on, and why it ended early.

    Where the steps were not checked, ``steps`` is None.
    """

    variant: StrokeVariant
    rows: Rows
    failure: ConvergenceError | None
    steps: CheckedSteps | None = None


def _without_path(run: VariantRun) -> VariantRun:
    """Leave out the path, needed only within a run: channels and impacts have it."""
    result = replace(run.variant.result, path=None)
    return replace(run, variant=replace(run.variant, result=result))


def stroke_study(
    valve: Valve,
    roles: ValveRoles,
    runs: Mapping[Variant, VariantRun],
    made: Mapping[str, Any],
    *,
    bodies: tuple[BodySummary, ...],
    stops: tuple[StopSummary, ...],
    warnings: tuple[str, ...] = (),
    schematic: str = "",
) -> StrokeStudy:
    """Record of computed variants, from a valve that may have no meshes and contacts.

    ``made`` are those of :func:`~klack.analyses.record.run_fields`.
    """
    case = valve.case
    rows = [run.rows for run in runs.values()]
    results: dict[str, StrokeVariant] = {name: run.variant for name, run in runs.items()}
    return StrokeStudy(
        **case_fields(case),
        **made,
        needle=roles.needle,
        lift=_lift(rows[0], roles.needle),
        switch_off=_switch_off(valve.network),
        duration=case.run.duration,
        step=case.run.fine_step,
        variants=results,
        channels=_channels(valve.network, roles, [run.result for run in results.values()]),
        bodies=bodies,
        stops=stops,
        fluid=_fluid_summary(rows),
        lines=_line_summaries(valve.network, rows),
        structures=valve.structures,
        schematic=schematic,
        warnings=warnings,
    )


def run_variant(
    case: ValveCase,
    rows: Rows,
    progress: Callable[[float], None] = lambda fraction: None,
    *,
    state: State | None = None,
    spatial: SpatialMotion | None = None,
    sizes: StepSizes | None = None,
    watch: Watch | None = None,
) -> NetworkResult:
    """Run rows for the duration and steps of the case, from rest or a state.

    ``spatial`` are the bodies of a motion in three dimensions, ``sizes`` other steps.
    """
    return simulate_network(
        rows,
        duration=case.run.duration,
        accuracy=case.run.accuracy,
        step=case.run.step,
        coarse=case.run.coarse,
        sizes=sizes,
        watch=watch,
        record=case.run.record,
        state=state,
        spatial=spatial,
        progress=progress,
    )


def _begin(case: ValveCase, after: StrokeStudy | None, name: Variant) -> NetworkResult | None:
    """Run that a variant continues, in its steps; None from rest."""
    if after is None:
        return None
    refuse_if(
        after.step != case.run.fine_step,  # the clock counts steps
        "step",
        got=format_si(case.run.fine_step, "s"),
        expected=f"{format_si(after.step, 's')}, the step of the result to continue from",
        hint="keep the step, or run from the start.",
    )
    refuse_if(
        name not in after.variants,
        "variant",
        got=f"'{name}', which is not in the result to continue from",
        expected=f"one of: {', '.join(after.variants)}",
        hint="run that variant from the start first.",
    )
    return after.variants[name].result


def _other_case(case: ValveCase, after: StrokeStudy | None) -> Iterator[str]:
    """A doubt where a run continues another one in a different valve."""
    if after is None:
        return
    parts = case.network.components
    own = {type(part) for part in parts.values() if not type(part).__module__.startswith("klack.")}
    try:
        before = read_valve_case(after.case_text, case.path or Path("case.yaml"), tuple(own))
    except KlackError:  # of other files, or of components that are not here
        return
    old = before.network.components
    differ = [
        f"network.components.{name}"
        for name in dict.fromkeys((*old, *parts))
        if old.get(name) != parts.get(name) and not isinstance(parts.get(name), Controlled)
    ]
    differ += [
        f"network.{key}"
        for key in ("fluid", "gas", "ambient", "connections")
        if getattr(before.network, key) != getattr(case.network, key)
    ]
    differ += [key for key in _OF_THE_VALVE if getattr(before, key) != getattr(case, key)]
    if differ:
        more = f" and {len(differ) - _NAMED} more" if len(differ) > _NAMED else ""
        yield (
            f"the run continues in a different valve: {', '.join(differ[:_NAMED])}{more} differ "
            "from the case of the result that it continues, whose state is used unchanged: speeds, "
            "gaps and forces may jump there. Try: the same case for another duration; what changes "
            "during a stroke belongs into tables over time."
        )


def _runs(
    valve: Valve,
    roles: ValveRoles,
    begins: Mapping[Variant, NetworkResult | None],
    progress: Progress,
) -> tuple[dict[Variant, VariantRun], ConvergenceError | None]:
    runs: dict[Variant, VariantRun] = {}
    for name, after in begins.items():
        try:
            runs[name] = one_variant(valve, roles, name, progress, after=after)
        except ConvergenceError as error:
            if not runs:
                raise
            return runs, error
        failure = runs[name].failure
        if failure is not None:
            return runs, failure
    return runs, None


def one_variant(
    valve: Valve,
    roles: ValveRoles,
    name: Variant,
    progress: Progress,
    *,
    after: NetworkResult | None = None,
    halvings: int = 0,
    check: bool = True,
    until: Callable[[StrokeVariant], float] | None = None,
) -> VariantRun:
    """Compute one variant of a valve, from rest or from the end of a run.

    Parameters
    ----------
    halvings
        How often all steps are halved from the start: what the check of a like stroke has found.
    check
        Whether steps are checked, and halved where impacts depend on them, unless the case says.
    until
        Time [s] of a run up to which impacts have to be right.

    Raises
    ------
    ConvergenceError
        Before the first record.
    """
    begin = perf_counter()
    progress = _LiftAndForces(progress, roles, str(name))
    asked = valve.case.run.check_steps
    checked = check if asked is None else asked
    progress(f"run {name}", 0.0)
    kept: AbstractContextManager[Warned] = trial() if checked else nullcontext([])
    with kept as caught:
        run = _attempt(valve, name, progress, after=after, halvings=halvings)
    setup_time = perf_counter() - begin - run.result.wall_time
    steps: CheckedSteps | None = None
    if checked and after is not None:
        reason = "the run continues another run, whose state belongs to its steps"
        steps = not_checked(run.result.events, reason)
    elif checked and run.failure is None:

        def end(found: _Attempt) -> float | None:
            if until is None:
                return None
            return until(variant_of(valve, roles, name, found.rows, found.result))

        run, caught, steps = _in_checked_steps(valve, name, progress, run, caught, end)
    elif checked:
        steps = not_checked(run.result.events, "the run ended early")
    show(caught)
    variant = variant_of(valve, roles, name, run.rows, run.result, setup_time)
    if steps is not None:
        variant = replace(variant, changes=steps.changes, halvings=halvings + steps.halvings)
        if steps.doubt:
            warnings.warn(f"'{name}': {steps.doubt}", AccuracyWarning, stacklevel=2)
    return VariantRun(variant=variant, rows=run.rows, failure=run.failure, steps=steps)


def halved(case: ValveCase, rows: Rows, halvings: int) -> StepSizes:
    """Steps that the case asks for, all of them halved that often."""
    run = case.run
    sizes = step_sizes(rows, run.accuracy, step=run.step, coarse=run.coarse)
    return scaled(rows, sizes, 0.5**halvings) if halvings else sizes


class _LiftAndForces:
    """Progress that draws lift and forces of stops from all channels of a run so far."""

    def __init__(self, progress: Progress, roles: ValveRoles, variant: str) -> None:
        self._progress, self._variant = progress, variant
        self._lift = f"{roles.needle}.{roles.point} displacement"

    def __call__(self, stage: str, fraction: float) -> None:
        self._progress(stage, fraction)

    def drawn(self, channels: Callable[[], Sequence[SoFar]]) -> None:
        """Lift in um, forces in N, over ms."""
        drawn(self._progress, lambda: [*self._chosen(channels())])

    def _chosen(self, channels: Sequence[SoFar]) -> Iterator[SoFar]:
        for one in channels:
            stop = one.title.removesuffix(" peak force")
            if one.title == self._lift:
                title, name, y = "lift [um]", "", 1e6 * one.y
            elif stop != one.title:
                title, name, y = "forces of the stops [N]", stop, one.y
            else:
                continue
            title = f"{self._variant}: {title}"
            yield SoFar(title=title, name=name, x=1e3 * one.x, y=y, x_label="time [ms]")


class _Attempt(NamedTuple):
    rows: Rows
    result: NetworkResult
    failure: ConvergenceError | None


def _attempt(
    valve: Valve,
    name: Variant,
    progress: Progress,
    *,
    after: NetworkResult | None = None,
    halvings: int = 0,
    sizes: StepSizes | None = None,
    watch: Watch | None = None,
) -> _Attempt:
    stage = f"run {name}" if sizes is None else f"check steps of {name}"
    rows = variant_network(valve, name).rows()
    if after is not None and after.sizes.step != valve.case.run.fine_step:
        sizes = after.sizes  # halved by a check
    elif halvings:
        sizes = halved(valve.case, rows, halvings)
    try:
        result = run_variant(
            valve.case,
            rows,
            StageProgress(progress, stage),
            state=None if after is None else after.state,
            spatial=valve.spatial,
            sizes=sizes,
            watch=watch,
        )
    except IncompleteRunError as error:
        return _Attempt(rows, error.result, error)
    return _Attempt(rows, result, None)


def _in_checked_steps(
    valve: Valve,
    name: Variant,
    progress: Progress,
    run: _Attempt,
    caught: Warned,
    until: Callable[[_Attempt], float | None],
) -> tuple[_Attempt, Warned, CheckedSteps]:
    """Halve all steps until impacts do not depend on them.

    As often as :data:`_HALVINGS`, and on to :data:`_MOST_HALVINGS` where that is short, longer if
    the largest change falls: an error that depends on where a step happens to lie need not fall.
    In three dimensions, where a step takes a thousand times as long, steps are compared, and halved
    where the case asks for the check; no run is short there.
    """
    accuracy, most = valve.case.run.accuracy, _MOST_HALVINGS
    if valve.spatial is not None:
        most = _HALVINGS if valve.case.run.check_steps else 0

    def again(factor: float, watch: Watch | None = None) -> tuple[_Attempt | None, Warned, str]:
        try:
            sizes = scaled(run.rows, run.result.sizes, factor)
            with trial() as kept:
                found = _attempt(valve, name, progress, sizes=sizes, watch=watch)
        except (ConvergenceError, InputError) as error:
            return None, [], " ".join(str(error).split())
        reason = "" if found.failure is None else " ".join(str(found.failure).split())
        return (None if reason else found), kept, reason

    def compared(longer: _Attempt) -> CheckedSteps:
        asked = inf if end is None else end
        return checked_steps(run.result, longer.result, accuracy, halvings, asked)

    end = until(run)
    watch = watched(run.result, accuracy, end) if valve.spatial is None else None
    longer, _, reason = again(2.0, watch)
    halvings, before = 0, inf
    while True:
        if longer is not None:
            steps = compared(longer)
            largest = steps.largest(accuracy)
            is_short = run.result.steps.taken < (_FALLING_RUN if largest < before else _SHORT_RUN)
            if not steps.doubt or halvings >= (most if is_short else min(most, _HALVINGS)):
                return run, caught, steps
            before = largest
        shorter, kept, failed = again(0.5) if halvings < most else (None, [], "")
        if shorter is not None and cut_records(shorter.result) and not cut_records(run.result):
            shorter, failed = None, "the record of the forces in fine steps is full."
        if shorter is None:
            if halvings == 0 and longer is not None and watch is not None:
                longer, _, reason = again(2.0)  # all of it
                steps = steps if longer is None else compared(longer)
            if longer is None:
                steps = not_checked(run.result.events, f"no run with longer steps. {reason}")
            if failed:
                steps = steps._replace(doubt=f"{steps.doubt} With shorter steps: {failed}")
            return run, caught, steps
        run, longer, caught = shorter, run, kept
        end = until(run)
        halvings += 1


def study_of_run(
    valve: Valve,
    roles: ValveRoles,
    name: Variant,
    run: VariantRun,
    bodies: tuple[BodySummary, ...],
    stops: tuple[StopSummary, ...],
) -> StrokeStudy:
    """Record of one variant among many strokes; see :func:`stroke_study`."""
    made = run_fields(0.0, StageClock(silent))
    return stroke_study(valve, roles, {name: run}, made, bodies=bodies, stops=stops)


def variant_of(
    valve: Valve,
    roles: ValveRoles,
    name: Variant,
    rows: Rows,
    result: NetworkResult,
    setup_time: float = 0.0,
    until: float | None = None,
) -> StrokeVariant:
    """Record of one variant, with the times of its needle.

    ``until`` [s] is the end of the run, by default that of its records.
    """
    result = seen_from_valve(result, rows, (roles.seat, roles.opening_stop))
    times = all_lift_times(result, rows, roles.needle, roles.point, valve.case.run.seat or "")
    wet, flexible = not name.startswith("dry"), not name.endswith("lumped")
    measured = valve.case.measurement
    return StrokeVariant(
        name=name,
        label=_label(valve, rows, wet=wet, flexible=flexible),
        wet=wet,
        flexible=flexible,
        modes=sum(row.body.mode_count for row in rows.bodies),
        opening_time=times[0].opening.touch if times else None,
        closing_time=times[0].closing.touch if times else None,
        times=times,
        result=result,
        setup_time=setup_time,
        acting=acting_forces(rows),
        moving=moving_bodies(rows),
        passages=fluid_passages(rows, valve.network),
        line_ends=line_ends(rows, None if measured is None else measured.sensor),
        restrictions=restrictions_of(rows, valve.network, until or float(result.time[-1])),
    )


def _label(valve: Valve, rows: Rows, *, wet: bool, flexible: bool) -> str:
    fluid = "dry"
    if wet and rows.fluid is not None:
        fluid = f"{rows.fluid.name} at {_highest_pressure(rows) / 1e5:.3g} bar"
    if wet and rows.gas is not None:
        gas = f"{rows.gas.name} at {rows.gas_rows.highest_pressure() / 1e5:.3g} bar"
        fluid = gas if rows.fluid is None else f"{fluid}, {gas}"
    elastic = [
        row.body.mode_count - row.body.rigid_count for row in rows.bodies if row.body.mode_count
    ]
    lumped = valve.case.lumped
    if not flexible and lumped is not None:
        return f"{fluid}, rigid bodies on {lumped.stiffness / 1e6:.4g} N/um"
    if not any(elastic):
        return f"{fluid}, rigid bodies"
    where = ", on its machine" if any(row.body.momentum is not None for row in rows.bodies) else ""
    return f"{fluid}, {' + '.join(str(count) for count in elastic)} modes{where}"


def _highest_pressure(rows: Rows) -> float:
    """Highest absolute pressure at the start [Pa]."""
    return max((node.at_start for node in rows.nodes.values()), default=rows.ambient.pressure)


def _lift(rows: Rows, needle: str) -> float | None:
    """What the unloaded needle travels itself [m]; None without stops."""
    (low, high), _ = Travel.of(rows).lift(needle)
    lift = high - low
    return lift if isfinite(lift) else None


def _switch_off(network: Network) -> float | None:
    """End of the drivers' command [s], if any."""
    drivers = [part for part in network.components.values() if isinstance(part, Driver)]
    ends = [end for driver in drivers for _, end in driver.commands()]
    return max((end for end in ends if end is not None), default=None)


def _channels(
    network: Network, roles: ValveRoles, results: Sequence[NetworkResult]
) -> StrokeChannels:
    units = {
        name: data.unit for result in reversed(results) for name, data in result.channels.items()
    }
    coils = network.coil_labels()

    def known(names: Sequence[str]) -> tuple[str, ...]:
        return tuple(name for name in names if name in units)

    point = f"{roles.needle}.{roles.point}"
    return StrokeChannels(
        lift=f"{point} displacement",
        lift_velocity=f"{point} velocity",
        velocity=f"{roles.needle} velocity",
        voltage=known([f"{coil} voltage" for coil in coils]),
        current=known([f"{coil} current" for coil in coils]),
        magnetic_force=known([f"{coil}.armature force" for coil in coils]),
        pressures=tuple(
            name for name, unit in units.items() if unit == "Pa" and not name.startswith("ambient ")
        ),
        flows=tuple(name for name in units if name.endswith(" flow")),
        opening_stop=roles.opening_stop,
        seat=roles.seat,
    )


def body_summaries(valve: Valve) -> tuple[BodySummary, ...]:
    """What a report says of each body."""
    result = []
    for name, body in valve.bodies.items():
        reduced = valve.reduced[name]
        contact = [
            reduced.port_index(port.name)
            for item in valve.contacts.values()
            for side, port in zip((item.pair.upper, item.pair.lower), item.ports, strict=True)
            if side.name == name
        ]
        shares = reduced.compliance_share[contact] if contact else np.array([np.nan])
        summary = summarise_body(valve.case, body, reduced, compliance_share=float(shares.min()))
        result.append(summary)
    return tuple(result)


def stop_summaries(valve: Valve) -> tuple[StopSummary, ...]:
    """Contact of each stop, for reports."""
    return tuple(
        _stop_summary(valve, name, part)
        for name, part in valve.network.components.items()
        if isinstance(part, EndStop)
    )


def _stop_summary(valve: Valve, name: str, part: EndStop) -> StopSummary:
    contact, law = valve.contacts.get(name), valve.laws.get(name)
    local = None if law is None else law.local
    none, nan = np.empty(0), float("nan")
    indentation = np.append(0.0, local.force_indentation) if local else none
    surfaces = " on ".join(str(s) for s in valve.case.stops[name].between) if contact else ""
    check = None
    if contact is not None:
        force, worn = contact.pattern_force, valve.case.stops[name].worn
        check = check_contact(
            valve.case,
            contact.pair,
            contact.closing,
            force,
            surfaces,
            has_yield=law is not None and isinstance(law.law, YieldingLaw),
            worn_by=0.0 if worn is None else worn.force,
        )
    return StopSummary(
        name=name,
        surfaces=surfaces,
        kind=part.law.kind if part.law is not None else "film",
        gap=part.gap,
        film=part.film is not None,
        indentation=indentation,
        force=np.append(0.0, local.force) if local else none,
        share=np.append(nan, local.share) if local else none,
        approach=contact.closing.approach if contact else none,
        static_force=contact.closing.force if contact else none,
        area=contact.closing.area if contact else none,
        pattern_force=contact.pattern_force if contact else nan,
        half_width=check.half_width if check else nan,
        size_ratio=check.size_ratio if check else nan,
        points_across=check.points_across if check else 0,
        doubts=check.doubts if check else (),
        needed_yield=check.needed_yield if check else nan,
        friction=valve.case.stops[name].friction if contact else 0.0,
        returning=law.law.returning(indentation)
        if law and isinstance(law.law, RubbingLaw)
        else none,
    )


def _fluid_summary(rows: Sequence[Rows]) -> FluidSummary | None:
    wet = next((item for item in rows if item.fluid is not None), None)
    if wet is None or wet.fluid is None:
        return None
    fluid, p = wet.fluid, _highest_pressure(wet)
    return FluidSummary(
        name=fluid.name,
        temperature=fluid.temperature,
        pressure=p,
        density=float(fluid.density(p)),
        bulk_modulus=float(fluid.bulk_modulus(p)),
        sound_speed=float(fluid.sound_speed(p)),
        viscosity=float(fluid.viscosity(p)),
        vapour_pressure=fluid.vapour_pressure,
    )


def _line_summaries(network: Network, rows: Sequence[Rows]) -> tuple[LineSummary, ...]:
    found = dict[str, float]()
    for item in reversed(rows):
        pieces = defaultdict[str, float](float)
        for line in item.lines:
            pieces[line.component] += line.delay
        found |= pieces
    return tuple(
        LineSummary(
            name=name,
            length=(length := float(getattr(network.components[name], "length", np.nan))),
            sound_speed=length / delay,
            echo_time=2.0 * delay,
        )
        for name, delay in found.items()
    )
