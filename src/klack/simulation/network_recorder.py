"""Memory for what a run records, and the words for its columns.

The loop fills memory for one chunk: steps in which an interface carried force, and records as
closely spaced as the impacts need.  Then the impacts are found, the records are thinned to the
requested spacing, and the steps are kept while there is room.  So the number of records alone
determines the memory of a run.

Records hold means over the time before them; the one before the first step holds their limit, the
values of the start itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import ceil

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Matrix, Vector
from klack.contact.step_constants import NO_LAW
from klack.hydraulics.fluid import Fluid
from klack.machine.memory import require_memory
from klack.network.rows import BranchRow, Channel, ElementRow, Rows
from klack.simulation.contact_step import mean_force
from klack.simulation.flow_channels import flow_label
from klack.simulation.impact_events import ImpactFinder
from klack.simulation.interface_step import film_force
from klack.simulation.modal_step import FIXED_ROWS
from klack.simulation.network_arrays import Recording, StepRows
from klack.simulation.network_compile import CompiledNetwork
from klack.simulation.network_record import extremes, lay_across, moment_of, record_moment
from klack.simulation.network_result import ChannelData, InterfaceRecord

__all__ = ["Recorder", "gap_rates", "recorded_columns", "values_now"]


_MOST_FINE = 1_000_000  # recorded steps per interface that are kept
_FINE = 6  # numbers of a recorded step
_KEPT = 5  # of which these are kept; the speed at its start is for the impacts


@dataclass(frozen=True, slots=True)
class _Column:
    name: str
    unit: str


class Recorder:
    """What a run records, chunk by chunk.

    Parameters
    ----------
    records
        Of the whole run, beside that of its start.
    looks
        Per record; the records of a chunk are one look apart.
    chunk, fine
        Most looks and most steps of a chunk.
    """

    def __init__(
        self, network: CompiledNetwork, *, records: int, looks: int, chunk: int, fine: int
    ) -> None:
        self.network, self.looks = network, looks
        rows, elements = network.rows, network.elements
        states = [
            (elements.state0[k] + channel.index, _channel(row, channel), channel.unit)
            for k, row in enumerate(rows.elements)
            for channel in row.channels
        ]
        branch_states = [
            (network.branches.state0[k] + channel.index, _channel(row, channel), channel.unit)
            for k, row in enumerate(rows.branches)
            for channel in row.channels
        ]
        free = [b for b, row in enumerate(rows.bodies) if row.body.moves]
        driven = [row.component for row in rows.bodies if row.course is not None]
        blocks = network.body_blocks
        owner = [b for b, row in enumerate(rows.bodies) for _ in row.ports]
        place = [i for row in rows.bodies for i in range(len(row.ports))]
        self.means = [
            *(
                _Column(_column(row, "force", port), "N")
                for row in rows.elements
                for port in row.names
            ),
            *(_Column(_column(row, flow_label(row)), "kg/s") for row in rows.branches),
            *(
                _Column(f"{row.component} {kind} force", "N")
                for row in rows.interfaces
                for kind in ("contact", "film")
            ),
            *(
                _Column(f"{row.component}.{port} force", "N")
                for row in rows.sliders
                for port in row.names
            ),
        ]
        ports = [f"{name.component}.{name.port}" for name in network.ports]
        fluid_ports = sorted({network.port_of[handle] for handle in rows.in_fluid} - {len(ports)})
        nodes = [rows.nodes[handle].component for handle in network.node_order]
        slow = network.nodes.volumes * network.nodes.slow_gas
        self.points = [
            *(_Column(f"{port} displacement", "m") for port in ports),
            *(_Column(f"{port} velocity", "m/s") for port in ports),
            *(_Column(f"{rows.bodies[b].component} velocity", "m/s") for b in free),
            *(_Column(f"{rows.bodies[b].component} repaid impulse", "N s") for b in free),
            *(_Column(f"{ports[p]} fluid impulse", "N s") for p in fluid_ports),
            *(_Column(f"{node} pressure", "Pa") for node in nodes),
            *(_Column(f"{node} free gas", "-") for node in nodes[:slow]),
            *(_Column(name, unit) for _, name, unit in states + branch_states),
            *(_Column(f"{row.component} gap", "m") for row in rows.interfaces),
            *(_Column(f"{name} drive force", "N") for name in driven),
        ]
        self._driven = len(driven)
        self.peaks = [_Column(f"{row.component} peak force", "N") for row in rows.interfaces]
        parting, self.sides = _sides(rows, blocks)
        count = len(rows.interfaces)
        columns = len(self.means) + len(self.points) + count
        _require_memory(records, columns)
        self.recording = Recording(
            means=np.zeros((chunk, len(self.means))),
            peaks=np.zeros((chunk, count)),
            points=np.zeros((chunk, len(self.points))),
            states=np.array([index for index, _, _ in states], dtype=np.int64),
            branch_states=np.array([index for index, _, _ in branch_states], dtype=np.int64),
            cm_block0=blocks[free].astype(np.int64),
            cm_block1=blocks[[b + 1 for b in free]].astype(np.int64),
            fluid_ports=np.array(fluid_ports, dtype=np.int64),
            port_block0=blocks[owner].astype(np.int64),
            port_block1=blocks[[b + 1 for b in owner]].astype(np.int64),
            port_row=np.array([FIXED_ROWS + i for i in place], dtype=np.int64),
            parting=parting,
            fine=np.empty((count, fine, _FINE)),
            filled=np.zeros(count, np.int64),
        )
        # a row for each channel: nothing is copied when they are handed out
        self._means = np.zeros((len(self.means), records + 1))
        self._peaks = np.zeros((count, records + 1))
        self._points = np.zeros((len(self.points), records + 1))
        self._fine = [np.empty((_KEPT, 0)) for _ in range(count)]  # a row for each number
        self._kept = [0] * count  # steps in them; the rest is room
        self._complete = [True] * count
        self._begun = self._driving = False
        self.looked = 0

    def begin(self) -> None:
        """Make room for the next chunk."""
        self.recording.filled[:] = 0

    def start(self, time: float, finder: ImpactFinder, *, fresh: bool) -> None:
        """Record the present state as that before the first step."""
        record_moment(self.recording, 0, moment_of(self.network.arrays))
        self._points[:, 0] = self.recording.points[0]
        if fresh:  # a run that goes on knows this moment
            none = [np.empty((0, _FINE))] * len(self._fine)
            finder.feed(np.array([time]), gap_rates(self.recording.points[:1], self.sides), none)

    def port_speeds(self) -> Vector:
        """Velocity [m/s] of every port at the start, the ground last."""
        ports = len(self.network.ports)
        return np.append(self._points[ports : 2 * ports, 0], 0.0)

    def first(self, acting: Vector, states: Vector | None = None) -> None:
        """Put what acts at the start before the records.

        Parameters
        ----------
        acting
            Forces of elements [N], flows [kg/s], forces of interfaces and of sliders [N], then
            peaks of interfaces [N] and forces of driven bodies [N]; a state of an earlier version
            lacks the last.
        states
            Recorded states of elements, then of branches; by default those in the rows.
        """
        means, peaks = len(self.means), len(self.peaks)
        self._means[:, 0], self._peaks[:, 0], drives = np.split(acting, [means, means + peaks])
        if self._driven and drives.size:
            self._points[-self._driven :, 0] = drives
            self._driving = True
        if states is not None:
            end = len(self.points) - len(self._fine) - self._driven
            self._points[end - len(states) : end, 0] = states
        self._begun = True

    def start_values(self) -> Vector:
        """Means at the start, then points."""
        return np.concatenate([self._means[:, 0], self._points[:, 0]])

    def values(self, look: int) -> Vector:
        """What the present chunk recorded at look ``look``, from 1 on."""
        at = self.recording
        return np.concatenate([at.means[look - 1], at.points[look - 1]])

    def last(self, records: int) -> Vector:
        """First values of a continued run: see :meth:`first`."""
        drives = self._points[len(self.points) - self._driven :, records]
        return np.concatenate([self._means[:, records], self._peaks[:, records], drives])

    def take(self, time: Vector, finder: ImpactFinder) -> None:
        """Take over a chunk with a look at each ``time``."""
        recording, count = self.recording, len(time)
        steps = [recording.fine[c, : recording.filled[c]] for c in range(len(self._fine))]
        finder.feed(time, gap_rates(recording.points[:count], self.sides), steps)
        self._thin(count)
        for c, rows in enumerate(steps):
            begin = self._kept[c]
            end = self._kept[c] = min(begin + len(rows), _MOST_FINE)
            if end > self._fine[c].shape[1]:  # room for as many as this would make in the whole run
                share = self.looked / (self.looks * (self._points.shape[1] - 1))
                wider = np.empty((_KEPT, min(ceil(end / share), _MOST_FINE)))
                wider[:, :begin] = self._fine[c][:, :begin]
                self._fine[c] = wider
            lay_across(rows[: end - begin], 0, 1, self._fine[c], begin)
            self._complete[c] &= end - begin == len(rows)

    def channels(self, records: int) -> dict[str, ChannelData]:
        """All channels by name, with so many records."""
        result = {}
        for columns, values in (
            (self.means, self._means),
            (self.points, self._points),
            (self.peaks, self._peaks),
        ):
            if columns is not self.points and not self._begun:  # state of an earlier version
                values[:, 0] = values[:, 1]
            if columns is self.points and self._driven and records and not self._driving:
                values[-self._driven :, 0] = values[-self._driven :, 1]
            for column, row in zip(columns, values, strict=True):
                result[column.name] = ChannelData(unit=column.unit, values=row[: records + 1])
        return result

    def interfaces(self) -> dict[str, InterfaceRecord]:
        """Steps in which an interface carried force: see :class:`InterfaceRecord`."""
        result = {}
        for c, row in enumerate(self.network.rows.interfaces):
            time, step, contact, film, gap = self._fine[c][:, : self._kept[c]]
            result[row.component] = InterfaceRecord(
                time=time,
                step=step,
                contact_force=contact,
                film_force=film,
                gap=gap,
                complete=self._complete[c],
            )
        return result

    def first_not_finite(self, count: int) -> tuple[int, str] | None:
        """First sample of a chunk that is not finite, and the channel's name."""
        found: tuple[int, str] | None = None
        recording = self.recording
        for columns, values in (
            (self.points, recording.points),
            (self.means, recording.means),
            (self.peaks, recording.peaks),
        ):
            if count and not np.isfinite(extremes(values[:count])[0]).all():
                look, column = np.argwhere(~np.isfinite(values[:count]))[0]
                if found is None or look < found[0]:
                    found = int(look), columns[column].name
        return found

    def _thin(self, count: int) -> None:
        """Records of this chunk: means of means, largest peaks, last points."""
        recording, looks, first = self.recording, self.looks, self.looked
        self.looked += count
        begun = first // looks + 1  # the first record that gets anything
        points, means = recording.points[:count], recording.means[:count]
        peaks = recording.peaks[:count]
        lay_across(points, begun * looks - 1 - first, looks, self._points, begun)
        if looks > 1:
            starts = np.maximum(np.arange(begun - 1, -(-self.looked // looks)) * looks - first, 0)
            means = np.add.reduceat(means, starts, axis=0) / looks
            peaks = np.maximum.reduceat(peaks, starts, axis=0)
        here = slice(begun, begun + len(means))
        self._means[:, here] += means.T
        np.maximum(self._peaks[:, here], peaks.T, out=self._peaks[:, here])


def _sides(rows: Rows, blocks: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where the speeds of both sides of each interface are, the upper one first.

    A body moves as a whole, with its centre of mass.  The face of a lever moves with its own arm,
    and that of a body that follows a course moves with it where the other body can fly.  All others
    are held.

    Returns
    -------
    parting (interfaces, 6)
        Per side: first and last block, none if held, and the row of shapes there.
    columns (interfaces, 2)
        Among the points of a record; -1 if held.
    """
    ports = [(b, i) for b, row in enumerate(rows.bodies) for i in range(len(row.ports))]
    place = {handle: p for p, handle in enumerate(h for row in rows.bodies for h in row.ports)}
    free = [b for b, row in enumerate(rows.bodies) if row.body.moves]
    parting, columns = [], []
    for interface, bodies in zip(rows.interfaces, rows.meeting, strict=True):
        flies = any(owner is not None and owner.body.moves for owner in bodies)
        for handle, owner in zip((interface.upper, interface.lower), bodies, strict=True):
            if owner is None or not flies or not (owner.body.moves or owner.course is not None):
                parting += [0, 0, -1]
                columns.append(-1)
                continue
            b, i = ports[place[handle]]
            own = owner.course is not None or owner.face_ratio(handle) != 1.0
            parting += [blocks[b], blocks[b + 1], FIXED_ROWS + i if own else -1]
            columns.append(len(ports) + place[handle] if own else 2 * len(ports) + free.index(b))
    count = len(rows.interfaces)
    return (
        np.array(parting, dtype=np.int64).reshape(count, 6),
        np.array(columns, dtype=np.int64).reshape(count, 2),
    )


def gap_rates(points: Matrix, sides: NDArray[np.int64]) -> Matrix:
    """Speed of each gap [m/s] at each record, (interfaces, n), positive when it opens."""
    rates = np.zeros((len(sides), len(points)))
    for rate, (upper, lower) in zip(rates, sides, strict=True):
        if upper >= 0:
            rate += points[:, upper]
        if lower >= 0:
            rate -= points[:, lower]
    return rates


def recorded_columns(rows: Rows) -> int:
    """Channels that a run of these rows records."""
    ports = sum(len(row.ports) for row in rows.bodies)
    free = sum(1 for row in rows.bodies if row.body.moves)
    states = sum(len(row.channels) for row in rows.elements)
    states += sum(len(row.channels) for row in rows.branches)
    forces = sum(len(row.names) for row in rows.elements) + len(rows.branches)
    forces += 2 * len(rows.sliders)
    free += free + len(rows.in_fluid)  # impulses
    free += sum(1 for row in rows.bodies if row.course is not None)
    if isinstance(rows.fluid, Fluid) and rows.fluid.has_release_times:
        free += sum(1 for node in rows.nodes.values() if node.volume > 0.0)
    return 2 * ports + free + len(rows.nodes) + states + forces + 4 * len(rows.interfaces)


def _require_memory(records: int, columns: int) -> None:
    require_memory(
        "record",
        8.0 * (records + 1) * columns,
        what=f"{records} records of {columns} channels",
        hint="use a longer record interval, or a shorter duration.",
    )


def _channel(row: ElementRow | BranchRow, channel: Channel) -> str:
    return f"{channel.owner} {channel.label}" if channel.owner else _column(row, channel.label)


def _column(row: ElementRow | BranchRow, what: str, port: str = "") -> str:
    owner = f"{row.component}.{port}" if port else row.component
    owner = port if "." in port else owner  # of a row that stands for several components
    return " ".join(filter(None, (owner, row.label, what)))


def values_now(network: CompiledNetwork, speeds: Vector, h: float) -> tuple[Vector, Vector]:
    """Forces, flows and recorded states now, by a short step ``h`` [s] of all rows.

    Parameters
    ----------
    speeds [m/s]
        Of all ports, the ground last.

    Returns
    -------
    acting : array
        Forces of elements [N], flows of branches [kg/s], contact and film force of every
        interface [N], those of sliders [N], then the sums of each interface [N], and the forces of
        driven bodies [N].
    states : array
        Of elements, then of branches.
    """
    elements, branches, rows = network.elements, network.branches, network.rows
    forces = [
        elements.outputs[elements.output0[k] :][: len(row.ports)]
        for k, row in enumerate(rows.elements)
    ]
    flows = branches.outputs[branches.output0[:-1]]
    pressing, friction = _interfaces(network, speeds, h), _sliders(network, speeds)
    if network.moving is not None:
        pressing[:, 0] += network.moving.pressing()
    states = [*_states(elements, rows.elements), *_states(branches, rows.branches)]
    return (
        np.concatenate(
            [
                *forces,
                flows,
                pressing.ravel(),
                friction,
                pressing.sum(axis=1),
                _drives(network, pressing.sum(axis=1), friction),
            ]
        ),
        np.array(states, dtype=float),
    )


def _states(data: StepRows, rows: Sequence[ElementRow | BranchRow]) -> list[float]:
    """Recorded states, derived ones as the step functions gave them."""
    found = []
    for k, row in enumerate(rows):
        after = data.outputs[data.output0[k] + data.head + len(row.ports) :]
        now = data.state[data.state0[k] :]
        found += [(after if c.derived else now)[c.index] for c in row.channels]
    return found


def _interfaces(network: CompiledNetwork, speeds: Vector, h: float) -> Vector:
    """Contact and film force [N] of every interface, shape (n, 2)."""
    at, state = network.interfaces, network.interface_state
    found = np.zeros((len(network.rows.interfaces), 2))
    for c in range(len(found)):
        gap = float(state.gap[c] + state.e[c])  # between the surfaces
        opening = float(speeds[at.upper[c]] - speeds[at.lower[c]])
        if at.kind[c] != NO_LAW and gap < 0.0:
            found[c, 0], _, _ = mean_force(int(at.kind[c]), at.law, int(at.law0[c]), -gap, -gap, 0)
        before = gap - h * opening
        film = (float(at.cubic[c]), float(at.linear[c]), float(at.cut_off[c]))
        if max(film[:2]) > 0.0 and min(before, gap) >= 0.0:
            found[c, 1] = max(film_force(*film, h, before, gap), -float(at.suction[c]))
    return found


def _sliders(network: CompiledNetwork, speeds: Vector) -> Vector:
    """Friction of every slider [N] on its two ports, flat; none where nothing slips."""
    at = network.sliders
    speed = speeds[at.upper] - speeds[at.lower]
    dry = at.coulomb + at.excess * np.exp(-((speed / at.stribeck) ** 2))
    force = -np.sign(speed) * dry - at.viscous * speed
    return np.column_stack([force, -force]).ravel()


def _drives(network: CompiledNetwork, pressing: Vector, friction: Vector) -> Vector:
    """Force [N] of every driven body: minus the sum of what acts on it."""
    bodies, nodes = network.bodies, network.nodes
    if bodies.driven == 0:
        return np.zeros(0)
    force = np.zeros(bodies.ports + 1)  # the ground last
    for data in (network.elements, network.branches):
        for k in range(data.rows):
            q0, q1, o0 = data.port0[k], data.port0[k + 1], data.output0[k] + data.head
            np.add.at(force, data.ports[q0:q1], data.outputs[o0 : o0 + q1 - q0])
    pressure = network.node_state.p[nodes.wall_node]
    np.add.at(force, nodes.wall_port, nodes.wall_area * (pressure - nodes.ambient))
    np.add.at(force, network.interfaces.upper, pressing)
    np.add.at(force, network.interfaces.lower, -pressing)
    np.add.at(force, network.sliders.upper, friction[0::2])
    np.add.at(force, network.sliders.lower, friction[1::2])
    return np.array(
        [-np.sum(force[bodies.port0[k] : bodies.port1[k]]) for k in bodies.driven_block],
        dtype=float,
    )
