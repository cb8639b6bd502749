r"""The compiled step of the interface level.

With the exact modal propagator over one step *h* under a constant mean force (A, B of
:mod:`klack.simulation.propagator`), and contact forces :math:`\lambda_0, \lambda_1` at its ends,

.. math::
    \bar\lambda &= \tfrac12 (1 + \varepsilon) (\lambda_0 + \lambda_1), \qquad
    q_1 = A_{11} q_0 + A_{12} v_0 + B_1 (f + \Phi^T \bar\lambda), \qquad
    v_1 = A_{21} q_0 + A_{22} v_0 + B_2 (f + \Phi^T \bar\lambda) \\
    0 &\le \lambda_1 \perp g_0 + \Phi q_1 + C_l \lambda_1 \ge 0 .

The complementarity problem has the constant matrix :math:`C_l + \tfrac12 \Phi B_1 \Phi^T`.

Energy: the massless contact has the potential :math:`U = \tfrac12 \lambda^T C_l \lambda`, and with
:math:`\varepsilon = 0` a step misses it by :math:`\tfrac12 (\lambda_0^T g_1 - \lambda_1^T g_0)`, by
points that close or open within the step.  :math:`\varepsilon` pays that back in the same step:
some 1e-6 of the force, at most 1e-3, and as much as it takes in the first and the last step of a
contact, which are closed only in part.  The rest is owed to the next step and never adds up.

A spring at :math:`y = p^T q` pulls with its mean force over the step, :math:`-k (y_0 + y_1) / 2`,
so that its work is exactly the change of its energy.  As :math:`y_1` follows from all forces of the
step, each force comes with the answer of the spring,

.. math:: f \to f - p \, \kappa \, p^T B_1 f, \qquad
    \kappa = \frac{k / 2}{1 + \tfrac{k}{2} p^T B_1 p} ,

and the matrix of the complementarity problem loses
:math:`\tfrac12 \kappa (\Phi B_1 p) (\Phi B_1 p)^T` (:func:`contact_compliance`).

With friction the same holds in all directions of the points
(:mod:`klack.transient.interface_friction`).  Points that yield leave a set, from then on part of
their gap (:mod:`klack.transient.yielding_points`); the step takes its plastic work.

Points with a layer of asperities (:mod:`klack.transient.rough_points`) have no complementarity but
:math:`\lambda_1 = A p(-g_1)`, and the energy of the layer besides,

.. math:: U = \tfrac12 \lambda^T C_l \lambda + \sum_k A_k \int_0^{-g_k} p \, dc ,

which is convex in :math:`d = g_0 + \Phi q`.  Their mean force is :math:`(\tfrac12 - \theta)
\lambda_0 + (\tfrac12 + \theta) \lambda_1` with the one :math:`\theta` for which its work is the
change of U.  By convexity :math:`\theta` is never beyond :math:`\pm\tfrac12`, and of the order of a
step.  For one point on a rigid body this is the mean pressure of the layer between two closures.
"""

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Index, Matrix, Vector
from klack.machine.compiling.jit import FAST, inner, njit
from klack.simulation.phase import sums
from klack.transient.active_set import solve_active
from klack.transient.guide_step import (
    GuideRub,
    begin_rub,
    count_bearing,
    no_rub,
    rub_guide,
    squeeze_guide,
)
from klack.transient.interface_arrays import (
    CONTACT_STEPS,
    DAMPING,
    DEBT,
    DIRECTION,
    GUIDE,
    GUIDE_STRAIN,
    LAYER,
    OPEN_STEPS,
    PLASTIC,
    ROUNDS,
    WORK,
    ActiveSet,
    ContactPoints,
    Films,
    Grip,
    Guide,
    Layer,
    Limit,
    Modes,
    Near,
    Others,
    Outside,
    Record,
    State,
    Step,
)
from klack.transient.interface_friction import (
    across,
    begin_offsets,
    forget,
    held_across,
    push_across,
    remember,
    rub,
    tell_friction,
)
from klack.transient.rough_points import layer_energy, solve_rough
from klack.transient.tilting_films import (
    begin_films,
    bend_faces,
    bulk_work,
    count_squeeze,
    film_change,
    film_work,
    hold_films,
    squeeze,
    tell_land,
)
from klack.transient.yielding_points import let_yield, solve_yielding

__all__ = [
    "FAILED",
    "FINISHED",
    "LEFT_OUT",
    "OPEN",
    "TURNED",
    "contact_compliance",
    "march",
    "march_near",
    "safe_flight",
]


FINISHED, OPEN, FAILED, TURNED, LEFT_OUT = 0, 1, 2, 3, 4
"""Why :func:`march` returned.

All steps done; open for long enough; no active set found; a contact of the other stop would begin,
and that step is not taken.
"""

_SWEEPS, _SETTLED = 20, 1e-4
"""Rounds over all films of a step, which move each other, and the change of heights over their
displacement in the step that ends them.
"""

_PAY_FROM = 1e-10
"""Smallest work of a step over the energy of the contact that pays debts.

Below it, for bodies at rest, debt and work are round-off.
"""

_PAY_LIMIT = 1e-3
"""Share of a contact force that may always pay the energy debt.

More may, where the debt exceeds that share of the energy of the contact.
"""


def contact_compliance(
    local: NDArray, traces: NDArray, B1: NDArray, push: NDArray, spring: float
) -> NDArray:
    """Matrix of :func:`march`: gaps at the end of a step per contact force there (n, n) [m/N].

    With friction the directions of all points, normal ones first, instead of gaps.  ``local`` is
    the compliance that the modes do not carry; ``traces``, ``B1``, ``push``, ``spring`` are as in
    :func:`march`.
    """
    A = local + 0.5 * (traces * B1) @ traces.T
    if spring > 0.0:
        pull = traces @ (B1 * push)
        A -= 0.5 * _spring_share(B1, push, spring) * np.outer(pull, pull)
    return np.ascontiguousarray(A)


@njit
def _spring_share(B1: NDArray, push: NDArray, spring: float) -> float:
    """Force of the spring per displacement of the step without it [N/m]."""
    yields = 0.0
    for i in range(len(push)):
        yields += push[i] * push[i] * B1[i]
    return 0.5 * spring / (1.0 + 0.5 * spring * yields)


@sums
def _push_by_films(films: Films, bore: Guide | None, state: State, step: Step) -> None:
    for i in range(len(step.kick)):
        step.kick[i] = 0.0
        for k in range(len(films.lowest)):
            for c in range(3):
                step.kick[i] += films.rows[k, c, i] * state.films[k, c]
        if bore is not None:
            for k in range(len(films.room)):
                for c in range(2):
                    step.kick[i] += bore.traces[k, c, i] * state.bearing[k, c]


@sums
def _hold(step: Step, modes: Modes) -> float:
    """Let the spring answer the next force; returns its part [N]."""
    kick, push, B1, share = step.kick, modes.push, modes.B1, step.share
    if share == 0.0:
        return 0.0
    moved = 0.0
    for i in range(len(push)):
        moved += push[i] * B1[i] * kick[i]
    for i in range(len(push)):
        kick[i] -= push[i] * share * moved
    return -share * moved


@sums
def _add(step: Step, modes: Modes, factor: float) -> None:
    for i in range(len(step.kick)):
        step.whole[i] += factor * step.kick[i]
        step.q[i] += factor * modes.B1[i] * step.kick[i]
        step.v[i] += factor * modes.B2[i] * step.kick[i]


@sums
def _gather(traces: Matrix, force: Vector, factor: float, kick: Vector) -> None:
    for i in range(len(kick)):
        kick[i] = 0.0
    for k in range(len(force)):
        if force[k] > 0.0:
            a = factor * force[k]
            for i in range(len(kick)):
                kick[i] += a * traces[k, i]


@njit
def safe_flight(
    gap: NDArray,
    traces: NDArray,
    omega: NDArray,
    q: NDArray,
    v: NDArray,
    force: NDArray,
    horizon: float,
) -> float:
    """Time [s] during which no gap can close, at most ``horizon``.

    Rigid coordinates move as ``q + v t + f t^2 / 2``, elastic ones stay within their amplitude.

    Parameters
    ----------
    gap (n,) [m]
        At q = 0.
    force (M,)
        Constant modal forces.
    """
    n, modes = traces.shape
    swing = np.zeros(modes)
    for i in range(modes):
        if omega[i] > 0.0:
            still = force[i] / omega[i] ** 2
            swing[i] = abs(still) + np.sqrt((q[i] - still) ** 2 + (v[i] / omega[i]) ** 2)
    safe = horizon
    for k in range(n):
        distance = gap[k]
        speed = 0.0
        pull = 0.0
        for i in range(modes):
            if omega[i] > 0.0:
                distance -= abs(traces[k, i]) * swing[i]
            else:
                distance += traces[k, i] * q[i]
                speed += traces[k, i] * v[i]
                pull += traces[k, i] * force[i]
        if distance <= 0.0:
            return 0.0
        # distance + speed t + pull t^2 / 2 > 0 holds at least until then
        closing = max(-speed, 0.0)
        pull = max(-pull, 0.0)
        if closing > 0.0 or pull > 0.0:
            safe = min(safe, 2.0 * distance / (closing + np.sqrt(closing**2 + 2 * pull * distance)))
    return safe


@sums
def _payment(owed: float, slope: float, square: float) -> float:
    """Smaller root of ``owed + slope p + square p^2``; where it has none, its extremum."""
    inside = slope**2 - 4.0 * square * owed
    if inside < 0.0:
        return -0.5 * slope / square
    divisor = slope + np.sqrt(inside) * (1.0 if slope >= 0.0 else -1.0)
    return -2.0 * owed / divisor if divisor != 0.0 else 0.0


@sums
def _work(points: ContactPoints, before: Vector, step: Step) -> tuple[float, float]:
    """Work of the mean contact forces over a step, and the potential at its end [J]."""
    traces = points.traces
    work = 0.0
    stored = 0.0
    for k in range(len(points.gap)):
        if step.both[k] > 0.0:
            travel = 0.0
            end = points.gap[k]
            for i in range(len(before)):
                travel += traces[k, i] * (step.q[i] - before[i])
                end += traces[k, i] * step.q[i]
            work += 0.5 * step.both[k] * travel
            stored -= 0.5 * step.lam[k] * end
    return work, stored


@inner
def _start(
    modes: Modes, outside: Outside, bore: Guide | None, films: Films | None, n: int, rubs: int
) -> tuple[Step, GuideRub]:
    """Room for a step, the answer of the spring, and how much drag brakes the shaft."""
    M, guides = len(modes.push), 0
    work = None
    if films is not None:
        work = film_work(films, modes)
    if bore is not None:
        guides = len(bore.clearance)
    dragging = np.zeros(guides)
    if bore is not None:
        for k in range(guides):
            for j in range(guides):
                for i in range(M):
                    yields = abs(bore.slide[k, i] * bore.slide[j, i] * modes.B2[i])
                    dragging[k] += bore.viscous[j] * yields
    step = Step(
        _spring_share(modes.B1, modes.push, outside.spring),
        np.empty(M),
        np.empty(M),
        np.empty(M),
        np.empty(M),
        np.empty(M),
        np.empty(n),
        np.empty(n),
        np.zeros(n),
        np.empty(n),
        np.zeros((guides, 2)),
        dragging,
        np.empty(n + rubs if rubs else 0),
        np.empty(n + rubs if rubs else 0),
        np.zeros(M),
        np.zeros(rubs),
        np.zeros(rubs),
        np.empty(n if rubs else 0),
        work,
    )
    return step, no_rub(guides, M)


@sums
def _potential(points: ContactPoints, state: State) -> float:
    """Energy of the contact, -lam (gap + Phi q) / 2, since closed points have no gap [J].

    With friction also what its forces bend across the normals.
    """
    potential = 0.0
    for k in range(len(points.gap)):
        if state.lam[k] > 0.0:
            d = points.gap[k]
            for i in range(len(state.q)):
                d += points.traces[k, i] * state.q[i]
            potential -= 0.5 * state.lam[k] * d
    for i in range(len(state.rubbing.across)):
        potential += 0.5 * state.rubbing.across[i] * state.rubbing.bent[i]
    return potential


@sums
def _begin(modes: Modes, outside: Outside, bore: Guide | None, state: State, step: Step) -> float:
    """Forces known before the step, the guide's as they were; returns its drag [N]."""
    for i in range(len(modes.push)):
        step.known[i] = modes.push[i] * outside.constant
    braking = 0.0
    if bore is not None:
        for k in range(len(bore.clearance)):
            slide = 0.0
            for i in range(len(state.v)):
                slide += bore.slide[k, i] * state.v[i]
            # of the mean speed over the step
            drag = -bore.viscous[k] * slide / (1.0 + 0.5 * step.dragging[k])
            braking += drag
            for i in range(len(state.v)):
                step.known[i] += bore.slide[k, i] * drag
                for c in range(2):
                    step.known[i] += 0.5 * bore.traces[k, c, i] * state.guide_force[k, c]
    return braking


@sums
def _move(modes: Modes, state: State, step: Step) -> float:
    """Move the bodies over the step under all known forces; returns the spring's [N]."""
    A11, A12, B1, q, v = modes.A11, modes.A12, modes.B1, state.q, state.v
    pull, share = 0.0, step.share
    if share > 0.0:
        rest = 0.0
        for i in range(len(B1)):
            moved = (A11[i] + 1.0) * q[i] + A12[i] * v[i] + B1[i] * (step.known[i] + step.kick[i])
            rest += modes.push[i] * moved
        pull = -share * rest
        for i in range(len(B1)):
            step.known[i] += modes.push[i] * pull
    for i in range(len(B1)):
        step.whole[i] = step.known[i] + step.kick[i]
        step.q[i] = A11[i] * q[i] + A12[i] * v[i] + B1[i] * step.whole[i]
        step.v[i] = modes.A21[i] * q[i] + modes.A22[i] * v[i] + modes.B2[i] * step.whole[i]
    return pull


@sums
def _press(modes: Modes, bore: Guide, step: Step, k: int) -> float:
    """Keep the shaft in its disc of clearance; returns what the spring adds [N]."""
    step.normal[k, 0] = 0.0
    step.normal[k, 1] = 0.0
    x, y = bore.offset[k, 0], bore.offset[k, 1]
    for i in range(len(step.q)):
        x += bore.traces[k, 0, i] * step.q[i]
        y += bore.traces[k, 1, i] * step.q[i]
    distance = np.sqrt(x**2 + y**2)
    if not distance > bore.clearance[k]:
        return 0.0
    nx, ny = x / distance, y / distance
    C = bore.compliance[k]
    soft = nx * nx * C[0, 0] + 2.0 * nx * ny * C[0, 1] + ny * ny * C[1, 1]
    for i in range(len(step.q)):
        t = nx * bore.traces[k, 0, i] + ny * bore.traces[k, 1, i]
        soft += 0.5 * t * t * modes.B1[i]
    press = (distance - bore.clearance[k]) / soft
    step.normal[k, 0] = -press * nx
    step.normal[k, 1] = -press * ny
    for i in range(len(step.q)):
        step.kick[i] = 0.5 * (
            step.normal[k, 0] * bore.traces[k, 0, i] + step.normal[k, 1] * bore.traces[k, 1, i]
        )
    answer = _hold(step, modes)
    for i in range(len(step.q)):
        step.known[i] += step.kick[i]
    _add(step, modes, 1.0)
    return answer


@sums
def _look(points: ContactPoints, step: Step) -> tuple[float, float]:
    """Gaps without new contact forces: the smallest, and the largest magnitude [m]."""
    least, widest = 1e300, 0.0
    for k in range(len(points.gap)):
        row, gap = points.traces[k], points.gap[k]
        for i in range(len(step.q)):
            gap += row[i] * step.q[i]
        step.open_gap[k] = gap
        least = min(least, gap)
        widest = max(widest, abs(gap))
        step.lam[k] = 0.0
    return least, widest


@sums
def _turned(points: ContactPoints, state: State, step: Step) -> bool:
    """Whether the contact pushes opposite to the last one."""
    axial = 0.0
    for k in range(len(points.gap)):
        axial += points.axial[k] * step.lam[k]
    if axial * state.books[DIRECTION] < 0.0:
        return True
    if axial != 0.0:
        state.books[DIRECTION] = 1.0 if axial > 0.0 else -1.0
    return False


@sums
def _close(points: ContactPoints, state: State, step: Step) -> float:
    """Let the new contact forces act; returns the smallest gap [m]."""
    least = 1e300
    for k in range(len(points.gap)):
        if step.lam[k] > 0.0:
            state.carried[k] = True
        least = min(least, step.gap[k])
    _gather(points.traces, step.lam, 0.5, step.kick)
    push_across(points.grip, state.rubbing.forces, len(points.gap), 0.5, step.kick)
    return least


@sums
def _touch(
    points: ContactPoints,
    grip: Grip | None,
    limit: Limit | None,
    layer: Layer | None,
    state: State,
    step: Step,
    widest: float,
) -> int:
    """Contact forces at the end of the step; returns the rounds, below zero on failure."""
    n, diagonal = len(points.gap), 0.0
    for k in range(n):
        diagonal += points.A[k, k] / n
    tolerance = max(1e-15, 1e-13 * widest)
    lam, gap = step.lam, step.gap
    if grip is not None:
        return rub(points, grip, state, step, tolerance / diagonal)
    if limit is not None:
        worn, contact = state.worn, state.contact
        return solve_yielding(
            points.A, step.open_gap, limit, worn, contact, lam, gap, tolerance, diagonal
        )
    if layer is not None:
        rounds = solve_rough(points.A, step.open_gap, layer, state.pressed, lam, gap)
        state.contact.counts[0] = 0
        for k in range(n):
            state.contact.counts[0] += lam[k] != 0.0
        return rounds
    return solve_active(points.A, step.open_gap, state.contact, lam, gap, tolerance, diagonal)


@sums
def _take_up(
    points: ContactPoints, limit: Limit | None, layer: Layer | None, state: State, step: Step
) -> float:
    """Loss of faces that yield, or energy of asperities beyond the potential [J]."""
    taken = 0.0
    if limit is not None:
        taken = let_yield(limit, state.worn, step.lam, points.gap)
        state.books[PLASTIC] += taken
    if layer is not None:
        held = layer_energy(layer, step.lam, step.gap)
        taken = held - state.books[LAYER]
        state.books[LAYER] = held
    return taken


@sums
def _pay(
    modes: Modes,
    points: ContactPoints,
    state: State,
    step: Step,
    potential: float,
    answer: float,
    yielded: float,
) -> tuple[float, float, float]:
    """Work of the mean contact forces on d = gap + Phi q against the potential, and the payment.

    ``yielded`` [J] is the loss of faces that yield.  Returns the payment as share of the forces,
    the potential at the end, and the answer of the spring to the contact.
    """
    for k in range(len(points.gap)):
        step.both[k] = state.lam[k] + step.lam[k]
    work, stored = _work(points, state.q, step)
    whole_step = potential > 0.0 and stored > 0.0
    owed = state.books[DEBT] + work + stored - potential + yielded
    rubs, sideways = points.grip is not None and work != 0.0, 0.0
    if rubs:
        sideways = across(points.grip, state, step)
        owed += sideways
    pay = 0.0
    if owed != 0.0 and abs(work) > _PAY_FROM * (potential + stored):
        limit = 1.0
        if whole_step:  # what the contact still holds must suffice
            limit = min(max(_PAY_LIMIT, 2.0 * abs(owed) / potential), 1.0)
        pay = min(max(-owed / work, -limit), limit)
        _gather(points.traces, step.both, 0.5 * pay, step.kick)
        back = _hold(step, modes)
        answer += back
        _add(step, modes, 1.0)
        first, kept = _work(points, state.q, step)
        change = 0.0
        if rubs:
            change = across(points.grip, state, step) - sideways
        if whole_step or pay == 0.0:
            work, stored = first, kept  # what is left of the debt comes next
        else:
            # the last chance: both are linear in the payment, the balance is quadratic
            work_slope, stored_slope = (first - work) / pay, (kept - stored) / pay
            slope = work + work_slope + stored_slope + change / pay
            exact = _payment(owed, slope, work_slope)
            exact = min(max(exact, -limit), limit)
            more = exact / pay - 1.0
            answer += more * back
            _add(step, modes, more)
            pay = exact
            work += pay * work_slope
            stored += pay * stored_slope
    state.books[DEBT] += (1.0 + pay) * work + stored - potential + yielded
    if rubs:
        state.books[DEBT] += across(points.grip, state, step)
        stored += held_across(points.grip, state.rubbing, step.bent)
    return pay, stored, answer


@sums
def _balance(
    modes: Modes,
    points: ContactPoints,
    state: State,
    step: Step,
    potential: float,
    answer: float,
    held: float,
) -> tuple[float, float]:
    """Weigh the forces of rough points so that their work is the change of energy.

    ``held`` [J] is the energy of the layers beyond the potential.  Returns the potential at the
    end, and the answer of the spring to the contact.
    """
    n, M = len(points.gap), len(state.q)
    for i in range(M):
        step.kick[i] = 0.0
    for k in range(n):
        step.both[k] = state.lam[k] + step.lam[k]
        change = step.lam[k] - state.lam[k]
        if change != 0.0:
            for i in range(M):
                step.kick[i] += change * points.traces[k, i]
    back = _hold(step, modes)
    work, stored = _work(points, state.q, step)
    slope, square, given = 0.0, 0.0, 0.0
    for k in range(n):
        if step.both[k] > 0.0:
            travel, moved = 0.0, 0.0
            for i in range(M):
                travel += points.traces[k, i] * (step.q[i] - state.q[i])
                moved += points.traces[k, i] * modes.B1[i] * step.kick[i]
            change = step.lam[k] - state.lam[k]
            slope += change * (travel - 0.5 * moved)
            square += change * moved
            given += 0.5 * step.lam[k] * moved
    weight = _payment(state.books[DEBT] + work + stored - potential + held, slope, square)
    weight = min(max(weight, -0.5), 0.5)
    _add(step, modes, weight)
    for k in range(n):
        step.both[k] += 2.0 * weight * (step.lam[k] - state.lam[k])
    work, stored = _work(points, state.q, step)
    # the forces are not solved for anew: they have done -lam moved, twice what ``stored`` counts
    held -= weight * given
    state.books[LAYER] -= weight * given
    state.books[DEBT] += work + stored - potential + held
    return stored, answer + weight * back


@sums
def _settle(
    modes: Modes,
    points: ContactPoints,
    layer: Layer | None,
    state: State,
    step: Step,
    potential: float,
    answer: float,
    taken_up: float,
) -> tuple[float, float, float]:
    """Balance the energy of the step; returns as :func:`_pay`."""
    if layer is not None:
        stored, answer = _balance(modes, points, state, step, potential, answer, taken_up)
        return 0.0, stored, answer
    return _pay(modes, points, state, step, potential, answer, taken_up)


@sums
def _tell_forces(
    points: ContactPoints, state: State, step: Step, pay: float, record: Record, taken: int
) -> None:
    force = 0.0
    for c in range(record.stops.shape[1]):
        record.stops[taken, c, 0] = 0.0
    for k in range(len(points.gap)):
        mean = 0.5 * (1.0 + pay) * step.both[k]
        force += points.axial[k] * mean
        if record.stops.shape[1]:
            record.stops[taken, points.stop[k], 0] += points.axial[k] * mean
        if len(record.points):
            record.points[taken, k] = mean
    for c in range(record.stops.shape[1]):
        record.stops[taken, c, 1] = record.stops[taken, c, 0]
    force += tell_friction(points.grip, points.stop, state.rubbing, record, taken, force)
    record.force[taken] = force
    if state.contact.counts[0] > 0:
        state.books[OPEN_STEPS] = 0.0
        state.books[CONTACT_STEPS] += 1.0
    elif state.books[OPEN_STEPS] >= 0.0:
        state.books[OPEN_STEPS] += 1.0


@sums
def _count(
    modes: Modes, outside: Outside, bore: Guide | None, state: State, step: Step, axial: float
) -> None:
    """Add the step to the sums of energy; ``axial`` [N] is the force from outside."""
    books, q, v, loss = state.books, state.q, state.v, modes.loss
    moved = 0.0
    for i in range(len(q)):
        moved += modes.push[i] * (step.q[i] - q[i])
    books[WORK] += outside.constant * moved
    if len(loss):
        for i in range(len(q)):
            books[DAMPING] += (
                loss[0, i] * q[i] ** 2
                + loss[1, i] * q[i] * v[i]
                + loss[2, i] * v[i] ** 2
                + step.whole[i]
                * (loss[3, i] * q[i] + loss[4, i] * v[i] + loss[5, i] * step.whole[i])
            )
    if bore is not None:
        given = 0.0
        for i in range(len(q)):
            part = step.known[i] - modes.push[i] * axial
            given += part * (step.q[i] - q[i])
        held = 0.0
        for k in range(len(bore.clearance)):
            for c in range(2):
                for d in range(2):
                    held += 0.5 * step.normal[k, c] * bore.compliance[k, c, d] * step.normal[k, d]
                state.guide_force[k, c] = step.normal[k, c]
        books[GUIDE] -= given + held - books[GUIDE_STRAIN]
        books[GUIDE_STRAIN] = held


@sums
def _finish(
    modes: Modes,
    state: State,
    step: Step,
    record: Record,
    taken: int,
    gap: float,
    outside: float,
) -> None:
    record.gap[taken] = gap
    record.outside[taken] = outside
    for i in range(len(state.q)):
        state.q[i] = step.q[i]
        state.v[i] = step.v[i]
        if len(record.places):
            record.places[taken, i] = step.q[i]
    for k in range(len(step.lam)):
        state.lam[k] = step.lam[k]
    for b in range(modes.drift.shape[0]):
        s = 0.0
        for i in range(len(state.v)):
            s += modes.drift[b, i] * state.v[i]
        record.drift[taken, b] = s


@sums
def _apart(
    others: Others | None,
    films: Films | None,
    state: State,
    step: Step,
    time: float,
    least: float,
) -> bool:
    """Whether points that are left out have larger gaps than the others, and no contact."""
    if others is None:
        return True
    rigid, elastic, pressed = 0.0, 0.0, 0.0
    for i in range(len(step.q)):
        other = step.q[i] - others.place[i] - time * others.speed[i]
        if i < others.rigid:
            rigid += other * other
        else:
            elastic += other * other
    for k in range(len(step.lam)):
        pressed += step.lam[k]
    room = others.room - others.reach[0] * np.sqrt(rigid) - others.reach[1] * np.sqrt(elastic)
    room -= others.reach[2] * pressed
    if films is not None:
        for k in range(len(films.lowest)):
            D, bent = films.compliance[k], others.bend[k]
            for c in range(3):
                bend = 0.0
                for d in range(3):
                    bend += D[c, d] * (state.films[k, d] - bent[d])
                room -= abs(bend) * (1.0 if c == 0 else others.arm)
    return room > max(least, 0.0)


@njit
def march(
    steps: int,
    wait: int,
    modes: Modes,
    outside: Outside,
    points: ContactPoints,
    bore: Guide | None,
    films: Films | None,
    state: State,
    record: Record,
) -> tuple[int, int]:
    """Advance by up to ``steps`` steps, in place; returns the steps taken and a status.

    Parameters
    ----------
    wait
        Return :data:`OPEN` when no point has carried for so many steps after a contact; 0: never.
    bore, films
        None without any: their code is not compiled then.
    record
        Out, for at least ``steps`` steps.
    """
    n, rubs = len(points.gap), len(state.rubbing.across)
    step, guide = _start(modes, outside, bore, films, n, rubs)
    return _advance(steps, wait, modes, outside, points, bore, films, state, record, step, guide)


@inner(_nrt=False, error_model="numpy", fastmath=FAST)
def _advance(
    steps: int,
    wait: int,
    modes: Modes,
    outside: Outside,
    points: ContactPoints,
    bore: Guide | None,
    films: Films | None,
    state: State,
    record: Record,
    step: Step,
    guide: GuideRub,
) -> tuple[int, int]:
    """As :func:`march`, without counted references."""
    n, books, rubs_guide = len(points.gap), state.books, False
    if films is not None:
        for k in range(len(films.lowest)):
            bend_faces(films, k, film_change(state, k, 1.0, 0.0), points.gap)
    potential = _potential(points, state)
    smallest = 0.0  # gap of the step before
    for taken in range(steps):
        braking = _begin(modes, outside, bore, state, step)
        _gather(points.traces, state.lam, 0.5, step.kick)
        push_across(points.grip, state.rubbing.across, 0, 0.5, step.kick)
        axial = outside.constant + _move(modes, state, step)
        if bore is not None:
            for k in range(len(bore.clearance)):
                axial += _press(modes, bore, step, k)
            rubs_guide = begin_rub(bore, state.guide_force, step.normal, guide)
            if rubs_guide:
                axial += rub_guide(modes, guide, state.q, step)
        if films is not None:
            begin_films(films, step.film, state, modes.step, taken == 0)
            _push_by_films(films, bore, state, step)
            _add(step, modes, 1.0)
            for _ in range(_SWEEPS):
                moved = 0.0
                for k in range(len(films.lowest)):
                    change = squeeze(films, k, modes.step, state, step, step.film)
                    if change < 0.0:
                        return taken, FAILED
                    _add(step, modes, 1.0)
                    moved = max(moved, change)
                if bore is not None and len(films.room):
                    change = squeeze_guide(films, modes, bore, state, step.q, step.kick)
                    if change < 0.0:
                        return taken, FAILED
                    _add(step, modes, 1.0)
                    moved = max(moved, change)
                if len(films.lowest) + (len(films.room) > 0) == 1:
                    break
                if moved <= _SETTLED:
                    break
            for k in range(len(films.lowest)):
                tell_land(films, k, step.film, state, step.q, record.lands[taken, k])
                bend_faces(films, k, film_change(state, k, 1.0, -1.0), points.gap)
        least, lowest = 0.0, 0.0
        answer = 0.0  # of the spring to the forces of the contact
        taken_up = 0.0  # by what yields, or by layers beyond the potential
        if n:
            least, widest = _look(points, step)
            lowest = least
            if least < 0.0 or state.contact.counts[0] > 0:
                rounds = _touch(
                    points, points.grip, points.limit, points.layer, state, step, widest
                )
                if rounds < 0:
                    return taken, FAILED
                if wait and _turned(points, state, step):
                    return taken, TURNED
                books[ROUNDS] += rounds
                taken_up = _take_up(points, points.limit, points.layer, state, step)
                if films is not None:
                    hold_films(films, step.film, step.lam)
                    for k in range(len(films.lowest)):
                        taken_up += bulk_work(films, k, step.film, state)
                least = _close(points, state, step)
                answer += _hold(step, modes)
                _add(step, modes, 1.0)
                begin_offsets(points.grip, state, step)
                if bore is not None and rubs_guide:
                    axial += rub_guide(modes, guide, state.q, step)
            if state.contact.counts[0] == 0:
                forget(points.grip, state.rubbing, step)
            pay, potential, answer = _settle(
                modes, points, points.layer, state, step, potential, answer, taken_up
            )
            _tell_forces(points, state, step, pay, record, taken)
            if not _apart(points.others, films, state, step, (taken + 1) * modes.step, lowest):
                return taken, LEFT_OUT
        _count(modes, outside, bore, state, step, axial)
        if films is not None:
            for k in range(len(films.lowest)):
                count_squeeze(films, k, step.film, state, step.q, modes.step)
                record.film[taken, k] = films.axial[k] * state.films[k, 0]
            if bore is not None:
                for k in range(len(films.room)):
                    count_bearing(k, bore, state, step.q)
        if bore is not None:
            for k in range(len(guide.most)):
                braking += guide.force[k, 0]
        mean_gap = 0.5 * (least + smallest) if taken else least
        remember(points.grip, state, step)
        _finish(modes, state, step, record, taken, mean_gap, axial + answer + braking)
        smallest = least
        if wait and books[OPEN_STEPS] > wait:
            return taken + 1, OPEN
    if films is not None:
        for k in range(len(films.lowest)):
            bend_faces(films, k, film_change(state, k, -1.0, 0.0), points.gap)
    return steps, FINISHED


@sums
def _low_gaps(
    points: ContactPoints, near: Near, films: Films | None, state: State, time: float
) -> float:
    """Least gap of each point within a time at its speed, and the least of all [m]."""
    least = 1e300
    for k in range(len(points.gap)):
        row, gap, speed = points.traces[k], points.gap[k], 0.0
        for i in range(len(state.q)):
            gap += row[i] * state.q[i]
            speed += row[i] * state.v[i]
        near.low[k] = gap + min(speed * time, 0.0)
    if films is not None:
        for f in range(len(films.lowest)):
            D = films.compliance[f]
            for k in range(films.span[f, 0], films.span[f, 1]):
                for c in range(3):
                    for d in range(3):
                        near.low[k] += films.arms[f, k, c] * D[c, d] * state.films[f, d]
    for k in range(len(points.gap)):
        least = min(least, near.low[k])
    return least


@sums
def _choose(
    points: ContactPoints, near: Near, films: Films | None, state: State, time: float, margin: float
) -> tuple[int, float]:
    """Points that may close within a time, and the least gap of all others [m].

    Those of the last time where they are enough.
    """
    n, M, known = len(points.gap), len(state.q), near.known
    if n == 0:
        return 0, 1e300
    cut, room = max(_low_gaps(points, near, films, state, time), 0.0), 1e300
    enough = known[0] > 0.0 and known[1] == points.A[0, 0]
    for k in range(n):
        if near.place[k] < 0:
            room = min(room, near.low[k])
            enough = enough and not (state.lam[k] > 0.0 or state.contact.active[k])
    if enough and room > cut + 0.5 * margin:
        return int(known[0]), room
    m, room = 0, 1e300
    for k in range(n):
        near.place[k] = -1
        if near.low[k] < cut + margin or state.lam[k] > 0.0 or state.contact.active[k]:
            near.chosen[m] = k
            near.place[k] = m
            m += 1
        else:
            room = min(room, near.low[k])
    for s in range(m):
        row, trace = points.A[near.chosen[s]], points.traces[near.chosen[s]]
        for j in range(m):
            near.block[s * m + j] = row[near.chosen[j]]
        for i in range(M):
            near.rows[s * M + i] = trace[i]
    known[0], known[1] = float(m), points.A[0, 0]
    return m, room


@inner
def _films_at(films: Films | None, points: Index) -> Films | None:
    """The same films at some of the contact points."""
    if films is None:
        return None
    span = np.zeros_like(films.span)
    span[:, 1] = len(points)
    return Films(
        films.rows,
        films.offset,
        films.lowest,
        films.reach,
        films.viscosity,
        films.tension,
        films.shear,
        films.axial,
        films.arms[:, points],
        span,
        films.compliance,
        films.bearing,
        films.room,
        films.sizes,
        films.ways,
        films.worked,
        films.between,
        films.along,
        films.around,
        films.load,
        films.area,
    )


@njit
def march_near(
    steps: int,
    margin: float,
    modes: Modes,
    outside: Outside,
    points: ContactPoints,
    near: Near,
    bore: Guide | None,
    films: Films | None,
    state: State,
    record: Record,
) -> int:
    """:func:`march` of all steps with those elastic points that may close in them; a status.

    :data:`LEFT_OUT` where one that was left out may have closed: then with more ``margin`` [m].
    """
    M, contact = len(state.q), state.contact
    m, room = _choose(points, near, films, state, steps * modes.step, margin)
    index, carrying = near.chosen[:m], contact.counts[0]
    lam, carried, active = state.lam[index], state.carried[index], contact.active[index]
    order = near.place[contact.points[: max(carrying, 1)]]
    own = np.zeros(m, dtype=np.int64)
    own[:carrying] = order[:carrying]
    told = np.zeros((len(record.points), m), dtype=np.float32)
    some = ContactPoints(
        near.block[: m * m].reshape((m, m)),
        near.rows[: m * M].reshape((m, M)),
        points.gap[index],
        points.axial[index],
        points.stop[index],
        None,
        None,
        None,
        Others(
            room,
            state.q.copy(),
            state.v.copy(),
            near.rigid,
            near.reach,
            state.films[:, :3].copy(),
            near.arm,
        ),
    )
    here = State(
        state.q,
        state.v,
        lam,
        ActiveSet(active, own, contact.inverse, contact.counts),
        state.rubbing,
        state.worn,
        state.pressed,
        carried,
        state.guide_force,
        state.films,
        state.bearing,
        state.books,
    )
    into = Record(
        record.force,
        record.gap,
        record.drift,
        record.outside,
        told,
        record.pressed,
        record.across,
        record.doing,
        record.film,
        record.lands,
        record.places,
        record.stops,
    )
    squeezed = _films_at(films, index)
    step, guide = _start(modes, outside, bore, films, m, 0)
    _, status = _advance(steps, 0, modes, outside, some, bore, squeezed, here, into, step, guide)
    state.lam[:] = 0.0
    contact.active[:] = False
    record.points[:] = 0.0
    for s in range(m):
        k = index[s]
        state.lam[k], state.carried[k], contact.active[k] = lam[s], carried[s], active[s]
        for i in range(len(told)):
            record.points[i, k] = told[i, s]
    for s in range(contact.counts[0]):
        contact.points[s] = index[own[s]]
    return status
