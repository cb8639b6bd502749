"""From the rows of a network to the flat arrays of the time loop."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import ceil
from typing import NamedTuple, Self

import numpy as np

from klack.arrays import Cube, Index, Vector
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.contact.step_constants import LAW_YIELDING, NO_LAW
from klack.errors import refuse_if
from klack.hydraulics.fluid import Fluid
from klack.hydraulics.fluid_table import fluid_at, fluid_table
from klack.hydraulics.gas_release import NO_RELEASE, release_numbers
from klack.hydraulics.mass_balance import find_links
from klack.network.rows import GROUND, BodyRow, BranchRow, ElementRow, Rows
from klack.network.step_function import address_of
from klack.simulation.delay_line import Lines, LineState, compile_lines, start_lines
from klack.simulation.lasting_laws import settle
from klack.simulation.modal_step import (
    FIXED_ROWS,
    ROW,
    ROW_A11,
    ROW_B1,
    ROW_K,
    ROW_P1,
    ROW_Q,
    ROW_R1,
    ROW_V,
)
from klack.simulation.moving_bodies import MovingBodies
from klack.simulation.network_arrays import (
    AT_ONCE,
    FINE,
    LOSS,
    PORTS,
    ROWS_AT,
    STORE,
    SUPPLY,
    Accounts,
    Bodies,
    Interfaces,
    InterfaceState,
    NetworkArrays,
    Nodes,
    NodeState,
    Sliders,
    SliderState,
    StepRows,
)
from klack.simulation.network_gas import require_chambers, settle_gas
from klack.simulation.propagator import Propagator, modal_propagator
from klack.simulation.rest import rest_time
from klack.simulation.step_sizes import StepSizes, kinks
from klack.simulation.wave_rows import WAVE_THROUGHPUT, Waves, compile_waves, start_wave

__all__ = [
    "CompiledNetwork",
    "PortName",
    "body_energy",
    "compile_network",
    "interface_compliance",
    "modal_state",
]


_FLIGHT_SPEED = 0.5  # [m/s] over the stroke: a film force is judged by what it moves in this time
_FILM_SMALL = 1.64e-2  # [m/s] mean speed of a gap under a small force: 0.5 N on a needle of 3 g
_FILM_FELT = 6.55e-4  # [m/s] the same for one that is worth a record: 0.02 N

_KINDS = {"store": STORE, "supply": SUPPLY, "loss": LOSS}


@dataclass(frozen=True, slots=True)
class PortName:
    """A mechanical port of the loop, in words."""

    component: str
    port: str


@dataclass(frozen=True, kw_only=True, eq=False)
class CompiledNetwork:
    """All arrays of the time loop, with their names.

    Parameters
    ----------
    bodies, elements, branches, nodes, lines, waves, interfaces, sliders
        What stays, with the states of bodies, elements, branches and waves.
    node_state, line_state, interface_state, slider_state
        What changes from step to step.
    account_kind
        ``STORE``, ``SUPPLY`` or ``LOSS`` of each of ``accounts.rows``.
    kinks [s]
        Of :func:`klack.simulation.step_sizes.kinks`.
    node_order
        Handle of every node.
    body_blocks (bodies + 1,)
        First block of each body.
    moving
        Bodies that meet point by point, instead of at interfaces.
    """

    rows: Rows
    bodies: Bodies
    elements: StepRows
    branches: StepRows
    nodes: Nodes
    node_state: NodeState
    lines: Lines
    line_state: LineState
    waves: Waves
    interfaces: Interfaces
    interface_state: InterfaceState
    sliders: Sliders
    slider_state: SliderState
    accounts: Accounts
    account_kind: Index
    kinks: Vector
    account_names: tuple[str, ...]
    ports: tuple[PortName, ...]
    port_of: Mapping[int, int]
    node_order: tuple[int, ...]
    body_blocks: Index
    moving: MovingBodies | None = None

    @property
    def arrays(self) -> NetworkArrays:
        """What the time loop works on."""
        return NetworkArrays(*(getattr(self, name) for name in NetworkArrays._fields))


def compile_network(rows: Rows, sizes: StepSizes) -> CompiledNetwork:
    """Lay out a network for these steps."""
    refuse_if(
        not rows.bodies,
        "network",
        got="no body",
        expected="at least one body that moves",
        hint="add a rigid-mass or a flexible-body component.",
    )
    port_of, names = _number_ports(rows.bodies)
    refuse_if(
        len(names) >= PORTS,
        "network",
        got=f"{len(names)} mechanical ports",
        expected=f"fewer than {PORTS}",
        hint="leave out unconnected ports of bodies.",
    )
    propagators = _propagators(rows.bodies, sizes.seconds)
    answers = _Answers.of(rows.bodies, propagators)
    bodies, blocks = _compile_bodies(rows.bodies, propagators, answers)
    accounts = _Accounts()
    elements = _step_rows(rows.elements, 0, accounts, port_of, {})
    node_order = _order_nodes(rows)
    node_of = {handle: i for i, handle in enumerate(node_order)}
    branches = _step_rows(rows.branches, 3, accounts, port_of, node_of)
    lines, line_state = compile_lines(
        rows.lines,
        step=sizes.step,
        coarse=sizes.coarse,
        near=sizes.near,
        ambient_pressure=rows.ambient.pressure,
    )
    ends = [*lines.node, *(node for row in rows.waves for node in (row.a, row.b))]
    nodes, node_state = _nodes(rows, node_order, port_of, bodies, ends)
    of_lines = nodes.end_node[: len(lines.node)]
    if of_lines.size:
        start_lines(lines, line_state, nodes.density * node_state.g[of_lines])
    waves = compile_waves(rows.waves, len(lines.node), nodes.density, sizes.coarse * sizes.step)
    for k, row in enumerate(rows.waves):
        start_wave(waves, rows.waves, k, *(node_state.p[node_of[node]] for node in (row.a, row.b)))
    interfaces, interface_state = _interfaces(rows, port_of, bodies)
    sliders, slider_state = _sliders(rows, port_of, bodies, blocks, answers)
    return CompiledNetwork(
        rows=rows,
        bodies=bodies,
        elements=elements,
        branches=branches,
        nodes=nodes,
        node_state=node_state,
        lines=lines,
        line_state=line_state,
        waves=waves,
        interfaces=interfaces,
        interface_state=interface_state,
        sliders=sliders,
        slider_state=slider_state,
        accounts=Accounts(
            rows=np.zeros(len(accounts.kinds)),
            lines=np.zeros((max(len(rows.lines), 1), 3)),
            waves=np.zeros((len(rows.waves), WAVE_THROUGHPUT + 1)),
            implicit=np.zeros(nodes.volumes),
            supply=np.zeros(nodes.nodes - nodes.volumes),
            gas=np.zeros(nodes.volumes * nodes.slow_gas),
            contact=np.zeros(interfaces.interfaces),
            film=np.zeros(interfaces.interfaces),
            friction=np.zeros(sliders.sliders),
        ),
        account_kind=np.array(accounts.kinds, dtype=np.int64),
        kinks=kinks(rows, sizes.coarse * sizes.step),
        account_names=tuple(accounts.names),
        ports=names,
        port_of=port_of,
        node_order=node_order,
        body_blocks=blocks,
    )


class _Accounts:
    def __init__(self) -> None:
        self.kinds: list[int] = []
        self.names: list[str] = []

    def add(self, name: str, kind: int) -> int:
        self.names.append(name)
        self.kinds.append(kind)
        return len(self.kinds) - 1


def _number_ports(rows: Sequence[BodyRow]) -> tuple[dict[int, int], tuple[PortName, ...]]:
    """Number the ports body by body; the ground comes last."""
    handles = [handle for row in rows for handle in row.ports]
    port_of = {handle: i for i, handle in enumerate(handles)}
    port_of[GROUND] = len(handles)
    names = tuple(PortName(row.component, name) for row in rows for name in row.names)
    return port_of, names


class _Answers(NamedTuple):
    """Response of each port to a force at another, for each step size, (SIZES, PORTS, PORTS)."""

    moved: Cube  # displacement at the end per unit force
    moved_by_rise: Cube  # ... per force that rises evenly by one and has no mean
    speed: Cube  # speed at the end per unit force
    mean_by_rise: Cube  # mean displacement per force that rises evenly by one and has no mean

    @classmethod
    def of(cls, rows: Sequence[BodyRow], propagators: Sequence[Sequence[Propagator]]) -> Self:
        """Responses of all bodies; one that follows a course is not moved."""
        found = np.zeros((4, len(propagators[0]), PORTS, PORTS))
        first = 0
        for row, of_body in zip(rows, propagators, strict=True):
            here = slice(first, first + len(row.ports))
            shapes = np.asarray(row.body.port_shapes).T
            for level, P in enumerate(of_body):
                if row.course is None:
                    found[0, level, here, here] = (shapes * P.B1) @ shapes.T
                    found[1, level, here, here] = (shapes * P.R1) @ shapes.T
                    found[2, level, here, here] = (shapes * P.B2) @ shapes.T
                    found[3, level, here, here] = (shapes * P.Rm) @ shapes.T
            first = here.stop
        return cls(*found)


def _propagators(rows: Sequence[BodyRow], steps: Sequence[float]) -> list[list[Propagator]]:
    return [[modal_propagator(row.body.omega, row.body.damping, h) for h in steps] for row in rows]


def _compile_bodies(
    rows: Sequence[BodyRow], propagators: Sequence[Sequence[Propagator]], answers: _Answers
) -> tuple[Bodies, Index]:
    """Lay out the modes in blocks for each step size; also the first block of each body."""
    laid_out: tuple[list[Vector], ...] = tuple([] for _ in propagators[0])
    start, count, port0, port1 = [0], list[int](), list[int](), list[int]()
    blocks = [0]
    driven, course0, course = list[int](), list[int](), list[Vector]()
    first_port = 0
    ports = sum(len(row.ports) for row in rows)
    first, last = np.zeros(ports + 1, np.int64), np.zeros(ports + 1, np.int64)
    first[ports] = last[ports] = ports
    for row, of_body in zip(rows, propagators, strict=True):
        body, own = row.body, len(row.ports)
        height = FIXED_ROWS + own + 1
        modes = body.mode_count
        cm = np.zeros(modes)
        if body.rigid_count:
            cm[: body.rigid_count] = body.rigid_axial / body.mass
        if body.momentum is not None:
            cm = body.momentum / body.mass
        v0 = np.zeros(modes)
        v0[: body.rigid_count] = row.speed * body.rigid_axial
        here = slice(first_port, first_port + own)
        first[here], last[here] = first_port, first_port + own
        for begin in range(0, max(modes, 1), ROW):
            part = slice(begin, min(begin + ROW, modes))
            used = part.stop - part.start
            for P, target in zip(of_body, laid_out, strict=True):
                W = np.zeros((height, ROW))
                W[ROW_V, :used] = v0[part]
                if row.course is None:
                    W[ROW_A11 : ROW_A11 + 4, :used] = [
                        values[part] for values in (P.A11, P.A12, P.A21, P.A22)
                    ]
                    pending = P.A11 * P.B1 + P.A12 * P.B2, P.A21 * P.B1 + P.A22 * P.B2
                    W[ROW_P1 : ROW_P1 + 2, :used] = [values[part] for values in pending]
                    W[ROW_B1 : ROW_B1 + 2, :used] = P.B1[part], P.B2[part]
                    W[ROW_K, :used] = body.omega[part] ** 2
                    W[ROW_R1 : ROW_R1 + 2, :used] = P.R1[part], P.R2[part]
                else:  # no force moves it, a speed does
                    W[ROW_A11, 0], W[ROW_A11 + 1, 0], W[ROW_A11 + 3, 0] = 1.0, P.step, 1.0
                W[FIXED_ROWS:-1, :used] = np.asarray(body.port_shapes)[part].T
                W[-1, :used] = cm[part]
                target.append(W.ravel())
            start.append(start[-1] + height * ROW)
            count.append(4 * ceil(used / 4))
            port0.append(first_port)
            port1.append(first_port + own)
        if row.course is not None:
            driven.append(len(count) - 1)
            course0.append(sum(map(len, course)))
            course.append(row.course.numbers())
        blocks.append(len(count))
        first_port += own
    bodies = Bodies(
        ports=ports,
        blocks=len(count),
        size=start[-1],
        laid_out=np.concatenate([part for parts in laid_out for part in parts]),
        start=np.array(start, dtype=np.int64),
        modes=np.array(count, dtype=np.int64),
        port0=np.array(port0, dtype=np.int64),
        port1=np.array(port1, dtype=np.int64),
        first=first,
        last=last,
        driven=len(driven),
        driven_block=np.array(driven, dtype=np.int64),
        course0=np.array(course0, dtype=np.int64),
        course=np.concatenate([*course, np.zeros(1)]),
        G=answers.moved.ravel(),
        Gr=answers.moved_by_rise.ravel(),
        Gm=answers.mean_by_rise.ravel(),
        at=np.zeros(ROWS_AT * PORTS),
    )
    return bodies, np.array(blocks, dtype=np.int64)


def _step_rows(
    rows: Sequence[ElementRow | BranchRow],
    head: int,
    accounts: _Accounts,
    port_of: Mapping[int, int],
    node_of: Mapping[int, int],
) -> StepRows:
    count = len(rows)
    numbers = {
        key: np.zeros(count, np.int64)
        for key in ("function", "states", "accounts", "a", "b", "supply", "loss")
    }
    offsets = {
        key: np.zeros(count + 1, np.int64)
        for key in ("parameter0", "state0", "input0", "output0", "port0", "account0")
    }
    numbers["supply"][:] = numbers["loss"][:] = -1
    parameters, state, ports = [np.zeros(0)], [np.zeros(0)], list[int]()
    for k, row in enumerate(rows):
        if isinstance(row, BranchRow):
            numbers["a"][k], numbers["b"][k] = node_of[row.a], node_of[row.b]
        numbers["function"][k] = address_of(row.step)
        numbers["states"][k] = len(row.state)
        numbers["accounts"][k] = len(row.books)
        parameters.append(row.parameters)
        state.append(row.state)
        ports += [port_of[port] for port in row.ports]
        sizes = {
            "parameter0": len(row.parameters),
            "state0": len(row.state),
            "input0": (6 if head else 2) + 2 * len(row.ports),
            "output0": head + len(row.ports) + len(row.state) + len(row.books),
            "port0": len(row.ports),
            "account0": len(row.books),
        }
        for key, size in sizes.items():
            offsets[key][k + 1] = offsets[key][k] + size
        offsets["account0"][k] = len(accounts.kinds)
        label = " ".join(filter(None, (row.component, row.label)))
        for book in row.books:
            place = accounts.add(f"{book.owner or label} {book.label}", _KINDS[book.kind])
            if head and book.kind == "supply":
                numbers["supply"][k] = place
        offsets["account0"][k + 1] = len(accounts.kinds)
        if head and numbers["supply"][k] < 0:
            numbers["loss"][k] = accounts.add(f"{label} flow", LOSS)
    return StepRows(
        rows=count,
        head=head,
        function=numbers["function"],
        parameters=np.append(np.concatenate(parameters), 0.0),
        parameter0=offsets["parameter0"],
        state=np.append(np.concatenate(state), 0.0),
        state0=offsets["state0"],
        states=numbers["states"],
        inputs=np.zeros(offsets["input0"][-1] + 1),
        input0=offsets["input0"],
        outputs=np.zeros(offsets["output0"][-1] + 1),
        output0=offsets["output0"],
        ports=np.array(ports, dtype=np.int64),
        port0=offsets["port0"],
        account0=offsets["account0"],
        accounts=numbers["accounts"],
        a=numbers["a"],
        b=numbers["b"],
        supply=numbers["supply"],
        loss=numbers["loss"],
    )


def _order_nodes(rows: Rows) -> tuple[int, ...]:
    chambers = [handle for handle, node in rows.nodes.items() if node.volume > 0.0]
    junctions = [handle for handle, node in rows.nodes.items() if node.junction]
    prescribed = [handle for handle, node in rows.nodes.items() if node.prescribed]
    return (*chambers, *junctions, *prescribed)


def _nodes(
    rows: Rows,
    order: Sequence[int],
    port_of: Mapping[int, int],
    bodies: Bodies,
    ends: Sequence[int],
) -> tuple[Nodes, NodeState]:
    node_of = {handle: i for i, handle in enumerate(order)}
    given = [rows.nodes[handle] for handle in order]
    volumes = sum(not node.prescribed for node in given)
    ambient = rows.ambient.pressure
    fluid = np.zeros(8)
    settled, gas, slow = fluid, NO_RELEASE, False
    count = len(order)
    p = np.array([node.at_start for node in given], dtype=float)
    density, boiling, rho, g = 1.0, 0.0, np.ones(count), np.zeros(count)
    hint = np.zeros(count, np.int64)
    if rows.fluid is not None and count:
        fluid = settled = fluid_table(rows.fluid, ambient)
        if isinstance(rows.fluid, Fluid) and rows.fluid.has_release_times:
            require_chambers(rows)
            slow, gas = True, release_numbers(rows.fluid, ambient)
            fluid = fluid_table(rows.fluid.all_free(), ambient)
        density = fluid_at(fluid, ambient, 0)[0]
        boiling = rows.fluid.all_liquid_from
        for i in range(count):
            rho[i], _, g[i], hint[i] = fluid_at(fluid, p[i], 0)
            if slow:
                rho[i] = fluid_at(settled, p[i], 0)[0]
    tables = [given[i] for i in range(volumes, count)]
    sizes = [len(node.time) for node in tables]
    volume = np.array([node.volume for node in given[:volumes]], dtype=float)
    gamma = np.zeros((2, max(volumes, 1)))
    pairs = tuple((node_of[row.a], node_of[row.b]) for row in rows.branches)
    walls = [(node_of[w.node], port_of[w.port], w.area) for w in rows.walls]
    G = bodies.G.reshape(-1, PORTS, PORTS)
    for i, a, area_a in walls:
        for j, b, area_b in walls:
            if i == j and i < volumes:
                gamma[0, i] += area_a * G[FINE, a, b] * area_b
    nodes = Nodes(
        nodes=count,
        chambers=sum(node.volume > 0.0 for node in given),
        walls=len(walls),
        ends=len(ends),
        fluid=fluid,
        ambient=ambient,
        density=density,
        boiling=boiling,
        volume=volume,
        gamma=gamma.ravel(),
        time=np.concatenate([np.zeros(0), *(node.time for node in tables)]),
        pressure=np.concatenate([np.zeros(0), *(node.pressure for node in tables)]),
        table0=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        wall_node=np.array([w[0] for w in walls], dtype=np.int64),
        wall_port=np.array([w[1] for w in walls], dtype=np.int64),
        wall_area=np.array([w[2] for w in walls], dtype=float),
        end_node=np.array([node_of[int(node)] for node in ends], dtype=np.int64),
        slow_gas=int(slow),
        settled=settled,
        gas=gas,
        **find_links(volumes, pairs)._asdict(),
    )
    mass = volume * rho[:volumes]
    state = NodeState(
        mass=mass,
        held=volume.copy(),
        p=p,
        before=p.copy(),
        g=g,
        rate=np.full(count, AT_ONCE),
        slope=np.zeros(count),
        hint=hint,
        free=np.ones(volumes),
        dissolved=np.zeros(volumes),
    )
    settle_gas(nodes, state)
    return nodes, state


def _interfaces(
    rows: Rows, port_of: Mapping[int, int], bodies: Bodies
) -> tuple[Interfaces, InterfaceState]:
    count = len(rows.interfaces)
    kind = np.full(count, NO_LAW, np.int64)
    law0, alpha = np.zeros(count, np.int64), np.zeros(count)
    law = [np.zeros(0)]
    film = np.zeros((4, count))
    for c, row in enumerate(rows.interfaces):
        law0[c] = sum(len(part) for part in law)
        if row.law is not None:
            flat = row.law.flat()
            kind[c], alpha[c] = flat.kind, flat.dissipation
            law.append(flat.parameters)
        if row.film is not None:
            film[:, c] = row.film.cubic, row.film.linear, row.film.cut_off, row.film.suction
    gap = np.array([row.gap for row in rows.interfaces], dtype=float)
    upper = np.array([port_of[row.upper] for row in rows.interfaces], dtype=np.int64)
    lower = np.array([port_of[row.lower] for row in rows.interfaces], dtype=np.int64)
    stroke = float(np.max(np.maximum(gap, film[2]), initial=0.0))
    film_time = stroke / _FLIGHT_SPEED or 1.0  # nothing to fly, no film to judge
    moved = _Answers.of(rows.bodies, _propagators(rows.bodies, (film_time,))).moved
    force = film_time / interface_compliance(moved, upper, lower)  # that gives 1 m/s
    rest = [rest_time(*pair) for pair in zip(rows.interfaces, rows.meeting, strict=True)]
    interfaces = Interfaces(
        interfaces=count,
        upper=upper,
        lower=lower,
        G=interface_compliance(bodies.G, upper, lower),
        dry=np.array([row.film is None for row in rows.interfaces], dtype=np.int64),
        gap0=gap,
        kind=kind,
        law=np.append(np.concatenate(law), 0.0),
        law0=law0,
        alpha=alpha,
        series=np.array([row.series_compliance for row in rows.interfaces], dtype=float),
        cubic=film[0].copy(),
        linear=film[1].copy(),
        cut_off=film[2].copy(),
        suction=film[3].copy(),
        film_small=_FILM_SMALL * force,
        film_felt=_FILM_FELT * force,
        rest=np.array(rest, dtype=float),
    )
    for c in map(int, np.flatnonzero(kind == LAW_YIELDING)):  # run in before
        gap[c] += settle(interfaces.law, int(law0[c]))
    state = InterfaceState(
        hint=np.zeros(count, np.int64),
        e=np.zeros(count),
        gap=gap.copy(),
        rate=np.zeros(count),
        force=np.zeros(count),
        chi=np.zeros(count),
        deepest=np.zeros(count),
        since=np.full(count, np.inf),
        film_before=np.zeros(count),
        pulled=np.zeros(count),
        force_before=np.zeros(count),
        calm=np.full(count, -np.inf),
        far=np.zeros(count),
        bend=np.full(count, np.inf),
        jerk=np.full(count, np.inf),
        rough=np.full(count, -np.inf),
    )
    return interfaces, state


def _sliders(
    rows: Rows,
    port_of: Mapping[int, int],
    bodies: Bodies,
    body_blocks: Index,
    answers: _Answers,
) -> tuple[Sliders, SliderState]:
    count = len(rows.sliders)
    upper = np.array([port_of[row.upper] for row in rows.sliders], dtype=np.int64)
    lower = np.array([port_of[row.lower] for row in rows.sliders], dtype=np.int64)
    owner = [b for b, row in enumerate(rows.bodies) for _ in row.ports]
    place = [i for row in rows.bodies for i in range(len(row.ports))]
    places = [port for ends in zip(upper, lower, strict=True) for port in ends]
    joined = [(p, owner[p], place[p]) if p < bodies.ports else (p, 0, 0) for p in places]
    kick = answers.speed[:, :, upper] - answers.speed[:, :, lower]  # (SIZES, PORTS, n)
    every = np.arange(count)
    sliders = Sliders(
        sliders=count,
        upper=upper,
        lower=lower,
        coulomb=np.array([row.coulomb for row in rows.sliders], dtype=float),
        excess=np.array([row.breakaway - row.coulomb for row in rows.sliders], dtype=float),
        stribeck=np.array([row.stribeck_speed for row in rows.sliders], dtype=float),
        viscous=np.array([row.viscous for row in rows.sliders], dtype=float),
        G=interface_compliance(answers.moved, upper, lower),
        D=(kick[:, upper, every] - kick[:, lower, every]).ravel(),
        kick=np.ascontiguousarray(kick.transpose(0, 2, 1)).ravel(),
        block0=np.array([body_blocks[b] for _, b, _ in joined], dtype=np.int64),
        block1=np.array(
            [body_blocks[b + (p < bodies.ports)] for p, b, _ in joined], dtype=np.int64
        ),
        row=np.array([FIXED_ROWS + i for _, _, i in joined], dtype=np.int64),
    )
    return sliders, SliderState(seen=np.zeros(count), force=np.zeros(count))


def interface_compliance(G: Vector, upper: Index, lower: Index) -> Vector:
    """Speed of each port at the end of a step per force at another, (SIZES, PORTS, PORTS)."""
    of = G.reshape(-1, PORTS, PORTS)
    own = of[:, upper, upper] + of[:, lower, lower]
    return np.asarray(own - of[:, upper, lower] - of[:, lower, upper]).ravel()


def modal_state(network: CompiledNetwork, body: int) -> tuple[Vector, Vector]:
    """Modal displacements and velocities of a body now."""
    modes = network.rows.bodies[body].body.mode_count
    q, v = [], []
    bodies = network.bodies
    for k in range(network.body_blocks[body], network.body_blocks[body + 1]):
        W = bodies.laid_out[bodies.start[k] : bodies.start[k + 1]].reshape(-1, ROW)
        q.append(W[ROW_Q])
        v.append(W[ROW_V])
    return np.concatenate(q)[:modes], np.concatenate(v)[:modes]


def body_energy(body: ReducedBody, q: Vector, v: Vector) -> tuple[float, float]:
    """Kinetic and strain energy [J]."""
    return 0.5 * float(v @ v), 0.5 * float(np.sum((body.omega * q) ** 2))
