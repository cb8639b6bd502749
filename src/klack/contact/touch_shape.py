r"""Shape of two surfaces where they press on each other: how fast their gap opens.

Around the most loaded contact point the gap is, to second order in the tangent plane,

.. math:: g = g_0 + s \cdot x + \tfrac{1}{2} x^T H x ,

taken on the curved faces, so a mesh much coarser than the contact gives it as well as a fine one.
The eigenvalues of *H* are the relative curvatures of Hertz's theory.

Force of faces that meet all at once: pressure of plane waves on the area that closes.

A face that meets another at the speed v sends a plane wave into either body,

.. math:: p = \frac{v}{1/z_a + 1/z_b}, \qquad z = \rho\, c_p = \sqrt{\rho\, M},

with the modulus M of uniaxial strain (Graff, Wave Motion in Elastic Solids, 1975, section 6.1),
until waves from its edges arrive. Points whose gaps differ by less than :math:`v \tau` meet within
the time :math:`\tau`: the force rises by p times their area, whatever the bodies do elsewhere.
"""

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from klack.contact.mortar import ContactSpace
from klack.contact.pairing import face_geometry, face_lattice, gaps_to
from klack.contact.ray_cutting import CurvedFaces
from klack.materials.material import Material
from klack.mesh.mesh import FaceBlock, Mesh, Surface

__all__ = ["area_at_once", "front_pressure", "relative_curvatures"]


_LATTICE = 7
_LEAST_SHARE = 0.3  # of the samples that have to face the other surface


def relative_curvatures(
    space: ContactSpace,
    pressures: NDArray[np.float64],
    sides: tuple[tuple[Mesh, Surface, CurvedFaces], tuple[Mesh, Surface, CurvedFaces]],
) -> NDArray[np.float64]:
    """Principal relative curvatures (d - 1,) [1/m] at the most loaded point, the largest first.

    Convex positive: about 1/R for a sphere on a plane, 0 for flat on flat; nan where too little of
    the faces has something to face.

    Parameters
    ----------
    pressures (nc,) [N]
    sides
        Of a and b, as they touch.
    """
    slave, master = sides if space.slave == "a" else (sides[1], sides[0])
    (mesh, surface, _), (*_, faces) = slave, master
    node = int(space.nodes[np.argmax(pressures)])
    positions, normals = _samples(mesh, surface, node)
    gap = gaps_to(positions, normals, faces)
    met = np.isfinite(gap)
    columns = 1 if mesh.dimension == 2 else 2
    if np.sum(met) < max(_LEAST_SHARE * len(positions), 6 * columns):
        return np.full(columns, np.nan)
    normal = normals.mean(axis=0)
    frame = _tangents(normal / np.linalg.norm(normal))
    x = (positions[met] - mesh.points[node]) @ frame.T
    scale = float(np.abs(x).max())
    x, gap = x / scale, gap[met]
    if columns == 1:
        terms = np.column_stack([np.ones(len(x)), x, x**2])
        coefficient, *_ = np.linalg.lstsq(terms, gap)
        return np.array([2.0 * coefficient[2] / scale**2])
    u, v = x.T
    terms = np.column_stack([np.ones(len(x)), u, v, u**2, u * v, v**2])
    coefficient, *_ = np.linalg.lstsq(terms, gap)
    _, _, _, a, b, c = coefficient
    H = np.array([[2.0 * a, b], [b, 2.0 * c]]) / scale**2
    return np.asarray(np.linalg.eigvalsh(H)[::-1], dtype=float)


def _samples(
    mesh: Mesh, surface: Surface, node: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions and outward normals on the faces at a node, each (p, d)."""
    positions, normals = [], []
    for block in surface.blocks:
        lattice = face_lattice(block.family, _LATTICE)
        here = block.connectivity[(block.connectivity == node).any(axis=1)]
        if not len(here):
            continue
        at = face_geometry(mesh.points, FaceBlock(block.family, here), lattice)
        positions.append(at.position.reshape(-1, mesh.dimension))
        normals.append(at.normal.reshape(-1, mesh.dimension))
    return np.concatenate(positions), np.concatenate(normals)


def _tangents(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Orthonormal tangents in rows, shape (d - 1, d)."""
    if len(normal) == 2:
        return np.array([[-normal[1], normal[0]]])
    _, _, rows = np.linalg.svd(normal[None, :])
    return np.asarray(rows[1:])


def area_at_once(space: ContactSpace, travel: float) -> float:
    """Area [m^2] that has met after a rigid travel [m] from first touch."""
    facing = space.axial > 1e-6
    height = space.gap[facing] / space.axial[facing]
    return float(space.area[facing][height <= np.min(height, initial=np.inf) + travel].sum())


def front_pressure(speed: float, material_a: Material, material_b: Material) -> float:
    """Pressure [Pa] of faces that meet at a speed [m/s].

    Examples
    --------
    >>> steel = Material(name="steel", young=210e9, poisson=0.3, density=7850.0)
    >>> f"{1e-6 * front_pressure(1.0, steel, steel):.1f} MPa"
    '23.6 MPa'
    """
    return speed / sum(1.0 / _impedance(one) for one in (material_a, material_b))


def _impedance(material: Material) -> float:
    """Of a plane wave [Pa s/m]."""
    return sqrt(material.density * (material.lame_lambda + 2.0 * material.shear_modulus))
