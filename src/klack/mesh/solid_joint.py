"""The cylinder that two solids of a mesh share: a press fit of parts from a STEP file."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from klack.errors import InputError
from klack.mesh.families import FAMILIES
from klack.mesh.joint import Joint, across
from klack.mesh.mesh import Mesh
from klack.mesh.parting import parted

__all__ = ["solid_joint"]

_ROUND = 1e-5  # of the radius: how far nodes are from a cylinder
_FLAT = 1e-2  # turn of the normals, from which a face is round: 20 deg


def solid_joint(mesh: Mesh, name: str) -> Joint:
    """Joint of all faces of one name; rejects what is no cylinder between exactly two solids."""
    apart, _ = parted(mesh, [name], Joint.key)
    pair = apart.pairs[name]
    corners = np.vstack([b.connectivity[:, : FAMILIES[b.family].corners] for b in pair.first])
    a, b, c = (apart.points[corners[:, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    sizes, ways = np.linalg.eigh(normal.T @ normal)
    points = apart.points[np.unique(np.concatenate([b.connectivity.ravel() for b in pair.first]))]
    centre, extent = points.mean(axis=0), float(np.ptp(points, axis=0).max())
    if sizes[1] < _FLAT * sizes[2]:
        raise _solid_error(name, "a flat face, or one that is hardly round")

    def cylinder(x: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        axis = ways[:, 0] + ways[:, 1:] @ x[:2]
        return centre + extent * (ways[:, 1:] @ x[2:4]), axis / np.linalg.norm(axis)

    def off(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.linalg.norm(across(points, *cylinder(x)), axis=1) / extent - x[4])

    found = least_squares(off, [0.0, 0.0, 0.0, 0.0, 0.5], xtol=1e-15, ftol=1e-15, gtol=1e-15)
    middle, axis = cylinder(found.x)
    radius = extent * float(found.x[4])
    out = np.einsum("fi,fi->f", normal, across((a + b + c) / 3.0, middle, axis))
    if np.abs(found.fun).max() * extent > _ROUND * radius or out.min() * out.max() <= 0.0:
        raise _solid_error(name, "faces that are not one cylinder")
    one, two = pair.solids
    return Joint(
        name=name,
        inner=one if out[0] > 0.0 else two,
        outer=two if out[0] > 0.0 else one,
        radius=radius,
        length=float(np.ptp(points @ axis)),
        axis=(middle, axis),
    )


def _solid_error(name: str, got: str) -> InputError:
    return InputError(
        f"{Joint.key}.{name}",
        got=got,
        expected="a cylinder: faces of one radius round one axis",
        hint="a cone or a flat face cannot be pressed on; name the cylinder in the CAD file.",
    )
