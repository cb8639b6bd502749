"""A finite-element mesh: points, blocks of elements, named surfaces and node sets."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.mesh.families import FAMILIES, ElementFamily
from klack.mesh.rigid import Pose

__all__ = ["ElementBlock", "FaceBlock", "Mesh", "Surface", "simplices", "solid_at"]


@dataclass(frozen=True, slots=True)
class ElementBlock:
    """Elements of one family that belong to one solid.

    Parameters
    ----------
    family : str
        Key of :data:`klack.mesh.families.FAMILIES`, of dimension 3 or 2.
    connectivity : int array, shape (n_elements, n_nodes)
        Node numbers, Abaqus order.
    solid : str
        Name of the solid; the material is chosen by it.
    """

    family: str
    connectivity: NDArray[np.int64]
    solid: str

    @property
    def topology(self) -> ElementFamily:
        """Topology of the elements."""
        return FAMILIES[self.family]


@dataclass(frozen=True, slots=True)
class FaceBlock:
    """Element faces of one family, oriented outwards.

    Parameters
    ----------
    family : str
        ``line2 line3`` (axisymmetric), ``tri3 tri6 quad4 quad8``.
    connectivity : int array, shape (n_faces, n_nodes)
    """

    family: str
    connectivity: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Surface:
    """A named part of the boundary."""

    name: str
    blocks: tuple[FaceBlock, ...]

    @property
    def nodes(self) -> NDArray[np.int64]:
        """Sorted node numbers of the surface."""
        parts = [block.connectivity.ravel() for block in self.blocks]
        return np.unique(np.concatenate(parts)) if parts else np.empty(0, dtype=np.int64)

    @property
    def face_count(self) -> int:
        """Number of faces."""
        return sum(len(block.connectivity) for block in self.blocks)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mesh:
    """Nodal mesh of one body, in metres.

    Parameters
    ----------
    points : array, shape (n, 3) or (n, 2) [m]
        Three columns x, y, z for a solid; two columns r, z for an axisymmetric body (axis r = 0).
    blocks : tuple of ElementBlock
    surfaces : mapping of str to Surface
    node_sets : mapping of str to int array
    """

    points: NDArray[np.float64]
    blocks: tuple[ElementBlock, ...]
    surfaces: Mapping[str, Surface] = field(default_factory=dict)
    node_sets: Mapping[str, NDArray[np.int64]] = field(default_factory=dict)

    @property
    def dimension(self) -> int:
        """3 for a solid, 2 for an axisymmetric body; also the degrees of freedom per node."""
        return int(self.points.shape[1])

    @property
    def node_count(self) -> int:
        """Number of nodes."""
        return len(self.points)

    @property
    def dof_count(self) -> int:
        """Number of degrees of freedom; that of node i and direction d is dimension * i + d."""
        return self.node_count * self.dimension

    @property
    def element_count(self) -> int:
        """Number of elements."""
        return sum(len(block.connectivity) for block in self.blocks)

    @property
    def solids(self) -> tuple[str, ...]:
        """Names of the solids, in order of first appearance."""
        return tuple(dict.fromkeys(block.solid for block in self.blocks))

    def surface(self, name: str) -> Surface:
        """Surface by name.

        Raises
        ------
        InputError
            If there is none of that name; the text lists the names there are.
        """
        if name not in self.surfaces:
            known = ", ".join(sorted(self.surfaces)) or "none"
            got, hint = "a name that the mesh does not have", "check the spelling, or name the face"
            if name in self.node_sets:
                got, hint = "a set of nodes, which has no faces", "name its faces as a surface"
            raise InputError(
                f"surface '{name}'",
                got=got,
                expected=f"one of: {known}",
                hint=f"{hint} in the CAD or mesh file.",
            )
        return self.surfaces[name]

    def moved(self, shift: NDArray[np.float64]) -> Self:
        """Translate the mesh by ``shift``, shape (dimension,) [m]."""
        return replace(self, points=self.points + np.asarray(shift))

    def placed(self, pose: Pose) -> Self:
        """Turn and shift the mesh of a solid rigidly.

        Raises
        ------
        InputError
            For an axisymmetric body, which cannot leave its axis.
        """
        if self.dimension != 3:
            raise InputError(
                "mesh: rigid displacement",
                got="an axisymmetric body",
                expected="a solid",
                hint="take 'model: swept' with 'layers: 18'; a shift along z is 'moved'.",
            )
        return replace(self, points=pose.of(self.points))


def solid_at(mesh: Mesh, surface: Surface) -> str:
    """Solid that most nodes of a surface belong to."""
    nodes = surface.nodes
    counts = [np.isin(nodes, block.connectivity).sum() for block in mesh.blocks]
    return mesh.blocks[int(np.argmax(counts))].solid


_SIMPLICES: dict[str, tuple[tuple[int, ...], ...]] = {
    "line2": ((0, 1),),
    "line3": ((0, 2), (2, 1)),
    "tri3": ((0, 1, 2),),
    "tri6": ((0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)),
    "quad4": ((0, 1, 2), (0, 2, 3)),
    "quad8": ((0, 4, 7), (1, 5, 4), (2, 6, 5), (3, 7, 6), (4, 5, 6), (4, 6, 7)),
}


def simplices(block: FaceBlock) -> NDArray[np.int64]:
    """Triangles or segments of every face through all its nodes, shape (f, dimension)."""
    local = np.array(_SIMPLICES[block.family])
    return block.connectivity[:, local].reshape(-1, local.shape[1])
