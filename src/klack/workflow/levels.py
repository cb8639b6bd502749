"""One impact at one level: lumped, reduced in its variants, or full order."""

import warnings
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from klack.acoustics.comparison import compare_histories
from klack.case.schema import (
    Case,
    HertzLocalLaw,
    LinearLocalLaw,
    ModeChoice,
    SubmodelLocalLaw,
)
from klack.contact.history import BodyEnergy, ImpactHistory
from klack.contact.laws import (
    ContactLaw,
    HertzLaw,
    HuntCrossley,
    LinearLaw,
    gonthier_coefficient,
)
from klack.contact.local_law import LocalLaw, OverfullModesError, consistent_law
from klack.contact.mortar import ContactSpace
from klack.contact.restitution import Deviation, measure_impact
from klack.contact.statics import ReachError
from klack.contact.submodel import LocalStiffness, local_stiffness
from klack.elasticity.body import ElasticBody
from klack.elasticity.eigen import Modes, eigenmodes
from klack.elasticity.statics import Flexibility
from klack.errors import AccuracyWarning, InputError
from klack.reduction.ports import Port
from klack.reduction.reduce import Correction, reduce_body
from klack.reduction.reduced_body import ReducedBody
from klack.reduction.selection import ByCount, ByFrequency, ByParticipation, ModeSelection, select
from klack.simulation.bodies import fixed_body, rigid_mass_body
from klack.simulation.impact import simulate_impact
from klack.simulation.system import AxialForce, ContactPair, ReducedSystem, ReturnSpring
from klack.transient.body_damping import BodyDamping, body_damping
from klack.transient.full_order import simulate_full_order
from klack.transient.result import FullOrderResult, Snapshots
from klack.workflow.damping_choice import damping_of
from klack.workflow.pressure import pressure_record
from klack.workflow.problem import ContactProblem
from klack.workflow.progress import Progress
from klack.workflow.stages import show, trial
from klack.workflow.study import LevelResult, ModalEnergy, PressureRecord
from klack.workflow.trust import doubts_of

__all__ = [
    "PARTICIPATION_POOL",
    "PORT",
    "ReducedPair",
    "classical_stiffness",
    "damping_of",
    "deviations",
    "elastic_count",
    "first_stiffness",
    "hertz_coefficient",
    "impact_system",
    "is_damped",
    "kept_modes",
    "level_result",
    "lumped_level",
    "mode_pool",
    "mode_pools",
    "own_pair",
    "participating",
    "reduce_pair",
    "run_full",
    "run_lumped",
    "run_reduced",
    "selection_of",
    "simulate_in_full",
    "static_curve",
]

PORT = "contact"
"""Name of the contact port of both bodies."""

# The pattern of the port is taken at the peak force, which depends on it weakly.
_PATTERN_ROUNDS = 3
_CLASSICAL_SIZE = 3.0  # radius of the contact submodel over the half width of the contact
PARTICIPATION_POOL = 100
"""Modes of each body from which the level ``reduced-participation`` chooses."""

_PARTICIPATING = (8, 20)  # of the upper and of the lower body


@dataclass(frozen=True, kw_only=True, eq=False)
class ReducedPair:
    """Both bodies reduced for one contact, and the local law that goes with them.

    Parameters
    ----------
    upper, lower : ReducedBody
    ports : pair of Port
        Contact ports of the upper and of the lower body, resultant +1 N along z each.
    law : contact law
    local : LocalLaw or None
        The consistent law with its shares; None for another kind.
    pattern_force : float [N]
        Force at which the pressure pattern of the port was taken.
    """

    upper: ReducedBody
    lower: ReducedBody
    ports: tuple[Port, Port]
    law: ContactLaw
    local: LocalLaw | None
    pattern_force: float


def selection_of(choice: ModeChoice) -> ModeSelection:
    """Selection of modes that a case asks for."""
    if choice.count is not None:
        return ByCount(choice.count)
    if choice.frequency is not None:
        return ByFrequency(choice.frequency)
    return ByParticipation(choice.participation or 1, choice.pool or 1)


def mode_pools(
    problem: ContactProblem, *, at_least: int, progress: Progress
) -> Mapping[str, Modes]:
    """Elastic modes of all bodies: as many as the case needs, and no fewer than ``at_least``."""
    bodies = [problem.pair.upper, problem.pair.lower]
    flexibilities = [problem.flexibility_upper, problem.flexibility_lower]
    if problem.opposite is not None:
        bodies.append(problem.opposite.body)
        flexibilities.append(problem.opposite.flexibility)
    progress("modes", 0.0)
    # the triangular solves run outside of the interpreter: two bodies keep two cores busy
    with ThreadPoolExecutor(max_workers=len(bodies)) as workers:
        jobs = [
            workers.submit(
                mode_pool,
                selection_of(problem.case.reduction.choice(body.name)),
                body,
                flexibility,
                at_least=at_least,
            )
            for body, flexibility in zip(bodies, flexibilities, strict=True)
        ]
        pools = [job.result() for job in jobs]
    progress("modes", 1.0)
    return {body.name: pool for body, pool in zip(bodies, pools, strict=True)}


def mode_pool(
    choice: ModeSelection, body: ElasticBody, flexibility: Flexibility, *, at_least: int = 1
) -> Modes:
    """Elastic modes of a body that a selection can choose from."""
    count = at_least
    if isinstance(choice, ByCount):
        count = max(count, choice.count)
    elif isinstance(choice, ByParticipation):
        count = max(count, choice.pool)
    count = min(count, len(body.free) - body.rigid_modes.shape[1])
    pool = eigenmodes(body, count=count, flexibility=flexibility)
    if isinstance(choice, ByFrequency) and pool.frequency[-1] < choice.maximum:
        return eigenmodes(body, max_frequency=choice.maximum, flexibility=flexibility)
    return pool


def classical_stiffness(problem: ContactProblem, peak_force: float) -> LocalStiffness:
    """Constant stiffness of the contact zone alone, as the classical recipe takes it."""
    law = problem.case.contact.local_law
    width = problem.static.half_width_at(min(peak_force, problem.static.max_force))
    size = law.size if isinstance(law, SubmodelLocalLaw) else _CLASSICAL_SIZE * width
    return local_stiffness(
        problem.static,
        problem.pair.upper,
        problem.pair.lower,
        size=size,
        cache=problem.flexibility_upper.cache,
    )


def first_stiffness(problem: ContactProblem) -> float:
    """Secant of the static contact [N/m], good enough to find the order of the peak force."""
    return problem.static.max_force / float(problem.static.approach[-1])


def own_pair(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    *,
    stiffness: float,
    recovery: bool = False,
) -> ReducedPair:
    """Reduce both bodies as the case asks for; see :func:`reduce_pair`.

    Warns
    -----
    AccuracyWarning
        When fewer modes than asked for were kept, so that a compliance is left to the local law.
    """
    reduction = problem.case.reduction
    names = (problem.pair.upper.name, problem.pair.lower.name)
    asked = {name: selection_of(reduction.choice(name)) for name in names}
    selection = asked
    while True:
        try:
            pair = reduce_pair(
                problem,
                pools,
                correction=reduction.correction,
                selection=selection,
                stiffness=stiffness,
                recovery=recovery,
            )
        except OverfullModesError:
            fewer = {name: _fewer(choice) for name, choice in selection.items()}
            if fewer == selection:
                raise
            selection = fewer
            continue
        break
    if selection != asked:
        counts = [f"{elastic_count(b)} of '{b.name}'" for b in (pair.upper, pair.lower)]
        warnings.warn(
            f"contact: only {' and '.join(counts)} of the modes asked for are kept: more of them "
            "would carry more than the static compliance of this contact and leave none to the "
            "local law. The interface level keeps them all.",
            AccuracyWarning,
            stacklevel=2,
        )
    return pair


def _fewer(choice: ModeSelection) -> ModeSelection:
    """About two thirds of so many lowest modes; another choice as it is."""
    return ByCount(max(1, 2 * choice.count // 3)) if isinstance(choice, ByCount) else choice


def reduce_pair(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    *,
    correction: Correction,
    selection: Mapping[str, ModeSelection],
    stiffness: float,
    recovery: bool = False,
) -> ReducedPair:
    """Reduce both bodies at the contact, with the port pattern taken at the peak force.

    Parameters
    ----------
    problem : ContactProblem
    pools : mapping of body name to Modes
    correction : "consistent", "attachment" or "none"
    selection : mapping of body name to ModeSelection
    stiffness : float [N/m]
        Of the local contact, for corrections that do not compute their own law.
    recovery : bool
        Keep the displacement of all named surfaces.
    """
    force = 0.7 * problem.static.max_force
    for _ in range(_PATTERN_ROUNDS):
        with trial() as caught:
            pair = _reduce_at(problem, pools, force, correction, selection, stiffness, recovery)
            peak = float(np.max(_simulate(problem.case, pair).peak_force))
        settled = abs(peak - force) <= 0.02 * force
        force = min(peak, problem.static.max_force)
        if settled or not force > 0:
            break
    show(caught)
    return pair


def _reduce_at(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    force: float,
    correction: Correction,
    selection: Mapping[str, ModeSelection],
    stiffness: float,
    recovery: bool,
) -> ReducedPair:
    load_upper, load_lower = problem.static.load_patterns(force)
    ports = (Port(PORT, load_upper), Port(PORT, -load_lower))
    bodies = (problem.pair.upper, problem.pair.lower)
    flexibilities = (problem.flexibility_upper, problem.flexibility_lower)
    upper, lower = (
        reduce_body(
            body,
            [port],
            modes=selection[body.name],
            correction=correction,
            damping=damping_of(problem.case.bodies[body.name].damping),
            modes_pool=pools[body.name],
            flexibility=flexibility,
            recovery_surfaces=tuple(body.mesh.surfaces) if recovery else (),
        )
        for body, port, flexibility in zip(bodies, ports, flexibilities, strict=True)
    )
    law, local = _law(problem, correction, upper, lower, stiffness)
    return ReducedPair(
        upper=upper, lower=lower, ports=ports, law=law, local=local, pattern_force=force
    )


def _law(
    problem: ContactProblem,
    correction: Correction,
    upper: ReducedBody,
    lower: ReducedBody,
    stiffness: float,
) -> tuple[ContactLaw, LocalLaw | None]:
    asked = problem.case.contact.local_law
    if isinstance(asked, LinearLocalLaw):
        return LinearLaw(asked.stiffness), None
    if isinstance(asked, HertzLocalLaw):
        return HertzLaw(hertz_coefficient(problem.case, asked)), None
    if isinstance(asked, SubmodelLocalLaw) or correction != "consistent":
        return LinearLaw(stiffness), None
    modal = float(upper.modal_compliance[0, 0] + lower.modal_compliance[0, 0])
    local = consistent_law(problem.static, modal)
    return local.law, local


def hertz_coefficient(case: Case, law: HertzLocalLaw) -> float:
    """4/3 E* sqrt(R) [N/m^1.5] with the given modulus, or the materials of the two bodies."""
    if law.modulus is not None:
        return 4.0 / 3.0 * law.modulus * float(np.sqrt(law.radius))
    inverse = 0.0
    for name, body in case.bodies.items():
        if not isinstance(body.material, str):
            raise InputError(
                f"{case.path or 'case'}: contact.local_law",
                got=f"a Hertz law on body '{name}' of several materials",
                expected="bodies of one material",
                hint="take the consistent law, which needs no such choice.",
            )
        inverse += 1.0 / case.materials_of(name, [name])[name].plane_strain_modulus
    return 4.0 / 3.0 / inverse * float(np.sqrt(law.radius))


def run_reduced(
    case: Case, pair: ReducedPair, *, level: str, label: str, setup_time: float
) -> LevelResult:
    """Impact of two reduced bodies."""
    _simulate(case, pair)  # compiles, so that the time below is that of the run
    begin = perf_counter()
    history = _simulate(case, pair)
    wall_time = perf_counter() - begin
    return level_result(
        history,
        level=level,
        label=label,
        dofs=pair.upper.mode_count + pair.lower.mode_count,
        step=case.run.reduced_step,
        wall_time=wall_time,
        setup_time=setup_time,
    )


def _simulate(case: Case, pair: ReducedPair) -> ImpactHistory:
    return _simulate_bodies(case, pair.upper, pair.lower, pair.law)


def impact_system(
    case: Case,
    upper: ReducedBody,
    lower: ReducedBody,
    law: ContactLaw,
    *,
    ports: tuple[str, str] = (PORT, PORT),
    series_compliance: float = 0.0,
) -> ReducedSystem:
    """Both bodies of a case, their contact, and the force and spring that act on the upper one.

    Parameters
    ----------
    case : Case
    upper, lower : ReducedBody
    law : contact law
    ports : pair of str
        Where they meet, on the upper and on the lower body.
    series_compliance : float [m/N]
        In series with the law.
    """
    contact = ContactPair(
        body_a=upper.name,
        port_a=ports[0],
        body_b=lower.name,
        port_b=ports[1],
        law=law,
        gap=_gap(case),
        series_compliance=series_compliance,
    )
    spring = case.motion.spring
    closing = case.motion.force
    springs: tuple[ReturnSpring, ...] = ()
    if spring is not None:
        # the preload is the force at first touch; a gap above it the spring pushes harder
        closing += spring.preload + spring.stiffness * _gap(case)
        springs = (ReturnSpring(body=upper.name, port=ports[0], stiffness=spring.stiffness),)
    forces: tuple[AxialForce, ...] = ()
    if closing != 0:
        forces = (AxialForce(body=upper.name, force=-closing),)
    return ReducedSystem(bodies=(upper, lower), contacts=(contact,), forces=forces, springs=springs)


def _simulate_bodies(
    case: Case, upper: ReducedBody, lower: ReducedBody, law: ContactLaw
) -> ImpactHistory:
    return simulate_impact(
        impact_system(case, upper, lower, law),
        speed=case.motion.speed,
        duration=case.run.duration,
        step=case.run.reduced_step,
    )


def _gap(case: Case) -> float:
    return case.contact.gap or 0.0


def run_lumped(problem: ContactProblem) -> LevelResult:
    """Impact of rigid masses on one spring, with or without loss: the baseline."""
    bodies = (problem.pair.upper, problem.pair.lower)
    masses = {body.name: None if body.is_fixed else body.mass for body in bodies}
    return lumped_level(problem.case, masses)


def lumped_level(case: Case, masses: Mapping[str, float | None]) -> LevelResult:
    """Impact of rigid masses: upper body, then lower body; None for one that is held."""
    if case.lumped is None:  # refused by require_levels already
        raise InputError(
            "lumped", got="no stiffness", expected="lumped.stiffness", hint="add it to the case."
        )
    bodies = [
        fixed_body(name, port=PORT) if mass is None else rigid_mass_body(name, mass, port=PORT)
        for name, mass in masses.items()
    ]
    law: ContactLaw = LinearLaw(case.lumped.stiffness)
    if case.lumped.restitution is not None:
        alpha = gonthier_coefficient(case.lumped.restitution)
        law = HuntCrossley(LinearLaw(case.lumped.stiffness), alpha / case.motion.speed)
    begin = perf_counter()
    history = _simulate_bodies(case, bodies[0], bodies[1], law)
    return level_result(
        history,
        level="lumped",
        label=f"lumped: rigid masses, {case.lumped.stiffness / 1e6:.4g} N/um",
        dofs=sum(body.mode_count for body in bodies),
        step=case.run.reduced_step,
        wall_time=perf_counter() - begin,
        setup_time=0.0,
    )


def simulate_in_full(
    problem: ContactProblem,
    *,
    kept: Mapping[str, Modes],
    progress: Progress,
    threads: int | None,
    space: ContactSpace | None = None,
    longest_period: float = 0.0,
    snapshots: Snapshots | None = None,
) -> FullOrderResult:
    """Move the bodies of a case with every degree of freedom.

    Parameters
    ----------
    problem : ContactProblem
    kept : mapping of body name to Modes
        Elastic modes that the reduced levels keep: a damping ratio acts on these, as it does
        there.  Only damped bodies are looked up.
    progress : callable
    threads : int or None
    space : ContactSpace, optional
        Other contact points of the same surfaces than those of the static contact.
    longest_period : float [s]
    snapshots : Snapshots, optional
        Both as in :func:`klack.transient.full_order.simulate_full_order`.

    Raises
    ------
    ReachError
        Where the motion reaches farther than the contact points.
    """
    case, pair = problem.case, problem.pair
    spring = case.motion.spring
    stiffness = 0.0 if spring is None else spring.stiffness
    progress("full order", 0.0)
    return simulate_full_order(
        pair.upper,
        pair.lower,
        problem.space if space is None else space,
        speed=case.motion.speed,
        duration=case.run.duration,
        step=case.run.full_step,
        # the preload is the force at first touch; a gap above it the spring pushes harder
        axial_force=-(case.motion.closing_force + stiffness * _gap(case)),
        spring_stiffness=stiffness,
        damping=(_damping(case, pair.upper, kept), _damping(case, pair.lower, kept)),
        longest_period=longest_period,
        threads=threads or 2,
        progress=lambda fraction: progress("full order", fraction),
        snapshots=snapshots,
    )


def is_damped(case: Case, name: str) -> bool:
    """Tell whether a case gives a body any damping."""
    return bool(damping_of(case.bodies[name].damping).ratios([1.0])[0] > 0.0)


def kept_modes(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    ports: tuple[Port, Port] | None = None,
) -> dict[str, Modes]:
    """Elastic modes of both bodies that the reduced level keeps.

    Parameters
    ----------
    problem : ContactProblem
    pools : mapping of body name to Modes
    ports : pair of Port, optional
        Contact ports, for modes chosen by participation; near the highest force without.
    """
    if ports is None:
        loads = problem.static.load_patterns(0.7 * problem.static.max_force)
    else:
        loads = (ports[0].pattern, ports[1].pattern)
    kept = {}
    for body, load in zip((problem.pair.upper, problem.pair.lower), loads, strict=True):
        pool = pools[body.name]
        selection = selection_of(problem.case.reduction.choice(body.name))
        chosen = select(selection, pool.omega, pool.shapes.T @ load[:, None])
        kept[body.name] = Modes(pool.omega[chosen], pool.shapes[:, chosen])
    return kept


def _damping(case: Case, body: ElasticBody, kept: Mapping[str, Modes]) -> BodyDamping | None:
    if not is_damped(case, body.name):
        return None
    return body_damping(damping_of(case.bodies[body.name].damping), kept[body.name])


def run_full(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    *,
    kept: Mapping[str, Modes],
    progress: Progress,
    threads: int | None,
) -> tuple[LevelResult, FullOrderResult]:
    """Impact with every degree of freedom, on as many contact points as the motion reaches.

    ``kept`` as in :func:`simulate_in_full`.
    """
    case, pair, space = problem.case, problem.pair, problem.space
    while True:
        try:
            result = simulate_in_full(
                problem,
                kept=kept,
                space=space,
                longest_period=_longest_period(pools[pair.upper.name]),
                progress=progress,
                threads=threads,
            )
        except ReachError as error:
            space = problem.wider(space, error)
        else:
            break
    history = replace(
        result.history,
        ledger=replace(
            result.history.ledger,
            bodies=tuple(
                _with_modes(energy, body, pools[body.name], result)
                for energy, body in zip(
                    result.history.ledger.bodies, (pair.upper, pair.lower), strict=True
                )
            ),
        ),
    )
    statistics = result.statistics
    level = level_result(
        history,
        level="full",
        label=f"full order, {statistics.degrees_of_freedom} degrees of freedom",
        dofs=statistics.degrees_of_freedom,
        step=case.run.full_step,
        wall_time=statistics.loop_time,
        setup_time=statistics.set_up_time,
        pressure=pressure_record(history, result.point_force, space.points, space.area),
    )
    return level, result


def _longest_period(pool: Modes) -> float:
    return float(2.0 * np.pi / pool.omega[0]) if len(pool.omega) else 0.0


def _with_modes(
    energy: BodyEnergy, body: ElasticBody, pool: Modes, result: FullOrderResult
) -> BodyEnergy:
    """Add the energy of every mode of the pool, from the fields at the end of the run."""
    fields = next(item for item in result.fields if item.name == body.name)
    weighted = body.M @ pool.shapes
    q, v = weighted.T @ fields.end_displacement, weighted.T @ fields.end_velocity
    return replace(
        energy,
        frequency=pool.frequency,
        modal=0.5 * (v**2 + (pool.omega * q) ** 2),
    )


def level_result(
    history: ImpactHistory,
    *,
    level: str,
    label: str,
    dofs: int,
    step: float,
    wall_time: float,
    setup_time: float,
    pressure: PressureRecord | None = None,
) -> LevelResult:
    """Measures and energies of one computed impact."""
    ledger = history.ledger
    result = LevelResult(
        level=level,
        label=label,
        history=history,
        measures=measure_impact(history),
        degrees_of_freedom=dofs,
        steps=_steps(history, step),
        step=step,
        wall_time=wall_time,
        setup_time=setup_time,
        energies=ledger.parts(),
        energy_residual=ledger.residual,
        modal_energy=tuple(
            ModalEnergy(body=body.name, frequency=body.frequency, energy=body.modal)
            for body in ledger.bodies
            if len(body.modal)
        ),
        pressure=pressure,
    )
    return replace(result, doubts=doubts_of(result))


def _steps(history: ImpactHistory, step: float) -> int:
    return round(len(history.force) * history.step / step)


def participating(pair_names: tuple[str, str]) -> dict[str, ModeSelection]:
    """The 8 + 20 modes of 100 that carry most of the compliance at the contact."""
    return {
        name: ByParticipation(count, PARTICIPATION_POOL)
        for name, count in zip(pair_names, _PARTICIPATING, strict=True)
    }


def deviations(results: Mapping[str, LevelResult], reference: str) -> dict[str, Deviation]:
    """Compare every level with the reference: none where that has doubts, none that is cut off."""
    if results[reference].doubts:
        return {}
    return {
        name: compare_histories(results[reference].history, result.history)
        for name, result in results.items()
        if name != reference and not result.measures.cut_off
    }


def elastic_count(body: ReducedBody) -> int:
    """Number of elastic modes without attachment modes."""
    return body.mode_count - body.rigid_count - body.attachment_count


def static_curve(pair: ReducedPair) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (indentation [m], force [N]) of the local law, for a picture."""
    if pair.local is not None:
        return np.append(0.0, pair.local.force_indentation), np.append(0.0, pair.local.force)
    indentation = np.linspace(0.0, _indentation_at(pair.law, 1.2 * pair.pattern_force), 50)
    return indentation, pair.law.force(indentation)


def _indentation_at(law: ContactLaw, force: float) -> float:
    upper = 1e-9
    while float(law.force(upper)) < force:
        upper *= 1.3
    return upper
