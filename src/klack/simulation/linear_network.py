r"""Linear equations of a whole network about the point where it rests.

Bodies keep their modes, volumes their compliance, rows the laws of
:mod:`klack.simulation.linear_rows`, contacts and films their stiffness and damping, and lines their
delays: with the waves :math:`w` that arrive at the ends of segments and :math:`z` that left,

.. math:: \dot x = A x + B u + B_w w, \quad y = C x + D u + D_w w, \quad
          z = C_z x + D_z u + D_{zw} w, \quad w_i(t) = z_i(t - T_i).

Mass balance of a volume: :math:`V \varrho' \dot p + \varrho \sum A_i v_i = \sum \dot m`.  A
junction stores nothing: its pressure, at which its flows add up to zero, is eliminated.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from klack.arrays import Matrix, Vector
from klack.contact.step_constants import LAW_RUBBING, LAW_YIELDING, NO_LAW
from klack.errors import InputError, refuse_if
from klack.network.gas_rows import PASSED
from klack.network.rows import BranchRow, ElementRow, LineRow, Rows
from klack.simulation.linear_rows import LinearRow, RowPoint, linear_row
from klack.simulation.linear_system import LinearSystem, Signal
from klack.simulation.network_arrays import Y0, StepRows
from klack.simulation.network_compile import CompiledNetwork
from klack.simulation.static_rows import contacts_at_rest, fluids_at
from klack.units import format_si, percent_text

__all__ = ["LinearNetwork", "linear_network"]


_DOUBT = 1e-3  # between the laws of two steps
_KINK = 0.2  # between those to both sides; densities of two pressures differ by less
_TOUCHING = 1e-13  # [m] gap of a contact that neither presses nor is apart
_NEARLY = 1e-9  # [m] gap of an open contact, from which on it is far
_WEAK = 1e-3  # [N] force of a closed contact below which it is about to open
_BENT = 1e-2  # change of the compressibility within a thousandth of a pressure


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LinearNetwork:
    """Linear equations of a network.

    Parameters
    ----------
    adds
        Outputs that one component adds at a place, each with the input there and its sign.
    """

    system: LinearSystem
    adds: Mapping[int, tuple[int, float]]
    doubts: tuple[str, ...]


def linear_network(
    network: CompiledNetwork,
    h: float,
    *,
    held: Collection[str] = (),
    drives: Mapping[str, tuple[str, Rows]] | None = None,
) -> LinearNetwork:
    """Linearise a network about the state that it is in.

    Parameters
    ----------
    network
        At rest, with everything that drives it constant.
    h [s]
        Step whose laws are linearised, and half of it.
    held
        Bodies that do not move.
    drives
        By the name of an input: its unit, and the rows with one such unit more of it.

    Raises
    ------
    InputError
        For what has no linear law: components outside of compiled code, a contact that just
        touches.
    """
    return _Assembly(network, h, set(held), drives or {}).found()


class _Assembly:
    """Numbers the variables, then writes one linear form after the other."""

    def __init__(
        self,
        network: CompiledNetwork,
        h: float,
        held: set[str],
        drives: Mapping[str, tuple[str, Rows]],
    ) -> None:
        self.network, self.held, self.drives = network, held, drives
        self.doubts: list[str] = []
        self.rows = network.rows
        self.port_count = len(network.ports)
        self.y = np.append(network.bodies.at[Y0 : Y0 + self.port_count], 0.0)
        nodes = network.nodes
        if network.rows.waves:
            raise InputError(
                f"linearisation: components.{network.rows.waves[0].component}.properties",
                got="a line of local properties",
                expected="properties: fixed, whose waves are linear",
                hint="give the line properties: fixed and the pressure of the operating point.",
            )
        refuse_if(
            nodes.slow_gas,
            "linearisation: fluid with release_time and absorption_time",
            got="gas that is released and absorbed over time",
            expected="a fluid whose density depends only on the pressure",
            hint="leave both times out: for fast changes the gas is free, or, with only "
            "release_pressure and saturation_pressure, in equilibrium.",
        )
        self.p = network.node_state.p.copy()
        self.fluid = fluids_at(nodes.fluid, self.p) if self.p.size else np.zeros((0, 3))
        self.node_names = [self.rows.nodes[k].component for k in network.node_order]
        self.junction = np.array([self.rows.nodes[k].junction for k in network.node_order], bool)
        self.linear = [
            *(self._row(network.elements, k, row, h) for k, row in enumerate(self.rows.elements)),
            *(self._row(network.branches, k, row, h) for k, row in enumerate(self.rows.branches)),
        ]
        self._contacts()
        self._number()

    # ------------------------------------------------------------------ laws of the parts

    def _row(self, at: StepRows, k: int, row: ElementRow | BranchRow, h: float) -> LinearRow:
        branch = isinstance(row, BranchRow)
        ends = [int(at.a[k]), int(at.b[k])] if branch else []
        kind = "branches" if branch else "elements"
        driven = [getattr(other, kind)[k].parameters for _, other in self.drives.values()]
        now = row.parameters  # may be infinite, the same in both
        changes = [np.subtract(x, now, out=np.zeros_like(now), where=x != now) for x in driven]
        here = at.ports[at.port0[k] : at.port0[k + 1]]
        found = linear_row(
            RowPoint(
                row=row,
                state=at.state[at.state0[k] : at.state0[k] + at.states[k]].copy(),
                y=self.y[here],
                p=self.p[ends],
                density=self.fluid[ends, 0],
                compressed=self.fluid[ends, 1],
                inputs=np.array(changes).reshape(len(changes), row.parameters.size),
            ),
            h,
        )
        if found.kink > _KINK:
            self.doubts.append(
                f"'{row.component}' is not smooth at this point: its responses to a small change "
                f"up and down differ by {percent_text(found.kink)} (hysteresis, an edge, or a "
                "valve about to open). The linear law is the mean of the two."
            )
        if found.doubt > _DOUBT:
            self.doubts.append(
                f"the linear law of '{row.component}' changes by {percent_text(found.doubt)} "
                "with the time step used to derive it: part of it is faster than the step."
            )
        return found

    def _contacts(self) -> None:
        at, state = self.network.interfaces, self.network.interface_state
        gap = at.gap0 + self.y[at.upper] - self.y[at.lower]
        force, slope = contacts_at_rest(at.kind, at.law, at.law0, at.series, gap)
        self.contact_force = force
        self.stiffness, self.damping = np.zeros(gap.size), np.zeros(gap.size)
        for c, row in enumerate(self.rows.interfaces):
            name = row.component
            refuse_if(
                at.kind[c] != NO_LAW and abs(gap[c]) <= _TOUCHING,
                f"linearisation: components.{name}",
                got="faces that just touch without force",
                expected="a contact that is closed by a force, or open",
                hint="hold the body at another lift (--lift), or change a load slightly: "
                "stiffness and damping jump at such a point.",
            )
            if force[c] > 0.0:
                pressed = -float(slope[c])
                self.stiffness[c] = pressed / (1.0 - at.series[c] * pressed)
                self.damping[c] = float(state.chi[c]) * float(force[c])
                if at.kind[c] in (LAW_RUBBING, LAW_YIELDING):
                    self.doubts.append(
                        f"the contact '{name}' has a memory (friction between its faces, or "
                        "plastic flow): the stiffness is that of the closing curve."
                    )
                if force[c] < _WEAK:
                    self.doubts.append(
                        f"the contact '{name}' is about to open: it is closed by only "
                        f"{format_si(float(force[c]), 'N', 3)}."
                    )
            else:
                if at.kind[c] != NO_LAW and gap[c] < _NEARLY:
                    self.doubts.append(
                        f"the contact '{name}' is about to close: its gap is "
                        f"{format_si(float(gap[c]), 'm', 3)}."
                    )
                height = max(float(gap[c]), 0.0) + float(at.cut_off[c])
                if height > 0.0:
                    self.damping[c] = at.cubic[c] / height**3 + at.linear[c] / height
        for slider in self.rows.sliders:
            if slider.breakaway > 0.0:
                self.doubts.append(
                    f"'{slider.component}' has dry friction, which holds a body at rest against "
                    f"less than {format_si(slider.breakaway, 'N', 3)}: the linear model "
                    "describes sliding motion, with only the viscous part."
                )
        for i in range(self.network.nodes.volumes):
            if self.junction[i]:
                continue
            around = fluids_at(self.network.nodes.fluid, self.p[i] * np.array([0.999, 1.001]))
            if abs(around[1, 1] - around[0, 1]) > _BENT * abs(self.fluid[i, 1]):
                self.doubts.append(
                    f"the fluid in '{self.node_names[i]}' is about to boil or to dissolve its gas "
                    f"at {format_si(float(self.p[i]), 'Pa', 4)}: its compressibility changes by "
                    f"{100.0 * abs(around[1, 1] / around[0, 1] - 1.0):.2g} % within 0.2 % of the "
                    "pressure."
                )

    # ------------------------------------------------------------------ variables

    def _number(self) -> None:
        self.states: list[Signal] = []
        self.inputs: list[Signal] = []
        self.rigid: list[int] = []  # first state of the rigid mode of each body, or -1
        self.elastic: list[int] = []
        self.scale: list[float] = []
        for row in self.rows.bodies:
            name, body, r = row.component, row.body, row.body.rigid_count
            size = float(np.linalg.norm(body.rigid_axial))
            moves = size > 0.0 and row.course is None and name not in self.held
            self.scale.append(size)
            self.rigid.append(
                self._add(name, ("displacement", "m"), ("velocity", "m/s")) if moves else -1
            )
            first = len(self.states)
            if row.course is None:
                for i in range(r, body.mode_count):
                    self._add(
                        name,
                        (f"mode {i - r + 1}", "m*sqrt(kg)"),
                        (f"mode {i - r + 1} rate", "m*sqrt(kg)/s"),
                    )
            self.elastic.append(first)
        self.row_states = []
        every: list[ElementRow | BranchRow] = [*self.rows.elements, *self.rows.branches]
        for row_, found in zip(every, self.linear, strict=True):
            named = _state_signals(row_)
            self.row_states.append(len(self.states))
            self.states += [
                named.get(j, Signal(row_.component, f"state {j}", "")) for j in found.kept
            ]
        self.pressures = {
            i: self._add(self.node_names[i], ("pressure", "Pa"))
            for i in range(self.network.nodes.volumes)
            if not self.junction[i]
        }
        at = self.network.interfaces
        self.indents = {
            c: self._add(row.component, ("indentation", "m"))
            for c, row in enumerate(self.rows.interfaces)
            if at.series[c] > 0.0 and self.damping[c] > 0.0
        }
        self.memories, self.waves, self.delays = [], [], list[float]()
        for row_l in self.rows.lines:
            terms, lumps = len(row_l.unsteady_gain), row_l.segments + 1
            self.memories.append(
                self._add(
                    row_l.component,
                    *(
                        (f"friction term {k + 1} at {m}/{row_l.segments}", "m^3/s")
                        for m in range(lumps)
                        for k in range(terms)
                    ),
                )
            )
            self.waves.append(len(self.delays))
            self.delays += [row_l.delay / row_l.segments] * (2 * row_l.segments)
        for port in self.network.ports:
            self.inputs.append(Signal(f"{port.component}.{port.port}", "force", "N"))
        for k, row in enumerate(self.rows.bodies):
            if self.rigid[k] >= 0:
                self.inputs.append(Signal(row.component, "force", "N"))
        volumes = self.network.nodes.volumes
        for i in range(volumes):
            self.inputs.append(Signal(self.node_names[i], "mass_flow", "kg/s"))
        for i in range(volumes, self.network.nodes.nodes):
            self.inputs.append(Signal(self.node_names[i], "pressure", "Pa"))
        for row_e in self.rows.elements:
            self.inputs += [Signal(x.owner, x.quantity, x.unit) for x in row_e.inflows]
        for key, (unit, _) in self.drives.items():
            owner, _, quantity = key.rpartition(".")
            self.inputs.append(Signal(owner, quantity, unit))
        nx, nu = len(self.states), len(self.inputs)
        self.first_input, self.first_wave = nx, nx + nu
        self.first_junction = nx + nu + len(self.delays)  # eliminated in the end
        joined = np.flatnonzero(self.junction)
        self.pressures |= {int(i): self.first_junction + k for k, i in enumerate(joined)}
        self.width = self.first_junction + joined.size
        self.input_at = {x.name: self.first_input + j for j, x in enumerate(self.inputs)}

    def _add(self, component: str, *labels: tuple[str, str]) -> int:
        first = len(self.states)
        self.states += [Signal(component, label, unit) for label, unit in labels]
        return first

    def _unit(self, place: int) -> Vector:
        form = np.zeros(self.width)
        form[place] = 1.0
        return form

    # ------------------------------------------------------------------ equations

    def found(self) -> LinearNetwork:
        n = self.port_count
        self.way, self.speed = np.zeros((n + 1, self.width)), np.zeros((n + 1, self.width))
        self._move_ports()
        self.force = np.zeros((n + 1, self.width))
        for port, name in enumerate(self.network.ports):
            self.force[port, self.input_at[f"{name.component}.{name.port}.force"]] = 1.0
        nodes = self.network.nodes
        self.pressure = np.array(
            [
                self._unit(
                    self.pressures[i]
                    if i < nodes.volumes
                    else self.input_at[f"{self.node_names[i]}.pressure"]
                )
                for i in range(nodes.nodes)
            ]
        ).reshape(nodes.nodes, self.width)
        self.inflow = np.zeros((nodes.nodes, self.width))
        self.rates = np.zeros((len(self.states), self.width))
        self.left = np.zeros((len(self.delays), self.width))
        self.outputs: list[tuple[Signal, Vector]] = []
        self.adds: dict[str, tuple[str, float]] = {}
        self._ports_out()
        self._put_rows()
        self._put_contacts()
        self._put_lines()
        for w in range(nodes.walls):
            port = int(nodes.wall_port[w])
            self.force[port] += nodes.wall_area[w] * self.pressure[nodes.wall_node[w]]
        self._put_volumes()
        self._put_bodies()
        nx, nu = len(self.states), len(self.inputs)
        blocks = (slice(0, nx), slice(nx, nx + nu), slice(nx + nu, self.first_junction))
        forms = np.array([form for _, form in self.outputs]).reshape(-1, self.width)
        parts = [self._without_junctions(part) for part in (self.rates, forms, self.left)]
        matrices = [part[:, block] for part in parts for block in blocks]
        A, B, Bw, C, D, Dw, Cz, Dz, Dzw = matrices
        system = LinearSystem(
            A=A, B=B, Bw=Bw, C=C, D=D, Dw=Dw, Cz=Cz, Dz=Dz, Dzw=Dzw,
            delays=np.array(self.delays),
            waves=tuple(row.component for row in self.rows.lines for _ in range(2 * row.segments)),
            states=tuple(self.states),
            inputs=tuple(self.inputs),
            outputs=tuple(signal for signal, _ in self.outputs),
        )  # fmt: skip
        names = [signal.name for signal, _ in self.outputs]
        adds = {
            names.index(name): (self.input_at[place] - self.first_input, sign)
            for name, (place, sign) in self.adds.items()
        }
        return LinearNetwork(system=system, adds=adds, doubts=tuple(dict.fromkeys(self.doubts)))

    def _without_junctions(self, forms: Matrix) -> Matrix:
        """Put into forms the pressures at which the flows into each junction add up to zero."""
        kept, last = slice(0, self.first_junction), slice(self.first_junction, None)
        inflow = self.inflow[self.junction]
        pressure = -np.linalg.solve(inflow[:, last], inflow[:, kept])
        return np.asarray(forms[:, kept] + forms[:, last] @ pressure)

    def _move_ports(self) -> None:
        begin = 0
        for b, row in enumerate(self.rows.bodies):
            shapes, r = np.asarray(row.body.port_shapes), row.body.rigid_count
            here = slice(begin, begin + len(row.ports))
            begin = here.stop
            if row.course is not None:
                continue
            if self.rigid[b] >= 0:
                along = row.body.rigid_axial @ shapes[:r]  # per metre along the axis
                self.way[here, self.rigid[b]] = along
                self.speed[here, self.rigid[b] + 1] = along
            for i in range(r, row.body.mode_count):
                place = self.elastic[b] + 2 * (i - r)
                self.way[here, place] = shapes[i]
                self.speed[here, place + 1] = shapes[i]

    def _ports_out(self) -> None:
        for b, row in enumerate(self.rows.bodies):
            if self.rigid[b] >= 0:
                for k, (label, unit) in enumerate((("displacement", "m"), ("velocity", "m/s"))):
                    self._show(row.component, label, unit, self._unit(self.rigid[b] + k))
        for port, name in enumerate(self.network.ports):
            point = f"{name.component}.{name.port}"
            self._show(point, "displacement", "m", self.way[port])
            self._show(point, "velocity", "m/s", self.speed[port])

    def _show(self, owner: str, label: str, unit: str, form: Vector) -> None:
        signal = Signal(owner, label.replace(" ", "_"), unit)
        if all(signal.name != other.name for other, _ in self.outputs):
            self.outputs.append((signal, form))

    def _adds_flow(self, name: str, ends: Sequence[int], signs: Sequence[float]) -> None:
        """Remember the first free volume that a flow goes into."""
        for i, sign in zip(ends, signs, strict=True):
            if i < self.network.nodes.volumes:
                self.adds.setdefault(name, (f"{self.node_names[i]}.mass_flow", sign))

    def _adds_force(self, name: str, port: int, sign: float) -> None:
        if port < self.port_count:
            at = self.network.ports[port]
            self.adds.setdefault(name, (f"{at.component}.{at.port}.force", sign))

    def _columns(self, k: int, ports: Sequence[int], ends: Sequence[int]) -> Matrix:
        kept = [self._unit(self.row_states[k] + j) for j in range(len(self.linear[k].kept))]
        inputs = [self._unit(self.input_at[key]) for key in self.drives]
        forms = [
            *kept,
            *(self.way[p] for p in ports),
            *(self.speed[p] for p in ports),
            *(self.pressure[i] for i in ends),
            *inputs,
        ]
        return np.array(forms).reshape(len(forms), self.width)

    def _put_rows(self) -> None:
        k = 0
        kinds: list[tuple[StepRows, Sequence[ElementRow | BranchRow]]] = [
            (self.network.elements, self.rows.elements),
            (self.network.branches, self.rows.branches),
        ]
        for at, rows in kinds:
            for j, row in enumerate(rows):
                branch = isinstance(row, BranchRow)
                ends = [int(at.a[j]), int(at.b[j])] if branch else []
                ports = [int(p) for p in at.ports[at.port0[j] : at.port0[j + 1]]]
                law, forms = self.linear[k], self._columns(k, ports, ends)
                first = self.row_states[k]
                self.rates[first : first + len(law.kept)] = law.rate @ forms
                if isinstance(row, ElementRow):
                    self._flow_in(row, first, law, at.state[at.state0[j] :])
                acts = law.acts @ forms
                owner = " ".join(filter(None, (row.component, row.label))).replace(" ", "_")
                if branch:
                    self.inflow[ends[0]] -= acts[0]
                    self.inflow[ends[1]] += acts[0]
                    self._show(owner, "mass_flow", "kg/s", acts[0])
                    self._adds_flow(f"{owner}.mass_flow", ends, (-1.0, 1.0))
                    acts = acts[1:]
                names = getattr(row, "names", ())
                for p, port in enumerate(ports):
                    self.force[port] += acts[p]
                    label = names[p] if p < len(names) and names[p] else f"port {p + 1}"
                    place = label if "." in label else f"{owner}.{label}"  # as the run records it
                    self._show(place.replace(" ", "_"), "force", "N", acts[p])
                    self._adds_force(f"{place}.force".replace(" ", "_"), port, 1.0)
                for channel, form in zip(row.channels, law.channels @ forms, strict=True):
                    if not any(channel.label.endswith(x) for x in ("driver state", PASSED)):
                        self._show(channel.owner or owner, channel.label, channel.unit, form)
                k += 1

    def _flow_in(self, row: ElementRow, first: int, law: LinearRow, state: Vector) -> None:
        for inflow in row.inflows:
            place = self.input_at[f"{inflow.owner}.{inflow.quantity}"]
            for index, rate in inflow.rates(state).items():
                if index in law.kept:
                    self.rates[first + law.kept.index(index), place] += rate

    def _put_contacts(self) -> None:
        at = self.network.interfaces
        for c, row in enumerate(self.rows.interfaces):
            upper, lower = int(at.upper[c]), int(at.lower[c])
            opening, rate = self.way[upper] - self.way[lower], self.speed[upper] - self.speed[lower]
            k, d, series = self.stiffness[c], self.damping[c], float(at.series[c])
            if c in self.indents:  # d z' = F - k z, F = -(gap + z)/series: massless compliance
                z = self._unit(self.indents[c])
                push = -(opening + z) / series
                self.rates[self.indents[c]] = (push - k * z) / d
            elif series > 0.0:
                push = -k / (1.0 + series * k) * opening
            else:
                push = -k * opening - d * rate
            self.force[upper] += push
            self.force[lower] -= push
            self._show(row.component, "gap", "m", opening)
            self._show(row.component, "contact_force", "N", push)
            name = f"{row.component}.contact_force"
            self._adds_force(name, *((upper, 1.0) if upper < self.port_count else (lower, -1.0)))
        sliders = self.network.sliders
        for c, slider in enumerate(self.rows.sliders):
            upper, lower = int(sliders.upper[c]), int(sliders.lower[c])
            push = -slider.viscous * (self.speed[upper] - self.speed[lower])
            self.force[upper] += push
            self.force[lower] -= push

    def _put_lines(self) -> None:
        for line, row in enumerate(self.rows.lines):
            self._put_line(line, row)

    def _put_line(self, line: int, row: LineRow) -> None:
        nodes = self.network.nodes
        density, Z, segments = nodes.density, row.impedance, row.segments
        terms = len(row.unsteady_gain)
        gain = row.unsteady_gain / segments
        lump = row.resistance / segments + float(np.sum(gain))

        def arrives(segment: int, end: int) -> Vector:
            """Wave that leaves a segment at its end a (0) or b (1)."""
            return self._unit(self.first_wave + self.waves[line] + 2 * segment + end)

        def leaves(segment: int, end: int, wave: Vector) -> None:
            """What enters a segment at an end travels to the other one."""
            self.left[self.waves[line] + 2 * segment + 1 - end] = wave

        def memory(place: int) -> Matrix:
            first = self.memories[line] + terms * place
            forms = [self._unit(first + k) for k in range(terms)]
            return np.array(forms).reshape(terms, self.width)

        def rub(place: int, q: Vector) -> None:
            first = self.memories[line] + terms * place
            change = row.unsteady_rate[:, None] * (q - memory(place))
            self.rates[first : first + terms] = change

        for end, place, segment in ((0, 0, 0), (1, segments, segments - 1)):
            i = int(nodes.end_node[2 * line + end])
            head = density / self.fluid[i, 0] * self.pressure[i]  # P = rho_ref g(p)
            wave = arrives(segment, end)
            # half a lump: P = w + Z q + R/2 q + sum G/2 (q - i)
            q = (head - wave + 0.5 * gain @ memory(place)) / (Z + 0.5 * lump)
            rub(place, q)
            leaves(segment, end, wave + 2.0 * Z * q)
            self.inflow[i] -= density * q
            name = f"{row.component}.{'ab'[end]}"
            self._show(name, "mass_flow", "kg/s", (1.0 - 2.0 * end) * density * q)
            self._adds_flow(f"{name}.mass_flow", [i], (2.0 * end - 1.0,))
        for inner in range(segments - 1):
            before, after = arrives(inner, 1), arrives(inner + 1, 0)
            Q = (before - after + gain @ memory(inner + 1)) / (2.0 * Z + lump)
            rub(inner + 1, Q)
            leaves(inner, 1, before - 2.0 * Z * Q)
            leaves(inner + 1, 0, after + 2.0 * Z * Q)

    def _put_volumes(self) -> None:
        nodes, state = self.network.nodes, self.network.node_state
        for i in range(nodes.volumes):
            self.inflow[i, self.input_at[f"{self.node_names[i]}.mass_flow"]] += 1.0
            self._show(self.node_names[i], "pressure", "Pa", self.pressure[i])
        swept = np.zeros((nodes.nodes, self.width))
        for w in range(nodes.walls):
            swept[nodes.wall_node[w]] += nodes.wall_area[w] * self.speed[nodes.wall_port[w]]
        for i in range(nodes.volumes):
            if self.junction[i]:
                continue
            rho, slope = self.fluid[i, 0], self.fluid[i, 1]
            self.rates[self.pressures[i]] = (self.inflow[i] - rho * swept[i]) / (
                float(state.held[i]) * slope
            )

    def _put_bodies(self) -> None:
        begin = 0
        for b, row in enumerate(self.rows.bodies):
            body, r = row.body, row.body.rigid_count
            here = slice(begin, begin + len(row.ports))
            begin = here.stop
            if row.course is not None:
                continue
            shapes, force = np.asarray(body.port_shapes), self.force[here]
            if self.rigid[b] >= 0:
                place = self.rigid[b]
                self.rates[place] = self._unit(place + 1)
                push = (body.rigid_axial @ shapes[:r]) @ force
                push = push + self._unit(self.input_at[f"{row.component}.force"])
                self.rates[place + 1] = push / self.scale[b] ** 2
            for i in range(r, body.mode_count):
                place, omega = self.elastic[b] + 2 * (i - r), float(body.omega[i])
                self.rates[place] = self._unit(place + 1)
                self.rates[place + 1] = (
                    shapes[i] @ force
                    - omega**2 * self._unit(place)
                    - 2.0 * float(body.damping[i]) * omega * self._unit(place + 1)
                )


def _state_signals(row: ElementRow | BranchRow) -> dict[int, Signal]:
    found = {c.index: Signal(c.owner or row.component, c.label, c.unit) for c in row.channels}
    for index, (label, unit) in row.state_names.items():
        owner, dot, quantity = label.partition(".")
        found[index] = Signal(owner, quantity, unit) if dot else Signal(row.component, label, unit)
    return found
