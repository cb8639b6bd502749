"""What a network asks of its fluid and of the laws of its contacts."""

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from klack.arrays import Floats

__all__ = [
    "InterfaceLaw",
    "LawNumbers",
    "NetworkFluid",
    "NetworkGas",
    "PressureBounds",
    "RunningController",
]


class PressureBounds(Protocol):
    """Absolute pressures for which a fluid is described.

    Attributes
    ----------
    lowest, highest [Pa]
        Between them its numbers are right.
    usable [Pa]
        Above it a run stops.
    """

    @property
    def lowest(self) -> float: ...  # noqa: D102
    @property
    def highest(self) -> float: ...  # noqa: D102
    @property
    def usable(self) -> float: ...  # noqa: D102
    @property
    def source(self) -> str: ...  # noqa: D102


class NetworkFluid(Protocol):
    """A fluid at one temperature whose density follows from the pressure alone.

    Attributes
    ----------
    temperature [K]
    vapour_pressure [Pa]
    all_liquid_from [Pa]
        Above it no vapour is left.
    kinks [Pa]
        Where the second derivative of the density jumps, increasing.
    """

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def temperature(self) -> float: ...  # noqa: D102
    @property
    def vapour_pressure(self) -> float: ...  # noqa: D102
    @property
    def all_liquid_from(self) -> float: ...  # noqa: D102
    @property
    def kinks(self) -> tuple[float, ...]: ...  # noqa: D102
    @property
    def pressure_range(self) -> PressureBounds: ...  # noqa: D102

    def density(self, pressure: ArrayLike) -> Floats:
        """Density [kg/m^3] at the absolute pressure [Pa]."""

    def bulk_modulus(self, pressure: ArrayLike) -> Floats:
        """``rho dp/drho`` [Pa]."""

    def sound_speed(self, pressure: ArrayLike) -> Floats:
        """Speed of pressure waves in an unbounded fluid [m/s]."""

    def viscosity(self, pressure: ArrayLike) -> Floats:
        """Dynamic viscosity [Pa s]."""

    def specific_volume(self, pressure: ArrayLike) -> tuple[Floats, Floats]:
        """Volume per mass [m^3/kg] and its slope [m^3/(kg Pa)]."""


class NetworkGas(Protocol):
    """A gas of a network, of which only the room of gases knows more."""

    @property
    def name(self) -> str: ...  # noqa: D102


class LawNumbers(Protocol):
    """A law as plain numbers for the time loop; ``dissipation`` [-] is 0 for an elastic law."""

    @property
    def kind(self) -> int: ...  # noqa: D102
    @property
    def parameters(self) -> Floats: ...  # noqa: D102
    @property
    def dissipation(self) -> float: ...  # noqa: D102


class InterfaceLaw(Protocol):
    """Force of a contact over its indentation."""

    def force(self, indentation: ArrayLike) -> Floats:
        """Force [N] at the given indentation [m]."""

    def tangent_stiffness(self, indentation: ArrayLike) -> Floats:
        """Tangent stiffness [N/m] at the given indentation [m]."""

    def potential(self, indentation: ArrayLike) -> Floats:
        """Stored energy [J] at the given indentation [m]."""

    def flat(self) -> LawNumbers:
        """Return the law as plain numbers."""


class RunningController(Protocol):
    """A controller during a run."""

    def __call__(self, time: float, values: tuple[float, ...]) -> float:
        """Output for a time [s] and the values of its channels, in the units of its signals."""

    @property
    def can_be_stored(self) -> bool:
        """Whether a run can continue from what it remembers."""

    def memory(self) -> Mapping[str, NDArray[np.generic]]:
        """All that the next call depends on."""

    def recall(self, memory: Mapping[str, NDArray[np.generic]]) -> None:
        """Continue from a memory; KeyError for that of another controller."""
