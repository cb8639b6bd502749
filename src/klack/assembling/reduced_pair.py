"""Both bodies reduced for one contact, with their local law."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.assembling.modes import damping_of, selection_of
from klack.assembling.problem import ContactProblem
from klack.assembling.rubbing import fitted_loops
from klack.assembling.yielding import law_with_yield
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.reduction.ports import Observer, Port
from klack.bodies.reduction.reduce import Correction, reduce_body
from klack.bodies.reduction.reduced_body import ReducedBody, elastic_count
from klack.bodies.reduction.selection import ByCount, ModeSelection
from klack.case.impact_sections import (
    ConsistentLocalLaw,
    HertzLocalLaw,
    LinearLocalLaw,
    SubmodelLocalLaw,
)
from klack.case.schema import Case
from klack.contact.history import ImpactHistory
from klack.contact.laws import (
    ContactLaw,
    HertzLaw,
    LinearLaw,
)
from klack.contact.local_law import LocalLaw, OverfullModesError, consistent_law
from klack.contact.plasticity.loops import YieldingLoops
from klack.contact.rubbing_fit import RubbingFit
from klack.contact.rubbing_law import RubbingLaw
from klack.contact.statics import StaticContact
from klack.contact.submodel import LocalStiffness, local_stiffness
from klack.contact.yielding_law import YieldingLaw
from klack.errors import AccuracyWarning, InputError
from klack.machine.stages import show, trial
from klack.simulation.impact import simulate_impact
from klack.simulation.system import AxialForce, ContactPair, ReducedSystem, ReturnSpring
from klack.transient.rubbing_ladder import RubbingContact

__all__ = [
    "PORT",
    "ReducedPair",
    "classical_stiffness",
    "first_stiffness",
    "friction_doubt",
    "hertz_coefficient",
    "impact_system",
    "own_pair",
    "recipe_stiffness",
    "reduce_pair",
    "simulate_bodies",
    "starting_gap",
    "static_curve",
]

PORT = "contact"
"""Name of the contact port of both bodies."""

# The pattern of the port is taken at the peak force, which depends on it weakly.
_PATTERN_ROUNDS = 3
_USUAL_STIFFNESS = 1e9  # [N/m] that the literature puts beside modes, corrected or not
_CLASSICAL_SIZE = 3.0  # radius of the contact submodel over the half width of the contact


@dataclass(frozen=True, kw_only=True, eq=False)
class ReducedPair:
    """Both bodies reduced for one contact, with their local law.

    Parameters
    ----------
    ports
        Of the upper and the lower body, resultant +1 N along z each.
    local
        The consistent (elastic) law with its shares; None for another kind.
    pattern_force [N]
        Of the pressure pattern of the ports.
    static
        Of the full bodies, with the friction of ``law``.
    rubbing
        Law with memory, of ``local`` and static loops.
    """

    upper: ReducedBody
    lower: ReducedBody
    ports: tuple[Port, Port]
    law: ContactLaw | RubbingLaw | YieldingLaw
    local: LocalLaw | None
    pattern_force: float
    static: StaticContact | RubbingContact
    rubbing: RubbingFit | None = None

    @property
    def yields(self) -> bool:
        """Whether its law has yield."""
        return isinstance(self.law, YieldingLaw)


def classical_stiffness(problem: ContactProblem, peak_force: float) -> LocalStiffness:
    """Stiffness of the contact zone alone, by the classical recipe."""
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


def recipe_stiffness(case: Case) -> float:
    """Contact stiffness [N/m] of the classical recipe: of the case, or 1e9 N/m."""
    law = case.contact.local_law
    return law.stiffness if isinstance(law, LinearLocalLaw) else _USUAL_STIFFNESS


def first_stiffness(problem: ContactProblem) -> float:
    """Secant of the static contact [N/m], for the order of the peak force."""
    return problem.static.max_force / float(problem.static.approach[-1])


def own_pair(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    *,
    stiffness: float,
    recovery: bool = False,
    loops: YieldingLoops | None = None,
) -> ReducedPair:
    """Reduce both bodies as in the case; see :func:`reduce_pair`.

    Warns
    -----
    AccuracyWarning
        Of fewer kept modes than wanted, which leave a compliance to the local law.
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
                loops=loops,
            )
        except OverfullModesError:
            fewer = {
                name: (
                    ByCount(max(1, 2 * choice.count // 3))
                    if isinstance(choice, ByCount)
                    else choice
                )
                for name, choice in selection.items()
            }
            if fewer == selection:
                raise
            selection = fewer
            continue
        break
    if selection != asked:
        counts = [f"{elastic_count(b)} of '{b.name}'" for b in (pair.upper, pair.lower)]
        warnings.warn(
            f"contact: only {' and '.join(counts)} of the requested modes are kept: more modes "
            "would exceed the static compliance of this contact and leave none to the local "
            "law. The interface level keeps them all.",
            AccuracyWarning,
            stacklevel=2,
        )
    return pair


def reduce_pair(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    *,
    correction: Correction,
    selection: Mapping[str, ModeSelection],
    stiffness: float,
    recovery: bool = False,
    loops: YieldingLoops | None = None,
) -> ReducedPair:
    """Reduce both bodies at the contact, with the port pattern at the peak force.

    Parameters
    ----------
    stiffness [N/m]
        Of the local contact, for corrections without a law of their own.
    recovery
        Keep the displacement of all named surfaces.
    loops
        Of faces that yield, for the consistent law.
    """
    static = _static(problem, correction)
    force = 0.7 * static.max_force
    for _ in range(_PATTERN_ROUNDS):
        with trial() as caught:
            pair = _reduce_at(
                problem, pools, force, correction, selection, stiffness, recovery, loops
            )
            peak = float(
                np.max(simulate_bodies(problem.case, pair.upper, pair.lower, pair.law).peak_force)
            )
        settled = abs(peak - force) <= 0.02 * force
        force = min(peak, static.max_force)
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
    loops: YieldingLoops | None,
) -> ReducedPair:
    static = _static(problem, correction)
    load_upper, load_lower = static.load_patterns(force)
    ports = (Port(PORT, load_upper), Port(PORT, -load_lower))
    bodies = (problem.pair.upper, problem.pair.lower)
    flexibilities = (problem.flexibility_upper, problem.flexibility_lower)
    compliances = _port_compliances(problem, static, force)
    upper, lower = (
        reduce_body(
            body,
            [port],
            modes=selection[body.name],
            correction=correction,
            damping=damping_of(problem.case.bodies[body.name].damping),
            modes_pool=pools[body.name],
            flexibility=flexibility,
            port_compliance=compliance,
            shifts=problem.case.reduction.shifts_of(body.name, correction),
            recovery_surfaces=tuple(body.mesh.surfaces) if recovery else (),
            observers=[
                Observer(gauge.name, gauge.row)
                for gauge in problem.pair.gauges
                if gauge.body == body.name
            ],
        )
        for body, port, flexibility, compliance in zip(
            bodies, ports, flexibilities, compliances, strict=True
        )
    )
    law: ContactLaw | RubbingLaw | YieldingLaw
    law, local = _law(problem, correction, upper, lower, stiffness)
    fit = None
    if isinstance(static, RubbingContact) and local is not None:
        fit = fitted_loops(static, local, key="contact.friction")
    elif loops is not None and local is not None:
        modal = float(upper.modal_compliance[0, 0] + lower.modal_compliance[0, 0])
        law = law_with_yield(loops, modal) or law
    return ReducedPair(
        upper=upper,
        lower=lower,
        ports=ports,
        law=law if fit is None else fit.law,
        local=local,
        pattern_force=force,
        static=static,
        rubbing=fit,
    )


def _port_compliances(
    problem: ContactProblem, static: StaticContact | RubbingContact, force: float
) -> tuple[NDArray[np.float64] | None, NDArray[np.float64] | None]:
    """Static compliance of each body at its port [m/N]; None where the faces rub.

    From the compliance at the contact points, which the port loads alone.
    """
    if not isinstance(static, StaticContact):
        return None, None
    lam = static.pattern_at(force)
    condensed = problem.condensed
    upper, lower = (np.array([[lam @ C @ lam]]) for C in (condensed.upper, condensed.lower))
    return upper, lower


def friction_doubt(case: Case, *, has_memory: bool, correction: str = "none") -> str:
    """Doubt about a model without all friction of its case, or empty.

    ``has_memory``: its law closes and opens on two curves; ``correction`` is that of its modes.
    """
    faces = case.contact.faces
    if faces.is_none:
        return ""
    if not has_memory:
        left = (
            f"friction {faces.kinetic:g}" if faces.kinetic else f"static_friction {faces.static:g}"
        )
        why = "only the consistent local law has friction"
        if _rubs(case, correction):
            why = "faces that lock have no law, and neither have loops that it cannot represent"
        return f"it leaves out contact.{left}: {why}. Try: level interface."
    if not faces.is_constant:
        return (
            f"its law uses contact.friction {faces.kinetic:g} at every slip speed and leaves out "
            f"static_friction {faces.static:g}. Try: level interface."
        )
    return ""


def _rubs(case: Case, correction: str) -> bool:
    law = case.contact.local_law
    is_consistent = isinstance(law, ConsistentLocalLaw) and correction == "consistent"
    return is_consistent and case.contact.faces.kinetic > 0.0


def _static(problem: ContactProblem, correction: Correction) -> StaticContact | RubbingContact:
    """Static contact with the friction of the law."""
    rubbing = problem.rubbing if _rubs(problem.case, correction) else None
    return problem.static if rubbing is None else rubbing


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
    static = _static(problem, correction)
    local = consistent_law(static if isinstance(static, StaticContact) else static.closing, modal)
    return local.law, local


def hertz_coefficient(case: Case, law: HertzLocalLaw) -> float:
    """4/3 E* sqrt(R) [N/m^1.5], modulus given or of the two bodies."""
    if law.modulus is not None:
        return 4.0 / 3.0 * law.modulus * float(np.sqrt(law.radius))
    inverse = 0.0
    for name, body in case.bodies.items():
        if not isinstance(body.material, str):
            raise InputError(
                f"{case.path or 'case'}: contact.local_law",
                got=f"a Hertz law on body '{name}' of several materials",
                expected="bodies of one material",
                hint="use the consistent law, which needs no such choice.",
            )
        inverse += 1.0 / case.materials_of(name, [name])[name].plane_strain_modulus
    return 4.0 / 3.0 / inverse * float(np.sqrt(law.radius))


def impact_system(
    case: Case,
    upper: ReducedBody,
    lower: ReducedBody,
    law: ContactLaw | RubbingLaw | YieldingLaw,
    *,
    ports: tuple[str, str] = (PORT, PORT),
    series_compliance: float = 0.0,
) -> ReducedSystem:
    """Both bodies, their contact at ports, and force and spring on the upper one.

    ``series_compliance`` [m/N] is in series with the law.
    """
    contact = ContactPair(
        body_a=upper.name,
        port_a=ports[0],
        body_b=lower.name,
        port_b=ports[1],
        law=law,
        gap=starting_gap(case),
        series_compliance=series_compliance,
    )
    spring = case.motion.spring
    closing = case.motion.force
    springs: tuple[ReturnSpring, ...] = ()
    if spring is not None:
        # the preload is the force at first touch; a gap above it the spring pushes harder
        closing += spring.preload + spring.stiffness * starting_gap(case)
        springs = (ReturnSpring(body=upper.name, port=ports[0], stiffness=spring.stiffness),)
    forces: tuple[AxialForce, ...] = ()
    if closing != 0:
        forces = (AxialForce(body=upper.name, force=-closing),)
    return ReducedSystem(bodies=(upper, lower), contacts=(contact,), forces=forces, springs=springs)


def simulate_bodies(
    case: Case, upper: ReducedBody, lower: ReducedBody, law: ContactLaw | RubbingLaw | YieldingLaw
) -> ImpactHistory:
    """Impact of two reduced bodies, as the case starts it."""
    return simulate_impact(
        impact_system(case, upper, lower, law),
        speed=case.motion.speed,
        duration=case.run.duration,
        step=case.run.reduced_step,
    )


def starting_gap(case: Case) -> float:
    """Gap at the start [m]."""
    return case.contact.gap or 0.0


def static_curve(pair: ReducedPair) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (indentation [m], force [N]) of the local law."""
    if pair.local is not None:
        return np.append(0.0, pair.local.force_indentation), np.append(0.0, pair.local.force)
    assert not isinstance(pair.law, YieldingLaw)
    indentation = np.linspace(0.0, _indentation_at(pair.law, 1.2 * pair.pattern_force), 50)
    return indentation, pair.law.force(indentation)


def _indentation_at(law: ContactLaw | RubbingLaw, force: float) -> float:
    upper = 1e-9
    while float(law.force(upper)) < force:
        upper *= 1.3
    return upper
