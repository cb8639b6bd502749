"""Shapes of ANSYS elements: a brick with repeated nodes is a tetrahedron or a wedge.

Corners of a brick are I J K L M N O P, mid nodes Q to X of the two quadrilaterals and Y Z A B
between them.  A wedge has K = L and O = P, a tetrahedron K = L and M = N = O = P, a pyramid
M = N = O = P (ANSYS element reference, SOLID185 and SOLID186).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.mesh.families import FAMILIES
from klack.mesh.files.ansys.blocks import ElementTable
from klack.mesh.files.text_columns import TextLines

__all__ = ["SHAPES", "faces_of", "shapes_of"]

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Shape:
    """Family, and the nodes of the ANSYS element in its order."""

    family: str
    order: tuple[int, ...]


SHAPES = (
    Shape("hex8", tuple(range(8))),
    Shape("hex20", tuple(range(20))),
    Shape("wedge6", (0, 1, 2, 4, 5, 6)),
    Shape("wedge15", (0, 1, 2, 4, 5, 6, 8, 9, 11, 12, 13, 15, 16, 17, 18)),
    Shape("tet4", (0, 1, 2, 4)),
    Shape("tet10", (0, 1, 2, 4, 8, 9, 11, 16, 17, 18)),
    # SOLID187, SOLID92 and SOLID285 are tetrahedra from the start
    Shape("tet4", tuple(range(4))),
    Shape("tet10", tuple(range(10))),
)

_TETRAHEDRA = (92, 187, 285)


def shapes_of(lines: TextLines, table: ElementTable, kind: Ints) -> Ints:
    """Number in :data:`SHAPES` for every element.

    Parameters
    ----------
    lines : TextLines
        For the places in error texts.
    table : ElementTable
    kind : int array, shape (n,)
        185, 186, ...

    Raises
    ------
    InputError
        For pyramids, other repeated nodes, and elements that miss some of their mid nodes.
    """
    nodes = table.nodes
    K, L, M, N, O, P = nodes[:, 2:8].T  # noqa: E741
    own_tetrahedron = np.isin(kind, _TETRAHEDRA)
    top = (M == N) & (N == O) & (O == P)
    tetrahedron = ~own_tetrahedron & top & (K == L)
    pyramid = ~own_tetrahedron & top & (K != L)
    wedge = ~own_tetrahedron & ~top & (K == L) & (O == P)
    _refuse(lines, table, pyramid, "a pyramid", "split it into tetrahedra, or mesh without it.")
    linear = np.where(own_tetrahedron, 6, np.where(tetrahedron, 4, np.where(wedge, 2, 0)))
    shapes = linear.copy()
    for code in range(0, len(SHAPES), 2):
        here = linear == code
        corners = FAMILIES[SHAPES[code].family].nodes
        own = nodes[here][:, SHAPES[code + 1].order]
        middle = (own[:, corners:] > 0).sum(axis=1)
        every = own.shape[1] - corners
        partly = np.zeros(len(nodes), dtype=bool)
        partly[here] = (middle > 0) & (middle < every)
        _refuse(
            lines,
            table,
            partly,
            "an element without some of its mid nodes",
            "add them with EMID, ADD, or remove all of them with EMID, REMOVE.",
        )
        shapes[here] += middle == every
        strange = np.zeros(len(nodes), dtype=bool)
        ordered = np.sort(own[:, :corners], axis=1)
        strange[here] = (ordered[:, :1] <= 0)[:, 0] | (ordered[:, 1:] == ordered[:, :-1]).any(
            axis=1
        )
        _refuse(
            lines,
            table,
            strange,
            "corner nodes with an unknown repetition, or missing ones",
            "mesh with tetrahedra, hexahedra and wedges.",
        )
    return shapes


def _refuse(
    lines: TextLines, table: ElementTable, bad: NDArray[np.bool_], got: str, hint: str
) -> None:
    if bad.any():
        at = int(np.argmax(bad))
        raise InputError(
            f"{lines.place(int(table.row[at]))}: element {table.number[at]}",
            got=got,
            expected="a tetrahedron, hexahedron or wedge",
            hint=hint,
        )


def faces_of(
    nodes: Ints, kind: Ints, option: Ints
) -> Iterator[tuple[str, NDArray[np.bool_], Ints]]:
    """Triangles and quadrilaterals among surface elements: family, which, corner nodes.

    Parameters
    ----------
    nodes : int array, shape (n, 20)
    kind : int array, shape (n,)
    option : int array, shape (n,)
        KEYOPT(1), which is the shape of MESH200.
    """
    facet = kind == 200
    count = (nodes > 0).sum(axis=1)
    triangle = np.where(facet, np.isin(option, (4, 5)), (nodes[:, 2] == nodes[:, 3]) | (count == 3))
    quadrilateral = np.where(facet, np.isin(option, (6, 7)), ~triangle & (count >= 4))
    repeated = nodes[:, 2] == nodes[:, 3]
    triangle, quadrilateral = triangle | (quadrilateral & repeated), quadrilateral & ~repeated
    for family, here, corners in (("tri3", triangle, 3), ("quad4", quadrilateral, 4)):
        if here.any():
            yield family, here, nodes[here][:, :corners]
