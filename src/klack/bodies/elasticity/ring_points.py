r"""Points on rings of a body of revolution: what a Fourier order moves there, and their compliance.

N points at equal angles :math:`\theta_j = 2 \pi j / N` on every ring resolve the orders 0 to N/2.
With the static compliance :math:`c_n` of the rows of the half section in order *n*,

.. math:: C_{ki,lj} = \sum_{n=0}^{N/2} w_n \, c_{n,kl} \cos n (\theta_i - \theta_j), \qquad
    w_n = 1, \quad w_{N/2} = \tfrac12 ,

block-circulant: one matrix for each difference of angles. Order N/2 is at the points
:math:`(-1)^j` alone, one motion where other orders have two, and so counts half. A row that reads
along the ring has the sine of an angle where others have the cosine.
"""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, eye_array, kron, vstack

from klack.arrays import Flags, Floats, Ints
from klack.bodies.elasticity.fourier_body import rows_around

__all__ = ["RingPoints", "RingRows", "RingSections", "resolved_orders", "share_of_order"]


_AROUND = np.array([[-1.0, 1.0, 0.0]])  # V = b - a
_CHUNK = 256


def resolved_orders(count: int) -> range:
    """Orders that so many points on a ring resolve."""
    return range(count // 2 + 1)


def share_of_order(order: int, count: int) -> float:
    """Weight :math:`w_n` of an order in the compliance."""
    return 0.5 if 2 * order == count else 1.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingRows:
    """Rows on the half section that read what happens on whole rings.

    Parameters
    ----------
    along (m, 2 n_nodes)
        In the plane of the section (u_r, u_z), with the cosine of the angle.
    around (k, n_nodes)
        Along the ring (u_theta), with the sine.
    turned (k, 2 n_nodes)
        What the latter read besides of u_r and u_z, times the order.
    """

    along: csr_array
    around: csr_array
    turned: csr_array

    @classmethod
    def in_plane(cls, along: csr_array) -> "RingRows":
        """Rows in the plane of the section alone."""
        nodes = along.shape[1] // 2
        return cls(along=along, around=csr_array((0, nodes)), turned=csr_array((0, 2 * nodes)))

    @property
    def count(self) -> int:
        """Number of rows."""
        return int(self.along.shape[0] + self.around.shape[0])

    @property
    def is_sine(self) -> Flags:
        """Which rows read along the ring, shape (count,)."""
        return np.arange(self.count) >= self.along.shape[0]

    def of_order(self, order: int) -> csr_array:
        """Rows on the degrees of freedom of a body in one order, shape (count, 3 n_nodes)."""
        in_plane, turned = (
            rows_around(rows, order, np.zeros(1)) for rows in (self.along, self.turned)
        )
        around = self.around @ kron(eye_array(self.around.shape[1]), _AROUND)
        return csr_array(vstack([in_plane, csr_array(around + order * turned)]))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingPoints:
    """Points on rings, each with the row of the half section that reads it.

    Parameters
    ----------
    row (p,)
        Of :class:`RingRows`.
    turn (p,)
        Number of the angle.
    count
        N.
    is_sine (rows,)
        Of :class:`RingRows`.
    """

    row: Ints
    turn: Ints
    count: int
    is_sine: Flags

    @property
    def angle(self) -> Floats:
        """Angle of each point from the x axis towards y [rad]."""
        return 2.0 * np.pi * self.turn / self.count

    def factors(self, order: int) -> tuple[Floats, Floats]:
        r"""What a unit amplitude of the two motions of an order moves each point, shape (p,) each.

        The first bends towards x, the second is turned by :math:`\pi / 2 n`, and 0 for order 0.
        """
        sine = self.is_sine[self.row]
        if order == 0:
            return np.ones(len(sine)), np.zeros(len(sine))
        # whole turns taken off before the cosine: exact at any order
        phase = 2.0 * np.pi / self.count * (order * self.turn % self.count)
        cos, sin = np.cos(phase), np.sin(phase)
        return np.where(sine, sin, cos), np.where(sine, -cos, sin)

    def forces(self, order: int, loads: Floats) -> tuple[Floats, Floats]:
        """Loads at the points, shape (p, m), as forces on the rows of both motions."""
        out = []
        for factor in self.factors(order):
            force = np.zeros((len(self.is_sine), loads.shape[1]))
            np.add.at(force, self.row, factor[:, None] * loads)
            out.append(force)
        return out[0], out[1]

    def compliance(self, spectrum: Floats) -> Floats:
        """Static compliance of all points from that of each order, symmetric, shape (p, p) [m/N].

        Parameters
        ----------
        spectrum (orders, rows, rows) [m/N]
            Orders 0 to N/2.
        """
        table = _by_difference(spectrum, self.is_sine, self.count)
        C = np.empty((len(self.row),) * 2)
        for at in range(0, len(self.row), _CHUNK):
            some = slice(at, at + _CHUNK)
            apart = (self.turn[some, None] - self.turn) % self.count
            C[some] = table[apart, self.row[some, None], self.row]
        return C


def _by_difference(spectrum: Floats, is_sine: Flags, count: int) -> Floats:
    """Sum over the orders for each difference of angles, shape (N, rows, rows)."""
    phase = np.ones((len(is_sine),) * 2, dtype=complex)
    phase[np.ix_(is_sine, ~is_sine)] = -1j  # a row along the ring moves with the sine
    phase[np.ix_(~is_sine, is_sine)] = 1j
    # irfft has 1/N for the orders 0 and N/2, and 2/N for those between
    scale = np.array([1.0 if n == 0 else 0.5 for n in range(len(spectrum))]) * count
    return np.asarray(np.fft.irfft(scale[:, None, None] * spectrum * phase, n=count, axis=0))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RingSections:
    r"""Sections of a shaft of revolution.

    A section is one or two rings of nodes around a height *h*, with weights *w* whose sum is 1 and
    whose mean height is *h*. Its displacement is the weighted mean round the rings, its rotation
    that of the rigid motion nearest to theirs. Of the amplitudes U, V, W of a Fourier order
    (:mod:`klack.bodies.elasticity.fourier_body`) the mean leaves

    .. math:: u_z = \sum w W, \quad \varphi_z = \frac{\sum w r V}{\sum w r^2} \quad (n = 0), \qquad
        u_x = \sum w a, \quad
        \varphi_y = \frac{\sum w (\zeta a - \tfrac12 r W)}{\sum w (\zeta^2 + \tfrac12 r^2)} \quad
        (n = 1),

    with the height :math:`\zeta` above *h*, for a body that bends towards *x*, and nothing of
    higher orders. The transposes are forces and moments, spread evenly round the rings.

    Parameters
    ----------
    heights (k,) [m]
    weights (k, n_nodes) [-]
        Of the rings of each section.
    points (n_nodes, 2) [m]
        (r, z).
    """

    heights: Floats
    weights: csr_array
    points: Floats

    @property
    def count(self) -> int:
        """Number of sections."""
        return len(self.heights)

    @property
    def radius(self) -> Floats:
        """Mean radius of each section [m]."""
        return np.asarray(self.weights @ self.points[:, 0])

    def of_order(self, order: int) -> csr_array:
        """Displacement of each section, then rotation of each, shape (2 k, 3 n_nodes).

        In order 0 along and about the axis; in order 1 towards the direction of bending and about
        the one across it; zero for higher orders.
        """
        k, nodes = self.count, len(self.points)
        if order > 1:
            return csr_array((2 * k, 3 * nodes))
        w, r = self.weights.tocoo(), self.points[:, 0]
        row, node = (at.astype(np.int64) for at in w.coords)
        if order == 0:
            spin = w.data * r[node] / (self.weights @ r**2)[row]
            turned = [(0, -spin), (1, spin)]  # V = b - a
            moved = [(2, w.data)]
        else:
            above = self.points[node, 1] - self.heights[row]
            inertia = np.bincount(row, w.data * (above**2 + 0.5 * r[node] ** 2), minlength=k)
            share = w.data / inertia[row]
            turned = [(0, share * above), (2, -0.5 * share * r[node])]
            moved = [(0, w.data)]
        return csr_array(vstack([_placed(part, row, node, k, nodes) for part in (moved, turned)]))


def _placed(
    parts: list[tuple[int, Floats]],
    row: Ints,
    node: Ints,
    k: int,
    nodes: int,
) -> csr_array:
    """Values on some of the three amplitudes of the nodes, shape (k, 3 n_nodes)."""
    out = csr_array((k, 3 * nodes))
    for amplitude, values in parts:
        out = out + csr_array((values, (row, 3 * node + amplitude)), shape=out.shape)
    return csr_array(out)
