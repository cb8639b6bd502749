r"""Contact law of faces that yield: closing once on one curve, opening on others.

The faces remember the largest indentation, :math:`d_m`. Below it they are elastic,

.. math:: F = P(d_m)\, \varphi\Bigl(\frac{d - d_0(d_m)}{d_m - d_0(d_m)}; d_m\Bigr), \qquad
    \varphi(0) = 0, \quad \varphi(1) = 1 ,

with the set :math:`d_0`; beyond it they close along :math:`P(d)` and yield. The plastic loss, work
of closing less elastic energy,

.. math:: D(d_m) = \int_0^{d_m} P\, \mathrm dd - (d_m - d_0)\, P \int_0^1 \varphi\, \mathrm ds ,

never falls. All three are linear between the states of the ladder, shapes between their points,
for exact energies. Beyond the last state closing continues straight, and the faces open along its
shape.
"""

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from klack.arrays import Floats
from klack.contact.laws import FlatLaw
from klack.contact.step_constants import LAW_YIELDING
from klack.errors import InputError, refuse_if

__all__ = ["YieldingLaw"]


_LEAST_LOSS = -1e-6  # share of the work by which the loss may fall between two states


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class YieldingLaw:
    """Loading curve and elastic curves of faces that yield.

    Rejects a loss that would fall as the faces are pressed further.

    Parameters
    ----------
    largest (m,) [m]
        Of the states, increasing; at the first nothing has yielded.
    set (m,) [m]
        Where the faces part after each; 0 at the first.
    closing (m,) [N]
        At ``largest``; increasing.
    shape (m, n) [-]
        Elastic force over ``closing``, from 0 to 1, at ``n`` places ``(k / (n - 1))**2`` of the
        way from the set to the largest indentation.
    reached [m]
        Largest indentation so far.
    """

    largest: Floats
    set: Floats
    closing: Floats
    shape: Floats
    reached: float = 0.0

    def __post_init__(self) -> None:
        for name in ("largest", "set", "closing", "shape"):
            object.__setattr__(self, name, np.array(getattr(self, name), dtype=float))
        falls = float(np.min(np.diff(self.loss), initial=0.0))
        rising = all(np.all(np.diff(a) > 0) for a in (self.largest, self.closing))
        refuse_if(
            not (rising and np.all(self.set < self.largest)),
            "law of faces that yield",
            got="a force that falls as the faces are pressed further, or faces that do not "
            "separate",
            expected="a force that increases, and a permanent set below the indentation",
            hint="a finer mesh at the contact, or fewer modes.",
        )
        refuse_if(
            falls < _LEAST_LOSS * self.taken[-1],
            "law of faces that yield",
            got=f"a loss that falls by {-falls:.2g} J of {self.taken[-1]:.2g} J",
            expected="a loss that rises with the indentation",
            hint="a finer mesh at the contact, or fewer modes.",
        )

    @property
    def places(self) -> Floats:
        """Places of ``shape`` over the way from the set to the largest indentation [-]."""
        n = self.shape.shape[1]
        return np.asarray((np.arange(n) / (n - 1)) ** 2)

    @property
    def stored(self) -> Floats:
        """Elastic energy [J] at each state."""
        area = np.trapezoid(self.shape, self.places, axis=1)
        return np.asarray(self.closing * (self.largest - self.set) * area)

    @property
    def taken(self) -> Floats:
        """Work of closing [J] up to each state."""
        more = np.diff(self.largest) * (self.closing[1:] + self.closing[:-1]) / 2.0
        return self.stored[0] + np.concatenate([[0.0], np.cumsum(more)])

    @property
    def loss(self) -> Floats:
        """Plastic loss [J] up to each state."""
        return np.asarray(self.taken - self.stored)

    @property
    def stiffest(self) -> float:
        """Highest stiffness [N/m], closing or opening."""
        slope = np.max(np.diff(self.shape, axis=1) / np.diff(self.places), axis=1)
        opening = self.closing / (self.largest - self.set) * slope
        closing = np.diff(self.closing) / np.diff(self.largest)
        return float(max(opening.max(), closing.max()))

    def require(self, reached: float) -> None:
        """Reject an indentation [m] beyond the last state."""
        if reached > self.largest[-1] * (1.0 + 1e-9):
            raise InputError(
                "law of faces that yield",
                got=f"an indentation of {reached * 1e6:.4g} um",
                expected=f"at most {self.largest[-1] * 1e6:.4g} um, {self.closing[-1]:.4g} N, "
                "where its static loops end",
                hint="compute the loops for a higher energy.",
            )

    def after(self, reached: float) -> Self:
        """Law of the same faces after an indentation ``reached`` [m]."""
        return replace(self, reached=max(reached, self.reached))

    def force(self, indentation: ArrayLike) -> Floats:
        """Force [N] of the present faces, along the elastic curve and beyond."""
        return self._along(indentation)[0]

    def potential(self, indentation: ArrayLike) -> Floats:
        """Work [J] of closing the present faces."""
        return self._along(indentation)[1]

    def tangent_stiffness(self, indentation: ArrayLike) -> Floats:
        """Largest slope [N/m] of all states; 0 while open."""
        return np.where(np.asarray(indentation, dtype=float) > 0.0, self.stiffest, 0.0)

    def _along(self, indentation: ArrayLike) -> tuple[Floats, Floats]:
        """Force and work of closing the present faces."""
        d = np.asarray(indentation, dtype=float)
        deep = max(self.reached, float(self.largest[0]))
        at = np.interp(deep, self.largest, np.arange(self.largest.size))
        i = min(int(at), self.largest.size - 2)
        share = at - i
        shape = (1 - share) * self.shape[i] + share * self.shape[i + 1]
        parted = self.set_after(deep)
        top, taken = self._closing(np.array(deep))
        way = np.clip((d - parted) / (deep - parted), 0.0, 1.0)
        below = np.minimum((np.sqrt(way) * (shape.size - 1)).astype(int), shape.size - 2)
        x = way - self.places[below]
        slope = (np.diff(shape) / np.diff(self.places))[below]
        area = np.cumsum(np.diff(self.places) * (shape[1:] + shape[:-1]) / 2.0)
        area = np.append(0.0, area)
        elastic = top * (shape[below] + slope * x)
        stored = top * (deep - parted) * (area[below] + x * (shape[below] + 0.5 * slope * x))
        closing, work = self._closing(d)
        full = top * (deep - parted) * area[-1]
        return np.where(d > deep, closing, elastic), np.where(d > deep, full + work - taken, stored)

    def _closing(self, d: Floats) -> tuple[Floats, Floats]:
        """Force and work of the closing curve, straight behind its last state."""
        i = np.clip(np.searchsorted(self.largest, d) - 1, 0, self.largest.size - 2)
        slope = (np.diff(self.closing) / np.diff(self.largest))[i]
        x = d - self.largest[i]
        return self.closing[i] + slope * x, self.taken[i] + x * (self.closing[i] + 0.5 * slope * x)

    def set_after(self, reached: float) -> float:
        """Set [m] after an indentation ``reached`` [m]."""
        beyond = max(reached - float(self.largest[-1]), 0.0)
        return float(np.interp(reached, self.largest, self.set)) + beyond

    def loss_after(self, reached: float) -> float:
        """Plastic loss [J] after an indentation ``reached`` [m]."""
        return float(np.interp(reached, self.largest, self.loss))

    def flat(self) -> FlatLaw:
        """Law as numbers for the kernel."""
        integrals = np.concatenate(
            [
                np.zeros((len(self.shape), 1)),
                np.cumsum(
                    np.diff(self.places) * (self.shape[:, 1:] + self.shape[:, :-1]) / 2.0, axis=1
                ),
            ],
            axis=1,
        )
        deep = max(self.reached, float(self.largest[0]))
        head = [float(self.largest.size), float(self.shape.shape[1]), deep, 0.0, deep, 0.0]
        return FlatLaw(
            kind=LAW_YIELDING,
            parameters=np.concatenate(
                [
                    head,
                    self.largest,
                    self.set,
                    self.closing,
                    self.taken,
                    self.shape.ravel(),
                    integrals.ravel(),
                ]
            ),
        )
