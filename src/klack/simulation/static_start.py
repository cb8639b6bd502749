r"""Static equilibrium of bodies, pressures and flows at time zero.

Unknown are the axial coordinates :math:`z` of the free bodies, the displacements :math:`y` of their
ports, the pressures :math:`p` that the case does not state, and the flows :math:`\dot m` of
columns of fluid (lines, inertances):

.. math::

    y = \Phi_r^T z + C F(y, p), \qquad \Phi_r F(y, p) = 0, \qquad
    \sum \dot m_i(y, p) = 0, \qquad g_a - g_b = r\,\dot m

with the static compliance :math:`C = \Phi_e^T \Omega^{-2} \Phi_e` of the elastic modes and the
forces :math:`F` of everything that acts, contacts with their full laws.

To reach the root that the valve itself would come to rest in, pseudo-time first leads near it
(Kelley & Keyes, SIAM J. Numer. Anal. 35 (1998) 508): implicit Euler steps in which a body creeps
with :math:`\Delta z = \tfrac12 \tau^2 \Phi_r F` and a volume fills with :math:`V \varrho' \Delta p
= \tau \sum \dot m`.  Steps :math:`\tau` grow from microseconds until nothing but the equilibrium is
left; a step whose Newton iteration fails is shortened.  What never stops has no equilibrium.

No state with a magnet beyond the range of its gaps is tried: past its pole it would still pull, and
hold an armature where none can be.
"""

import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Index, Matrix, Vector
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.contact.step_constants import LAW_RUBBING, LAW_YIELDING
from klack.errors import AccuracyWarning, ConvergenceError, InputError
from klack.hydraulics.fluid_table import fluid_at
from klack.network.ranges import Travel, range_text, value_text
from klack.network.rows import BranchRow, LimitRow, LineRow, WaveRow
from klack.simulation.delay_line import start_lines
from klack.simulation.lasting_laws import begin_faces, begin_sliders
from klack.simulation.modal_step import ROW, ROW_Q
from klack.simulation.network_arrays import (
    BEFORE,
    BEFORE_2,
    BEFORE_3,
    LAST,
    MEAN,
    SEEN,
    Y0,
)
from klack.simulation.network_compile import CompiledNetwork
from klack.simulation.network_gas import settle_gas
from klack.simulation.network_result import StaticStart
from klack.simulation.rest import resting_dissipation
from klack.simulation.row_calls import SHARE_OF_STEP
from klack.simulation.static_rows import (
    EMPTIED,
    EMPTY,
    FOUND,
    MORE,
    NONE,
    Balance,
    Begin,
    Couplings,
    Parts,
    State,
    fluids_at,
    newton_steps,
)
from klack.simulation.wave_rows import start_wave
from klack.units import format_si

__all__ = ["RestState", "SteadySlopes", "begin_at_rest", "begin_steady"]


_FIRST, _LONGEST, _SHORTEST = 2e2, 2e13, 2e-5  # steps of pseudo-time over the step of the run
_GROWTH = 8.0  # from one to the next
_MOST_STATES = 64  # of elements that are kept for places which come again
_MOST_ROUNDS = 100  # Newton steps at once, more than there are
_MOST_BEYOND = 20  # steps that are shortened because a magnet would leave its range, or for fluid
_LENGTH = 20.0  # [m/s] displacements are told apart to a share of what this covers in a step
_MOVE = 0.02  # [m/s] the same for the way by which a port is moved to see what changes
_FAR = 2e9  # [m/s] ... and for what an unsupported body has gone
_HIGH = 1e11  # [Pa] a volume that came so high lets nothing out
_MOST_STEADY = 1e9  # [Pa] the same of an operating point: no valve is meant for more
_UNDAMPED = float(np.finfo(float).tiny)  # [s/m]: known, and nothing
_SHALLOW = 1e-6  # [m] no contact is looked at that is less deep
_DEEP = 10.0  # of the way between the stops: nobody means a stop so soft
_ROUND_OFF = 1e-14  # of the sum of absolute forces, flows and displacements: they balance
_IDLE = 1e-6  # of the largest flow: where less flows, behind closed valves, that is the measure
_FILLED = 1e-6  # of ambient pressure: a closed volume that something has filled
_NEARLY = 1e-9  # the same where they come no closer


@dataclass(frozen=True, slots=True, eq=False)
class RestState:
    """Equilibrium of a network, from which that of a similar one is found at once."""

    _state: State
    _first: Vector  # pressures from which the search for it began
    _held: frozenset[int]
    _stuck: frozenset[int]
    _enclosed: bool


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SteadySlopes:
    """Linear equations of :mod:`klack.simulation.static_start` about an equilibrium.

    Ports ``n``, rigid modes ``r``, free volumes ``f``, columns of fluid ``c``.

    Parameters
    ----------
    shapes (r, n) [1/sqrt(kg)]
    axial (r,) [sqrt(kg)]
        Coordinate of each rigid mode per metre of its body along +z.
    body
        Component of each rigid mode.
    moves (r,)
        False for a body that is held.
    compliance (n, n) [m/N]
        Static one of the elastic modes.
    force_by_port, force_by_pressure : array, shapes (n, n) [N/m], (n, f) [m^2]
    flow_by_port, flow_by_pressure : array, shapes (f, n) [kg/(s m)], (f, f) [kg/(s Pa)]
        Of what flows into the free volumes, without columns.
    volumes
        Components of the free volumes.
    density (f,) [kg/m^3]
    left (f,) [kg/s]
        Rest of the flow into each of them.
    ends (c, 2)
        Free volumes at the ends of columns; -1 for a known pressure.
    friction (c,) [J s/kg^2]
    known (f,)
        Volumes with a way for the fluid to a prescribed pressure; the others are enclosed.
    """

    shapes: Matrix
    axial: Vector
    body: tuple[str, ...]
    moves: NDArray[np.bool_]
    compliance: Matrix
    force_by_port: Matrix
    force_by_pressure: Matrix
    flow_by_port: Matrix
    flow_by_pressure: Matrix
    volumes: tuple[str, ...]
    density: Vector
    left: Vector
    ends: Index
    friction: Vector
    known: NDArray[np.bool_]


class _RunawayError(Exception):
    """The bodies that go far, or the volumes whose pressure has no end."""

    def __init__(self, bodies: list[int], volumes: list[int]) -> None:
        self.bodies, self.volumes = bodies, volumes
        super().__init__()


def begin_at_rest(
    network: CompiledNetwork,
    step: float,
    near: RestState | None = None,
    shift: Vector | None = None,
) -> tuple[StaticStart, RestState]:
    """Find the static equilibrium and put the network there, in place.

    Bodies with a speed at the start stay where they are, and so do those without an equilibrium
    that friction holds.  Volumes keep a stated pressure; those without one, where nothing flows in
    or out, ambient pressure.

    Parameters
    ----------
    step [s]
        Fine step of the run.
    near
        Of a similar network of the same parts; it has warned already.
    shift (ports,) [m]
        Of the ports from where bodies that move along the axis have them.

    Raises
    ------
    InputError
        If a body has no equilibrium, with its name.
    ConvergenceError
        If none is found.
    """
    problem, found, closed = _settled(network, step, near, shift=shift)
    notes = [_no_pressure(network, i) for i in closed]
    for note in notes:
        warnings.warn(note, AccuracyWarning, stacklevel=3)
    notes += problem.held_by_friction()
    return problem.put(found._state, tuple(notes)), found


def begin_steady(
    network: CompiledNetwork,
    step: float,
    *,
    first: Mapping[str, float],
    held: Collection[str] = (),
) -> tuple[StaticStart, SteadySlopes]:
    """Find the operating point of a network and put it there, in place: every volume is free.

    Parameters
    ----------
    network
        Without stated pressures: those at the start are where the search begins.
    step [s]
    first [m]
        Displacements of free bodies from which the search begins; else 0.
    held
        Bodies that stay at their ``first`` displacement, whatever force is left on them.

    Raises
    ------
    InputError
        If a body has no equilibrium, or a volume no steady pressure.
    """
    bodies = [row.component for row in network.rows.bodies]
    fixed = frozenset(bodies.index(name) for name in held)
    lifts = np.array([first.get(name, 0.0) for name in bodies])
    problem, found, closed = _settled(network, step, None, fixed=fixed, lifts=lifts)
    if closed:
        raise _without_outlet(network, closed)
    notes = problem.held_by_friction()
    begun = problem.put(found._state, tuple(notes), tells_closed=False)
    return begun, problem.steady_slopes(found._state)


def _settled(
    network: CompiledNetwork,
    step: float,
    near: RestState | None,
    *,
    shift: Vector | None = None,
    fixed: frozenset[int] = frozenset(),
    lifts: Vector | None = None,
) -> tuple["_Balance", RestState, list[int]]:
    """Equilibrium, and the volumes without a steady pressure, which keep that of the start."""
    held = set(near._held) if near is not None else set[int]()
    stuck = set(near._stuck) if near is not None else set[int]()
    closed: list[int] = []
    enclosed = near is not None and near._enclosed
    while True:
        problem = _Balance(
            network, step, held, stuck, enclosed=enclosed, shift=shift, fixed=fixed, lifts=lifts
        )
        try:
            state = _march(problem, near)
            kept = frozenset(held), frozenset(stuck), enclosed
            return problem, RestState(state, problem.first().p, *kept), closed
        except _RunawayError as away:
            if away.volumes:
                held.update(away.volumes)
                closed += away.volumes
            elif not enclosed and problem.can_enclose(away.bodies):
                enclosed = True
            elif all(problem.dry[b] > 0.0 for b in away.bodies):
                stuck.update(away.bodies)
            else:
                raise _unheld(network, away.bodies) from None


def _march(problem: "_Balance", near: RestState | None) -> State:
    """Lead the start through pseudo-time to the equilibrium, from a near one with long steps.

    A body that nothing holds and on which nothing acts stays: in a long step it would drift.
    """
    begin, step = problem.first(), problem.step
    state = begin if near is None else problem.nearby(begin, near)
    longest = _LONGEST * step
    tau = _FIRST * step if near is None else longest
    mass = None if near is None else problem.masses(begin)  # what closed volumes hold
    beyond = 0
    while tau >= _SHORTEST * step and beyond < _MOST_BEYOND:
        open_modes = problem.unbalanced(state)
        if open_modes is None and mass is None:
            return state
        if open_modes is None:  # a near state is in balance with what its own volumes hold
            open_modes = problem.answering()
        after = problem.advance(state, min(tau, longest), open_modes, mass)
        if after is None:
            beyond += problem.beyond is not None or bool(problem.emptied)
            tau = min(tau, longest) / _GROWTH**1.5
            continue
        problem.check(after)
        if tau > _GROWTH**4 * longest and problem.unbalanced(after, _NEARLY) is None:
            return after
        if tau > _GROWTH**8 * longest:
            break
        state, tau, mass = after, tau * _GROWTH, None
    if problem.emptied:
        raise _RunawayError([], problem.emptied)
    raise problem.not_found(state)


class _Balance:
    """Residuals and slopes of the equations above, for one network."""

    def __init__(
        self,
        network: CompiledNetwork,
        step: float,
        held: set[int],
        stuck: set[int],
        *,
        enclosed: bool,
        shift: Vector | None = None,
        fixed: frozenset[int] = frozenset(),
        lifts: Vector | None = None,
    ) -> None:
        self.network, self.step, self.enclosed, self.stuck = network, step, enclosed, sorted(stuck)
        self.is_steady = lifts is not None
        self.high = _MOST_STEADY if self.is_steady else _HIGH
        self.emptied: list[int] = []  # volumes in the last step that failed for them
        self.lifts = np.zeros(len(network.rows.bodies)) if lifts is None else lifts
        self.h, self.move = SHARE_OF_STEP * step, _MOVE * step
        rows, nodes = network.rows, network.nodes
        count = network.bodies.first.size - 1
        self.ports = count
        along = [_along(row.body) for row in rows.bodies]
        rigid = [len(directions) for directions in along]
        self.of_body = np.repeat(np.arange(len(rigid)), rigid)
        self.shapes = np.zeros((sum(rigid), count))
        self.compliance = np.zeros((count, count))
        staying = fixed | stuck
        rests = [row.speed == 0.0 and b not in staying for b, row in enumerate(rows.bodies)]
        self.moves = np.array(rests)[self.of_body]
        begin, mode = 0, 0
        self.along = along
        sizes = [
            size for row in rows.bodies if (size := float(np.linalg.norm(row.body.rigid_axial)))
        ]
        self.axial = np.array(sizes)
        for row, directions in zip(rows.bodies, along, strict=True):
            body, here = row.body, slice(begin, begin + len(row.ports))
            shapes = np.asarray(body.port_shapes)
            r = body.rigid_count
            self.shapes[mode : mode + len(directions), here] = directions @ shapes[:r]
            elastic = shapes[r:] / body.omega[r:, None]
            self.compliance[here, here] = elastic.T @ elastic
            begin, mode = here.stop, mode + len(directions)
        self.body_of_port = np.repeat(
            np.arange(len(rows.bodies)), [len(b.ports) for b in rows.bodies]
        )
        self.dry = self._dry_friction(rigid)
        stated = [rows.nodes[handle].stated for handle in network.node_order]
        self.stated = np.array(stated, dtype=bool)
        self.given = [i in held or bool(self.stated[i]) for i in range(nodes.volumes)]
        self.at_first = np.array([rows.nodes[handle].at_start for handle in network.node_order])
        walls = set(nodes.wall_node.tolist())
        free = [i for i in range(nodes.volumes) if not self.given[i] or (enclosed and i in walls)]
        self.free = np.array(free, np.int64)
        self.shut = np.array([self.given[i] for i in free], dtype=bool)
        self._columns()
        self.shift = np.zeros(count) if shift is None else shift
        self.kept = [
            (k, row.at_rest) for k, row in enumerate(rows.elements) if row.at_rest is not None
        ]
        self.parts = Parts(
            network.elements, network.branches, nodes, network.node_state.hint, network.interfaces
        )
        size = count + 1 + nodes.nodes
        self.now = Balance(
            force=np.zeros(count + 1),
            acting=np.zeros(count + 1),
            inflow=np.zeros(nodes.nodes),
            size=np.zeros(size),
            by_port=np.zeros((size, count)),
            by_pressure=np.zeros((size, self.free.size)),
            contact=np.zeros(len(rows.interfaces)),
            report=np.zeros(3, np.int64),
            left=np.array([-1.0, 0.0]),
        )
        length = _LENGTH * step  # in these units no unknown has a size of its own
        largest = np.max(np.abs(self.shapes), axis=1, initial=0.0)
        units = np.concatenate(
            [
                np.full(count, length),
                length / np.where(largest > 0.0, largest, 1.0),
                np.ones(self.free.size),
                np.full(len(self.ends), nodes.density * length**2),
            ]
        )
        self.states: dict[tuple[int, bytes], Vector] = {}  # of elements, where they are asked again
        self.ranges = [limit for limit in rows.limits if limit.ports]
        self.couplings = self._couplings(units)

    def _dry_friction(self, rigid: list[int]) -> Vector:
        """Largest force by which friction on what cannot move away holds each body [N]."""
        held = np.zeros(len(rigid))
        for slider in self.network.rows.sliders:
            ends = [self.network.port_of[handle] for handle in (slider.upper, slider.lower)]
            free = [b for p in ends if p < self.ports and rigid[b := int(self.body_of_port[p])]]
            if len(free) == 1:
                held[free[0]] += slider.breakaway
        return held

    def held_by_friction(self) -> list[str]:
        """Notes on bodies that friction holds where they are drawn; an error where it cannot."""
        left, told = self.left_on_bodies(), []
        for b in self.stuck:
            name = self.network.rows.bodies[b].component
            if abs(left[name]) > self.dry[b]:
                raise _unheld(self.network, [b])
            told.append(
                f"'{name}' has no equilibrium without friction, which holds it at the start: "
                f"{format_si(abs(left[name]), 'N', 3)} of {format_si(float(self.dry[b]), 'N', 3)}."
            )
        return told

    def _columns(self) -> None:
        """Give lines and inertances with a free volume at one end an unknown flow."""
        rows, density, p = self.network.rows, self.network.nodes.density, self.network.node_state.p
        place = {handle: i for i, handle in enumerate(self.network.node_order)}
        free = set(self.free.tolist())

        def moving(columns: Sequence[BranchRow | LineRow | WaveRow]) -> list[int]:
            ends = [(place.get(row.a), place.get(row.b)) for row in columns]
            return [k for k, (a, b) in enumerate(ends) if a in free or b in free]

        is_column = [row.column is not None for row in rows.branches]
        self.column_rows = np.array(is_column, dtype=np.int64)
        self.column_branch = [k for k in moving(rows.branches) if is_column[k]]
        self.column_line, self.column_wave = moving(rows.lines), moving(rows.waves)
        branches = [rows.branches[k] for k in self.column_branch]
        lines = [rows.lines[k] for k in self.column_line]
        waves = [rows.waves[k] for k in self.column_wave]
        columns: list[BranchRow | LineRow | WaveRow] = [*branches, *lines, *waves]
        ends = [(place[row.a], place[row.b]) for row in columns]
        self.ends = np.array(ends, np.int64).reshape(-1, 2)
        friction = [
            *(row.column for row in branches),
            *(row.resistance / density**2 for row in lines),
            *(row.drop(float(p[place[row.a]]), 0.0)[1] for row in waves),
        ]
        self.friction = np.array(friction, dtype=float)
        self.drop = np.full(len(friction), np.nan)

    def _couplings(self, units: Vector) -> Couplings:
        nodes = self.network.nodes
        place = {int(i): j for j, i in enumerate(self.free)}
        joined = [
            (k, sign, place[int(i)])
            for k, pair in enumerate(self.ends)
            for sign, i in zip((1.0, -1.0), pair, strict=True)
            if int(i) in place
        ]
        walls = [
            (place[int(i)], port, area)
            for i, port, area in zip(nodes.wall_node, nodes.wall_port, nodes.wall_area, strict=True)
            if self.enclosed and int(i) in place and port < self.ports
        ]
        range_ports = np.zeros((len(self.ranges), self.ports + 1))
        for weights, limit in zip(range_ports, self.ranges, strict=True):
            for port, factor in limit.ports:
                weights[self.network.port_of[port]] += factor
        ranges = [(x.start, x.valid[0] - x.slack, x.usable[1]) for x in self.ranges]
        elements = self.network.elements
        of_kept = [elements.ports[elements.port0[k] : elements.port0[k + 1]] for k, _ in self.kept]
        asked = sorted({int(port) for ports in of_kept for port in ports} - {self.ports})
        return Couplings(
            shapes=self.shapes,
            compliance=self.compliance,
            shift=self.shift,
            units=units,
            h=self.h,
            move=self.move,
            length=_LENGTH * self.step,
            free=self.free,
            shut=self.shut,
            ends=self.ends,
            friction=self.friction,
            drop=self.drop,
            flows=self.column_rows,
            range_ports=range_ports,
            ranges=np.array(ranges, dtype=float).reshape(-1, 3),
            asked_port=np.array(asked, dtype=np.int64),
            asked=np.zeros((len(asked), self.now.size.size)),
            column=np.array([k for k, _, _ in joined], dtype=np.int64),
            sign=np.array([sign for _, sign, _ in joined], dtype=float),
            volume=np.array([j for _, _, j in joined], dtype=np.int64),
            wall_volume=np.array([j for j, _, _ in walls], dtype=np.int64),
            wall_port=np.array([port for _, port, _ in walls], dtype=np.int64),
            wall_area=np.array([area for _, _, area in walls], dtype=float),
        )

    @property
    def beyond(self) -> tuple[LimitRow, float] | None:
        """Range that the last step left, and how far."""
        k, value = int(self.now.left[0]), float(self.now.left[1])
        return None if k < 0 else (self.ranges[k], value)

    def can_enclose(self, bodies: list[int]) -> bool:
        """Whether fluid in a volume may hold one of these bodies like a spring."""
        nodes = self.network.nodes
        walls = zip(nodes.wall_node, nodes.wall_port, strict=True)
        return any(i < nodes.volumes and self.body_of_port[port] in bodies for i, port in walls)

    def first(self) -> State:
        """Undeformed bodies, stated or ambient pressures, no flow in columns."""
        z = self.axial * self.lifts[self.of_body]
        y = np.append(self.shapes.T @ z, 0.0)
        return State(z, y, self.at_first.copy(), np.zeros(len(self.ends)))

    def nearby(self, begin: State, near: RestState) -> State:
        """Equilibrium of a similar network, with what is given in this one."""
        state = near._state.copy()
        state.p[:] += begin.p - near._first  # a volume that nothing fills keeps what it begins with
        known = np.setdiff1d(np.arange(state.p.size), self.free)
        state.p[known] = begin.p[known]
        return state

    def unbalanced(self, state: State, share: float = _ROUND_OFF) -> NDArray[np.bool_] | None:
        """Rigid modes that are free to creep; None in equilibrium.

        One with round-off alone, which no force answers, is not.
        """
        if not self.evaluate(state):
            raise self.failed()
        ports, y = self.ports + 1, np.abs(state.y[:-1])
        known = self.now.size + np.abs(self.now.by_port) @ y
        known += np.abs(self.now.by_pressure) @ state.p[self.free]
        left = np.abs(self.shapes @ self.now.force[:-1])
        pushed = left > share * (np.abs(self.shapes) @ known[: ports - 1])
        bent = self._bent(state)
        stretch = y + np.abs(self.compliance) @ known[: ports - 1]
        settled = bool(np.all(np.abs(bent) <= share * stretch) and not np.any(pushed & self.moves))
        nodes, net, flows = self.network.nodes, self._net(state), known[ports:].copy()
        for (a, b), m in zip(self.ends, state.m, strict=True):
            flows[a] += abs(m)
            flows[b] += abs(m)
        if nodes.volumes > nodes.chambers or share > _ROUND_OFF:
            # nothing flows in a dead end but the round-off of all that flows
            unit = nodes.density * (_LENGTH * self.step) ** 2
            most = unit + float(np.max(np.abs(state.m), initial=0.0))
            flows[self.ends.ravel()] += _ROUND_OFF / share * most
        flows = np.maximum(flows, _IDLE * np.max(flows, initial=0.0))
        if settled and bool(np.all(np.abs(net) <= share * flows[self.free])):
            rest, scale = self._columns_left(state)
            if np.all(np.abs(rest) <= share * scale):
                return None
        return (pushed & self.moves) | self.answering()

    def answering(self) -> NDArray[np.bool_]:
        """Rigid modes that move and whose motion a force answers."""
        answers = np.any(self.shapes @ self.now.by_port[: self.ports] != 0.0, axis=1)
        return np.asarray(answers & self.moves)

    def advance(
        self,
        start: State,
        tau: float,
        open_modes: NDArray[np.bool_],
        mass: Vector | None = None,
    ) -> State | None:
        """One implicit Euler step of pseudo-time; None if Newton's method fails.

        ``mass`` is what the free volumes hold before, in place of that of ``start``.
        """
        state, self.emptied, done = start.copy(), [], np.array([0.0, np.inf])
        self.now.left[0] = -1.0
        creep = np.where(open_modes, 0.5 * tau * tau, 0.0)
        begin = Begin(start.z, creep, self.masses(start) if mass is None else mass, tau)
        rounds = 1 if self.kept or self.column_wave else _MOST_ROUNDS
        found = MORE
        while found == MORE:
            if not self._prepare(state):
                return None
            found = newton_steps(self.parts, self.couplings, self.now, begin, state, done, rounds)
        if found == EMPTIED:
            self.emptied = self._unstated(state.p < EMPTY)
            if not self.is_steady:  # else perhaps a shorter step leaves something in it
                raise _RunawayError([], self.emptied)
        return state if found == FOUND else None

    def check(self, state: State) -> None:
        """Raise :class:`_RunawayError` for what has left all real bounds."""
        volumes = self._unstated(state.p > self.high)
        far = np.flatnonzero(np.abs(state.y[:-1]) > _FAR * self.step)
        bodies = sorted({int(self.body_of_port[port]) for port in far})
        if volumes or bodies:
            raise _RunawayError(bodies, volumes)

    def _unstated(self, which: NDArray[np.bool_]) -> list[int]:
        return [int(i) for i in self.free if which[i] and not self.given[i]]

    def evaluate(self, state: State) -> bool:
        """Forces and flows with their slopes, contacts included; False if a part fails."""
        return self._prepare(state) and self._balances(state)

    def _balances(self, state: State) -> bool:
        begin = Begin(state.z, state.z, state.z, 0.0)  # of no step
        given = self.parts, self.couplings, self.now, begin, state, np.zeros(2), 0
        return bool(newton_steps(*given) != NONE)

    def _prepare(self, state: State) -> bool:
        """What elements and lines of cells say outside of compiled code; False if one fails."""
        first, at, now = self.ports + 1, self.couplings, self.now
        for port, found in zip(at.asked_port, at.asked, strict=True):
            moved = state.copy()
            moved.y[port] += self.move
            found[:] = np.nan
            if self._keep_states(moved.y) and self._balances(moved):
                found[:first], found[first:] = now.acting, now.inflow
        for place, k in enumerate(self.column_wave, self.drop.size - len(self.column_wave)):
            at_a, flow = float(state.p[self.ends[place, 0]]), float(state.m[place])
            self.drop[place], self.friction[place] = self.network.rows.waves[k].drop(at_a, flow)
        return self._keep_states(state.y)

    def _keep_states(self, y: Vector) -> bool:
        """Give elements that ask for it the state in which they stay; False if one has none."""
        elements = self.network.elements
        for k, state_at in self.kept:
            ports = elements.ports[elements.port0[k] : elements.port0[k + 1]]
            place = k, y[ports].tobytes()
            state = self.states.get(place)
            if state is None:
                try:
                    state = state_at(y[ports])
                except (ConvergenceError, np.linalg.LinAlgError):
                    self.now.report[:] = 0, k, 1
                    return False
                if len(self.states) >= _MOST_STATES:
                    self.states.clear()
                self.states[place] = state
            elements.state[elements.state0[k] : elements.state0[k] + len(state)] = state
        return True

    def _bent(self, state: State) -> Vector:
        bent = state.y[:-1] - self.shapes.T @ state.z - self.compliance @ self.now.force[:-1]
        return np.asarray(bent - self.shift)

    def _net(self, state: State) -> Vector:
        """Mass flow into each free volume [kg/s]; an enclosed one lets none through."""
        inflow = self.now.inflow.copy()
        np.add.at(inflow, self.ends[:, 0], -state.m)
        np.add.at(inflow, self.ends[:, 1], state.m)
        return np.where(self.shut, 0.0, inflow[self.free])

    def _columns_left(self, state: State) -> tuple[Vector, Vector]:
        """What accelerates each column [J/kg], and the scale of its round-off.

        That is the sum of both terms of the difference, and of pressure over density: near ambient
        pressure the energy itself is small, its round-off is that of the pressure.
        """
        at_ends = state.p[self.ends]
        fluid = self._fluid(at_ends.ravel()).reshape(-1, 2, 3)
        g, size = fluid[:, :, 2], np.abs(fluid[:, :, 2]) + at_ends / fluid[:, :, 0]
        drop = np.where(np.isnan(self.drop), self.friction * state.m, self.drop)
        return drop - (g[:, 0] - g[:, 1]), np.abs(drop) + size.sum(axis=1)

    def _fluid(self, p: Vector) -> Matrix:
        """Density, slope and pressure energy at each pressure, shape (n, 3)."""
        nodes = self.network.nodes
        found = np.asarray(fluids_at(nodes.settled, p))
        if nodes.slow_gas:  # flows count with all gas free
            found[:, 2] = np.asarray(fluids_at(nodes.fluid, p))[:, 2]
        return found

    def masses(self, state: State) -> Vector:
        """Mass in each free volume [kg]."""
        volume = self.volumes(state.y if self.enclosed else np.zeros_like(state.y))[self.free]
        return np.asarray(volume * self._fluid(state.p[self.free])[:, 0])

    def volumes(self, y: Vector) -> Vector:
        nodes = self.network.nodes
        volume = np.zeros(nodes.nodes)
        volume[: nodes.volumes] = nodes.volume
        np.add.at(volume, nodes.wall_node, nodes.wall_area * y[nodes.wall_port])
        return volume

    def failed(self) -> ConvergenceError:
        """Error of the part without an answer at the start."""
        head, k, status = (int(value) for value in self.now.report)
        rows = self.network.rows
        failed = rows.branches[k] if head else rows.elements[k]
        errors = getattr(failed.step, "errors", [])
        if errors:
            raise errors.pop(0)
        words = failed.failures.get(status, f"status {status} of its step function")
        return ConvergenceError(
            f"static equilibrium: {failed.component}: {words}.\n"
            "Try: check its parameters and start values."
        )

    def left_on_bodies(self) -> dict[str, float]:
        left = self.shapes @ self.now.force[:-1]
        result = {}
        for b, row in enumerate(self.network.rows.bodies):
            mine = left[self.of_body == b]
            if mine.size:
                result[row.component] = float(mine @ (self.along[b] @ row.body.rigid_axial))
        return result

    def not_found(self, state: State) -> ConvergenceError:
        if not self.evaluate(state):
            return self.failed()
        if self.beyond is not None:
            return _out_of_range(*self.beyond)
        left = self.left_on_bodies()
        name = max(left, key=lambda key: abs(left[key])) if left else "the network"
        force = format_si(abs(left.get(name, 0.0)), "N", 3)
        flows = self._net(state)
        flowing = ""
        if flows.size and np.any(flows != 0.0):
            most = int(np.argmax(np.abs(flows)))
            volume = self.network.rows.nodes[self.network.node_order[self.free[most]]].component
            flow = abs(float(flows[most])) / self.network.nodes.density
            flowing = f", {format_si(flow, 'm^3/s', 3)} into or out of '{volume}'"
        return ConvergenceError(
            f"static equilibrium not found: {force} remain on '{name}'{flowing} at a "
            f"displacement of {format_si(float(np.max(np.abs(state.y))), 'm', 3)}.\n"
            "Try: check for an unsupported body, a magnet stronger "
            "than its counterforce, or a gap outside its map; in Python, "
            "start='free' skips the equilibrium."
        )

    def steady_slopes(self, state: State) -> SteadySlopes:
        """Equations about the state that the network is in."""
        n, network = self.ports, self.network
        place = {int(i): j for j, i in enumerate(self.free)}
        flow = self.now.by_pressure[n + 1 :]
        names = [network.rows.nodes[handle].component for handle in network.node_order]
        return SteadySlopes(
            shapes=self.shapes.copy(),
            axial=self.axial.copy(),
            body=tuple(network.rows.bodies[b].component for b in self.of_body),
            moves=self.moves.copy(),
            compliance=self.compliance.copy(),
            force_by_port=self.now.by_port[:n].copy(),
            force_by_pressure=self.now.by_pressure[:n].copy(),
            flow_by_port=self.now.by_port[n + 1 :][self.free].copy(),
            flow_by_pressure=flow[self.free].copy(),
            volumes=tuple(names[i] for i in self.free),
            density=self._fluid(state.p[self.free])[:, 0],
            left=self._net(state),
            ends=np.array([[place.get(int(i), -1) for i in pair] for pair in self.ends], np.int64)
            .reshape(-1, 2)
            .copy(),
            friction=self.friction.copy(),
            known=self._known(flow),
        )

    def _known(self, flow: Matrix) -> NDArray[np.bool_]:
        """Free volumes with a way for the fluid to a known pressure.

        A pressure of one volume that changes the flow into another node leads there.
        """
        free = set(self.free.tolist())
        links = [
            (int(i), int(k))
            for j, i in enumerate(self.free)
            for k in np.flatnonzero(flow[:, j])
            if k != i
        ]
        links += [(int(a), int(b)) for a, b in self.ends]
        known = set(range(self.network.nodes.nodes)) - free
        while True:
            more = {a for a, b in links if b in known} | {b for a, b in links if a in known}
            if more <= known:
                return np.array([int(i) in known for i in self.free], dtype=bool)
            known |= more

    def put(
        self, state: State, notes: tuple[str, ...], *, tells_closed: bool = True
    ) -> StaticStart:
        """Put the network into this state, and describe it."""
        if not self.evaluate(state):
            raise self.failed()
        self._check_stops(state)
        self._put_bodies(state)
        if state.p.size:
            self._put_fluid(state)
        self._put_interfaces(state)
        return self._told(state, notes, tells_closed=tells_closed)

    def _check_stops(self, state: State) -> None:
        """Reject bodies pressed far deeper into a stop than they can move away."""
        rows, interfaces = self.network.rows, self.network.interfaces
        gap = interfaces.gap0 + state.y[interfaces.upper] - state.y[interfaces.lower]
        for row, depth in zip(rows.interfaces, -gap, strict=True):
            if row.law is None or depth <= _SHALLOW:
                continue
            factors = Travel.factors(rows, ((row.upper, 1.0), (row.lower, -1.0)))
            way = row.gap + Travel.of(rows).highest(factors)[0]
            if depth > _DEEP * way > 0.0:
                raise InputError(
                    f"static equilibrium: components.{row.component}",
                    got=f"bodies pressed {format_si(float(depth), 'm', 3)} into each other",
                    expected=f"less than {_DEEP:g} times {format_si(way, 'm', 3)}, the whole "
                    "clearance between the stops",
                    hint="check the stiffness of the stop and the forces at time zero, with their "
                    "units.",
                )

    def _put_bodies(self, state: State) -> None:
        network = self.network
        bodies = network.bodies
        at, ports = bodies.at, self.ports
        for row in (Y0, SEEN):
            at[row : row + ports] = state.y[:-1]
        for row in (LAST, MEAN, BEFORE, BEFORE_2, BEFORE_3):
            at[row : row + ports] = self.now.acting[:-1]
        sliders = network.sliders
        network.slider_state.seen[:] = state.y[sliders.upper] - state.y[sliders.lower]
        begin, mode = 0, 0
        for b, body_row in enumerate(network.rows.bodies):
            body, r = body_row.body, body_row.body.rigid_count
            here = slice(begin, begin + len(body_row.ports))
            q = np.asarray(body.port_shapes) @ self.now.force[:-1][here]
            q[r:] /= body.omega[r:] ** 2
            directions = self.along[b]
            q[:r] = state.z[mode : mode + len(directions)] @ directions
            for k in range(network.body_blocks[b], network.body_blocks[b + 1]):
                part = q[ROW * (k - network.body_blocks[b]) :][:ROW]
                place = bodies.start[k] + ROW * ROW_Q
                bodies.laid_out[place : place + part.size] = part
            begin, mode = here.stop, mode + len(directions)

    def _put_fluid(self, state: State) -> None:
        network = self.network
        nodes, now, branches = network.nodes, network.node_state, network.branches
        for i, p in enumerate(state.p):
            now.p[i] = now.before[i] = p
            rho, _, now.g[i], now.hint[i] = fluid_at(nodes.fluid, p, 0)
            if nodes.slow_gas:
                rho = fluid_at(nodes.settled, p, 0)[0]
            if i < nodes.chambers:
                held = now.held[i] = self.volumes(state.y)[i]
                if held <= 0.0:
                    raise _emptied(network, i, float(held))
                now.mass[i] = rho * held
        settle_gas(nodes, now)
        for k in range(branches.rows):
            count = branches.states[k]
            after = branches.output0[k] + branches.head + branches.port0[k + 1] - branches.port0[k]
            if self.column_rows[k] == 0:
                begin = branches.state0[k]
                branches.state[begin : begin + count] = branches.outputs[after : after + count]
        lines, waves = np.zeros(len(network.rows.lines)), np.zeros(len(network.rows.waves))
        for place, m in enumerate(state.m):
            if place < len(self.column_branch):
                branches.state[branches.state0[self.column_branch[place]]] = m
                continue
            place -= len(self.column_branch)
            if place < len(self.column_line):
                lines[self.column_line[place]] = m / nodes.density
            else:
                waves[self.column_wave[place - len(self.column_line)]] = m
        if lines.size:
            pressure = nodes.density * now.g[nodes.end_node[: 2 * lines.size]]
            start_lines(network.lines, network.line_state, pressure, lines)
        for k, flow in enumerate(waves):
            ends = nodes.end_node[2 * lines.size + 2 * k :]
            p_a, p_b = (float(now.p[i]) for i in ends[:2])
            start_wave(network.waves, network.rows.waves, k, p_a, p_b, float(flow))

    def _put_interfaces(self, state: State) -> None:
        network = self.network
        interfaces, now, rows = network.interfaces, network.interface_state, network.rows
        now.force[:] = now.force_before[:] = self.now.contact
        now.gap[:] = interfaces.gap0 + state.y[interfaces.upper] - state.y[interfaces.lower]
        now.rate[:] = 0.0
        now.e[:] = interfaces.series * now.force  # in equilibrium with the contacts
        closed = now.gap + now.e < 0.0
        now.since[closed] = -np.inf
        for c in map(int, np.flatnonzero(interfaces.kind == LAW_RUBBING)):
            deep = max(-float(now.gap[c] + now.e[c]), 0.0)
            begin_sliders(interfaces.law, int(interfaces.law0[c]), deep)
        for c in map(int, np.flatnonzero(interfaces.kind == LAW_YIELDING)):
            deep = max(-float(now.gap[c] + now.e[c]), 0.0)
            settled = begin_faces(interfaces.law, int(interfaces.law0[c]), deep)
            interfaces.gap0[c] += settled
            now.gap[c] += settled
        owner = {handle: row for row in rows.bodies for handle in row.ports}
        for c, touching in enumerate(rows.interfaces):
            pair = (owner.get(touching.upper), owner.get(touching.lower))
            chi = resting_dissipation(touching, pair, -float(now.gap[c] + now.e[c]))
            damped = bool(closed[c]) and interfaces.alpha[c] > 0.0
            # 0 would be for "not touched yet"
            now.chi[c] = chi or (_UNDAMPED if damped else 0.0)

    def _told(self, state: State, notes: tuple[str, ...], *, tells_closed: bool) -> StaticStart:
        network = self.network
        nodes, rows = network.nodes, network.rows
        names = [rows.nodes[handle].component for handle in network.node_order]
        flow = {
            " ".join(filter(None, (row.component, row.label))): float(
                network.branches.outputs[network.branches.output0[k]]
            )
            for k, row in enumerate(rows.branches)
            if self.column_rows[k] == 0
        }
        columns = [rows.branches[k].component for k in self.column_branch]
        columns += [rows.lines[k].component for k in self.column_line]
        columns += [rows.waves[k].component for k in self.column_wave]
        flow |= {name: float(m) for name, m in zip(columns, state.m, strict=True)}
        return StaticStart(
            displacement={
                f"{name.component}.{name.port}": float(y)
                for name, y in zip(network.ports, state.y[:-1], strict=True)
            },
            pressure={names[i]: float(state.p[i]) for i in range(nodes.volumes)},
            stated={names[i]: bool(self.stated[i]) for i in range(nodes.volumes)},
            flow=flow,
            residual=self.left_on_bodies(),
            notes=(*notes, *(self._closed(names, state.p) if tells_closed else ())),
        )

    def _closed(self, names: list[str], p: Vector) -> tuple[str, ...]:
        """Notes on volumes without a stated pressure that nothing fills or empties.

        One that a valve has filled until it closed has a pressure of its own.
        """
        first, ambient = self.ports + 1, self.network.rows.ambient.pressure
        told = []
        for j, i in enumerate(self.free):
            column = self.now.by_pressure[first + i, j] != 0.0 or bool(np.any(self.ends == i))
            filled = abs(float(p[i]) - ambient) > _FILLED * ambient
            if not (column or filled or self.given[i]):
                told.append(
                    f"'{names[i]}' is closed at the start: it starts at ambient "
                    "pressure; give its 'pressure' if that differs."
                )
        return tuple(told)


def _along(body: ReducedBody) -> Matrix:
    """Axial shift among the rigid modes, shape (1, rigid); (0, rigid) if held.

    Bodies in three dimensions have six: forces along the axis balance along the axis.
    """
    size = float(np.linalg.norm(body.rigid_axial))
    return np.atleast_2d(body.rigid_axial / size) if size > 0.0 else np.zeros((0, body.rigid_count))


def _unheld(network: CompiledNetwork, bodies: list[int]) -> InputError:
    names = [f"'{network.rows.bodies[b].component}'" for b in bodies]
    return InputError(
        "static equilibrium",
        got=f"{' and '.join(names)}, unsupported against the forces at time zero",
        expected="a spring, a stop or enclosed fluid in the direction of the force, or friction "
        "above it",
        hint="check the signs of preloads and forces (positive opens; the preload of a "
        "spring closes), add a stop, let the force start later, or give the body a 'speed': then "
        "it starts in flight.",
    )


def _out_of_range(limit: LimitRow, value: float) -> ConvergenceError:
    return ConvergenceError(
        f"static equilibrium: {limit.component}: none found with a {limit.quantity} in the "
        f"range of {limit.law}, {range_text(limit)}; the forces at time zero lead to "
        f"{value_text(value, limit.unit)} and beyond.\n"
        f"Try: {limit.advice} Or check for a magnet that is stronger at the start than the "
        "stop that supports it."
    )


def _no_pressure(network: CompiledNetwork, node: int) -> str:
    name = network.rows.nodes[network.node_order[node]].component
    return (
        f"'{name}' has no steady pressure: the flow into it at time zero has no outlet. It "
        "starts at ambient pressure; give its 'pressure' if that differs."
    )


def _without_outlet(network: CompiledNetwork, nodes: list[int]) -> InputError:
    names = [f"'{network.rows.nodes[network.node_order[i]].component}'" for i in nodes]
    return InputError(
        "operating point",
        got=f"{' and '.join(names)} with a flow that is forced in or out, which no pressure up to "
        f"{format_si(_MOST_STEADY, 'Pa')} balances",
        expected="a way for the fluid to a source or the surroundings that is open at rest and "
        "wide enough",
        hint="open the valve there (another current, or another start), or replace the flow-source "
        "by a pressure-source.",
    )


def _emptied(network: CompiledNetwork, node: int, volume: float) -> InputError:
    name = network.rows.nodes[network.node_order[node]].component
    return InputError(
        f"components.{name}.volume",
        got=f"{format_si(volume, 'm^3', 3)} with its walls at their start positions",
        expected="more than 0 m^3",
        hint="enlarge it: it is the volume with all faces at displacement 0.",
    )
