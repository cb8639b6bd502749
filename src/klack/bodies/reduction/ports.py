"""Ports: where a force enters a body and which displacement does work on it.

A port is one load pattern ``b``, the nodal forces of a resultant of 1 N. Force in: ``f = b F``.
Displacement out: ``y = b^T u``, the mean displacement weighted like the load. The *same* vector
for both makes the transfer function symmetric (Maxwell, Betti), and ``F dy`` the work of the nodal
forces.

A single node is no port. A load spread over an area but read at one node has ``c != b``: the
reduced body is not reciprocal, and a contact closed over such a pair creates or swallows energy (a
mismatch of 10 % in the modal amplitudes moved the energy of a two-rod impact by -5 to +3 %). Under
a point load, in three dimensions, the displacement grows without bound as the mesh is refined.
Single nodes are therefore read only, by an :class:`Observer`.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.bodies.elasticity.quadrature import quadrature
from klack.bodies.elasticity.shape_functions import shape_functions
from klack.errors import InputError, refuse_if
from klack.mesh.mesh import FaceBlock, Mesh, Surface

__all__ = [
    "FaceSamples",
    "Observer",
    "Port",
    "face_samples",
    "node_observer",
    "node_set_port",
    "pressure_port",
    "surface_port",
]


@dataclass(frozen=True, slots=True, eq=False)
class FaceSamples:
    """Integration points of ``f`` faces of one family, ``q`` points each, ``n`` nodes.

    Parameters
    ----------
    values (q, n) [-]
        Shape functions.
    area (f, q) [m^2]
        Weight times area, of an axisymmetric face round the full circle.
    normal (f, q, dimension) [-]
        Outwards, of length 1; zero where a face has no area.
    """

    values: NDArray[np.float64]
    area: NDArray[np.float64]
    normal: NDArray[np.float64]


def face_samples(mesh: Mesh, block: FaceBlock) -> FaceSamples:
    """Integration points, exact for products of two shape functions on plane faces."""
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


Direction = Literal["x", "y", "z", "r"] | ArrayLike


@dataclass(frozen=True, slots=True, eq=False)
class Port:
    """One place where force and displacement are exchanged.

    Parameters
    ----------
    pattern (n_dof,) [-]
        Nodal forces ``b`` of a resultant of 1 N; of a contact ``G^T lam / P`` of the static
        contact problem.
    """

    name: str
    pattern: NDArray[np.float64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "pattern", _weights(f"port '{self.name}'", self.pattern))


@dataclass(frozen=True, slots=True, eq=False)
class Observer:
    """A displacement that is read but never loaded.

    Parameters
    ----------
    weights (n_dof,) [-]
        The displacement is ``weights . u``.
    """

    name: str
    weights: NDArray[np.float64]

    def __post_init__(self) -> None:
        object.__setattr__(self, "weights", _weights(f"observer '{self.name}'", self.weights))


def _weights(where: str, values: ArrayLike) -> NDArray[np.float64]:
    array = np.array(values, dtype=float)
    usable = array.ndim == 1 and bool(np.all(np.isfinite(array))) and bool(np.any(array))
    refuse_if(
        not usable,
        where,
        got=f"an array of shape {array.shape} with {np.count_nonzero(array)} non-zero entries",
        expected="one finite number per degree of freedom, not all of them zero",
        hint="check that the surface has faces and that the load is not zero.",
    )
    array.setflags(write=False)
    return array


def surface_port(mesh: Mesh, surface: str | Surface, direction: Direction, *, name: str) -> Port:
    r"""Port of a uniform traction on a surface, resultant 1 N along ``direction``.

    .. math:: b_{id} = \frac{e_d}{A} \int_A N_i \, dA

    integrated over the curved faces (the full circle of an axisymmetric body): the displacement is
    the mean over the area.

    Parameters
    ----------
    direction : "x", "y", "z", or array, shape (dimension,)
        An axisymmetric body takes ``"z"`` only: radial tractions have no resultant.
    """
    surface = mesh.surface(surface) if isinstance(surface, str) else surface
    where = f"port '{name}' on surface '{surface.name}'"
    unit = _unit_vector(mesh, direction, where)
    _radial_if(mesh.dimension == 2 and abs(unit[0]) > 0, where)
    weights = np.zeros(mesh.node_count)
    for block in surface.blocks:
        at = face_samples(mesh, block)
        np.add.at(weights, block.connectivity, np.einsum("qn,fq->fn", at.values, at.area))
    total = weights.sum()
    _require_area(where, total)
    return Port(name, (weights[:, None] / total * unit).ravel())


def pressure_port(mesh: Mesh, surface: str | Surface, *, name: str) -> Port:
    r"""Port of a uniform pressure, normal to a surface, resultant 1 N.

    .. math:: b_i = -\frac{1}{R} \int_A N_i \, n \, dA, \qquad
              R = \left| \int_A n \, dA \right|

    Unlike :func:`surface_port`, the load of a cone or a sphere has lateral parts that squeeze the
    body. The port points along the resultant (into the material). A closed surface has none and is
    rejected.
    """
    surface = mesh.surface(surface) if isinstance(surface, str) else surface
    load = np.zeros((mesh.node_count, mesh.dimension))
    total = 0.0
    for block in surface.blocks:
        at = face_samples(mesh, block)
        forces = -np.einsum("qn,fq,fqd->fnd", at.values, at.area, at.normal)
        np.add.at(load, block.connectivity, forces)
        total += float(at.area.sum())
    resultant = load.sum(axis=0)
    if mesh.dimension == 2:
        resultant[0] = 0.0  # radial forces cancel around the circle
    size = float(np.linalg.norm(resultant))
    _require_area(f"port '{name}' on surface '{surface.name}'", size if size > 1e-9 * total else 0)
    return Port(name, (load / size).ravel())


def node_set_port(mesh: Mesh, node_set: str, direction: Direction, *, name: str) -> Port:
    """Port of equal forces on the nodes of a set, resultant 1 N along ``direction``.

    For bodies without faces.  Equal weights are no uniform pressure: on quadratic elements corner
    nodes should carry none of it, so take a set of many nodes, or faces and :func:`surface_port`.

    Parameters
    ----------
    direction : "x", "y", "z", or array, shape (dimension,)
        An axisymmetric body takes ``"z"`` only.
    """
    where = f"port '{name}' on node set '{node_set}'"
    nodes = mesh.node_sets.get(node_set)
    if nodes is None or not len(nodes):
        raise InputError(
            where,
            got="a name that is not in the mesh" if nodes is None else "a set without nodes",
            expected=f"one of: {', '.join(sorted(mesh.node_sets)) or 'none'}",
            hint="name the set in geometry.nodes.sets, or in the mesh file.",
        )
    unit = _unit_vector(mesh, direction, where)
    _radial_if(mesh.dimension == 2 and abs(unit[0]) > 0, where)
    pattern = np.zeros((mesh.node_count, mesh.dimension))
    pattern[nodes] = unit / len(nodes)
    return Port(name, pattern.ravel())


def node_observer(
    mesh: Mesh, place: int | ArrayLike, direction: Direction, *, name: str
) -> Observer:
    """Displacement of one node, for output only.

    Parameters
    ----------
    place : int or array, shape (dimension,) [m]
        Number, or a point whose nearest node is taken.
    direction : "x", "y", "z", "r" (axisymmetric), or array, shape (dimension,)
    """
    where = f"observer '{name}'"
    unit = _unit_vector(mesh, direction, where)
    if isinstance(place, int | np.integer):
        node = int(place)
        refuse_if(
            not 0 <= node < mesh.node_count,
            where,
            got=f"node {node}",
            expected=f"0 to {mesh.node_count - 1}",
            hint="give a node number of this mesh, or a point [m].",
        )
    else:
        node = int(np.argmin(np.sum((mesh.points - np.asarray(place, float)) ** 2, axis=1)))
    weights = np.zeros((mesh.node_count, mesh.dimension))
    weights[node] = unit
    return Observer(name, weights.ravel())


def _unit_vector(mesh: Mesh, direction: Direction, where: str) -> NDArray[np.float64]:
    names = {1: "z", 2: "rz", 3: "xyz"}[mesh.dimension]
    if isinstance(direction, str):
        vector = np.array([float(direction == name) for name in names])
    else:
        vector = np.asarray(direction, dtype=float)
    length = float(np.linalg.norm(vector)) if vector.shape == (mesh.dimension,) else 0.0
    refuse_if(
        not (np.isfinite(length) and length > 0),
        where,
        got=f"direction {direction!r}",
        expected=f"one of {', '.join(names)}, or a vector of {mesh.dimension} numbers",
        hint="an axisymmetric body has the directions r and z, a solid x, y and z.",
    )
    return vector / length


def _radial_if(wrong: object, where: str) -> None:
    refuse_if(
        wrong,
        where,
        got="a radial direction on an axisymmetric body",
        expected="'z'",
        hint="a radial traction has no resultant around the circle; use a 3-D body.",
    )


def _require_area(where: str, area: float) -> None:
    refuse_if(
        not area > 0,
        where,
        got="a surface without area or without resultant",
        expected="at least one face, not closed on itself",
        hint="check the name of the surface in the mesh.",
    )
