"""``klack impact``: one dry impact at requested levels."""

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from time import perf_counter

import numpy as np

from klack.acoustics.comparison import compare_histories
from klack.analyses.impact.analysis import answer_so_far
from klack.analyses.impact.body_picture import body_pictures, with_peak_stress
from klack.analyses.impact.contact_check import (
    ContactCheck,
    check_contact,
    ends_reached,
    force_all_round,
)
from klack.analyses.impact.full_level import run_full
from klack.analyses.impact.gauges import with_reduced_gauges
from klack.analyses.impact.given_models import run_given_impact
from klack.analyses.impact.interface_level import (
    build_guide,
    certificate_modes,
    off_axis_within_reach,
    run_interface,
    simulate_case,
    within_reach,
)
from klack.analyses.impact.levels import deviations, law_summary, law_words, run_lumped, run_reduced
from klack.analyses.impact.record import (
    SETTLED,
    BodyPicture,
    ContactSummary,
    ImpactStudy,
    LawSummary,
    LevelResult,
    RunningIn,
    SectionPicture,
)
from klack.analyses.impact.running_in import asks_for_more, points_running_in, running_in
from klack.analyses.impact.section import section_picture
from klack.analyses.impact.three_bodies import run_three_bodies
from klack.analyses.impact.transfer import TRANSFER_MODES, compare_transfer
from klack.analyses.impact.trust import (
    DISAGREEMENT,
    STEPS_PER_CONTACT,
    best_level,
    disagreement,
    doubt_modal_levels,
    flat_for_modes,
    flat_for_reduced,
    trust_notes,
)
from klack.analyses.impact.yielding_level import (
    YieldingFaces,
    doubt_elastic_levels,
    doubt_large_strain,
    elastic_twin,
    tell_yield,
)
from klack.analyses.incomplete import Attempts, IncompleteImpactError, failure_notes
from klack.analyses.record import case_fields, run_fields
from klack.assembling.body_summary import BodySummary, summarise_body
from klack.assembling.bolts import struck_bolts
from klack.assembling.fits import press_fits
from klack.assembling.layers import layer_states
from klack.assembling.modes import (
    PARTICIPATION_POOL,
    kept_modes,
    mode_pools,
    participating,
    selection_of,
)
from klack.assembling.problem import (
    ContactProblem,
    PlacedBodies,
    contact_problem,
    place_bodies,
)
from klack.assembling.reduced_pair import (
    ReducedPair,
    classical_stiffness,
    first_stiffness,
    own_pair,
    recipe_stiffness,
    reduce_pair,
    static_curve,
)
from klack.assembling.structures import impact_structures
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.elasticity.loads import NearLoads
from klack.bodies.reduction.reduce import Correction
from klack.bodies.reduction.reduced_body import elastic_count
from klack.bodies.reduction.structure import Structure
from klack.bodies.reduction.transfer import TransferComparison
from klack.case.impact_sections import SubmodelLocalLaw
from klack.case.levels import Level
from klack.case.placed_errors import tells_place
from klack.case.schema import Case
from klack.contact.face_friction import FaceFriction
from klack.contact.history import ImpactHistory
from klack.contact.plasticity.loops import YieldingLoops
from klack.contact.pressure_limit import PressureLimit
from klack.contact.restitution import Deviation, measure_impact
from klack.contact.statics import (
    ReachError,
    StaticContact,
    StuckCompliance,
    static_contact,
    stuck_compliance,
)
from klack.contact.submodel import LocalStiffness
from klack.errors import AccuracyWarning, InputError
from klack.files.closing import Closing
from klack.machine.cache.result_cache import result_cache
from klack.machine.cores import available_cores, blas_threads
from klack.machine.progress import Progress, silent
from klack.machine.stages import (
    StageClock,
    collected_warnings,
    for_comparison,
    warnings_of,
)
from klack.transient.interface_model import InterfaceModel
from klack.transient.result import FullOrderResult
from klack.units import format_si

__all__ = ["ImpactBodies", "impact_bodies", "impact_of_bodies", "run_impact"]

# What a reduced level needs before it can run, beyond meshes and matrices.
_SET_UP = ("factorise", "static contact", "modes", "reduced")
_COARSER = 2.0**0.5  # a step that adds to an error of order two as much as it was
_KNOWN_ENDS, _FULL_ENDS = 0.25, 0.5  # of a step, both ends of a contact together
_CORRECTIONS: Mapping[str, Correction] = {
    "reduced-participation": "consistent",
    "reduced-attachment": "attachment",
    "reduced-none": "none",
}


@tells_place
def run_impact(
    case: Case,
    *,
    levels: Sequence[str],
    certify: bool = True,
    progress: Progress = silent,
    threads: int | None = None,
) -> ImpactStudy:
    """Compute one impact at several levels (:data:`klack.case.levels.LEVELS`) and compare them.

    Parameters
    ----------
    certify
        Estimate the error of reduced levels, and of the steps of the full order, by one
        interface-level run with twice as many modes; bodies without surfaces have no such level.
    threads
        Of the factorisations; the full order moves two bodies side by side on two cores.

    Raises
    ------
    IncompleteImpactError
        When a level fails: with the study of the others.
    """
    begin = perf_counter()
    wanted = case.require_levels(levels)
    _require_time_to_touch(case, case.contact.gap)
    if not case.has_surfaces:
        return run_given_impact(case, levels=wanted, progress=progress, threads=threads)
    if case.backing is not None:
        return run_three_bodies(case, progress=progress, threads=threads)
    clock = StageClock(progress, result_cache())
    with collected_warnings() as notes:
        placed = place_bodies(case, clock, threads=threads)
        _require_time_to_touch(case, placed.case.contact.gap)
    bodies = _with_modes(placed, notes, wanted, certify, clock)
    return _study(case, bodies, wanted, certify, begin, clock, threads, is_last=True)


@dataclass(frozen=True, kw_only=True, eq=False)
class ImpactBodies(Closing):
    """Bodies of an impact, the same for every speed, force, step and law.

    With as many modes as the levels of the impact need; notes are doubts about them.
    """

    placed: PlacedBodies
    pools: Mapping[str, Modes]
    notes: tuple[str, ...]

    def close(self) -> None:
        """Free the factorisations."""
        self.placed.close()


def impact_bodies(
    case: Case,
    *,
    levels: Sequence[str],
    certify: bool = True,
    progress: Progress = silent,
    threads: int | None = None,
) -> ImpactBodies:
    """Mesh, place, factorise and find the modes of an impact; see :func:`run_impact`."""
    with collected_warnings() as notes:
        placed = place_bodies(case, progress, threads=threads)
    return _with_modes(placed, notes, levels, certify, progress)


def _with_modes(
    placed: PlacedBodies,
    before: Sequence[str],
    levels: Sequence[str],
    certify: bool,
    progress: Progress,
) -> ImpactBodies:
    with collected_warnings() as notes, blas_threads(placed.threads):
        pools = mode_pools(
            placed,
            at_least=_modes_needed(placed.case, levels),
            rough=certificate_modes(placed.case)
            if certify and _estimated(placed.case, levels)
            else 0,
            progress=progress,
        )
    return ImpactBodies(placed=placed, pools=pools, notes=(*before, *notes))


def impact_of_bodies(
    case: Case,
    bodies: ImpactBodies,
    *,
    levels: Sequence[str],
    certify: bool = True,
    near: Mapping[str, NearLoads] | None = None,
    progress: Progress = silent,
) -> ImpactStudy:
    """Compute one impact of existing bodies, without mere comparisons.

    Its levels are those of :func:`run_impact`, bit for bit; the classical stiffness of the contact
    and the transfer functions are left out.

    Parameters
    ----------
    case
        With an upper stop, of this speed and these forces as well.
    bodies
        Of the same levels; they stay open.
    levels
        Without ``full``, which frees the factorisations first.
    near
        Of earlier impacts: the structures then depend on these to about 1e-6, the impact does not.
    """
    begin = perf_counter()
    wanted = case.require_levels(levels)
    _require_time_to_touch(case, bodies.placed.case.contact.gap)
    clock = StageClock(progress, result_cache())
    return _study(case, bodies, wanted, certify, begin, clock, None, is_last=False, near=near)


def _modes_needed(case: Case, levels: Sequence[str]) -> int:
    needed = [1]
    if case.run.transfer is not None:
        needed.append(TRANSFER_MODES)
    if "reduced-participation" in levels:
        needed.append(PARTICIPATION_POOL)
    return max(needed)


def _study(
    case: Case,
    bodies: ImpactBodies,
    wanted: Sequence[Level],
    certify: bool,
    begin: float,
    clock: StageClock,
    threads: int | None,
    *,
    is_last: bool,
    near: Mapping[str, NearLoads] | None = None,
) -> ImpactStudy:
    """One impact of these bodies; the last one frees them, and is compared with others."""
    blas = bodies.placed.threads
    with collected_warnings() as notes, blas_threads(blas):
        work = _Work(contact_problem(case, bodies.placed, clock), bodies)
        work.reduce(wanted, certify, clock)
        work.run_levels(wanted, clock)
        if certify and _estimated(case, wanted):
            work.estimate(wanted, clock)
        work.check_contact()
        if is_last and work.results and (set(wanted) & {"full"} or case.run.transfer is not None):
            for line in answer_so_far(work.study((), begin, clock)):
                clock.remark(line)
        work.find_structures(near, clock)
        if is_last:
            work.compare(clock)
            work.problem.close()
        if "full" in wanted:
            share = threads if blas is None else min(2, threads or available_cores())
            work.run_full(share, clock)
        work.attempts.require_one(work.results)
        work.check_ends()
    study = work.study(notes, begin, clock)
    if study.failures:
        raise IncompleteImpactError(study)
    return study


class _Work:
    def __init__(self, problem: ContactProblem, bodies: ImpactBodies) -> None:
        self.problem, self.bodies = problem, bodies
        self.case, self.pools = problem.case, bodies.pools
        self.attempts = Attempts()
        self.results: dict[str, LevelResult] = {}
        self.twins: dict[str, ImpactHistory] = {}
        self.ran: RunningIn | None = None
        self.certificate = _Certificate()
        self.classical: LocalStiffness | None = None
        self.stuck: StuckCompliance | None = None
        self.structures: tuple[Structure, ...] = ()
        self.transfer: tuple[TransferComparison, ...] = ()
        self.pictures: tuple[BodyPicture, ...] = ()
        self.sections: tuple[SectionPicture, ...] = ()

    def reduce(self, wanted: Sequence[Level], certify: bool, clock: StageClock) -> None:
        problem, pools = self.problem, self.pools
        clock("reduced", 0.0)
        with warnings_of("modes of the case"):
            self.own = own_pair(problem, pools, stiffness=first_stiffness(problem))
        self.peak = min(self.own.pattern_force, problem.static.max_force)
        self.yielding = YieldingFaces.of(
            problem,
            laws=bool({"reduced", "reduced-participation"} & set(wanted)),
            points="interface" in wanted or (certify and _has_reduced(wanted)),
            progress=clock,
        )
        loops = self.yielding.loops
        if isinstance(self.case.contact.local_law, SubmodelLocalLaw):
            self.classical = classical_stiffness(problem, self.peak)
            self.own = own_pair(problem, pools, stiffness=self.classical.stiffness)
        if loops is not None:
            with warnings_of("modes of the case"):
                self.own = own_pair(problem, pools, stiffness=first_stiffness(problem), loops=loops)
        self.kept = kept_modes(problem, pools, self.own.ports)
        self.flat = {
            "reduced": flat_for_reduced(problem, self.own),
            "interface": flat_for_modes(problem, self.kept.values()),
        }

    def run_levels(self, wanted: Sequence[Level], clock: StageClock) -> None:
        clock("reduced", 0.5)
        loops = self.yielding.loops
        for level in wanted:
            if level == "lumped":
                with self.attempts.at(level):
                    self.results[level] = run_lumped(self.problem)
            elif level.startswith("reduced"):
                with self.attempts.at(level), warnings_of(f"level '{level}'"):
                    self._run_reduced(level, clock)
        if loops is not None and "reduced" in self.results:
            self.ran = running_in(self.case, self.own, loops)
        clock("reduced", 1.0)
        if "interface" in wanted:
            with self.attempts.at("interface"), warnings_of("level 'interface'"):
                self.results["interface"], at_points = _run_interface(
                    self.problem,
                    self.pools,
                    self.own,
                    self.yielding.limit,
                    clock,
                    is_first=not self.twins,
                )
                self.ran = self.ran or at_points
        if self.ran is None and asks_for_more(self.case):
            warnings.warn(
                "run.impacts: all impacts equal the first, because no level with yield was "
                "computed or nothing yields. Try: level reduced (bodies in the meridian plane) "
                "or interface, and a material with 'yield'.",
                AccuracyWarning,
                stacklevel=2,
            )

    def _run_reduced(self, level: str, clock: StageClock) -> None:
        problem, loops = self.problem, self.yielding.loops
        pair = self.own if level == "reduced" else _variant(level, problem, self.pools, loops)
        setup = clock.spent((*_SET_UP, *(["faces that yield"] if pair.yields else [])))
        result = _run_variant(self.case, level, pair, setup_time=setup)
        self.results[level] = with_reduced_gauges(result, problem, pair)
        if pair.yields:
            self.twins[level] = elastic_twin(problem, pair)
            tell_yield(self.results[level], self.twins[level], _surfaces(self.case))
            assert loops is not None
            self.results[level] = doubt_large_strain(self.results[level], loops)

    def estimate(self, wanted: Sequence[Level], clock: StageClock) -> None:
        """Errors of the reduced levels, and of the steps of the full order to come."""
        limit = self.yielding.limit
        twins = self.twins if limit is None else {}
        richer = {name: pool.richer or pool for name, pool in self.pools.items()}
        found = for_comparison(
            "the error estimate",
            lambda: _certificate(
                self.problem, richer, self.results, twins, limit, "full" in wanted, clock
            ),
        )
        self.certificate = found or self.certificate

    def check_contact(self) -> None:
        worn = self.case.contact.worn
        static, loaded = _as_loaded(self.problem, self.results, self.peak)
        self.check = check_contact(
            self.case,
            self.problem.pair,
            static,
            loaded,
            _surfaces(self.case),
            worn_by=0.0 if worn is None else worn.force,
            has_yield=self.yielding.limit is not None or self.yielding.loops is not None,
        )
        what = "the compliance of the contact"
        self.stuck = for_comparison(what, lambda: _stuck(self.problem, static, loaded))

    def find_structures(self, near: Mapping[str, NearLoads] | None, clock: StageClock) -> None:
        clock("radiating surfaces", 0.0)
        self.structures = impact_structures(self.problem, self.pools, self.own, near)
        clock("radiating surfaces", 1.0)

    def compare(self, clock: StageClock) -> None:
        """Comparisons and pictures; failures cost nothing else."""
        problem, pools, own = self.problem, self.pools, self.own
        if self.classical is None:
            clock("classical stiffness", 0.0)
            what = "the stiffness of only the contact zone"
            self.classical = for_comparison(what, lambda: classical_stiffness(problem, self.peak))
        if self.case.run.transfer is not None:
            found = for_comparison(
                "the comparison of transfer functions",
                lambda: compare_transfer(problem, pools, own.ports, progress=clock),
            )
            self.transfer = found or ()
        clock("picture", 0.0)
        drawn = for_comparison(
            "the picture of the bodies",
            lambda: _pictures(problem, pools, own, self.results.get("reduced")),
        )
        self.pictures = drawn or ()
        clock("picture", 1.0)

    def run_full(self, threads: int | None, clock: StageClock) -> None:
        """Full order, after the static solutions are freed."""
        problem = self.problem
        with self.attempts.at("full"), warnings_of("level 'full'"):
            self.results["full"], run = run_full(
                problem, self.pools, kept=self.kept, progress=clock, threads=threads
            )
            self.sections = _sections(problem, run)
            self.pictures = _with_full_stress(problem, run, self.pictures)

    def check_ends(self) -> None:
        problem = self.problem
        self.check = ends_reached(
            self.check, problem.pair, problem.space, self.results, _surfaces(self.case)
        )

    def study(self, notes: Sequence[str], begin: float, clock: StageClock) -> ImpactStudy:
        case, certificate = self.case, self.certificate
        results = doubt_modal_levels(self.results, **self.flat)
        if not self.twins:
            _take_better(results, certificate)
        has_yield = [*self.twins, *(["interface"] if self.yielding.limit is not None else [])]
        results = doubt_elastic_levels(results, has_yield)
        sound = (name for name in self.twins if not results[name].doubts)
        reference = next(sound, best_level(results))
        compared = deviations(results, reference)
        failures = self.attempts.texts
        again = () if self.ran is None else self.ran.peak_force
        bolts = struck_bolts(case, max([results[reference].measures.peak_force, *again]))
        return ImpactStudy(
            **case_fields(case),
            speed=case.motion.speed,
            gap=case.contact.gap or 0.0,
            **run_fields(begin, clock),
            bodies=_summaries(self.problem, self.own),
            contact=replace(_contact_summary(self.problem, self.check), stuck=self.stuck),
            law=_law_summary(self.own, self.classical, self.peak),
            levels=results,
            reference=reference,
            deviations=compared,
            transfer=self.transfer,
            sections=self.sections,
            pictures=self.pictures,
            fits=tuple(fit for name in case.bodies for fit in press_fits(case, name)),
            bolts=bolts,
            layers=tuple(
                state
                for body in self.problem.bodies
                for state in layer_states(body, self.pools[body.name])
            ),
            warnings=(
                *failure_notes(failures),
                *dict.fromkeys([*self.bodies.notes, *notes]),
                *filter(None, (joint.opening_doubt for joint in bolts)),
                *trust_notes(results, reference, compared),
            ),
            failures=failures,
            running_in=self.ran,
            estimates=certificate.estimates,
            estimate_basis=certificate.basis,
            estimate_margins=certificate.margins,
            estimate_spread=certificate.spread,
            estimate_doubt=certificate.doubt,
            structures=self.structures,
        )


def _estimated(case: Case, levels: Sequence[str]) -> bool:
    endless = any(body.non_reflecting is not None for body in case.bodies.values())
    return _has_reduced(levels) or ("full" in levels and not endless)


def _has_reduced(levels: Sequence[str]) -> bool:
    return any(level.startswith("reduced") for level in levels)


def _require_time_to_touch(case: Case, gap: float | None) -> None:
    flight = (gap or 0.0) / case.motion.speed
    if not flight < case.run.duration:
        drawn = case.contact.gap is None
        at = f"{format_si(case.run.duration, 's')}, but first touch at {format_si(flight, 's')}"
        if drawn:
            at += f": the parts are drawn {format_si(gap or 0.0, 'm')} apart, without contact.gap"
        raise InputError(
            f"{case.path or 'case'}: run.duration",
            got=at,
            expected="a time that covers the impact",
            hint="give contact.gap (for example 0 um): the upper body is then moved there."
            if drawn
            else "enlarge run.duration or make contact.gap smaller.",
        )


def _run_interface(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    own: ReducedPair,
    limit: PressureLimit | None,
    clock: StageClock,
    *,
    is_first: bool,
) -> tuple[LevelResult, RunningIn | None]:
    """Interface level; the first with yielding faces reports them and runs them in."""
    clock("interface", 0.0)

    def run(model: InterfaceModel) -> tuple[LevelResult, RunningIn | None]:
        guide = build_guide(problem, model, pools, ports=own.ports)
        setup = clock.spent((*_SET_UP[:-1], "interface"))
        result = run_interface(problem, model, guide, setup_time=setup)
        if model.limit is not None and is_first:
            elastic = simulate_case(problem.case, model.elastic(), guide).history
            tell_yield(result, elastic, _surfaces(problem.case))
            return result, points_running_in(problem.case, model, guide)
        return result, None

    if problem.case.leaves_axis:
        result = off_axis_within_reach(problem, pools, run, ports=own.ports, limit=limit)
    else:
        result = within_reach(problem, pools, run, ports=own.ports, limit=limit)
    clock("interface", 1.0)
    return result


@dataclass(frozen=True, kw_only=True)
class _Certificate:
    estimates: Mapping[str, Deviation] = field(default_factory=dict)
    basis: str = ""
    margins: Mapping[str, Deviation] = field(default_factory=dict)
    spread: float = 0.0
    doubt: str = ""
    level: LevelResult | None = None


def _certificate(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    results: Mapping[str, LevelResult],
    twins: Mapping[str, ImpactHistory],
    limit: PressureLimit | None,
    full: bool,
    clock: StageClock,
) -> _Certificate:
    """Deviation of every reduced level from one interface-level run with more modes.

    The same run with half as many modes, in longer steps, tells how good a reference it is.
    With ``full``, it once more with the periods and steps of the full order gives what these do.
    Levels with a law of faces that yield are measured by ``twins`` without it where that run has
    no limit of the pressure.
    """
    clock("error estimate", 0.0)
    whole = [n for n in results if n.startswith("reduced") and not results[n].measures.cut_off]
    if not whole and _has_reduced(tuple(results)):
        return _Certificate(doubt="the run of the reduced level ends in contact")
    count, steps = certificate_modes(problem.case), problem.case.run
    histories = {name: twins.get(name, results[name].history) for name in whole}

    def run(model: InterfaceModel) -> tuple[InterfaceModel, LevelResult]:
        setup = clock.spent((*_SET_UP[:-1], "error estimate"))
        return model, run_interface(problem, model, None, setup_time=setup)

    def run_coarser(model: InterfaceModel) -> ImpactHistory:
        return simulate_case(problem.case, model, step=_COARSER * steps.interface_step).history

    def run_as_full(model: InterfaceModel) -> ImpactHistory:
        stepped = model.in_steps(steps.full_step)
        return simulate_case(problem.case, stepped, step=steps.full_step).history

    with warnings_of(f"error estimate, {count} modes"):
        model, level = within_reach(problem, pools, run, count=count, limit=limit)
        if full and level.measures.contact_time >= STEPS_PER_CONTACT * steps.full_step:
            histories["full"] = within_reach(problem, pools, run_as_full, count=count, limit=limit)
    history = level.history
    clock("error estimate", 0.5)
    with warnings_of(f"error estimate, {count // 2} modes"):
        fewer = within_reach(problem, pools, run_coarser, count=count // 2, limit=limit)
    names = (problem.pair.upper.name, problem.pair.lower.name)
    richer = (Modes(pools[n].omega[:count], pools[n].shapes[:, :count]) for n in names)
    elastic = model.omega > 0
    counts = [int(np.sum(elastic & (model.owner == body))) for body in (0, 1)]
    clock("error estimate", 1.0)
    basis = f"interface level, {counts[0]} + {counts[1]} modes, {model.count} contact points"
    if twins:
        basis += ", both with elastic bodies"
    if limit is not None:
        basis += ", yield by a pressure limit"
    apart = compare_histories(history, fewer)
    return _Certificate(
        estimates={name: compare_histories(history, one) for name, one in histories.items()},
        basis=basis,
        margins={
            name: _margin(apart, history, one, is_full=name == "full")
            for name, one in histories.items()
        },
        spread=apart.history_l2,
        doubt=next(iter(level.doubts), flat_for_modes(problem, richer)),
        level=level,
    )


def _margin(
    apart: Deviation, reference: ImpactHistory, other: ImpactHistory, *, is_full: bool
) -> Deviation:
    """How well two runs can be compared, by how far the reference is apart from a coarser one.

    Peaks may agree by chance while the histories do not: a peak is known no better than these.
    Contact begins and ends within a step; points of the full order (``is_full``) only at its end.
    """
    ends = _FULL_ENDS if is_full else _KNOWN_ENDS
    open_ends = max(_KNOWN_ENDS * reference.step, ends * other.step)
    return replace(
        apart,
        peak_force=max(abs(apart.peak_force), apart.history_l2),
        contact_time=max(
            abs(apart.contact_time), open_ends / measure_impact(reference).contact_time
        ),
        impulse=abs(apart.impulse),
        restitution=abs(apart.restitution),
    )


def _take_better(results: dict[str, LevelResult], certificate: _Certificate) -> None:
    """Add the run behind the estimates to the levels, where it is better."""
    level, best = certificate.level, best_level(results)
    if level is None or certificate.doubt or certificate.spread > SETTLED:
        return
    if best == "full" or best not in certificate.estimates:
        return
    if disagreement(certificate.estimates[best]) > DISAGREEMENT:
        results["interface"] = replace(level, label=f"{level.label}, run for the estimate")


def _variant(
    level: str,
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    loops: YieldingLoops | None,
) -> ReducedPair:
    names = (problem.pair.upper.name, problem.pair.lower.name)
    selection = {name: selection_of(problem.case.reduction.choice(name)) for name in names}
    if level == "reduced-participation":
        selection = participating(names)
    return reduce_pair(
        problem,
        pools,
        correction=_CORRECTIONS[level],
        selection=selection,
        stiffness=recipe_stiffness(problem.case),
        loops=loops,
    )


def _run_variant(case: Case, level: str, pair: ReducedPair, *, setup_time: float) -> LevelResult:
    correction = _CORRECTION_WORDS[pair.upper.correction]
    if pair.upper.correction == "attachment" and case.reduction.shifts:
        correction = f"shifted {correction}"
    counts = f"{elastic_count(pair.upper)} + {elastic_count(pair.lower)} modes"
    words = ", ".join(filter(None, (correction, _law_words(pair))))
    if level == "reduced-participation":
        words += ", modes by participation"
    return run_reduced(
        case, pair, level=level, label=f"reduced, {counts}, {words}", setup_time=setup_time
    )


_CORRECTION_WORDS = {"consistent": "", "attachment": "attachment modes", "none": "no correction"}


def _law_words(pair: ReducedPair) -> str:
    if pair.rubbing is not None:
        return "consistent law with friction"
    if pair.yields:
        return "consistent law with yield"
    if pair.local is not None:
        return "consistent law"
    return law_words(pair.law)


def _sections(problem: ContactProblem, run: FullOrderResult) -> tuple[SectionPicture, ...]:
    time = float(run.history.edges[run.peak_index + 1])
    bodies = (problem.pair.upper, problem.pair.lower)
    return tuple(
        section_picture(body.mesh, fields.peak_displacement, time, body.name)
        for body, fields in zip(bodies, run.fields, strict=True)
    )


def _pictures(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    own: ReducedPair,
    ran: LevelResult | None,
) -> tuple[BodyPicture, ...]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", AccuracyWarning)
        return body_pictures(problem, pools, own, ran)


def _with_full_stress(
    problem: ContactProblem, run: FullOrderResult, pictures: tuple[BodyPicture, ...]
) -> tuple[BodyPicture, ...]:
    bodies = {body.name: body for body in (problem.pair.upper, problem.pair.lower)}
    moved = {fields.name: fields.peak_displacement for fields in run.fields}
    return tuple(
        with_peak_stress(one, problem.case, bodies[one.body], moved[one.body])
        if one.body in moved
        else one
        for one in pictures
    )


def _summaries(problem: ContactProblem, own: ReducedPair) -> tuple[BodySummary, ...]:
    return tuple(
        summarise_body(
            problem.case, body, reduced, compliance_share=float(reduced.compliance_share[0])
        )
        for body, reduced in (
            (problem.pair.upper, own.upper),
            (problem.pair.lower, own.lower),
        )
    )


def _as_loaded(
    problem: ContactProblem, results: Mapping[str, LevelResult], peak: float
) -> tuple[StaticContact, float]:
    """Static contact that is judged, and its force.

    Axisymmetric bodies off-axis load a part of their ring: it is judged as a centred contact that
    is loaded as much all round, as far as that stays within the candidates.
    """
    level = results.get("interface")
    if not problem.case.leaves_axis or level is None or level.pressure is None:
        return problem.static, peak
    force = force_all_round(level.pressure, float(level.measures.peak_force))
    if force <= problem.static.max_force:
        return problem.static, force
    try:
        heavier = static_contact(problem.space, problem.static.compliance, force)
    except ReachError:
        return problem.static, problem.static.max_force
    return heavier, force


def _stuck(problem: ContactProblem, static: StaticContact, force: float) -> StuckCompliance | None:
    """Compliance while all points stick; solids without friction save its solves."""
    pair, faces = problem.pair, problem.case.contact.faces
    if problem.pair.layer is not None or (static.space.dimension == 3 and faces.is_none):
        return None
    sides = (pair.upper.mesh, pair.upper_surface, pair.lower.mesh, pair.lower_surface)
    rows = FaceFriction.on(faces, static.space, *sides)
    bodies = (problem.flexibility_upper, problem.flexibility_lower)
    return stuck_compliance(static, min(force, static.max_force), rows, *bodies)


def _surfaces(case: Case) -> str:
    return f"{case.contact.moving} on {case.contact.stop}"


def _contact_summary(problem: ContactProblem, check: ContactCheck) -> ContactSummary:
    static, rough = problem.static, problem.case.contact.roughness
    return ContactSummary(
        surfaces=_surfaces(problem.case),
        points=static.space.count,
        half_width=check.half_width,
        size_ratio=check.size_ratio,
        points_across=check.points_across,
        doubts=check.doubts,
        needed_yield=check.needed_yield,
        layer="" if rough is None else rough.in_words,
        approach=static.approach,
        force=static.force,
        area=static.area,
    )


def _law_summary(pair: ReducedPair, classical: LocalStiffness | None, peak: float) -> LawSummary:
    indentation, force = static_curve(pair)
    share = np.append(np.nan, pair.local.share) if pair.local else np.full(len(force), np.nan)
    kind = "consistent" if pair.local is not None else "given"
    return law_summary(kind, indentation, force, share, peak, classical)
