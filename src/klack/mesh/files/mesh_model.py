"""A mesh as of a file: numbers, materials and unit."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from klack.mesh.mesh import Mesh

__all__ = ["FileMaterial", "MeshModel"]


@dataclass(frozen=True, slots=True, kw_only=True)
class FileMaterial:
    """Elastic material in the units of the file.

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
        Of the file.
    element_numbers
        Of the file, by block.
    sections
        Material by solid, where given.
    unit_length [m]
        One unit of the file.
    left_out
        Elements that are no solids, counted by type.
    foreign_materials
        Materials that are not isotropic and linear, in words.
    """

    mesh: Mesh
    node_numbers: NDArray[np.int64]
    element_numbers: tuple[NDArray[np.int64], ...]
    materials: Mapping[str, FileMaterial]
    sections: Mapping[str, str]
    unit_length: float
    left_out: Mapping[str, int] = field(default_factory=dict)
    foreign_materials: Mapping[str, str] = field(default_factory=dict)
