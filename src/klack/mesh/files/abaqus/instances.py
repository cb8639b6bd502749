r"""Instances of parts: where the assembly puts them, and how their names and numbers are kept.

The data lines of *INSTANCE hold a translation :math:`t` and, in a second line, two points
:math:`a, b` of an axis and an angle in degrees.  The translation comes first:

.. math:: x' = R\,(x + t - a) + a .
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, refuse
from klack.mesh.families import FAMILIES
from klack.mesh.files.abaqus.keywords import Keyword
from klack.mesh.files.abaqus.numbers import number
from klack.mesh.files.abaqus.scope import FaceSelection, Instance, Scope, Section
from klack.mesh.rigid import rotation_matrix

__all__ = ["Placement", "add_instance", "read_placement"]

LARGEST_NODES = 100_000_000
"""Most nodes of all instances together."""

Points = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Placement:
    """Rigid displacement of an instance, in the units of the file.

    Parameters
    ----------
    shift : array, shape (3,)
    turn : array, shape (3, 3)
    about : array, shape (3,)
        A point of the axis, after the shift.
    """

    shift: Points
    turn: Points
    about: Points

    @property
    def along_axis(self) -> bool:
        """True if a body of revolution (r = x, z = y) stays one."""
        return not self.shift[[0, 2]].any() and np.array_equal(self.turn, np.eye(3))

    def of(self, points: Points) -> Points:
        """Points of the part, shape (n, 3), where the instance has them."""
        if not self.shift.any() and np.array_equal(self.turn, np.eye(3)):
            return points
        moved = points + self.shift
        if np.array_equal(self.turn, np.eye(3)):
            return moved
        return (moved - self.about) @ self.turn.T + self.about


def read_placement(keyword: Keyword) -> Placement:
    """Placement of an *INSTANCE; without data lines it is left where the part is drawn."""
    rows = [[number(line, t) for t in line.fields] for line in keyword.lines() if line.fields]
    if [len(row) for row in rows] not in ([], [3], [3, 7]):
        raise InputError(
            f"{keyword.place}: *INSTANCE",
            got=f"data lines of {', '.join(str(len(row)) for row in rows[:8])} numbers",
            expected="a translation (3 numbers) and, if rotated, two points and an angle (7)",
            hint="write both lines; zeros for no translation.",
        )
    shift = np.array(rows[0] if rows else [0.0, 0.0, 0.0])
    if len(rows) < 2:
        return Placement(shift, np.eye(3), np.zeros(3))
    a, b, angle = np.array(rows[1][:3]), np.array(rows[1][3:6]), np.deg2rad(rows[1][6])
    length = float(np.linalg.norm(b - a))
    if not (length > 0 and np.isfinite(length)):
        raise InputError(
            f"{keyword.place}: *INSTANCE",
            got=f"an axis of length {length:g}",
            expected="two different points of the axis",
            hint="check the second data line: two points and an angle in degrees.",
        )
    return Placement(shift, rotation_matrix((b - a) / length * angle), a)


def add_instance(root: Scope, name: str, part: Scope, placement: Placement, place: str) -> None:
    """Put an instance into the assembly; its sets and surfaces are called ``name.set``."""
    refuse(
        (
            name.upper() in root.instances,
            InputError(
                f"{place}: *INSTANCE",
                got=f"a second instance '{name[:80]}'",
                expected="every name once",
                hint="give every instance its own name.",
            ),
        ),
        (
            root.nodes.count + part.nodes.count > LARGEST_NODES,
            InputError(
                f"{place}: *INSTANCE",
                got=f"{root.nodes.count + part.nodes.count} nodes with this instance",
                expected=f"at most {LARGEST_NODES}",
                hint="leave out unneeded instances.",
            ),
        ),
    )
    _require_revolution(part, placement, place)
    node, element = root.nodes.count, root.elements.count
    root.instances[name.upper()] = Instance(name, part, node, element)
    root.labels += part.labels
    root.points += [placement.of(points) for points in part.points]
    root.groups += [group.adopted(name, node, element) for group in part.groups]
    root.nodes.count += part.nodes.count
    root.elements.count += part.elements.count
    root.nodes.sets.adopt(place, name, part.nodes.sets, node)
    root.elements.sets.adopt(place, name, part.elements.sets, element)
    root.node_surfaces.adopt(place, name, part.node_surfaces, node)
    root.surfaces.adopt(
        name, part.surfaces, lambda part: FaceSelection(part.elements + element, part.side)
    )
    root.listed += [f"{name}.{key}".upper() for key in part.listed]
    root.sections += [Section(f"{name}.{s.elset}".upper(), s.material) for s in part.sections]


def _require_revolution(part: Scope, placement: Placement, place: str) -> None:
    flat = any(group.solid and FAMILIES[group.family].dimension == 2 for group in part.groups)
    if flat and not placement.along_axis:
        raise InputError(
            f"{place}: *INSTANCE",
            got="an axisymmetric part that is rotated, or moved away from its axis",
            expected="a translation along y, which is the axis",
            hint="draw the part at its radius.",
        )
