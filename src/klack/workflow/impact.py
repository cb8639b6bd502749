"""``klack impact``: one dry impact at the levels asked for, laid over each other."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import version
from time import perf_counter

import numpy as np

from klack import __version__
from klack.acoustics.comparison import compare_histories
from klack.cache.setting import result_cache
from klack.case.schema import Case, SubmodelLocalLaw
from klack.contact.history import ImpactHistory
from klack.contact.laws import LinearLaw
from klack.contact.restitution import Deviation
from klack.contact.submodel import LocalStiffness
from klack.elasticity.eigen import Modes
from klack.errors import InputError
from klack.reduction.reduce import Correction
from klack.reduction.transfer import TransferComparison
from klack.transient.interface_model import InterfaceModel
from klack.transient.result import FullOrderResult
from klack.workflow.body_summary import summarise_body
from klack.workflow.contact_check import ContactCheck, check_contact, ends_reached
from klack.workflow.given_impact import run_given_impact
from klack.workflow.interface_level import (
    build_guide,
    certificate_modes,
    run_interface,
    simulate_case,
    within_reach,
)
from klack.workflow.levels import (
    PARTICIPATION_POOL,
    ReducedPair,
    classical_stiffness,
    deviations,
    elastic_count,
    first_stiffness,
    mode_pools,
    own_pair,
    participating,
    reduce_pair,
    run_full,
    run_lumped,
    run_reduced,
    selection_of,
    static_curve,
)
from klack.workflow.problem import ContactProblem, build_problem
from klack.workflow.progress import Progress, silent
from klack.workflow.section import section_picture
from klack.workflow.stages import LIBRARIES, StageClock, collected_warnings, warnings_of
from klack.workflow.structures import impact_structures
from klack.workflow.study import (
    BodySummary,
    ContactSummary,
    ImpactStudy,
    LawSummary,
    LevelResult,
    SectionPicture,
)
from klack.workflow.transfer import TRANSFER_MODES, compare_transfer

__all__ = ["run_impact"]

# What a reduced level needs before it can run, beyond meshes and matrices.
_SET_UP = ("factorise", "static contact", "modes", "reduced")
_CORRECTIONS: Mapping[str, Correction] = {
    "reduced-participation": "consistent",
    "reduced-attachment": "attachment",
    "reduced-none": "none",
}
_USUAL_STIFFNESS = 1e9
"""Contact stiffness [N/m] that the literature puts beside modes, corrected or not."""


def run_impact(
    case: Case,
    *,
    levels: Sequence[str],
    certify: bool = True,
    progress: Progress = silent,
    threads: int | None = None,
) -> ImpactStudy:
    """Compute one impact at several levels and compare them.

    Parameters
    ----------
    case : Case
    levels : sequence of str
        Among :data:`klack.case.schema.LEVELS`.
    certify : bool
        Estimate the error of reduced levels by one interface-level run with twice as many modes;
        bodies without surfaces have no such level.
    progress : callable
        Called with stage and fraction.
    threads : int, optional
        Of the factorisations; the full order moves two bodies side by side on two cores.

    Returns
    -------
    ImpactStudy
    """
    begin = perf_counter()
    wanted = case.require_levels(levels)
    _require_time_to_touch(case)
    if not case.has_surfaces:
        return run_given_impact(case, levels=wanted, progress=progress, threads=threads)
    clock = StageClock(progress, result_cache())
    with collected_warnings() as notes:
        problem = build_problem(case, clock, threads=threads)
        needed = [1]
        if case.run.transfer is not None:
            needed.append(TRANSFER_MODES)
        if "reduced-participation" in wanted:
            needed.append(PARTICIPATION_POOL)
        reduced = [level for level in wanted if level.startswith("reduced")]
        if certify and reduced:
            needed.append(certificate_modes(case))
        pools = mode_pools(problem, at_least=max(needed), progress=clock)
        clock("reduced", 0.0)
        with warnings_of("modes of the case"):
            preview = own_pair(problem, pools, stiffness=first_stiffness(problem))
        peak = min(preview.pattern_force, problem.static.max_force)
        classical = classical_stiffness(problem, peak)
        own = preview
        if isinstance(case.contact.local_law, SubmodelLocalLaw):  # no other law asks for it
            own = own_pair(problem, pools, stiffness=classical.stiffness)
        results: dict[str, LevelResult] = {}
        for level in wanted:
            if level == "lumped":
                results[level] = run_lumped(problem)
            elif level.startswith("reduced"):
                pair = own if level == "reduced" else _variant(level, problem, pools)
                setup = clock.spent(_SET_UP)
                with warnings_of(f"level '{level}'"):
                    results[level] = _run_variant(case, level, pair, setup_time=setup)
        clock("reduced", 1.0)
        if "interface" in wanted:
            with warnings_of("level 'interface'"):
                results["interface"] = _run_interface(problem, pools, own, clock)
        certificate = _certificate(problem, pools, results if certify else {}, clock)
        transfer: tuple[TransferComparison, ...] = ()
        if case.run.transfer is not None:
            transfer = compare_transfer(problem, pools, own.ports, progress=clock)
        clock("radiating surfaces", 0.0)
        structures = impact_structures(problem, pools, own)
        clock("radiating surfaces", 1.0)
        check = check_contact(case, problem.pair, problem.static, peak, _surfaces(case))
        problem.close()
        sections: tuple[SectionPicture, ...] = ()
        if "full" in wanted:
            with warnings_of("level 'full'"):
                results["full"], run = run_full(problem, pools, progress=clock, threads=threads)
            sections = _sections(problem, run)
        check = ends_reached(check, problem.pair, problem.space, results, _surfaces(case))
    # the best of what was run; the lumped model is nobody's reference
    best = (name for name in ("full", "interface", "reduced") if name in results)
    reference = next(best, next(iter(results)))
    return ImpactStudy(
        case=case.name,
        title=case.title,
        description=case.description.strip(),
        case_text=case.source,
        speed=case.motion.speed,
        gap=case.contact.gap or 0.0,
        version=__version__,
        versions={name: version(name) for name in LIBRARIES},
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        wall_time=perf_counter() - begin,
        stage_times=clock.times(),
        bodies=_summaries(problem, own),
        contact=_contact_summary(problem, check),
        law=_law_summary(own, classical, peak),
        levels=results,
        reference=reference,
        deviations=deviations(results, reference),
        transfer=transfer,
        sections=sections,
        warnings=tuple(notes),
        estimates=certificate.estimates,
        estimate_basis=certificate.basis,
        estimate_spread=certificate.spread,
        structures=structures,
    )


def _require_time_to_touch(case: Case) -> None:
    flight = (case.contact.gap or 0.0) / case.motion.speed
    if flight >= case.run.duration:
        raise InputError(
            f"{case.path or 'case'}: run.duration",
            got=f"{case.run.duration * 1e6:.4g} us, but first touch at {flight * 1e6:.4g} us",
            expected="a time that holds the impact",
            hint="enlarge run.duration or make contact.gap smaller.",
        )


def _run_interface(
    problem: ContactProblem, pools: Mapping[str, Modes], own: ReducedPair, clock: StageClock
) -> LevelResult:
    clock("interface", 0.0)

    def run(model: InterfaceModel) -> LevelResult:
        guide = build_guide(problem, model, pools, ports=own.ports)
        setup = clock.spent((*_SET_UP[:-1], "interface"))
        return run_interface(problem, model, guide, setup_time=setup)

    result = within_reach(problem, pools, run, ports=own.ports)
    clock("interface", 1.0)
    return result


@dataclass(frozen=True, kw_only=True)
class _Certificate:
    """Estimated errors, what they refer to, and how far that has settled itself."""

    estimates: Mapping[str, Deviation] = field(default_factory=dict)
    basis: str = ""
    spread: float = 0.0


def _certificate(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    results: Mapping[str, LevelResult],
    clock: StageClock,
) -> _Certificate:
    """Deviation of every reduced level from one interface-level run with more modes.

    The same run with half as many modes tells whether it can serve as a reference.
    """
    reduced = [name for name in results if name.startswith("reduced")]
    if not reduced:
        return _Certificate()
    clock("estimate of the error", 0.0)
    count = certificate_modes(problem.case)

    def run(model: InterfaceModel) -> tuple[InterfaceModel, ImpactHistory]:
        return model, simulate_case(problem.case, model).history

    with warnings_of(f"estimate of the error, {count} modes"):
        model, history = within_reach(problem, pools, run, count=count)
    clock("estimate of the error", 0.5)
    with warnings_of(f"estimate of the error, {count // 2} modes"):
        _, fewer = within_reach(problem, pools, run, count=count // 2)
    elastic = model.omega > 0
    counts = [int(np.sum(elastic & (model.owner == body))) for body in (0, 1)]
    clock("estimate of the error", 1.0)
    return _Certificate(
        estimates={name: compare_histories(history, results[name].history) for name in reduced},
        basis=f"interface level, {counts[0]} + {counts[1]} modes, {model.count} contact points",
        spread=compare_histories(history, fewer).history_l2,
    )


def _variant(level: str, problem: ContactProblem, pools: Mapping[str, Modes]) -> ReducedPair:
    names = (problem.pair.upper.name, problem.pair.lower.name)
    selection = {name: selection_of(problem.case.reduction.choice(name)) for name in names}
    if level == "reduced-participation":
        selection = participating(names)
    return reduce_pair(
        problem,
        pools,
        correction=_CORRECTIONS[level],
        selection=selection,
        stiffness=_USUAL_STIFFNESS,
    )


def _run_variant(case: Case, level: str, pair: ReducedPair, *, setup_time: float) -> LevelResult:
    counts = f"{elastic_count(pair.upper)} + {elastic_count(pair.lower)} modes"
    words = ", ".join(filter(None, (_CORRECTION_WORDS[pair.upper.correction], _law_words(pair))))
    if level == "reduced-participation":
        words += ", modes by participation"
    return run_reduced(
        case, pair, level=level, label=f"reduced, {counts}, {words}", setup_time=setup_time
    )


_CORRECTION_WORDS = {"consistent": "", "attachment": "attachment modes", "none": "no correction"}


def _law_words(pair: ReducedPair) -> str:
    if pair.local is not None:
        return "consistent law"
    if isinstance(pair.law, LinearLaw):
        return f"{pair.law.stiffness / 1e6:.4g} N/um"
    return "Hertz law"


def _sections(problem: ContactProblem, run: FullOrderResult) -> tuple[SectionPicture, ...]:
    time = float(run.history.edges[run.peak_index + 1])
    bodies = (problem.pair.upper, problem.pair.lower)
    return tuple(
        section_picture(body.mesh, fields.peak_displacement, time, body.name)
        for body, fields in zip(bodies, run.fields, strict=True)
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


def _surfaces(case: Case) -> str:
    return f"{case.contact.moving} on {case.contact.stop}"


def _contact_summary(problem: ContactProblem, check: ContactCheck) -> ContactSummary:
    static = problem.static
    return ContactSummary(
        surfaces=_surfaces(problem.case),
        points=static.space.count,
        half_width=check.half_width,
        size_ratio=check.size_ratio,
        points_across=check.points_across,
        doubts=check.doubts,
        approach=static.approach,
        force=static.force,
        area=static.area,
    )


def _law_summary(pair: ReducedPair, classical: LocalStiffness, peak: float) -> LawSummary:
    indentation, force = static_curve(pair)
    fit_range = (0.5 * peak, peak)
    load = np.linspace(*fit_range, 50)
    slope = np.polyfit(np.interp(load, force, indentation), load, 1)[0]
    share = np.append(np.nan, pair.local.share) if pair.local else np.full(len(force), np.nan)
    return LawSummary(
        kind="consistent" if pair.local is not None else "given",
        indentation=indentation,
        force=force,
        share=share,
        linear_stiffness=float(slope),
        fit_range=fit_range,
        classical_stiffness=classical.stiffness,
        classical_size=classical.size,
    )
