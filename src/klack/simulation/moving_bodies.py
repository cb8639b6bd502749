"""Bodies of a running network that meet point by point, whoever moves them."""

from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Vector
from klack.simulation.network_arrays import Recording, Scratch
from klack.simulation.network_result import ChannelData, StaticStart
from klack.simulation.spatial_impact import SpatialImpact, SpatialPath

__all__ = ["MovingBodies"]

Changing = NDArray[np.generic]


class MovingBodies(Protocol):
    """Bodies of one run; the network holds their modes whenever a record ends."""

    path: SpatialPath
    paths: list[SpatialPath]

    def start(self, balance: Callable[[Vector], StaticStart] | None) -> StaticStart | None:
        """Place them, at rest under the forces of the network, which ``balance`` finds anew.

        Its argument is how far each port is from where bodies along the axis have it [m].  Without
        it they start as they are.  Returns the last balance found.
        """

    def resume(self) -> None:
        """Continue from a stored state."""

    def advance(
        self,
        recording: Recording,
        scratch: Scratch,
        clock: NDArray[np.int64],
        block: int,
        look: int,
        looks: int,
        report: Vector,
    ) -> int:
        """Advance by ``looks`` of ``look`` times ``block`` fine steps; a status."""

    def pressing(self) -> Vector:
        """Contact force of each interface at rest [N]."""

    def turning(self) -> dict[str, tuple[Vector, Vector]]:
        """Times [s] and energies of rotation [J] of each component that moves."""

    def changing(self) -> dict[str, Changing]:
        """All arrays that a step changes and the next one begins with."""

    def stores(self) -> dict[str, float]:
        """Energies [J] that they hold beside that of their modes."""

    def supplies(self) -> dict[str, float]:
        """Energies [J] from sources of their own since the start of the run."""

    def losses(self) -> dict[str, float]:
        """Energies [J] lost since the start of the run."""

    def forget_losses(self) -> None:
        """Begin a new energy balance."""

    def recorded_impacts(self, end: float) -> tuple[SpatialImpact, ...]:
        """What was recorded of the impacts up to ``end`` [s], in order of first touch."""

    def gap(self) -> Vector:
        """What to add to the recorded gap of each interface to have the true one [m]."""

    def channels(self, time: Vector) -> dict[str, ChannelData]:
        """Quantities at these moments that no axial motion has."""
