r"""Boundary elements of a closed surface in triangles.

Each triangle has one value; the kernels are sums over its points, the more the nearer the point
they are seen from. Of its own middle a triangle sees

.. math:: G = \frac{1}{4\pi}\int \frac{\mathrm dS}{R} + \frac{1}{4\pi}\int
          \frac{e^{-ikR} - 1}{R}\,\mathrm dS, \qquad H = 0,

the first integral in closed form, the second one regular. Rows are made in threads.
"""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np

from klack.acoustics.boundary.interior import spread_inside
from klack.arrays import Complexes, Flags, Floats, Ints, Matrix, Vector
from klack.errors import InputError
from klack.machine.compiling.jit import njit
from klack.machine.cores import available_cores

__all__ = ["Triangles"]


_THREE = np.array([[4.0, 1.0, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, 4.0]]) / 6.0
_SMALL = 1e-9  # of a size


@dataclass(frozen=True, kw_only=True, eq=False)
class Triangles:
    """Closed surface in triangles.

    Parameters
    ----------
    points (v, 3) [m]
    corners (n, 3)
        Of each triangle, anticlockwise seen from the air.
    """

    points: Matrix
    corners: Ints

    def __post_init__(self) -> None:
        corners = np.asarray(self.corners)
        edges = np.concatenate([corners[:, [i, (i + 1) % 3]] for i in range(3)])
        there = {tuple(edge) for edge in edges.tolist()}
        open_ones = sum((b, a) not in there for a, b in there) + len(edges) - len(there)
        if open_ones:
            got = f"{open_ones} edges without a neighbour, or with two"
        elif self.volume <= 0.0:
            got = "normals that point into the body"
        else:
            return
        raise InputError(
            "boundary elements: triangles",
            got=got,
            expected="a closed surface whose normals point into the air",
            hint="close openings, merge duplicate points, reverse triangles.",
        )

    @cached_property
    def _abc(self) -> Floats:
        return np.ascontiguousarray(np.asarray(self.points, dtype=float)[self.corners])

    @cached_property
    def centres(self) -> Matrix:
        """Middles (n, 3) [m], where the equation holds."""
        return np.asarray(self._abc.mean(axis=1))

    @cached_property
    def _across(self) -> Matrix:
        a, b, c = np.moveaxis(self._abc, 1, 0)
        return np.cross(b - a, c - a)

    @cached_property
    def areas(self) -> Vector:
        """[m^2], shape (n,)."""
        return np.asarray(np.linalg.norm(self._across, axis=1) / 2.0)

    @property
    def weights(self) -> Vector:
        """As areas."""
        return self.areas

    @cached_property
    def normals(self) -> Matrix:
        """Into the air (n, 3) [-]."""
        return np.asarray(self._across / (2.0 * self.areas[:, None]))

    @property
    def volume(self) -> float:
        """Inside [m^3]."""
        return float((self._abc.mean(axis=1) * self._across).sum() / 6.0)

    @property
    def rigid(self) -> Matrix:
        """Normal motion (n, 6) of unit translations [-] and rotations about the origin [m]."""
        return np.hstack([self.normals, np.cross(self.centres, self.normals)])

    def kernels(self, points: Matrix, wave_number: float) -> tuple[Complexes, Complexes]:
        """G and H (k, n) [m; -] of all triangles at points (k, 3), on the surface or off it."""
        places = np.ascontiguousarray(points, dtype=float)
        G = np.empty((len(places), len(self.areas)), dtype=complex)
        H = np.empty_like(G)
        given = (self._abc, self.centres, self.normals, self.areas, self._own, wave_number)

        def rows(part: slice) -> None:
            _rows(places[part], *given, *_POINTS, G[part], H[part])

        threads = available_cores()
        cuts = np.linspace(0, len(places), 4 * threads + 1).astype(int)
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(rows, map(slice, cuts[:-1], cuts[1:])))
        return G, H

    def inside(self, count: int, draw: int) -> Matrix:
        """Points (count, 3) in the inside, well off the surface, drawn anew for every ``draw``."""
        return spread_inside(self.points, count, draw, self._within, self._distance)

    def _within(self, points: Matrix) -> Flags:
        """By the solid angle of all triangles (van Oosterom & Strackee 1983)."""
        a, b, c = (corner - points[:, None] for corner in np.moveaxis(self._abc, 1, 0))
        la, lb, lc = (np.linalg.norm(way, axis=2) for way in (a, b, c))
        below = la * lb * lc + (a * b).sum(2) * lc + (a * c).sum(2) * lb + (b * c).sum(2) * la
        angle = 2.0 * np.arctan2((a * np.cross(b, c)).sum(axis=2), below)
        return np.asarray(np.abs(angle.sum(axis=1)) > 2.0 * pi)

    def _distance(self, points: Matrix) -> Vector:
        seen = np.vstack([self.centres, self.points])
        return np.array([np.linalg.norm(seen - at, axis=1).min() for at in points])

    @cached_property
    def _own(self) -> Vector:
        """Integral of 1/R over each triangle from its middle [m]."""
        found = np.zeros(len(self.areas))
        for i in range(3):
            p = self._abc[:, i] - self.centres
            q = self._abc[:, (i + 1) % 3] - self.centres
            length = np.linalg.norm(q - p, axis=1)
            along = (q - p) / length[:, None]
            height = np.linalg.norm(np.cross(p, along), axis=1)
            ends = [np.linalg.norm(way, axis=1) + (way * along).sum(axis=1) for way in (q, p)]
            found += height * np.log(ends[0] / ends[1])
        return found


def _points_of(level: int) -> Matrix:
    """Three points, as shares of the corners, in each of 4^level equal parts of a triangle."""
    parts = [np.eye(3)]
    for _ in range(level):
        parts = [
            np.array(corners)
            for a, b, c in parts
            for ab, bc, ca in [((a + b) / 2, (b + c) / 2, (c + a) / 2)]
            for corners in ([a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca])
        ]
    return np.concatenate([_THREE @ part for part in parts])


_POINTS = (_points_of(0), _points_of(2), _points_of(3))


@njit(nogil=True, error_model="numpy")
def _rows(
    points: Matrix,
    abc: Floats,
    centres: Matrix,
    normals: Matrix,
    areas: Vector,
    own: Vector,
    k: float,
    few: Matrix,
    more: Matrix,
    many: Matrix,
    G: Complexes,
    H: Complexes,
) -> None:
    """Fill rows of both kernels."""
    for i in range(points.shape[0]):
        x, y, z = points[i]
        for j in range(areas.size):
            size = np.sqrt(areas[j])
            way = np.sqrt(
                (centres[j, 0] - x) ** 2 + (centres[j, 1] - y) ** 2 + (centres[j, 2] - z) ** 2
            )
            at_home = way < _SMALL * size
            at = few if way > 4.0 * size else more if way > 2.0 * size else many
            g, h = 0.0j, 0.0j
            for q in range(at.shape[0]):
                a, b, c = at[q]
                dx = a * abc[j, 0, 0] + b * abc[j, 1, 0] + c * abc[j, 2, 0] - x
                dy = a * abc[j, 0, 1] + b * abc[j, 1, 1] + c * abc[j, 2, 1] - y
                dz = a * abc[j, 0, 2] + b * abc[j, 1, 2] + c * abc[j, 2, 2] - z
                R = np.sqrt(dx * dx + dy * dy + dz * dz)
                wave = complex(np.cos(k * R), -np.sin(k * R))
                if at_home:
                    g += (wave - 1.0) / R
                else:
                    dn = (dx * normals[j, 0] + dy * normals[j, 1] + dz * normals[j, 2]) / R
                    g += wave / R
                    h -= wave / R * dn * complex(1.0 / R, k)
            share = areas[j] / (4.0 * np.pi * at.shape[0])
            G[i, j] = share * g
            H[i, j] = share * h
            if at_home:
                G[i, j] += own[j] / (4.0 * np.pi)
