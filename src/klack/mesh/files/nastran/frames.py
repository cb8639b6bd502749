r"""Coordinate systems of a Nastran file: rectangular, cylindrical, spherical.

A system is given by three points: A its origin, B on its z axis, C in its x-z plane.  Angles are
in degrees; the spherical angle :math:`\theta` is measured from the z axis.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError
from klack.mesh.files.nastran.cards import BulkData, Card

__all__ = ["Frames"]

_DEEPEST = 50


@dataclass(frozen=True, slots=True)
class _Definition:
    card: Card
    kind: str  # R, C or S
    reference: int
    points: NDArray[np.float64] | None  # three rows in the reference system
    nodes: tuple[int, int, int] | None


class Frames:
    """All coordinate systems of a file.

    Parameters
    ----------
    bulk : BulkData
    node : function
        Gives the place of a node by its number, in basic coordinates.
    """

    def __init__(self, bulk: BulkData, node: Callable[[int, int], NDArray[np.float64]]) -> None:
        self._node = node
        self._known: dict[int, _Definition] = {}
        for kind in "RCS":
            for card in bulk.cards(f"CORD2{kind}"):
                points = np.array([card.real(i, "coordinate") for i in range(3, 12)])
                reference = card.integer(2, "coordinate system") if card.field(2) else 0
                label = card.integer(1, "number of the coordinate system")
                self._add(label, _Definition(card, kind, reference, points.reshape(3, 3), None))
            for card in bulk.cards(f"CORD1{kind}"):
                for first in (1, 5):
                    if card.field(first):
                        label, *nodes = (card.integer(first + i, "number") for i in range(4))
                        triple = (nodes[0], nodes[1], nodes[2])
                        self._add(label, _Definition(card, kind, 0, None, triple))

    def _add(self, label: int, definition: _Definition) -> None:
        if label in self._known:
            definition.card.refuse(f"coordinate system {label} for the second time", "one of each")
        self._known[label] = definition

    def basic(
        self, label: int, x: NDArray[np.float64], place: str, depth: int = 0
    ) -> NDArray[np.float64]:
        """Turn coordinates, shape (n, 3), of one system into basic ones."""
        if label == 0:
            return x
        if label not in self._known or depth > _DEEPEST:
            raise InputError(
                f"{place}: coordinate system {label}",
                got="no CORD1 or CORD2 card for it" if depth <= _DEEPEST else "a loop of systems",
                expected="a system that the file defines, or 0",
                hint="the file may be truncated, or the card may be in a file that is not "
                "included.",
            )
        own = self._known[label]
        if own.nodes is not None:
            corners = np.array([self._node(node, depth + 1) for node in own.nodes])
        else:
            assert own.points is not None
            corners = self.basic(own.reference, own.points, own.card.place, depth + 1)
        axes = _axes(own.card, corners)
        return corners[0] + _rectangular(own.kind, x) @ axes


def _axes(card: Card, corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Unit vectors of the axes, as rows."""
    z = corners[1] - corners[0]
    y = np.cross(z, corners[2] - corners[0])
    lengths = np.linalg.norm(z), np.linalg.norm(y)
    if not min(lengths) > 1e-9 * np.linalg.norm(corners[2] - corners[0]):
        card.refuse("three points on one line", "an origin, a point on z and one in the x-z plane")
    z, y = z / lengths[0], y / lengths[1]
    return np.array([np.cross(y, z), y, z])


def _rectangular(kind: str, x: NDArray[np.float64]) -> NDArray[np.float64]:
    if kind == "R":
        return x
    a, b = np.radians(x[:, 1]), np.radians(x[:, 2])
    if kind == "C":
        return np.stack([x[:, 0] * np.cos(a), x[:, 0] * np.sin(a), x[:, 2]], axis=1)
    ring = x[:, 0] * np.sin(a)
    return np.stack([ring * np.cos(b), ring * np.sin(b), x[:, 0] * np.cos(a)], axis=1)
