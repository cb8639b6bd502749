"""Summary of one body, for tables."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.plausible_material import estimate_material
from klack.bodies.reduction.reduced_body import ReducedBody, elastic_count
from klack.case.bodies import CaseFile

__all__ = ["BodySummary", "summarise_body"]


@dataclass(frozen=True, kw_only=True, eq=False)
class BodySummary:
    """One body in numbers.

    Parameters
    ----------
    name, model, source, support, material
        ``model`` is ``"3-D"`` or ``"axisymmetric"``, ``source`` that of the geometry.
    mass [kg]
    frequencies [Hz]
        Elastic, kept, lowest first.
    compliance_share [-]
        Share of the static compliance at the contact in the kept modes.
    """

    name: str
    model: str
    source: str
    support: str
    material: str
    mass: float
    nodes: int
    elements: int
    dofs: int
    frequencies: NDArray[np.float64]
    compliance_share: float


def summarise_body(
    case: CaseFile, body: ElasticBody, reduced: ReducedBody, *, compliance_share: float
) -> BodySummary:
    """Summary of a body; the share is that of the kept modes."""
    given = case.bodies[body.name]
    geometry = given.geometry
    if geometry.mesh is not None:
        source = f"mesh file {geometry.mesh.file.name}"
    elif geometry.step is not None:
        source = f"STEP file {geometry.step.file.name}"
    else:
        layers = f" in {geometry.layers} layers" if geometry.layers else ""
        source = f"profile, {geometry.model}{layers}"
    supports = []
    for support in given.fixed or ():
        sectors = support.sectors
        where = f"surface '{support.surface}'"
        if sectors is not None:
            where += f" in {sectors.count} sectors of {np.degrees(sectors.width):.4g} deg"
        supports.append(where)
    first, last = reduced.rigid_count, reduced.rigid_count + elastic_count(reduced)
    return BodySummary(
        name=body.name,
        model="axisymmetric" if body.dimension == 2 else "3-D",
        source=source,
        support="held at " + " and ".join(supports) if supports else "free",
        material=_material(case, body),
        mass=body.mass,
        nodes=body.mesh.node_count,
        elements=body.mesh.element_count,
        dofs=body.dof_count,
        frequencies=np.sort(reduced.frequencies[first:last]),
        compliance_share=compliance_share,
    )


def _material(case: CaseFile, body: ElasticBody) -> str:
    given = case.bodies[body.name].matrices
    if given is None:
        materials = case.materials_of(body.name, body.mesh.solids)
        return "; ".join(
            dict.fromkeys(
                f"{m.name} (E {m.young / 1e9:.4g} GPa, nu {m.poisson:.3g}, rho {m.density:.5g} "
                "kg/m^3)"
                for m in materials.values()
            )
        )
    found = estimate_material(body.K, body.mesh, body.mass)
    return (
        f"matrices {given.stiffness.name} and {given.mass.name} ({found.density_in_words}, wave "
        f"speed {found.wave_speed:.4g} m/s)"
    )
