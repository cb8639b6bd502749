"""What a network asks of the fluid in it and of the laws of its contacts, whatever they are."""

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
    """Absolute pressures for which a fluid is described, and where that comes from.

    Attributes
    ----------
    lowest, highest [Pa]
        Between them its numbers are right.
    usable [Pa]
        Above it a number means nothing any more, and a run stops.
    source
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
    name
    temperature [K]
    vapour_pressure [Pa]
        At which it boils.
    all_liquid_from [Pa]
        Above it no vapour is left.
    kinks : tuple of float [Pa]
        Where the second derivative of the density jumps, increasing.
    pressure_range : PressureBounds
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
    """A gas of a network; what it computes with it is a matter of the room of gases.

    Attributes
    ----------
    name
    """

    @property
    def name(self) -> str: ...  # noqa: D102


class LawNumbers(Protocol):
    """A law as plain numbers for the time loop: its kind, its parameters, its damping.

    Attributes
    ----------
    kind
    parameters
    dissipation [-]
        0 for an elastic law.
    """

    @property
    def kind(self) -> int: ...  # noqa: D102
    @property
    def parameters(self) -> Floats: ...  # noqa: D102
    @property
    def dissipation(self) -> float: ...  # noqa: D102


class InterfaceLaw(Protocol):
    """Force of a contact over its indentation."""

    def force(self, indentation: ArrayLike) -> Floats:
        """Return the force [N] at the given indentation [m]."""

    def tangent_stiffness(self, indentation: ArrayLike) -> Floats:
        """Return the tangent stiffness [N/m] at the given indentation [m]."""

    def potential(self, indentation: ArrayLike) -> Floats:
        """Return the stored energy [J] at the given indentation [m]."""

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
