r"""Where a point lies in a mesh: its element, and its coordinates there.

In elements near the point the reference coordinates are found by Gauss-Newton steps,

.. math:: J^T J \, \Delta\xi = J^T (x - x(\xi)),

kept inside the element; where none holds the point, the nearest place by sequential quadratic
programming.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from klack.arrays import Floats, Ints
from klack.bodies.elasticity.shape_functions import reference_nodes, shape_functions
from klack.errors import refuse_if
from klack.mesh.mesh import ElementBlock, Mesh
from klack.mesh.rigid import Pose
from klack.units import format_si

__all__ = ["LocatedPoint", "locate"]


_SNAP = 0.05
"""Share of the element size that a flat facet may lie below the curved face."""

_ROUNDS = 30
_SHARED = 1e-6  # of the element size: elements that meet at the point all have it
_SETTLED = 1e-13  # of the reference coordinates


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LocatedPoint:
    """A point of one element.

    Parameters
    ----------
    element
        Row of its connectivity.
    xi (dimension,) [-]
        Reference coordinates.
    distance [m]
        From the wanted point.
    place (dimension,) [m]
    """

    block: ElementBlock
    element: int
    xi: Floats
    distance: float
    place: Floats

    @property
    def nodes(self) -> Ints:
        """Nodes of the element."""
        return np.asarray(self.block.connectivity[self.element])


def locate(
    mesh: Mesh, point: Floats, where: str, pose: Pose | None = None
) -> tuple[LocatedPoint, ...]:
    """Elements that hold a point, several where they meet; rejects one outside of the body.

    Parameters
    ----------
    point (dimension,) [m]
    pose
        How the mesh came there from its drawing, whose coordinates the error uses.
    """
    found = [
        _in_element(mesh, block, int(element), point)
        for block in mesh.blocks
        for element in _candidates(mesh, block, point)
    ]
    best = min(found, key=lambda item: item.distance)
    size = float(np.ptp(mesh.points[best.nodes], axis=0).max())
    if best.distance > _SHARED * size:
        found = [_nearest(mesh, item, point) for item in found]
        best = min(found, key=lambda item: item.distance)
    refuse_if(
        best.distance > _SNAP * size,
        where,
        got=f"a point at {_text(point, pose)}, {format_si(best.distance, 'm')} outside the body",
        expected=f"a point of the body; the nearest one is {_text(best.place, pose)}",
        hint="use that point, or correct the coordinates, which refer to the drawing.",
    )
    near = best.distance + _SHARED * size
    return tuple(item for item in found if item.distance <= near)


def _text(point: Floats, pose: Pose | None) -> str:
    if pose is not None and len(point) == 2:  # turned bodies move along their axis alone
        point = point - np.array([0.0, pose.shift[2]])
    elif pose is not None:
        point = pose.drawn(point)
    return "(" + ", ".join(f"{round(1e3 * x, 6) + 0.0:g}" for x in point) + ") mm"


def _candidates(mesh: Mesh, block: ElementBlock, point: Floats) -> Ints:
    """Elements whose box is not farther than the nearest node of the block."""
    x = mesh.points[block.connectivity]
    slack = 0.1 * np.ptp(x, axis=1)  # curved sides leave the box of the nodes
    below, above = x.min(axis=1) - slack - point, point - x.max(axis=1) - slack
    to_box = np.linalg.norm(np.maximum(np.maximum(below, above), 0.0), axis=1)
    to_node = np.sqrt(((x - point) ** 2).sum(axis=2).min())
    return np.flatnonzero(to_box <= to_node)


def _in_element(mesh: Mesh, block: ElementBlock, element: int, point: Floats) -> LocatedPoint:
    """Point of one element nearest to the wanted one."""
    family, x = block.family, mesh.points[block.connectivity[element]]
    xi = reference_nodes(family).mean(axis=0)
    for _ in range(_ROUNDS):
        N, dN = shape_functions(family, xi[None])
        J = x.T @ dN[0]
        step = np.linalg.lstsq(J, point - N[0] @ x, rcond=None)[0]
        new = _inside(family, xi + step)
        done = float(np.abs(new - xi).max()) < _SETTLED
        xi = new
        if done:
            break
    place = shape_functions(family, xi[None])[0][0] @ x
    return LocatedPoint(
        block=block,
        element=element,
        xi=xi,
        distance=float(np.linalg.norm(point - place)),
        place=place,
    )


def _nearest(mesh: Mesh, near: LocatedPoint, point: Floats) -> LocatedPoint:
    """The same for an element that does not hold the point."""
    family, x = near.block.family, mesh.points[near.nodes]
    size = float(np.ptp(x, axis=0).max())
    corners = reference_nodes(family)

    def apart(xi: Floats) -> float:
        return float(np.sum((shape_functions(family, xi[None])[0][0] @ x - point) ** 2)) / size**2

    straight = 0 if family.startswith(("quad", "hex")) else 2 if family.startswith("wedge") else 3
    row = (np.arange(len(near.xi)) < straight).astype(float)
    found = scipy.optimize.minimize(
        apart,
        near.xi,
        method="SLSQP",
        bounds=list(zip(corners.min(axis=0), corners.max(axis=0), strict=True)),
        constraints=scipy.optimize.LinearConstraint(row[None], -np.inf, 1.0) if straight else (),
        options={"ftol": 1e-14, "maxiter": 100},
    )
    xi = _inside(family, np.asarray(found.x, dtype=float))
    place = shape_functions(family, xi[None])[0][0] @ x
    distance = float(np.linalg.norm(point - place))
    if distance >= near.distance:
        return near
    return replace(near, xi=xi, distance=distance, place=place)


def _inside(family: str, xi: Floats) -> Floats:
    if family.startswith(("quad", "hex")):
        return np.clip(xi, -1.0, 1.0)
    if family.startswith("wedge"):
        return np.append(_in_simplex(xi[:2]), np.clip(xi[2], -1.0, 1.0))
    return _in_simplex(xi)


def _in_simplex(xi: Floats) -> Floats:
    """Nearest point of the unit simplex (Duchi et al. 2008 where the sum is above one)."""
    inside = np.maximum(xi, 0.0)
    if inside.sum() <= 1.0:
        return np.asarray(inside)
    falling = np.sort(xi)[::-1]
    over = (np.cumsum(falling) - 1.0) / np.arange(1, len(xi) + 1)
    return np.asarray(np.maximum(xi - over[np.flatnonzero(falling > over)[-1]], 0.0))
