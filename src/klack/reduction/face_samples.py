"""Where integrals over a surface are taken: points, areas and outward normals of its faces."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.elasticity.quadrature import quadrature
from klack.elasticity.shape_functions import shape_functions
from klack.mesh.mesh import FaceBlock, Mesh

__all__ = ["FaceSamples", "face_samples"]


@dataclass(frozen=True, slots=True, eq=False)
class FaceSamples:
    """Integration points of ``f`` faces of one family, ``q`` points each, ``n`` nodes.

    Parameters
    ----------
    values : array, shape (q, n) [-]
        Shape functions.
    area : array, shape (f, q) [m^2]
        Weight times area; of an axisymmetric face round the full circle.
    normal : array, shape (f, q, dimension) [-]
        Outwards, of length 1; zero where a face has no area.
    """

    values: NDArray[np.float64]
    area: NDArray[np.float64]
    normal: NDArray[np.float64]


def face_samples(mesh: Mesh, block: FaceBlock) -> FaceSamples:
    """Integration points that are exact for products of two shape functions on plane faces.

    Parameters
    ----------
    mesh : Mesh
    block : FaceBlock
        Faces of one family of this mesh.
    """
    xi, weights = quadrature(block.family, "mass")
    values, slopes = shape_functions(block.family, xi)
    corners = mesh.points[block.connectivity]
    tangents = np.einsum("qnp,fnd->fqpd", slopes, corners)
    if mesh.dimension == 2:
        radius = np.einsum("qn,fn->fq", values, corners[:, :, 0])
        along = tangents[:, :, 0, :]
        normal = np.stack([along[..., 1], -along[..., 0]], axis=-1)  # tangent turned by -90 deg
        circumference = 2.0 * np.pi * radius
    else:
        normal = np.cross(tangents[:, :, 0, :], tangents[:, :, 1, :])
        circumference = np.ones(normal.shape[:2])
    length = np.linalg.norm(normal, axis=-1)
    unit = normal / np.where(length > 0, length, 1.0)[..., None]
    return FaceSamples(values=values, area=length * weights * circumference, normal=unit)
