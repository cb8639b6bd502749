"""Checks of a needle in space: its films, its guide, and the network that drives it."""

from functools import partial
from math import cos, pi, sin, sqrt, tan

import numpy as np
from scipy.integrate import solve_ivp

from klack.hydraulics.guide_film import guide_film_damping
from klack.hydraulics.tilted_film import sector_film, sector_forces
from klack.mechanics.force import ConstantForce
from klack.mechanics.spring import Spring
from klack.transient.interface_model import InterfaceModel
from klack.transient.interface_run import simulate_interface
from klack.transient.spatial_run import SpatialValve
from klack.verification.check import Check, ComparedCurve, compare
from klack.verification.pulled_needle import pulls
from klack.verification.rigid_needle import (
    FACE,
    INERTIA,
    MASS,
    STIFFNESS,
    Ended,
    fly_in_films,
    fly_in_network,
    guide_of,
    needle_on_cone,
    needle_on_ring,
)
from klack.verification.ring_bodies import NeedleOnRing
from klack.verification.ring_strokes import RingStroke

__all__ = ["checks"]

_check = partial(compare, "off-axis")

_MU, _SUCTION = 4e-4, 1e9  # [Pa s], [N]
_ROW = FACE.film_row(_MU, _SUCTION / FACE.area)
_STEP = 20e-9
_ROUND_OFF = "round-off of thousands of steps"
_LEAN = np.array([0.0, 0.0, 0.0, 4e-4, 6e-4, 0.0])  # [rad]


def checks() -> list[Check]:
    """Films that tilt, films in a guide, drops and starts in a network, magnets, faces, rings."""
    return [
        *_films(),
        *_bearing(),
        *_driven(),
        *_centred(),
        _rest(),
        _energy(),
        *_rubbing(),
        *pulls(),
        *_rings(),
    ]


# ---------------------------------------------------------------------- films


def _coordinates(rigid: np.ndarray) -> np.ndarray:
    """Modal coordinates of a shift and rotation about the centre of mass."""
    return np.asarray(rigid) * np.sqrt([MASS] * 3 + list(INERTIA))


def _squeezed(steps: int, lean: np.ndarray) -> tuple[np.ndarray, Ended]:
    """Fall through the film from 8 um, 6 us; lift and tilts of the face before."""
    model = needle_on_ring(8e-6)
    v = _coordinates(np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0]))
    q = _coordinates(lean)
    ended = fly_in_films(model, _ROW, q, v, step=6e-6 / steps, steps=steps)
    return v, ended


def _films() -> list[Check]:
    before, flat = _squeezed(300, np.zeros(6))
    lift = 8e-6 + flat.q[2] / MASS**0.5
    h0, h1 = 8e-6 + FACE.lowest_height, lift + FACE.lowest_height
    taken = 0.5 * _ROW.cubic * (h1**-2 - h0**-2)
    v, tilted = _squeezed(300, _LEAN)
    times, lifts, ends = _reynolds()
    errors = [
        np.linalg.norm((_squeezed(steps, _LEAN)[1].v - ends)[[2, 3, 4]]) for steps in (150, 300)
    ]
    return [
        _check(
            "momentum that a film of parallel faces takes in time [N s]",
            expected=taken,
            computed=float((flat.v[2] - before[2]) * MASS**0.5),
            tolerance=5e-12,
            source="B/2 (1/h^2 - 1/h0^2); small changes of the force follow its slopes",
        ),
        _check(
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
        _check(
            "the same: tilting rate after 6 us [rad/s]",
            expected=float(ends[4]) / INERTIA[1] ** 0.5,
            computed=float(tilted.v[4]) / INERTIA[1] ** 0.5,
            tolerance=2e-5,
            source="Reynolds' equation, equations of motion by DOP853; order 2 in the step",
        ),
        _check(
            "the same: order in the step",
            expected=2.0,
            computed=float(np.log2(errors[0] / errors[1])),
            tolerance=2e-3,
            source="midpoint rule",
        ),
        _check(
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
        heights = (rows @ (start + Y @ q)).reshape(film.sectors, film.circles)
        closing = -(rows @ (Y @ v)).reshape(film.sectors, film.circles)
        forces = sector_forces(film, heights, closing, viscosity)
        return np.concatenate([v, Y.T @ (rows.T @ forces.ravel())])

    v = _coordinates(np.array([0.0, 0.0, -1.0, 0.0, 0.0, 0.0]))
    begin = np.concatenate([_coordinates(_LEAN), v])
    times = np.linspace(0.0, 6e-6, 31)
    found = solve_ivp(rates, (0.0, 6e-6), begin, "DOP853", times, rtol=1e-10, atol=1e-16)
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
    moved = float(np.linalg.norm(found.y[:6, -1] - q))
    return [
        _check(
            "needle in the film of its guide: way across the axis after 10 us, deviation [-]",
            expected=0.0,
            computed=float(np.linalg.norm(after.q - found.y[:6, -1])) / moved,
            tolerance=2e-5,
            source="short bearings, equations of motion by DOP853; order 2 in the step",
        ),
        _check(
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
    """An eccentric drop under a constant force, as the interface level has it; a force aside."""
    model, tilt = needle_on_ring(5e-6), np.array([0.0, 0.0, 0.0, 0.0, 3e-4, 0.0])
    alone = simulate_interface(
        model, speed=0.3, duration=120e-6, step=_STEP, force=6.0, offset=tilt, flight=False
    )
    valve = SpatialValve(
        model=model, components=("needle",), stops=("contact",), placement=tilt,
        arms=np.array([[0.0, 0.0, -6e-3]]),
    )  # fmt: skip
    driven = fly_in_network(
        valve, {"push": ConstantForce(force=-6.0)}, at_tip=("push.end",),
        gap=5e-6, speed=-0.3, duration=120e-6,
    )  # fmt: skip
    history = alone.history
    arm = 0.8e-3
    free = fly_in_network(
        SpatialValve(
            model=needle_on_ring(1e-2), components=("needle",), stops=("contact",),
            arms=np.array([[0.0, 0.0, -6e-3]]),
        ),
        {"push": ConstantForce(force=2.0)}, aside=("push.end",), arm=arm, gap=1e-2, duration=1e-4,
    )  # fmt: skip
    t = free.time[-1]
    return [
        _check(
            "eccentric drop in a network, peak of the first impact [N]",
            expected=float(history.force.max()),
            computed=driven.events[0].peak_force,
            tolerance=1e-8,
            source="the same drop at the interface level",
        ),
        _check(
            "the same: impulse [N s]",
            expected=float(np.sum(history.force) * _STEP),
            computed=float(np.sum(driven.interfaces["contact"].contact_force) * _STEP),
            tolerance=1e-11,
            source="the same drop at the interface level",
            reason=_ROUND_OFF,
        ),
        _check(
            "force 0.8 mm from the axis: tilt after 100 us [rad]",
            expected=-2.0 * arm / INERTIA[1] * 0.5 * t**2,
            computed=float(free.channels["needle tilt x"].values[-1]),
            tolerance=1e-12,
            source="F r/I",
            reason=_ROUND_OFF,
        ),
    ]


def _centred() -> list[Check]:
    """A centred needle in space against the loop along the axis."""
    push = {"push": ConstantForce(force=-6.0)}
    kind = {"at_tip": ("push.end",), "gap": 5e-6, "speed": -0.5, "duration": 150e-6}
    valve = SpatialValve(
        model=needle_on_ring(5e-6), components=("needle",), stops=("contact",),
        arms=np.array([[0.0, 0.0, -6e-3]]),
    )  # fmt: skip
    axial = fly_in_network(None, push, **kind).events[0]  # type: ignore[arg-type]
    space = fly_in_network(valve, push, **kind).events[0]  # type: ignore[arg-type]
    rate, lean = (STIFFNESS / MASS) ** 0.5, 6.0 / STIFFNESS
    speed = -axial.approach_speed
    exact = (pi + 2.0 * np.arctan(lean * rate / abs(speed))) / rate
    return [
        _check(
            "centred drop in space, peak of the impact [N]",
            expected=axial.peak_force,
            computed=space.peak_force,
            tolerance=1e-4,
            source="the loop along the axis, whose law is in parallel",
        ),
        _check(
            "the same: contact time [s]",
            expected=exact,
            computed=space.contact_time,
            tolerance=2e-3,
            source="half a period of mass and springs and 6 N beside 290 N; steps of 20 ns",
        ),
    ]


def _rest() -> Check:
    """A needle pressed aside stands on its springs as a plate does on an elastic bed."""
    push, arm = 40.0, 0.3e-3
    valve = SpatialValve(
        model=needle_on_ring(), components=("needle",), stops=("contact",),
        arms=np.array([[0.0, 0.0, -6e-3]]),
    )  # fmt: skip
    found = fly_in_network(
        valve, {"push": ConstantForce(force=-push)}, aside=("push.end",), arm=arm,
        start="rest", duration=20e-6,
    )  # fmt: skip
    bed = STIFFNESS * 0.5 * (1.6e-3) ** 2  # of a rotation
    return _check(
        "needle at rest, pressed 0.3 mm from the axis: tilt [rad]",
        expected=push * arm / bed,
        computed=float(found.channels["needle tilt x"].values[-1]),
        tolerance=1e-10,  # round-off, which depends on the order of the points in the factor
        source="M/(k r^2/2): ring of springs, all of them closed",
    )


def _energy() -> Check:
    """Eccentric, in a guide with friction, thrown back by a spring, over five milliseconds."""
    model = needle_on_ring(20e-6)
    valve = SpatialValve(
        model=model, components=("needle",), stops=("contact",),
        guide=guide_of(model, friction=0.1), arms=np.array([[0.0, 0.0, -6e-3]]),
        placement=np.array([0.5e-6, 0.0, 0.0, 0.0, 3e-4, 0.0]),
    )  # fmt: skip
    parts = {"spring": Spring(stiffness=2e4, preload=10.0)}
    found = fly_in_network(
        valve, parts, at_tip=("spring.end",), gap=20e-6, speed=-0.4, duration=2.05e-3
    )
    return _check(
        "eccentric needle with guide, friction and spring over 2 ms, energy residual [-]",
        expected=0.0,
        computed=found.books.relative_residual,
        tolerance=1e-11,
        source="energy",
        reason=_ROUND_OFF,
    )


def _rubbing() -> list[Check]:
    """A needle in a cone whose faces rub: centred, and off its axis in a network."""
    half_angle, mu, stiffer = 0.25 * pi, 0.1, 0.8
    arms = np.array([[0.0, 0.0, -6e-3]])

    def valve(model: InterfaceModel, **more: object) -> SpatialValve:
        given = {"model": model, "components": ("needle",), "stops": ("contact",), "arms": arms}
        return SpatialValve(**(given | more))  # type: ignore[arg-type]

    model = needle_on_cone(half_angle, mu, stiffer=stiffer, gap=5e-6)
    drop = {"gap": 5e-6, "speed": -0.5, "duration": 80e-6}
    centred = fly_in_network(valve(model), {}, **drop)  # type: ignore[arg-type]
    ratio = stiffer / tan(half_angle) / mu
    share = 2.0 * mu * cos(half_angle) / (sin(half_angle) + mu * cos(half_angle))
    lean, turn = np.array([0.0, 0.0, 0.0, 2e-4, 3e-4, 0.0]), np.array([0.1, 0, 0, 0, 2.0, 50.0])
    alone = simulate_interface(
        model, speed=0.5, duration=80e-6, step=_STEP, offset=lean, velocity=turn, flight=False
    )
    driven = fly_in_network(valve(model, placement=lean, velocity=turn), {}, **drop)  # type: ignore[arg-type]
    held = fly_in_network(
        valve(model, placement=lean, guide=guide_of(model, friction=0.1)),
        {"spring": Spring(stiffness=2e4, preload=10.0)}, at_tip=("spring.end",),
        gap=5e-6, speed=-0.4, duration=2e-3,
    )  # fmt: skip
    return [
        _check(
            "needle on a cone with friction 0.1 in a network: restitution [-]",
            expected=sqrt(1.0 - share * (ratio - 1.0) / (ratio + 1.0)),
            computed=centred.events[0].restitution,
            tolerance=2e-5,
            source="springs and sliders at the ring, closed form",
        ),
        _check(
            "the same, tilted and spinning: energy that friction takes [J]",
            expected=alone.energy.friction,
            computed=driven.books.losses["contact friction"],
            tolerance=1e-11,
            source="the same drop at the interface level",
            reason=_ROUND_OFF,
        ),
        _check(
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
    aside = np.array([3e-7, 1.2e-7, 0.0, 5e-5, -3e-5, 0.0])
    stroke = RingStroke(pair=NeedleOnRing(), placement=aside)
    alone = simulate_interface(stroke.model, speed=0.1, duration=90e-6, step=40e-9)
    driven = stroke.fly(speed=0.1, duration=90e-6)
    guide = stroke.guide(clearance=0.6e-6, friction=0.1)
    guided = stroke.fly(speed=0.1, duration=400e-6, guide=guide)
    return [
        _check(
            "half sections off their axis in a network, peak of the first impact [N]",
            expected=float(alone.history.force.max()),
            computed=driven.events[0].peak_force,
            tolerance=1e-9,
            source="the same drop at the interface level",
            reason=_ROUND_OFF,
        ),
        _check(
            "the same in a guide with friction over 0.4 ms, energy residual [-]",
            expected=0.0,
            computed=guided.books.relative_residual,
            tolerance=1e-11,
            source="energy",
            reason=_ROUND_OFF,
        ),
    ]
