"""The time loop of a network: bodies, elements, fluid nodes, branches, lines, contacts and films.

One step of length ``h`` (or ``M h`` while nothing touches):

1. Every mode moves exactly, without the forces of this step.
2. Sweeps: all elements, then all pressures (Newton), then all interfaces find their mean forces
   from the port displacements at both ends of the step; the forces move the ports by ``G F``;
   again, until no port moves by more than a small share of the way in the step.  Elements and
   fluid live on the displacements that they saw last, so what is left of that change costs energy
   in second order: the change of their forces times it, a small share of the work of the step.
3. States, masses, waves and energies are updated; the forces stay pending for the next pass over
   the modes.

A coarse step is tried when all interfaces are far apart or at rest; if it ends in a contact, in a
release or in a noticeable film, it is discarded and repeated in fine steps.
"""

from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from klack.hydraulics.fluid_table import fluid_at, pressure_at
from klack.network.step_function import call, first, pointer, shift
from klack.simulation.contact_step import mean_force
from klack.simulation.delay_line import Lines, LineState, lines_commit, lines_incoming
from klack.simulation.interface_step import solve_interface
from klack.simulation.kernel import SEPARATED
from klack.simulation.modal_step import ROW, advance, apply_forces, watch
from klack.simulation.network_arrays import (
    BEFORE,
    ELEMENTS,
    ELEMENTS_BEFORE,
    FORCE,
    FREE,
    LAST,
    PENDING,
    PORTS,
    SEEN,
    STORE,
    USED,
    WORK,
    Y0,
    Y1,
    Bodies,
    Interfaces,
    Nodes,
    Recording,
    Scratch,
    StepRows,
)

__all__ = [
    "STATUS_BRANCH",
    "STATUS_DONE",
    "STATUS_ELEMENT",
    "STATUS_FORCES",
    "STATUS_PRESSURES",
    "record_points",
    "run_network",
]

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Index = NDArray[np.int64]

STATUS_DONE, STATUS_ELEMENT, STATUS_BRANCH, STATUS_PRESSURES, STATUS_FORCES = 0, 1, 2, 3, 4
_SETTLED = 5e-5  # last change of a port displacement over the longest way of a port in the step
_SETTLED_COARSE = 3e-8  # the same for a coarse step, whose forces change more
_ENERGY_LEFT = 1e-12  # energy that what is left of that change costs, over the work of the step
_UNSEEN = 1e-10  # of the displacements by all forces of a step: no smaller change is asked for
_ROUND_OFF = 4e-16  # of the displacements themselves
_FORCE_ROUND_OFF = 2e-15  # of each force that acts, whatever the others leave of their sum
_FEW_SWEEPS = 8  # are enough, unless what still changes is round-off
_MOST_SWEEPS = 200
_COARSE_SWEEPS = 20  # without success: fine steps
_MOST_NEWTON = 80
_FULL_NEWTON = 15  # of them with whole steps
_PRESSURE_LEFT = 3e-5  # last Newton step over the pressure; what is left of it is its square
_LEAST_PRESSURE = 1.0  # [Pa]
_LARGE_STEP = 1e-3  # of the pressure
_PLAIN_NEWTON = 12  # iterations, more than nearly all need; then the root is kept in an interval
_MOST_OF = 0.9  # longest step within this interval
_NARROW = 1e-13  # such an interval over the density: the other volumes have moved the root
_SLOWEST = 1e-3  # [m/s] approach speed from which on a dashpot of a given restitution is scaled


@njit(cache=True)
def _copy_state(source: Vector, target: Vector, start: Index, count: Index) -> None:
    for k in range(count.size):
        s = start[k]
        for i in range(count[k]):
            target[s + i] = source[s + i]
            target[s + ROW + i] = source[s + ROW + i]


@njit(cache=True)
def _table(time: Vector, value: Vector, first: int, last: int, t: float) -> float:
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


@njit(cache=True, error_model="numpy")
def _solve(A: Any, own: Any, r: Any, n: int) -> None:
    """Gauss without pivoting and without subtracting, ``A`` row by row and its column sums ``own``.

    What leaves a volume fills another: beside the diagonal ``A`` is below zero, and its column sums
    are what a pressure changes in all volumes together, above zero.  Pivots follow from these sums
    (Grassmann, Taksar & Heyman 1985), the diagonal is not looked at.  So a wide channel between two
    almost empty volumes, whose storage is less than the round-off of its flow, is solved as well.
    """
    for k in range(n):
        pivot = own[k]
        for i in range(k + 1, n):
            pivot -= A[i * n + k]
        A[k * n + k] = pivot
        inverse = 1.0 / pivot
        share = own[k] * inverse
        for j in range(k + 1, n):
            own[j] -= A[k * n + j] * share
        for i in range(k + 1, n):
            if A[i * n + k] != 0.0:
                c = A[i * n + k] * inverse
                for j in range(k + 1, n):
                    A[i * n + j] -= c * A[k * n + j]
                r[i] -= c * r[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            r[k] -= A[k * n + j] * r[j]
        r[k] /= A[k * n + k]


@njit(cache=True)
def _bracketed(
    target: float, density: float, lower: float, upper: float
) -> tuple[float, float, float]:
    """Density to go to from ``density``, and the interval known to hold the root.

    Where a chamber is about to fill with liquid, the slope on the boiling side leads far into the
    liquid, and that of the liquid back: Newton alone goes to and fro.
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


@njit(cache=True)
def _move_by_guess(S: Any, G: Any, body_first: Any, body_last: Any, ports: int) -> None:
    """Displacements at the end of a step under the forces so far; ``G`` of its level.

    These loops over ports stay scalar on purpose: a vector that is loaded from numbers stored one
    by one a moment before has to wait until they have left the store buffer.
    """
    for p in range(ports):
        total = S[FREE + p]
        for j in range(body_first[p], body_last[p]):
            total += G[p * PORTS + j] * S[FORCE + j]
        S[Y1 + p] = total
        S[USED + p] = total


@njit(cache=True)
def _move(S: Any, G: Any, body_first: Any, body_last: Any, ports: int) -> float:
    """The same under the new forces; returns the largest change."""
    moved = 0.0
    for p in range(ports):
        total = S[FREE + p]
        for j in range(body_first[p], body_last[p]):
            total += G[p * PORTS + j] * S[FORCE + j]
        S[Y1 + p] = total
        moved = max(moved, abs(total - S[USED + p]))
    return moved


@njit(cache=True)
def _settled(S: Any, ports: int, moved: float, share: float, left: float, work: float) -> bool:
    """Whether the last change of the displacements matters no more.

    ``left`` and ``work`` are what the interfaces add to both sums.  What an element saw is
    ``d = Y1 - USED`` short of the end of the step, and catches up in the next one: of ``F dy`` the
    energy ``F_n (d_n - d_(n-1))`` is lost, in sum ``(F_n - F_(n+1)) d_n``.
    """
    way = 0.0
    for p in range(ports):
        y, force = S[Y1 + p], S[ELEMENTS + p]
        here = abs(y - S[Y0 + p])
        way = max(way, here)
        left += abs((force - S[ELEMENTS_BEFORE + p]) * (y - S[USED + p]))
        work += abs(force) * here
    if moved <= share * way and left <= _ENERGY_LEFT * work and work < np.inf:
        return True
    displacement, by_forces = 0.0, 0.0
    for p in range(ports):
        displacement = max(displacement, abs(S[Y1 + p]))
        by_forces = max(by_forces, abs(S[Y1 + p] - S[FREE + p]))
    # a force or displacement that is not finite never settles
    return work < np.inf and moved <= max(_UNSEEN * by_forces, _ROUND_OFF * displacement)


@njit(cache=True)
def _moved_by_round_off(
    G: Any,
    ports: int,
    elements: StepRows,
    branches: StepRows,
    nodes: Nodes,
    interfaces: Interfaces,
    fi: Any,
    p: Any,
    rho: Any,
    slope: Any,
) -> float:
    """Displacement that the round-off of the forces of a sweep makes [m], the largest of a port.

    Forces that hold each other in balance leave a sum of nothing, but not without the round-off of
    each.  A pressure that follows from the mass in a volume is known to the round-off of that mass
    times the bulk modulus ``rho dp/drho``.  ``G`` of its level is zero between bodies.
    """
    largest = 0.0
    for row in range(ports):
        total = 0.0
        for k in range(elements.function.size):
            q0 = elements.port0[k]
            for j in range(q0, elements.port0[k + 1]):
                force = elements.outputs[elements.output0[k] + j - q0]
                total += abs(G[row * PORTS + elements.ports[j]] * force)
        for k in range(branches.function.size):
            q0 = branches.port0[k]
            for j in range(q0, branches.port0[k + 1]):
                force = branches.outputs[branches.output0[k] + 3 + j - q0]
                total += abs(G[row * PORTS + branches.ports[j]] * force)
        for w in range(nodes.wall_node.size):
            i = nodes.wall_node[w]
            known = abs(p[i]) + nodes.ambient
            if i < nodes.volumes and slope[i] > 0.0:
                known += rho[i] / slope[i]
            total += abs(G[row * PORTS + nodes.wall_port[w]] * nodes.wall_area[w]) * known
        for c in range(interfaces.upper.size):
            way = G[row * PORTS + interfaces.upper[c]] - G[row * PORTS + interfaces.lower[c]]
            total += abs(way * fi[c])
        largest = max(largest, total)
    return _FORCE_ROUND_OFF * largest


@njit(cache=True)
def _finite(S: Any, ports: int) -> bool:
    """Whether all ports are somewhere; looked at while it can be seen which part is to blame."""
    total = 0.0
    for p in range(ports):
        total += S[Y1 + p]
    return abs(total) < np.inf


# without the runtime of numba there is no counting of references, half the time of a step
@njit(cache=True, _nrt=False, error_model="numpy")
def run_network(
    macros: int,
    per_record: int,
    clock: Index,
    M: int,
    h: float,
    allow_coarse: bool,
    bodies: Bodies,
    elements: StepRows,
    branches: StepRows,
    nodes: Nodes,
    lines: Lines,
    line_state: LineState,
    line_books: Matrix,
    interfaces: Interfaces,
    recording: Recording,
    scratch: Scratch,
    books: Vector,
    book_kind: Index,
    report: Vector,
) -> int:
    """Integrate ``macros`` blocks of ``M`` fine steps, in place.

    ``clock`` counts: time in fine steps, level of the last step, fine and coarse steps done;
    ``report`` gets the row of a failure, its status and its time.
    """
    S = first(bodies.at)
    ports = bodies.first.size - 1
    width = 4 * (ports // 4 + 1)
    at_interfaces, at_nodes = scratch.interfaces, scratch.nodes
    at_branches, at_ends = scratch.branches, scratch.ends
    A, sums = first(scratch.matrix), first(scratch.sums)
    # pointers, because every access to an array checks for a negative index and loads a stride
    body_G = first(bodies.G)
    body_coarse = bodies.coarse
    body_fine = bodies.fine
    body_first = first(bodies.first)
    body_last = first(bodies.last)
    body_modes = bodies.modes
    body_port0 = first(bodies.port0)
    body_port1 = first(bodies.port1)
    body_start = bodies.start
    element_book0 = first(elements.book0)
    element_books = first(elements.books)
    element_function = first(elements.function)
    element_input0 = first(elements.input0)
    element_inputs = first(elements.inputs)
    element_output0 = first(elements.output0)
    element_outputs = first(elements.outputs)
    element_parameter0 = first(elements.parameter0)
    element_parameters = first(elements.parameters)
    element_port0 = first(elements.port0)
    element_ports = first(elements.ports)
    element_state = first(elements.state)
    element_state0 = first(elements.state0)
    element_states = first(elements.states)
    branch_a = first(branches.a)
    branch_b = first(branches.b)
    branch_book0 = first(branches.book0)
    branch_books = first(branches.books)
    branch_function = first(branches.function)
    branch_input0 = first(branches.input0)
    branch_inputs = first(branches.inputs)
    branch_loss = first(branches.loss)
    branch_output0 = first(branches.output0)
    branch_outputs = first(branches.outputs)
    branch_parameter0 = first(branches.parameter0)
    branch_parameters = first(branches.parameters)
    branch_port0 = first(branches.port0)
    branch_ports = first(branches.ports)
    branch_state = first(branches.state)
    branch_state0 = first(branches.state0)
    branch_states = first(branches.states)
    branch_supply = first(branches.supply)
    node_ambient = nodes.ambient
    node_before = first(nodes.before)
    node_density = nodes.density
    node_end_node = first(nodes.end_node)
    node_fluid = nodes.fluid
    node_g = first(nodes.g)
    node_gamma = first(nodes.gamma)
    node_held = first(nodes.held)
    node_hint = first(nodes.hint)
    node_mass = first(nodes.mass)
    node_numeric = first(nodes.numeric)
    node_p = first(nodes.p)
    node_pressure = nodes.pressure
    node_supply = first(nodes.supply)
    node_table0 = first(nodes.table0)
    node_time = nodes.time
    node_volume = first(nodes.volume)
    node_volumes = nodes.volumes
    node_wall_area = first(nodes.wall_area)
    node_wall_node = first(nodes.wall_node)
    node_wall_port = first(nodes.wall_port)
    interface_alpha = first(interfaces.alpha)
    interface_chi = first(interfaces.chi)
    interface_contact_loss = first(interfaces.contact_loss)
    interface_cubic = first(interfaces.cubic)
    interface_cut_off = first(interfaces.cut_off)
    interface_deepest = first(interfaces.deepest)
    interface_e = first(interfaces.e)
    interface_film_loss = first(interfaces.film_loss)
    interface_film_small = first(interfaces.film_small)
    interface_film_felt = first(interfaces.film_felt)
    interface_rest = first(interfaces.rest)
    interface_force = first(interfaces.force)
    interface_gap = first(interfaces.gap)
    interface_G = first(interfaces.G)
    interface_dry = first(interfaces.dry)
    interface_gap0 = first(interfaces.gap0)
    interface_hint = first(interfaces.hint)
    interface_kind = first(interfaces.kind)
    interface_law = interfaces.law
    interface_law0 = first(interfaces.law0)
    interface_linear = first(interfaces.linear)
    interface_lower = first(interfaces.lower)
    interface_rate = first(interfaces.rate)
    interface_series = first(interfaces.series)
    interface_since = first(interfaces.since)
    interface_suction = first(interfaces.suction)
    interface_film_before = first(interfaces.film_before)
    interface_upper = first(interfaces.upper)
    record_filled = first(recording.filled)
    record_fine = recording.fine
    record_means = recording.means
    record_peaks = recording.peaks
    count_interfaces = interfaces.upper.size
    volumes, count_nodes = node_volumes, nodes.p.size
    ends = nodes.end_node.size
    f_contact, f_film, fi = (
        first(at_interfaces[0]),
        first(at_interfaces[1]),
        first(at_interfaces[2]),
    )
    e1, lost_contact, lost_film = (
        first(at_interfaces[3]),
        first(at_interfaces[4]),
        first(at_interfaces[5]),
    )
    peaks, gap1 = first(at_interfaces[6]), first(at_interfaces[7])
    rho, slope, g, p = (
        first(at_nodes[0]),
        first(at_nodes[1]),
        first(at_nodes[2]),
        first(at_nodes[3]),
    )
    p_used, V, V_used = first(at_nodes[4]), first(at_nodes[5]), first(at_nodes[6])
    r, inflow, known = first(at_nodes[7]), first(at_nodes[8]), first(at_nodes[9])
    lower, upper, own = first(at_nodes[10]), first(at_nodes[11]), first(at_nodes[12])
    mdot, slope_a, slope_b = first(at_branches[0]), first(at_branches[1]), first(at_branches[2])
    c_end, Z_end, q_end = at_ends[0], at_ends[1], at_ends[2]
    gammas = nodes.gamma.shape[1]
    for k in range(width):
        S[PENDING + k] = 0.0
        S[FORCE + k] = S[LAST + k]
    for k in range(count_interfaces):
        fi[k] = interface_force[k]
        peaks[k] = 0.0
    for k in range(count_nodes):
        p[k] = node_p[k]
        known[k] = -1.0
    Z_end[:] = 1.0
    for k in range(scratch.sums.size):
        sums[k] = 0.0
    count_branches = branches.function.size
    count_elements = elements.function.size
    element_forces = elements.ports.size
    step, last_level = clock[0], clock[1]
    inverse_h = 1.0 / h
    in_record = 0
    record = 0
    record_time = 0.0
    fine_steps, coarse_steps = 0, 0

    for _macro in range(macros):
        level = 0
        if allow_coarse:
            level = 1
            Hc = M * h
            for c in range(count_interfaces):
                rate = abs(interface_rate[c])
                if interface_since[c] < np.inf:
                    if step * h - interface_since[c] < interface_rest[c]:
                        level = 0
                    continue
                x = interface_gap[c] - 3.0 * rate * Hc
                creeping = rate * Hc < 1e-3 * (max(interface_gap[c], 0.0) + interface_cut_off[c])
                if x <= 0.0:
                    if not (creeping and interface_cubic[c] > 0.0):
                        level = 0
                elif interface_cubic[c] > 0.0:
                    film = rate * (interface_cubic[c] / x**3 + interface_linear[c] / x)
                    if film > interface_film_small[c] and not creeping:
                        level = 0
        done = 0
        if level == 1:
            _copy_state(body_fine, body_coarse, body_start, body_modes)
        while done < M:
            m = M if level == 1 else 1
            H = m * h
            t = step * h
            inverse_H = inverse_h if level == 0 else inverse_h / M
            # 1. modes
            for i in range(width):
                S[FREE + i] = 0.0
            for k in range(body_modes.size):
                block = pointer(body_fine, body_start[k])
                if level == 1:
                    block = pointer(body_coarse, body_start[k])
                advance(
                    block,
                    body_modes[k],
                    shift(S, PENDING),
                    body_port0[k],
                    body_port1[k],
                    shift(S, FREE),
                )
            # guesses from the past
            if level == last_level:
                for i in range(width):
                    S[FORCE + i] = 2.0 * S[LAST + i] - S[BEFORE + i]
                    S[BEFORE + i] = S[LAST + i]
                for i in range(volumes):
                    p[i] = max(2.0 * node_p[i] - node_before[i], _LEAST_PRESSURE)
            else:
                for i in range(width):
                    S[FORCE + i] = S[LAST + i]
                    S[BEFORE + i] = S[LAST + i]
                for i in range(volumes):
                    p[i] = node_p[i]
            for i in range(volumes, count_nodes):
                k = i - volumes
                p[i] = _table(node_time, node_pressure, node_table0[k], node_table0[k + 1], t + H)
            if ends > 0:
                lines_incoming(lines, line_state, m, c_end, Z_end)
            # 2. sweeps
            settled, lost = False, False
            for sweep in range(_MOST_SWEEPS):
                own_G = shift(body_G, level * PORTS * PORTS)
                _move_by_guess(S, own_G, body_first, body_last, ports)
                for i in range(width):
                    S[FORCE + i] = 0.0
                for k in range(count_elements):
                    i0, o0 = element_input0[k], element_output0[k]
                    q0, q1 = element_port0[k], element_port0[k + 1]
                    element_inputs[i0] = t
                    element_inputs[i0 + 1] = H
                    for j in range(q0, q1):
                        port = element_ports[j]
                        element_inputs[i0 + 2 + 2 * (j - q0)] = S[SEEN + port]
                        element_inputs[i0 + 3 + 2 * (j - q0)] = S[Y1 + port]
                    status = call(
                        element_function[k],
                        shift(element_parameters, element_parameter0[k]),
                        shift(element_state, element_state0[k]),
                        shift(element_inputs, i0),
                        shift(element_outputs, o0),
                    )
                    if status != 0:
                        report[0], report[1], report[2] = k, status, t
                        return STATUS_ELEMENT
                    for j in range(q0, q1):
                        S[FORCE + element_ports[j]] += element_outputs[o0 + j - q0]
                # pressures
                if count_nodes > 0:
                    for i in range(volumes):
                        V_used[i] = node_volume[i]
                        p_used[i] = p[i]
                    for w in range(nodes.wall_node.size):
                        i = node_wall_node[w]
                        if i < volumes:
                            V_used[i] += node_wall_area[w] * S[USED + node_wall_port[w]]
                    for iteration in range(_MOST_NEWTON):
                        for i in range(count_nodes):
                            if i < volumes or p[i] != known[i]:
                                rho[i], slope[i], g[i], node_hint[i] = fluid_at(
                                    node_fluid, p[i], node_hint[i]
                                )
                                known[i] = p[i]
                        for i in range(volumes):
                            V[i] = V_used[i] + node_gamma[level * gammas + i] * (p[i] - p_used[i])
                            r[i] = node_mass[i] - V[i] * rho[i]
                            for j in range(volumes):
                                A[i * volumes + j] = 0.0
                            own[i] = V[i] * slope[i] + rho[i] * node_gamma[level * gammas + i]
                        for k in range(count_branches):
                            i0, o0 = branch_input0[k], branch_output0[k]
                            q0, q1 = branch_port0[k], branch_port0[k + 1]
                            a, b = branch_a[k], branch_b[k]
                            branch_inputs[i0] = t
                            branch_inputs[i0 + 1] = H
                            branch_inputs[i0 + 2] = p[a]
                            branch_inputs[i0 + 3] = p[b]
                            branch_inputs[i0 + 4] = rho[a]
                            branch_inputs[i0 + 5] = rho[b]
                            for j in range(q0, q1):
                                port = branch_ports[j]
                                branch_inputs[i0 + 6 + 2 * (j - q0)] = S[SEEN + port]
                                branch_inputs[i0 + 7 + 2 * (j - q0)] = S[USED + port]
                            status = call(
                                branch_function[k],
                                shift(branch_parameters, branch_parameter0[k]),
                                shift(branch_state, branch_state0[k]),
                                shift(branch_inputs, i0),
                                shift(branch_outputs, o0),
                            )
                            if status != 0:
                                report[0], report[1], report[2] = k, status, t
                                return STATUS_BRANCH
                            mdot[k] = branch_outputs[o0]
                            slope_a[k] = branch_outputs[o0 + 1]
                            slope_b[k] = branch_outputs[o0 + 2]
                            if a < volumes:
                                r[a] -= H * mdot[k]
                                if b < volumes:
                                    A[a * volumes + b] += H * slope_b[k]
                                    A[b * volumes + a] -= H * slope_a[k]
                                else:
                                    own[a] += H * slope_a[k]
                            if b < volumes:
                                r[b] += H * mdot[k]
                                if a >= volumes:
                                    own[b] -= H * slope_b[k]
                        for e in range(ends):
                            i = node_end_node[e]
                            q_end[e] = (node_density * g[i] - c_end[e]) / Z_end[e]
                            if i < volumes:
                                r[i] -= H * node_density * q_end[e]
                                own[i] += H * node_density * (node_density / rho[i]) / Z_end[e]
                        if volumes == 1:
                            r[0] /= own[0]
                        else:
                            _solve(A, own, r, volumes)
                        worst, total = 0.0, 0.0
                        for i in range(volumes):
                            total += r[i]
                            target = rho[i] + slope[i] * r[i]
                            large = abs(r[i]) > _LARGE_STEP * p[i]
                            if iteration >= _PLAIN_NEWTON:
                                if iteration == _PLAIN_NEWTON:
                                    lower[i], upper[i] = 0.0, np.inf
                                target, lower[i], upper[i] = _bracketed(
                                    target, rho[i], lower[i], upper[i]
                                )
                                large = True
                            if large:
                                # boiling: the density takes the step, the pressure follows it
                                new, node_hint[i] = pressure_at(node_fluid, target, node_hint[i])
                                r[i] = new - p[i]
                            worst = max(worst, abs(r[i]) / max(p[i], node_ambient))
                        finite = abs(total) < np.inf
                        if finite and worst < _PRESSURE_LEFT:
                            for i in range(volumes):
                                p[i] += r[i]
                            break
                        # a root-like law about no drop lets Newton's method swing across for ever
                        share = 1.0 if iteration < _FULL_NEWTON else 0.5
                        for i in range(volumes):
                            p[i] += share * r[i]
                        # at once, while it can be seen which branch is to blame
                        if iteration == _MOST_NEWTON - 1 or not finite or not worst < np.inf:
                            if level == 1:  # fine steps may do
                                lost = True
                                break
                            report[0], report[2] = 0.0, t
                            for i in range(volumes):
                                if abs(r[i]) / max(p[i], node_ambient) == worst:
                                    report[0] = i
                            return STATUS_PRESSURES
                    if lost:
                        break
                    # the last Newton step, taken with the slopes: mass is conserved exactly
                    for k in range(count_branches):
                        a, b = branch_a[k], branch_b[k]
                        if a < volumes:
                            mdot[k] += slope_a[k] * r[a]
                        if b < volumes:
                            mdot[k] += slope_b[k] * r[b]
                        if branch_books[k] > 0:
                            # what it stores has to follow from the pressures that do the work
                            i0, o0 = branch_input0[k], branch_output0[k]
                            branch_inputs[i0 + 2] = p[a]
                            branch_inputs[i0 + 3] = p[b]
                            status = call(
                                branch_function[k],
                                shift(branch_parameters, branch_parameter0[k]),
                                shift(branch_state, branch_state0[k]),
                                shift(branch_inputs, i0),
                                shift(branch_outputs, o0),
                            )
                            if status != 0:
                                report[0], report[1], report[2] = k, status, t
                                return STATUS_BRANCH
                            mdot[k] = branch_outputs[o0]
                    for i in range(volumes):
                        V[i] = V_used[i] + node_gamma[level * gammas + i] * (p[i] - p_used[i])
                    for w in range(nodes.wall_node.size):
                        S[FORCE + node_wall_port[w]] += node_wall_area[w] * (
                            p[node_wall_node[w]] - node_ambient
                        )
                    for k in range(count_branches):
                        o0 = branch_output0[k] + 3
                        q0, q1 = branch_port0[k], branch_port0[k + 1]
                        for j in range(q0, q1):
                            S[FORCE + branch_ports[j]] += branch_outputs[o0 + j - q0]
                for i in range(ports):
                    S[ELEMENTS + i] = S[FORCE + i]
                # interfaces
                for c in range(count_interfaces):
                    if fi[c] != 0.0:
                        S[FORCE + interface_upper[c]] += fi[c]
                        S[FORCE + interface_lower[c]] -= fi[c]
                moved = _move(S, own_G, body_first, body_last, ports)
                for c in range(count_interfaces):
                    u, low = interface_upper[c], interface_lower[c]
                    Gc = interface_G[level * count_interfaces + c]
                    g0 = interface_gap[c]
                    gap_free = interface_gap0[c] + S[Y1 + u] - S[Y1 + low] - Gc * fi[c]
                    gap1[c] = gap_free
                    if interface_dry[c] and g0 >= 0.0 and gap_free >= 0.0 and interface_e[c] == 0.0:
                        f_contact[c] = f_film[c] = e1[c] = lost_contact[c] = lost_film[c] = 0.0
                    else:
                        if interface_alpha[c] > 0.0 and interface_chi[c] == 0.0 and gap_free < 0.0:
                            speed = max((g0 - gap_free) * inverse_H, _SLOWEST)
                            interface_chi[c] = interface_alpha[c] / speed
                        (
                            f_contact[c],
                            f_film[c],
                            gap1[c],
                            e1[c],
                            interface_hint[c],
                            lost_contact[c],
                            lost_film[c],
                        ) = solve_interface(
                            interface_kind[c],
                            interface_law,
                            interface_law0[c],
                            interface_chi[c] * inverse_H,
                            interface_cubic[c],
                            interface_linear[c],
                            interface_cut_off[c],
                            interface_suction[c],
                            H,
                            Gc,
                            interface_series[c],
                            g0,
                            gap_free,
                            interface_e[c],
                            fi[c],
                            interface_hint[c],
                            interface_film_before[c],
                        )
                    change = f_contact[c] + f_film[c] - fi[c]
                    if change != 0.0:
                        fi[c] += change
                        S[FORCE + u] += change
                        S[FORCE + low] -= change
                        for i in range(body_first[u], body_last[u]):
                            S[Y1 + i] += own_G[i * PORTS + u] * change
                            moved = max(moved, abs(S[Y1 + i] - S[USED + i]))
                        for i in range(body_first[low], body_last[low]):
                            S[Y1 + i] -= own_G[i * PORTS + low] * change
                            moved = max(moved, abs(S[Y1 + i] - S[USED + i]))
                left, work = 0.0, 0.0
                for c in range(count_interfaces):
                    if fi[c] != 0.0:
                        u, low = interface_upper[c], interface_lower[c]
                        gap = interface_gap0[c] + S[Y1 + u] - S[Y1 + low]
                        left += abs((fi[c] - interface_force[c]) * (gap - gap1[c]))
                        work += abs(fi[c] * (gap - interface_gap[c]))
                share = _SETTLED if level == 0 else _SETTLED_COARSE
                settled = _settled(S, ports, moved, share, left, work)
                if not settled and sweep >= _FEW_SWEEPS:
                    settled = moved <= _moved_by_round_off(
                        own_G, ports, elements, branches, nodes, interfaces, fi, p, rho, slope
                    )
                if settled:
                    break
                if level == 1 and sweep >= _COARSE_SWEEPS:
                    break
                if sweep == _MOST_SWEEPS - 1 or (sweep == 0 and not _finite(S, ports)):
                    report[0], report[2] = moved, t
                    return STATUS_FORCES
            S[FORCE + ports] = 0.0  # what pushes the ground moves nothing
            # a coarse step may not meet what it cannot see
            if level == 1:
                fits = settled
                for c in range(count_interfaces):
                    closed = interface_since[c] < np.inf
                    if closed != (f_contact[c] > 0.0):
                        fits = False
                    if abs(f_film[c]) > 2.0 * interface_film_small[c]:
                        fits = False
                if not fits:
                    level = 0
                    last_level = -1
                    for i in range(width):
                        S[FORCE + i] = S[LAST + i]
                        S[BEFORE + i] = S[LAST + i]
                    for c in range(count_interfaces):
                        fi[c] = interface_force[c]
                    continue
            # 3. commit
            for k in range(count_elements):
                o0 = element_output0[k]
                q0, q1 = element_port0[k], element_port0[k + 1]
                for j in range(q0, q1):
                    sums[j] += H * element_outputs[o0 + j - q0]
                o0 += q1 - q0
                for j in range(element_states[k]):
                    element_state[element_state0[k] + j] = element_outputs[o0 + j]
                o0 += element_states[k]
                for j in range(element_books[k]):
                    book = element_book0[k] + j
                    if book_kind[book] == STORE:
                        books[book] = element_outputs[o0 + j]
                    else:
                        books[book] += element_outputs[o0 + j]
            if count_nodes > 0:
                for i in range(count_nodes):
                    inflow[i] = 0.0
                for i in range(volumes):
                    # r is the last Newton step: g to second order in it
                    g[i] += r[i] / rho[i] * (1.0 - 0.5 * r[i] * slope[i] / rho[i])
                for k in range(count_branches):
                    a, b = branch_a[k], branch_b[k]
                    inflow[a] -= H * mdot[k]
                    inflow[b] += H * mdot[k]
                    sums[element_forces + k] += H * mdot[k]
                    o0 = branch_output0[k] + 3
                    q0, q1 = branch_port0[k], branch_port0[k + 1]
                    power = (g[a] - g[b]) * mdot[k] * H
                    for j in range(q0, q1):
                        port = branch_ports[j]
                        power -= branch_outputs[o0 + j - q0] * (S[USED + port] - S[SEEN + port])
                    o0 += q1 - q0
                    for j in range(branch_states[k]):
                        branch_state[branch_state0[k] + j] = branch_outputs[o0 + j]
                    o0 += branch_states[k]
                    for j in range(branch_books[k]):
                        book = branch_book0[k] + j
                        value = branch_outputs[o0 + j]
                        if book_kind[book] == STORE:
                            power -= value - books[book]
                            books[book] = value
                    if branch_supply[k] >= 0:
                        books[branch_supply[k]] -= power
                    else:
                        books[branch_loss[k]] += power
                for e in range(ends):
                    i = node_end_node[e]
                    # the pressures of the last Newton step belong to these flows
                    q = q_end[e]
                    if i < volumes:
                        q += node_density / rho[i] / Z_end[e] * r[i]
                    q_end[e] = q
                    inflow[i] -= H * node_density * q
                if ends > 0:
                    lines_commit(lines, line_state, m, q_end, line_books)
                for i in range(volumes):
                    mass = node_mass[i] + inflow[i]
                    excess = p[i] - node_ambient
                    stored = mass * g[i] - excess * V[i]
                    was = node_mass[i] * node_g[i]
                    was -= (node_p[i] - node_ambient) * node_held[i]
                    work = excess * (V[i] - node_held[i])
                    node_numeric[i] += was - stored + g[i] * inflow[i] - work
                    node_mass[i] = mass
                    node_held[i] = V[i]
                for i in range(volumes, count_nodes):
                    node_supply[i - volumes] -= g[i] * inflow[i]
                for i in range(count_nodes):
                    node_before[i] = node_p[i]
                    node_p[i] = p[i]
                    node_g[i] = g[i]
            for c in range(count_interfaces):
                gap = interface_gap0[c] + S[Y1 + interface_upper[c]] - S[Y1 + interface_lower[c]]
                interface_rate[c] = (gap - interface_gap[c]) * inverse_H
                interface_gap[c] = gap
                was_closed = interface_since[c] < np.inf
                acted = f_contact[c] != 0.0 or f_film[c] != 0.0 or lost_contact[c] != 0.0
                if acted or was_closed:
                    interface_e[c] = e1[c]
                    interface_force[c] = fi[c]
                    # over the way that the bodies went, not the one that film and dashpot saw
                    ahead = gap - gap1[c]
                    if interface_chi[c] != 0.0 and ahead != 0.0:
                        elastic, _, _ = mean_force(
                            interface_kind[c],
                            interface_law,
                            interface_law0[c],
                            -(gap1[c] + e1[c]),
                            -(gap + e1[c]),
                            interface_hint[c],
                        )
                        lost_contact[c] += (elastic - f_contact[c]) * ahead
                    interface_contact_loss[c] += lost_contact[c]
                    interface_film_loss[c] += lost_film[c] - f_film[c] * ahead
                    interface_film_before[c] = 0.0
                    if f_contact[c] > 0.0:
                        if not was_closed:
                            interface_since[c] = t
                            interface_film_before[c] = f_film[c]
                    else:
                        interface_since[c] = np.inf
                    column = element_forces + count_branches + 2 * c
                    sums[column] += H * f_contact[c]
                    sums[column + 1] += H * f_film[c]
                    peaks[c] = max(peaks[c], fi[c])
                    felt = level == 0 and abs(f_film[c]) > interface_film_felt[c]
                    if felt or was_closed or f_contact[c] > 0.0:
                        place = record_filled[c]
                        if place < record_fine.shape[1]:
                            record_fine[c, place, 0] = t
                            record_fine[c, place, 1] = H
                            record_fine[c, place, 2] = f_contact[c]
                            record_fine[c, place, 3] = f_film[c]
                            record_fine[c, place, 4] = gap
                        record_filled[c] = place + 1
                if interface_chi[c] != 0.0:
                    interface_deepest[c] = max(interface_deepest[c], -gap)
                    if gap > SEPARATED * interface_deepest[c]:
                        interface_chi[c] = interface_deepest[c] = 0.0
            for i in range(width):
                S[WORK + i] += S[FORCE + i] * (S[Y1 + i] - S[Y0 + i])
                S[Y0 + i] = S[Y1 + i]
                S[SEEN + i] = S[USED + i]
                S[PENDING + i] = S[FORCE + i]
                S[LAST + i] = S[FORCE + i]
                S[ELEMENTS_BEFORE + i] = S[ELEMENTS + i]
            last_level = level
            done += m
            step += m
            if level == 1:
                coarse_steps += 1
            else:
                fine_steps += 1
        for k in range(body_modes.size):
            block = pointer(body_fine, body_start[k])
            if level == 1:
                block = pointer(body_coarse, body_start[k])
            apply_forces(
                block,
                body_modes[k],
                shift(S, PENDING),
                body_port0[k],
                body_port1[k],
            )
        for i in range(width):
            S[PENDING + i] = 0.0
        if level == 1:
            _copy_state(body_coarse, body_fine, body_start, body_modes)
        in_record += 1
        record_time += M * h
        if in_record == per_record:
            for j in range(scratch.sums.size):
                record_means[record, j] = sums[j] / record_time
                sums[j] = 0.0
            for c in range(count_interfaces):
                record_peaks[record, c] = peaks[c]
                peaks[c] = 0.0
            record_points(
                recording,
                record,
                body_fine,
                body_start,
                body_modes,
                bodies.at,
                nodes.p,
                elements.state,
                branches.state,
                interfaces.gap,
            )
            record += 1
            in_record = 0
            record_time = 0.0
    clock[0], clock[1] = step, last_level
    clock[2] += fine_steps
    clock[3] += coarse_steps
    return STATUS_DONE


@njit(cache=True)
def record_points(
    recording: Recording,
    record: int,
    W: Vector,
    start: Index,
    count: Index,
    y: Vector,
    p: Vector,
    state: Vector,
    branch_state: Vector,
    gap: Vector,
) -> None:
    """Columns: port displacements, port velocities, centres of mass, pressures, states, gaps."""
    out, place = recording.points, 0
    ports = recording.port_row.size
    for i in range(ports):
        out[record, place + i] = y[i]
    place += ports
    for i in range(ports):
        total = 0.0
        for k in range(recording.port_block0[i], recording.port_block1[i]):
            total += watch(pointer(W, start[k]), count[k], 1, recording.port_row[i])
        out[record, place + i] = total
    place += ports
    for b in range(recording.cm_block0.size):
        total = 0.0
        for k in range(recording.cm_block0[b], recording.cm_block1[b]):
            last = (start[k + 1] - start[k]) // ROW - 1
            total += watch(pointer(W, start[k]), count[k], 1, last)
        out[record, place + b] = total
    place += recording.cm_block0.size
    for i in range(p.size):
        out[record, place + i] = p[i]
    place += p.size
    for i in range(recording.states.size):
        out[record, place + i] = state[recording.states[i]]
    place += recording.states.size
    for i in range(recording.branch_states.size):
        out[record, place + i] = branch_state[recording.branch_states[i]]
    place += recording.branch_states.size
    for c in range(gap.size):
        out[record, place + c] = gap[c]
