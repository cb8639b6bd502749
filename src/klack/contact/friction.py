r"""Coulomb friction of two faces.

A point pressed by :math:`\lambda_n` holds at most :math:`\mu \lambda_n` across its normal, and
slips against that force. The coefficient falls with the speed *v* of slip (Stribeck's curve in the
form of Bo & Pavelescu, Wear 82 (1982) 277, with exponent 1),

.. math:: \mu(v) = \mu_k + (\mu_s - \mu_k)\, e^{-v / v_s} ,

and at once for :math:`v_s = 0`: a point that has stuck (or just closed) holds
:math:`\mu_s \lambda_n`, one that slips :math:`\mu_k \lambda_n`.

In impacts :math:`\mu_k` decides: a face of a fast valve slips at 0.1 to 1 m/s within the first
microsecond, far above the millimetres per second at which an oil film is squeezed out, and a film
takes longer to follow than the contact lasts.
"""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from klack.errors import refuse_if, require_nonnegative

__all__ = ["MOST_FRICTION", "Friction"]

MOST_FRICTION = 2.0
"""Largest coefficient of a case; dry clean metals reach 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Friction:
    """Coefficients of friction of two faces.

    Parameters
    ----------
    kinetic [-]
        While the faces slip.
    static [-]
        While they stick; at least ``kinetic``.
    speed [m/s]
        v_s; 0: at once.
    """

    kinetic: float
    static: float
    speed: float = 0.0

    def __post_init__(self) -> None:
        require_nonnegative("friction: kinetic", self.kinetic, "")
        require_nonnegative("friction: speed", self.speed, "m/s")
        refuse_if(
            not self.static >= self.kinetic,
            "friction: static",
            got=f"{self.static:g}, below the kinetic coefficient {self.kinetic:g}",
            expected="a static coefficient of at least the kinetic one",
            hint="give only the kinetic coefficient where only one is known.",
        )

    @classmethod
    def coulomb(cls, coefficient: float) -> Self:
        """One coefficient for sticking and slipping."""
        return cls(kinetic=coefficient, static=coefficient)

    def scaled(self, kinetic: float) -> "Friction":
        """Faces of another kinetic coefficient [-], the static one in the same ratio to it.

        Rejects a kinetic coefficient of 0 below a static one, whose ratio is not known.
        """
        if kinetic == self.kinetic:
            return self
        if self.is_constant:
            return Friction(kinetic=kinetic, static=kinetic, speed=self.speed)
        refuse_if(
            self.kinetic == 0.0,
            "friction: kinetic",
            got=f"0, below a static coefficient of {self.static:g}",
            expected="a ratio of both coefficients",
            hint="give the kinetic coefficient of these faces.",
        )
        return Friction(
            kinetic=kinetic, static=kinetic * (self.static / self.kinetic), speed=self.speed
        )

    @property
    def is_none(self) -> bool:
        """True where the faces hold nothing across their normal."""
        return self.static == 0.0

    @property
    def is_constant(self) -> bool:
        """True where one coefficient holds at every speed of slip."""
        return self.static == self.kinetic

    def coefficient(self, speed: NDArray[np.float64]) -> NDArray[np.float64]:
        """Coefficient at speeds of slip [m/s], same shape."""
        if self.speed > 0.0:
            fall = np.exp(-np.abs(speed) / self.speed)
        else:
            fall = (np.asarray(speed) == 0.0).astype(float)
        return np.asarray(self.kinetic + (self.static - self.kinetic) * fall)
