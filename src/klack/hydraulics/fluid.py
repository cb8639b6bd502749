"""Fluids: see the class."""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Fluid"]


class Fluid(Protocol):
    """A fluid at one temperature."""

    name: str
    temperature: float
    vapour_pressure: float

    def density(self, pressure: ArrayLike) -> NDArray[np.float64]:
        """Density [kg/m^3] at the absolute pressure [Pa]."""
        ...

    def bulk_modulus(self, pressure: ArrayLike) -> NDArray[np.float64]:
        """``rho dp/drho`` [Pa] at the absolute pressure [Pa]."""
        ...

    def sound_speed(self, pressure: ArrayLike) -> NDArray[np.float64]:
        """Speed of pressure waves [m/s] at the absolute pressure [Pa]."""
        ...

    def viscosity(self, pressure: ArrayLike) -> NDArray[np.float64]:
        """Dynamic viscosity [Pa s] at the absolute pressure [Pa]."""
        ...
