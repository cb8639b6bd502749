"""``klack advise`` for a whole valve: step, modes and meshes by the first impact on each stop.

Later impacts are chaotic and tell nothing about convergence, so none is judged.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from math import inf
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from klack.analyses.advice.advice import Advice, Measured
from klack.analyses.advice.affordable import affordable, time_of
from klack.analyses.advice.ladder import Ladder, Measure, score
from klack.analyses.advice.modes import explicit_modes, mode_setting
from klack.analyses.advice.regions import mesh_settings, unmeshed, unmeshed_notes
from klack.analyses.advice.settings import Setting, SettingValue, applied
from klack.analyses.stroke.run import run_variant, variant_network
from klack.assembling.valve import Valve, build_valve, build_valve_bodies
from klack.assembling.yielding import tell_elastic
from klack.bodies.elasticity.body import ElasticBody
from klack.case.levels import Variant
from klack.case.placed_errors import tells_place
from klack.case.spatial_consistency import require_axial
from klack.case.valve import ValveCase
from klack.errors import KlackError, refuse_if
from klack.machine.progress import Progress, silent
from klack.machine.stages import collected_warnings
from klack.simulation.step_sizes import step_sizes

__all__ = ["advise_stroke", "first_impacts", "step_ladder", "stroke_measures"]

_NEAR = (2.0, 1.0, 0.5)
_REST = (1.0, 0.5, 0.25)
_SPARE = 2.0  # of the time until the first impacts have come
_MODE_ORDER, _MESH_ORDER, _STEP_ORDER = 1.0, 1.0, 2.0


def stroke_measures(error: float) -> tuple[Measure, ...]:
    """Measures of a stroke, each the worst of the first impacts on its stops.

    ``error`` [-] is accepted for the time of the impact (of its time since the start), peak force,
    and absolutely for the restitution.  The contact time comes in whole steps and is only reported.
    """
    names = ("impact time", "peak force", "restitution")
    judged = [Measure(name=name, limit=error) for name in names]
    return (*judged, Measure(name="contact time"))


def first_impacts(valve: Valve, *, step: float | None = None) -> dict[str, NDArray[np.float64]]:
    """Time, peak force, restitution, contact time of the first impact on every stop, shape (4,).

    ``step`` [s] is that of the network; macro steps change in proportion.
    """
    case = valve.case
    rows, run = variant_network(valve, _variant(case)).rows(), case.run
    if step is not None:
        sizes = step_sizes(rows, run.accuracy, step=run.step, coarse=run.coarse)
        run = run.model_copy(update={"step": step, "coarse": sizes.coarse})
    result = run_variant(case.model_copy(update={"run": run}), rows)
    found: dict[str, NDArray[np.float64]] = {}
    for event in result.events:
        if event.stop not in found:
            numbers = (event.time, event.peak_force, event.restitution, event.contact_time)
            found[event.stop] = np.array(numbers)
    return found


def _variant(case: ValveCase) -> Variant:
    names: tuple[Variant, ...] = (*case.run.variants, "wet")
    return next(name for name in names if not name.endswith("lumped"))


def _deviation(
    reference: Mapping[str, NDArray[np.float64]], run: Mapping[str, NDArray[np.float64]]
) -> NDArray[np.float64]:
    """Worst deviation (4,) over the stops; 1 where a stop is not reached."""
    worst = np.zeros(4)
    for stop, numbers in reference.items():
        if stop not in run:
            return np.ones(4)
        scale = np.array([numbers[0], numbers[1], 1.0, numbers[3]])
        worst = np.maximum(worst, np.nan_to_num(np.abs(run[stop] - numbers) / scale))
    return worst


@tells_place
def advise_stroke(
    case: ValveCase,
    *,
    error: float = 0.01,
    confirm: bool = True,
    progress: Progress = silent,
    threads: int | None = None,
) -> Advice:
    """Measure what step, modes and meshes of a valve cost in accuracy at its first impacts.

    Contact regions and step are doubled and halved; growth, bodies away from their contacts and
    modes are refined twice.  Runs end after the first impacts, without sound.  Parameters as for
    :func:`klack.analyses.advice.impact.advise_impact`.  InputError if no impact comes within the
    run, and for a motion in three dimensions.
    """
    require_axial(case, "klack advise")
    begin = perf_counter()
    measures = stroke_measures(error)
    case = explicit_modes(case).model_copy(update={"noise": None})
    with collected_warnings() as notes:
        tell_elastic(case, "advice is measured on")
        valve = build_valve(case, progress, threads=threads)
        spent = perf_counter() - begin
        progress("first impacts", 0.0)
        now = first_impacts(valve)
    runs = 1
    refuse_if(
        not now,
        f"{case.path or 'case'}: run.duration",
        got="no impact within it",
        expected="a run that reaches a stop",
        hint="check the lift with klack stroke, and increase run.duration.",
    )
    case = _shortened(case, now)
    with collected_warnings():
        log = list(notes)
        measured = []
        settings = [*_mesh_settings(case), *_mode_settings(valve)]
        for i, setting in enumerate(settings):
            found = {1.0: now}
            for factor in (f for f in _factors(setting) if f != 1.0):
                progress("other bodies", (i + 0.5 * (len(found) - 1)) / len(settings))
                runs += 1
                try:
                    found[factor] = _impacts(applied(case, setting.at(factor)), threads)
                except KlackError as trouble:
                    log.append(
                        f"No run with '{setting.name}' times {factor:g}: "
                        f"{str(trouble).splitlines()[0]}"
                    )
            if len(found) > 1:
                measured.append(_measured(case, setting, found, measures))
        measured.append(step_ladder(replace(valve, case=case), now, measures))
        runs += 2
        log += unmeshed_notes(case.bodies)
        dofs = _dofs(valve.bodies)
        counsels, size, dear = affordable(
            measured,
            (),
            measures,
            size_with=lambda values: _dofs(build_valve_bodies(applied(case, values), silent)),
            present=dofs,
            dimension=max((body.dimension for body in valve.bodies.values()), default=2),
        )
        log += [dear] if dear else []
        advice = Advice(
            case=case.name,
            title=case.title,
            level="stroke",
            measures=measures,
            up_to=float("nan"),
            band_from_case=False,
            counsels=counsels,
            unmeshed=unmeshed(case.bodies),
            dofs=(dofs, size) if dofs else None,
        )
        if confirm:
            progress("advised case", 0.0)
            advice = _confirmed(case, advice, now, threads)
            runs += 2
    return replace(
        advice,
        notes=tuple(log),
        times=(spent, spent * _growth(advice)),
        runs=runs,
        wall_time=perf_counter() - begin,
    )


def _shortened(case: ValveCase, now: Mapping[str, NDArray[np.float64]]) -> ValveCase:
    end = max(_SPARE * (numbers[0] + np.nan_to_num(numbers[3])) for numbers in now.values())
    run = case.run.model_copy(update={"duration": min(case.run.duration, float(end))})
    return case.model_copy(update={"run": run})


def _factors(setting: Setting) -> tuple[float, ...]:
    near = setting.name.startswith("contact of")
    if setting.values[0].key[-1] == "participation":
        return _REST[:2]  # of a pool that holds twice as many
    return tuple(f for f in (_NEAR if near else _REST) if setting.reaches(f))


def _measured(
    case: ValveCase,
    setting: Setting,
    found: Mapping[float, Mapping[str, NDArray[np.float64]]],
    measures: Sequence[Measure],
) -> Measured:
    factors = sorted(found, reverse=True)
    if setting.group == "modes":
        words, order = ", ".join(f"{setting.values[0].at(f):g}" for f in factors), _MODE_ORDER
    else:
        words, order = "sizes times " + ", ".join(f"{f:g}" for f in factors), _MESH_ORDER
    return Measured(
        setting=setting,
        ladder=_ladder(factors, [found[f] for f in factors], measures, order),
        runs=f"{_variant(case)}: {words}",
    )


def step_ladder(
    valve: Valve, now: Mapping[str, NDArray[np.float64]], measures: Sequence[Measure]
) -> Measured:
    """Twice, once and half the step of the network.

    Where a wave in a line would cross a cell within the doubled macro step, which is refused: once,
    half and a quarter, and no longer step is advised.
    """
    step, doubles = valve.case.run.fine_step, _may_double(valve)
    factors = _NEAR if doubles else _REST
    runs = [now if f == 1.0 else first_impacts(valve, step=f * step) for f in factors]
    value = SettingValue(key=("run", "step"), value=step, unit="s")
    words = "2h, h, h/2" if doubles else "h, h/2, h/4"
    return Measured(
        setting=Setting(name="step of the network", group="step", values=(value,)),
        ladder=_ladder(factors, runs, measures, _STEP_ORDER),
        runs=f"{_variant(valve.case)}: {words}",
        at_least=inf if doubles else 1.0,
    )


def _may_double(valve: Valve) -> bool:
    """Whether waves in lines of cells take two macro steps or more."""
    rows, run = variant_network(valve, _variant(valve.case)).rows(), valve.case.run
    sizes = step_sizes(rows, run.accuracy, step=run.step, coarse=run.coarse)
    crossing = min((wave.crossing for wave in rows.waves), default=inf)
    return crossing >= 2.0 * sizes.coarse * sizes.step


def _ladder(
    factors: Sequence[float],
    runs: Sequence[Mapping[str, NDArray[np.float64]]],
    measures: Sequence[Measure],
    order: float,
) -> Ladder:
    return Ladder(
        factors=tuple(factors),
        differences=np.array([_deviation(runs[-1], run) for run in runs[:-1]]),
        steps=np.array([score(_deviation(finer, run), measures) for run, finer in pairwise(runs)]),
        assumed_order=order,
    )


def _mesh_settings(case: ValveCase) -> tuple[Setting, ...]:
    surfaces = tuple(s for stop in case.stops.values() for s in (stop.upper, stop.lower))
    return mesh_settings(case.bodies, surfaces)


def _mode_settings(valve: Valve) -> list[Setting]:
    found = []
    for name, body in valve.reduced.items():
        choice = valve.case.reduction.choice(name)
        elastic = body.frequencies[body.rigid_count : body.mode_count - body.attachment_count]
        count = choice.count or choice.participation or len(elastic)
        if choice.participation is not None and (choice.pool or 0) < 2 * count:
            continue  # of a pool: no more than it holds
        found.append(mode_setting(name, choice, count, elastic))
    return found


def _impacts(case: ValveCase, threads: int | None) -> dict[str, NDArray[np.float64]]:
    return first_impacts(build_valve(case, silent, threads=threads))


def _confirmed(
    case: ValveCase,
    advice: Advice,
    now: Mapping[str, NDArray[np.float64]],
    threads: int | None,
) -> Advice:
    reference = _impacts(applied(case, advice.finest), threads)
    advised = _impacts(applied(case, advice.changes), threads)
    return replace(
        advice,
        checked=(_deviation(reference, now), _deviation(reference, advised)),
        check_words="both run again, against the valve with every setting at its finest value "
        "in the runs or in the advice",
    )


def _dofs(bodies: Mapping[str, ElasticBody]) -> int:
    return sum(len(body.free) for body in bodies.values())


def _growth(advice: Advice) -> float:
    if advice.dofs is None:
        return float("nan")
    before, after = advice.dofs
    return time_of(after, 2) / time_of(before, 2)
