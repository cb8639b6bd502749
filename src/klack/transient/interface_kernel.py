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
:math:`\varepsilon = 0` a step misses it by :math:`\tfrac12 (\lambda_0^T g_1 - \lambda_1^T g_0)`,
which only points that close or open within the step feel.  :math:`\varepsilon` pays that back in
the same step: some 1e-6 of the force, at most 1e-3, and as much as it takes in the first and the
last step of a contact, which are closed for a part only.  What is left is owed to the next step
and never adds up.

A spring that holds the moving body at :math:`y = p^T q` pulls with its mean force over the step,
:math:`-k (y_0 + y_1) / 2`, so that its work is exactly what its energy changes by.  As :math:`y_1`
follows from all forces of the step, each force comes with the answer of the spring,

.. math:: f \to f - p \, \kappa \, p^T B_1 f, \qquad
    \kappa = \frac{k / 2}{1 + \tfrac{k}{2} p^T B_1 p} ,

and the matrix of the complementarity problem loses
:math:`\tfrac12 \kappa (\Phi B_1 p) (\Phi B_1 p)^T` (:func:`contact_compliance`).

The inverse of the active block of that matrix is carried along: a point that closes borders it, a
point that opens takes a row out, each at the cost of one product with it.
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = [
    "FAILED",
    "FINISHED",
    "OPEN",
    "TURNED",
    "contact_compliance",
    "march",
    "safe_flight",
    "solve_active",
]

FINISHED, OPEN, FAILED, TURNED = 0, 1, 2, 3
"""Why :func:`march` returned.

All steps done; open for long enough; no active set found; a contact would begin that pushes the
other way (the other stop), and that step is not taken.
"""

_FAST_ROUNDS = 60
_REFRESH = 256
"""Changes of the active set after which its inverse is computed afresh."""

_PAY_LIMIT = 1e-3
"""Share of a contact force that may always pay the energy debt.

More may, where the debt is more than that share of the energy that the contact holds."""


def contact_compliance(
    local: NDArray, traces: NDArray, B1: NDArray, push: NDArray, spring: float
) -> NDArray:
    """Matrix A of :func:`march`: gaps at the end of a step per contact force there, (n, n) [m/N].

    Parameters
    ----------
    local : array, shape (n, n) [m/N]
        Of what the modes do not carry.
    traces, B1, push, spring
        As in :func:`march`.
    """
    A = local + 0.5 * (traces * B1) @ traces.T
    if spring > 0.0:
        pull = traces @ (B1 * push)
        A -= 0.5 * _spring_share(B1, push, spring) * np.outer(pull, pull)
    return np.ascontiguousarray(A)


@njit(cache=True)
def _spring_share(B1: NDArray, push: NDArray, spring: float) -> float:
    """Force of the spring per displacement that the step would have without it [N/m]."""
    yields = 0.0
    for i in range(len(push)):
        yields += push[i] * push[i] * B1[i]
    return 0.5 * spring / (1.0 + 0.5 * spring * yields)


@njit(cache=True)
def _hold(kick: NDArray, push: NDArray, B1: NDArray, share: float) -> float:
    """Let the spring answer a force; returns its part [N]."""
    if share == 0.0:
        return 0.0
    moved = 0.0
    for i in range(len(push)):
        moved += push[i] * B1[i] * kick[i]
    for i in range(len(push)):
        kick[i] -= push[i] * share * moved
    return -share * moved


@njit(cache=True)
def _rebuild(A: NDArray, B: NDArray, index: NDArray, m: int) -> None:
    block = np.empty((m, m))
    for i in range(m):
        for j in range(m):
            block[i, j] = A[index[i], index[j]]
    inverse = np.linalg.inv(block)
    for i in range(m):
        for j in range(m):
            B[i, j] = 0.5 * (inverse[i, j] + inverse[j, i])


@njit(cache=True)
def _border(A: NDArray, B: NDArray, index: NDArray, m: int, j: int, u: NDArray) -> bool:
    """Take point j into the active set; False when the matrix is not positive definite."""
    row = A[j]
    for i in range(m):
        u[i] = 0.0
    for k in range(m):
        a = row[index[k]]
        for i in range(m):
            u[i] += a * B[k, i]
    s = row[j]
    for k in range(m):
        s -= row[index[k]] * u[k]
    if not s > 1e-13 * row[j]:
        return False
    inverse = 1.0 / s
    for k in range(m):
        scaled = u[k] * inverse
        for i in range(m):
            B[k, i] += scaled * u[i]
        B[k, m] = -scaled
        B[m, k] = -scaled
    B[m, m] = inverse
    index[m] = j
    return True


@njit(cache=True)
def _take_out(B: NDArray, index: NDArray, m: int, place: int) -> None:
    """Take the point at ``place`` out; the last one moves there."""
    last = m - 1
    if place != last:
        for i in range(m):
            B[place, i], B[last, i] = B[last, i], B[place, i]
        for i in range(m):
            B[i, place], B[i, last] = B[i, last], B[i, place]
        index[place], index[last] = index[last], index[place]
    inverse = 1.0 / B[last, last]
    for k in range(last):
        scaled = B[k, last] * inverse
        for i in range(last):
            B[k, i] -= scaled * B[last, i]


@njit(cache=True)
def solve_active(
    A: NDArray,
    q: NDArray,
    active: NDArray,
    index: NDArray,
    B: NDArray,
    counts: NDArray,
    lam: NDArray,
    gap: NDArray,
    tolerance: float,
    scale: float,
) -> int:
    """Complementarity problem with a warm active set; returns the rounds, -1 without a solution.

    Parameters
    ----------
    A : array, shape (n, n) [m/N]
    q : array, shape (n,) [m]
        Gaps without contact forces.
    active : bool array, shape (n,)
        In: first guess, that of ``index``; out: the points that carry.
    index : int array, shape (n,)
    B : array, shape (n, n) [N/m]
        Inverse of A over the first ``counts[0]`` points of ``index``.
    counts : int array, shape (2,)
        Active points; changes since the inverse was computed afresh.
    lam, gap : array, shape (n,) [N], [m]
        Out.
    tolerance : float [m]
        Gap that counts as zero; over ``scale`` [m/N] the force that does.
    """
    n = len(q)
    u = np.empty(n)
    bad = np.empty(n, dtype=np.int64)
    best = n + 1
    stalled = 0
    for rounds in range(1, 200 + 10 * n):
        m = counts[0]
        for k in range(m):
            u[k] = 0.0
        for k in range(m):
            a = -q[index[k]]
            for i in range(m):
                u[i] += a * B[k, i]
        for i in range(n):
            gap[i] = q[i]
        for k in range(m):
            a = u[k]
            row = A[index[k]]
            for i in range(n):
                gap[i] += a * row[i]
        wrong = 0
        for k in range(m):
            gap[index[k]] = 0.0
            if u[k] < -tolerance / scale:
                bad[wrong] = index[k]
                wrong += 1
        for i in range(n):
            if not active[i] and gap[i] < -tolerance:
                bad[wrong] = i
                wrong += 1
        if wrong == 0:
            for i in range(n):
                lam[i] = 0.0
            for k in range(m):
                lam[index[k]] = max(u[k], 0.0)
            return rounds
        if wrong < best:
            best = wrong
            stalled = 0
        else:
            stalled += 1
        # far from the solution all wrong points are flipped at once, else only the last (Murty)
        first = 0
        if rounds > _FAST_ROUNDS or stalled > 8:
            highest = 0
            for k in range(wrong):
                if bad[k] > bad[highest]:
                    highest = k
            bad[0] = bad[highest]
            wrong = 1
        many = wrong > max(24, m // 4)
        for k in range(first, wrong):
            j = bad[k]
            if active[j]:
                place = 0
                while index[place] != j:
                    place += 1
                if many:
                    index[place] = index[counts[0] - 1]
                else:
                    _take_out(B, index, counts[0], place)
                counts[0] -= 1
                active[j] = False
            else:
                if many:
                    index[counts[0]] = j
                elif not _border(A, B, index, counts[0], j, u):
                    return -1
                counts[0] += 1
                active[j] = True
            counts[1] += 1
        if counts[0] and (many or counts[1] > _REFRESH):
            _rebuild(A, B, index, counts[0])
            counts[1] = 0
    return -1


@njit(cache=True)
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
    gap : array, shape (n,) [m]
        At q = 0.
    traces : array, shape (n, M)
    omega, q, v, force : array, shape (M,)
        Frequencies, state and constant modal forces.
    horizon : float [s]
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


@njit(cache=True)
def _payment(owed: float, slope: float, square: float) -> float:
    """Smaller root of ``owed + slope p + square p^2``; where it has none, its extremum."""
    inside = slope**2 - 4.0 * square * owed
    if inside < 0.0:
        return -0.5 * slope / square
    divisor = slope + np.sqrt(inside) * (1.0 if slope >= 0.0 else -1.0)
    return -2.0 * owed / divisor if divisor != 0.0 else 0.0


@njit(cache=True)
def _work(
    gap0: NDArray, traces: NDArray, lam: NDArray, new: NDArray, before: NDArray, after: NDArray
) -> tuple[float, float]:
    """Work of the mean contact forces over a step, and the potential at its end [J]."""
    n, modes = traces.shape
    work = 0.0
    stored = 0.0
    for k in range(n):
        if lam[k] > 0.0 or new[k] > 0.0:
            travel = 0.0
            end = gap0[k]
            for i in range(modes):
                travel += traces[k, i] * (after[i] - before[i])
                end += traces[k, i] * after[i]
            work += 0.5 * (lam[k] + new[k]) * travel
            stored -= 0.5 * new[k] * end
    return work, stored


@njit(cache=True)
def march(
    steps: int,
    wait: int,
    step: float,
    A: NDArray,
    traces: NDArray,
    gap0: NDArray,
    axial: NDArray,
    drift: NDArray,
    propagator: NDArray,
    loss: NDArray,
    push: NDArray,
    constant: float,
    spring: float,
    guide_traces: NDArray,
    guide_slide: NDArray,
    guide_offset: NDArray,
    guide_clearance: NDArray,
    guide_compliance: NDArray,
    guide_friction: NDArray,
    guide_viscous: NDArray,
    slip_speed: float,
    q: NDArray,
    v: NDArray,
    lam: NDArray,
    active: NDArray,
    index: NDArray,
    B: NDArray,
    counts: NDArray,
    guide_force: NDArray,
    books: NDArray,
    carried: NDArray,
    out_force: NDArray,
    out_gap: NDArray,
    out_drift: NDArray,
    out_outside: NDArray,
    out_points: NDArray,
) -> tuple[int, int]:
    """Advance by up to ``steps`` steps; the state arrays are changed in place.

    Parameters
    ----------
    steps : int
    wait : int
        Return :data:`OPEN` when no point has carried for so many steps after a contact; 0: never.
    step : float [s]
    A : array, shape (n, n) [m/N]
        Of :func:`contact_compliance`; n = 0: flight, no contact is looked at.
    traces, gap0, axial : array, shape (n, M), (n,), (n,)
    drift : array, shape (bodies, M)
        Centres of mass.
    propagator : array, shape (6, M)
        A11, A12, A21, A22, B1, B2.
    loss : array, shape (6, M) or (0, M)
        Q11, Q12, Q22, L1, L2, S of the modal damping; none: undamped.
    push : array, shape (M,)
        Modal force of 1 N along +z on the moving body, spread over its mass.
    constant, spring : float [N], [N/m]
        Outside force along +z, and stiffness of the spring that pulls the moving body back to
        where it started.
    guide_traces : array, shape (k, 2, M)
        Displacement of the shaft across the axis at each height.
    guide_slide : array, shape (k, M)
        The same along the axis.
    guide_offset : array, shape (k, 2) [m]
        Position of the shaft across the axis at q = 0.
    guide_clearance, guide_friction, guide_viscous : array, shape (k,) [m], [-], [N s/m]
    guide_compliance : array, shape (k, 2, 2) [m/N]
    slip_speed : float [m/s]
        Below it Coulomb friction fades out.
    q, v, lam : array
        State.
    active, index, B, counts : array
        Of :func:`solve_active`.
    guide_force : array, shape (k, 2) [N]
        On the shaft, at the start of the next step.
    books : array, shape (9,)
        0 damping loss, 1 work of the constant force, 2 guide (friction and its numerical part),
        3 energy debt of the contact, 4 strain energy of the guides, 5 steps since the last contact
        (-1 before the first), 6 LCP rounds, 7 steps with contact, 8 direction of the last contact
        force (0 before the first).
    carried : bool array, shape (n,)
        Points that have carried a force.
    out_force, out_gap, out_outside : array, shape (>= steps,)
        Mean axial contact force, mean smallest gap, mean outside axial force.
    out_drift : array, shape (>= steps, bodies)
        Velocity of the centres of mass at the end of each step.
    out_points : float32 array, shape (>= steps, n) or (0, n)
        Mean force of every point.

    Returns
    -------
    taken, status : int
    """
    n, modes = traces.shape
    bodies = drift.shape[0]
    guides = len(guide_clearance)
    A11, A12, A21, A22, B1, B2 = propagator
    share = _spring_share(B1, push, spring)
    diagonal = 0.0
    for k in range(n):
        diagonal += A[k, k] / n
    before = np.empty(modes)
    f = np.empty(modes)
    whole = np.empty(modes)
    qf = np.empty(modes)
    vf = np.empty(modes)
    kick = np.empty(modes)
    open_gap = np.empty(n)
    gap = np.empty(n)
    new = np.zeros(n)
    normal = np.zeros((guides, 2))
    free = np.zeros((guides, 2))
    # change of the sliding speed in a step per force, and per speed with drag, at all heights alike
    mobility = np.zeros(guides)
    damped = np.zeros(guides)
    for k in range(guides):
        for j in range(guides):
            for i in range(modes):
                yields = abs(guide_slide[k, i] * guide_slide[j, i] * B2[i])
                mobility[k] += yields
                damped[k] += guide_viscous[j] * yields
    debt = books[3]
    potential = 0.0
    # potential of the contact: -lam (gap0 + Phi q) / 2, since closed points have no gap
    for k in range(n):
        if lam[k] > 0.0:
            d = gap0[k]
            for i in range(modes):
                d += traces[k, i] * q[i]
            potential -= 0.5 * lam[k] * d
    smallest = 0.0  # gap of the step before
    for taken in range(steps):
        # forces known before the step
        outside = constant
        for i in range(modes):
            before[i] = q[i]
            f[i] = push[i] * outside
        braking = 0.0
        for k in range(guides):
            slide = 0.0
            for i in range(modes):
                slide += guide_slide[k, i] * v[i]
            # drag of the mean speed over the step; friction may stop the shaft, not turn it round
            drag = -guide_viscous[k] * slide / (1.0 + 0.5 * damped[k])
            if guide_friction[k] > 0.0:
                pressed = np.sqrt(guide_force[k, 0] ** 2 + guide_force[k, 1] ** 2)
                rub = guide_friction[k] * pressed / np.sqrt(slide**2 + slip_speed**2)
                drag -= min(rub, 1.0 / mobility[k]) * slide
            braking += drag
            for i in range(modes):
                f[i] += guide_slide[k, i] * drag
                for c in range(2):
                    f[i] += 0.5 * guide_traces[k, c, i] * guide_force[k, c]
        # half of the contact forces of the start of the step
        for i in range(modes):
            kick[i] = 0.0
        for k in range(n):
            if lam[k] > 0.0:
                a = 0.5 * lam[k]
                for i in range(modes):
                    kick[i] += a * traces[k, i]
        if spring > 0.0:  # its mean force under all forces that are known by now
            rest = 0.0
            for i in range(modes):
                moved = (A11[i] + 1.0) * q[i] + A12[i] * v[i] + B1[i] * (f[i] + kick[i])
                rest += push[i] * moved
            pull = -share * rest
            outside += pull
            for i in range(modes):
                f[i] += push[i] * pull
        for i in range(modes):
            whole[i] = f[i] + kick[i]
            qf[i] = A11[i] * q[i] + A12[i] * v[i] + B1[i] * whole[i]
            vf[i] = A21[i] * q[i] + A22[i] * v[i] + B2[i] * whole[i]
        # guides: a disc of clearance around the axis at each height
        for k in range(guides):
            normal[k, 0] = 0.0
            normal[k, 1] = 0.0
            for c in range(2):
                free[k, c] = guide_offset[k, c]
                for i in range(modes):
                    free[k, c] += guide_traces[k, c, i] * qf[i]
            distance = np.sqrt(free[k, 0] ** 2 + free[k, 1] ** 2)
            if distance > guide_clearance[k]:
                nx, ny = free[k, 0] / distance, free[k, 1] / distance
                soft = (
                    nx * nx * guide_compliance[k, 0, 0]
                    + 2.0 * nx * ny * guide_compliance[k, 0, 1]
                    + ny * ny * guide_compliance[k, 1, 1]
                )
                for i in range(modes):
                    t = nx * guide_traces[k, 0, i] + ny * guide_traces[k, 1, i]
                    soft += 0.5 * t * t * B1[i]
                press = (distance - guide_clearance[k]) / soft
                normal[k, 0] = -press * nx
                normal[k, 1] = -press * ny
                for i in range(modes):
                    kick[i] = 0.5 * (
                        normal[k, 0] * guide_traces[k, 0, i] + normal[k, 1] * guide_traces[k, 1, i]
                    )
                outside += _hold(kick, push, B1, share)
                for i in range(modes):
                    f[i] += kick[i]
                    whole[i] += kick[i]
                    qf[i] += B1[i] * kick[i]
                    vf[i] += B2[i] * kick[i]
        # contact
        touching = counts[0] > 0
        if n:
            np.dot(traces, qf, open_gap)
            for k in range(n):
                open_gap[k] += gap0[k]
                if open_gap[k] < 0.0:
                    touching = True
        least = 0.0
        mean_force = 0.0
        answer = 0.0  # of the spring to the forces of the contact
        if touching:
            widest = 0.0
            for k in range(n):
                widest = max(widest, abs(open_gap[k]))
            rounds = solve_active(
                A,
                open_gap,
                active,
                index,
                B,
                counts,
                new,
                gap,
                max(1e-15, 1e-13 * widest),
                diagonal,
            )
            if rounds < 0:
                return taken, FAILED
            if wait:
                way = 0.0
                for k in range(n):
                    way += axial[k] * new[k]
                if way * books[8] < 0.0:
                    return taken, TURNED
                if way != 0.0:
                    books[8] = 1.0 if way > 0.0 else -1.0
            books[6] += rounds
            for i in range(modes):
                kick[i] = 0.0
            for k in range(n):
                if new[k] > 0.0:
                    carried[k] = True
                    a = 0.5 * new[k]
                    for i in range(modes):
                        kick[i] += a * traces[k, i]
            answer += _hold(kick, push, B1, share)
            for i in range(modes):
                whole[i] += kick[i]
                qf[i] += B1[i] * kick[i]
                vf[i] += B2[i] * kick[i]
            least = 1e300
            for k in range(n):
                least = min(least, gap[k])
        else:
            for k in range(n):
                new[k] = 0.0
            if n:
                least = 1e300
                for k in range(n):
                    least = min(least, open_gap[k])
        # work of the mean forces on d = gap0 + Phi q, against the potential, and the payment
        if n:
            work, stored = _work(gap0, traces, lam, new, before, qf)
            whole_step = potential > 0.0 and stored > 0.0
            owed = debt + work + stored - potential
            pay = 0.0
            if owed != 0.0 and work != 0.0:
                limit = 1.0
                if whole_step:  # what the contact still holds must suffice
                    limit = min(max(_PAY_LIMIT, 2.0 * abs(owed) / potential), 1.0)
                pay = min(max(-owed / work, -limit), limit)
                for i in range(modes):
                    kick[i] = 0.0
                for k in range(n):
                    if lam[k] > 0.0 or new[k] > 0.0:
                        a = 0.5 * pay * (lam[k] + new[k])
                        for i in range(modes):
                            kick[i] += a * traces[k, i]
                back = _hold(kick, push, B1, share)
                answer += back
                for i in range(modes):
                    whole[i] += kick[i]
                    qf[i] += B1[i] * kick[i]
                    vf[i] += B2[i] * kick[i]
                first, kept = _work(gap0, traces, lam, new, before, qf)
                if whole_step or pay == 0.0:
                    work, stored = first, kept  # what is left of the debt comes next
                else:
                    # the last chance: both are linear in the payment, the balance is quadratic
                    work_slope, stored_slope = (first - work) / pay, (kept - stored) / pay
                    exact = _payment(owed, work + work_slope + stored_slope, work_slope)
                    exact = min(max(exact, -limit), limit)
                    more = exact / pay - 1.0
                    answer += more * back
                    for i in range(modes):
                        whole[i] += more * kick[i]
                        qf[i] += more * B1[i] * kick[i]
                        vf[i] += more * B2[i] * kick[i]
                    pay = exact
                    work += pay * work_slope
                    stored += pay * stored_slope
            for k in range(n):
                mean = 0.5 * (1.0 + pay) * (lam[k] + new[k])
                mean_force += axial[k] * mean
                if len(out_points):
                    out_points[taken, k] = mean
            debt += (1.0 + pay) * work + stored - potential
            potential = stored
            if counts[0] > 0:
                books[5] = 0.0
                books[7] += 1.0
            elif books[5] >= 0.0:
                books[5] += 1.0
        # other books, then the end of the step becomes the state
        moved = 0.0
        for i in range(modes):
            moved += push[i] * (qf[i] - before[i])
        books[1] += constant * moved
        if len(loss):
            for i in range(modes):
                books[0] += (
                    loss[0, i] * q[i] ** 2
                    + loss[1, i] * q[i] * v[i]
                    + loss[2, i] * v[i] ** 2
                    + whole[i] * (loss[3, i] * q[i] + loss[4, i] * v[i] + loss[5, i] * whole[i])
                )
        if guides:
            given = 0.0
            for i in range(modes):
                part = f[i] - push[i] * outside
                given += part * (qf[i] - before[i])
            held = 0.0
            for k in range(guides):
                for c in range(2):
                    for d in range(2):
                        held += 0.5 * normal[k, c] * guide_compliance[k, c, d] * normal[k, d]
                    guide_force[k, c] = normal[k, c]
            books[2] -= given + held - books[4]
            books[4] = held
        for i in range(modes):
            q[i] = qf[i]
            v[i] = vf[i]
        for k in range(n):
            lam[k] = new[k]
        for b in range(bodies):
            s = 0.0
            for i in range(modes):
                s += drift[b, i] * v[i]
            out_drift[taken, b] = s
        out_force[taken] = mean_force
        out_gap[taken] = 0.5 * (least + smallest) if taken else least
        smallest = least
        out_outside[taken] = outside + answer + braking
        books[3] = debt
        if wait and books[5] > wait:
            return taken + 1, OPEN
    return steps, FINISHED
