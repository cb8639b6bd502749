"""Mounting surfaces: their reference points, areas and rigid motions, also by Fourier order."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from klack.arrays import Ints, Matrix, Vector
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.fourier_body import FourierBody
from klack.bodies.reduction.craig_bampton import Interface, InterfaceKind
from klack.bodies.reduction.ports import face_samples
from klack.errors import refuse_if
from klack.mesh.mesh import Mesh

__all__ = ["MountingSurface", "interface_of", "mounting_surface"]


@dataclass(frozen=True, kw_only=True, eq=False)
class MountingSurface:
    """A surface that meets a mount.

    Parameters
    ----------
    nodes
    area (n_nodes,) [m^2]
        That each node of the mesh stands for, round the full circle; zero off the surface.
    reference (3,) [m]
        About which its moments are.
    """

    mount: str
    kind: InterfaceKind
    nodes: Ints
    area: Vector
    reference: Vector


def mounting_surface(
    mesh: Mesh,
    surfaces: Sequence[str],
    mount: str,
    *,
    kind: InterfaceKind,
    nodes: Ints | None = None,
    reference: Vector | None = None,
) -> MountingSurface:
    """Surface of a mesh as a mounting surface; its centroid is the reference point.

    Parameters
    ----------
    nodes
        Part of the surface that the mount holds; all of it without.
    reference (3,) [m]
        Another point.
    """
    area = np.zeros(mesh.node_count)
    for name in surfaces:
        for block in mesh.surface(name).blocks:
            at = face_samples(mesh, block)
            np.add.at(area, block.connectivity, np.einsum("qn,fq->fn", at.values, at.area))
    held = np.flatnonzero(area) if nodes is None else nodes
    if nodes is None:
        held = np.unique(np.concatenate([mesh.surface(name).nodes for name in surfaces]))
    else:
        area[np.setdiff1d(np.arange(mesh.node_count), nodes)] = 0.0
    refuse_if(
        not area.sum() > 0.0,
        f"mount '{mount}'",
        got=f"no area of {', '.join(surfaces)}",
        expected="a surface with faces",
        hint="name another surface.",
    )
    centre = np.zeros(3)
    centre[3 - mesh.dimension :] = area @ mesh.points / area.sum()
    if mesh.dimension == 2:
        centre[:2] = 0.0
    return MountingSurface(
        mount=mount,
        kind=kind,
        nodes=held,
        area=area,
        reference=centre if reference is None else np.asarray(reference, dtype=float),
    )


def interface_of(
    body: ElasticBody | FourierBody, surface: MountingSurface, *, turned: bool = False
) -> Interface:
    """Freedoms that a body has at a mounting surface.

    A solid has six, an axisymmetric motion has z; a body of revolution has the rotation about z in
    order 0, and x with the rotation about y in order 1, ``turned`` y with that about x.
    """
    points = body.mesh.points
    if isinstance(body, FourierBody):
        directions, motion, share = _by_order(body, surface.reference[2], turned)
    elif body.dimension == 2:
        directions, share = (3,), np.array([0.0, 1.0])
        motion = np.tile([[0.0], [1.0]], (len(points), 1))
    else:
        directions, share = (1, 2, 3, 4, 5, 6), np.ones(3)
        field = np.zeros((len(points), 3, 6))
        field[:, :, :3] = np.eye(3)
        for axis in range(3):
            field[:, :, 3 + axis] = np.cross(np.eye(3)[axis], points - surface.reference)
        motion = field.reshape(-1, 6)
    d = body.dimension
    return Interface(
        mount=surface.mount,
        kind=surface.kind,
        directions=directions,
        motion=motion,
        weights=np.outer(surface.area, share).ravel(),
        rows=(d * surface.nodes[:, None] + np.arange(d)).ravel(),
        reference=surface.reference,
    )


def _by_order(
    body: FourierBody, height: float, turned: bool
) -> tuple[tuple[int, ...], Matrix, Vector]:
    """Directions, motion (n_dof, d), and mean squares of the amplitudes a, b, W."""
    refuse_if(
        body.order > 1,
        f"mounts of body '{body.name}'",
        got=f"Fourier order {body.order}",
        expected="0 or 1, the orders of rigid motions",
        hint="other orders do not move a mounting surface as a whole.",
    )
    r, z = body.mesh.points.T
    if body.order == 0:
        spin = np.zeros((len(r), 3, 1))
        spin[:, 0, 0], spin[:, 1, 0] = -0.5 * r, 0.5 * r
        return (6,), spin.reshape(-1, 1), np.array([2.0, 2.0, 1.0])
    field = np.zeros((len(r), 3, 2))
    field[:, 0, 0] = 1.0
    # about y: u_x = z - height, u_z = -x; turned by a right angle this is against x
    field[:, 0, 1], field[:, 2, 1] = z - height, -r
    if turned:
        field[:, :, 1] *= -1.0
    return ((2, 4) if turned else (1, 5)), field.reshape(-1, 2), np.array([1.0, 1.0, 0.5])
