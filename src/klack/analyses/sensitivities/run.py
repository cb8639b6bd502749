"""Derivatives of a stroke by exact tangents."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, sqrt
from time import perf_counter, process_time

from klack.analyses.record import case_fields, run_fields
from klack.analyses.sensitivities.parameters import SlopeSpace, asked_measures, slope_space
from klack.analyses.sensitivities.record import (
    HOLDS,
    MISSED,
    ImpactSlope,
    MeasureSlopes,
    SensitivityRecord,
)
from klack.analyses.sensitivities.slopes import SlopeRunner, has_slope, measured
from klack.analyses.stroke.record import StrokeVariant
from klack.analyses.study.measures import TIMES, ChosenMeasure, StrokeOfPoint, stroke_measures
from klack.case.any_case import CaseTree
from klack.case.placed_errors import tells_place
from klack.case.spatial_consistency import require_axial
from klack.case.study_source import StudySource
from klack.case.valve import ValveCase
from klack.case.valve_roles import find_roles
from klack.errors import ConvergenceError, InputError
from klack.input.problem import one_of
from klack.machine.progress import Progress, silent
from klack.machine.stages import StageClock, collected_warnings
from klack.simulation.tangent_run import DIRECTIONS, TangentRun
from klack.units import format_si, is_level

__all__ = ["run_sensitivities"]

_OF_IMPACTS = ("approach_speed", "peak_force", "impulse")
_HEARD = "noise.sound_exposure_level_weighted"
_SHARE = 0.01  # of the size, by which all parameters change in the check
_GROWN = 5.0  # times all before, and as much as the time itself: what bounces do that are chaotic
_RESOLVED = 1e-3  # of a measure that is no time: what the steps of a run resolve of it
_RESOLVED_LEVEL = 0.01  # [dB]: the same of a force


@tells_place
def run_sensitivities(
    case: ValveCase,
    tree: CaseTree,
    source: StudySource | None = None,
    *,
    parameters: Sequence[str] = (),
    measures: Sequence[str] = (),
    variant: str | None = None,
    check: bool = True,
    threads: int | None = None,
    progress: Progress = silent,
) -> SensitivityRecord:
    """Differentiate measures of a stroke.

    ``source`` has parameters and measures; by default the study of the case, unless parameters
    (keys) are given.  ``variant`` is that of the study, or the first.  A ``check`` computes three
    more strokes: derivatives have to predict two of them, and values those of the third.
    InputError also for what cannot be differentiated, and for a motion in three dimensions.
    """
    require_axial(case, "klack sensitivities")
    begin = perf_counter()
    space = slope_space(case, source, parameters)
    chosen = _measures(case, source, measures)
    asked = variant or (source.study.variant if source is not None else None)
    name = case.one_variant(asked)
    clock = StageClock(progress)
    with collected_warnings() as notes:
        runner = SlopeRunner(case, tree, space, name, clock, threads)
        runner.check_steps()
        runs = runner.tangents()
        slopes = runner.slopes(runs, chosen)
        others, not_checked = _others_of(runner) if check else (None, ())
    step = runs[0].sizes.step
    pairs = zip(chosen, slopes, strict=True)
    found = tuple(_checked(item, slope, space, others, step) for item, slope in pairs)
    impacts = _impacts(runs, space, others)
    return SensitivityRecord(
        **case_fields(case),
        **run_fields(begin, clock),
        variant=name,
        parameters=space.described,
        measures=found,
        impacts=impacts,
        share=_SHARE if others is not None else 0.0,
        runs_time=runner.runs_time,
        run_time=others.time if others is not None else 0.0,
        warnings=(
            *_left_out(case, source, space, measures, chosen),
            *notes,
            *runner.notes,
            *not_checked,
            *_unbounded(runs, space),
            *_doubts(found, impacts, others),
        ),
    )


def _measures(
    case: ValveCase, source: StudySource | None, names: Sequence[str]
) -> tuple[ChosenMeasure, ...]:
    wanted = list(asked_measures(source, names))
    if not wanted:
        roles = find_roles(case)
        stops = [stop for stop in (roles.opening_stop, roles.seat) if stop]
        wanted = [*TIMES, *(f"{stop}.{key}" for stop in stops for key in _OF_IMPACTS)]
        wanted += [_HEARD] if case.noise is not None else []
    chosen = stroke_measures(case, wanted)
    fitting = tuple(item for item in chosen if has_slope(item))
    if (names and len(fitting) < len(chosen)) or not fitting:
        bad = next(item for item in chosen if not has_slope(item))
        raise InputError(
            "--measure",
            got=f"'{bad.name}', which has no derivative here",
            expected="times of opening and closing, measures of impacts, energies and levels of "
            f"the noise: {one_of([*TIMES, *(f'seat.{key}' for key in _OF_IMPACTS), _HEARD])}",
            hint="klack study computes any measure at other values of a parameter.",
        )
    return fitting


def _left_out(
    case: ValveCase,
    source: StudySource | None,
    space: SlopeSpace,
    names: Sequence[str],
    chosen: Sequence[ChosenMeasure],
) -> tuple[str, ...]:
    found = []
    if space.skipped:
        found.append(
            f"No derivatives with {one_of(space.skipped)}: use klack study for bodies, noise, "
            "words and lists."
        )
    if source is not None and not names:
        known = {item.name for item in chosen}
        left = [name for name in asked_measures(source) if name not in known]
        if left:
            found.append(
                f"No derivatives of {one_of(left)}: only times, impacts, and energies and levels "
                "of the noise have them."
            )
    return tuple(found)


@dataclass(frozen=True, slots=True)
class _Others:
    """Strokes without derivatives: as they are, and with all parameters changed.

    ``time`` [s] is the processor time of one of them.
    """

    time: float
    same: StrokeOfPoint
    plus: StrokeOfPoint
    minus: StrokeOfPoint


def _others_of(runner: SlopeRunner) -> tuple[_Others | None, tuple[str, ...]]:
    """Strokes as they are, and with all parameters changed by a share, to either side.

    None where one of them cannot be computed, and why.
    """
    found = []
    begin = process_time()
    for way in (0.0, 1.0, -1.0):
        try:
            found.append(runner.stroke(runner.space.together(way * _SHARE)))
        except (InputError, ConvergenceError) as error:
            return None, (f"The derivatives were not checked by other strokes: {error}",)
    return _Others((process_time() - begin) / len(found), *found), ()


def _checked(
    item: ChosenMeasure,
    slopes: tuple[float | None, tuple[float | None, ...]],
    space: SlopeSpace,
    others: _Others | None,
    step: float,
) -> MeasureSlopes:
    value, found = slopes
    predicted, scale = space.change_together(_SHARE, found)
    secant, again = None, value
    if others is not None:
        plus, minus = measured(item, others.plus), measured(item, others.minus)
        secant = None if plus is None or minus is None else 0.5 * (plus - minus)
        again = measured(item, others.same)
    resolution = _RESOLVED * abs(value or 0.0)
    if item.measure.unit == "s":
        resolution = step
    elif is_level(item.measure.unit):
        resolution = _RESOLVED_LEVEL
    return MeasureSlopes(
        name=item.name,
        title=item.measure.name,
        unit=item.measure.unit,
        value=again,
        slopes=found,
        predicted=predicted,
        secant=secant,
        scale=scale,
        resolution=resolution,
        strayed=0.0 if value is None or again is None else abs(value - again),
    )


def _impacts(
    runs: Sequence[TangentRun],
    space: SlopeSpace,
    others: _Others | None,
) -> tuple[ImpactSlope, ...]:
    """Impacts that kept their phase, with the growth of their derivatives."""
    found, counts = list[ImpactSlope](), dict[str, int]()
    for place, touch in enumerate(runs[0].touches):
        number = counts[touch.stop] = counts.get(touch.stop, 0) + 1
        slopes = [
            float(x) for run in runs if place < len(run.touches) for x in run.touches[place].slopes
        ]
        if len(slopes) < len(space.varied):
            break
        parts = [p.size * s for p, s in zip(space.varied, slopes, strict=True)]
        growth = sqrt(sum(part * part for part in parts))
        largest = max((item.growth for item in found), default=inf)
        deviation, is_doubtful = None, growth > max(_GROWN * largest, touch.time)
        if others is not None:
            ends = (others.plus.variant, others.minus.variant)
            plus, minus = (_touch_time(end, touch.stop, number) for end in ends)
            predicted, scale = space.change_together(_SHARE, slopes)
            if plus is not None and minus is not None and predicted is not None:
                missed = abs(0.5 * (plus - minus) - predicted)
                deviation = missed / scale if scale > 0.0 else None
                is_doubtful = missed > max(HOLDS * scale, runs[0].sizes.step)
        found.append(
            ImpactSlope(
                stop=touch.stop,
                number=number,
                time=touch.time,
                growth=growth,
                deviation=deviation,
                is_doubtful=is_doubtful,
            )
        )
    return tuple(found)


def _why(others: _Others) -> str:
    same, *ends = (_in_order(end.variant) for end in (others.same, others.plus, others.minus))
    for end, words in zip(ends, ("so", "the other way"), strict=True):
        pairs = enumerate(zip(same, end, strict=False))
        count = next((k for k, (one, other) in pairs if one != other), None)
        if count is not None:
            time, stop = others.same.variant.result.events[count].time, same[count]
            return (
                f" Changed {words}, impact {count + 1} of all, on '{stop}' at "
                f"{format_si(time, 's', 4)}, is on '{end[count]}': the order of the impacts "
                "changes."
            )
        if len(end) != len(same):
            return f" Changed {words}, there are {len(end)} impacts instead of {len(same)}."
    return (
        " The order of the impacts is the same: either the measure has a kink or jump within "
        "that change, like the flow at zero pressure drop or a peak between two bounces, or the "
        "motion is chaotic; smaller changes in a study show which."
    )


def _in_order(variant: StrokeVariant) -> list[str]:
    return [event.stop for event in variant.result.events]


def _touch_time(variant: StrokeVariant, stop: str, number: int) -> float | None:
    fastest = max((event.approach_speed for event in variant.impacts(stop)), default=0.0)
    events = [e for e in variant.impacts(stop) if e.approach_speed > 0.02 * fastest]
    return events[number - 1].time if number <= len(events) else None


def _unbounded(runs: Sequence[TangentRun], space: SlopeSpace) -> tuple[str, ...]:
    """Sign that tangents have left the motion, with the first parameter."""
    found = []
    for k, item in enumerate(space.varied):
        time = runs[k // DIRECTIONS].without_bound(k % DIRECTIONS, item.size)
        if time is not None:
            found.append((time, item.name))
    if not found:
        return ()
    time, name = min(found)
    return (
        f"After {format_si(time, 's', 4)} derivatives with respect to {name} grow without bound: "
        "either bounces are chaotic, or a contact at rest responds to pressures one macro step "
        "late, which affects its derivatives but not its motion. Later measures have no "
        "derivatives. Try: run.coarse: 16.",
    )


def _doubts(
    measures: Sequence[MeasureSlopes],
    impacts: Sequence[ImpactSlope],
    others: _Others | None = None,
) -> tuple[str, ...]:
    found = []
    wrong = [item.name for item in measures if item.is_doubtful]
    if wrong:
        found.append(
            f"The derivatives of {one_of(wrong)} do not predict runs with all parameters changed "
            f"by {_SHARE:.0%}: they are not valid for changes of this size."
            + ("" if others is None else _why(others))
        )
    rough = [f"{item.name} ({item.deviation:.0%})" for item in measures if item.is_rough]
    if rough:
        found.append(
            f"Derivatives that miss runs with all parameters changed by {_SHARE:.0%} by more than "
            f"{MISSED:.0%}: {', '.join(rough)}."
        )
    unsure = [item.name for item in measures if item.is_unconfirmed]
    if unsure:
        found.append(
            f"The derivatives of {one_of(unsure)} are not confirmed: the effect of changing all "
            f"parameters by {_SHARE:.0%} is too small to be resolved to {MISSED:.0%} with the "
            "steps of a run. Try: run.accuracy: fine, or a study with larger changes."
        )
    strayed = [item.name for item in measures if item.has_strayed]
    if strayed:
        found.append(
            "Chaos: two strokes that differ by round-off have other values of "
            f"{one_of(strayed)}: their derivatives are meaningless."
        )
    lost = next((item for item in impacts if item.is_doubtful), None)
    if lost is not None:
        at = format_si(lost.time, "s", 4)
        told = "change as predicted by their derivatives"
        if lost.deviation is None:
            told = "seem to follow their derivatives, which grow from bounce to bounce"
        found.append(
            f"From impact {lost.number} on '{lost.stop}' at {at}, the times of impacts do not "
            f"{told}: bounces are chaotic, or a controller switches in another phase. Later "
            "numbers are doubtful, see the table of the impacts."
        )
    return tuple(found)
