r"""Rows on nodal displacements: what a gauge of a body reads is ``row . u``.

A gauge reads the mean over a length *l* along a direction *d*, centred on its place.  For the
strain that is exact without any integration,

.. math:: \frac1l \int_{-l/2}^{l/2} d \cdot \frac{\partial u}{\partial s} \, \mathrm ds =
    \frac{d \cdot \left[u(x + \tfrac l2 d) - u(x - \tfrac l2 d)\right]}{l},

and without a length it is the gradient of the shape functions. Both give a uniform strain exactly.
Around the axis the strain is :math:`u_r / r`. The stress along *d* is Hooke's :math:`\sigma_d =
\lambda \, \mathrm{tr}\,\varepsilon + 2 \mu \, \varepsilon_d`.

Where elements meet, their mean is taken; on a face the values are those of the elements behind it,
not of the load on it.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from klack.arrays import Floats
from klack.bodies.elasticity.shape_functions import shape_functions
from klack.bodies.gauges.located_point import LocatedPoint, locate
from klack.errors import InputError, refuse_if, require_nonnegative
from klack.materials.material import Material
from klack.mesh.mesh import Mesh
from klack.mesh.rigid import Pose

__all__ = ["AROUND", "Line", "displacement_row", "strain_row", "stress_row"]


AROUND = "around"
"""Direction around the axis of a body of revolution."""

_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_ON_AXIS = 1e-9  # of the largest radius


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Line:
    """Where a gauge sits: a place, a direction, a length.

    Parameters
    ----------
    at (dimension,) [m]
        Its middle.
    direction (dimension,) [-], or ``"around"``
        Unit vector.
    length [m]
        0 for a point.
    pose
        How the body came there from its drawing, whose coordinates errors use.
    """

    at: Floats
    direction: Floats | str
    length: float
    where: str
    pose: Pose | None = None

    def __post_init__(self) -> None:
        require_nonnegative(f"{self.where}: length", self.length, "m")
        refuse_if(
            isinstance(self.direction, str) and len(self.at) != 2,
            f"{self.where}: direction",
            got=f"'{self.direction}' on a solid",
            expected="x, y, z or three numbers",
            hint="'around' is a direction of bodies of revolution.",
        )

    def found(self, mesh: Mesh, place: Floats) -> tuple[LocatedPoint, ...]:
        """See :func:`klack.bodies.gauges.located_point.locate`."""
        is_middle = np.array_equal(place, self.at)
        where = self.where if is_middle else f"{self.where}, within the gauge length"
        return locate(mesh, place, where, self.pose)

    def places(self) -> tuple[tuple[float, Floats], ...]:
        """Places with their weights; around the axis all places are the same."""
        if self.length == 0.0 or isinstance(self.direction, str):
            return ((1.0, self.at),)
        return tuple(
            (0.5 * float(w), self.at + 0.5 * self.length * s * self.direction)
            for s, w in zip(_POINTS, _WEIGHTS, strict=True)
        )


def displacement_row(mesh: Mesh, line: Line) -> Floats:
    """Mean displacement along a line, shape (n_dof,) [-]; rejected around the axis."""
    if isinstance(line.direction, str):
        raise InputError(
            f"{line.where}: direction",
            got="'around', a direction in which a body of revolution does not move",
            expected="r or z",
            hint="only strain and stress have that direction.",
        )
    row = np.zeros((mesh.node_count, mesh.dimension))
    for weight, place in line.places():
        found = line.found(mesh, place)
        for item in found:
            N, _ = _shapes(mesh, item)
            row[item.nodes] += weight / len(found) * N[:, None] * line.direction
    return row.ravel()


def strain_row(mesh: Mesh, line: Line) -> Floats:
    """Mean strain along a line, positive in tension, shape (n_dof,) [1/m]."""
    if line.length > 0.0 and not isinstance(line.direction, str):
        ahead, behind = (
            displacement_row(
                mesh,
                Line(
                    at=line.at + 0.5 * side * line.length * line.direction,
                    direction=line.direction,
                    length=0.0,
                    where=f"{line.where}, end of the gauge length",
                    pose=line.pose,
                ),
            )
            for side in (1.0, -1.0)
        )
        return np.asarray((ahead - behind) / line.length)
    found = line.found(mesh, line.at)
    parts = [_strain(mesh, item, line.direction) for item in found]
    return np.asarray(sum(parts) / len(parts))


def stress_row(mesh: Mesh, line: Line, materials: Mapping[str, Material]) -> Floats:
    """Mean normal stress along a line, positive in tension, shape (n_dof,) [Pa/m]."""
    row = np.zeros(mesh.dof_count)
    for weight, place in line.places():
        found = line.found(mesh, place)
        for item in found:
            material = materials[item.block.solid]
            along = _strain(mesh, item, line.direction)
            share = weight / len(found)
            row += 2.0 * share * material.shear_modulus * along
            row += share * material.lame_lambda * _trace(mesh, item)
    return row


def _shapes(mesh: Mesh, item: LocatedPoint) -> tuple[Floats, Floats]:
    """Shape functions (n,) and their gradients (n, dimension) [1/m] at a place."""
    N, dN = shape_functions(item.block.family, item.xi[None])
    J = mesh.points[item.nodes].T @ dN[0]
    return N[0], np.asarray(dN[0] @ np.linalg.inv(J))


def _strain(mesh: Mesh, item: LocatedPoint, direction: Floats | str) -> Floats:
    if isinstance(direction, str):
        return _hoop(mesh, item)
    row = np.zeros((mesh.node_count, mesh.dimension))
    _, gradient = _shapes(mesh, item)
    row[item.nodes] = np.outer(gradient @ direction, direction)
    return row.ravel()


def _hoop(mesh: Mesh, item: LocatedPoint) -> Floats:
    """``u_r / r``; on the axis its limit, the slope of u_r."""
    N, gradient = _shapes(mesh, item)
    row = np.zeros((mesh.node_count, mesh.dimension))
    on_axis = item.place[0] <= _ON_AXIS * mesh.points[:, 0].max()
    row[item.nodes, 0] = gradient[:, 0] if on_axis else N / item.place[0]
    return row.ravel()


def _trace(mesh: Mesh, item: LocatedPoint) -> Floats:
    row = np.zeros((mesh.node_count, mesh.dimension))
    row[item.nodes] = _shapes(mesh, item)[1]
    trace = row.ravel()
    return trace + _hoop(mesh, item) if mesh.dimension == 2 else trace
