r"""*SYSTEM: a rectangular frame in which the nodes that follow are given.

.. math:: x = a + x_1' e_1 + x_2' e_2 + x_3' e_3
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.mesh.files.abaqus.keywords import Keyword
from klack.mesh.files.abaqus.numbers import number

__all__ = ["NodeSystem", "read_system"]

_SMALLEST = 1e-9  # sine of the angle between axes, relative length


@dataclass(frozen=True, slots=True, eq=False)
class NodeSystem:
    """Frame of node coordinates.

    Parameters
    ----------
    origin : array, shape (3,)
    axes : array, shape (3, 3)
        One unit vector per row.
    """

    origin: NDArray[np.float64]
    axes: NDArray[np.float64]

    def of(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Global coordinates of points in this frame, shape (n, 3)."""
        return self.origin + points @ self.axes


def read_system(keyword: Keyword) -> NodeSystem | None:
    """Frame of a *SYSTEM; None, the global one, if it has no data.

    The first line holds the origin and a point of the first axis, the second a point of the plane
    of the first and second axis.  Without the second line the third axis stays, and the first one
    is laid into the plane z = 0.
    """
    rows = [[number(line, t) for t in line.fields] for line in keyword.lines() if line.fields]
    lengths = [len(row) for row in rows]
    if not rows:
        return None
    if lengths == [3]:
        return NodeSystem(np.array(rows[0]), np.eye(3))
    if lengths not in ([6], [6, 3]):
        raise _unfit(keyword, f"data lines of {', '.join(map(str, lengths[:8]))} numbers")
    a, b = np.array(rows[0][:3]), np.array(rows[0][3:])
    first = b - a
    second = np.array(rows[1]) - a if len(rows) == 2 else np.array([-first[1], first[0], 0.0])
    if len(rows) == 1:
        first = np.array([first[0], first[1], 0.0])
    normal = np.cross(first, second)
    size = np.linalg.norm(first) * np.linalg.norm(second)
    if not (np.isfinite(size) and np.linalg.norm(normal) > _SMALLEST * size):
        raise _unfit(keyword, "points on one line")
    e1, e3 = first / np.linalg.norm(first), normal / np.linalg.norm(normal)
    return NodeSystem(a, np.array([e1, np.cross(e3, e1), e3]))


def _unfit(keyword: Keyword, got: str) -> InputError:
    return InputError(
        f"{keyword.place}: *SYSTEM",
        got=got,
        expected="an origin (3 numbers), with a point of the x axis (6), and in a second line a "
        "point of the x-y plane (3)",
        hint="write the file again with global rectangular coordinates.",
    )
