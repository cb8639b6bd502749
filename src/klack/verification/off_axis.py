"""A rigid needle in space: films, guide, magnet, and the network that drives it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import cos, hypot, pi, sin, sqrt, tan
from typing import Any, Literal

import numpy as np
from scipy.integrate import solve_ivp

from klack.bodies.reduction.reduced_body import ReducedBody
from klack.contact.friction import Friction
from klack.errors import ConvergenceError
from klack.hydraulics.film import RingFilm
from klack.hydraulics.fluid_library import library_fluid
from klack.hydraulics.guide_film import guide_film_damping
from klack.hydraulics.off_axis_seat import SeatFace, flow_area
from klack.hydraulics.seat_across import SeatPlace
from klack.hydraulics.tilted_film import sector_film, sector_forces
from klack.magnetics.off_axis_gap import eccentric_ring, tilted_ring_face
from klack.magnetics.solenoid import Solenoid
from klack.magnetics.solenoid_parts import ArmatureBore, ParasiticGap, PoleGap
from klack.mechanics.end_stop import EndStop
from klack.mechanics.flexible_body import FlexibleBody
from klack.mechanics.stop_law import LinearStopLaw
from klack.network.component import Component
from klack.network.network import Network
from klack.network.rows import FilmRow
from klack.simulation.network_result import NetworkResult
from klack.simulation.network_run import State as NetworkState
from klack.simulation.network_run import simulate_network
from klack.transient.interface_arrays import DEBT, Films, Guide, Outside, Record, State
from klack.transient.interface_kernel import FAILED, march
from klack.transient.interface_model import InterfaceModel
from klack.transient.interface_run import (
    contact_points,
    modes_of_step,
    simulate_interface,
)
from klack.transient.spatial_run import SpatialValve
from klack.transient.tilting_films import (
    LOST,
    BearingFilm,
    TiltingFilm,
    bend_faces,
    film_arrays,
    film_strain,
)
from klack.verification.benches import component
from klack.verification.check import Check, ComparedCurve, check
from klack.verification.interface_bodies import lateral_guide, rigid_body
from klack.verification.ring_bodies import NeedleOnRing, RingStroke

__all__ = [
    "FACE",
    "INERTIA",
    "MASS",
    "checks",
    "film_of",
    "fly_in_films",
    "fly_in_network",
    "guide_of",
    "held_coil",
    "needle_on_cone",
    "needle_on_ring",
    "pulled_needle",
    "seat_off_axis",
]


MASS, INERTIA = 3e-3, (1.2e-7, 1.2e-7, 2e-8)  # [kg], [kg m^2]
STIFFNESS = 1e8  # [N/m]
FACE = RingFilm(shape="ring", inner_radius=1.3e-3, outer_radius=1.9e-3, cut_off=1e-6)
_RING, _POINTS, _BELOW = 1.6e-3, 24, 6e-3  # of contact points; centre of mass above them [m]


def needle_on_ring(gap: float = 0.0) -> InterfaceModel:
    """Rigid needle over a ring of springs, of :data:`STIFFNESS` in all, so far above [m]."""
    angle = 2.0 * np.pi * np.arange(_POINTS) / _POINTS
    return rigid_body(
        mass=MASS,
        inertia=INERTIA,
        points=np.column_stack(
            [
                np.column_stack([_RING * np.cos(angle), _RING * np.sin(angle)]),
                np.full(_POINTS, -_BELOW),
            ]
        ),
        stiffness=STIFFNESS / _POINTS,
        gap=gap,
    )


def needle_on_cone(
    half_angle: float, friction: float, *, stiffer: float, gap: float = 0.0
) -> InterfaceModel:
    """The same in a rubbing cone: ``stiffer`` springs across the normals over those along.

    Tangents along the meridian, upwards, and round the axis; ``gap`` [m] along it.
    """
    flat, s, c = needle_on_ring(), sin(half_angle), cos(half_angle)
    angle, nothing = 2.0 * np.pi * np.arange(_POINTS) / _POINTS, np.zeros(_POINTS)
    out, up = np.column_stack([np.cos(angle), np.sin(angle), nothing]), np.array([0.0, 0.0, 1.0])

    def rows(way: np.ndarray) -> np.ndarray:
        return way @ flat.rigid[:3] + np.cross(flat.points, way) @ flat.rigid[3:]

    return replace(
        flat,
        traces=rows(s * up - c * out),
        tangents=np.vstack(
            [
                rows(c * up + s * out),
                rows(np.column_stack([-np.sin(angle), np.cos(angle), nothing])),
            ]
        ),
        compliance=np.asarray(
            np.kron(np.diag([1.0, 1.0 / stiffer, 1.0 / stiffer]), flat.compliance), dtype=np.float64
        ),
        gap=np.full(_POINTS, s * gap),
        axial=np.full(_POINTS, s),
        axial_across=np.concatenate([np.full(_POINTS, c), nothing]),
        friction=(Friction.coulomb(friction),),
    )


def needle_valve(model: InterfaceModel, **more: Any) -> SpatialValve:
    """The needle at its stop in a network, tip 6 mm below its centre of mass."""
    return SpatialValve(
        model=model,
        components=("needle",),
        stops=("contact",),
        arms=np.array([[0.0, 0.0, -_BELOW]]),
        **more,
    )


def guide_of(model: InterfaceModel, *, clearance: float = 3e-6, friction: float = 0.0) -> Guide:
    """Guide of a shaft of 1.5 mm radius at two heights."""
    return lateral_guide(
        model, clearance=clearance, stiffness=2e8, heights=(-2e-3, 5e-3),
        offset=((0.0, 0.0), (0.0, 0.0)), friction=friction, radius=1.5e-3,
    )  # fmt: skip


def film_of(model: InterfaceModel, *, sectors: int = 36) -> TiltingFilm:
    """Film of :data:`FACE` at the ring of contact points."""
    return TiltingFilm(
        stop="contact",
        land=sector_film(FACE.inner_radius, FACE.outer_radius, sectors=sectors, circles=2),
        cubic=FACE.coefficients()[0],
        slope=1.0,
        fit=np.linalg.pinv(np.column_stack([np.ones(model.count), model.points[:, :2]])),
        base=np.zeros(3),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Ended:
    """Coordinates, velocities and energies [J] after a motion.

    Lost in films, held by bulk and contact, and owed by the contact; mean axial forces of contact
    and films, step by step.
    """

    q: np.ndarray
    v: np.ndarray
    lost: float
    held: float
    owed: float
    force: np.ndarray
    film: np.ndarray


def fly_in_films(
    model: InterfaceModel,
    row: FilmRow | None,
    q: np.ndarray,
    v: np.ndarray,
    *,
    step: float,
    steps: int,
    guide: Guide | None = None,
    bearing: tuple[np.ndarray, np.ndarray] | None = None,
    sectors: int = 36,
    series: float = 0.0,
) -> Ended:
    """Motion in a film at the contact, or films in the guide, alone.

    ``series`` is the compliance [m/N] of the bulk under film and contact.
    """
    none = np.zeros(0)
    films: Films = film_arrays(
        model,
        [film_of(model, sectors=sectors)] if row is not None else [],
        {"contact": row} if row is not None else {},
        {"contact": series},
        *(bearing or (none, none)),
    )
    bore = Guide.none(model.mode_count) if guide is None else guide
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
    _, status = march(
        steps,
        0,
        modes,
        Outside(0.0, 0.0),
        contact_points(model, modes.B1, step),
        bore,
        films,
        state,
        record,
    )
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

    Ports of ``parts`` meet it on its axis, or ``arm`` [m] along x; ``joints`` are further
    connections. ``wet`` has a fluid, with ``film`` also at the contact.
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
    needle = FlexibleBody.of(body if valve is not None else body.along_axis(), speed=speed)
    network = Network(
        {
            "needle": needle,
            "contact": EndStop(
                gap=gap,
                law=LinearStopLaw(kind="linear", stiffness=STIFFNESS),
                film=FACE if wet and film else None,
            ),
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


_MU, _SUCTION = 4e-4, 1e9  # [Pa s], [N]
_ROW = FACE.film_row(_MU, _SUCTION / FACE.area)
_STEP = 20e-9
_ROUND_OFF = "round-off of thousands of steps"
_LEAN = np.array([0.0, 0.0, 0.0, 4e-4, 6e-4, 0.0])  # [rad]


def checks() -> list[Check]:
    """Return the checks."""
    return [
        *_films(),
        *_bearing(),
        *_driven(),
        *_centred(),
        _rest(),
        _energy(),
        *_rubbing(),
        *_aside(),
        _tilted(),
        _seat(),
        *_rings(),
    ]


# ---------------------------------------------------------------------- films


def _coordinates(rigid: np.ndarray) -> np.ndarray:
    """Modal coordinates of a shift and rotation about the centre of mass."""
    return np.asarray(rigid) * np.sqrt([MASS] * 3 + list(INERTIA))


def _squeezed(steps: int, lean: np.ndarray) -> tuple[np.ndarray, Ended]:
    """Fall through the film from 8 um, 6 us; lift and tilts before."""
    v = _coordinates(np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0]))
    ended = fly_in_films(
        needle_on_ring(8e-6), _ROW, _coordinates(lean), v, step=6e-6 / steps, steps=steps
    )
    return v, ended


def _films() -> list[Check]:
    before, flat = _squeezed(300, np.zeros(6))
    lift = 8e-6 + flat.q[2] / MASS**0.5
    h0, h1 = 8e-6 + FACE.lowest_height, lift + FACE.lowest_height
    v, tilted = _squeezed(300, _LEAN)
    times, lifts, ends = _reynolds()
    errors = [
        np.linalg.norm((_squeezed(steps, _LEAN)[1].v - ends)[[2, 3, 4]]) for steps in (150, 300)
    ]
    return [
        check(
            "momentum that a film of parallel faces takes in time [N s]",
            expected=0.5 * _ROW.cubic * (h1**-2 - h0**-2),
            computed=float((flat.v[2] - before[2]) * MASS**0.5),
            tolerance=5e-12,
            source="B/2 (1/h^2 - 1/h0^2); small changes of the force follow its slopes",
        ),
        check(
            "needle that tilts into its film: speed after 6 us [m/s]",
            expected=float(ends[2]) / MASS**0.5,
            computed=float(tilted.v[2]) / MASS**0.5,
            tolerance=5e-7,
            source="Reynolds' equation, equations of motion by DOP853; order 2 in the step",
            curve=ComparedCurve(
                x_label="time [us]",
                y_label="lift of the middle of the face [um]",
                expected=(1e6 * times, 1e6 * lifts),
                computed=_lifts(),
            ),
        ),
        check(
            "the same: tilting rate after 6 us [rad/s]",
            expected=float(ends[4]) / INERTIA[1] ** 0.5,
            computed=float(tilted.v[4]) / INERTIA[1] ** 0.5,
            tolerance=2e-5,
            source="Reynolds' equation, equations of motion by DOP853; order 2 in the step",
        ),
        check(
            "the same: order in the step",
            expected=2.0,
            computed=float(np.log2(errors[0] / errors[1])),
            tolerance=2e-3,
            source="midpoint rule",
        ),
        check(
            "the same: loss of the film over the energy that the needle loses [-]",
            expected=1.0,
            computed=tilted.lost / float(0.5 * v @ v - 0.5 * tilted.v @ tilted.v),
            tolerance=1e-11,
            source="energy",
            reason=_ROUND_OFF,
        ),
    ]


def _lifts() -> tuple[np.ndarray, np.ndarray]:
    counts = np.arange(0, 301, 30)
    model, v = needle_on_ring(8e-6), _coordinates(np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0]))
    lifts = [8e-6]
    for steps in counts[1:]:
        ended = fly_in_films(model, _ROW, _coordinates(_LEAN), v, step=_STEP, steps=int(steps))
        lifts.append(8e-6 + float(ended.q[2]) / MASS**0.5)
    return 1e6 * _STEP * counts, 1e6 * np.array(lifts)


def _reynolds() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, lifts, and modal velocities after 6 us of the equations of motion."""
    film = sector_film(FACE.inner_radius, FACE.outer_radius, sectors=36, circles=2)
    rows = film.rows()
    viscosity = _ROW.cubic / FACE.coefficients()[0]
    # lift and slopes of the face per modal coordinate: u_z = z + theta_x y - theta_y x
    Y = np.zeros((3, 6))
    Y[0, 2], Y[1, 4], Y[2, 3] = MASS**-0.5, -(INERTIA[1] ** -0.5), INERTIA[0] ** -0.5
    start = np.array([8e-6 + FACE.lowest_height, 0.0, 0.0])

    def rates(_: float, state: np.ndarray) -> np.ndarray:
        q, v = state[:6], state[6:]
        forces = sector_forces(
            film,
            (rows @ (start + Y @ q)).reshape(film.sectors, film.circles),
            -(rows @ (Y @ v)).reshape(film.sectors, film.circles),
            viscosity,
        )
        return np.concatenate([v, Y.T @ (rows.T @ forces.ravel())])

    v = _coordinates(np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0]))
    times = np.linspace(0.0, 6e-6, 31)
    found = solve_ivp(
        rates,
        (0.0, 6e-6),
        np.concatenate([_coordinates(_LEAN), v]),
        "DOP853",
        times,
        rtol=1e-10,
        atol=1e-16,
    )
    return times, 8e-6 + found.y[2] / MASS**0.5, found.y[6:, -1]


# ---------------------------------------------------------------------- guide


def _bearing() -> list[Check]:
    """Free flight across the axis in the films of a guide at two heights."""
    model = needle_on_ring(1e-3)
    guide, clearance = guide_of(model), 3e-6
    room = np.full(2, clearance + 0.3e-6)
    strength = np.full(2, _MU * (2e-3) ** 3 * 1.5e-3) / room**2
    q = _coordinates(np.array([1e-6, -0.5e-6, 0.0, 1e-4, 0.0, 0.0]))
    v = _coordinates(np.array([0.05, 0.1, 0.0, 0.0, 10.0, 0.0]))

    def rates(_: float, state: np.ndarray) -> np.ndarray:
        q, v = state[:6], state[6:]
        push = np.zeros(6)
        for k in range(2):
            x, y = guide.traces[k] @ q / room[k]
            C = guide_film_damping(x, y) * strength[k] / room[k]
            push -= guide.traces[k].T @ (C @ (guide.traces[k] @ v))
        return np.concatenate([v, push])

    found = solve_ivp(rates, (0.0, 1e-5), np.concatenate([q, v]), "DOP853", rtol=1e-11, atol=1e-16)
    after = fly_in_films(
        model, None, q, v, step=_STEP, steps=500, guide=guide, bearing=(strength, room)
    )
    return [
        check(
            "needle in the film of its guide: way across the axis after 10 us, deviation [-]",
            expected=0.0,
            computed=float(np.linalg.norm(after.q - found.y[:6, -1]))
            / float(np.linalg.norm(found.y[:6, -1] - q)),
            tolerance=2e-5,
            source="short bearings, equations of motion by DOP853; order 2 in the step",
        ),
        check(
            "the same: loss of the film over the energy that the needle loses [-]",
            expected=1.0,
            computed=after.lost / float(0.5 * v @ v - 0.5 * after.v @ after.v),
            tolerance=1e-11,
            source="energy",
            reason=_ROUND_OFF,
        ),
    ]


# ---------------------------------------------------------------------- network


def _driven() -> list[Check]:
    """An eccentric drop under a constant force, as of the interface level; a force aside."""
    model, tilt = needle_on_ring(5e-6), np.array([0.0, 0.0, 0.0, 0.0, 3e-4, 0.0])
    alone = simulate_interface(
        model, speed=0.3, duration=120e-6, step=_STEP, force=6.0, offset=tilt, flight=False
    )
    valve = needle_valve(
        model, placement=tilt,
    )  # fmt: skip
    driven = fly_in_network(
        valve, {"push": component("constant-force", force=-6.0)}, at_tip=("push.end",),
        gap=5e-6, speed=-0.3, duration=120e-6,
    )  # fmt: skip
    history = alone.history
    arm = 0.8e-3
    free = fly_in_network(
        needle_valve(needle_on_ring(1e-2)),
        {"push": component("constant-force", force=2.0)},
        aside=("push.end",),
        arm=arm,
        gap=1e-2,
        duration=1e-4,
    )
    return [
        check(
            "eccentric drop in a network, peak of the first impact [N]",
            expected=float(history.force.max()),
            computed=driven.events[0].peak_force,
            tolerance=1e-8,
            source="the same drop at the interface level",
        ),
        check(
            "the same: impulse [N s]",
            expected=float(np.sum(history.force) * _STEP),
            computed=float(np.sum(driven.interfaces["contact"].contact_force) * _STEP),
            tolerance=1e-11,
            source="the same drop at the interface level",
            reason=_ROUND_OFF,
        ),
        check(
            "force 0.8 mm from the axis: tilt after 100 us [rad]",
            expected=-2.0 * arm / INERTIA[1] * 0.5 * free.time[-1] ** 2,
            computed=float(free.channels["needle tilt x"].values[-1]),
            tolerance=1e-12,
            source="F r/I",
            reason=_ROUND_OFF,
        ),
    ]


def _centred() -> list[Check]:
    """A centred needle in space against the loop along the axis."""
    push = {"push": component("constant-force", force=-6.0)}
    kind = {"at_tip": ("push.end",), "gap": 5e-6, "speed": -0.5, "duration": 150e-6}
    valve = needle_valve(
        needle_on_ring(5e-6),
    )  # fmt: skip
    axial = fly_in_network(None, push, **kind).events[0]  # type: ignore[arg-type]
    space = fly_in_network(valve, push, **kind).events[0]  # type: ignore[arg-type]
    rate, lean = (STIFFNESS / MASS) ** 0.5, 6.0 / STIFFNESS
    return [
        check(
            "centred drop in space, peak of the impact [N]",
            expected=axial.peak_force,
            computed=space.peak_force,
            tolerance=1e-4,
            source="the loop along the axis, whose law is in parallel",
        ),
        check(
            "the same: contact time [s]",
            expected=(pi + 2.0 * np.arctan(lean * rate / abs(-axial.approach_speed))) / rate,
            computed=space.contact_time,
            tolerance=2e-3,
            source="half a period of mass and springs and 6 N beside 290 N; steps of 20 ns",
        ),
    ]


def _rest() -> Check:
    """A needle pressed aside: a plate on an elastic bed."""
    push, arm = 40.0, 0.3e-3
    valve = needle_valve(
        needle_on_ring(),
    )  # fmt: skip
    found = fly_in_network(
        valve, {"push": component("constant-force", force=-push)}, aside=("push.end",), arm=arm,
        start="rest", duration=20e-6,
    )  # fmt: skip
    bed = STIFFNESS * 0.5 * (1.6e-3) ** 2  # of a rotation
    return check(
        "needle at rest, pressed 0.3 mm from the axis: tilt [rad]",
        expected=push * arm / bed,
        computed=float(found.channels["needle tilt x"].values[-1]),
        tolerance=1e-10,  # round-off, which depends on the order of the points in the factor
        source="M/(k r^2/2): ring of springs, all of them closed",
    )


def _energy() -> Check:
    """Eccentric, in a guide with friction, thrown back by a spring, over five milliseconds."""
    model = needle_on_ring(20e-6)
    valve = needle_valve(
        model, guide=guide_of(model, friction=0.1),
        placement=np.array([0.5e-6, 0.0, 0.0, 0.0, 3e-4, 0.0]),
    )  # fmt: skip
    found = fly_in_network(
        valve,
        {"spring": component("spring", stiffness=2e4, preload=10.0)},
        at_tip=("spring.end",),
        gap=20e-6,
        speed=-0.4,
        duration=2.05e-3,
    )
    return check(
        "eccentric needle with guide, friction and spring over 2 ms, energy residual [-]",
        expected=0.0,
        computed=found.books.relative_residual,
        tolerance=1e-11,
        source="energy",
        reason=_ROUND_OFF,
    )


def _rubbing() -> list[Check]:
    """A needle in a rubbing cone: centred, and off-axis in a network."""
    half_angle, mu, stiffer = 0.25 * pi, 0.1, 0.8

    model = needle_on_cone(half_angle, mu, stiffer=stiffer, gap=5e-6)
    drop = {"gap": 5e-6, "speed": -0.5, "duration": 80e-6}
    centred = fly_in_network(needle_valve(model), {}, **drop)  # type: ignore[arg-type]
    ratio = stiffer / tan(half_angle) / mu
    share = 2.0 * mu * cos(half_angle) / (sin(half_angle) + mu * cos(half_angle))
    lean, turn = np.array([0.0, 0.0, 0.0, 2e-4, 3e-4, 0.0]), np.array([0.1, 0, 0, 0, 2.0, 50.0])
    alone = simulate_interface(
        model, speed=0.5, duration=80e-6, step=_STEP, offset=lean, velocity=turn, flight=False
    )
    driven = fly_in_network(needle_valve(model, placement=lean, velocity=turn), {}, **drop)  # type: ignore[arg-type]
    held = fly_in_network(
        needle_valve(model, placement=lean, guide=guide_of(model, friction=0.1)),
        {"spring": component("spring", stiffness=2e4, preload=10.0)}, at_tip=("spring.end",),
        gap=5e-6, speed=-0.4, duration=2e-3,
    )  # fmt: skip
    return [
        check(
            "needle on a cone with friction 0.1 in a network: restitution [-]",
            expected=sqrt(1.0 - share * (ratio - 1.0) / (ratio + 1.0)),
            computed=centred.events[0].restitution,
            tolerance=2e-5,
            source="springs and sliders at the ring, closed form",
        ),
        check(
            "the same, tilted and spinning: energy that friction takes [J]",
            expected=alone.energy.friction,
            computed=driven.books.losses["contact friction"],
            tolerance=1e-11,
            source="the same drop at the interface level",
            reason=_ROUND_OFF,
        ),
        check(
            "the same with guide and spring over 2 ms, energy residual [-]",
            expected=0.0,
            computed=held.books.relative_residual,
            tolerance=1e-11,
            source="energy",
            reason=_ROUND_OFF,
        ),
    ]


def _rings() -> list[Check]:
    """Half sections that move in all Fourier orders, in a network."""
    stroke = RingStroke(
        pair=NeedleOnRing(), placement=np.array([3e-7, 1.2e-7, 0.0, 5e-5, -3e-5, 0.0])
    )
    alone = simulate_interface(stroke.model, speed=0.1, duration=90e-6, step=40e-9)
    driven = stroke.fly(speed=0.1, duration=90e-6)
    guided = stroke.fly(
        speed=0.1, duration=400e-6, guide=stroke.guide(clearance=0.6e-6, friction=0.1)
    )
    return [
        check(
            "half sections off their axis in a network, peak of the first impact [N]",
            expected=float(alone.history.force.max()),
            computed=driven.events[0].peak_force,
            tolerance=1e-9,
            source="the same drop at the interface level",
            reason=_ROUND_OFF,
        ),
        check(
            "the same in a guide with friction over 0.4 ms, energy residual [-]",
            expected=0.0,
            computed=guided.books.relative_residual,
            tolerance=1e-11,
            source="energy",
            reason=_ROUND_OFF,
        ),
    ]


_RADIUS, _CLEARANCE, _LENGTH = 5e-3, 100e-6, 3.5e-3
_INNER, _OUTER, _GAP, _LEFT = 2e-3, 3.3e-3, 100e-6, 50e-6
_ROUND_OFF_PULLED = "round-off of sums over hundreds of steps"


def held_coil(bore: ArmatureBore | None, *, tilts: bool = False, current: float = 5.0) -> Solenoid:
    """Coil of steady current, one working gap and one ring around its armature."""
    return Solenoid(
        turns=60,
        resistance=0.6,
        gap=_GAP,
        residual_gap=_LEFT,
        poles=(PoleGap(inner_radius=_INNER, outer_radius=_OUTER, fringing="none", tilts=tilts),),
        parasitic=(
            ParasiticGap(radius=_RADIUS, clearance=_CLEARANCE, length=_LENGTH, off_axis=bore),
        ),
        start_current=current,
    )


def pulled_needle(
    coil: Solenoid,
    placement: tuple[float, ...],
    duration: float,
    *,
    guided: bool = False,
    held: bool = True,
) -> NetworkResult:
    """A needle in the field of a coil whose armature port is ``held``: its flux is constant.

    Else the coil pulls along z as well, 2 mm from the axis. ``guided``: with a film; else free.
    """
    below = 1e-2 if held else 1e-3  # to the stop
    model = needle_on_ring(below)
    valve = needle_valve(
        model, placement=np.array(placement),
        guide=guide_of(model, clearance=4e-6, friction=0.1) if guided else None,
        bearing=BearingFilm(length=1e-3, cut_off=0.3e-6) if guided else None,
    )  # fmt: skip
    driver = component("voltage-step", voltage=coil.resistance * coil.start_current, end=1.0)
    return fly_in_network(
        valve,
        {"coil": coil, "driver": driver},
        aside=() if held else ("coil.armature",),
        arm=2e-3,
        joints=(
            *((("coil.armature", "ground"),) if held else ()),
            ("coil.terminals", "driver.terminals"),
        ),
        gap=below,
        wet=guided,
        film=False,
        duration=duration,
    )


def seat_off_axis(
    placement: tuple[float, ...],
    *,
    follows: bool = True,
    velocity: tuple[float, ...] = (0.0,) * 6,
    duration: float = 20e-6,
    state: NetworkState | None = None,
) -> NetworkResult:
    """A ball 60 um over its edge at 5 bar, the needle at a placement, free to move."""
    seat = component("seat", 
        shape="ball", diameter=1.768e-3, ball_diameter=2.5e-3, lift=60e-6,
        off_axis=SeatPlace(height=-6e-3) if follows else None,
    )  # fmt: skip
    valve = needle_valve(
        needle_on_ring(1e-2), placement=np.array(placement), velocity=np.array(velocity),
    )  # fmt: skip
    return fly_in_network(
        valve,
        {"restriction": seat, "supply": component("pressure-source", pressure=6.013e5)},
        at_tip=("restriction.needle",),
        joints=(("supply.fluid", "restriction.a"), ("restriction.b", "ambient")),
        gap=1e-2,
        wet=True,
        film=False,
        state=state,
        duration=duration,
    )


def _aside() -> list[Check]:
    run = pulled_needle(held_coil(ArmatureBore(height=0.0)), (4e-6, -3e-6, 0, 0, 0, 0), 350e-6)
    assert run.path is not None
    flux = float(run.channels["coil flux"].values[-1])
    first, last = (hypot(*run.path.position[k, :2]) for k in (0, -1))
    (P0, _), (P1, slope) = (
        eccentric_ring(_RADIUS, _RADIUS + _CLEARANCE, _LENGTH, e) for e in (first, last)
    )
    speed = hypot(*run.path.velocity[-1, :2])
    force = hypot(*(run.channels[f"coil side force {a}"].values[-1] for a in "xy"))
    return [
        check(
            "needle pulled aside by a magnet, 5 to 16 um in 0.35 ms, kinetic energy [J]",
            expected=0.5 * flux**2 * float(1.0 / P0 - 1.0 / P1),
            computed=0.5 * MASS * speed**2,
            tolerance=3e-5,
            source="loss of magnetic energy of an eccentric ring at constant flux (Smythe); steps "
            "of 1.28 us",
        ),
        check(
            "the same: force across the axis at the end [N]",
            expected=float(0.5 * flux**2 / P1**2 * slope),
            computed=force,
            tolerance=1e-12,
            source="slope of that energy",
            reason=_ROUND_OFF_PULLED,
        ),
        check(
            "the same: work of the side force over the kinetic energy [-]",
            expected=1.0,
            computed=run.books.supplies["coil side force"] / (0.5 * MASS * speed**2),
            tolerance=1e-12,
            source="energy",
            reason=_ROUND_OFF_PULLED,
        ),
    ]


def _tilted() -> Check:
    run = pulled_needle(held_coil(None, tilts=True), (0, 0, 0, 0, 1e-3, 0), 300e-6)
    assert run.path is not None
    flux = float(run.channels["coil flux"].values[-1])
    first, last = (hypot(*run.path.position[k, 3:5]) for k in (0, -1))
    P0, P1 = (tilted_ring_face(_INNER, _OUTER, _GAP + _LEFT, t)[0] for t in (first, last))
    return check(
        "needle tilted by a working gap from 1 mrad on, kinetic energy after 0.3 ms [J]",
        expected=0.5 * flux**2 * float(1.0 / P0 - 1.0 / P1),
        computed=0.5 * INERTIA[1] * float(run.path.velocity[-1, 4]) ** 2,
        tolerance=3e-5,
        source="loss of magnetic energy of a tilted ring face at constant flux; steps of 1.28 us",
    )


def _seat() -> Check:
    run = seat_off_axis((20e-6, -10e-6, 0, 2e-3, 1e-3, 0))
    assert run.path is not None
    x, y, rise, turn_x, turn_y, _ = run.path.position[-1]
    offset = (x - 6e-3 * turn_y, y + 6e-3 * turn_x)
    face = SeatFace(shape="ball", radius=0.884e-3, angle=float(np.arccos(0.884 / 1.25)))
    return check(
        "seat of a tilted needle 20 um off-axis in a network, flow area [m^2]",
        expected=flow_area(face, [60e-6 + rise, *offset, -turn_y, turn_x]),
        computed=float(run.channels["restriction area"].values[-1]),
        tolerance=1e-7,
        source="mantle between edge and ball, at the end of a step that takes its middle",
    )
