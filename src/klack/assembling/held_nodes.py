"""Nodes where a case holds a body."""

import numpy as np
from numpy.typing import NDArray

from klack.case.bodies import CaseBody
from klack.errors import InputError, require_positive
from klack.mesh.mesh import Mesh

__all__ = ["held_nodes", "sector_nodes", "surface_nodes"]


def surface_nodes(mesh: Mesh, surface: str) -> NDArray[np.int64]:
    """Sorted numbers of all nodes of a named surface."""
    return mesh.surface(surface).nodes


def sector_nodes(
    mesh: Mesh, surface: str, count: int, width_rad: float, first_rad: float = 0.0
) -> NDArray[np.int64]:
    """Sorted nodes of a surface in equal sectors around z, for a body held at a few places.

    Rejects overlapping sectors, and those without a node; nodes on the axis are in none.

    Parameters
    ----------
    mesh
        Of dimension 3.
    count
        Of sectors, evenly spread.
    width_rad [rad]
        Of each.
    first_rad [rad]
        Middle of the first, from x towards y.
    """
    if mesh.dimension != 3:
        raise InputError(
            f"sector_nodes: surface '{surface}'",
            got="an axisymmetric mesh",
            expected="a solid mesh, because sectors are not axisymmetric",
            hint="hold the whole surface, or sweep the meridian to a solid first.",
        )
    if count < 1:
        raise InputError(
            "sector_nodes: count",
            got=str(count),
            expected="at least one sector",
            hint="three sectors act like a chuck.",
        )
    require_positive("sector_nodes: width_rad", width_rad, "rad")
    pitch = 2 * np.pi / count
    if width_rad > pitch * (1 + 1e-12):
        raise InputError(
            "sector_nodes: width_rad",
            got=f"{count} sectors of {np.degrees(width_rad):.6g} deg",
            expected=f"up to {np.degrees(pitch):.6g} deg each, to avoid overlap",
            hint="make the sectors narrower, or hold the whole surface.",
        )
    nodes = mesh.surface(surface).nodes
    x, y, _ = mesh.points[nodes].T
    r = np.hypot(x, y)
    off_axis = r > 1e-9 * r.max()
    turn = (np.arctan2(y, x) - first_rad + 0.5 * pitch) % (2 * np.pi)
    from_middle = np.abs(turn % pitch - 0.5 * pitch)
    inside = off_axis & (from_middle <= 0.5 * width_rad + 1e-9)
    filled = np.unique((turn[inside] // pitch).astype(int) % count)
    if len(filled) < count:
        raise InputError(
            f"sector_nodes: surface '{surface}'",
            got=f"nodes in {len(filled)} of {count} sectors",
            expected="nodes in every sector",
            hint="refine the mesh around the circumference, or make the sectors wider.",
        )
    return nodes[inside]


def held_nodes(body: CaseBody, mesh: Mesh) -> NDArray[np.int64]:
    """Sorted nodes of all supports: surfaces, sectors, or sets of nodes."""
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
