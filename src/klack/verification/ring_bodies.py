"""A needle on a conical seat as half sections: at points on rings, as solids, in a network."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.spatial import cKDTree

from klack.assembling.spatial_rings import in_all_orders
from klack.bodies.elasticity.body import ElasticBody, elastic_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.bodies.elasticity.fourier_body import FourierBody, fourier_body
from klack.bodies.elasticity.ring_points import RingRows, RingSections
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.reduction.damping import ModalDamping
from klack.bodies.reduction.ports import surface_port
from klack.bodies.reduction.reduce import reduce_body
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.bodies.reduction.selection import ByCount
from klack.contact.friction import Friction
from klack.contact.gap_update import RingGaps
from klack.contact.mortar import ContactSpace, contact_space
from klack.contact.rings import RingFriction, RingSpace
from klack.mechanics.end_stop import EndStop
from klack.mechanics.flexible_body import FlexibleBody
from klack.mechanics.stop_law import LinearStopLaw
from klack.mesh.mesh import Mesh, Surface
from klack.mesh.swept import sweep
from klack.network.network import Network
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.transient.guide import guide_at_sections, shaft_sections, turned_sections
from klack.transient.interface_arrays import Guide
from klack.transient.interface_model import InterfaceModel
from klack.transient.interface_result import InterfaceResult
from klack.transient.revolved_model import (
    RevolvedBody,
    RevolvedPoints,
    RingContact,
    model_of_reduced,
    reduced_bodies,
    revolved_model,
)
from klack.transient.spatial_run import SpatialValve
from klack.verification.transient import STEEL, needle_over_seat

__all__ = [
    "NeedleOnRing",
    "RingStroke",
    "impulse_on_needle",
    "momentum_of_needle",
    "solid_over_ring_compliance",
]


@dataclass(frozen=True, kw_only=True)
class NeedleOnRing:
    """Free needle D4 over a held seat, in the meridian plane (:func:`needle_over_seat`).

    Parameters
    ----------
    size, bulk [m]
        Elements at the ring and far away.
    reach [m]
        Of the centred bodies.
    slave
        Of the hats, needle or seat.
    """

    size: float = 30e-6
    bulk: float = 3e-3
    reach: float = 12e-6
    slave: Literal["a", "b"] | None = None

    @cached_property
    def bodies(self) -> tuple[ElasticBody, ElasticBody]:
        """Needle and seat, centred in first touch, moving axially alone."""
        return needle_over_seat(size=self.size, bulk=self.bulk)[:2]

    @property
    def sides(self) -> tuple[Mesh, Surface, Mesh, Surface]:
        """Mesh and surface of both."""
        upper, lower = (body.mesh for body in self.bodies)
        return upper, upper.surface("tip"), lower, lower.surface("cone")

    @cached_property
    def section(self) -> ContactSpace:
        """Hats of the half section."""
        return contact_space(*self.sides, reach=self.reach, slave=self.slave)

    def gaps(self, count: int) -> RingGaps:
        """Gaps at so many angles."""
        return RingGaps.of(
            self.section,
            *self.sides,
            angle=2.0 * np.pi * np.arange(count) / count,
            centre=np.array([0.0, 0.0, float(self.bodies[0].centre_of_mass[1])]),
        )

    def placed(self, count: int, placement: np.ndarray) -> tuple[RingSpace, np.ndarray]:
        """Contact points and placement (6,), after a placement and a shift to first touch."""
        gaps, moved = self.gaps(count), np.array(placement, dtype=float)
        for _ in range(6):
            gap = gaps(moved)
            moved[2] -= float(np.min(gap / self.section.axial[:, None]))
        gap = gaps(moved)
        return RingSpace.within(self.section, gap, float(gap.min()) + 0.7 * self.reach), moved

    def in_order(self, number: int) -> Callable[[int], FourierBody]:
        """Needle (0) or seat (1) in any Fourier order."""
        body = self.bodies[number]
        (solid,) = body.mesh.solids
        held = body.mesh.surface("base").nodes if number else ()
        return lambda order: fourier_body(
            body.name, body.mesh, {solid: STEEL}, order=order, fixed_nodes=held
        )

    def revolved(self, axial: int, others: int) -> list[RevolvedBody]:
        """Both bodies with so many modes of order 0 and of each above."""
        return [
            RevolvedBody(
                name=body.name,
                in_order=self.in_order(number),
                axial=eigenmodes(body, count=axial),
                others=others,
                damping=lambda omega: np.zeros(len(omega)),
            )
            for number, body in enumerate(self.bodies)
        ]

    def contact(self, space: RingSpace, friction: Friction | None = None) -> RingContact:
        """Contact at these points."""
        faces = None if friction is None else RingFriction.on(friction, self.section, *self.sides)
        upper, lower = (body.name for body in self.bodies)
        return RingContact(name="seat", upper=upper, lower=lower, space=space, faces=faces)

    def model(
        self, space: RingSpace, *, axial: int, others: int, friction: Friction | None = None
    ) -> InterfaceModel:
        """Interface model; modes as of :meth:`revolved`."""
        return revolved_model(self.revolved(axial, others), [self.contact(space, friction)])


def impulse_on_needle(
    pair: NeedleOnRing, space: RingSpace, result: InterfaceResult, step: float
) -> np.ndarray:
    """Impulse and its moment about the centre of mass, shape (6,), from forces at the hats.

    Without Fourier orders: forces of the half section on a rigid needle.
    """
    needle = pair.bodies[0]
    points = needle.mesh.points
    arm = points[:, 1] - needle.centre_of_mass[1]
    rigid = np.zeros((3, needle.mesh.node_count, 2))  # in the plane of the section
    rigid[0, :, 0] = 1.0  # outwards
    rigid[1, :, 1] = 1.0
    rigid[2] = np.column_stack([arm, -points[:, 0]])  # turns z into r
    outwards, along, turning = (space.section.G_a @ field.ravel() for field in rigid)
    pushed = result.impacts[0].point_force.astype(float).sum(axis=0) * step
    angle = space.angles[space.turn]
    away, up, turn = (values[space.ring] * pushed for values in (outwards, along, turning))
    c, s = np.cos(angle), np.sin(angle)
    return np.array([away @ c, away @ s, up.sum(), -(turn @ s), turn @ c, 0.0])


def momentum_of_needle(pair: NeedleOnRing, velocity: np.ndarray) -> np.ndarray:
    """Momentum and angular momentum (6,) of a rigid velocity."""
    needle = pair.bodies[0]
    return np.concatenate([needle.mass * velocity[:3], needle.inertia @ velocity[3:]])


def solid_over_ring_compliance(
    pair: NeedleOnRing, *, number: int, order: int, layers: int
) -> tuple[float, float]:
    r"""Compliance under a pressure wave, of a swept solid and of the half section in that order.

    Work of the pressure :math:`\cos n \theta` on its own answer over the square of its force all
    round.  The hats of the solid are linear round the ring, two steps *d* wide, and read a wave by
    :math:`(\sin x / x)^2`, :math:`x = n d / 2`, loaded and read; so does the half section here.

    Parameters
    ----------
    number
        Needle (0) or seat (1).
    layers
        Of the solid.
    """
    space, _ = pair.placed(2 * layers, np.zeros(6))
    kept = np.unique(space.ring)
    upper, lower = (sweep(body.mesh, layers) for body in pair.bodies)
    whole = contact_space(
        *(upper, upper.surface("tip"), lower, lower.surface("cone")),
        reach=2.0 * pair.reach,
        slave=pair.section.slave,
    )
    place = np.column_stack([np.hypot(*whole.points[:, :2].T), whole.points[:, 2]])
    away, _ = cKDTree(pair.section.points[kept]).query(place)
    solid = whole.restricted(np.asarray(away < 1e-9))
    wave = np.cos(order * np.arctan2(solid.points[:, 1], solid.points[:, 0])) * solid.area
    mesh, G = ((upper, solid.G_a), (lower, solid.G_b))[number]
    (name,) = mesh.solids
    body = elastic_body(
        name, mesh, {name: STEEL}, fixed_nodes=mesh.surface("base").nodes if number else ()
    )
    with Flexibility(body) as flexibility:
        found = float(wave @ (G @ flexibility.solve(G.T @ wave)))
    rows = RingRows.in_plane((pair.section.G_a, pair.section.G_b)[number]).of_order(order)[kept]
    with Flexibility(pair.in_order(number)(order)) as flexibility:
        c = flexibility.condensed(rows)
    # of unit pressure all round the load on a row is its area, of a wave half of it
    load = pair.section.area[kept] * (1.0 if order == 0 else 0.5)
    hat = np.sinc(order / (2.0 * layers)) ** 2
    force = pair.section.area[kept].sum()
    return found / force**2, float(hat**2 * load @ c @ load) / force**2


_HEIGHTS = (5e-3, 20e-3)  # of the guide, in the drawing of the needle [m]
_STIFFNESS = 1e9  # [N/m] of a law that never acts


@dataclass(frozen=True, kw_only=True, eq=False)
class RingStroke:
    """Needle over a seat, as half sections with modes of all orders.

    Parameters
    ----------
    placement (6,) [m], [rad]
        Of the needle, which is moved along z to ``gap``.
    count
        Angles of every ring.
    axial, others
        As of :meth:`NeedleOnRing.revolved`.
    gap [m]
        To first touch.
    """

    pair: NeedleOnRing
    placement: np.ndarray
    count: int = 24
    axial: int = 6
    others: int = 8
    gap: float = 1e-6

    @cached_property
    def sections(self) -> RingSections:
        """Sections of the shaft in its guide."""
        return turned_sections("needle", self.pair.bodies[0].mesh, "guide", _HEIGHTS)

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
        """Both bodies with contact port and modes of all orders."""
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
        velocity: np.ndarray | None = None,
        guide: Guide | None = None,
    ) -> NetworkResult:
        """Drop the needle in a network without any other force.

        Parameters
        ----------
        speed [m/s]
            Downwards.
        duration, step [s]
        velocity (6,) [m/s], [rad/s]
            Beside it.
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
