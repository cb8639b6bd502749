"""Requirements on a mesh from a file, reported with its node and element numbers."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.mesh.mesh import ElementBlock, Mesh
from klack.mesh.quality import require_positive_jacobians

__all__ = ["require_near", "require_right_of_axis", "require_sound"]

Ints = NDArray[np.int64]

_CHUNK = 50_000
_FARTHEST = 1e4  # [m] of a node from the origin


def require_near(path: Path, points: NDArray[np.float64], numbers: Ints) -> None:
    """Raise for a node so distant that its unit or its columns must be wrong."""
    far = np.abs(points).max(axis=1) > _FARTHEST
    if far.any():
        at = int(np.argmax(far))
        raise InputError(
            f"{path}: node {numbers[at]}",
            got=f"a coordinate of {np.abs(points[at]).max():.3g} m",
            expected=f"coordinates within {_FARTHEST:g} m",
            hint="check the unit, and the columns of this node.",
        )


def require_right_of_axis(path: Path, mesh: Mesh, numbers: Ints) -> None:
    """Raise for a node of an axisymmetric mesh that lies left of the axis."""
    if mesh.dimension != 2:
        return
    lowest = int(np.argmin(mesh.points[:, 0]))
    if mesh.points[lowest, 0] < 0:
        raise InputError(
            f"{path}: node {numbers[lowest]}",
            got=f"r = x = {mesh.points[lowest, 0] * 1e3:.6g} mm",
            expected="r >= 0: the axis of an axisymmetric mesh is x = 0",
            hint="draw the half of the section that lies at positive x.",
        )


def require_sound(path: Path, mesh: Mesh, numbers: Sequence[Ints]) -> None:
    """Raise for an inverted element; some at a time, which bounds the memory."""
    blocks, labels = [], []
    for block, own in zip(mesh.blocks, numbers, strict=True):
        for begin in range(0, len(own), _CHUNK):
            part = slice(begin, begin + _CHUNK)
            blocks.append(ElementBlock(block.family, block.connectivity[part], block.solid))
            labels.append(own[part])
    parts = replace(mesh, blocks=tuple(blocks))
    with np.errstate(all="ignore"):  # damaged numbers: what is not above 0 is refused
        require_positive_jacobians(str(path), parts, numbers=labels)
