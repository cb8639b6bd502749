"""A rigid body on one contact point without mass: springs along and across, a Coulomb slider."""

from dataclasses import dataclass, replace
from math import inf

import numpy as np

from klack.contact.face_friction import FaceFriction
from klack.contact.friction import Friction
from klack.contact.mortar import ContactSpace
from klack.contact.restitution import measure_impact
from klack.elasticity.body import ElasticBody
from klack.transient.interface_model import InterfaceContact
from klack.transient.interface_run import simulate_interface
from klack.verification.interface_bodies import modal_model

__all__ = ["PointImpact", "PointRebound", "rubbing_faces", "seat_restitution"]


@dataclass(frozen=True, slots=True, kw_only=True)
class PointRebound:
    """Velocities of the point after an impact, tangential and normal [m/s], and the loss [J]."""

    tangential: float
    normal: float
    lost: float


@dataclass(frozen=True, slots=True, kw_only=True)
class PointImpact:
    """Planar rigid body that hits with one point.

    Parameters
    ----------
    along, coupling, normal : float [1/kg]
        Inverse mass at the point: tangential, tangential per normal force, normal.
    friction : float [-]
    tangential, approach : float [m/s]
        Velocity of the point before, along the face and into it.
    spring, stiffer : float [N/m], [-]
        Normal spring, and the tangential one over it.
    """

    along: float
    coupling: float
    normal: float
    friction: float
    tangential: float
    approach: float = 1.0
    spring: float = 1.0
    stiffer: float = 0.8235294

    def hit(self, time: float, *, steps: int = 400) -> PointRebound:
        """Impact that lasts about ``time`` [s], in so many steps."""
        root = np.asarray(
            np.linalg.cholesky([[self.normal, self.coupling], [self.coupling, self.along]]),
            dtype=float,
        )  # normal motion is the first coordinate
        rigid = np.zeros((6, 2))
        rigid[2], rigid[0] = root
        model = modal_model(
            masses=(1.0 / self.normal, inf),
            omega=np.zeros(2),
            traces=root[:1],
            compliance=np.diag([1.0, 1.0 / self.stiffer]) / self.spring,
            gap=np.zeros(1),
            rigid=rigid,
        )
        model = replace(
            model,
            tangents=root[1:],
            axial_across=np.zeros(1),
            friction=(Friction.coulomb(self.friction),),
        )
        run = simulate_interface(
            model,
            speed=self.approach,
            duration=1.02 * time,
            step=time / steps,
            velocity=np.array([self.tangential, 0.0, 0.0, 0.0, 0.0, 0.0]),
        )
        after = run.motion.velocity[-1]
        return PointRebound(
            tangential=float(after[0]), normal=float(after[2]), lost=run.energy.friction
        )


def seat_restitution(half_angle: float, friction: float, stiffer: float, steps: int = 800) -> float:
    """Restitution of a rigid needle on a frictional cone, compliance at the ring alone."""
    s, c = np.sin(half_angle), np.cos(half_angle)
    model = modal_model(
        masses=(1.0, inf),
        omega=np.zeros(1),
        traces=np.array([[s]]),
        compliance=np.diag([1.0, 1.0 / stiffer]),
        gap=np.zeros(1),
    )
    model = replace(
        model,
        tangents=np.array([[c]]),
        axial_across=np.array([c]),
        friction=(Friction.coulomb(friction),),
    )
    time = np.pi / s
    run = simulate_interface(model, speed=1.0, duration=1.2 * time, step=time / steps)
    return measure_impact(run.history).restitution


def rubbing_faces(
    upper: ElasticBody,
    lower: ElasticBody,
    space: ContactSpace,
    faces: tuple[str, str],
    friction: float,
) -> InterfaceContact:
    """Contact of two meshed bodies with tangential directions."""
    meshes = (upper.mesh, upper.mesh.surface(faces[0]), lower.mesh, lower.mesh.surface(faces[1]))
    return InterfaceContact(
        name="face",
        upper=upper.name,
        lower=lower.name,
        space=space,
        faces=FaceFriction.on(Friction.coulomb(friction), space, *meshes),
    )
