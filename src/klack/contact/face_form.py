r"""Form of two faces that are drawn plane: crown, waviness and tilt, together as one axial height.

Flatness, a fraction of a micrometre, decides how fast the force of an impact rises. The deviation
of both faces together is a height along z that opens the gaps,

.. math:: f = h \frac{r^2}{R^2} + a \left[1 - \cos\left(\frac{2 \pi s}{\lambda} + \phi\right)\right]
    + (R + t) \tan \alpha

with r the distance from the centre of the face, R that of its outermost point, s along the waves
(r for waves round the centre) and t the coordinate towards which a tilted face opens. A gap along
the normal n of the slave face grows by :math:`f |n_z|`. Meshes, compliances and modes stay those
of the drawing: good for slopes far below 1, at most :data:`STEEPEST`.

A crown on one of two plane faces is a sphere of radius :math:`R^2 / (2 h)` (Johnson, Contact
Mechanics, 1985, section 4.1) as long as the contact stays away from the edge.
"""

from dataclasses import dataclass
from math import cos, pi, sin, tan

import numpy as np
from numpy.typing import NDArray

__all__ = ["STEEPEST", "FaceForm", "Waves"]

STEEPEST = 0.1
"""Largest slope [-] of a form; normals turn by as much."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Waves:
    """Waviness of a face.

    Parameters
    ----------
    amplitude [m]
        Half the height from valley to crest.
    length [m]
        From crest to crest.
    direction [rad]
        Along which straight waves follow each other, from x towards y; None for waves round the
        centre, as turning leaves them.
    phase [rad]
        Of the centre: 0 on a crest, pi in a valley.
    """

    amplitude: float
    length: float
    direction: float | None = None
    phase: float = 0.0

    @property
    def slope(self) -> float:
        """Steepest slope [-]."""
        return 2.0 * pi * self.amplitude / self.length


@dataclass(frozen=True, slots=True, kw_only=True)
class FaceForm:
    """Form of both faces of a contact.

    Parameters
    ----------
    centre [m]
        x and y; 0 and 0 in the meridian plane.
    radius [m]
        R.
    crown [m]
        h, centre above edge.
    tilt [rad]
        alpha, between the two faces.
    tilt_direction [rad]
        Towards which the gap opens, from x towards y.
    """

    centre: tuple[float, float]
    radius: float
    crown: float = 0.0
    waves: Waves | None = None
    tilt: float = 0.0
    tilt_direction: float = 0.0

    def heights(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Axial heights f [m], shape (n,), at positions (n, 3), or (n, 2) as (r, z)."""
        x = position[:, 0] - self.centre[0]
        y = position[:, 1] - self.centre[1] if position.shape[1] == 3 else np.zeros(len(x))
        r = np.hypot(x, y)
        height = self.crown * (r / self.radius) ** 2
        if self.waves is not None:
            way = self.waves.direction
            s = r if way is None else cos(way) * x + sin(way) * y
            angle = 2.0 * pi * s / self.waves.length + self.waves.phase
            height = height + self.waves.amplitude * (1.0 - np.cos(angle))
        if self.tilt:
            t = cos(self.tilt_direction) * x + sin(self.tilt_direction) * y
            height = height + (self.radius + t) * tan(self.tilt)
        return height

    def gaps(
        self, position: NDArray[np.float64], normal: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Growth of the gaps [m] at points of the slave face, shape (n,)."""
        return self.heights(position) * np.abs(normal[:, -1])
