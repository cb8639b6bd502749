"""A needle and a seat as half sections that meet off their axis in a network."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from klack.assembling.spatial_rings import in_all_orders
from klack.elasticity.ring_points import RingSections
from klack.mechanics.end_stop import EndStop
from klack.mechanics.flexible_body import FlexibleBody
from klack.mechanics.stop_law import LinearStopLaw
from klack.network.network import Network
from klack.reduction.damping import ModalDamping
from klack.reduction.ports import surface_port
from klack.reduction.reduce import reduce_body
from klack.reduction.reduced_body import ReducedBody
from klack.reduction.selection import ByCount
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.transient.guide import Guide, guide_at_sections
from klack.transient.interface_model import InterfaceModel
from klack.transient.revolved_guide import shaft_sections, turned_sections
from klack.transient.revolved_model import model_of_reduced, reduced_bodies
from klack.transient.revolved_points import RevolvedPoints
from klack.transient.spatial_run import SpatialValve
from klack.verification.ring_bodies import NeedleOnRing

__all__ = ["RingStroke"]

Floats = NDArray[np.float64]

_HEIGHTS = (5e-3, 20e-3)  # of the guide, in the drawing of the needle [m]
_STIFFNESS = 1e9  # [N/m] of a law that never acts


@dataclass(frozen=True, kw_only=True, eq=False)
class RingStroke:
    """Needle over a seat, as half sections with modes of all orders.

    Parameters
    ----------
    pair : NeedleOnRing
    placement : array, shape (6,) [m], [rad]
        Of the needle; it is moved along z to ``gap``.
    count : int
        Angles of every ring.
    axial, others : int
        Modes of each body of order 0, and of the orders above.
    gap : float [m]
        Along z, to the first touch.
    """

    pair: NeedleOnRing
    placement: Floats
    count: int = 24
    axial: int = 6
    others: int = 8
    gap: float = 1e-6

    @cached_property
    def sections(self) -> RingSections:
        """Sections of the shaft in its guide."""
        mesh = self.pair.bodies[0].mesh
        return turned_sections("needle", mesh, "guide", _HEIGHTS)

    @cached_property
    def _reduced(self) -> tuple[InterfaceModel, list[RevolvedPoints]]:
        space, _ = self.pair.placed(self.count, self.placement)
        needle, seat = self.pair.revolved(self.axial, self.others)
        contacts = [self.pair.contact(space)]
        points, loads = reduced_bodies([replace(needle, sections=self.sections), seat], contacts)
        model = model_of_reduced(points, loads, contacts)
        return replace(model, gap=model.gap + self.gap * model.axial), points

    @property
    def model(self) -> InterfaceModel:
        """Interface model, the needle first."""
        return self._reduced[0]

    @property
    def bodies(self) -> list[ReducedBody]:
        """Both bodies with a port on their contact surface and the modes of all orders."""
        return [
            in_all_orders(self.along_axis(number), points)
            for number, points in enumerate(self._reduced[1])
        ]

    def along_axis(self, number: int) -> ReducedBody:
        """Needle (0) or seat (1) in its motion along the axis."""
        body = self.pair.bodies[number]
        return reduce_body(
            body,
            [surface_port(body.mesh, "cone" if number else "tip", "z", name="contact")],
            modes=ByCount(self.axial),
            correction="consistent",
            damping=ModalDamping(ratio=0.0),
        )

    def guide(self, *, clearance: float, friction: float = 0.0) -> Guide:
        """Guide of the shaft at two heights."""
        return guide_at_sections(
            self.model,
            "needle",
            shaft_sections(self.sections, self._reduced[1][0]),
            clearance=clearance,
            stiffness=None,
            friction=friction,
            viscous=0.0,
        )

    def fly(
        self,
        *,
        speed: float,
        duration: float,
        step: float = 40e-9,
        velocity: Floats | None = None,
        guide: Guide | None = None,
    ) -> NetworkResult:
        """Drop the needle in a network without any other force.

        Parameters
        ----------
        speed : float [m/s]
            Downwards.
        duration, step : float [s]
        velocity : array, shape (6,), optional [m/s], [rad/s]
            Beside it.
        guide : Guide, optional
        """
        needle, seat = self.bodies
        network = Network(
            {
                "needle": FlexibleBody.of(needle, speed=-speed),
                "seat": FlexibleBody.of(seat),
                "stop": EndStop(
                    gap=self.gap, law=LinearStopLaw(kind="linear", stiffness=_STIFFNESS)
                ),
            },
            [["needle.contact", "stop.upper"], ["seat.contact", "stop.lower"]],
        )
        model = self.model
        arm = model.points.mean(axis=0) - model.centre
        valve = SpatialValve(
            model=model,
            components=("needle", "seat"),
            stops=("stop",),
            arms=arm[None],
            guide=guide,
            velocity=np.zeros(6) if velocity is None else velocity,
        )
        return simulate_network(
            network.rows(), duration=duration, step=step, record=1e-6, start="free", spatial=valve
        )
