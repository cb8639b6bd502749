"""Bending of axisymmetric bodies: the half section in Fourier order 1."""

import warnings

from klack.assembling.held_nodes import held_nodes
from klack.assembling.layers import layers_of
from klack.bodies.elasticity.fourier_body import FourierBody, fourier_body
from klack.case.bodies import CaseFile
from klack.errors import AccuracyWarning
from klack.mesh.mesh import Mesh

__all__ = ["bending_body"]


def bending_body(case: CaseFile, name: str, mesh: Mesh) -> FourierBody | None:
    """Body in order 1, held where the case holds it, all round.

    None for a solid, whose modes bend anyway, and for given matrices, which are of axial motion.

    Warns
    -----
    AccuracyWarning
        Of linear elements, which lock in bending.
    """
    body = case.bodies[name]
    if mesh.dimension != 2 or body.matrices is not None:
        return None
    linear = sorted({block.family for block in mesh.blocks if not block.topology.quadratic})
    if linear:
        warnings.warn(
            f"the bending frequencies of '{name}' are too high: its mesh has linear elements "
            f"({', '.join(linear)}), which are too stiff in bending. With two of them across the "
            "radius, the bending frequencies of a round bar are 2 % (quad4) to 9 % (tri3) too "
            "high, however accurate its axial modes are. Try: elements with mid-side nodes.",
            AccuracyWarning,
            stacklevel=2,
        )
    materials = case.materials_of(name, mesh.solids)
    return fourier_body(
        name,
        mesh,
        materials,
        order=1,
        fixed_nodes=held_nodes(body, mesh),
        layers=layers_of(case, name),
    )
