"""Requirements on a mesh from a file, reported with its node and element numbers."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.mesh.mesh import ElementBlock, Mesh
from klack.mesh.quality import require_positive_jacobians

__all__ = ["require_near", "require_right_of_axis", "require_sound", "same_nodes"]

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
    """Raise for elements on the same corners, and inverted ones; some at a time, for the memory.

    Two elements in one place count their mass and stiffness twice, and all their outer faces go.
    """
    for corners in sorted({block.topology.corners for block in mesh.blocks}):
        alike = [i for i, block in enumerate(mesh.blocks) if block.topology.corners == corners]
        nodes = np.concatenate([mesh.blocks[i].connectivity[:, :corners] for i in alike])
        if (twice := same_nodes(nodes)) is not None:
            first, second = np.concatenate([numbers[i] for i in alike])[list(twice)]
            raise InputError(
                f"{path}: element {second}",
                got=f"the corners of element {first} again"
                if first != second
                else "the same element for the second time",
                expected="every element once",
                hint="look for lines that are there twice, or write the file again.",
            )
    blocks, labels = [], []
    for block, own in zip(mesh.blocks, numbers, strict=True):
        for begin in range(0, len(own), _CHUNK):
            part = slice(begin, begin + _CHUNK)
            blocks.append(ElementBlock(block.family, block.connectivity[part], block.solid))
            labels.append(own[part])
    parts = replace(mesh, blocks=tuple(blocks))
    with np.errstate(all="ignore"):  # damaged numbers: what is not above 0 is refused
        require_positive_jacobians(str(path), parts, numbers=labels)


def same_nodes(nodes: Ints) -> tuple[int, int] | None:
    """Rows of the first two elements on the same nodes, in whatever order these stand."""
    ordered = np.sort(nodes, axis=1)
    # equal rows have equal sums; others hardly ever, and are told apart below
    weights = np.array([pow(0x9E3779B97F4A7C15, k, 1 << 64) for k in range(1, nodes.shape[1] + 1)])
    sums = (ordered.astype(np.uint64) * weights.astype(np.uint64)).sum(axis=1)
    by_sum = np.argsort(sums, kind="stable")
    again = np.flatnonzero(sums[by_sum[1:]] == sums[by_sum[:-1]])
    if not len(again):
        return None
    rows = np.unique(np.concatenate([by_sum[again], by_sum[again + 1]]))
    rows = rows[np.lexsort(ordered[rows].T)]
    twice = np.flatnonzero((ordered[rows[1:]] == ordered[rows[:-1]]).all(axis=1))
    return (int(rows[twice[0]]), int(rows[twice[0] + 1])) if len(twice) else None
