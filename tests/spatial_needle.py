"""A needle of a few numbers between two rings of contact points, for strokes in three dimensions.

Rigid freedoms, elastic modes of any shape, springs at the points: nothing but arrays, so what has
to come out is known.  A port moves along z at its arm from the centre of mass.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from klack.bodies.reduction.reduced_body import ReducedBody
from klack.contact.friction import Friction
from klack.mechanics.end_stop import EndStop
from klack.mechanics.flexible_body import FlexibleBody
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import Rows
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import simulate_network
from klack.transient.interface_arrays import Guide
from klack.transient.interface_model import InterfaceModel
from klack.transient.spatial_run import SpatialValve
from klack.verification.interface_bodies import lateral_guide, modal_model

MASS, INERTIA = 3e-3, np.array([2.4e-7, 2.3e-7, 6e-9])  # [kg], [kg m^2]
BELOW, ABOVE = -8e-3, 9e-3  # [m] of the seat and of the stop, from the centre of mass
LIFT = 60e-6


def ring(count: int, radius: float, height: float, turn: float = 0.0) -> NDArray[np.float64]:
    """Points of a circle about the axis."""
    angle = turn + 2.0 * np.pi * np.arange(count) / count
    z = np.full(count, height)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])


@dataclass(frozen=True)
class Needle:
    """Rigid freedoms first, then elastic modes.

    Shapes of elastic modes are one row for each, along z at seat, stop and ports.
    """

    seat: NDArray[np.float64]
    stop: NDArray[np.float64]
    stiffness: float = 2e7  # [N/m] of each point
    ports: Mapping[str, tuple[float, float, float]] = None  # type: ignore[assignment]
    omega: tuple[float, ...] = ()
    damping: float = 0.0
    shapes: NDArray[np.float64] | None = None
    across: NDArray[np.float64] | None = None  # (heights, 2, elastic) at the guide
    friction: tuple[float, float] | None = None  # of seat and stop; without: no tangents
    half_angle: float = 0.5 * np.pi  # of the cone of the seat
    stiffer: float = 0.8  # springs across the normals, over those along them
    coupling: float = 0.0  # of both, over the mean compliance
    sliding: NDArray[np.float64] | None = None  # (2 points, elastic) of the tangents

    @property
    def arms(self) -> dict[str, NDArray[np.float64]]:
        """Port of the seat, of the stop, and all others."""
        given = {name: np.array(arm) for name, arm in (self.ports or {}).items()}
        return {"tip": self.seat.mean(axis=0), "land": self.stop.mean(axis=0)} | given

    @cached_property
    def rigid(self) -> NDArray[np.float64]:
        """Translation and rotation per modal coordinate."""
        elastic = np.zeros((6, len(self.omega)))
        return np.hstack([np.diag(np.concatenate([np.full(3, MASS), INERTIA]) ** -0.5), elastic])

    def along(self, arms: NDArray[np.float64], elastic: NDArray[np.float64]) -> NDArray[np.float64]:
        """Displacement along z at points: u_z + theta_x y - theta_y x."""
        R = self.rigid
        rows = R[2] + np.outer(arms[:, 1], R[3]) - np.outer(arms[:, 0], R[4])
        rows[:, 6:] += elastic
        return rows

    @cached_property
    def elastic(self) -> list[NDArray[np.float64]]:
        """Shapes of the elastic modes at seat, stop, ports."""
        counts = [len(self.seat), len(self.stop), len(self.arms)]
        if self.shapes is None:
            return [np.zeros((count, len(self.omega))) for count in counts]
        return np.split(self.shapes.T, np.cumsum(counts)[:-1])

    @cached_property
    def model(self) -> InterfaceModel:
        """Its contact points."""
        n, m = len(self.seat), len(self.stop)
        below, above = (
            self.along(self.seat, self.elastic[0]),
            self.along(self.stop, self.elastic[1]),
        )
        lean = self.half_angle
        if lean < 0.5 * np.pi:
            below = self.moved(self.seat, np.sin(lean), -np.cos(lean), self.elastic[0])
        model = modal_model(
            masses=(MASS, np.inf),
            omega=np.concatenate([np.zeros(6), self.omega]),
            damping=np.concatenate([np.zeros(6), np.full(len(self.omega), self.damping)]),
            traces=np.vstack([below, -above]),
            compliance=np.eye(n + m) / self.stiffness,
            gap=np.concatenate([np.zeros(n), np.full(m, LIFT)]),
            axial=np.concatenate([np.full(n, np.sin(lean)), -np.ones(m)]),
            contacts=(("seat", 0, n), ("opening", n, n + m)),
            points=np.vstack([self.seat, self.stop]),
            rigid=self.rigid,
        )
        return model if self.friction is None else self._rubbing(model, n, m)

    def moved(
        self, points: NDArray[np.float64], z: float, r: float, elastic: object = 0.0
    ) -> NDArray[np.float64]:
        """Displacement of points in the direction (r, 0, z) of their meridians."""
        out = points[:, :2] / np.linalg.norm(points[:, :2], axis=1)[:, None]
        return self._towards(points, np.column_stack([r * out, np.full(len(points), z)]), elastic)

    def _towards(
        self, points: NDArray[np.float64], way: NDArray[np.float64], elastic: object
    ) -> NDArray[np.float64]:
        rows = way @ self.rigid[:3] + np.cross(points, way) @ self.rigid[3:]
        rows[:, 6:] += elastic
        return rows

    def _rubbing(self, model: InterfaceModel, n: int, m: int) -> InterfaceModel:
        """Tangents along the meridian and round it, with springs of their own."""
        c, s = np.cos(self.half_angle), np.sin(self.half_angle)
        free = np.zeros((2 * (n + m), len(self.omega))) if self.sliding is None else self.sliding
        ends, rows = np.split(free, [n, n + m, 2 * n + m]), []
        for points, sign, part in ((self.seat, 1.0, ends[0]), (self.stop, -1.0, ends[1])):
            slope = (c, s) if sign > 0.0 else (0.0, 1.0)
            rows.append(sign * self.moved(points, *slope) + self._padded(part))
        for points, sign, part in ((self.seat, 1.0, ends[2]), (self.stop, -1.0, ends[3])):
            out = points[:, :2] / np.linalg.norm(points[:, :2], axis=1)[:, None]
            round_it = np.column_stack([-out[:, 1], out[:, 0], np.zeros(len(points))])
            rows.append(sign * self._towards(points, round_it, 0.0) + self._padded(part))
        own, one = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]), self.coupling
        own[1, 1] = own[2, 2] = 1.0 / self.stiffer
        own[0, 1] = own[1, 0] = one
        return replace(
            model,
            compliance=np.kron(own, np.eye(n + m)) / self.stiffness,
            tangents=np.vstack(rows),
            axial_across=np.concatenate([np.full(n, c), np.zeros(n + 2 * m)]),
            friction=tuple(Friction.coulomb(mu) for mu in self.friction or ()),
        )

    def _padded(self, elastic: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.hstack([np.zeros((len(elastic), 6)), elastic])

    @cached_property
    def reduced(self) -> ReducedBody:
        """As the network has it."""
        arms, omega = np.array(list(self.arms.values())), np.array(self.omega)
        shapes = self.along(arms, self.elastic[2]).T
        scaled = shapes[6:] / omega[:, None]
        return ReducedBody(
            name="needle",
            mass=MASS,
            omega=np.concatenate([np.zeros(6), omega]),
            damping=np.concatenate([np.zeros(6), np.full(len(omega), self.damping)]),
            port_names=tuple(self.arms),
            port_shapes=shapes,
            observer_names=(),
            observer_shapes=np.zeros((len(omega) + 6, 0)),
            static_compliance=scaled.T @ scaled,
            rigid_count=6,
            rigid_axial=np.sqrt(MASS) * np.eye(6)[2],
            dof_count=6,
        )

    def guide(self, **more: object) -> Guide:
        """Two heights, 4 um of clearance."""
        given = {"clearance": 4e-6, "stiffness": 3e7, "heights": (-3e-3, 5e-3)} | more
        offset = np.zeros((len(given["heights"]), 2))
        made = lateral_guide(self.model, **({"offset": offset, "radius": 1.5e-3} | given))
        if self.across is not None:
            made.traces[:, :, 6:] += self.across
        return made

    def rows(self, joints: Mapping[str, Component], speed: float = 0.0) -> Rows:
        """Network of the needle, its two stops, and what is joined to its ports."""
        parts: dict[str, Component] = {
            "needle": FlexibleBody.of(self.reduced, speed=speed),
            "seat": EndStop(gap=0.0, law=self._law(len(self.seat))),
            "opening": EndStop(gap=LIFT, law=self._law(len(self.stop))),
        }
        links = [
            ["needle.tip", "seat.upper"],
            ["seat.lower", "ground"],
            ["needle.land", "opening.lower"],
            ["opening.upper", "ground"],
        ]
        for port, part in joints.items():
            name, own = f"at_{port}", f"needle.{port}"
            parts[name] = part
            link = next((link for link in links if own in link), [own])
            link.append(f"{name}.end")
            links += [] if link in links else [link]
        return Network(parts, links).rows()

    def _law(self, count: int) -> dict[str, object]:
        return {"kind": "linear", "stiffness": count * self.stiffness}

    def valve(self, **more: object) -> SpatialValve:
        """In three dimensions."""
        arms = np.array([self.seat.mean(axis=0), self.stop.mean(axis=0)])
        given = {"model": self.model, "components": ("needle",), "stops": ("seat", "opening")}
        return SpatialValve(**(given | {"arms": arms} | more))

    def with_modes(self, seed: int = 1) -> "Needle":
        """The same with four elastic modes of any shape, that also move the guide."""
        random = np.random.default_rng(seed)
        count = len(self.seat) + len(self.stop) + len(self.arms)
        return replace(
            self,
            omega=tuple(2.0 * np.pi * np.array([31e3, 47e3, 88e3, 140e3])),
            damping=0.01,
            shapes=MASS**-0.5 * random.normal(size=(4, count)),
            across=0.5 * MASS**-0.5 * random.normal(size=(2, 2, 4)),
            sliding=MASS**-0.5 * random.normal(size=(2 * (count - len(self.arms)), 4)),
        )


def move(rows: Rows, valve: SpatialValve | None, duration: float, **more: object) -> NetworkResult:
    """Run it in steps of 20 ns."""
    given = {"step": 20e-9, "record": 1.28e-6} | more
    return simulate_network(rows, duration=duration, spatial=valve, **given)
