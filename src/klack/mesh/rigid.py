r"""Rigid displacement of a body: turn about a point, then shift.

.. math:: x' = R\,(x - c) + c + t, \qquad R = \exp[\theta]_\times .
"""

from dataclasses import dataclass
from typing import Self

import numpy as np

from klack.arrays import Vector

__all__ = ["Pose", "rigid_placement", "rotation_matrix"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Pose:
    """Pose of a body relative to its drawing.

    Parameters
    ----------
    rotation (3,) [rad]
        Rotation vector: axis times angle.
    about (3,) [m]
        Fixed point of the rotation, in the drawing.
    shift (3,) [m]
        After the rotation.
    """

    rotation: Vector
    about: Vector
    shift: Vector

    @classmethod
    def along_z(cls, distance: float) -> Self:
        """Shift by ``distance`` [m], without a rotation."""
        shift = np.array([0.0, 0.0, distance])
        return cls(rotation=np.zeros(3), about=np.zeros(3), shift=shift)

    def of(self, points: Vector) -> Vector:
        """Points of the drawing, shape (..., 3) [m], where they are now."""
        R = rotation_matrix(self.rotation)
        return (np.asarray(points) - self.about) @ R.T + self.about + self.shift

    def drawn(self, points: Vector) -> Vector:
        """Points, shape (..., 3) [m], where they are in the drawing."""
        R = rotation_matrix(self.rotation)
        return (np.asarray(points) - self.about - self.shift) @ R + self.about


def rotation_matrix(rotation: Vector) -> Vector:
    r"""Matrix (3, 3) of a rotation vector (3,) [rad].

    .. math:: R = I + \frac{\sin\theta}{\theta} W + \frac{1 - \cos\theta}{\theta^2} W^2,
        \qquad W x = \theta \times x

    (Rodrigues 1840).

    Examples
    --------
    >>> import numpy as np
    >>> R = rotation_matrix(np.array([0.0, np.pi / 2, 0.0]))
    >>> (R @ [0.0, 0.0, 1.0]).round(15).tolist()  # z tilts towards x
    [1.0, 0.0, 0.0]
    """
    x, y, z = np.asarray(rotation, dtype=float)
    angle = float(np.sqrt(x * x + y * y + z * z))
    W = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    # sin(x)/x with numpy's sinc, which is exact at 0; 1 - cos x = 2 sin^2(x/2) keeps small angles
    first = float(np.sinc(angle / np.pi))
    second = 0.5 * float(np.sinc(angle / (2.0 * np.pi))) ** 2
    return np.eye(3) + first * W + second * (W @ W)


def rigid_placement(
    aside: Vector,
    lean: Vector,
    about: Vector,
    centre: Vector,
) -> Vector:
    """Translation of ``centre`` [m] and rotation vector [rad] of an off-axis body, shape (6,).

    Parameters
    ----------
    aside, lean (2,) [m], [rad]
        Of its axis, at the height of ``about``.
    about, centre (3,) [m]
    """
    rotation = np.array([-lean[1], lean[0], 0.0])  # z x d
    pose = Pose(rotation=rotation, about=about, shift=np.append(aside, 0.0))
    return np.concatenate([pose.of(centre) - centre, rotation])
