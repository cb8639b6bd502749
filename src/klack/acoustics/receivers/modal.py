r"""Receivers by their modes, also beside the axis of frequency.

.. math:: Y(s) = s \left( \sum_i \frac{\varphi_i \varphi_i^T}
          {\omega_i^2 + 2 \zeta_i \omega_i s + s^2} + R \right)

with what the modes miss of the static compliance, ``R``.  Reciprocal, and passive for every
``zeta >= 0`` and ``R`` without negative eigenvalues.  Modal damping is causal, so time signals
may use it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from klack.acoustics.interface import (
    DIRECTIONS,
    Complexes,
    Freedom,
    InterfacePoint,
    ReceiverResponse,
    freedoms_of,
)
from klack.arrays import Matrix, Vector
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.errors import refuse_if

__all__ = ["ModalReceiver", "body_receiver", "grounded", "matrix_receiver", "rigid_receiver"]

_RIGID = 1e-12  # of the largest eigenvalue, below 0
_MASSLESS = 1e-12  # of a row's own mass
_LOST = 20.0  # [Hz] round-off of frequencies, at most
_SYMMETRIC = 1e-6
_BLOCK = 1 << 16  # denominators at once: what a processor's cache holds


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ModalReceiver:
    """Modes at the freedoms of a receiver.

    Parameters
    ----------
    omega, damping (m,) [rad/s], [-]
        Rigid modes have ``omega = 0``; viscous ratios.
    shapes (m, n) [1/sqrt(kg), 1/(m sqrt(kg)) for rotations]
    residual (n, n) [m/N]
        ``R``, in the units of the freedoms.
    radiated
        Pressure per velocity of each mode (k, ears, m) at ``s`` (k,).
    """

    points: tuple[InterfacePoint, ...]
    freedoms: tuple[Freedom, ...]
    omega: Vector
    damping: Vector
    shapes: Matrix
    residual: Matrix
    ears: tuple[str, ...] = ()
    radiated: Callable[[Complexes], Complexes] | None = None

    def at(self, s: Complexes) -> ReceiverResponse:
        """Return the mobility, and transfers where there are ears."""
        n = len(self.freedoms)
        first, second = np.triu_indices(n)
        pairs = (self.shapes[:, first] * self.shapes[:, second]).T
        rows = max(_BLOCK // max(self.omega.size, 1), 1)
        compliance = np.zeros((n, n, s.size), dtype=complex)
        transfers = np.zeros((s.size, len(self.ears), n), dtype=complex)
        for begin in range(0, s.size, rows):
            part = slice(begin, begin + rows)
            H = _receptances(self.omega, self.damping, s[part])
            # real products of numbers that lie side by side: a fourth of complex ones
            compliance[first, second, part] = (pairs @ H.view(float)).view(complex)
            if self.radiated is not None:
                moved = self.radiated(s[part])
                moved *= (s[part] * H).T[:, None, :]
                transfers[part] = moved @ self.shapes
        compliance[second, first] = compliance[first, second]
        mobility = s[:, None, None] * (compliance.transpose(2, 0, 1) + self.residual)
        return ReceiverResponse(mobility=mobility, transfers=transfers)


def _receptances(omega: Vector, damping: Vector, s: Complexes) -> Complexes:
    """``1 / (omega^2 + 2 zeta omega s + s^2)``, shape (m, k)."""
    H = np.multiply.outer(2.0 * damping * omega, s)
    H += s**2
    H += (omega**2)[:, None]
    return np.reciprocal(H, out=H)


def body_receiver(
    body: ReducedBody, ports: Mapping[str, Freedom], points: tuple[InterfacePoint, ...]
) -> ModalReceiver:
    """Take a reduced body as a receiver, with the static compliance that its modes miss.

    Parameters
    ----------
    body
        Whatever klack reads: from Craig-Bampton matrices, modal data, state space.
    ports
        Name of a port -> the freedom that it is; a reversed direction turns its sign.
    points
        Where the freedoms are.
    """
    for freedom in ports.values():
        refuse_if(
            freedom.point not in {point.name for point in points},
            f"receiver '{body.name}'",
            got=f"a port at the point '{freedom.point}'",
            expected=f"one of: {', '.join(point.name for point in points) or '(none)'}",
            hint="give the points of all degrees of freedom.",
        )
    columns = [body.port_index(name) for name in ports]
    return ModalReceiver(
        points=points,
        freedoms=tuple(ports.values()),
        omega=body.omega,
        damping=body.damping,
        shapes=body.port_shapes[:, columns],
        residual=body.residual_compliance[np.ix_(columns, columns)],
    )


def rigid_receiver(
    mass: float,
    inertia: Sequence[float] | None,
    centre: Vector,
    points: tuple[InterfacePoint, ...],
) -> ModalReceiver:
    r"""Free rigid body, :math:`Y = \tfrac 1s\, R\, \mathrm{diag}(m, m, m, I)^{-1} R^T`.

    Parameters
    ----------
    mass [kg]
    inertia (3,) [kg m^2]
        Principal, about x, y, z; without it translations of one point alone are known.
    centre (3,) [m]
        Of mass.
    points
        With the axes of the frame.
    """
    names = DIRECTIONS if inertia is not None else DIRECTIONS[:3]
    freedoms = tuple(freedom for point in points for freedom in freedoms_of(point.name, names))
    place = {point.name: point.position - centre for point in points}
    rows = []
    for freedom in freedoms:
        axis = np.eye(3)[freedom.index % 3]
        if freedom.is_rotation:
            rows.append(np.concatenate([np.zeros(3), axis]))
        else:  # e . (w x r) = w . (r x e)
            rows.append(np.concatenate([axis, np.cross(place[freedom.point], axis)]))
    motions = np.array(rows)[:, : len(names)]
    weights = np.array([mass, mass, mass, *(inertia or ())])
    return ModalReceiver(
        points=points,
        freedoms=freedoms,
        omega=np.zeros(len(names)),
        damping=np.zeros(len(names)),
        shapes=(motions / np.sqrt(weights)).T,
        residual=np.zeros((len(rows), len(rows))),
    )


def matrix_receiver(
    stiffness: Matrix,
    mass: Matrix,
    rows: Mapping[Freedom, int],
    points: tuple[InterfacePoint, ...],
    *,
    damping: float,
) -> ModalReceiver:
    """Receiver of matrices in SI, free where they are, by all of their modes.

    Parameters
    ----------
    rows
        Freedom -> its row; radians for rotations.
    damping [-]
        Ratio of all elastic modes.
    """
    own = np.sqrt(np.maximum(np.diag(mass), 0.0))
    refuse_if(
        not all(np.abs(A - A.T).max() <= _SYMMETRIC * np.abs(A).max() for A in (stiffness, mass))
        or not np.all(own > 0.0)
        or not np.linalg.eigvalsh(mass / np.outer(own, own))[0] > _MASSLESS,
        "noise.receiver.matrices",
        got="matrices that are not symmetric, or a mass that is not above 0",
        expected="K and M of an elastic body",
        hint="write them without constraints, contact and damping; condense rows without mass.",
    )
    squares, X = scipy.linalg.eigh(stiffness, mass)
    noise = squares.size * np.finfo(float).eps * float(np.abs(squares).max())
    lost = np.sqrt(noise) / (2.0 * np.pi)
    refuse_if(
        lost > _LOST,
        "noise.receiver.matrices",
        got=f"a mode at {np.sqrt(squares[-1]) / (2.0 * np.pi):.2g} Hz, next to which modes below "
        f"{lost:.2g} Hz are lost in round-off",
        expected=f"round-off below {_LOST:g} Hz",
        hint="condense rows of almost no mass, and those held by a penalty.",
    )
    rigid = squares <= noise
    refuse_if(
        bool(np.any(squares < -max(_RIGID * squares[-1], noise))),
        "noise.receiver.matrices",
        got="a stiffness below 0",
        expected="the stiffness of an elastic body at rest",
        hint="check that K and M are not exchanged.",
    )
    omega = np.where(rigid, 0.0, np.sqrt(np.maximum(squares, 0.0)))
    n = len(rows)
    return ModalReceiver(
        points=points,
        freedoms=tuple(rows),
        omega=omega,
        damping=np.where(rigid, 0.0, damping),
        shapes=X[list(rows.values())].T,
        residual=np.zeros((n, n)),
    )


def grounded(stiffness: Mapping[int, float], points: tuple[InterfacePoint, ...]) -> ModalReceiver:
    """Springs from each point to the ground: direction 1 to 6 -> stiffness [N/m, N m/rad]."""
    freedoms = tuple(Freedom(point.name, d) for point in points for d in sorted(stiffness))
    return ModalReceiver(
        points=points,
        freedoms=freedoms,
        omega=np.zeros(0),
        damping=np.zeros(0),
        shapes=np.zeros((0, len(freedoms))),
        residual=np.diag([1.0 / stiffness[freedom.direction] for freedom in freedoms]),
    )
