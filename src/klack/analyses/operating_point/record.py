"""Record of operating points."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.analyses.record import CaseRecord

__all__ = ["OperatingPoints", "PointQuantity", "SweptQuantity"]

Vector = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SweptQuantity:
    """A swept key of the case, or ``lift``, ``current``, ``voltage``, in SI."""

    name: str
    unit: str
    values: Vector

    @property
    def short(self) -> str:
        """Name without the sections that hold all components."""
        return self.name.removeprefix("network.components.")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PointQuantity:
    """One quantity of a component at every point.

    ``values`` (points,) [SI] are nan at a point that was not found, or that does not have it.
    """

    component: str
    quantity: str
    unit: str
    values: Vector

    @property
    def name(self) -> str:
        """Both words."""
        return f"{self.component} {self.quantity}"

    @property
    def short(self) -> str:
        """The same."""
        return self.name


@dataclass(frozen=True, kw_only=True, eq=False)
class OperatingPoints(CaseRecord):
    """Operating points of a valve.

    Parameters
    ----------
    needle
        ``component.point`` whose displacement is the lift.
    origin
        ``"start"``, or ``"far"`` stops.
    drive [A]
        Current of each coil, of the first point.
    force_left (points,) [N]
        Largest force on a free body.
    flow_left (points,) [m^3/s]
        Largest of a volume.
    voltage_left (points,) [V]
        Largest of a coil with steady fluxes.
    failures
        Why there is no point.
    doubts
        A line for each point.
    cpu_time [s]
        Of all points, without bodies and contact laws.
    """

    variant: str
    needle: str
    origin: str
    drive: Mapping[str, float]
    swept: tuple[SweptQuantity, ...]
    quantities: tuple[PointQuantity, ...]
    force_left: Vector
    flow_left: Vector
    voltage_left: Vector
    failures: tuple[str, ...]
    doubts: tuple[str, ...]
    cpu_time: float

    @property
    def count(self) -> int:
        """Number of points, found or not."""
        return len(self.failures)

    @property
    def found(self) -> NDArray[np.bool_]:
        """Points that were found, shape (points,)."""
        return np.array([not text for text in self.failures], dtype=bool)

    def quantity(self, name: str) -> PointQuantity | None:
        """Quantity by ``"component quantity"``."""
        return next((item for item in self.quantities if item.name == name), None)
