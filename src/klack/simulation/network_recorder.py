"""Memory for what a run records, and the words for its columns."""

from dataclasses import dataclass

import numpy as np

from klack.errors import InputError
from klack.network.rows import BranchRow, ElementRow
from klack.simulation.modal_step import FIXED_ROWS
from klack.simulation.network_arrays import Recording
from klack.simulation.network_compile import CompiledNetwork
from klack.simulation.network_kernel import record_points
from klack.simulation.network_result import ChannelData, InterfaceRecord

__all__ = ["Recorder"]

_MOST_FINE = 1_000_000  # recorded fine steps per interface
_MOST_VALUES = 400_000_000


@dataclass(frozen=True, slots=True)
class _Column:
    name: str
    unit: str


class Recorder:
    """Memory for the records, and the words for its columns."""

    def __init__(self, network: CompiledNetwork, records: int) -> None:
        self.network = network
        rows, elements = network.rows, network.elements
        states = [
            (elements.state0[k] + channel.index, _column(row, channel.label), channel.unit)
            for k, row in enumerate(rows.elements)
            for channel in row.channels
        ]
        branch_states = [
            (network.branches.state0[k] + channel.index, _column(row, channel.label), channel.unit)
            for k, row in enumerate(rows.branches)
            for channel in row.channels
        ]
        free = [b for b, row in enumerate(rows.bodies) if row.body.rigid_count > 0]
        blocks = network.body_blocks
        owner = [b for b, row in enumerate(rows.bodies) for _ in row.ports]
        place = [i for row in rows.bodies for i in range(len(row.ports))]
        self.means = [
            *(
                _Column(_column(row, "force", port), "N")
                for row in rows.elements
                for port in row.names
            ),
            *(_Column(_column(row, "flow"), "kg/s") for row in rows.branches),
            *(
                _Column(f"{row.component} {kind} force", "N")
                for row in rows.interfaces
                for kind in ("contact", "film")
            ),
        ]
        ports = [f"{name.component}.{name.port}" for name in network.ports]
        nodes = [rows.nodes[handle].component for handle in network.node_order]
        self.points = [
            *(_Column(f"{port} displacement", "m") for port in ports),
            *(_Column(f"{port} velocity", "m/s") for port in ports),
            *(_Column(f"{rows.bodies[b].component} velocity", "m/s") for b in free),
            *(_Column(f"{node} pressure", "Pa") for node in nodes),
            *(_Column(name, unit) for _, name, unit in states + branch_states),
            *(_Column(f"{row.component} gap", "m") for row in rows.interfaces),
        ]
        values = (records + 1) * (len(self.means) + len(self.points))
        if values > _MOST_VALUES:
            raise InputError(
                "record",
                got=f"{records} records of {len(self.means) + len(self.points)} channels",
                expected=f"{_MOST_VALUES} values or fewer",
                hint="take a longer record, or a shorter duration.",
            )
        count = len(rows.interfaces)
        self.recording = Recording(
            means=np.zeros((records + 1, len(self.means))),
            peaks=np.zeros((records + 1, count)),
            points=np.zeros((records + 1, len(self.points))),
            states=np.array([index for index, _, _ in states], dtype=np.int64),
            branch_states=np.array([index for index, _, _ in branch_states], dtype=np.int64),
            cm_block0=blocks[free].astype(np.int64),
            cm_block1=blocks[[b + 1 for b in free]].astype(np.int64),
            port_block0=blocks[owner].astype(np.int64),
            port_block1=blocks[[b + 1 for b in owner]].astype(np.int64),
            port_row=np.array([FIXED_ROWS + i for i in place], dtype=np.int64),
            fine=np.empty((count, _MOST_FINE, 5)),
            filled=np.zeros(count, np.int64),
        )

    def take(self, record: int) -> None:
        """Record the present state."""
        network = self.network
        record_points(
            self.recording,
            record,
            network.bodies.fine,
            network.bodies.start,
            network.bodies.modes,
            network.bodies.at,
            network.nodes.p,
            network.elements.state,
            network.branches.state,
            network.interfaces.gap,
        )

    def channels(self) -> dict[str, ChannelData]:
        """All channels by name."""
        recording = self.recording
        recording.means[0] = recording.means[1]
        recording.peaks[0] = recording.peaks[1]
        result = {}
        for columns, values in ((self.means, recording.means), (self.points, recording.points)):
            for i, column in enumerate(columns):
                result[column.name] = ChannelData(unit=column.unit, values=values[:, i].copy())
        for c, row in enumerate(self.network.rows.interfaces):
            peak = ChannelData(unit="N", values=recording.peaks[:, c].copy())
            result[f"{row.component} peak force"] = peak
        return result

    def interfaces(self) -> dict[str, InterfaceRecord]:
        """Every step in which an interface carried force: see :class:`InterfaceRecord`."""
        result = {}
        for c, row in enumerate(self.network.rows.interfaces):
            filled = int(self.recording.filled[c])
            part = self.recording.fine[c, : min(filled, _MOST_FINE)]
            columns = [part[:, i].copy() for i in range(5)]
            result[row.component] = InterfaceRecord(
                time=columns[0],
                step=columns[1],
                contact_force=columns[2],
                film_force=columns[3],
                gap=columns[4],
                complete=filled <= _MOST_FINE,
            )
        return result


def _column(row: ElementRow | BranchRow, what: str, port: str = "") -> str:
    owner = f"{row.component}.{port}" if port else row.component
    return " ".join(filter(None, (owner, row.label, what)))
