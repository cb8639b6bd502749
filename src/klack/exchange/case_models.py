"""Models of a case for other programs: reduced bodies, and the pair with its contacts."""

import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime

from klack import __version__
from klack.assembling.given_pair import build_given_pair
from klack.assembling.modes import mode_pools
from klack.assembling.problem import build_problem
from klack.assembling.reduced_pair import first_stiffness, impact_system, own_pair
from klack.assembling.valve import build_valve
from klack.assembling.yielding import tell_elastic
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.case.placed_errors import tells_place
from klack.case.schema import Case
from klack.case.spatial_consistency import require_axial
from klack.case.valve import ValveCase
from klack.case.valve_roles import find_meetings, find_roles
from klack.errors import AccuracyWarning, InputError, refuse_if
from klack.exchange.modal_model import ModalModel, Provenance, body_model, choose_body, pair_model
from klack.machine.progress import Progress, silent
from klack.mechanics.flexible_body import FlexibleBody
from klack.mesh.mesh import Mesh
from klack.network.network import Network
from klack.network.rows import FilmRow
from klack.simulation.system import ContactPair, ReducedSystem

__all__ = ["CaseModels", "case_models"]


@dataclass(frozen=True, kw_only=True, eq=False)
class CaseModels:
    """Models of a case.

    Parameters
    ----------
    pair
        All bodies, contacts and films; other drives stay outside. None of a valve for ``alone``.
    step [s]
    outside
        Components of a valve that no model has.
    """

    bodies: tuple[ReducedBody, ...]
    pair: ModalModel | None
    provenance: Provenance
    step: float
    outside: tuple[str, ...] = ()

    def body_models(self, name: str | None = None) -> tuple[ModalModel, ...]:
        """Linear models of one body or of all."""
        return tuple(
            body_model(body, provenance=self.provenance, step=self.step)
            for body in choose_body(self.bodies, name)
        )


@tells_place
def case_models(
    case: Case | ValveCase,
    progress: Progress = silent,
    *,
    threads: int | None = None,
    alone: bool = False,
) -> CaseModels:
    """Reduce the bodies of a case as its runs do, and join them, those of a valve unless ``alone``.

    The pair of an impact keeps constant force and spring; that of a valve its end stops with
    films, while the user gives the forces of springs, fluid and solenoid. Rejects a valve without
    end stops.

    Warns
    -----
    AccuracyWarning
        Of friction of faces and yield, which exported models leave out.
    """
    tell_elastic(case, "exported models are those of")
    if isinstance(case, ValveCase):
        return _of_valve(_smooth_valve(case), progress, threads, alone)
    if not case.has_surfaces:
        return _of_given(case, progress, threads)
    case.require_ends("an exported model")
    case.require_on_axis("an exported model")
    case = _frictionless(case).without_outputs()
    problem = build_problem(case, progress, threads=threads)
    pools = mode_pools(problem, at_least=1, progress=progress)
    progress("reduced", 0.0)
    reduced = own_pair(problem, pools, stiffness=first_stiffness(problem))
    problem.close()
    progress("reduced", 1.0)
    provenance = _provenance(
        case, {body.name: body.mesh for body in (problem.pair.upper, problem.pair.lower)}
    )
    system = impact_system(case, reduced.upper, reduced.lower, reduced.law)
    return _of_impact(case, (reduced.upper, reduced.lower), system, provenance)


def _of_impact(
    case: Case,
    bodies: tuple[ReducedBody, ReducedBody],
    system: ReducedSystem,
    provenance: Provenance,
) -> CaseModels:
    pair = pair_model(
        f"{case.name}_pair",
        system,
        moving=bodies[0].name,
        contact_names=("contact",),
        speed=-case.motion.speed,
        step=case.run.reduced_step,
        duration=case.run.duration,
        provenance=provenance,
    )
    return CaseModels(bodies=bodies, pair=pair, provenance=provenance, step=case.run.reduced_step)


def _frictionless(case: Case) -> Case:
    """The case as exported models have it: their laws have no memory."""
    if case.contact.faces.is_none:
        return case
    warnings.warn(
        f"the exported pair leaves out contact.friction {case.contact.faces.static:g}: its law "
        "loads and unloads on one curve. Try: klack impact, whose reduced level includes the "
        "loss.",
        AccuracyWarning,
        stacklevel=3,
    )
    return case.without_friction()


def _smooth_valve(case: ValveCase) -> ValveCase:
    """The same for the end stops of a valve."""
    left = [f"stops.{name}.friction {s.friction:g}" for name, s in case.stops.items() if s.friction]
    if not left:
        return case
    warnings.warn(
        f"the exported valve leaves out {' and '.join(left)}: its laws load and unload on one "
        "curve. Try: klack stroke, which includes the loss.",
        AccuracyWarning,
        stacklevel=3,
    )
    return case.without_friction()


def _of_given(case: Case, progress: Progress, threads: int | None) -> CaseModels:
    """Bodies reduced or assembled by other programs, joined at ports."""
    given = build_given_pair(case, progress, threads=threads)
    sources = {item.name: item.source for item in given.summaries}
    provenance = replace(_provenance(case, {}), meshes=sources)
    return _of_impact(case, (given.upper, given.lower), given.system(case), provenance)


def _of_valve(case: ValveCase, progress: Progress, threads: int | None, alone: bool) -> CaseModels:
    require_axial(case, "the export of models")
    valve = build_valve(case, progress, threads=threads)
    provenance = _provenance(case, {name: body.mesh for name, body in valve.bodies.items()})
    rows = valve.network.rows()
    bodies, step = tuple(valve.reduced.values()), case.run.fine_step
    refuse_if(
        not bodies,
        f"{case.path or 'case'}: network.components",
        got="rigid bodies only",
        expected="at least one flexible-body",
        hint="describe its shape in bodies and name it in a flexible-body.",
    )
    if alone:
        return CaseModels(bodies=bodies, pair=None, provenance=provenance, step=step)
    parts = valve.network.components
    meetings = find_meetings(valve.network)
    contacts: list[ContactPair] = []
    films: list[FilmRow | None] = []
    names: list[str] = []
    for row in rows.interfaces:
        met = meetings[row.component]
        if met.upper is None or met.lower is None or row.law is None:
            lawless = met.upper is not None and met.lower is not None
            raise InputError(
                f"{case.path or 'case'}: network.components.{row.component}",
                got="an end stop without a law" if lawless else "an end stop on the ground",
                expected="a contact law between two bodies",
                hint="give it a law."
                if lawless
                else "give the stop a separate body, held by a support.",
            )
        (upper, a), (lower, b) = met.upper, met.lower
        contacts.append(
            ContactPair(
                body_a=_body_of(case, upper, parts[upper]),
                port_a=a,
                body_b=_body_of(case, lower, parts[lower]),
                port_b=b,
                law=row.law,
                gap=row.gap,
                series_compliance=row.series_compliance,
            )
        )
        films.append(row.film)
        names.append(row.component)
    refuse_if(
        not contacts,
        f"{case.path or 'case'}: network.components",
        got="no end stop",
        expected="at least one component of type end-stop",
        hint="export only the bodies: --part body.",
    )
    used = [
        body
        for body in valve.reduced.values()
        if any(body.name in (contact.body_a, contact.body_b) for contact in contacts)
    ]
    needle = find_roles(case).needle
    pair = pair_model(
        f"{case.name}_pair",
        ReducedSystem(bodies=tuple(used), contacts=tuple(contacts)),
        moving=_body_of(case, needle, parts[needle]),
        contact_names=names,
        films=films,
        speed=0.0,
        step=step,
        duration=case.run.duration,
        provenance=provenance,
    )
    outside = tuple(
        name
        for name, part in parts.items()
        if name not in names and not isinstance(part, FlexibleBody)
    )
    loose = {
        name
        for name, part in parts.items()
        if isinstance(part, FlexibleBody)
        and name != needle
        and any(body.name == part.body and body.rigid_count for body in used)
    }
    _tell_without_input(valve.network, loose, outside)
    return CaseModels(bodies=bodies, pair=pair, provenance=provenance, step=step, outside=outside)


def _tell_without_input(network: Network, loose: Collection[str], outside: Sequence[str]) -> None:
    """Note forces on moving bodies for which the pair has no input: it has those of the needle."""
    for node in network.nodes:
        at = {joint.component for joint in node.joints}
        for body in sorted(at.intersection(loose)):
            if forces := [f"'{name}'" for name in outside if name in at]:
                acting = f"{' and '.join(forces)} act{'s' * (len(forces) == 1)}"
                warnings.warn(
                    f"the exported valve has no input for '{body}', on which {acting}: without "
                    f"that force '{body}' is loose in it. Try: klack stroke, or one glued body "
                    "instead of two.",
                    AccuracyWarning,
                    stacklevel=4,
                )


def _body_of(case: ValveCase, name: str, part: object) -> str:
    if not isinstance(part, FlexibleBody):
        raise InputError(
            f"{case.path or 'case'}: network.components.{name}",
            got=f"a {getattr(part, 'type', type(part).__name__)} at an end stop",
            expected="flexible bodies only, in a model of all of them",
            hint="describe it as a body of the case and a flexible-body of the network, or export "
            "the flexible bodies alone: --part body.",
        )
    return part.body


def _provenance(case: Case | ValveCase, meshes: Mapping[str, Mesh]) -> Provenance:
    return Provenance(
        case=case.name,
        title=case.title,
        version=__version__,
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        meshes={
            name: f"{mesh.element_count} elements, {mesh.dof_count} degrees of freedom"
            for name, mesh in meshes.items()
        },
    )
