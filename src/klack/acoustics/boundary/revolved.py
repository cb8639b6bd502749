r"""Boundary elements of a surface of revolution, order by order of its circumference.

Pressure and velocity vary as :math:`\cos m\varphi`; what is left of the surface is its meridian,
in straight elements with one value each. The kernels of an element seen from a point at
:math:`\varphi = 0`,

.. math:: G_m = \int\!\int_0^{2\pi} \frac{e^{-ikR}}{4\pi R} \cos m\varphi\, \mathrm d\varphi\,
          r'\,\mathrm ds, \qquad
          H_m = \int\!\int_0^{2\pi} \frac{\partial}{\partial n'} \frac{e^{-ikR}}{4\pi R}
          \cos m\varphi\, \mathrm d\varphi\, r'\,\mathrm ds,

are sums over Gauss points on panels that halve towards :math:`\varphi = 0` until they are as short
as the distance, and on the meridian towards the nearest point of the element: no elliptic
integrals, and one way for far, near and own elements.
"""

from dataclasses import dataclass
from functools import cached_property
from math import pi

import numpy as np

from klack.acoustics.boundary.interior import spread_inside
from klack.arrays import Complexes, Flags, Matrix, Vector
from klack.errors import InputError
from klack.machine.compiling.jit import inner, njit

__all__ = ["Meridian"]


_AROUND = np.polynomial.legendre.leggauss(8)
_ALONG = np.polynomial.legendre.leggauss(5)
_PHASE = 6.0  # of a wave within a panel, for eight points
_OWN_HALVINGS = 12  # of an element towards a point on it


@dataclass(frozen=True, kw_only=True, eq=False)
class Meridian:
    """Closed surface of revolution: its meridian from the lower to the upper end of the axis.

    Parameters
    ----------
    nodes (n + 1, 2) [m]
        (r, z), both ends on the axis; the air is to the right of the way.
    order
        Of the circumference, 0 or above.
    """

    nodes: Matrix
    order: int = 0

    def __post_init__(self) -> None:
        nodes = np.asarray(self.nodes, dtype=float)
        if nodes.ndim != 2 or nodes.shape[1] != 2 or len(nodes) < 4:
            got = f"an array of shape {nodes.shape}"
        elif not np.all(np.isfinite(nodes)) or np.any(nodes[:, 0] < 0.0):
            got = "points with a negative or unknown radius"
        elif max(nodes[0, 0], nodes[-1, 0]) > 1e-9 * np.ptp(nodes[:, 1]):
            got = f"ends {nodes[0, 0]:g} m and {nodes[-1, 0]:g} m from the axis: it is not closed"
        elif _volume(nodes) <= 0.0:
            got = "a path with the air on its left"
        else:
            object.__setattr__(self, "nodes", nodes)
            return
        raise InputError(
            "boundary elements: meridian",
            got=got,
            expected="four points (r, z) or more, from the lower to the upper end of the axis, "
            "around the outside",
            hint="close openings with straight lines; reverse the path if it runs downwards.",
        )

    @cached_property
    def lengths(self) -> Vector:
        """Of the elements along the meridian [m], shape (n,)."""
        return np.asarray(np.hypot(*np.diff(self.nodes, axis=0).T))

    @cached_property
    def centres(self) -> Matrix:
        """Middles of the elements (n, 2) [m], where the equation holds."""
        return (self.nodes[1:] + self.nodes[:-1]) / 2.0

    @cached_property
    def normals(self) -> Matrix:
        """Into the air (n, 2) [-]."""
        d = np.diff(self.nodes, axis=0)
        return np.column_stack([d[:, 1], -d[:, 0]]) / self.lengths[:, None]

    @cached_property
    def areas(self) -> Vector:
        """Of the rings [m^2], shape (n,)."""
        return 2.0 * pi * self.centres[:, 0] * self.lengths

    @property
    def weights(self) -> Vector:
        r"""Integral of :math:`\cos^2 m\varphi` over each ring [m^2], shape (n,)."""
        return self.areas if self.order == 0 else self.areas / 2.0

    @property
    def volume(self) -> float:
        """Inside [m^3]."""
        return _volume(self.nodes)

    @property
    def rigid(self) -> Matrix:
        """Normal motion (n, 2) of a body that moves and turns as a whole, of this order [-; m].

        Order 0: along the axis (and no turning); order 1: across, along x, and turning about y.
        """
        (r, z), (nr, nz) = self.centres.T, self.normals.T
        if self.order == 0:
            return np.column_stack([nz, np.zeros_like(nz)])
        if self.order == 1:
            return np.column_stack([nr, z * nr - r * nz])
        return np.zeros((len(r), 2))

    def kernels(self, points: Matrix, wave_number: float) -> tuple[Complexes, Complexes]:
        """G and H (k, n) [m; -] of all elements at points (k, 2), on the surface or off it."""
        places = np.ascontiguousarray(points, dtype=float)
        return _kernels(places, self.nodes, wave_number, self.order, *_AROUND, *_ALONG)

    def inside(self, count: int, draw: int) -> Matrix:
        """Points (count, 2) in the inside, well off the surface, drawn anew for every ``draw``."""
        loop = np.vstack([self.nodes, self.nodes[::-1] * (-1.0, 1.0)])
        return spread_inside(self.nodes, count, draw, lambda at: _within(loop, at), self._distance)

    def far_field(self, wave_number: float, angles: Vector) -> tuple[Complexes, Complexes]:
        """Far pressure (a, n) for unit pressure and velocity [m], times ``exp(-ikr)/r``.

        Parameters
        ----------
        angles (a,) [rad]
            From the upper end of the axis; at ``phi = 0``.
        """
        from scipy.special import jv

        k, m = wave_number, self.order
        sin, cos = np.sin(angles)[:, None], np.cos(angles)[:, None]
        nr, nz = self.normals.T
        by_pressure = np.zeros((len(angles), len(nr)), dtype=complex)
        by_velocity = by_pressure.copy()
        for u, weight in zip(*_ALONG, strict=True):
            r, z = (self.centres + 0.5 * u * np.diff(self.nodes, axis=0)).T
            x = k * r * sin
            bessel, slope = jv(m, x), (jv(m - 1, x) - jv(m + 1, x)) / 2.0
            turn = 0.25j * k * weight * self.lengths * r * np.exp(1j * k * z * cos) * 1j**m
            by_pressure += turn * (nz * cos * bessel - 1j * nr * sin * slope)
            by_velocity += turn * bessel
        return by_pressure, by_velocity

    def _distance(self, points: Matrix) -> Vector:
        a, d = self.nodes[:-1], np.diff(self.nodes, axis=0)
        way = points[:, None] - a
        t = np.clip((way * d).sum(2) / self.lengths**2, 0.0, 1.0)
        return np.asarray(np.linalg.norm(way - t[..., None] * d, axis=2).min(axis=1))


def _volume(nodes: Matrix) -> float:
    (r0, z0), (r1, z1) = nodes[:-1].T, nodes[1:].T
    return float(pi / 3.0 * ((z1 - z0) * (r0**2 + r0 * r1 + r1**2)).sum())


def _within(loop: Matrix, points: Matrix) -> Flags:
    (xa, ya), (xb, yb) = loop.T, np.roll(loop, -1, axis=0).T
    x, y = points[:, :1], points[:, 1:]
    rises = np.where(yb == ya, 1.0, yb - ya)
    crosses = ((ya > y) != (yb > y)) & (x < xa + (y - ya) * (xb - xa) / rises)
    return np.asarray(crosses.sum(axis=1) % 2 == 1)


@inner
def _around(
    r: float,
    z: float,
    s: float,
    t: float,
    nr: float,
    nz: float,
    k: float,
    m: int,
    x: Vector,
    w: Vector,
) -> tuple[complex, complex]:
    """Both kernels of a ring (s, t) with normal (nr, nz), seen from (r, z), times its radius."""
    near = (r - s) ** 2 + (z - t) ** 2
    wide = np.sqrt(max(r * s, 1e-300))
    first = np.sqrt(near) / wide  # angle over which the distance doubles
    longest = _PHASE / (k * min(r, s) + m + 1.0)
    end = np.pi
    g, h = 0.0j, 0.0j
    while end > 0.0:
        begin = max(0.5 * end if end > 0.5 * first else 0.0, end - longest)
        half = 0.5 * (end - begin)
        for q in range(x.size):
            phi = begin + half * (1.0 + x[q])
            lift = np.sin(0.5 * phi) ** 2
            R = np.sqrt(near + 4.0 * r * s * lift)
            dn = ((s - r) * nr + 2.0 * r * nr * lift + (t - z) * nz) / R
            value = half * w[q] * np.cos(m * phi) / (2.0 * np.pi * R)
            wave = value * complex(np.cos(k * R), -np.sin(k * R))
            g += wave
            h -= wave * dn * complex(1.0 / R, k)
        end = begin
    return g * s, h * s


@njit(nogil=True, error_model="numpy")
def _kernels(
    points: Matrix,
    nodes: Matrix,
    k: float,
    m: int,
    around: Vector,
    around_weights: Vector,
    along: Vector,
    along_weights: Vector,
) -> tuple[Complexes, Complexes]:
    """G and H of all elements at points."""
    count = nodes.shape[0] - 1
    G = np.zeros((points.shape[0], count), dtype=np.complex128)
    H = np.zeros((points.shape[0], count), dtype=np.complex128)
    for j in range(count):
        ra, za = nodes[j]
        dr, dz = nodes[j + 1, 0] - ra, nodes[j + 1, 1] - za
        length = np.sqrt(dr * dr + dz * dz)
        nr, nz = dz / length, -dr / length
        for i in range(points.shape[0]):
            r, z = points[i]
            at = min(max(((r - ra) * dr + (z - za) * dz) / length**2, 0.0), 1.0)
            gap = np.sqrt((ra + at * dr - r) ** 2 + (za + at * dz - z) ** 2) / length
            g, h = 0.0j, 0.0j
            for side in range(2):  # from the nearest point to both ends
                whole = 1.0 - at if side else -at
                least = max(gap, abs(whole) * 0.5**_OWN_HALVINGS)
                end = whole
                while end != 0.0:
                    begin = 0.5 * end if abs(end) > least else 0.0
                    for q in range(along.size):
                        u = at + begin + 0.5 * (end - begin) * (1.0 + along[q])
                        one, two = _around(
                            *(r, z, ra + u * dr, za + u * dz, nr, nz, k, m),
                            *(around, around_weights),
                        )
                        weight = 0.5 * abs(end - begin) * along_weights[q] * length
                        g += weight * one
                        h += weight * two
                    end = begin
            G[i, j], H[i, j] = g, h
    return G, H
