"""Volume, centre and second moments of a shape, and of several with their densities."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Self

import numpy as np

from klack.arrays import Floats

__all__ = ["Moments"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Moments:
    r"""Integrals over a body of density 1, or over its density.

    Parameters
    ----------
    volume [m^3] or [kg]
    centre (3,) [m]
    second (3, 3) [m^5] or [kg m^2]
        :math:`\int x_i x_j \, dV` about the centre.
    """

    volume: float
    centre: Floats
    second: Floats

    @classmethod
    def about_origin(cls, volume: float, first: Floats, second: Floats) -> Self:
        """Steiner: from moments about the origin of the drawing."""
        centre = first / volume
        second = second - volume * np.outer(centre, centre)
        return cls(volume=volume, centre=centre, second=second)

    @classmethod
    def together(cls, parts: "Iterable[tuple[float, Moments]]") -> Self:
        """Of one body from parts with their densities."""
        volume, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
        for density, part in parts:
            mass, at = density * part.volume, part.centre
            volume += mass
            first += mass * at
            second += density * part.second + mass * np.outer(at, at)
        return cls.about_origin(volume, first, second)

    @property
    def inertia(self) -> Floats:
        """Tensor of inertia about the centre, ``tr(S) I - S``."""
        return float(np.trace(self.second)) * np.eye(3) - self.second
