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
from klack.errors import AccuracyWarning, ConvergenceError, InputError, refuse_if
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
    Balance,
    Couplings,
    at_rest,
    contacts_at_rest,
    fluids_at,
    last_change,
    least_share,
    newton_system,
    slopes_at_rest,
)
from klack.simulation.wave_rows import start_wave
from klack.units import format_si

__all__ = ["RestState", "SteadySlopes", "begin_at_rest", "begin_steady"]


_FIRST, _LONGEST, _SHORTEST = 2e2, 2e13, 2e-5  # steps of pseudo-time over the step of the run
_GROWTH = 8.0  # from one to the next
_MOST_STATES = 64  # of elements that are kept for places which come again
_MOST_NEWTON = 60
_PLAIN_NEWTON = 15  # without a half step among them
_MOST_BEYOND = 20  # steps that are shortened because a magnet would leave its range, or for fluid
_HALVINGS = 12  # of a Newton step that leads where a part knows no answer
_FALL = 0.1  # least share of a pressure that a Newton step leaves
_FOUND = 1e-13  # last Newton step over the largest displacement, and over each pressure
_STUCK = 1e-8  # the same, where round-off lets it fall no more
_LENGTH = 20.0  # [m/s] displacements are told apart to a share of what this covers in a step
_MOVE = 0.02  # [m/s] the same for the way by which a port is moved to see what changes
_FAR = 2e9  # [m/s] ... and for what an unsupported body has gone
_HIGH = 1e11  # [Pa] a volume that came so high lets nothing out
_MOST_STEADY = 1e9  # [Pa] the same of an operating point: no valve is meant for more
_EMPTY = 1e-3  # [Pa] ... so low gets nothing
_UNDAMPED = float(np.finfo(float).tiny)  # [s/m]: known, and nothing
_SHALLOW = 1e-6  # [m] no contact is looked at that is less deep
_DEEP = 10.0  # of the way between the stops: nobody means a stop so soft
_ROUND_OFF = 1e-14  # of the sum of absolute forces, flows and displacements: they balance
_IDLE = 1e-6  # of the largest flow: where less flows, behind closed valves, that is the measure
_FILLED = 1e-6  # of ambient pressure: a closed volume that something has filled
_MOVED = 1e-3  # of a stated pressure: another one
_NEARLY = 1e-9  # the same where they come no closer


@dataclass(slots=True)
class _State:
    z: Vector  # axial coordinates of all free bodies
    y: Vector  # ports, the ground last
    p: Vector  # all nodes
    m: Vector  # columns

    def copy(self) -> "_State":
        return _State(self.z.copy(), self.y.copy(), self.p.copy(), self.m.copy())


@dataclass(frozen=True, slots=True, eq=False)
class RestState:
    """Equilibrium of a network, from which that of a similar one is found at once."""

    _state: _State
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
    notes += problem.instead_of_stated(found._state.p) if near is None else []
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


def _march(problem: "_Balance", near: RestState | None) -> _State:
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
        self.shift = 0.0 if shift is None else shift
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
            elastic = shapes[r:] / body.resting_omega[:, None]
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
        self.kept = [
            (k, row.at_rest) for k, row in enumerate(rows.elements) if row.at_rest is not None
        ]
        self._rows = (
            network.elements,
            network.branches,
            nodes,
            network.node_state.hint,
            self.column_rows,
        )
        self.force, self.inflow = np.zeros(count + 1), np.zeros(nodes.nodes)
        self.elements = self.force
        self.size = np.zeros(count + 1 + nodes.nodes)
        self.by_port = np.zeros((self.size.size, count))
        self.by_pressure = np.zeros((self.size.size, self.free.size))
        self.contact_force = np.zeros(len(rows.interfaces))
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
        self.couplings = self._couplings(units)
        self.code = np.zeros(3, np.int64)
        self.states: dict[tuple[int, bytes], Vector] = {}  # of elements, where they are asked again
        self.ranges = [limit for limit in rows.limits if limit.ports]
        self.beyond: tuple[LimitRow, float] | None = None  # range that was left last, and how far

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
        return Couplings(
            shapes=self.shapes,
            units=units,
            free=self.free,
            shut=self.shut,
            friction=self.friction,
            column=np.array([k for k, _, _ in joined], dtype=np.int64),
            sign=np.array([sign for _, sign, _ in joined], dtype=float),
            volume=np.array([j for _, _, j in joined], dtype=np.int64),
            wall_volume=np.array([j for j, _, _ in walls], dtype=np.int64),
            wall_port=np.array([port for _, port, _ in walls], dtype=np.int64),
            wall_area=np.array([area for _, _, area in walls], dtype=float),
        )

    def can_enclose(self, bodies: list[int]) -> bool:
        """Whether fluid in a volume may hold one of these bodies like a spring."""
        nodes = self.network.nodes
        walls = zip(nodes.wall_node, nodes.wall_port, strict=True)
        return any(i < nodes.volumes and self.body_of_port[port] in bodies for i, port in walls)

    def first(self) -> _State:
        """Undeformed bodies, stated or ambient pressures, no flow in columns."""
        z = self.axial * self.lifts[self.of_body]
        y = np.append(self.shapes.T @ z, 0.0)
        return _State(z, y, self.at_first.copy(), np.zeros(len(self.ends)))

    def nearby(self, begin: _State, near: RestState) -> _State:
        """Equilibrium of a similar network, with what is given in this one."""
        state = near._state.copy()
        state.p += begin.p - near._first  # a volume that nothing fills keeps what it begins with
        known = np.setdiff1d(np.arange(state.p.size), self.free)
        state.p[known] = begin.p[known]
        return state

    def unbalanced(self, state: _State, share: float = _ROUND_OFF) -> NDArray[np.bool_] | None:
        """Rigid modes that are free to creep; None in equilibrium.

        One with round-off alone, which no force answers, is not.
        """
        if not self.evaluate(state):
            raise self.failed()
        ports, y = self.ports + 1, np.abs(state.y[:-1])
        known = self.size + np.abs(self.by_port) @ y
        known += np.abs(self.by_pressure) @ state.p[self.free]
        left = np.abs(self.shapes @ self.force[:-1])
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
        answers = np.any(self.shapes @ self.by_port[: self.ports] != 0.0, axis=1)
        return np.asarray(answers & self.moves)

    def advance(
        self,
        start: _State,
        tau: float,
        open_modes: NDArray[np.bool_],
        mass: Vector | None = None,
    ) -> _State | None:
        """One implicit Euler step of pseudo-time; None if Newton's method fails.

        ``mass`` is what the free volumes hold before, in place of that of ``start``.
        """
        state, before, self.beyond, self.emptied = start.copy(), np.inf, None, []
        creep = np.where(open_modes, 0.5 * tau * tau, 0.0)
        mass = self.masses(start) if mass is None else mass
        for iteration in range(_MOST_NEWTON):
            if not self.evaluate(state):
                return None
            change = self._newton(state, start, creep, mass, tau)
            # a root-like law about no drop lets Newton's method swing across for ever
            swings = iteration >= _PLAIN_NEWTON and iteration % 3 == 0
            share, fall = 0.5 if swings else 1.0, least_share(self.couplings, change, state.p)
            if np.isnan(fall):
                return None
            if fall < _FALL:
                share = (1.0 - _FALL) / (1.0 - fall)
            for _halving in range(_HALVINGS):
                tried = self._moved(state, share * change)
                if self.answers(tried):
                    break
                share *= 0.5
            else:
                return None
            former, state = state, tried
            last = last_change(self.couplings, change, state.y, state.p, _LENGTH * self.step)
            if share == 1.0 and last <= _FOUND:
                return state
            if share == 1.0 and last <= _STUCK and last >= 0.5 * before:
                # a valve about to close: from there the step leads back to where it began
                return state if last <= before else former
            if np.any(state.p[self.free] < _EMPTY):
                self.emptied = self._unstated(state.p < _EMPTY)
                if self.is_steady:  # perhaps a shorter step leaves something in it
                    return None
                raise _RunawayError([], self.emptied)
            before = last
        return None

    def check(self, state: _State) -> None:
        """Raise :class:`_RunawayError` for what has left all real bounds."""
        volumes = self._unstated(state.p > self.high)
        far = np.flatnonzero(np.abs(state.y[:-1]) > _FAR * self.step)
        bodies = sorted({int(self.body_of_port[port]) for port in far})
        if volumes or bodies:
            raise _RunawayError(bodies, volumes)

    def _unstated(self, which: NDArray[np.bool_]) -> list[int]:
        return [int(i) for i in self.free if which[i] and not self.given[i]]

    def answers(self, state: _State) -> bool:
        return (
            self._in_range(state.y)
            and self._keep_states(state.y)
            and bool(
                at_rest(
                    *self._rows,
                    self.h,
                    state.y,
                    state.p,
                    self.force,
                    self.inflow,
                    self.size,
                    self.code,
                )
            )
        )

    def evaluate(self, state: _State) -> bool:
        found = self._keep_states(state.y) and slopes_at_rest(
            *self._rows,
            self.h,
            self.move,
            state.y,
            state.p,
            self.free,
            self.force,
            self.inflow,
            self.size,
            self.by_port,
            self.by_pressure,
            self.code,
        )
        if not found:
            return False
        self._slopes_of_kept_states(state)
        self.elements = self.force.copy()
        for c, (force, slope) in enumerate(self.contacts(state.y)):
            u, low = self.network.interfaces.upper[c], self.network.interfaces.lower[c]
            self.contact_force[c] = force
            for port, sign in ((u, 1.0), (low, -1.0)):
                if port < self.ports:
                    self.force[port] += sign * force
                    self.size[port] += force
                    for other, side in ((u, 1.0), (low, -1.0)):
                        if other < self.ports:
                            self.by_port[port, other] += sign * side * slope
        return True

    def contacts(self, y: Vector) -> list[tuple[float, float]]:
        interfaces = self.network.interfaces
        gap = interfaces.gap0 + y[interfaces.upper] - y[interfaces.lower]
        forces, slopes = contacts_at_rest(
            interfaces.kind, interfaces.law, interfaces.law0, interfaces.series, gap
        )
        return list(zip(forces.tolist(), slopes.tolist(), strict=True))

    def _in_range(self, y: Vector) -> bool:
        """Whether no armature is beyond its pole or far outside its map."""
        for limit in self.ranges:
            moved = sum(factor * y[self.network.port_of[port]] for port, factor in limit.ports)
            value = limit.start + float(moved)
            if not limit.valid[0] - limit.slack <= value <= limit.usable[1]:
                self.beyond = limit, value
                return False
        return True

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
                    self.code[:] = 0, k, 1
                    return False
                if len(self.states) >= _MOST_STATES:
                    self.states.clear()
                self.states[place] = state
            elements.state[elements.state0[k] : elements.state0[k] + len(state)] = state
        return True

    def _slopes_of_kept_states(self, state: _State) -> None:
        """Repeat the slopes by ports whose motion changes such a state."""
        elements = self.network.elements
        if not self.kept:
            return
        force, inflow = self.force.copy(), self.inflow.copy()
        for k, _ in self.kept:
            for port in elements.ports[elements.port0[k] : elements.port0[k + 1]]:
                if port == self.ports:
                    continue
                moved = state.copy()
                moved.y[port] += self.move
                if self.answers(moved):
                    self.by_port[: self.ports + 1, port] = (self.force - force) / self.move
                    self.by_port[self.ports + 1 :, port] = (self.inflow - inflow) / self.move
        self.answers(state)  # what the rows gave out last belongs to the state itself

    def _moved(self, state: _State, change: Vector) -> _State:
        n, r, f = self.ports, self.of_body.size, self.free.size
        after = state.copy()
        after.y[:n] += change[:n]
        after.z += change[n : n + r]
        after.p[self.free] += change[n + r : n + r + f]
        after.m += change[n + r + f :]
        return after

    def _bent(self, state: _State) -> Vector:
        bent = state.y[:-1] - self.shapes.T @ state.z - self.compliance @ self.force[:-1]
        return np.asarray(bent - self.shift)

    def _net(self, state: _State) -> Vector:
        """Mass flow into each free volume [kg/s]; an enclosed one lets none through."""
        inflow = self.inflow.copy()
        np.add.at(inflow, self.ends[:, 0], -state.m)
        np.add.at(inflow, self.ends[:, 1], state.m)
        return np.where(self.shut, 0.0, inflow[self.free])

    def _columns_left(self, state: _State) -> tuple[Vector, Vector]:
        """What accelerates each column [J/kg], and the scale of its round-off.

        That is the sum of both terms of the difference, and of pressure over density: near ambient
        pressure the energy itself is small, its round-off is that of the pressure.
        """
        at_ends = state.p[self.ends]
        fluid = self._fluid(at_ends.ravel()).reshape(-1, 2, 3)
        g, size = fluid[:, :, 2], np.abs(fluid[:, :, 2]) + at_ends / fluid[:, :, 0]
        drop = self.friction * state.m
        first = drop.size - len(self.column_wave)
        for place, k in enumerate(self.column_wave, first):
            at_a, flow = float(at_ends[place, 0]), float(state.m[place])
            drop[place], self.friction[place] = self.network.rows.waves[k].drop(at_a, flow)
        return drop - (g[:, 0] - g[:, 1]), np.abs(drop) + size.sum(axis=1)

    def _fluid(self, p: Vector) -> Matrix:
        """Density, slope and pressure energy at each pressure, shape (n, 3)."""
        nodes = self.network.nodes
        found = np.asarray(fluids_at(nodes.settled, p))
        if nodes.slow_gas:  # flows count with all gas free
            found[:, 2] = np.asarray(fluids_at(nodes.fluid, p))[:, 2]
        return found

    def masses(self, state: _State) -> Vector:
        return self._masses(state)[0]

    def _masses(self, state: _State) -> tuple[Vector, Vector, Vector]:
        """Mass in each free volume [kg], its change with the pressure, and the density."""
        volume = self.volumes(state.y if self.enclosed else np.zeros_like(state.y))[self.free]
        fluid = self._fluid(state.p[self.free]).T
        # contiguous whatever their number: compiled code would be made for a view as well
        density = np.ascontiguousarray(fluid[0])
        return volume * density, volume * fluid[1], density

    def volumes(self, y: Vector) -> Vector:
        nodes = self.network.nodes
        volume = np.zeros(nodes.nodes)
        volume[: nodes.volumes] = nodes.volume
        np.add.at(volume, nodes.wall_node, nodes.wall_area * y[nodes.wall_port])
        return volume

    def _newton(
        self, state: _State, start: _State, creep: Vector, mass: Vector, tau: float
    ) -> Vector:
        n, f = self.ports, self.free.size
        force_y, force_p = self.by_port[:n], self.by_pressure[:n, :f]
        now, by_p, density = self._masses(state)
        balance = Balance(
            by_port=self.by_port,
            by_pressure=self.by_pressure,
            bent_y=self.compliance @ force_y,
            bent_p=self.compliance @ force_p,
            push_y=self.shapes @ force_y,
            push_p=self.shapes @ force_p,
            bent=self._bent(state),
            lag=state.z - start.z - creep * (self.shapes @ self.force[:-1]),
            filled=now - mass,
            by_p=by_p,
            density=density,
            net=self._net(state),
            rest=self._columns_left(state)[0],
        )
        A, right = newton_system(self.couplings, balance, creep, tau)
        try:
            change = np.linalg.solve(A, right)
        except np.linalg.LinAlgError:
            change = np.linalg.lstsq(A, right, rcond=None)[0]
        return np.asarray(change * self.couplings.units)

    def failed(self) -> ConvergenceError:
        """Error of the part without an answer at the start."""
        head, k, status = (int(value) for value in self.code)
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
        left = self.shapes @ self.force[:-1]
        result = {}
        for b, row in enumerate(self.network.rows.bodies):
            mine = left[self.of_body == b]
            if mine.size:
                result[row.component] = float(mine @ (self.along[b] @ row.body.rigid_axial))
        return result

    def not_found(self, state: _State) -> ConvergenceError:
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

    def steady_slopes(self, state: _State) -> SteadySlopes:
        """Equations about the state that the network is in."""
        n, network = self.ports, self.network
        place = {int(i): j for j, i in enumerate(self.free)}
        flow = self.by_pressure[n + 1 :]
        names = [network.rows.nodes[handle].component for handle in network.node_order]
        return SteadySlopes(
            shapes=self.shapes.copy(),
            axial=self.axial.copy(),
            body=tuple(network.rows.bodies[b].component for b in self.of_body),
            moves=self.moves.copy(),
            compliance=self.compliance.copy(),
            force_by_port=self.by_port[:n].copy(),
            force_by_pressure=self.by_pressure[:n].copy(),
            flow_by_port=self.by_port[n + 1 :][self.free].copy(),
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
        self, state: _State, notes: tuple[str, ...], *, tells_closed: bool = True
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

    def _check_stops(self, state: _State) -> None:
        """Reject bodies pressed far deeper into a stop than they can move away."""
        rows, interfaces = self.network.rows, self.network.interfaces
        gap = interfaces.gap0 + state.y[interfaces.upper] - state.y[interfaces.lower]
        for row, depth in zip(rows.interfaces, -gap, strict=True):
            if row.law is None or depth <= _SHALLOW:
                continue
            factors = Travel.factors(rows, ((row.upper, 1.0), (row.lower, -1.0)))
            way = row.gap + Travel.of(rows).highest(factors)[0]
            refuse_if(
                depth > _DEEP * way > 0.0,
                f"static equilibrium: components.{row.component}",
                got=f"bodies pressed {format_si(float(depth), 'm', 3)} into each other",
                expected=f"less than {_DEEP:g} times {format_si(way, 'm', 3)}, the total "
                "clearance between the stops",
                hint="check the stiffness of the stop and the forces at time zero, with their "
                "units.",
            )

    def _put_bodies(self, state: _State) -> None:
        network = self.network
        bodies = network.bodies
        at, ports = bodies.at, self.ports
        for row in (Y0, SEEN):
            at[row : row + ports] = state.y[:-1]
        for row in (LAST, MEAN, BEFORE, BEFORE_2, BEFORE_3):
            at[row : row + ports] = self.elements[:-1]
        sliders = network.sliders
        network.slider_state.seen[:] = state.y[sliders.upper] - state.y[sliders.lower]
        begin, mode = 0, 0
        for b, body_row in enumerate(network.rows.bodies):
            body, r = body_row.body, body_row.body.rigid_count
            here = slice(begin, begin + len(body_row.ports))
            q = np.asarray(body.port_shapes) @ self.force[:-1][here]
            q[r:] /= body.resting_omega**2
            directions = self.along[b]
            q[:r] = state.z[mode : mode + len(directions)] @ directions
            for k in range(network.body_blocks[b], network.body_blocks[b + 1]):
                part = q[ROW * (k - network.body_blocks[b]) :][:ROW]
                place = bodies.start[k] + ROW * ROW_Q
                bodies.laid_out[place : place + part.size] = part
            begin, mode = here.stop, mode + len(directions)

    def _put_fluid(self, state: _State) -> None:
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

    def _put_interfaces(self, state: _State) -> None:
        network = self.network
        interfaces, now, rows = network.interfaces, network.interface_state, network.rows
        now.force[:] = now.force_before[:] = self.contact_force
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
        for c, (touching, pair) in enumerate(zip(rows.interfaces, rows.meeting, strict=True)):
            chi = resting_dissipation(touching, pair, -float(now.gap[c] + now.e[c]))
            damped = bool(closed[c]) and interfaces.alpha[c] > 0.0
            # 0 would be for "not touched yet"
            now.chi[c] = chi or (_UNDAMPED if damped else 0.0)

    def _told(self, state: _State, notes: tuple[str, ...], *, tells_closed: bool) -> StaticStart:
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
            stated={
                names[i]: bool(self.stated[i]) and i not in self._restated(state.p)
                for i in range(nodes.volumes)
            },
            flow=flow,
            residual=self.left_on_bodies(),
            notes=(*notes, *(self._closed(names, state.p) if tells_closed else ())),
        )

    def _restated(self, p: Vector) -> list[int]:
        """Volumes whose stated pressure has become another one, as nothing else holds a body."""
        return [
            int(i)
            for i in self.free
            if self.stated[i] and abs(p[i] / self.at_first[i] - 1.0) > _MOVED
        ]

    def instead_of_stated(self, p: Vector) -> list[str]:
        """Doubts about volumes with a way out that do not start at the pressure of the case."""
        handles, rows = self.network.node_order, self.network.rows
        ways = {end for branch in rows.branches for end in (branch.a, branch.b)}
        ways |= {end for line in rows.lines for end in (line.a, line.b)}
        ways |= {end for wave in rows.waves for end in (wave.a, wave.b)}
        return [
            f"'{rows.nodes[handles[i]].component}' starts at {format_si(float(p[i]), 'Pa', 4)}, "
            f"not at the stated {format_si(float(self.at_first[i]), 'Pa', 4)}: nothing but its "
            "fluid holds a body, so it starts as if it were enclosed and had been compressed or "
            "expanded until the forces balance. Try: the pressure at which they balance; a spring, "
            "a stop or friction that holds the body; or its 'speed': then it starts in flight."
            for i in self._restated(p)
            if handles[i] in ways
        ]

    def _closed(self, names: list[str], p: Vector) -> tuple[str, ...]:
        """Notes on volumes without a stated pressure that nothing fills or empties.

        One that a valve has filled until it closed has a pressure of its own.
        """
        first, ambient = self.ports + 1, self.network.rows.ambient.pressure
        told = []
        for j, i in enumerate(self.free):
            column = self.by_pressure[first + i, j] != 0.0 or bool(np.any(self.ends == i))
            filled = abs(float(p[i]) - ambient) > _FILLED * ambient
            if not (column or filled or self.given[i]):
                told.append(
                    f"'{names[i]}' is closed at the start and starts at ambient pressure; give "
                    "its 'pressure' if it differs."
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
        hint="check the signs of preloads and forces (positive opens; the preload of a spring "
        "closes), add a stop, let the force start later, or give the body a 'speed', with which "
        "it starts in flight.",
    )


def _out_of_range(limit: LimitRow, value: float) -> ConvergenceError:
    return ConvergenceError(
        f"static equilibrium: {limit.component}: none found with a {limit.quantity} in the range "
        f"of {limit.law}, {range_text(limit)}; the forces at time zero lead to "
        f"{value_text(value, limit.unit)} and beyond.\n"
        f"Try: {limit.advice} Or check for a magnet whose force at the start exceeds that of the "
        "supporting stop."
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
        got=f"{' and '.join(names)} with a forced flow in or out that no pressure up to "
        f"{format_si(_MOST_STEADY, 'Pa')} balances",
        expected="a path for the fluid to a source or to ambient that is open at rest and wide "
        "enough",
        hint="open the valve there (another current, or another start), or replace the flow-source "
        "by a pressure-source.",
    )


def _emptied(network: CompiledNetwork, node: int, volume: float) -> InputError:
    name = network.rows.nodes[network.node_order[node]].component
    return InputError(
        f"components.{name}.volume",
        got=f"{format_si(volume, 'm^3', 3)} with its walls at their start positions",
        expected="more than 0 m^3",
        hint="enlarge the volume: it is measured with all faces at displacement 0.",
    )
