r"""Craig-Bampton bodies on mounting surfaces that move as rigid bodies.

With the modes :math:`\varphi_i` whose mounting surfaces rest, and the static motion :math:`\Psi`
for a unit rigid motion of each surface (Craig & Bampton 1968),

.. math:: u = \sum_i \varphi_i q_i + \Psi s, \qquad
          P = \Phi^T M \Psi, \quad M_b = \Psi^T M \Psi, \quad K_b = \Psi^T K \Psi .

.. math:: \begin{pmatrix} 1 & P \\ P^T & M_b \end{pmatrix}
          \begin{pmatrix} \ddot q \\ \ddot s \end{pmatrix} +
          \begin{pmatrix} 2 \zeta \omega & \\ & C_b \end{pmatrix}
          \begin{pmatrix} \dot q \\ \dot s \end{pmatrix} +
          \begin{pmatrix} \omega^2 & \\ & K_b \end{pmatrix}
          \begin{pmatrix} q \\ s \end{pmatrix} =
          \begin{pmatrix} \Phi^T f \\ \Psi^T f + g \end{pmatrix}

A surface is *rigid*, all its nodes move with the joint, or *averaged*: with the rigid motions
:math:`R` of its points and the areas :math:`W`, velocity and force share one matrix,

.. math:: s = B^T u, \qquad f = B g, \qquad B = W R (R^T W R)^{-1},

so the surface stays flexible, and the joint adds no stiffness. Static motion and modes then obey
:math:`B^T \Psi = 1` and :math:`B^T \varphi = 0`, by forces :math:`B \lambda` on a body that is not
held there.

:math:`C_b` damps the modes of :math:`M_b` and :math:`K_b` by the law of the body; whole rigid
motions stay free of stiffness and loss.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy

from klack.arrays import Ints, Matrix, Vector
from klack.bodies.elasticity.body import VibratingBody
from klack.bodies.elasticity.eigen import Modes, block_lanczos
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.damping import Damping, damping_ratios
from klack.bodies.reduction.reduce import at_ports
from klack.machine.cache.entry import Entry

__all__ = [
    "CRAIG_BAMPTON_UNITS",
    "CraigBampton",
    "Interface",
    "InterfaceKind",
    "averages_of",
    "constrained_modes",
    "craig_bampton",
]

CRAIG_BAMPTON_UNITS: Mapping[str, str] = {
    "omega": "rad/s",
    "damping": "1",
    "references": "m",
    "participation": "kg^0.5",
    "mass": "kg",
    "stiffness": "N/m",
    "loss": "N s/m",
    "port_shapes": "kg^-0.5",
    "port_motion": "1",
}
"""Units of the arrays of a stored :class:`CraigBampton`, of translations."""

InterfaceKind = Literal["rigid", "averaged"]

_BLOCK = 8


@dataclass(frozen=True, kw_only=True, eq=False)
class CraigBampton:
    """A body by its modes and the motion of its mounting surfaces.

    ``m`` modes, ``n`` freedoms, ``p`` ports.

    Parameters
    ----------
    omega, damping (m,) [rad/s], [-]
    mounts, directions (n,)
        Mount of each freedom, and 1 to 6 for x, y, z, rx, ry, rz.
    references (n, 3) [m]
        Where the mount of each freedom is.
    participation (m, n) [sqrt(kg), m sqrt(kg) for rotations]
        ``P``.
    mass, stiffness, loss (n, n) [kg], [N/m], [N s/m]
        ``M_b``, ``K_b``, ``C_b``.
    port_names
    port_shapes (m, p) [1/sqrt(kg)]
    port_motion (n, p) [-, m for rotations]
        ``Psi^T b`` of each load pattern.
    """

    omega: Vector
    damping: Vector
    mounts: tuple[str, ...]
    directions: tuple[int, ...]
    references: Matrix
    participation: Matrix
    mass: Matrix
    stiffness: Matrix
    loss: Matrix
    port_names: tuple[str, ...]
    port_shapes: Matrix
    port_motion: Matrix

    def matrices(self) -> tuple[Matrix, Matrix]:
        """Mass and stiffness of modes, then freedoms, shapes (m + n, m + n)."""
        M = np.block(
            [[np.eye(self.omega.size), self.participation], [self.participation.T, self.mass]]
        )
        return M, scipy.linalg.block_diag(np.diag(self.omega**2), self.stiffness)


@dataclass(frozen=True, kw_only=True, eq=False)
class Interface:
    """A mounting surface of a body; of a body of revolution in one Fourier order.

    Parameters
    ----------
    mount
        Name.
    directions (d,)
        1 to 6.
    motion (n_dof, d)
        Rigid motion of the whole body, 1 along each direction, or 1 rad about an axis through
        the reference point of the mount.
    weights (n_dof,) [m^2]
        Area that each degree of freedom stands for; zero off the surface.
    rows
        Degrees of freedom of its nodes.
    reference (3,) [m]
    """

    mount: str
    kind: InterfaceKind
    directions: tuple[int, ...]
    motion: Matrix
    weights: Vector
    rows: Ints
    reference: Vector

    def averages(self) -> Matrix:
        """``B``, shape (n_dof, d)."""
        loaded = self.weights[:, None] * self.motion
        return np.asarray(np.linalg.solve(self.motion.T @ loaded, loaded.T).T)

    def moved(self) -> Matrix:
        """Rigid motion of its nodes alone, shape (n_dof, d)."""
        field = np.zeros(self.motion.shape)
        field[self.rows] = self.motion[self.rows]
        return field


class _Constrained:
    """Statics of a body with ``B^T u`` given, by forces ``B lambda`` and rigid motion."""

    def __init__(self, flexibility: Flexibility, B: Matrix) -> None:
        self.flexibility, self.B, self.R = flexibility, B, flexibility.body.rigid_modes
        self.n = B.shape[1]
        if not self.n:
            return
        self.FB = flexibility.solve(B)
        A = B.T @ self.R
        C = B.T @ self.FB
        self._row = 1.0 / np.sqrt(np.diag(C))
        self._column = 1.0 / np.maximum(np.linalg.norm(self._row[:, None] * A, axis=0), 1e-300)
        scale = np.concatenate([self._row, self._column])
        S = np.block([[C, A], [A.T, np.zeros((A.shape[1], A.shape[1]))]])
        self._scale, self._factor = scale, scipy.linalg.lu_factor(scale[:, None] * S * scale)

    def corrected(self, u: Matrix, wanted: Matrix | float, momentum: Matrix) -> Matrix:
        """Add forces and rigid motion until ``B^T u = wanted``, against ``R^T f`` (r, m)."""
        if not self.n:
            return u
        right = np.vstack([wanted - self.B.T @ u, -momentum])
        found = self._scale[:, None] * scipy.linalg.lu_solve(
            self._factor, self._scale[:, None] * right
        )
        return np.asarray(u + self.FB @ found[: self.n] + self.R @ found[self.n :])

    def inverse(self, load: Matrix) -> Matrix:
        """Deflection under loads with ``B^T u = 0``."""
        return self.corrected(self.flexibility.solve(load), 0.0, self.R.T @ load)


def constrained_modes(flexibility: Flexibility, averages: Matrix, highest: float) -> Modes:
    """Modes of a body with ``B^T u = 0``, up to a frequency [Hz]; kept in the cache.

    At most a fourth of its degrees of freedom: above, a mesh does not resolve its modes.
    """
    body = flexibility.body
    statics = _Constrained(flexibility, averages)
    most = len(body.free) - averages.shape[1]

    def found() -> Modes:
        start = np.random.default_rng(2024).standard_normal((body.dof_count, _BLOCK))
        limit = 1.0 / (2.0 * np.pi * highest) ** 2
        _, shapes = block_lanczos(
            statics.inverse,
            body.M,
            statics.inverse(body.M @ start),
            lambda values: len(values) > most / 4 or bool(len(values) and values[-1] < limit),
            most,
        )
        K, M = shapes.T @ (body.K @ shapes), shapes.T @ (body.M @ shapes)
        squares, X = scipy.linalg.eigh((K + K.T) / 2, (M + M.T) / 2)
        keep = squares < (2.0 * np.pi * highest) ** 2
        return Modes(np.sqrt(squares[keep]), np.asfortranarray(shapes @ X[:, keep]))

    return flexibility.remembered(
        "modes on averaged surfaces",
        (averages, highest),
        found,
        lambda modes: Entry(arrays={"omega": modes.omega, "shapes": modes.shapes}),
        lambda entry: Modes(entry.arrays["omega"], entry.arrays["shapes"]),
    )


def craig_bampton(
    flexibility: Flexibility,
    interfaces: Sequence[Interface],
    modes: Modes,
    *,
    damping: Damping,
    port_names: Sequence[str] = (),
    patterns: Matrix | None = None,
) -> CraigBampton:
    """Reduce a body to modes and the motion of its mounting surfaces.

    Parameters
    ----------
    flexibility
        Of the body, held at its rigid mounting surfaces alone.
    modes
        Of that body; with averaged surfaces those of :func:`constrained_modes`.
    patterns (n_dof, p)
        Load patterns of the ports.
    """
    body = flexibility.body
    ports = np.zeros((body.dof_count, 0)) if patterns is None else patterns
    averaged = averages_of(body, interfaces)
    Psi = flexibility.remembered(
        "static motion of mounting surfaces",
        tuple((part.kind, part.moved(), part.weights) for part in interfaces),
        lambda: _static_motion(flexibility, interfaces, averaged),
        lambda found: Entry(arrays={"Psi": found}),
        lambda entry: entry.arrays["Psi"],
    )
    M_b, K_b = Psi.T @ (body.M @ Psi), Psi.T @ (body.K @ Psi)
    M_b = (M_b + M_b.T) / 2.0
    # a rigid motion of all mounts strains nothing, whatever round-off says
    rigid = np.vstack([part.averages().T @ interfaces[0].motion for part in interfaces])
    Q, _ = np.linalg.qr(rigid / np.linalg.norm(rigid, axis=0))
    K_b = K_b - Q @ (Q.T @ K_b)
    K_b = K_b - (K_b @ Q) @ Q.T
    K_b = (K_b + K_b.T) / 2.0
    return CraigBampton(
        omega=modes.omega,
        damping=damping_ratios(damping, body, modes.omega, modes.shapes),
        mounts=tuple(part.mount for part in interfaces for _ in part.directions),
        directions=tuple(d for part in interfaces for d in part.directions),
        references=np.vstack([np.tile(p.reference, (len(p.directions), 1)) for p in interfaces]),
        participation=modes.shapes.T @ (body.M @ Psi),
        mass=M_b,
        stiffness=K_b,
        loss=_viscous(body, Psi, M_b, K_b, rigid.shape[1], damping),
        port_names=tuple(port_names),
        port_shapes=at_ports(modes.shapes, ports),
        port_motion=Psi.T @ ports,
    )


def averages_of(body: VibratingBody, interfaces: Sequence[Interface]) -> Matrix:
    """``B`` of the averaged surfaces among all, shape (n_dof, a)."""
    parts = [part.averages() for part in interfaces if part.kind == "averaged"]
    return np.hstack([np.zeros((body.dof_count, 0)), *parts])


def _static_motion(
    flexibility: Flexibility, interfaces: Sequence[Interface], averaged: Matrix
) -> Matrix:
    body = flexibility.body
    fields, wanted, at = [], [], 0
    for part in interfaces:
        rows = np.zeros((averaged.shape[1], len(part.directions)))
        field = part.moved() if part.kind == "rigid" else np.zeros(part.motion.shape)
        if part.kind == "averaged":
            rows[at : at + rows.shape[1]] = np.eye(rows.shape[1])
            at += rows.shape[1]
        fields.append(field)
        wanted.append(rows)
    G = np.hstack(fields)
    G = G - flexibility.solve(body.K @ G)
    R = body.rigid_modes
    return _Constrained(flexibility, averaged).corrected(
        G, np.hstack(wanted), np.zeros((R.shape[1], G.shape[1]))
    )


def _viscous(
    body: VibratingBody, Psi: Matrix, M: Matrix, K: Matrix, rigid: int, damping: Damping
) -> Matrix:
    """``M V 2 zeta omega V^T M`` with the modes V of M and K; none for the rigid motions."""
    squares, V = scipy.linalg.eigh(K, M)
    squares[:rigid] = 0.0
    omega = np.sqrt(np.maximum(squares, 0.0))
    MV = M @ V
    ratios = damping_ratios(damping, body, omega, Psi @ V)
    return np.asarray((MV * (2.0 * ratios * omega)) @ MV.T)
