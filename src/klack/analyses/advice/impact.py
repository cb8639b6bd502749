"""``klack advise`` for one impact."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from time import perf_counter
from typing import Literal

import numpy as np

from klack.analyses.advice.advice import Advice, Fixed, Measured
from klack.analyses.advice.affordable import added, affordable, fits, larger, memory_of, time_of
from klack.analyses.advice.modes import (
    counted,
    expected_count,
    explicit_modes,
    highest_band,
    history_ladder,
    impact_errors,
    impact_measures,
    interface_history,
    judged_up_to,
    mode_ladder,
    mode_setting,
    modes_in_band,
    richer_pools,
)
from klack.analyses.advice.regions import (
    axisymmetric_twin,
    coarse_contact_notes,
    layer_setting,
    mesh_settings,
    unmeshed,
    unmeshed_notes,
)
from klack.analyses.advice.settings import Setting, SettingValue, applied
from klack.analyses.impact.interface_level import build_interface, simulate_case
from klack.assembling.bodies import BodyPair, build_bodies
from klack.assembling.modes import mode_pools
from klack.assembling.problem import ContactProblem, build_problem
from klack.assembling.reduced_pair import ReducedPair, first_stiffness, impact_system, own_pair
from klack.assembling.yielding import tell_elastic
from klack.bodies.elasticity.eigen import Modes
from klack.case.placed_errors import tells_place
from klack.case.schema import Case
from klack.contact.history import ImpactHistory
from klack.contact.restitution import measure_impact
from klack.contact.statics import size_over_half_width
from klack.errors import InputError, KlackError, refuse_if
from klack.input.problem import Key
from klack.machine.progress import Progress, silent
from klack.machine.stages import collected_warnings
from klack.simulation.impact import simulate_impact
from klack.units import format_si

__all__ = ["AdviceLevel", "advise_impact"]

AdviceLevel = Literal["reduced", "interface"]

_STEPS = (1.0, 0.5, 0.25)
_NEAR = (2.0, 1.0, 0.5)
_REST = (1.0, 0.5, 0.25)
_REST_OF_LARGE = (2.0, 1.0, 0.5)
_LARGE = 50_000  # degrees of freedom of finest meshes that take seconds
_GROWTH = 6  # of the degrees of freedom with a quarter of the size: 4 to 7 on shipped cases
_COARSE = (1.5, 1.0)
_AROUND = (1.5, 1.0, 1.0 / 1.5)
# lowest orders measured on shipped cases: contact of curved faces, corners of a body, the circle
_CONTACT_ORDER, _REST_ORDER, _LAYER_ORDER = 1.4, 1.0, 2.0


@dataclass(frozen=True, kw_only=True, eq=False)
class _Base:
    case: Case
    level: AdviceLevel
    problem: ContactProblem
    pools: Mapping[str, Modes]
    pair: ReducedPair
    counts: Mapping[str, int]
    time: float

    @property
    def dofs(self) -> int:
        return _dofs(self.problem.pair)

    @property
    def step_key(self) -> Key:
        return ("run", f"{self.level}_step")

    @property
    def step(self) -> float:
        return _step_of(self.case, self.level)

    @cached_property
    def now(self) -> ImpactHistory:
        """Impact of the case, needed again when the factorisations are gone."""
        return self.history(1.0)

    def history(self, factor: float) -> ImpactHistory:
        step = factor * self.step
        if self.level == "reduced":
            return _reduced(self.case, self.pair, step)
        model = build_interface(self.problem, self.pools, ports=self.pair.ports)
        return simulate_case(self.case, model, step=step).history

    def interface(self, counts: Mapping[str, int], step: float) -> ImpactHistory:
        return interface_history(self.problem, self.pools, self.pair.ports, counts, step=step)


@dataclass(slots=True)
class _Log:
    notes: list[str] = field(default_factory=list)
    runs: int = 0


@tells_place
def advise_impact(
    case: Case,
    *,
    error: float = 0.01,
    level_error: float = 1.0,
    up_to: float | None = None,
    level: AdviceLevel | None = None,
    confirm: bool = True,
    progress: Progress = silent,
    threads: int | None = None,
) -> Advice:
    """Measure what mesh, modes and step of a case cost in accuracy, and advise each.

    Parameters
    ----------
    error [-]
        Accepted for peak force, contact time and force history.
    level_error [dB]
        Accepted for every third octave of the target band.
    up_to [Hz]
        Target band; by default the highest third octave within 40 dB of the strongest.
    level
        ``reduced`` (default) or, by default for a case off its axis, ``interface``.
    confirm
        Run the advised case and compare it with the finest run.

    Raises
    ------
    InputError
        Also for an impact that does not end or that rings on its modes.
    """
    begin = perf_counter()
    case = explicit_modes(case)
    chosen = _level(case, level)
    _require_surfaces(case)
    case.require_ends("advice")
    case.require_on_axis("advice")
    log = _Log()
    with collected_warnings() as warned:
        tell_elastic(case, "advice is measured on")
        base = _base(case, chosen, progress, threads)
    log.notes += warned
    log.runs += 1
    with collected_warnings():
        _require_one_pulse(base, base.now)
        wanted = highest_band(base.now) if up_to is None else up_to
        judged = judged_up_to(base.now, wanted)
        if up_to is not None and judged < up_to / 1.3:
            log.notes.append(
                f"Third octaves above {format_si(judged, 'Hz', 3)} are more than 40 dB below the "
                f"strongest and are not judged, although the target band goes to "
                f"{format_si(up_to, 'Hz', 3)}."
            )
        measures = impact_measures(error, level_error)
        measured, fixed = _modes_and_step(base, wanted, judged, log, progress)
        family = _family(base, log)
        meshes, sizes = _mesh_ladders(base, family, judged, log, progress, threads)
        measured = [*meshes, *measured]
        touching = {n: case.bodies[n] for n in (case.contact.moving.body, case.contact.stop.body)}
        peak = measure_impact(base.now).peak_force
        ratio = size_over_half_width(base.problem.static, peak)
        log.notes += unmeshed_notes(touching, ratio)
        if not unmeshed(touching):
            log.notes += coarse_contact_notes(ratio)
        counsels, dofs, dear = affordable(
            measured,
            fixed,
            measures,
            size_with=lambda values: _size_with(base, family, meshes, sizes, values),
            present=base.dofs,
            dimension=case.dimension,
        )
        log.notes += [dear] if dear else []
        advice = Advice(
            case=case.name,
            title=case.title,
            level=chosen,
            measures=measures,
            up_to=judged,
            band_from_case=up_to is None,
            counsels=counsels,
            fixed=tuple(fixed),
            unmeshed=unmeshed(touching),
            dofs=(base.dofs, dofs),
            times=(base.time, base.time * _growth(base, dofs)),
        )
        base.problem.close()
        if confirm:
            advice = _confirmed(base, family, meshes, sizes, advice, log, progress, threads)
    return replace(advice, notes=tuple(log.notes), runs=log.runs, wall_time=perf_counter() - begin)


def _level(case: Case, asked: AdviceLevel | None) -> AdviceLevel:
    if asked is not None:
        refuse_if(
            asked not in ("reduced", "interface"),
            "--level",
            got=f"'{asked}'",
            expected="reduced or interface",
            hint="the full order has the meshes of both, and measuring its step would take "
            "too long: advise the interface level.",
        )
        return asked
    centred = case.motion.placement.is_centred
    only = all(name in ("interface", "full") for name in case.run.levels)
    return "reduced" if centred and not (only and "interface" in case.run.levels) else "interface"


def _require_surfaces(case: Case) -> None:
    names = [name for name, body in case.bodies.items() if not body.has_surfaces]
    if names:
        raise InputError(
            f"{case.path or 'case'}: bodies.{names[0]}",
            got="a body without surfaces (a reduced model, or only nodes)",
            expected="two bodies with meshed surfaces",
            hint="such a body has a mesh error and missing modes that cannot be measured here: "
            "compare klack impact of two such models, one from a finer mesh and with more "
            "modes; for the step, run the case again with half of run.reduced_step.",
        )


def _base(case: Case, level: AdviceLevel, progress: Progress, threads: int | None) -> _Base:
    begin = perf_counter()
    problem = build_problem(case, progress, threads=threads)
    pools = mode_pools(problem, at_least=1, progress=progress)
    spent = perf_counter() - begin
    counts = {name: counted(case.reduction.choice(name), pool) for name, pool in pools.items()}
    pair = own_pair(problem, pools, stiffness=first_stiffness(problem))
    return _Base(
        case=case,
        level=level,
        problem=problem,
        pools=richer_pools(problem, {n: 2 * count for n, count in counts.items()}, progress),
        pair=pair,
        counts=counts,
        time=spent,
    )


def _reduced(case: Case, pair: ReducedPair, step: float) -> ImpactHistory:
    return simulate_impact(
        impact_system(case, pair.upper, pair.lower, pair.law),
        speed=case.motion.speed,
        duration=case.run.duration,
        step=step,
    )


def _step_of(case: Case, level: AdviceLevel) -> float:
    return case.run.reduced_step if level == "reduced" else case.run.interface_step


def _dofs(pair: BodyPair) -> int:
    return len(pair.upper.free) + len(pair.lower.free)


def _require_one_pulse(base: _Base, history: ImpactHistory) -> None:
    measures = measure_impact(history)
    refuse_if(
        not np.isfinite(measures.restitution),
        f"{base.case.path or 'case'}: run.duration",
        got=f"{format_si(base.case.run.duration, 's')}, within which the bodies do not separate",
        expected="a time that covers the impact and the rebound",
        hint="increase run.duration until klack impact prints a restitution.",
    )
    refuse_if(
        measures.sub_contacts > 1,
        f"{base.case.path or 'case'}: level {base.level}",
        got=f"an impact of {measures.sub_contacts} contacts: the force rings on the modes",
        expected="one contact, whose peak and history converge",
        hint="for faces that meet all at once, only impulse, restitution and the plateau of "
        "the full order converge: compare klack impact --level full on two meshes; "
        "otherwise use correction: consistent, or --level interface.",
    )


def _modes_and_step(
    base: _Base, up_to: float, judged: float, log: _Log, progress: Progress
) -> tuple[list[Measured], list[Fixed]]:
    progress("modes and steps", 0.0)
    measured: list[Measured] = []
    step = min(base.case.run.interface_step, base.step)
    twice = {name: 2 * count for name, count in base.counts.items()}
    reference = base.interface(twice, step)
    names = (base.case.contact.moving.body, base.case.contact.stop.body)
    for i, name in enumerate(names):
        choice = base.case.reduction.choice(name)
        ladder = mode_ladder(
            base.problem,
            base.pools,
            base.pair.ports,
            base.counts,
            name,
            reference=reference,
            step=step,
            up_to=judged,
        )
        if ladder is None:
            log.notes.append(
                f"'{name}' has fewer modes in its mesh than twice those kept: no advice for them."
            )
            continue
        limit = float("inf")
        if choice.participation is None:
            within = modes_in_band(base.pools[name], up_to)
            limit = base.counts[name] / max(within, 1)
            if within == len(base.pools[name].omega):
                log.notes.append(
                    f"Even {within} modes of '{name}' end at "
                    f"{format_si(float(base.pools[name].frequency[-1]), 'Hz', 3)}, inside the "
                    "target band, whose upper end is therefore uncertain. Try: modes by "
                    "participation from a larger pool."
                )
        measured.append(
            Measured(
                setting=mode_setting(name, choice, base.counts[name], base.pools[name].frequency),
                ladder=ladder,
                runs=_runs_words("interface", ladder.factors, base.counts[name]),
                at_least=limit,
            )
        )
        progress("modes and steps", (i + 1) / 4)
    histories = [base.now, *(base.history(factor) for factor in _STEPS[1:])]
    value = SettingValue(key=base.step_key, value=base.step, unit="s")
    measured.append(
        Measured(
            setting=Setting(name=f"step, {base.level} level", group="step", values=(value,)),
            ladder=history_ladder(list(_STEPS), histories, judged, 2.0),
            runs=f"{base.level}: h, h/2, h/4",
        )
    )
    fixed: list[Fixed] = []
    if base.level == "reduced":
        points = base.interface(base.counts, step / 2.0)
        fixed.append(
            Fixed(
                name="one pressure pattern",
                errors=impact_errors(points, histories[-1], judged),
                remedy="klack impact --level interface, which has a point-resolved contact",
            )
        )
    progress("modes and steps", 1.0)
    return measured, fixed


def _runs_words(level: str, factors: Sequence[float], count: int) -> str:
    return f"{level}: {', '.join(f'{round(count / f)}' for f in factors)} modes"


@dataclass(frozen=True, kw_only=True, eq=False)
class _Family:
    """Cases on which meshes are compared: the case itself, or its axisymmetric twin.

    The other regions stay at their finest, or, ``around`` the case, as they are.
    """

    case: Case
    words: str = ""
    near: tuple[float, ...] = _NEAR
    rest: tuple[float, ...] = _REST
    around: bool = False

    @property
    def fine(self) -> bool:
        return min(self.rest) < 1.0

    @cached_property
    def dofs(self) -> int:
        return _dofs(build_bodies(self.case, silent))

    def factors(self, setting: Setting) -> tuple[float, ...]:
        near = setting.name.startswith(("contact of", "growth in"))
        return tuple(f for f in (self.near if near else self.rest) if setting.reaches(f))


def _family(base: _Base, log: _Log) -> _Family:
    case = base.case
    names = (case.contact.moving.body, case.contact.stop.body)
    if len(unmeshed({name: case.bodies[name] for name in names})) == len(names):
        return _Family(case=case, around=True)
    if case.dimension == 2:
        if not fits(larger(base.dofs, 0.25, 2), 2):
            log.notes.append(_too_big(base.dofs, 0.25, 2))
            return _Family(case=case, near=_COARSE, rest=_COARSE, around=True)
        return _Family(case=case, rest=_REST_OF_LARGE if _GROWTH * base.dofs > _LARGE else _REST)
    highest = {
        name: 1.001 * float(base.pools[name].frequency[base.counts[name] - 1]) for name in names
    }
    twin = axisymmetric_twin(case, highest)
    if twin is None:
        if not fits(larger(base.dofs, _AROUND[-1], 3), 3):
            log.notes.append(_too_big(base.dofs, _AROUND[-1], 3))
            return _Family(case=case, near=_COARSE, rest=_COARSE, around=True)
        return _Family(case=case, near=_AROUND, rest=_AROUND, around=True)
    words = ", axisymmetric half sections"
    if any(s.sectors for b in case.bodies.values() for s in b.fixed or ()):
        words += " held all round"
    return _Family(case=twin, words=words)


def _too_big(dofs: int, factor: float, dimension: int) -> str:
    return (
        f"Refining meshes of {dofs} degrees of freedom could take more than half of the free "
        f"memory (estimated {memory_of(larger(dofs, factor, dimension), dimension) / 1e9:.2g} "
        "GB): they were coarsened instead, and an order of convergence was assumed."
    )


def _mesh_ladders(
    base: _Base,
    family: _Family,
    judged: float,
    log: _Log,
    progress: Progress,
    threads: int | None,
) -> tuple[list[Measured], dict[str, tuple[float, int]]]:
    """Ladders of every region; factor and degrees of freedom of one run of each."""
    case = family.case
    surfaces = (case.contact.moving, case.contact.stop)
    wanted = {surface.body for surface in surfaces}
    bodies = {name: body for name, body in case.bodies.items() if name in wanted}
    settings = mesh_settings(bodies, surfaces)
    factors = {s.name: family.factors(s) for s in settings}
    at = 1.0 if family.around else None
    others = {k: v for s in settings for k, v in s.at(at or factors[s.name][-1]).items()}
    total = 1 + sum(len(f) - 1 for f in factors.values())
    result: list[Measured] = []
    sizes: dict[str, tuple[float, int]] = {}
    reference = base.now
    if settings and not family.around:
        progress("meshes", 0.0)
        reference, _ = _run(applied(case, others), base.level, threads)
        log.runs += 1
    done = 1
    for setting in settings:
        runs: dict[float, ImpactHistory] = {}
        for factor in factors[setting.name]:
            if factor == (at or factors[setting.name][-1]):
                runs[factor] = reference
                continue
            try:
                runs[factor], dofs = _run(
                    applied(case, {**others, **setting.at(factor)}), base.level, threads
                )
                sizes[setting.name] = (factor, dofs)
            except KlackError as error:
                if factor <= 1.0 and not family.around:
                    raise
                log.notes.append(_no_run(setting, factor, error))
            log.runs += 1
            done += 1
            progress("meshes", done / total)
        if len(runs) < 2:
            log.notes.append(f"The error of '{setting.name}' is not in the sums.")
            continue
        order = _CONTACT_ORDER if setting.name.startswith("contact of") else _REST_ORDER
        words = ", ".join(f"{factor:.3g}" for factor in runs)
        result.append(
            Measured(
                setting=setting,
                ladder=history_ladder(list(runs), list(runs.values()), judged, order),
                runs=f"{base.level}{family.words}: sizes times {words}",
            )
        )
    layers = layer_setting(base.case.bodies)
    if layers is not None and min(v.at(_COARSE[0]) for v in layers.values) > 6:
        progress("layers", 0.0)
        coarse, _ = _run(applied(base.case, layers.at(_COARSE[0])), base.level, threads)
        log.runs += 1
        ladder = history_ladder(list(_COARSE), [coarse, base.now], judged, _LAYER_ORDER)
        words = " and ".join(f"{v.at(_COARSE[0]):g}" for v in layers.values[:1])
        result.append(
            Measured(
                setting=layers,
                ladder=ladder,
                runs=f"{base.level}: {layers.values[0].value:g} and {words} layers",
            )
        )
    return result, sizes


def _no_run(setting: Setting, factor: float, error: KlackError) -> str:
    how = f"{factor:.2g} times as coarse" if factor > 1.0 else f"{1.0 / factor:.2g} times as fine"
    return f"No run with '{setting.name}' {how}: {str(error).splitlines()[0]}"


def _run(case: Case, level: AdviceLevel, threads: int | None) -> tuple[ImpactHistory, int]:
    problem = build_problem(case, silent, threads=threads)
    try:
        pools = mode_pools(problem, at_least=1, progress=silent)
        pair = own_pair(problem, pools, stiffness=first_stiffness(problem))
        dofs = _dofs(problem.pair)
        if level == "reduced":
            return _reduced(case, pair, case.run.reduced_step), dofs
        model = build_interface(problem, pools, ports=pair.ports)
        return simulate_case(case, model).history, dofs
    finally:
        problem.close()


def _size_with(
    base: _Base,
    family: _Family,
    meshes: Sequence[Measured],
    sizes: Mapping[str, tuple[float, int]],
    changes: Mapping[Key, float],
) -> int:
    """Degrees of freedom of both bodies with other values; estimated for solids."""
    changed = {k: v for k, v in changes.items() if k[0] == "bodies"}
    if not changed:
        return base.dofs
    if base.case.dimension == 2:
        return _dofs(build_bodies(applied(base.case, changed), silent))
    sections = {k: v for k, v in changed.items() if k[-1] != "layers"}
    layers = [
        value / float(base.case.bodies[str(k[1])].geometry.layers or value)
        for k, value in changed.items()
        if k[-1] == "layers"
    ]
    ratio = max(layers, default=1.0)
    if family.case is not base.case:
        after = _dofs(build_bodies(applied(family.case, sections), silent))
        return round(base.dofs * ratio * after / family.dofs)
    dofs = float(base.dofs)
    for setting in (item.setting for item in meshes if item.setting.name in sizes):
        factor = min(v.factor_of(sections.get(v.key, v.value)) for v in setting.values)
        dofs += added(base.dofs, sizes[setting.name], factor, 3)
    return round(max(dofs, 1.0) * ratio)


def _growth(base: _Base, dofs: int) -> float:
    dimension = base.case.dimension
    return time_of(dofs, dimension) / time_of(base.dofs, dimension)


def _confirmed(
    base: _Base,
    family: _Family,
    meshes: Sequence[Measured],
    sizes: Mapping[str, tuple[float, int]],
    advice: Advice,
    log: _Log,
    progress: Progress,
    threads: int | None,
) -> Advice:
    """Compare both cases with one at least as fine as all runs and as both."""
    case = family.case
    finest = {k: v for k, v in advice.finest.items() if k[0] == "bodies" and k[-1] != "layers"}
    if meshes and not family.fine:
        return replace(advice, check_words="not run again: no finer meshes were affordable")
    if family.around:
        dofs = _size_with(base, family, meshes, sizes, finest)
    else:
        dofs = _dofs(build_bodies(applied(case, finest), silent))
    if not fits(dofs, case.dimension):
        needed = f"about {dofs:.2g} degrees of freedom, too many for the free memory"
        return replace(advice, check_words=f"not run again: the finest run has {needed}")
    progress("advised case", 0.0)
    advised_case = _advised(base, case, advice.changes)
    step = min(base.step / 2.0, _step_of(advised_case, base.level))
    reference = _richest(applied(case, finest), advised_case, step, threads)
    present = base.now if case is base.case else _run(case, base.level, threads)[0]
    progress("advised case", 0.5)
    advised, _ = _run(advised_case, base.level, threads)
    log.runs += 2 + (case is not base.case)
    progress("advised case", 1.0)
    checked = (
        impact_errors(reference, present, advice.up_to),
        impact_errors(reference, advised, advice.up_to),
    )
    on = "the finest meshes" if meshes else "the same meshes"
    return replace(
        advice,
        checked=checked,
        check_words=f"both run again{family.words}, against the interface level on {on}, with "
        "twice the modes and half the step, or as advised where that is finer",
    )


def _richest(case: Case, advised: Case, step: float, threads: int | None) -> ImpactHistory:
    """Interface level with twice the modes, or more if the advice has more."""
    problem = build_problem(case, silent, threads=threads)
    try:
        pools = mode_pools(problem, at_least=1, progress=silent)
        counts = {
            name: max(
                2 * counted(case.reduction.choice(name), pool),
                expected_count(advised.reduction.choice(name), pool),
            )
            for name, pool in pools.items()
        }
        richer = richer_pools(problem, counts, silent)
        pair = own_pair(problem, pools, stiffness=first_stiffness(problem))
        return interface_history(problem, richer, pair.ports, counts, step=step)
    finally:
        problem.close()


def _advised(base: _Base, case: Case, changes: Mapping[Key, float]) -> Case:
    if case is base.case:
        return applied(case, changes)
    known: dict[Key, float] = {}
    for key, value in changes.items():
        if key[-1] == "layers":
            continue
        if key[0] == "reduction":  # the twin keeps modes up to where the case does
            frequency = base.pools[str(key[2])].frequency
            top = (
                value
                if key[-1] == "frequency"
                else frequency[min(round(value), len(frequency)) - 1]
            )
            known[(*key[:-1], "frequency")] = 1.001 * float(top)
        else:
            known[key] = value
    return applied(case, known)
