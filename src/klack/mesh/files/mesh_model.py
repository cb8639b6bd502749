"""A mesh as a file holds it: with the numbers of the file, its materials and its unit."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from klack.mesh.mesh import Mesh

__all__ = ["FileMaterial", "MeshModel"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FileMaterial:
    """Elastic material as the file has it, in the units of the file.

    Parameters
    ----------
    young [stress unit of the file]
    poisson [-]
    density : float [density unit of the file], or None
    """

    name: str
    young: float
    poisson: float
    density: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class MeshModel:
    """Mesh with the other content of the file.

    Parameters
    ----------
    node_numbers (n_nodes,)
        Number in the file of every node of the mesh.
    element_numbers
        The same for the elements, one array per block.
    materials : mapping of name to FileMaterial
    sections : mapping of solid name to material name
        Where the file says it.
    unit_length [m]
        Length of one unit of the file.
    left_out
        Elements of the file that are no solids and were left out, counted by their type.
    foreign_materials : mapping of name to str
        Materials that are not isotropic and linear, and what they are.
    """

    mesh: Mesh
    node_numbers: NDArray[np.int64]
    element_numbers: tuple[NDArray[np.int64], ...]
    materials: Mapping[str, FileMaterial]
    sections: Mapping[str, str]
    unit_length: float
    left_out: Mapping[str, int] = field(default_factory=dict)
    foreign_materials: Mapping[str, str] = field(default_factory=dict)
