"""Impacts at the interface level: the model, the compiled step, and the flight in between.

Around an impact steps are fine.  Far from it the exact propagator jumps as far as no gap can close
(:func:`klack.transient.interface_kernel.safe_flight`) and the guide allows.  Before each impact the
gaps can be taken from the geometry at the present placement, so that tilt and eccentricity may grow
over many bounces while each impact stays linear.
"""

from collections.abc import Callable
from math import ceil
from time import perf_counter

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from klack.contact.history import BodyEnergy, EnergyLedger, ImpactHistory
from klack.contact.statics import ReachError
from klack.errors import ConvergenceError, refuse_if, require_nonnegative, require_positive
from klack.simulation import energy_balance
from klack.simulation.finite import require_finite
from klack.simulation.propagator import damping_loss, modal_propagator
from klack.transient.closed_rings import rings_of
from klack.transient.interface_arrays import (
    CONTACT_STEPS,
    DAMPING,
    DEBT,
    DIRECTION,
    FRICTION,
    GUIDE,
    GUIDE_STRAIN,
    LAYER,
    OPEN_STEPS,
    PLASTIC,
    ROUNDS,
    WORK,
    ActiveSet,
    ContactPoints,
    Grip,
    Guide,
    Layer,
    Limit,
    Modes,
    Near,
    Outside,
    Pressed,
    Record,
    Rubbing,
    State,
    Worn,
)
from klack.transient.interface_kernel import (
    FAILED,
    OPEN,
    TURNED,
    contact_compliance,
    march,
    safe_flight,
)
from klack.transient.interface_model import InterfaceModel
from klack.transient.interface_result import (
    ImpactSegment,
    InterfaceEnergy,
    InterfaceResult,
    RigidMotion,
)
from klack.transient.placed_bodies import (
    SCALE,
    modal_energy,
    rigid_coordinates,
    shaft_pressed,
    surely_unguided,
)
from klack.transient.rough_points import layer_energy, solve_rough

__all__ = ["Gaps", "contact_points", "modes_of_step", "near_points", "simulate_interface"]

Gaps = Callable[[NDArray[np.float64]], NDArray[np.float64]]
"""Exact gaps (nc,) [m] at a rigid placement of the moving body (6,) [m], [rad]."""

_BALANCE = 1e-3  # energy residual that a run keeps at its usual step
_CHUNK = 500
_CLUSTER_TIME = 50e-6  # open for so long ends an impact [s]
_DOUBLINGS = 9  # of the fine step in flight
_GUIDED_DOUBLINGS = 0  # a shaft meets its stiff bore for a microsecond or two only
_FLIGHT_CHUNK = 20e-6  # [s]
_NEAR = 8.0  # fine steps before a possible touch
_FAR = 200.0  # fine steps that end a segment without a touch
_STALE_SHARE = 0.25  # of the way since the gaps were taken: what they may be wrong by
_FRESH = 0.04e-6  # gaps as good as new [m]
_WARY_SHARE = 0.25  # of the safe time, while the guide may kick
_RIM_RESERVE = 1.1


def simulate_interface(
    model: InterfaceModel,
    *,
    speed: float,
    duration: float,
    step: float = 40e-9,
    force: float = 0.0,
    spring_stiffness: float = 0.0,
    guide: Guide | None = None,
    offset: NDArray[np.float64] | None = None,
    velocity: NDArray[np.float64] | None = None,
    height: float | None = None,
    gaps: Gaps | None = None,
    flight: bool = False,
    impacts: int | None = None,
    points: bool = True,
    worn: NDArray[np.float64] | None = None,
    progress: Callable[[float], None] | None = None,
) -> InterfaceResult:
    """Simulate the moving body in -z through one or several impacts.

    Parameters
    ----------
    speed [m/s]
        Of approach.
    duration [s]
    step [s]
        Around impacts; about one 500th of the contact time.
    force [N]
        Constant, presses the moving body towards -z (closing), spread over it like its weight.
    spring_stiffness [N/m]
        Of a spring that pulls the centre of mass back to its start; its preload belongs to
        ``force``.
    offset (6,) [m], [rad]
        Rigid placement of the moving body, from that of the meshes: translation of the centre of
        mass and rotation vector.
    velocity (6,) [m/s], [rad/s]
        Besides ``speed``.
    height [m]
        Start this far above first touch; by default where the offset puts the body.
    gaps
        Used before every impact; without it the gaps stay linear in the placement.
    flight
        Jump over free flight; the result then has one segment per impact.
    impacts
        Stop after so many; with ``flight`` only.
    points
        Keep the force of every contact point.
    worn (nc,) [m]
        Set of the contact points by earlier impacts, of a model whose points yield.
    progress
        Called with the fraction done.

    Raises
    ------
    InputError
        Bad numbers; a contact that grows to the border of the candidate points.
    ConvergenceError
        When contact forces are not found.

    Warns
    -----
    AccuracyWarning
        When the energy balance does not close to 1e-3 (:mod:`klack.simulation.energy_balance`).
    """
    require_nonnegative("simulate_interface: speed", speed, "m/s")
    require_positive("simulate_interface: duration", duration, "s")
    require_positive("simulate_interface: step", step, "s")
    begin = perf_counter()
    with threadpool_limits(limits=1, user_api="blas"):
        run = _Run(model, step, force, spring_stiffness, guide, gaps, points, worn)
        run.place(offset, velocity, speed, height)
        run.go(duration, flight, impacts, progress)
    result = run.result(perf_counter() - begin)
    energy_balance.check_energy_balance(
        "simulate_interface",
        result.energy.residual,
        result.energy.least_loss,
        limit=_BALANCE,
        advice="a shorter step",
    )
    return result


def contact_points(
    model: InterfaceModel, B1: NDArray[np.float64], step: float, spring: float = 0.0
) -> ContactPoints:
    """Points of the compiled step, with the gaps of the model.

    Parameters
    ----------
    B1 (M,)
        Of the propagator of this step.
    step [s]
    spring [N/m]
        Of a spring that holds the moving body.

    Raises
    ------
    InputError
        For a layer of asperities beside friction, yield or a second contact.
    """
    _require_layer_alone(model)
    push = np.ascontiguousarray(model.rigid[2])
    counts = [last - first for _, first, last in model.contacts]
    stop = np.repeat(np.arange(len(counts)), counts)
    if not model.ways:
        A = contact_compliance(model.compliance, model.traces, B1, push, spring)
        laws = None, _limit(model), _layer(model)
        return ContactPoints(A, model.traces, model.gap, model.axial, stop, *laws)
    rows = np.vstack([model.traces, model.tangents])
    static, kinetic, fade = np.repeat(
        [(f.static, f.kinetic, f.speed * step) for f in model.friction], counts, axis=0
    ).T
    A = contact_compliance(model.compliance, rows, B1, push, spring)
    return ContactPoints(
        A,
        model.traces,
        model.gap,
        model.axial,
        stop,
        Grip(
            model.tangents,
            model.axial_across,
            np.ascontiguousarray(static),
            np.ascontiguousarray(kinetic),
            np.ascontiguousarray(fade),
            rings_of(A, model.angles),
        ),
    )


def near_points(model: InterfaceModel, rigid: int) -> Near:
    """Memory for those points that may close within a few steps.

    Parameters
    ----------
    rigid
        Rigid modes of the needle, the first ones.
    """
    n, M = model.traces.shape
    parts = model.traces[:, :rigid], model.traces[:, rigid:]
    motion = [np.linalg.norm(part, axis=1).max(initial=0.0) for part in parts]
    pulled = max(-float(np.min(model.compliance, initial=0.0)), 0.0)
    return Near(
        *(np.zeros(n * n), np.zeros(n * M), np.zeros(n, np.int64), np.zeros(n, np.int64)),
        *(np.zeros(2), np.zeros(n), np.array([*motion, pulled]), rigid),
        float(np.max(np.abs(model.points[:, :2]), initial=0.0)),
    )


def _limit(model: InterfaceModel) -> Limit | None:
    """Pressure limit of the points of one contact; others stay elastic."""
    if model.limit is None:
        return None
    area = np.full(model.count, np.inf)
    first, last = model.contacts[0][1:]
    area[first:last] = model.area[first:last]
    law = model.limit
    return Limit(area, law.set, law.pressure, law.softness)


def _require_layer_alone(model: InterfaceModel) -> None:
    others = {
        "friction": bool(model.ways),
        "points that yield": model.limit is not None,
        "a second contact": len(model.contacts) > 1,
    }
    beside = next((name for name, is_there in others.items() if is_there), None)
    refuse_if(
        model.layer is not None and beside is not None,
        "interface level: layer",
        got=f"a layer of asperities and {beside}",
        expected="one of them",
        hint="set the layer of the model to None, or remove the other feature.",
    )


def _layer(model: InterfaceModel) -> Layer | None:
    law = model.layer
    if law is None:
        return None
    return Layer(model.area, law.closure, law.pressure, law.state(law.closure)[2])


def modes_of_step(model: InterfaceModel, step: float) -> Modes:
    """Everything that depends on the length of the step."""
    P = modal_propagator(model.omega, model.damping, step)
    loss = np.zeros((0, model.mode_count))
    if np.any(model.damping > 0):
        loss = damping_loss(model.omega, model.damping, step)
    push = np.ascontiguousarray(model.rigid[2])
    return Modes(P.A11, P.A12, P.A21, P.A22, P.B1, P.B2, loss, push, model.drift, step)


class _Segment:
    def __init__(self, run: "_Run") -> None:
        self.time = run.time
        self.ledger = run.ledger_start()
        self.position, self.velocity = run.rigid_state()
        self.drift = [run.model.drift @ run.v]
        self.parts: list[tuple[NDArray[np.float64], ...]] = []
        self.point_force: list[NDArray[np.float32]] = []
        self.friction_force: list[NDArray[np.float32]] = []
        self.doing: list[NDArray[np.int8]] = []
        self.pressed: list[NDArray[np.float64]] = []
        self.contact_steps = run.books[CONTACT_STEPS]

    @property
    def steps(self) -> int:
        return sum(len(part[0]) for part in self.parts)


class _Run:
    def __init__(
        self,
        model: InterfaceModel,
        step: float,
        force: float,
        spring: float,
        guide: Guide | None,
        gaps: Gaps | None,
        points: bool,
        worn: NDArray[np.float64] | None,
    ) -> None:
        self.model, self.step, self.guide, self.gaps, self.points = model, step, guide, gaps, points
        self.constant, self.spring = -force, spring
        n, M = model.count, model.mode_count
        self.steppers: dict[int, Modes] = {}
        B1, self.push = self.stepper(0).B1, self.stepper(0).push
        self.contact = contact_points(model, B1, step, spring)
        self.rigid_count = int(np.sum((model.owner == 0) & (model.omega == 0)))
        self.gap0 = np.array(model.gap)
        below = model.axial > 1e-6
        self.clearance = max(
            0.0, float(np.min(model.gap[below] / model.axial[below], initial=np.inf))
        )
        self.bore = Guide.none(M) if guide is None else guide
        yields = model.limit is not None
        rough = model.layer is not None
        heights = len(self.bore.clearance)
        self.state = State.still(M, n, heights, model.ways, yields=yields, rough=rough)
        if worn is not None and yields:
            self.state.worn.set[:] = worn
        self.q, self.v, self.books = self.state.q, self.state.v, self.state.books
        self.in_flight = self.state._replace(
            lam=np.zeros(0),
            contact=ActiveSet.none(0),
            rubbing=Rubbing.none(0, 0),
            worn=Worn.none(0),
            pressed=Pressed.none(0),
        )
        self.taken_at = np.zeros(6)
        first, last = model.contacts[0][1:]
        self.arm = np.zeros(3)
        if gaps is not None:
            self.arm = model.points[first:last].mean(axis=0) - model.centre
        self.time = 0.0
        self.segments: list[ImpactSegment] = []
        self.motion: list[tuple[float, NDArray[np.float64], NDArray[np.float64]]] = []
        self.steps = 0
        self.lowest, self.highest = np.inf, -np.inf
        self.touched_at: float | None = None

    def stepper(self, doublings: int) -> Modes:
        if doublings not in self.steppers:
            self.steppers[doublings] = modes_of_step(self.model, self.step * 2.0**doublings)
        return self.steppers[doublings]

    # ------------------------------------------------------------------ placement

    def place(
        self,
        offset: NDArray[np.float64] | None,
        velocity: NDArray[np.float64] | None,
        speed: float,
        height: float | None,
    ) -> None:
        placement = np.zeros(6) if offset is None else np.array(offset, dtype=float)
        for _ in range(1 if height is None else 4):
            self.q[: self.rigid_count] = self.coordinates(placement)
            self.take_gaps()
            if height is None:
                break
            placement[2] += height - self.touch()
        self.start_lift = float(self.push @ self.q)
        motion = np.zeros(6) if velocity is None else np.array(velocity, dtype=float)
        motion[2] -= speed
        self.v[: self.rigid_count] = self.coordinates(motion)
        # the spring counts from q = 0 in the kernel
        self.constant += self.spring * self.start_lift
        shaft_pressed(self.bore, self.state)
        self.settle()
        self.start_energy = self.energy()
        self.keep_motion()

    def settle(self) -> None:
        """Press the layer of faces that overlap at the start."""
        gap, lam = self.open_gap + self.model.traces @ self.q, self.state.lam
        if self.model.layer is None or not np.any(gap < 0.0):
            return
        C, ends, pressed = self.model.compliance, np.zeros(len(gap)), self.state.pressed
        if solve_rough(C, gap, self.contact.layer, pressed, lam, ends) < 0:
            raise ConvergenceError(
                "interface level: no contact forces found at the start.\n"
                "Try: a start without contact."
            )
        pressed.before[:] = lam
        pressed.counts[0] = 0  # its inverse is that of the bodies at rest
        pressed.stiffness[:] = 0.0
        self.state.contact.counts[0] = np.count_nonzero(lam)
        self.books[LAYER] = layer_energy(self.contact.layer, lam, ends)

    def coordinates(self, rigid: NDArray[np.float64]) -> NDArray[np.float64]:
        R = self.model.rigid[:, : self.rigid_count]
        q = rigid_coordinates(R, rigid)
        refuse_if(
            np.max(np.abs(R @ q - rigid) / SCALE) > 1e-9 * max(1.0, np.max(np.abs(rigid / SCALE))),
            "simulate_interface: offset or velocity",
            got="a motion across the axis, or a rotation",
            expected="motion along z only, for bodies of revolution",
            hint="model the bodies as swept or solid to tilt or shift them.",
        )
        return q

    def rigid_state(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self.model.rigid @ self.q, self.model.rigid @ self.v

    @property
    def open_gap(self) -> NDArray[np.float64]:
        """Gaps at q = 0 without contact forces, of the faces as they are [m]."""
        worn = self.state.worn.set
        return self.gap0 + worn if len(worn) else self.gap0

    def take_gaps(self) -> None:
        if self.gaps is None:
            return
        r = self.rigid_count
        self.taken_at = self.model.rigid @ self.q
        fresh = self.gaps(self.taken_at)
        self.gap0 = fresh - self.model.traces[:, :r] @ self.q[:r]

    def touch(self) -> float:
        """Travel of the moving body along -z until the first gap closes [m]."""
        facing = self.model.axial > 1e-6
        gap = self.open_gap + self.model.traces @ self.q
        return float(np.min(gap[facing] / self.model.axial[facing]))

    # ------------------------------------------------------------------ motion

    def go(
        self,
        duration: float,
        flight: bool,
        impacts: int | None,
        progress: Callable[[float], None] | None,
    ) -> None:
        end = duration * (1.0 - 1e-9)
        wait = ceil(max(_CLUSTER_TIME, 2.0 * self.model.longest_period) / self.step)
        while self.time < end:
            if flight:
                self.fly(duration, progress)
                if self.time >= end:
                    break
            self.impact(duration, wait if flight else 0, progress)
            if impacts is not None and flight and len(self.segments) >= impacts:
                break
        if progress is not None:
            progress(1.0)

    def fly(self, duration: float, progress: Callable[[float], None] | None) -> None:
        """Jump until a gap may close soon; recompute the gaps meanwhile."""
        away = self.contact.away()
        while self.time < duration:
            stale = self.stale()
            horizon = min(2.0 * _FLIGHT_CHUNK, duration - self.time + self.step)
            safe = self.safe(self.open_gap - stale, horizon)
            if safe < _NEAR * self.step:
                if stale <= _FRESH:
                    return
                self.take_gaps()
                continue
            doublings = min(int(np.log2(safe / self.step)), _DOUBLINGS)
            if not surely_unguided(self.model, self.bore, self.state, safe):
                safe, doublings = _WARY_SHARE * safe, _GUIDED_DOUBLINGS
            length = self.step * 2.0**doublings
            steps = max(1, int(min(safe, _FLIGHT_CHUNK) / length))
            self.march(self.stepper(doublings), steps, 0, away, self.in_flight)
            self.time += steps * length
            self.keep_motion()
            if progress is not None:
                progress(min(self.time / duration, 1.0))

    def stale(self) -> float:
        """Largest possible error of the gaps [m].

        Faces at an angle slide past each other: a share of the displacement is missing.
        """
        if self.gaps is None:
            return 0.0
        moved = self.model.rigid @ self.q - self.taken_at
        way = float(np.linalg.norm(moved[:3] + np.cross(moved[3:], self.arm)))
        return _STALE_SHARE * way + 0.5 * _FRESH

    def safe(self, gap: NDArray[np.float64], horizon: float) -> float:
        outside = self.constant - self.spring * float(self.push @ self.q)
        force = self.push * outside
        return float(
            safe_flight(gap, self.model.traces, self.model.omega, self.q, self.v, force, horizon)
        )

    def impact(self, duration: float, wait: int, progress: Callable[[float], None] | None) -> None:
        segment = _Segment(self)
        self.books[OPEN_STEPS], self.books[DIRECTION] = -1.0, 0.0
        status = 0
        while self.time < duration * (1.0 - 1e-9) and status not in (OPEN, TURNED):
            steps = min(_CHUNK, ceil((duration - self.time) / self.step * (1.0 - 1e-9)))
            status = self.fine(segment, steps, wait)
            if progress is not None:
                progress(min(self.time / duration, 1.0))
            touched = self.books[CONTACT_STEPS] > segment.contact_steps
            if (
                wait
                and not touched
                and self.safe(self.open_gap, self.step * 1e3) > _FAR * self.step
            ):
                return  # it went by
        if self.books[CONTACT_STEPS] > segment.contact_steps or not wait:
            self.check_rim()
            self.segments.append(self.close(segment))

    def fine(self, segment: _Segment, steps: int, wait: int) -> int:
        points = self.contact._replace(gap=self.open_gap)
        taken, status, record = self.march(self.stepper(0), steps, wait, points, self.state)
        if status == FAILED:
            raise ConvergenceError(
                f"interface level: no contact forces found at {1e6 * self.time:.4g} us.\n"
                "Try: a shorter step, or fewer kept modes."
            )
        force, drift = record.force[:taken], record.drift[:taken]
        segment.parts.append((force, record.gap[:taken], record.outside[:taken]))
        segment.drift.extend(drift)
        if self.points:
            segment.point_force.append(record.points[:taken])
            segment.friction_force.append(record.across[:taken])
            segment.doing.append(record.doing[:taken])
        segment.pressed.append(record.pressed[:taken])
        self.time += taken * self.step
        self.steps += taken
        self.keep_motion()
        if self.books[CONTACT_STEPS] > segment.contact_steps:
            way = np.concatenate([[0.0], np.cumsum(drift[:, 0]) * self.step])
            end = float(self.push @ self.q)
            path = end - way[-1] + way
            if self.touched_at is None:
                closed = np.flatnonzero(force > 0)
                self.touched_at = float(path[closed[0]]) if len(closed) else None
            self.lowest = min(self.lowest, float(path.min()))
            self.highest = max(self.highest, float(path.max()))
        return status

    def march(
        self, modes: Modes, steps: int, wait: int, points: ContactPoints, state: State
    ) -> tuple[int, int, Record]:
        n = len(points.gap)
        ways = self.model.ways if n else 0
        record = Record.empty(
            steps, len(self.model.bodies), n, ways, keep_points=self.points and n > 0
        )
        outside = Outside(self.constant, self.spring)
        bore = None if self.guide is None else self.bore
        taken, status = march(steps, wait, modes, outside, points, bore, None, state, record)
        return taken, status, record

    # ------------------------------------------------------------------ records

    def keep_motion(self) -> None:
        position, velocity = self.rigid_state()
        if not (np.all(np.isfinite(position)) and np.all(np.isfinite(velocity))):
            raise ConvergenceError(
                f"interface level: the motion is not finite at {1e6 * self.time:.4g} us.\n"
                "Try: a shorter step."
            )
        self.motion.append((self.time, position, velocity))

    def contact_energy(self) -> float:
        pressed = -0.5 * self.state.lam @ (self.open_gap + self.model.traces @ self.q)
        pressed += self.books[LAYER]
        rubbing = self.state.rubbing
        if len(rubbing.across):
            pressed += 0.5 * rubbing.across @ rubbing.bent
        return float(pressed)

    def spring_energy(self) -> float:
        return float(0.5 * self.spring * (self.push @ self.q) ** 2)

    def energy(self) -> float:
        return (
            modal_energy(self.model, self.q, self.v)
            + self.contact_energy()
            + self.spring_energy()
            + float(self.books[GUIDE_STRAIN])
        )

    def ledger_start(self) -> tuple[float, float, NDArray[np.float64]]:
        modal = modal_energy(self.model, self.q, self.v)
        return modal, self.spring_energy(), self.books.copy()

    def body_energies(self) -> tuple[BodyEnergy, ...]:
        model, entries = self.model, []
        kinetic, strain = 0.5 * self.v**2, 0.5 * (model.omega * self.q) ** 2
        for number, name in enumerate(model.bodies):
            own = model.owner == number
            elastic = own & (model.omega > 0)
            mass = model.masses[number]
            drift = float(model.drift[number] @ self.v)
            translation = 0.5 * mass * drift**2 if np.isfinite(mass) else 0.0
            entries.append(
                BodyEnergy(
                    name=name,
                    translation=translation,
                    vibration=float(np.sum(kinetic[own]) + np.sum(strain[own])) - translation,
                    strain=float(np.sum(strain[own])),
                    frequency=model.omega[elastic] / (2.0 * np.pi),
                    modal=kinetic[elastic] + strain[elastic],
                )
            )
        return tuple(entries)

    def close(self, segment: _Segment) -> ImpactSegment:
        model = self.model
        force, gap, outside = (np.concatenate(part) for part in zip(*segment.parts, strict=True))
        drift = np.array(segment.drift)
        require_finite(
            "interface level",
            self.step,
            {"contact force": force, "gap": gap}
            | {f"velocity of {name}": drift[:, i] for i, name in enumerate(model.bodies)},
        )
        points = np.zeros((0, model.count), dtype=np.float32)
        across, doing = np.zeros((0, 0), dtype=np.float32), np.zeros((0, 0), dtype=np.int8)
        if self.points:
            points = np.concatenate(segment.point_force)
            across, doing = np.concatenate(segment.friction_force), np.concatenate(segment.doing)
        pressed = np.concatenate(segment.pressed) if model.ways else force
        initial, spring, books = segment.ledger
        spent = self.books - books
        contact, side, other = self.closed(pressed)
        # as if the other body were below: z points from it to the moving one
        moving, hit, mass = side * drift[:, 0], np.zeros(len(drift)), np.inf
        if other is not None:
            hit, mass = side * drift[:, other], model.masses[other]
        history = ImpactHistory(
            step=self.step,
            start=segment.time,
            force=np.where(pressed < 0.0, -force, force),
            gap=gap,
            velocity_a=moving,
            velocity_b=hit,
            speed=abs(float(moving[0] - hit[0])),
            mass_a=model.masses[0],
            mass_b=mass,
            ledger=EnergyLedger(
                initial=initial,
                bodies=self.body_energies(),
                contact=self.contact_energy(),
                contact_dissipation=float(spent[GUIDE]),
                damping=float(spent[DAMPING]),
                work=float(spent[WORK]),
                spring=self.spring_energy() - spring + float(spent[GUIDE_STRAIN]),
                friction=float(spent[FRICTION]),
                plastic=float(spent[PLASTIC]),
            ),
            external_force=side * outside,
            longest_period=model.longest_period,
            solver=f"interface level, {model.mode_count} modal coordinates, "
            f"{model.count} contact points",
        )
        return ImpactSegment(
            contact=contact,
            side=side,
            history=history,
            point_force=points,
            position=segment.position,
            velocity=segment.velocity,
            friction_force=across,
            doing=doing,
        )

    def closed(self, force: NDArray[np.float64]) -> tuple[str, float, int | None]:
        """Contact that carried first, its side by the sign of the force, and the other body.

        None for a body that has no modes.
        """
        model = self.model
        carried = np.flatnonzero(force)
        side = -1.0 if len(carried) and force[carried[0]] < 0.0 else 1.0
        name, first, last = next(
            (
                (name, first, last)
                for name, first, last in model.contacts
                if side * float(np.sum(model.axial[first:last])) >= 0.0
            ),
            model.contacts[0],
        )
        met = set(model.owner[np.any(model.traces[first:last] != 0.0, axis=0)].tolist()) - {0}
        return name, side, min(met, default=None)

    def approach(self) -> float:
        """Largest travel to -z after the first touch below [m]."""
        return 0.0 if self.touched_at is None else max(0.0, self.touched_at - self.lowest)

    def check_rim(self) -> None:
        """Reject a contact that has grown to the border of the candidate points."""
        at_rim = self.state.carried & self.model.rim
        if not np.any(at_rim):
            return
        axial = self.model.axial[at_rim]
        # way to either side from the placement of the meshes, where ``beyond`` belongs; below, a
        # body that leans or sits off its axis is taken as if it touched where the meshes do
        travel = np.where(axial >= 0.0, self.clearance + self.approach(), max(self.highest, 0.0))
        if np.all(_RIM_RESERVE * travel * np.abs(axial) < self.model.beyond[at_rim]):
            return
        at = ", ".join(f"{x * 1e3:.4g}" for x in self.model.points[np.argmax(at_rim)])
        raise ReachError(
            "interface level: contact",
            got=f"a contact point at the edge of the candidate area, at ({at}) mm, that carried "
            "load",
            expected="contact only inside the candidate area",
            hint="increase contact.reach, or reduce eccentricity and tilt.",
        )

    def result(self, wall_time: float) -> InterfaceResult:
        times, positions, velocities = zip(*self.motion, strict=True)
        contact_steps = int(self.books[CONTACT_STEPS])
        return InterfaceResult(
            impacts=tuple(self.segments),
            motion=RigidMotion(
                time=np.array(times),
                position=np.array(positions),
                velocity=np.array(velocities),
            ),
            energy=InterfaceEnergy(
                initial=self.start_energy,
                final=self.energy(),
                damping=float(self.books[DAMPING]),
                guide=float(self.books[GUIDE]),
                work=float(self.books[WORK]),
                debt=float(self.books[DEBT]),
                friction=float(self.books[FRICTION]),
                plastic=float(self.books[PLASTIC]),
            ),
            worn=self.state.worn.set.copy(),
            steps=self.steps,
            steps_in_contact=contact_steps,
            rounds_per_step=float(self.books[ROUNDS]) / max(contact_steps, 1),
            approach=self.approach(),
            wall_time=wall_time,
        )
