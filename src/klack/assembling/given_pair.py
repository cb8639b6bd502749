"""Two bodies that meet at one port each: reduced models, nodes with matrices, meshes."""

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.assembling.assembled_bodies import assembled_from_matrices
from klack.assembling.bodies import assemble_body, mesh_body
from klack.assembling.body_summary import BodySummary, summarise_body
from klack.assembling.given_bodies import reduced_from_file
from klack.assembling.layers import tell_layers
from klack.assembling.modes import damping_of, mode_pool, selection_of
from klack.assembling.reduced_pair import hertz_coefficient, impact_system
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.ports import Port, node_set_port, surface_port
from klack.bodies.reduction.reduce import reduce_body
from klack.bodies.reduction.reduced_body import ReducedBody, elastic_count
from klack.case.bodies import CaseBody, SurfaceName
from klack.case.impact_sections import HertzLocalLaw, LinearLocalLaw
from klack.case.schema import Case
from klack.contact.laws import HertzLaw, LinearLaw
from klack.errors import AccuracyWarning, InputError
from klack.machine.cache.result_cache import result_cache
from klack.machine.progress import Progress
from klack.simulation.system import ReducedSystem

__all__ = ["GivenPair", "build_given_pair"]


@dataclass(frozen=True, kw_only=True, eq=False)
class GivenPair:
    """Both bodies reduced at their ports, with a law.

    Parameters
    ----------
    series_compliance [m/N]
        Residual compliance of both, in series with the law.
    """

    upper: ReducedBody
    lower: ReducedBody
    ports: tuple[str, str]
    law: LinearLaw | HertzLaw
    series_compliance: float
    summaries: tuple[BodySummary, BodySummary]

    @property
    def modal_compliance(self) -> float:
        """Static compliance of both in their modes [m/N]."""
        sides = zip((self.upper, self.lower), self.ports, strict=True)
        return sum(_at_port(body.modal_compliance, body, port) for body, port in sides)

    def system(self, case: Case) -> ReducedSystem:
        """Return what is simulated."""
        return impact_system(
            case,
            self.upper,
            self.lower,
            self.law,
            ports=self.ports,
            series_compliance=self.series_compliance,
        )


def build_given_pair(case: Case, progress: Progress, *, threads: int | None = None) -> GivenPair:
    """Read, assemble and reduce both bodies of a case without common surfaces.

    Ports of a body that klack reduces: a uniform axial traction on a surface, or equal weights of
    the nodes of a set. Rejects a supported moving body.
    """
    sides, missing = [], 0.0
    for i, surface in enumerate(case.contact.between):
        progress("bodies", i / 2)
        reduced, summary = _side(case, surface, threads)
        sides.append((reduced, summary))
        if case.reduction.correction != "none" or case.bodies[surface.body].reduced is not None:
            missing += _at_port(reduced.residual_compliance, reduced, surface.surface)
    progress("bodies", 1.0)
    (upper, _), (lower, _) = sides
    if upper.rigid_count == 0:
        raise InputError(
            f"{case.path or 'case'}: bodies.{upper.name}",
            got="a moving body without rigid motion: it is supported",
            expected="a free body",
            hint="export it without supports, or swap the two in contact.between.",
        )
    return GivenPair(
        upper=upper,
        lower=lower,
        ports=(case.contact.moving.surface, case.contact.stop.surface),
        law=_law(case),
        series_compliance=max(missing, 0.0),  # round-off where the modes have it all
        summaries=(sides[0][1], sides[1][1]),
    )


def _at_port(matrix: NDArray[np.float64], body: ReducedBody, port: str) -> float:
    i = body.port_index(port)
    return float(matrix[i, i])


def _law(case: Case) -> LinearLaw | HertzLaw:
    law = case.contact.local_law
    if isinstance(law, LinearLocalLaw):
        return LinearLaw(law.stiffness)
    if isinstance(law, HertzLocalLaw):
        return HertzLaw(hertz_coefficient(case, law))
    raise InputError(  # refused by the case already
        "contact.local_law", got=law.kind, expected="linear or hertz", hint="give one of them."
    )


def _side(case: Case, surface: SurfaceName, threads: int | None) -> tuple[ReducedBody, BodySummary]:
    given = case.bodies[surface.body]
    if given.reduced is not None:
        reduced = reduced_from_file(case, surface.body)
        _note_missing(given, reduced)
        return reduced, _summary(given, reduced, surface.surface)
    body, port = _elastic(case, surface)
    flexibility = Flexibility(body, threads=threads, cache=result_cache())
    choice = selection_of(case.reduction.choice(body.name))
    pool = mode_pool(choice, body, flexibility)
    tell_layers([body], {body.name: pool})
    correction = case.reduction.correction
    reduced = reduce_body(
        body,
        [port],
        modes=choice,
        correction="none" if correction == "none" else "consistent",
        damping=damping_of(given.damping),
        modes_pool=pool,
        flexibility=flexibility,
    )
    flexibility.close()
    share = float(reduced.compliance_share[0])
    if given.has_surfaces and given.matrices is None:
        return reduced, summarise_body(case, body, reduced, compliance_share=share)
    return reduced, _of_matrices(given, body, reduced, share)


def _elastic(case: Case, surface: SurfaceName) -> tuple[ElasticBody, Port]:
    given = case.bodies[surface.body]
    if not given.has_surfaces:
        body = assembled_from_matrices(case, surface.body, None)
        return body, node_set_port(body.mesh, surface.surface, "z", name=surface.surface)
    mesh = mesh_body(given, surface.body, ())
    body = assemble_body(case, surface.body, mesh)
    return body, surface_port(mesh, surface.surface, "z", name=surface.surface)


def _note_missing(given: CaseBody, reduced: ReducedBody) -> None:
    """Note a missing residual compliance; boundary coordinates need none."""
    kind = given.reduced.kind if given.reduced is not None else ""
    if kind in ("state-space", "modal") and reduced.correction == "none":
        warnings.warn(
            f"the model of '{reduced.name}' has no residual compliance: unless the local law "
            "contains it, the contact is too stiff. Try: export D, or the responses (dataset "
            "58) of the port.",
            AccuracyWarning,
            stacklevel=2,
        )


_KINDS = {
    "state-space": "state space",
    "modal": "modal data",
    "craig-bampton": "Craig-Bampton matrices",
    "klack": "reduced body",
}


def _summary(given: CaseBody, reduced: ReducedBody, port: str) -> BodySummary:
    if given.reduced is None:
        raise AssertionError
    i = reduced.port_index(port)
    static = reduced.static_compliance[i, i]
    return BodySummary(
        name=reduced.name,
        model="reduced model",
        source=f"{_KINDS[given.reduced.kind]} in {given.reduced.file.name}",
        support="free" if reduced.rigid_count else "held",
        material="in the model",
        mass=reduced.mass if np.isfinite(reduced.mass) else np.nan,
        nodes=0,
        elements=0,
        dofs=reduced.dof_count,
        frequencies=_kept(reduced),
        compliance_share=float(reduced.modal_compliance[i, i] / static) if static > 0 else np.nan,
    )


def _of_matrices(
    given: CaseBody, body: ElasticBody, reduced: ReducedBody, share: float
) -> BodySummary:
    files = []
    if given.matrices is not None:
        files = [given.matrices.stiffness.name, given.matrices.mass.name]
    return BodySummary(
        name=body.name,
        model="matrices",
        source=f"matrices in {' and '.join(dict.fromkeys(files))}",
        support="held" if body.is_fixed else "free",
        material="in the matrices",
        mass=body.mass,
        nodes=body.mesh.node_count,
        elements=body.mesh.element_count,
        dofs=body.dof_count,
        frequencies=_kept(reduced),
        compliance_share=share,
    )


def _kept(reduced: ReducedBody) -> NDArray[np.float64]:
    return reduced.frequencies[reduced.rigid_count : reduced.rigid_count + elastic_count(reduced)]
