"""Nodes where a case holds a body."""

import numpy as np
from numpy.typing import NDArray

from klack.case.bodies import CaseBody
from klack.mesh.mesh import Mesh
from klack.mesh.supports import sector_nodes, surface_nodes

__all__ = ["held_nodes"]


def held_nodes(body: CaseBody, mesh: Mesh) -> NDArray[np.int64]:
    """Sorted nodes of all supports: surfaces, sectors of surfaces, or sets of nodes alone.

    Raises
    ------
    InputError
        For a surface that the mesh does not have.
    """
    held = [np.empty(0, dtype=np.int64)]
    for support in body.fixed or ():
        sectors = support.sectors
        if not mesh.blocks and sectors is None and support.surface in mesh.node_sets:
            held.append(mesh.node_sets[support.surface])
        elif sectors is None:
            held.append(surface_nodes(mesh, support.surface))
        else:
            held.append(
                sector_nodes(mesh, support.surface, sectors.count, sectors.width, sectors.first)
            )
    return np.unique(np.concatenate(held))
