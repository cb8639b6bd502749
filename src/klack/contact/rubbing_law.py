r"""Contact law with memory: what two faces with Coulomb friction do along the axis of motion.

The faces slip along the meridian: up the cone while the contact closes, down while it opens. The
law is a bed of springs, each touching at an indentation :math:`g_j`. Pressed in by
:math:`x = \langle d - g_j \rangle` it has the force :math:`n_j x` of the pressure, and that of the
friction, a spring :math:`k_j` with a slider,

.. math::
    F = \sum_j n_j x_j + k_j (x_j - s_j), \qquad |k_j (x_j - s_j)| \le h_j x_j, \qquad
    R = \frac{k_j}{h_j} ,

so that :math:`s_j` stays between :math:`x_j (1 - 1/R)` and :math:`x_j (1 + 1/R)`: a play (Visintin,
Differential Models of Hysteresis, 1994).  A slider that has opened forgets.  Closing from first
touch all sliders slip, :math:`F = \sum (n_j + h_j) x_j`; opening, each holds until

.. math:: \frac{x}{x_{max}} = \frac{R - 1}{R + 1} ,

and slips back below, :math:`F = \sum (n_j - h_j) x_j`. The energy is :math:`\sum \tfrac12 n_j
x_j^2 + \tfrac12 k_j (x_j - s_j)^2`; the rest of the work is lost.

A rigid needle of half angle *a* on a cone with the stiffnesses :math:`k_n, k_t` at its ring is one
such spring: :math:`n = k_n \sin^2 a`, :math:`h = \mu k_n \sin a \cos a`, :math:`k = k_t \cos^2 a`.
Springs of all depths make any law that stiffens, each losing the same share of its work, as
partial slip in a growing contact does (Jaeger, Arch. Appl. Mech. 64 (1994) 235; Popov & Hess,
Method of Dimensionality Reduction, 2015). Of the work that one closing takes,

.. math:: e^2 = 1 - \frac{2 H}{N + H}\,\frac{R - 1}{R + 1}

comes back where *H* is the same share of *N* at every depth.  :math:`R \le 1` never slips.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from klack.arrays import Vector
from klack.contact.laws import FlatLaw
from klack.contact.step_constants import LAW_RUBBING
from klack.errors import refuse_if, require_positive

__all__ = ["RubbingLaw"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RubbingLaw:
    """A bed of springs with sliders.

    Rejects a contact that would not come apart by itself.

    Parameters
    ----------
    onset (n,) [m]
        Indentation :math:`g_j`, increasing, not negative.
    normal (n,) [N/m]
        Of the pressure.
    strength (n,) [N/m]
        What friction holds at most; not negative.
    ratio [-]
        R; up to 1 nothing slips.

    Examples
    --------
    >>> law = RubbingLaw(onset=[0.0], normal=[1e9], strength=[1e8], ratio=9.0)
    >>> law.along([0.0, 1e-6, 0.8e-6, 0.4e-6, 0.0])  # closes, holds, slips back
    array([   0., 1100.,  720.,  360.,    0.])
    """

    onset: Vector
    normal: Vector
    strength: Vector
    ratio: float

    def __post_init__(self) -> None:
        for name in ("onset", "normal", "strength"):
            object.__setattr__(self, name, np.array(getattr(self, name), dtype=float).ravel())
        require_positive("law with friction: ratio", self.ratio, "-")
        sizes = {self.onset.size, self.normal.size, self.strength.size}
        rising = self.onset.size > 0 and self.onset[0] >= 0.0 and np.all(np.diff(self.onset) > 0)
        refuse_if(
            len(sizes) != 1 or not rising or not np.all(self.strength >= 0.0),
            "law with friction",
            got=f"{sorted(sizes)} springs, the first from {self.onset[:1]} m, with strengths "
            f"from {self.strength.min(initial=0.0):g} N/m",
            expected="one onset, stiffness and strength for each spring, onsets increasing "
            "from 0 or more, strengths not below 0",
            hint="sort the springs by their onset.",
        )
        # straight between the onsets, so that the slopes tell
        refuse_if(
            not np.all(np.cumsum(self.normal - self.strength) > 0.0),
            "law with friction",
            got="a force that does not fall while the contact opens (self-locking)",
            expected="a friction coefficient below the slope of the faces",
            hint="lower the coefficient of friction.",
        )

    def force(self, indentation: ArrayLike) -> Vector:
        """Force [N], closing from first touch."""
        return self._summed(self.normal + min(self.ratio, 1.0) * self.strength, indentation, 1)

    def returning(self, indentation: ArrayLike) -> Vector:
        """Least force [N]: all sliders slip back."""
        strength = self.strength if self.ratio > 1.0 else -self.ratio * self.strength
        return self._summed(self.normal - strength, indentation, 1)

    def potential(self, indentation: ArrayLike) -> Vector:
        """Work [J], closing from first touch."""
        return self._summed(
            (self.normal + min(self.ratio, 1.0) * self.strength) / 2.0, indentation, 2
        )

    def tangent_stiffness(self, indentation: ArrayLike) -> Vector:
        """Largest slope [N/m]: all sliders hold."""
        return self._summed(self.normal + self.ratio * self.strength, indentation, 0)

    def along(self, path: ArrayLike) -> Vector:
        """Force [N] at each indentation [m] of a path that begins open."""
        slip, forces = np.zeros_like(self.onset), []
        for d in np.asarray(path, dtype=float).ravel():
            x = np.maximum(d - self.onset, 0.0)
            slip = np.clip(slip, x * (1.0 - 1.0 / self.ratio), x * (1.0 + 1.0 / self.ratio))
            forces.append(self.normal @ x + self.ratio * (self.strength @ (x - slip)))
        return np.array(forces)

    def stored(self, indentation: float, slip: Vector) -> float:
        """Energy [J] at an indentation with sliders at ``slip`` [m], shape (n,)."""
        x = np.maximum(indentation - self.onset, 0.0)
        held = self.ratio * (self.strength @ (x - slip) ** 2)
        return float(0.5 * (self.normal @ x**2 + held))

    def flat(self) -> FlatLaw:
        """Law as numbers for the kernel: five of each spring, two of a slider."""
        head = [float(self.onset.size), self.ratio]
        sliders = np.zeros(2 * self.onset.size)
        return FlatLaw(
            kind=LAW_RUBBING,
            parameters=np.concatenate([head, self.onset, self.normal, self.strength, sliders]),
        )

    def _summed(self, stiffness: Vector, indentation: ArrayLike, power: int) -> Vector:
        x = np.asarray(indentation, dtype=float)[..., None] - self.onset
        return np.asarray(np.where(x > 0.0, x**power, 0.0) @ stiffness)
