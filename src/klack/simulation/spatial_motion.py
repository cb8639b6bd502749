"""What a network needs of bodies that meet point by point.

All other bodies of a network meet at interfaces along the axis, in the loop of
:mod:`klack.simulation.network_kernel`.
"""

from typing import Protocol

from klack.simulation.moving_bodies import MovingBodies
from klack.simulation.network_compile import CompiledNetwork
from klack.simulation.step_sizes import StepSizes

__all__ = ["SpatialMotion"]


class SpatialMotion(Protocol):
    """Bodies of a valve that meet point by point."""

    def of(self, network: CompiledNetwork, sizes: StepSizes) -> MovingBodies:
        """Return them in a network."""
        ...
