r"""Impact of two elastic bodies with every degree of freedom: the truth to compare with.

Between :math:`t` and :math:`t + h` a body with trapezoidal inertia obeys

.. math:: \tfrac{4}{h^2} M (u_1 - w) + K (u_0 + u_1) = 2 f + 2 G^T \lambda, \qquad
    v_1 = v_0 + \tfrac{2}{h} (u_1 - w)

with the free flight :math:`w = u_0 + h v_0`, the contact forces :math:`\lambda` of mid step and the
gaps :math:`g = g_0 + \sum_b G_b u_b` at the end, :math:`0 \le \lambda \perp g_1 \ge 0`, without
penalty or regularisation.  Damping (:mod:`klack.transient.body_damping`) adds :math:`\tfrac{2}{h} C
(u_1 - u_0)` to the left side and takes :math:`\tfrac{1}{h} (u_1 - u_0)^T C (u_1 - u_0)` in a step.
Two schemes keep the forces quiet:

``contact-stabilised-newmark``
    (Deuflhard, Krause & Ertel 2008.)  Where free flight would carry the inertia of contact nodes
    through the other body it is first put back, :math:`w = u_0 + h v_0 + M^{-1} G^T \mu` with
    :math:`0 \le \mu \perp g(w) \ge 0`.  The energy can only fall, by two losses:

    .. math:: E_1 - E_0 = -\lambda^T g_0 - \tfrac{2}{h^2} \mu^T g_1

``massless``
    (Khenous, Laborde & Renard 2008.)  Contact nodes have no inertia; they follow statically, with
    forces at the ends of the steps, :math:`2 \lambda = \lambda_0 + \lambda_1`.

With friction the faces also carry forces across their normals, with rows *T* of tangential offset
(:func:`klack.contact.mortar.tangent_rows`), :math:`2 T^T \lambda_t` on the right side and

.. math:: |\lambda_t| \le \mu \lambda, \qquad
    \lambda_t = -\mu \lambda \frac{s}{|s|} \text{ where } s = T (u_1 - u_0) \ne 0 ,

solved together with the gaps (:mod:`klack.transient.rubbing`).  The slip is that of the whole step,
elastic part included, not counted from *w*, so that :math:`\lambda_t^T s \le 0` is a loss of strict
sign.  In the massless scheme friction is :math:`-\lambda_{t1}^T s`; the rest of the work of the
mean force belongs to points that open, close or turn.

Neither needs :math:`M^{-1}` in the loop: with :math:`v = \tilde v - M^{-1} G^T y` the corrections
are carried by the contact-sized vector *y*, and a step costs one product with K and one solve with
:math:`S = 4 M / h^2 + K` (:mod:`klack.transient.interface_solve`).
"""

import logging
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from functools import partial
from math import ceil, floor, inf
from time import perf_counter
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.factorization import Backend, Precision
from klack.contact.asperity_layer import AsperityLayer, press
from klack.contact.complementarity import ComplementaritySolver
from klack.contact.face_friction import FaceFriction
from klack.contact.history import BodyEnergy, EnergyLedger, ImpactHistory
from klack.contact.mortar import ContactSpace
from klack.contact.statics import ReachError
from klack.errors import ConvergenceError, refuse_if, require_nonnegative, require_positive
from klack.machine.cores import share_of
from klack.machine.progress import SoFar, drawn
from klack.simulation import energy_balance
from klack.simulation.finite import require_finite
from klack.transient.body_damping import BodyDamping
from klack.transient.full_body import FullBody, KnownBody, Scheme, open_gaps
from klack.transient.result import (
    EnergyRecord,
    FieldsOfBody,
    FullOrderResult,
    MotionOfBody,
    RubbingRecord,
    Snapshots,
    SolverStatistics,
)
from klack.transient.rubbing import RubbingPoints

__all__ = ["Scheme", "recommended_step", "simulate_full_order"]

_T = TypeVar("_T")
_BALANCE = 1e-9  # energy residual that a run keeps
_RETURNED = 1e-6  # share of the energy that gaps closed in single precision may return

_log = logging.getLogger(__name__)

_PENETRATION = 1e-13
"""Gap [m] below which a point that is not watched counts as closed."""

_WATCH_STEPS = 12
"""A point is watched when it would close within so many steps at the impact speed."""

_LEARN_STEPS = 60
"""The same for points whose response is computed together with those needed now."""

_RIM_RESERVE = 1.1
"""Points of a vibrating body travel slightly farther than its centre of mass."""

_LOOK_STEPS = 8
"""Steps between checks whether bodies have parted for good."""

_REVIEW_STEPS = 32
"""Steps between reviews of the watched points."""


def recommended_step(contact_time: float) -> float:
    """Time step [s] for an expected contact time [s]: one 440th of it.

    On a needle and seat: 0.02 N of ripple on some 300 N, and a loss of 3e-5 of the energy.
    """
    require_positive("recommended_step: contact_time", contact_time, "s")
    return contact_time / 440.0


def simulate_full_order(
    body_a: ElasticBody,
    body_b: ElasticBody | None,
    space: ContactSpace,
    *,
    speed: float,
    duration: float,
    step: float = 50e-9,
    scheme: Scheme = "contact-stabilised-newmark",
    axial_force: float = 0.0,
    spring_stiffness: float = 0.0,
    damping: tuple[BodyDamping | None, BodyDamping | None] = (None, None),
    friction: FaceFriction | None = None,
    layer: AsperityLayer | None = None,
    across: NDArray[np.float64] | None = None,
    stop_after_separation: float | None = None,
    known: Sequence[KnownBody] | None = None,
    energy_interval: int = 10,
    longest_period: float = 0.0,
    backend: Backend = "auto",
    precision: Precision = "double",
    threads: int = 1,
    progress: Callable[[float], None] | None = None,
    snapshots: Snapshots | None = None,
) -> FullOrderResult:
    """Simulate body a moving in -z onto body b until ``duration``.

    Body a starts free of strain with ``speed``, body b at rest.  The rigid flight until just before
    the first touch is skipped: the record starts there, and its clock at the given placement.

    Parameters
    ----------
    body_a
        The needle, free along z.
    body_b
        The seat or stop, free or fixed; ``None`` for a rigid wall (``space.G_b`` is ignored).
    space
        Contact points and their gaps at the given placement.
    speed [m/s]
        Of approach, above zero.
    duration [s]
        From the start of the record.
    step [s]
        See :func:`recommended_step`.
    scheme
    axial_force [N]
        Constant force on a along +z (negative presses a onto b), spread over it like its weight.
    spring_stiffness [N/m]
        Of a massless spring from the centre of mass of a to ground, without force at the given
        placement.
    damping
        Of body a and of body b.  Non-reflecting ends are for body b.
    friction
        Between the faces, of these contact points.
    layer
        Of the faces, elastic; not with friction nor the massless scheme.
    across (6,) [m/s], [rad/s]
        Rigid velocity of a at the start besides ``speed``, about its centre of mass; of solids
        only.
    stop_after_separation [s]
        End the run early when no point has carried a force for this long after a contact.
    known
        Of body a and, unless it is a rigid wall, body b: with it the steps end where these bodies
        have parted for good (:mod:`klack.transient.full_body`), and the rest of the record is
        their free flight: no force, constant velocities of the centres of mass, gaps without what
        the known modes leave.  Without effect with damping, spring, axial force, friction,
        snapshots or the massless scheme.
    energy_interval
        Steps between entries of the energy record.
    longest_period [s]
        Of the elastic modes of body a, passed on to the history.
    backend
    precision
        Of the factors (pardiso only; others are double).  ``"single"`` takes half the memory and
        two thirds of the time.  A step solves for an increment only, and the next one repays the
        defect of its solve: the force changes by some 1e-7.
    threads
        Of the factorisation; with two or more the bodies also advance side by side.
    progress
        Called with the fraction done.
    snapshots
        Reader of the fields on the way.

    Raises
    ------
    InputError
        For bodies and contact points that do not belong together, or when a contact point at the
        rim of the candidates closes (the reach of the contact space is too small).
    ConvergenceError
        When the state stops being finite, or the contact forces are not found.

    Warns
    -----
    AccuracyWarning
        When the energy balance, numerical losses included, does not close to 1e-9
        (:mod:`klack.simulation.energy_balance`).
    """
    require_positive("simulate_full_order: speed", speed, "m/s")
    require_positive("simulate_full_order: duration", duration, "s")
    require_positive("simulate_full_order: step", step, "s")
    if stop_after_separation is not None:
        require_nonnegative(
            "simulate_full_order: stop_after_separation", stop_after_separation, "s"
        )
    refuse_if(
        scheme not in ("contact-stabilised-newmark", "massless"),
        "simulate_full_order: scheme",
        got=f"'{scheme}'",
        expected="'contact-stabilised-newmark' or 'massless'",
        hint="use the first one; the second is for comparison.",
    )
    refuse_if(
        layer is not None and (friction is not None or scheme == "massless"),
        "simulate_full_order: layer",
        got="a layer of asperities with friction, or with the massless scheme",
        expected="smooth faces, or no friction and the contact-stabilised scheme",
        hint="leave one of them out.",
    )
    begin = perf_counter()
    with ExitStack() as stack:
        if friction is not None and friction.law.is_none:
            friction = None
        T_a, T_b = (None, None) if friction is None else (friction.T_a, friction.T_b)
        bodies = [FullBody(body_a, space.G_a, "a", damping[0], spring_stiffness, T_a)]
        if body_b is not None:
            bodies.append(FullBody(body_b, space.G_b, "b", damping[1], T=T_b))
        refuse_if(
            bodies[0].supported,
            f"simulate_full_order: body '{bodies[0].name}'",
            got="body a fixed along z",
            expected="body a free to move along z",
            hint="fix only radial degrees of freedom of the needle, or swap the bodies.",
        )
        for body in bodies:
            stack.callback(body.close)
        pool = None
        if threads > 1 and len(bodies) > 1:
            pool = stack.enter_context(ThreadPoolExecutor(max_workers=len(bodies)))
        run = _Run(bodies, space, speed, step, scheme, pool, axial_force, friction, layer)
        run.together(
            [
                partial(b.set_up, step, scheme, backend, precision, share_of(threads, len(bodies)))
                for b in bodies
            ]
        )
        start, retraction = run.place(np.zeros(6) if across is None else across)
        set_up_time = perf_counter() - begin
        steps = ceil(duration / step * (1.0 - 1e-9))
        # products of contact size: more threads only wait for each other, at twice the time
        with threadpool_limits(limits=1, user_api="blas"):
            show = None if snapshots is None else _Show(run, start, snapshots)
            free = known if run.is_free and show is None else None
            record = _march(
                run, steps, stop_after_separation, free, energy_interval, progress, show
            )
        loop_time = perf_counter() - begin - set_up_time
        result = _result(run, record, start, retraction, longest_period, (set_up_time, loop_time))
    history = result.history
    require_finite(
        "simulate_full_order",
        history.step,
        {
            "contact force": history.force,
            "gap": history.gap,
            **{
                f"velocity of {body.name}": values
                for body, values in zip(
                    bodies, (history.velocity_a, history.velocity_b), strict=False
                )
            },
        },
    )
    ledger = history.ledger
    energy_balance.check_energy_balance(
        "simulate_full_order",
        ledger.residual,
        # what the massless scheme books changes its sign: of second order in the step
        0.0 if scheme == "massless" else ledger.least_loss + _returned(precision),
        limit=_BALANCE,
        advice="precision='double', or a shorter step",
    )
    return result


def _returned(precision: Precision) -> float:
    """Share of the energy [-] by which losses may be below zero.

    A closed gap is zero to the precision of the factor, times its change in a step.
    """
    return _RETURNED if precision == "single" else 0.0


class _Run:
    def __init__(
        self,
        bodies: list[FullBody],
        space: ContactSpace,
        speed: float,
        step: float,
        scheme: Scheme,
        pool: ThreadPoolExecutor | None,
        axial_force: float,
        friction: FaceFriction | None,
        layer: AsperityLayer | None,
    ) -> None:
        self.bodies, self.space, self.speed, self.step = bodies, space, speed, step
        self.scheme, self.pool, self.axial_force = scheme, pool, axial_force
        count = self.count = len(space.gap)
        ways = 0 if friction is None else friction.T_a.shape[0] // count
        self.layer = layer
        self.rubbing = None
        if friction is not None:
            still = np.diff(friction.T_a.indptr)[:count] == 0
            self.rubbing = RubbingPoints(friction.law, step, count, ways, still)
        # contact forces of the last step (massless: at its end), along, then across the normals
        self.lam = np.zeros((ways + 1) * count)
        self.at_rest = np.concatenate([space.gap, np.zeros(ways * count)])  # gaps and offsets
        self.axial = space.axial
        if friction is not None:
            self.axial = np.concatenate([space.axial, friction.T_a @ bodies[0].full_axis])
        self.y = np.zeros(count)
        self.closed = np.zeros(count, dtype=bool)
        self.overshooting = np.zeros(count, dtype=bool)
        self.watched = np.zeros(count, dtype=bool)
        self.learned = np.zeros(count, dtype=bool)
        self.share = 1.0 if scheme == "massless" else 2.0
        self.contact_loss = self.overshoot_loss = self.damped = self.work = self.stored = 0.0
        self.friction_loss = self.radiated = 0.0
        self.outside = axial_force
        self.rounds = self.repeats = self.steps = self.steps_in_contact = self.watch_sum = 0

    def place(self, across: NDArray[np.float64]) -> tuple[float, float]:
        """Place a just before the first touch; returns the time flown and the retraction."""
        needle, axial = self.bodies[0], self.space.axial
        facing = axial > 1e-6
        refuse_if(
            not np.any(facing),
            "simulate_full_order: contact space",
            got="contact points whose gap does not change with the axial position of a",
            expected="surfaces that face each other along z",
            hint="check the orientation of the geometry; the axis of motion is z.",
        )
        touch = float(np.min(self.space.gap[facing] / axial[facing]))
        retraction = max(0.0, -touch)
        if retraction > 0:
            _log.info("bodies overlap by %.3g um; body a starts further away", retraction * 1e6)
        flown = 0
        if self.axial_force == 0.0 == needle.spring and not np.any(across):
            flown = max(0, floor(touch / (self.speed * self.step)) - 1)
        needle.force = needle.axial_mass * (self.axial_force / needle.mass)
        needle.u = needle.axis * (retraction - self.speed * flown * self.step)
        needle.v = -self.speed * needle.axis + needle.across(across)
        needle.refresh()
        self.ends = self.at_rest + sum(body.rows @ body.u for body in self.bodies)
        self.watch(self.gap < self.margin)
        return flown * self.step, retraction

    @property
    def gap(self) -> NDArray[np.float64]:
        return self.ends[: self.count]

    @property
    def reach_per_step(self) -> float:
        return self.speed * self.step

    @property
    def margin(self) -> float:
        """Gap [m] below which a point is watched."""
        return _WATCH_STEPS * self.reach_per_step

    @property
    def is_free(self) -> bool:
        """Whether only a smooth contact acts on the bodies, and all nodes have inertia."""
        alone = all(body.damping is None and body.spring == 0.0 for body in self.bodies)
        return (
            alone and self.axial_force == 0.0 and self.rubbing is None and self.scheme != "massless"
        )

    def watch(self, points: NDArray[np.bool_]) -> None:
        if np.any(points & ~self.learned):
            new = (points | (self.gap < _LEARN_STEPS * self.reach_per_step)) & ~self.learned
            points_new = np.flatnonzero(new)
            rows = self._rows(points_new)
            self.together([partial(body.learn, points_new, rows) for body in self.bodies])
            self.learned |= new
        self.watched = points
        self.points = np.flatnonzero(points)
        self.rows = self._rows(self.points)
        for body in self.bodies:
            body.solve.select(self.rows)
        grid = np.ix_(self.rows, self.rows)
        compliance = self.share * np.sum([b.solve.compliance[grid] for b in self.bodies], axis=0)
        if self.rubbing is None:
            self.force_problem = ComplementaritySolver(compliance)
        else:
            self.rubbing.watch(self.points, compliance)
        grid = np.ix_(self.points, self.points)
        self.overshoot_problem = ComplementaritySolver(
            np.sum([body.mobility[grid] for body in self.bodies], axis=0)
        )

    def _rows(self, points: NDArray[np.int64]) -> NDArray[np.int64]:
        """Rows of these points: gaps, then offsets in every direction."""
        directions = np.arange(len(self.lam) // self.count)
        return (self.count * directions[:, None] + points).ravel()

    def advance(self) -> tuple[float, float]:
        """One step; returns its mean axial contact force [N] and its mean smallest gap [m]."""
        flight = self.at_rest + self._sum([body.fly for body in self.bodies])
        push = self._push(flight[: self.count])
        change = self._sum([partial(body.predict, push) for body in self.bodies])
        while True:
            lam = np.zeros(len(flight))
            lam[self.rows], active, rounds = self._forces(flight[self.rows] + change)
            given = self.share * lam[self.rows]
            ends = self.at_rest + self._sum([partial(body.complete, given) for body in self.bodies])
            gap = ends[: self.count]
            missed = (gap < -_PENETRATION) & ~self.watched
            if not np.any(missed):
                break
            self.repeats += 1
            self.watch(self.watched | missed | (gap < self.margin))
            change = np.sum([body.solve.response() for body in self.bodies], axis=0)
        self.rounds += rounds
        self.closed[:] = False
        self.closed[self.points] = active
        return self._commit(lam, ends)

    def _push(self, flight: NDArray[np.float64]) -> NDArray[np.float64]:
        """Contact-sized forces known before the solve, shaped like lam [N]."""
        self.mu = np.zeros(len(flight))
        if self.scheme == "massless":
            return self.lam
        if self.layer is not None:  # it takes an overshoot up
            return np.zeros(len(self.lam))
        flight = (
            flight - self.step * sum(b.mobility @ self.y for b in self.bodies)
            if np.any(self.y)
            else flight
        )
        overshoot = flight < 0.0
        if np.any(overshoot & ~self.watched):
            self.watch(self.watched | overshoot | (self.gap < self.margin))
        if np.any(overshoot):
            self.mu[self.points], active, _ = self.overshoot_problem.solve(
                flight[self.points], self.overshooting[self.points]
            )
            self.overshooting[:] = False
            self.overshooting[self.points] = active
        push = np.zeros(len(self.lam))
        push[: self.count] = (4.0 / self.step**2) * (self.mu - self.step * self.y)
        return push

    def _forces(
        self, free: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_], int]:
        """Forces of the watched points from their gaps and offsets without them."""
        active = self.closed[self.points]
        gap = free[: len(self.points)]
        if not np.any(active) and np.all(gap >= 0.0):
            return np.zeros(len(free)), active, 0
        if self.layer is not None:
            area, before = self.space.area[self.points], self.gap[self.points]
            force, ends = press(
                self.layer, area, self.force_problem.A, gap, before=before, start=before
            )
            return force, ends < 0.0, 1
        if self.rubbing is None:
            return self.force_problem.solve(gap, active)
        slip = free[len(gap) :] - self.ends[self.rows[len(gap) :]]
        return self.rubbing.solve(np.concatenate([gap, slip]), self.lam[self.rows])

    def _commit(self, lam: NDArray[np.float64], ends: NDArray[np.float64]) -> tuple[float, float]:
        moved, before, self.ends = ends - self.ends, self.gap, ends
        gap = self.gap
        mean = 0.5 * (self.lam + lam) if self.scheme == "massless" else lam
        self.contact_loss -= float(mean @ moved)
        if self.rubbing is not None:
            rubbed = self.rubbing.commit(lam[self.count :], moved[self.count :])
            self.friction_loss += rubbed
            self.contact_loss -= rubbed
        if self.scheme != "massless":
            self.overshoot_loss += float(2.0 / self.step**2 * self.mu @ gap)
            if np.any(self.mu) or np.any(self.y):
                self.y = (2.0 / self.step) * self.mu - self.y
        centre = self.bodies[0].centre()
        given = self.share * lam
        done = self.together([partial(b.commit, given) for b in self.bodies])
        for damped, radiated, rounded in done:
            self.damped += damped
            self.radiated += radiated
            self.contact_loss -= rounded
        needle = self.bodies[0]
        travel, spring = needle.centre() - centre, needle.spring * 0.5 * (needle.centre() + centre)
        self.work += self.axial_force * travel
        self.stored += spring * travel
        self.outside = self.axial_force - spring
        self.lam, self.mean = lam, mean
        self.steps += 1
        self.steps_in_contact += bool(np.any(lam[: self.count]))
        self.watch_sum += len(self.points)
        if self.steps % _REVIEW_STEPS == 0:
            self.together([body.refresh for body in self.bodies])
            near = (gap < self.margin) | self.closed
            if np.any(near != self.watched):
                self.watch(near)
        return float(self.axial @ mean), float(np.min(0.5 * (before + gap)))

    @property
    def held(self) -> float:
        """Energy of the layer of asperities [J], part of what the contact took."""
        if self.layer is None:
            return 0.0
        return float(self.space.area @ self.layer.state(-self.gap)[2])

    @property
    def travel(self) -> float:
        """Distance that the centres of mass have closed since the placement [m]."""
        other = self.bodies[1].centre() if len(self.bodies) > 1 else 0.0
        return other - self.bodies[0].centre()

    def _sum(self, tasks: Sequence[Callable[[], NDArray[np.float64]]]) -> NDArray[np.float64]:
        return np.sum(self.together(tasks), axis=0)

    def together(self, tasks: Sequence[Callable[[], _T]]) -> list[_T]:
        """Do the same for all bodies, in parallel if there are threads."""
        if self.pool is None:
            return [task() for task in tasks]
        futures = [self.pool.submit(task) for task in tasks]
        return [future.result() for future in futures]


class _Record:
    def __init__(self, run: _Run) -> None:
        self.force: list[float] = []
        self.gap: list[float] = []
        self.outside: list[float] = []
        self.point_force: list[NDArray[np.float32]] = []
        self.across: list[NDArray[np.float32]] = []
        self.doing: list[NDArray[np.int8]] = []
        self.velocity: list[list[float]] = []
        self.energy: list[tuple[float, ...]] = []
        self.energy_step: list[int] = []
        self.highest = 0.0
        self.lowest = inf
        self.touched = False
        self.first_touch = 0.0
        self.quiet = 0
        self.peak = [body.u for body in run.bodies]
        self.keep_velocity(run)
        self.keep_energy(run)

    def so_far(self, step: float) -> list[SoFar]:
        """Contact force over time."""
        force = np.array(self.force)
        time = np.asarray(1e6 * step * np.arange(1, force.size + 1), dtype=float)
        return [SoFar(title="contact force [N]", x=time, y=force, x_label="time [us]")]

    def keep_velocity(self, run: _Run) -> None:
        velocity = [body.centre_velocity(run.y) for body in run.bodies]
        if not np.all(np.isfinite(velocity)):
            raise ConvergenceError(
                f"simulate_full_order: the motion is not finite at step {run.steps}, "
                f"{run.steps * run.step * 1e6:.4g} us after the start of the record.\n"
                "Try: a shorter time step, and look for distorted elements."
            )
        self.velocity.append(velocity)

    def keep_energy(self, run: _Run) -> None:
        kinetic = [body.kinetic(run.y) for body in run.bodies]
        strain = [body.strain() for body in run.bodies]
        losses = (run.contact_loss, run.overshoot_loss, run.work, run.damped, run.stored)
        self.energy.append((*kinetic, *strain, *losses, run.friction_loss, run.radiated))
        self.energy_step.append(run.steps)

    def keep_step(self, run: _Run, force: float, gap: float) -> None:
        self.force.append(force)
        self.gap.append(gap)
        self.outside.append(run.outside)
        self.point_force.append(run.mean[: run.count].astype(np.float32))
        if run.rubbing is not None:
            self.across.append(run.mean[run.count :].astype(np.float32).reshape(-1, run.count))
            self.doing.append(run.rubbing.doing.copy())
        self.keep_velocity(run)
        carries = bool(np.any(run.mean))
        if carries and not self.touched:
            self.touched, self.first_touch = True, run.bodies[0].centre()
        self.quiet = 0 if carries else self.quiet + 1
        if self.touched:
            self.lowest = min(self.lowest, run.bodies[0].centre())
        if force > self.highest:
            self.highest, self.peak = force, [body.u for body in run.bodies]

    def fly(self, run: _Run, gaps: NDArray[np.float64]) -> None:
        """Continue without contact; ``gaps`` now and after each further step (nc, k + 1)."""
        further = gaps.shape[1] - 1
        self.force += [0.0] * further
        self.gap += np.min(0.5 * (gaps[:, 1:] + gaps[:, :-1]), axis=0).tolist()
        self.outside += [run.outside] * further
        self.point_force += [np.zeros(run.count, dtype=np.float32)] * further
        self.velocity += [self.velocity[-1]] * further
        reached = run.bodies[0].centre() + self.velocity[-1][0] * further * run.step
        self.lowest = min(self.lowest, reached)


def _march(
    run: _Run,
    steps: int,
    stop_after_separation: float | None,
    known: Sequence[KnownBody] | None,
    energy_interval: int,
    progress: Callable[[float], None] | None,
    show: Callable[[], None] | None,
) -> _Record:
    record = _Record(run)
    if show is not None:
        show()
    patience = inf if stop_after_separation is None else stop_after_separation / run.step
    for number in range(1, steps + 1):
        try:
            force, gap = run.advance()
        except ConvergenceError as error:
            raise ConvergenceError(
                f"simulate_full_order: step {number}, {number * run.step * 1e6:.4g} us after the "
                f"start of the record: {error}"
            ) from error
        record.keep_step(run, force, gap)
        if show is not None:
            show()
        _check_rim(run)
        if number % energy_interval == 0:
            record.keep_energy(run)
        if progress is not None and number % 10 == 0:
            progress(number / steps)
            drawn(progress, partial(record.so_far, run.step))
        if record.touched and record.quiet > patience:
            break
        if known is not None and record.touched and record.quiet % _LOOK_STEPS == 1:
            gaps = open_gaps(
                run.bodies, known, run.at_rest, run.y, steps=steps - number, slack=run.margin
            )
            if gaps is not None:
                record.fly(run, gaps)
                break
    if record.energy_step[-1] != run.steps:
        record.keep_energy(run)
    if progress is not None:
        progress(1.0)
    return record


class _Show:
    def __init__(self, run: _Run, start: float, snapshots: Snapshots) -> None:
        self.run, self.start, self.snapshots = run, start, snapshots
        self.before = [body.u for body in run.bodies]

    def __call__(self) -> None:
        run = self.run
        if run.steps in self.snapshots.steps:
            motion = tuple(
                MotionOfBody(
                    name=body.name,
                    displacement=body.whole(body.u),
                    velocity=body.whole((body.u - before) / run.step if run.steps else body.v),
                )
                for body, before in zip(run.bodies, self.before, strict=True)
            )
            self.snapshots.receive(self.start + run.steps * run.step, motion)
        self.before = [body.u for body in run.bodies]


def _check_rim(run: _Run) -> None:
    beyond = run.space.rim & (run.lam[: run.count] > 0.0)
    if np.any(beyond) and not run.space.complete_at(_RIM_RESERVE * run.travel):
        at = ", ".join(f"{x * 1e3:.4g}" for x in run.space.points[np.argmax(beyond)])
        raise ReachError(
            "simulate_full_order: contact space",
            got=f"a contact point at the edge of the candidate area, at ({at}) mm, that closed "
            f"{run.steps * run.step * 1e6:.4g} us after the start of the record",
            expected="contact only inside the candidate area",
            hint="build the contact space with a larger reach; in a case, enlarge contact.reach.",
        )


def _result(
    run: _Run,
    record: _Record,
    start: float,
    retraction: float,
    longest_period: float,
    times: tuple[float, float],
) -> FullOrderResult:
    bodies, count = run.bodies, len(run.bodies)
    velocity = np.array(record.velocity)
    for i, body in enumerate(bodies):
        if body.supported or body.endless:
            velocity[:, i] = 0.0
    energy = np.array(record.energy)
    book = EnergyRecord(
        time=start + np.array(record.energy_step) * run.step,
        kinetic=energy[:, :count],
        strain=energy[:, count : 2 * count],
        contact=energy[:, 2 * count],
        overshoot=energy[:, 2 * count + 1],
        work=energy[:, 2 * count + 2],
        damping=energy[:, 2 * count + 3],
        spring=energy[:, 2 * count + 4],
        friction=energy[:, 2 * count + 5],
        radiated=energy[:, 2 * count + 6],
    )
    history = ImpactHistory(
        step=run.step,
        start=start,
        force=np.array(record.force),
        gap=np.array(record.gap),
        velocity_a=velocity[:, 0],
        velocity_b=velocity[:, 1] if count > 1 else np.zeros(len(velocity)),
        speed=run.speed,
        mass_a=bodies[0].mass,
        mass_b=inf if count == 1 or bodies[1].supported or bodies[1].endless else bodies[1].mass,
        ledger=_ledger(bodies, book, velocity[-1], run.held),
        external_force=np.array(record.outside),
        longest_period=longest_period,
        solver=f"full order, {sum(len(body.free) for body in bodies)} degrees of freedom, "
        f"{run.scheme}",
    )
    fields = tuple(
        FieldsOfBody(
            name=body.name,
            peak_displacement=body.whole(peak),
            end_displacement=body.whole(body.u),
            end_velocity=body.whole(body.velocity(run.y)),
        )
        for body, peak in zip(bodies, record.peak, strict=True)
    )
    return FullOrderResult(
        history=history,
        point_force=np.array(record.point_force),
        area=run.space.area,
        energy=book,
        fields=fields,
        rigid_velocity=bodies[0].rigid_velocity(fields[0].end_velocity),
        approach=max(0.0, record.first_touch - record.lowest) if record.touched else 0.0,
        retraction=retraction,
        statistics=_statistics(run, times),
        rubbing=None
        if run.rubbing is None
        else RubbingRecord(force=np.array(record.across), doing=np.array(record.doing)),
    )


def _ledger(
    bodies: Sequence[FullBody], book: EnergyRecord, velocity: NDArray[np.float64], held: float
) -> EnergyLedger:
    entries = []
    for i, body in enumerate(bodies):
        translation = 0.5 * body.mass * float(velocity[i]) ** 2
        strain = float(book.strain[-1, i])
        entries.append(
            BodyEnergy(
                name=body.name,
                translation=translation,
                vibration=float(book.kinetic[-1, i]) + strain - translation,
                strain=strain,
            )
        )
    return EnergyLedger(
        initial=float(book.total[0]),
        bodies=tuple(entries),
        contact=held,
        contact_dissipation=float(book.contact[-1] + book.overshoot[-1]) - held,
        damping=float(book.damping[-1]),
        work=float(book.work[-1]),
        spring=float(book.spring[-1]),
        friction=float(book.friction[-1]),
        radiated=float(book.radiated[-1]),
    )


def _statistics(run: _Run, times: tuple[float, float]) -> SolverStatistics:
    factors = [body.factor for body in run.bodies if body.factor is not None]
    return SolverStatistics(
        scheme=run.scheme,
        backend=factors[0].backend,
        degrees_of_freedom=sum(len(body.free) for body in run.bodies),
        contact_points=len(run.gap),
        steps=run.steps,
        steps_in_contact=run.steps_in_contact,
        rounds_per_step=run.rounds / max(run.steps_in_contact, 1),
        watched=run.watch_sum / max(run.steps, 1),
        repeats=run.repeats,
        factor_entries=sum(factor.nonzeros or 0 for factor in factors),
        turns=0 if run.rubbing is None else run.rubbing.turns,
        set_up_time=times[0],
        loop_time=times[1],
    )
