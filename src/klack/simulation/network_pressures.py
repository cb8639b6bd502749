"""Phases of a step for pressures and flows: all nodes together, implicit, by Newton's method."""

from typing import Any

import numpy as np

from klack.hydraulics.fluid_table import fluid_at, pressure_at
from klack.hydraulics.mass_balance import clear_links, solve_mass_balance
from klack.machine.compiling.jit import inner, njit
from klack.network.step_function import shift
from klack.simulation.network_arrays import (
    ANSWER,
    AT_ONCE,
    FINE,
    FLUID_IMPULSE,
    SEEN,
    STORE,
    Y1,
    Step,
)
from klack.simulation.network_gas import (
    begin_gas,
    end_energy,
    end_gas,
    look_up_mixture,
    pressure_of_mixture,
)
from klack.simulation.phase import (
    STATUS_BRANCH,
    STATUS_DONE,
    STATUS_PRESSURES,
    STATUS_REFUSED,
    phase,
)
from klack.simulation.row_calls import (
    ask_again,
    ask_branch,
    failed_at,
    push_ports,
    push_walls,
    take_states,
)

__all__ = [
    "begin_fluid",
    "bracketed",
    "end_branches",
    "end_ends",
    "end_nodes",
    "guess_pressures",
    "push_by_fluid",
    "solve_pressures",
]

_MOST_NEWTON = 80
_FULL_NEWTON = 15  # of them with whole steps
_PRESSURE_LEFT = 1e-5  # last Newton step, see _size; what is left of it is its square
_LEAST_PRESSURE = 1.0  # [Pa]
_CURVED = (
    0.1  # of the slope of the density: change in a step that the mean pressure does not follow
)
_FLOW_LEFT = 0.02  # of a flow: change in the last Newton step
_MASS_LEFT = 1e-8  # of what a volume holds: that change of a flow over the step
_LEAST_THETA = 0.51  # what the implicit step loses outweighs what the curved law could give back
_LARGE_STEP = 1e-3  # of the pressure
_PLAIN_NEWTON = 12  # iterations, more than nearly all need; then the root is kept in an interval
_SAME_INTERVAL = 12  # iterations with it
_MOST_OF = 0.9  # longest step within this interval
_OPEN, _NONE = 1.0, 0.0  # cavity at a junction
_HELD = 1.0  # [kg/Pa] what holds the pressure of an open one, far more than any flow answers
_BALANCED = 1e-12  # of the flows of a junction: what round-off fills its cavity too much
_AT_BOILING = 1e-6  # of that pressure: by so much an open cavity of the last step was missed
_NARROW = 1e-13  # such an interval over the density: the other volumes have moved the root


@phase
def begin_fluid(fluid: Any) -> None:
    """Begin a run with the pressures of the last step; no density is known."""
    trial, flows = fluid.trial, fluid.flows
    for i in range(fluid.nodes.nodes):
        trial.p[i] = trial.end[i] = fluid.state.p[i]
        trial.theta[i] = 1.0
        trial.known[i] = -1.0
    for e in range(fluid.nodes.ends):
        flows.Z[e] = 1.0


@inner(_nrt=False, error_model="numpy", forceinline=True)
def _table(time: Any, value: Any, first: int, last: int, t: float) -> float:
    """Lines through points, constant beyond them."""
    if t <= time[first]:
        return value[first]
    if t >= time[last - 1]:
        return value[last - 1]
    low, high = first, last - 1
    while high - low > 1:
        middle = (low + high) // 2
        if time[middle] <= t:
            low = middle
        else:
            high = middle
    share = (t - time[low]) / (time[high] - time[low])
    return value[low] + share * (value[high] - value[low])


@phase
def guess_pressures(fluid: Any, end: float, H: float, straight: bool) -> None:
    r"""Pressures of volumes as they were, or ``straight`` on; given ones at the end of the step.

    What acts is :math:`\hat p = \theta p_1 + (1 - \theta) p_0`: of second order for :math:`\theta =
    1/2`, which would let a pressure that flows balance at the rate :math:`k` oscillate where
    :math:`k H > 2`; :math:`\theta = 1 - 1/(k H)` is the smallest that does not.
    """
    nodes, state, trial = fluid.nodes, fluid.state, fluid.trial
    for i in range(nodes.chambers, nodes.volumes):
        open_before = state.p[i] < (1.0 + _AT_BOILING) * nodes.boiling
        trial.cavity[i] = _OPEN if open_before else _NONE
    for i in range(nodes.volumes):
        theta, balanced = _LEAST_THETA, state.rate[i] * H
        if balanced > 1.0 / (1.0 - _LEAST_THETA):
            theta = 1.0 - 1.0 / balanced
        trial.theta[i] = theta
        trial.end[i] = state.p[i]
        if straight:
            least = _LEAST_PRESSURE if i < nodes.chambers else nodes.boiling
            trial.end[i] = max(2.0 * state.p[i] - state.before[i], least)
        trial.p[i] = state.p[i] + theta * (trial.end[i] - state.p[i])
    if nodes.slow_gas > 0:
        begin_gas(fluid, H)
    for i in range(nodes.volumes, nodes.nodes):
        k = i - nodes.volumes
        p = _table(nodes.time, nodes.pressure, nodes.table0[k], nodes.table0[k + 1], end)
        trial.p[i] = trial.end[i] = p


@phase
def solve_pressures(fluid: Any, S: Any, step: Step, report: Any) -> int:
    """Pressures and flows at the end of the step, with ports where the last sweep left them.

    The cavities of the junctions are those of the linear equations of each Newton iteration: see
    :func:`_cavities_change`.
    """
    nodes, trial = fluid.nodes, fluid.trial
    p, r = trial.p, trial.r
    gamma = shift(nodes.gamma, min(step.level, 1) * max(nodes.volumes, 1))
    _place_walls(fluid, S)
    iteration = changes = 0
    while True:
        if nodes.slow_gas > 0:
            look_up_mixture(fluid)
        else:
            _look_up(fluid)
        _add_up_volumes(fluid, gamma)
        failed, code = _add_up_branches(fluid, S, step)
        if code != 0:
            report[0], report[1], report[2] = failed, code, step.t
            return failed_at(step.level, code, STATUS_BRANCH)
        _add_up_ends(fluid, step.H)
        solve_mass_balance(nodes, trial.into, trial.own, r)
        if changes <= nodes.volumes and _cavities_change(fluid, step.H):
            changes += 1
            continue
        worst, total = _limit_steps(fluid, iteration)
        finite = abs(total) < np.inf
        if finite and worst < _PRESSURE_LEFT and changes <= nodes.volumes:
            if iteration >= _FULL_NEWTON or _flows_follow(fluid, step.H):
                _step_by(fluid, 1.0)
                if not _fully_implicit(fluid):
                    break
                iteration = changes = 0
                continue
        # a root-like law about no drop lets Newton's method swing across for ever
        share = 1.0 if iteration < _FULL_NEWTON else 0.5
        _step_by(fluid, share)
        # at once, while it can be seen which branch is to blame
        if iteration == _MOST_NEWTON - 1 or not finite or not worst < np.inf:
            if step.level != FINE:  # fine steps may do
                return STATUS_REFUSED
            report[0], report[2] = _worst_volume(fluid, worst), step.t
            return STATUS_PRESSURES
        iteration, changes = iteration + 1, 0
    failed, code = _finish_flows(fluid)
    if code != 0:
        report[0], report[1], report[2] = failed, code, step.t
        return failed_at(step.level, code, STATUS_BRANCH)
    for i in range(nodes.volumes):
        trial.V[i] = trial.V_used[i] + gamma[i] * (p[i] - trial.p_used[i])
    return STATUS_DONE


@phase
def _fully_implicit(fluid: Any) -> bool:
    """Let volumes that boil or fill within the step feel its end alone; whether any did not.

    Its energy is no parabola in between: a mean pressure could return more than the step loses,
    that of the end cannot, as the energy is convex.
    """
    nodes, state, trial, changed = fluid.nodes, fluid.state, fluid.trial, False
    for i in range(nodes.chambers):
        if trial.theta[i] < 1.0 and _is_curved(trial.slope[i], state.slope[i]):
            trial.theta[i] = 1.0
            trial.p[i] = trial.end[i]
            changed = True
    if changed:
        _forget_intervals(fluid)
    return changed


@phase
def _is_curved(slope: float, before: float) -> bool:
    """Whether the slope of the density changes too much in a step for a mean pressure."""
    return abs(slope - before) > _CURVED * slope


@phase
def _flows_follow(fluid: Any, H: float) -> bool:
    """Whether flows follow the last Newton step, which they take with their slopes.

    Where a wide opening holds a small volume at a pressure, a step that is small beside the
    pressure may be as large as the drop that drives the flow.  A junction holds nothing: there the
    step is compared with what the whole pressure would let through.
    """
    branches, flows, trial, r = fluid.branches, fluid.flows, fluid.trial, fluid.trial.r
    chambers, mass, follow = fluid.nodes.chambers, fluid.state.mass, True
    volumes = fluid.nodes.volumes
    for k in range(branches.rows):
        a, b = branches.a[k], branches.b[k]
        change, least = 0.0, np.inf
        if a < volumes:
            change += flows.slope_a[k] * r[a]
            least = mass[a] if a < chambers else trial.balanced[a] * trial.end[a]
        if b < volumes:
            change += flows.slope_b[k] * r[b]
            held = mass[b] if b < chambers else trial.balanced[b] * trial.end[b]
            least = min(least, held)
        if abs(change) > _FLOW_LEFT * abs(flows.mdot[k]) and abs(change) * H > _MASS_LEFT * least:
            follow = False
    return follow


@phase
def _place_walls(fluid: Any, S: Any) -> None:
    nodes, trial = fluid.nodes, fluid.trial
    for i in range(nodes.volumes):
        trial.V_used[i] = nodes.volume[i]
        trial.p_used[i] = trial.p[i]
    for w in range(nodes.walls):
        i = nodes.wall_node[w]
        if i < nodes.volumes:
            trial.V_used[i] += nodes.wall_area[w] * S[Y1 + nodes.wall_port[w]]


@phase
def _step_by(fluid: Any, share: float) -> None:
    trial = fluid.trial
    for i in range(fluid.nodes.volumes):
        trial.p[i] += share * trial.r[i]
        trial.end[i] += share * trial.r[i] / trial.theta[i]


@phase
def _look_up(fluid: Any) -> None:
    nodes, state, trial, hint = fluid.nodes, fluid.state, fluid.trial, fluid.state.hint
    for i in range(nodes.chambers):
        theta = trial.theta[i]
        rho, trial.slope[i], g, hint[i] = fluid_at(nodes.fluid, trial.end[i], hint[i])
        trial.rho_end[i], trial.g_end[i] = rho, g
        before = state.mass[i] / state.held[i]
        trial.rho[i] = before + theta * (rho - before)
        trial.g[i] = state.g[i] + theta * (g - state.g[i])
    for i in range(nodes.chambers, nodes.volumes):
        rho, trial.slope[i], g, hint[i] = fluid_at(nodes.fluid, trial.end[i], hint[i])
        trial.rho[i] = trial.rho_end[i] = rho
        trial.g[i] = trial.g_end[i] = g
    for i in range(nodes.volumes, nodes.nodes):
        if trial.p[i] != trial.known[i]:
            rho, _, g, hint[i] = fluid_at(nodes.fluid, trial.p[i], hint[i])
            trial.rho[i], trial.g[i] = rho, g
            trial.g_end[i] = g
            trial.known[i] = trial.p[i]


@phase
def _add_up_volumes(fluid: Any, gamma: Any) -> None:
    """Mass that each volume misses, without flows, and its change with the pressures."""
    nodes, trial = fluid.nodes, fluid.trial
    p, rho, V = trial.p, trial.rho_end, trial.V
    clear_links(nodes, trial.into)
    for i in range(nodes.volumes):
        V[i] = trial.V_used[i] + gamma[i] * (p[i] - trial.p_used[i])
        trial.r[i] = fluid.state.mass[i] - V[i] * rho[i]
        trial.stored[i] = V[i] * trial.slope[i] / trial.theta[i]
        trial.balanced[i] = rho[i] * gamma[i]
        trial.own[i] = trial.stored[i] + trial.balanced[i]
    for i in range(nodes.chambers, nodes.volumes):
        if trial.cavity[i] == _OPEN:
            trial.r[i] = _HELD * (nodes.boiling - p[i])
            trial.stored[i] = trial.own[i] = _HELD
            trial.balanced[i] = 0.0


@phase
def _add_up_branches(fluid: Any, S: Any, step: Step) -> tuple[int, int]:
    """Flows of all branches; the row that failed and its status."""
    trial, branches, flows = fluid.trial, fluid.branches, fluid.flows
    volumes, H = fluid.nodes.volumes, step.H
    into, own, balanced, r = trial.into, trial.own, trial.balanced, trial.r
    seen, end = shift(S, SEEN), shift(S, Y1)
    for k in range(branches.rows):
        status = ask_branch(branches, k, step.t, H, seen, end, trial.p, trial.rho)
        if status != 0:
            return k, status
        a, b, o0 = branches.a[k], branches.b[k], branches.output0[k]
        flows.mdot[k] = branches.outputs[o0]
        flows.slope_a[k] = branches.outputs[o0 + 1]
        flows.slope_b[k] = branches.outputs[o0 + 2]
        if a < volumes:
            r[a] -= H * flows.mdot[k]
            balanced[a] += H * flows.slope_a[k]
            if b < volumes:
                into[fluid.nodes.place[2 * k]] -= H * flows.slope_b[k]
                into[fluid.nodes.place[2 * k + 1]] += H * flows.slope_a[k]
            else:
                own[a] += H * flows.slope_a[k]
        if b < volumes:
            r[b] += H * flows.mdot[k]
            balanced[b] -= H * flows.slope_b[k]
            if a >= volumes:
                own[b] -= H * flows.slope_b[k]
    return -1, 0


@phase
def _add_up_ends(fluid: Any, H: float) -> None:
    nodes, trial, flows = fluid.nodes, fluid.trial, fluid.flows
    for e in range(nodes.ends):
        i = nodes.end_node[e]
        flows.q[e] = (nodes.density * trial.g[i] - flows.c[e]) / flows.Z[e]
        if i < nodes.volumes:
            answer = H * nodes.density * (nodes.density / trial.rho_end[i]) / flows.Z[e]
            trial.r[i] -= H * nodes.density * flows.q[e]
            trial.balanced[i] += answer
            trial.own[i] += answer


@phase
def _cavities_change(fluid: Any, H: float) -> bool:
    r"""Open and close cavities by the solved linear equations; whether any changes.

    At each junction either nothing is missing and :math:`p \ge p_b`, or :math:`p = p_b` and
    :math:`M \le 0`.  As the matrix of the flows is an M-matrix, there is one solution.  Policy
    iteration finds it from any start in at most one solution more than there are junctions (Howard
    1960; Bokanowski, Maroso & Zidani 2009): close those that would be filled, open those whose
    pressure would be too low, solve again.
    """
    nodes, trial, changes = fluid.nodes, fluid.trial, False
    for i in range(nodes.chambers, nodes.volumes):
        if trial.cavity[i] == _OPEN:
            if _fills(fluid, i, H):
                trial.cavity[i], changes = _NONE, True
        elif trial.p[i] + trial.r[i] < nodes.boiling:
            trial.cavity[i], changes = _OPEN, True
    if changes:
        _forget_intervals(fluid)
    return changes


@phase
def _forget_intervals(fluid: Any) -> None:
    """Let the densities be anywhere: a cavity that opened or closed has moved the roots."""
    for i in range(fluid.nodes.volumes):
        fluid.trial.lower[i], fluid.trial.upper[i] = 0.0, np.inf


@phase
def _fills(fluid: Any, i: int, H: float) -> bool:
    """Whether the flows after a Newton iteration fill the cavity of a junction."""
    nodes, trial, branches, flows = fluid.nodes, fluid.trial, fluid.branches, fluid.flows
    net, size, r = 0.0, 0.0, trial.r
    for k in range(branches.rows):
        a, b, mdot = branches.a[k], branches.b[k], flows.mdot[k]
        if i in (a, b):
            if a < nodes.volumes:
                mdot += flows.slope_a[k] * r[a]
            if b < nodes.volumes:
                mdot += flows.slope_b[k] * r[b]
            net += mdot if i == b else -mdot
            size += abs(mdot)
    for e in range(nodes.ends):
        if nodes.end_node[e] == i:
            q = flows.q[e] + nodes.density / trial.rho_end[i] * r[i] / flows.Z[e]
            net -= nodes.density * q
            size += nodes.density * abs(q)
    return fluid.state.mass[i] + H * net > _BALANCED * H * size


@njit(_nrt=False, error_model="numpy", forceinline=True)
def bracketed(
    target: float, density: float, lower: float, upper: float
) -> tuple[float, float, float]:
    """Next density after ``density``, and the interval known to hold the root.

    Where a chamber is about to fill, the slope on the boiling side leads far into the liquid, and
    that of the liquid back: Newton's method alone would alternate.
    """
    if upper - lower < _NARROW * density:
        lower, upper = 0.0, np.inf
    if target > density:
        lower = density
    else:
        upper = density
    if abs(target - density) > _MOST_OF * (upper - lower):
        target = 0.5 * (lower + upper)
    return target, lower, upper


@phase
def _limit_steps(fluid: Any, iteration: int) -> tuple[float, float]:
    """Newton steps that the fluid can follow; the largest relative one, and their sum."""
    nodes, trial, hint = fluid.nodes, fluid.trial, fluid.state.hint
    p, r, rho, lower, upper = trial.p, trial.r, trial.rho_end, trial.lower, trial.upper
    worst, total = 0.0, 0.0
    for i in range(nodes.volumes):
        total += r[i]
        theta = trial.theta[i]
        target, is_inside = rho[i] + trial.slope[i] * r[i] / theta, False
        large = i < nodes.chambers and abs(r[i]) > _LARGE_STEP * p[i]
        # a step that may be the last stays as the flows have it: else they would leave mass behind
        last = _size(fluid, i) < _PRESSURE_LEFT
        if i < nodes.chambers and iteration >= _PLAIN_NEWTON and not last:
            if (iteration - _PLAIN_NEWTON) % _SAME_INTERVAL == 0:
                lower[i], upper[i] = 0.0, np.inf  # the other volumes may have moved the root
            wanted = target
            target, lower[i], upper[i] = bracketed(target, rho[i], lower[i], upper[i])
            is_inside = target != wanted
            if is_inside:
                # a step that a narrow interval made short has found no balance
                worst = max(worst, _size(fluid, i))
            large = True
        if large:
            # boiling: the density takes the step, the pressure follows it; from vapour towards
            # liquid it would follow far too far, there its own step is the shorter one
            if nodes.slow_gas > 0:
                new = pressure_of_mixture(fluid, i, target)
            else:
                new, hint[i] = pressure_at(nodes.fluid, target, hint[i])
            step = theta * (new - trial.end[i])
            if is_inside or abs(step) < abs(r[i]):
                r[i] = step
        worst = max(worst, _size(fluid, i))
    return worst, total


@phase
def _size(fluid: Any, i: int) -> float:
    """Newton step over the pressure, or the ambient one, and of a density over the density.

    In an almost empty volume a step that is small beside the ambient pressure is many times its
    own, and its density.
    """
    trial, step = fluid.trial, abs(fluid.trial.r[i])
    size = step / max(trial.theta[i] * trial.end[i], fluid.nodes.ambient)
    if i < fluid.nodes.chambers:
        size = max(size, trial.slope[i] * step / (trial.theta[i] * trial.rho_end[i]))
    return size


@phase
def _worst_volume(fluid: Any, worst: float) -> int:
    found = 0
    for i in range(fluid.nodes.volumes):
        if _size(fluid, i) == worst:
            found = i
    return found


@phase
def _finish_flows(fluid: Any) -> tuple[int, int]:
    """Take the last Newton step with the slopes: mass is conserved exactly."""
    branches, flows, p, r = fluid.branches, fluid.flows, fluid.trial.p, fluid.trial.r
    for k in range(branches.rows):
        a, b = branches.a[k], branches.b[k]
        if a < fluid.nodes.volumes:
            flows.mdot[k] += flows.slope_a[k] * r[a]
        if b < fluid.nodes.volumes:
            flows.mdot[k] += flows.slope_b[k] * r[b]
        if branches.accounts[k] > 0:
            # what it stores has to follow from the pressures that do the work
            i0 = branches.input0[k]
            branches.inputs[i0 + 2] = p[a]
            branches.inputs[i0 + 3] = p[b]
            status = ask_again(branches, k)
            if status != 0:
                return k, status
            flows.mdot[k] = branches.outputs[branches.output0[k]]
    return -1, 0


@phase
def push_by_fluid(fluid: Any, S: Any) -> None:
    """Add the forces of pressures on walls and those of branches to those of the ports."""
    force = shift(S, ANSWER)
    push_walls(fluid.nodes, fluid.trial.p, force)
    for k in range(fluid.branches.rows):
        push_ports(fluid.branches, k, force)


@phase
def end_branches(fluid: Any, S: Any, H: float, accounts: Any, kind: Any, sums: Any) -> None:
    """Accept flows and states of branches; the hydraulic power is stored, supplied or lost."""
    trial, branches, flows = fluid.trial, fluid.branches, fluid.flows
    inflow, g = trial.inflow, trial.g
    for i in range(fluid.nodes.nodes):
        inflow[i] = 0.0
    for i in range(fluid.nodes.chambers):
        # the last Newton step: g to second order in it
        last, rho = trial.r[i] / trial.theta[i], trial.rho_end[i]
        change = last / rho * (1.0 - 0.5 * last * trial.slope[i] / rho)
        trial.g_end[i] += change
        g[i] += trial.theta[i] * change
    for i in range(fluid.nodes.chambers, fluid.nodes.volumes):
        # to first order, as the flows have it: they add up to nothing
        g[i] += trial.r[i] / trial.rho_end[i]
        trial.g_end[i] = g[i]
    if fluid.nodes.slow_gas > 0:
        end_energy(fluid)
    for k in range(branches.rows):
        a, b, mdot = branches.a[k], branches.b[k], flows.mdot[k]
        inflow[a] -= H * mdot
        inflow[b] += H * mdot
        sums[k] += H * mdot
        power = (g[a] - g[b]) * mdot * H
        o0, q0 = branches.output0[k] + branches.head, branches.port0[k]
        for j in range(q0, branches.port0[k + 1]):
            port = branches.ports[j]
            power -= branches.outputs[o0 + j - q0] * (S[Y1 + port] - S[SEEN + port])
            S[FLUID_IMPULSE + port] += H * branches.outputs[o0 + j - q0]
        o0 = take_states(branches, k)
        for j in range(branches.accounts[k]):
            account, value = branches.account0[k] + j, branches.outputs[o0 + j]
            if kind[account] == STORE:
                power -= value - accounts.rows[account]
                accounts.rows[account] = value
        if branches.supply[k] >= 0:
            accounts.rows[branches.supply[k]] -= power
        else:
            accounts.rows[branches.loss[k]] += power
    nodes = fluid.nodes
    for w in range(nodes.walls):
        i, port = nodes.wall_node[w], nodes.wall_port[w]
        force = nodes.wall_area[w] * (trial.p[i] - nodes.ambient)
        S[FLUID_IMPULSE + port] += H * force
        if i >= nodes.volumes:  # a source fills the room behind a wall
            accounts.supply[i - nodes.volumes] += force * (S[Y1 + port] - S[SEEN + port])


@phase
def end_ends(fluid: Any, H: float) -> None:
    """Flows into the ends of lines, with the last Newton step of the pressures."""
    nodes, trial, flows = fluid.nodes, fluid.trial, fluid.flows
    for e in range(nodes.ends):
        i = nodes.end_node[e]
        q = flows.q[e]
        if i < nodes.volumes:
            # as the pressure energy follows it: the line gets what the volume gives
            last, rho = trial.r[i] / trial.theta[i], trial.rho_end[i]
            change = last / rho
            if i < nodes.chambers:
                change *= 1.0 - 0.5 * last * trial.slope[i] / rho
            q += nodes.density / flows.Z[e] * trial.theta[i] * change
        flows.q[e] = q
        trial.inflow[i] -= H * nodes.density * q


@phase
def end_nodes(fluid: Any, H: float, accounts: Any) -> None:
    """Accept masses, volumes and pressures, with the loss of the implicit step."""
    nodes, state, trial = fluid.nodes, fluid.state, fluid.trial
    p, g, V, inflow = trial.p, trial.g, trial.V, trial.inflow
    if nodes.slow_gas > 0:
        end_gas(fluid, H, accounts)
    for i in range(nodes.volumes):
        mass = state.mass[i] + inflow[i]
        stored = mass * trial.g_end[i] - (trial.end[i] - nodes.ambient) * V[i]
        was = state.mass[i] * state.g[i]
        was -= (state.p[i] - nodes.ambient) * state.held[i]
        work = (p[i] - nodes.ambient) * (V[i] - state.held[i])
        accounts.implicit[i] += was - stored + g[i] * inflow[i] - work
        state.mass[i] = mass
        state.held[i] = V[i]
    for i in range(nodes.chambers):
        state.rate[i] = trial.balanced[i] / (trial.theta[i] * trial.stored[i] * H)
        if _is_curved(trial.slope[i], state.slope[i]):
            state.rate[i] = AT_ONCE  # boiling, or about to fill
        state.slope[i] = trial.slope[i]
    for i in range(nodes.volumes, nodes.nodes):
        accounts.supply[i - nodes.volumes] -= g[i] * inflow[i]
    for i in range(nodes.nodes):
        state.before[i] = state.p[i]
        state.p[i] = trial.end[i]
        state.g[i] = trial.g_end[i]
