"""A rigid needle in space whose motion is known: alone in its films, or in a network."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import cos, sin
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from klack.contact.friction import Friction
from klack.errors import ConvergenceError
from klack.hydraulics.film import RingFilm
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.tilted_film import sector_film
from klack.mechanics.end_stop import EndStop
from klack.mechanics.flexible_body import FlexibleBody
from klack.mechanics.stop_law import LinearStopLaw
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import FilmRow
from klack.reduction.reduced_body import ReducedBody
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import State as NetworkState
from klack.simulation.network_run import simulate_network
from klack.transient.guide import Guide
from klack.transient.interface_arrays import DEBT, Films, Outside, Record, State
from klack.transient.interface_kernel import FAILED, march
from klack.transient.interface_model import InterfaceModel
from klack.transient.interface_run import bore_arrays, contact_points, modes_of_step
from klack.transient.spatial_run import SpatialValve
from klack.transient.tilting_film import TiltingFilm, film_arrays
from klack.transient.tilting_films import LOST, bend_faces, film_strain
from klack.verification.interface_bodies import lateral_guide, rigid_body

__all__ = [
    "FACE",
    "INERTIA",
    "MASS",
    "STIFFNESS",
    "Ended",
    "film_of",
    "fly_in_films",
    "fly_in_network",
    "guide_of",
    "needle_on_cone",
    "needle_on_ring",
]

Array = NDArray[np.float64]

MASS, INERTIA = 3e-3, (1.2e-7, 1.2e-7, 2e-8)  # [kg], [kg m^2]
STIFFNESS = 1e8  # [N/m]
FACE = RingFilm(shape="ring", inner_radius=1.3e-3, outer_radius=1.9e-3, cut_off=1e-6)
_RING, _POINTS, _BELOW = 1.6e-3, 24, 6e-3  # of contact points; centre of mass above them [m]


def needle_on_ring(gap: float = 0.0) -> InterfaceModel:
    """Rigid needle over a ring of springs, of :data:`STIFFNESS` in all, so far above [m]."""
    angle = 2.0 * np.pi * np.arange(_POINTS) / _POINTS
    ring = np.column_stack([_RING * np.cos(angle), _RING * np.sin(angle)])
    points = np.column_stack([ring, np.full(_POINTS, -_BELOW)])
    return rigid_body(
        mass=MASS, inertia=INERTIA, points=points, stiffness=STIFFNESS / _POINTS, gap=gap
    )


def needle_on_cone(
    half_angle: float, friction: float, *, stiffer: float, gap: float = 0.0
) -> InterfaceModel:
    """The same in a cone whose faces rub: ``stiffer`` springs across the normals, over those along.

    Tangents are those along the meridian, upwards, and round the axis; ``gap`` is along it [m].
    """
    flat, s, c = needle_on_ring(), sin(half_angle), cos(half_angle)
    angle, nothing = 2.0 * np.pi * np.arange(_POINTS) / _POINTS, np.zeros(_POINTS)
    out, up = np.column_stack([np.cos(angle), np.sin(angle), nothing]), np.array([0.0, 0.0, 1.0])
    round_it = np.column_stack([-np.sin(angle), np.cos(angle), nothing])

    def rows(way: Array) -> Array:
        return way @ flat.rigid[:3] + np.cross(flat.points, way) @ flat.rigid[3:]

    own = np.diag([1.0, 1.0 / stiffer, 1.0 / stiffer])
    return replace(
        flat,
        traces=rows(s * up - c * out),
        tangents=np.vstack([rows(c * up + s * out), rows(round_it)]),
        compliance=np.asarray(np.kron(own, flat.compliance), dtype=np.float64),
        gap=np.full(_POINTS, s * gap),
        axial=np.full(_POINTS, s),
        axial_across=np.concatenate([np.full(_POINTS, c), nothing]),
        friction=(Friction.coulomb(friction),),
    )


def guide_of(model: InterfaceModel, *, clearance: float = 3e-6, friction: float = 0.0) -> Guide:
    """Guide of a shaft of 1.5 mm radius at two heights."""
    return lateral_guide(
        model, clearance=clearance, stiffness=2e8, heights=(-2e-3, 5e-3),
        offset=((0.0, 0.0), (0.0, 0.0)), friction=friction, radius=1.5e-3,
    )  # fmt: skip


def film_of(model: InterfaceModel, *, sectors: int = 36) -> TiltingFilm:
    """Film of :data:`FACE` at the ring of contact points."""
    shapes = np.column_stack([np.ones(model.count), model.points[:, :2]])
    return TiltingFilm(
        stop="contact",
        land=sector_film(FACE.inner_radius, FACE.outer_radius, sectors=sectors, circles=2),
        cubic=FACE.coefficients()[0],
        slope=1.0,
        fit=np.linalg.pinv(shapes),
        base=np.zeros(3),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """Coordinates and velocities at the end of a motion, and its energies [J].

    Films have lost, bulk and contact hold, and the contact has still to pay so much.  Mean forces
    of the contact and of the films along the axis, step by step.
    """

    q: Array
    v: Array
    lost: float
    held: float
    owed: float
    force: Array
    film: Array


def fly_in_films(
    model: InterfaceModel,
    row: FilmRow | None,
    q: Array,
    v: Array,
    *,
    step: float,
    steps: int,
    guide: Guide | None = None,
    bearing: tuple[Array, Array] | None = None,
    sectors: int = 36,
    series: float = 0.0,
) -> Ended:
    """Motion in a film at the contact, or films in the guide, without any other force.

    ``series`` is the compliance [m/N] of the bulk under film and contact, of which the springs have
    as much at each point.
    """
    none = np.zeros(0)
    films: Films = film_arrays(
        model,
        [film_of(model, sectors=sectors)] if row is not None else [],
        {"contact": row} if row is not None else {},
        {"contact": series},
        *(bearing or (none, none)),
    )
    bore = bore_arrays(guide, model.mode_count)
    state = State.still(
        *(model.mode_count, model.count, len(bore.clearance)),
        films=len(films.lowest),
        sectors=int(np.max(films.sizes[:, 0], initial=0)),
    )
    state.q[:], state.v[:] = q, v
    modes = modes_of_step(model, step)
    record = Record.empty(
        steps, len(model.bodies), model.count, keep_points=False, films=len(films.lowest)
    )
    points = contact_points(model, modes.B1, step)
    there = bore if len(bore.clearance) else None
    _, status = march(steps, 0, modes, Outside(0.0, 0.0), points, there, films, state, record)
    if status == FAILED:
        raise ConvergenceError("rigid needle: no forces found")
    bent = np.array(model.gap)
    held = 0.0
    for k in range(len(films.lowest)):
        bend_faces(films, k, state.films[k, :3], bent)
        held += film_strain(films, k, state)
    return Ended(
        q=state.q,
        v=state.v,
        lost=float(np.sum(state.films[:, LOST]) + np.sum(state.bearing[:, 2])),
        held=held - 0.5 * float(state.lam @ (bent + model.traces @ state.q)),
        owed=float(state.books[DEBT]),
        force=record.force,
        film=record.film,
    )


def fly_in_network(
    valve: SpatialValve | None,
    parts: Mapping[str, Component],
    *,
    at_tip: tuple[str, ...] = (),
    aside: tuple[str, ...] = (),
    arm: float = 0.0,
    joints: tuple[tuple[str, ...], ...] = (),
    gap: float = 0.0,
    speed: float = 0.0,
    wet: bool = False,
    film: bool = True,
    start: Literal["rest", "free"] = "free",
    state: NetworkState | None = None,
    duration: float,
) -> NetworkResult:
    """A needle over its stop in a network: in space, or along its axis without ``valve``.

    Ports of ``parts`` meet it on its axis, or ``arm`` [m] along x from there; ``joints`` are
    further connections.  ``wet`` has a fluid, and with ``film`` one at the contact.
    """
    rigid = np.diag([MASS**-0.5] * 3 + [J**-0.5 for J in INERTIA])
    tip = rigid[2]
    side = tip - arm * rigid[4]  # u_z = -theta_y x
    body = ReducedBody(
        name="needle",
        mass=MASS,
        omega=np.zeros(6),
        damping=np.zeros(6),
        port_names=("tip", "side"),
        port_shapes=np.column_stack([tip, side]),
        observer_names=(),
        observer_shapes=np.zeros((6, 0)),
        static_compliance=np.full((2, 2), 1e-15),
        rigid_count=6,
        rigid_axial=tip * MASS,
        dof_count=6,
    )
    law = LinearStopLaw(kind="linear", stiffness=STIFFNESS)
    needle = FlexibleBody.of(body if valve is not None else body.along_axis(), speed=speed)
    network = Network(
        {
            "needle": needle,
            "contact": EndStop(gap=gap, law=law, film=FACE if wet and film else None),
        }
        | dict(parts),
        [
            ["needle.tip", "contact.upper", *at_tip],
            ["contact.lower", "ground"],
            *([["needle.side", *aside]] if aside else []),
            *(list(joint) for joint in joints),
        ],
        fluid=library_fluid("n-heptane").at(293.15) if wet else None,
    )
    return simulate_network(
        network.rows(),
        duration=duration,
        step=20e-9,
        record=1e-6,
        start=start,
        state=state,
        spatial=valve,
    )
