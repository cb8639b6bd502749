r"""A valve and what it stands on as one body in time: bodies, elements and receiver by their modes.

Craig-Bampton bodies share the motion :math:`s` of their mounts, the receiver has its modes
:math:`r`, and below the mounts lies the compliance of the elements and of what the modes of the
receiver miss,

.. math:: C = T R T^T + \mathrm{diag}(1/k), \qquad d = s - T \Phi^T r, \qquad g = C^{-1} d,

rigid joints (:math:`d = 0`) where :math:`C` is singular.  The undamped modes of all of it carry on;
the light damping of bodies and receiver stays where it falls on one mode, and what it couples is
left out: right to first order of the ratios.  Dampers of elements and an infinite plate
(:math:`F = 8 \sqrt{D m''}\, v` at a point, without memory) are left to the network, with the motion
that each of them sees, so that they may be as strong as they like.

A whole that is free would have no place to rest: it hangs at 0.1 Hz, all but undamped.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from klack.acoustics.at_mounts import freedoms_of_bodies
from klack.acoustics.coupling import Missing, Placement, transformation
from klack.acoustics.interface import Freedom, InterfacePoint, Receiver
from klack.acoustics.isolator import Isolator, Spring
from klack.acoustics.receivers.measured import HeardReceiver
from klack.acoustics.receivers.modal import ModalReceiver
from klack.acoustics.receivers.plates import InfinitePlate
from klack.arrays import Matrix, Vector
from klack.bodies.reduction.craig_bampton import CraigBampton
from klack.bodies.reduction.reduced_body import HANGS, ReducedBody
from klack.errors import refuse_if

__all__ = ["StandingValve", "standing_valve"]

_RIGID = 1e-9  # of the largest compliance
_SEEN = 1e-12  # of the largest shape of a port
_HUNG = 1e-4  # damping ratio of what hangs, which would grow by round-off


@dataclass(frozen=True, kw_only=True, eq=False)
class StandingValve:
    """Modes of a valve on its receiver.

    Parameters
    ----------
    omega, damping (m,) [rad/s], [-]
    shapes (m, p) [1/sqrt(kg)]
        At the ports of all bodies, one after the other.
    freedoms
        n motions of the mounts.
    mounts (m, n) [1/sqrt(kg)]
        Their shapes.
    momentum (m,) [sqrt(kg)]
        Axial momentum of the bodies per modal velocity.
    dampers
        Name -> shape (m,) of the motion that it sees, and its damping [N s/m].
    """

    omega: Vector
    damping: Vector
    shapes: Matrix
    freedoms: tuple[Freedom, ...]
    mounts: Matrix
    momentum: Vector
    dampers: Mapping[str, tuple[Vector, float]]

    def reduced(
        self, name: str, ports: Sequence[str], mass: float, rest: Matrix | None = None
    ) -> ReducedBody:
        """As a body of a network, with a port for each damper; modes that no port sees left out.

        ``rest`` (p, p) [m/N] is the static compliance that the modes of the bodies miss.
        """
        seen = [shape[:, None] for shape, _ in self.dampers.values()]
        shapes = np.hstack([self.shapes, *seen])
        size = np.abs(shapes).max(axis=0)
        kept = np.any(np.abs(shapes) > _SEEN * size, axis=1)
        shapes, omega = np.ascontiguousarray(shapes[kept]), self.omega[kept]
        scaled = shapes / omega[:, None]
        static = scaled.T @ scaled
        if rest is not None:
            static[: len(ports), : len(ports)] += rest
        return ReducedBody(
            name=name,
            mass=mass,
            omega=omega,
            damping=self.damping[kept],
            port_names=(*ports, *self.dampers),
            port_shapes=shapes,
            observer_names=(),
            observer_shapes=np.zeros((omega.size, 0)),
            static_compliance=static,
            rigid_count=0,
            rigid_axial=np.zeros(0),
            dof_count=omega.size,
            correction="none",
            momentum=self.momentum[kept],
        )


def standing_valve(
    bodies: Sequence[CraigBampton],
    points: tuple[InterfacePoint, ...],
    receiver: Receiver,
    *,
    placements: Mapping[str, Placement],
    isolators: Mapping[str, Isolator],
    missing: Mapping[str, Missing],
) -> StandingValve:
    """Join bodies at their mounts with what carries them; parameters as of a coupling.

    Raises
    ------
    InputError
        For a receiver or an element that has no law in time.
    """
    if isinstance(receiver, HeardReceiver):
        receiver = receiver.receiver  # ears that were measured apart push nothing
    freedoms = freedoms_of_bodies(bodies, points)
    T, kept, _ = transformation(points, freedoms, receiver, placements, missing)
    modes, own = sum(body.omega.size for body in bodies), len(freedoms)
    M, K, C, ports = _valve(bodies, freedoms)
    momentum = M[
        :, [modes + i for i, freedom in enumerate(freedoms) if freedom.direction == 3]
    ].sum(axis=1)
    omega, damping, shapes, residual, plate = _receiver(receiver)
    size, r = modes + own + omega.size, omega.size
    M = scipy.linalg.block_diag(M, np.eye(r) * (0.0 if plate.size else 1.0))
    K = scipy.linalg.block_diag(K, np.diag(omega**2))
    C = scipy.linalg.block_diag(C, np.diag(2.0 * damping * omega))
    d = np.zeros((len(kept), size))  # motion of the mounts against the receiver
    d[np.arange(len(kept)), modes + np.array(kept)] = 1.0
    d[:, modes + own :] = -T @ shapes.T
    springs, dampers = _elements([freedoms[i] for i in kept], isolators)
    compliance = T @ residual @ T.T + np.diag(springs)
    stiff, joints = _parted(compliance)
    K += d.T @ stiff @ d
    Z = scipy.linalg.null_space(joints @ d) if joints.size else np.eye(size)
    refuse_if(
        plate.size > 0 and bool(np.any(springs > 0.0)),
        "noise.elements",
        got="an element on an infinite plate",
        expected="a rigid joint, or a plate of finite size, for a run in time",
        hint="give the plate its sides: a point on an infinite plate has no mass of its own.",
    )
    squares, X = scipy.linalg.eigh(Z.T @ K @ Z, Z.T @ M @ Z)
    X = Z @ X
    found = np.sqrt(np.maximum(squares, HANGS**2))
    lost = np.maximum(np.einsum("im,ij,jm->m", X, C, X, optimize=True), 0.0) / (2.0 * found)
    seen = {}
    for name, i, c in dampers:
        seen[name] = X.T @ (d.T @ (stiff @ (springs * (np.arange(springs.size) == i)))), c
    for j, c in enumerate(plate):
        seen[f"{receiver.freedoms[j]}".replace(".", "-")] = X[modes + own + j], float(c)
    return StandingValve(
        omega=found,
        damping=np.where(squares > HANGS**2, lost, np.maximum(lost, _HUNG)),
        shapes=X[: modes + own].T @ ports,
        freedoms=freedoms,
        mounts=X[modes : modes + own].T,
        momentum=X[: modes + own].T @ momentum,
        dampers=seen,
    )


def _valve(
    bodies: Sequence[CraigBampton], freedoms: Sequence[Freedom]
) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """Mass, stiffness, damping and ports of modes, body by body, then of shared freedoms."""
    m, n = sum(body.omega.size for body in bodies), len(freedoms)
    M, K, C = (np.zeros((m + n, m + n)) for _ in range(3))
    ports = np.zeros((m + n, sum(len(body.port_names) for body in bodies)))
    at = port = 0
    for body in bodies:
        own = np.arange(at, at + body.omega.size)
        places = np.array(
            [
                m + freedoms.index(Freedom(*pair))
                for pair in zip(body.mounts, body.directions, strict=True)
            ]
        )
        both = np.ix_(np.concatenate([own, places]), np.concatenate([own, places]))
        mass, stiffness = body.matrices()
        M[both] += mass
        K[both] += stiffness
        C[both] += scipy.linalg.block_diag(np.diag(2.0 * body.damping * body.omega), body.loss)
        ports[own, port : port + len(body.port_names)] = body.port_shapes
        ports[places, port : port + len(body.port_names)] += body.port_motion
        at, port = at + own.size, port + len(body.port_names)
    return M, K, C, ports


def _receiver(receiver: Receiver) -> tuple[Vector, Vector, Matrix, Matrix, Vector]:
    """Frequencies, damping, shapes (m, n), residual (n, n), and impedances of an infinite plate.

    A plate moves as one coordinate without mass or stiffness.
    """
    if isinstance(receiver, InfinitePlate):
        refuse_if(
            receiver.radius > 0.0 or len(receiver.points) > 1,
            "noise.receiver: infinite_plate",
            got="feet that rotate it" if receiver.radius > 0.0 else f"{len(receiver.points)} feet",
            expected="one foot without a radius, for a run in time",
            hint="its response at other places depends on the past; give the plate its sides.",
        )
        impedance = np.array([1.0 / receiver.plate.mobility])
        zero = np.zeros(1)
        return zero, zero, np.eye(1), np.zeros((1, 1)), impedance
    refuse_if(
        not isinstance(receiver, ModalReceiver),
        "noise.receiver",
        got="measured responses",
        expected="a plate, a body, springs or matrices, for a run in time",
        hint="responses over frequency do not define a law in time: leave out the variant "
        "dry-mounted.",
    )
    assert isinstance(receiver, ModalReceiver)
    return receiver.omega, receiver.damping, receiver.shapes, receiver.residual, np.zeros(0)


def _elements(
    freedoms: Sequence[Freedom], isolators: Mapping[str, Isolator]
) -> tuple[Vector, list[tuple[str, int, float]]]:
    """Compliance of the elements, and dampers by name, place and damping."""
    compliance, dampers = np.zeros(len(freedoms)), []
    for i, freedom in enumerate(freedoms):
        element, direction = isolators.get(freedom.point), abs(freedom.direction)
        refuse_if(
            element is not None and (not isinstance(element, Spring) or element.loss_factor > 0.0),
            f"noise.elements.{freedom.point}",
            got="an element with a loss factor or a measured stiffness",
            expected="stiffness and damping, for a run in time",
            hint="give the damping in N s/m instead: loss factor x stiffness / (2 pi f).",
        )
        if isinstance(element, Spring) and direction in element.values:
            compliance[i] = 1.0 / element.values[direction]
            if element.damping.get(direction, 0.0) > 0.0:
                name = str(freedom).replace(".", "-")
                dampers.append((name, i, element.damping[direction]))
    return compliance, dampers


def _parted(compliance: Matrix) -> tuple[Matrix, Matrix]:
    """Stiffness where the joint yields, and the rows in which it is rigid."""
    scale = np.sqrt(np.diag(compliance))
    yields = scale > 0.0
    stiff = np.zeros(compliance.shape)
    rigid = [np.eye(scale.size)[~yields]]
    if np.any(yields):
        own = np.ix_(yields, yields)
        values, V = np.linalg.eigh(compliance[own] / np.outer(scale[yields], scale[yields]))
        kept = values > _RIGID * values[-1]
        W = V[:, kept] / scale[yields, None]
        stiff[own] = (W / values[kept]) @ W.T
        rows = np.zeros((int(np.sum(~kept)), scale.size))
        rows[:, yields] = V[:, ~kept].T / scale[yields]
        rigid.append(rows / np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), 1e-300))
    return stiff, np.vstack(rigid)
