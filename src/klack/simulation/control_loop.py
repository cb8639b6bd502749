"""Controllers of a network: at their sampling instants they read channels and set one number each.

The time loop runs from one instant to the next without them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, isfinite

import numpy as np
from numpy.typing import NDArray

from klack.errors import InputError, refuse_if
from klack.input.problem import CaseProblem, nearest, refuse_key_if
from klack.network.protocols import RunningController
from klack.network.rows import ControllerRow
from klack.simulation.flow_channels import present_name
from klack.simulation.network_arrays import BEFORE, BEFORE_2, BEFORE_3, MEAN
from klack.simulation.network_compile import CompiledNetwork
from klack.simulation.network_recorder import Recorder
from klack.units import KINDS, format_si, parse_quantity

__all__ = ["ControlLoop"]

_WHOLE = 1e-6  # of a look, to which a sample time must be a whole number
_STORED = "controllers."
_ACTED = f"{_STORED}acted"
_OTHER = {"kg/s": {"kg/s": 1.0, "g/s": 1e-3}, "-": {"-": 1.0, "1": 1.0}}


@dataclass(frozen=True, slots=True)
class _Running:
    row: ControllerRow
    looks: int  # between two instants
    columns: tuple[int, ...]  # of what is recorded: means, then points
    scale: tuple[float, ...]  # SI per unit of a signal
    target: NDArray[np.float64]  # what the output is written to, at this place
    place: int
    pushed: tuple[tuple[int, float], ...]  # ports that feel it at once, and the force per unit
    least: float  # smallest output that has a meaning
    output: RunningController


class ControlLoop:
    """All controllers of a run.

    Parameters
    ----------
    network
        Its parameters are overwritten.
    look [s]
        Time between two looks at the network.
    begun
        Looks before the start of a continued run.
    """

    def __init__(
        self, network: CompiledNetwork, recorder: Recorder, look: float, begun: int = 0
    ) -> None:
        self._network, self._look, self._begun = network, look, begun
        self._acted = -1  # looks, those before the start included
        columns = [*recorder.means, *recorder.points]
        self._names = [column.name for column in columns]
        self._units = [column.unit for column in columns]
        self._all = [self._running(row) for row in network.rows.controllers]

    def next(self, looked: int) -> int:
        """Looks from ``looked`` until the next instant."""
        now = looked + self._begun
        return min(running.looks - now % running.looks for running in self._all)

    def act(self, looked: int, values: NDArray[np.float64]) -> None:
        """Set the outputs of the controllers that are due, from the values recorded now."""
        now = looked + self._begun
        time = now * self._look
        self._acted = now
        for running in self._all:
            if now % running.looks:
                continue
            signals = zip(running.columns, running.scale, strict=True)
            found = running.output(time, tuple(float(values[c]) / s for c, s in signals))
            known = isinstance(found, int | float | np.floating) and isfinite(found)
            if not known or not found > running.least:
                raise InputError(
                    f"{running.row.component}: controller",
                    got=f"the output {found!r} at {format_si(time, 's', 8)}",
                    expected="a finite number" + (" above 0 Pa" if running.least == 0.0 else ""),
                    hint="check its law or function, and how it uses its signals.",
                )
            change = found - running.target[running.place]
            running.target[running.place] = found
            for port, share in running.pushed:  # no rise: it held before, and holds from now on
                for row in (BEFORE, BEFORE_2, BEFORE_3, MEAN):
                    self._network.bodies.at[row + port] += share * change

    def memory(self) -> dict[str, NDArray[np.generic]]:
        """Outputs, and the memory of all controllers that can be stored, to continue from."""
        kept: dict[str, NDArray[np.generic]] = {_ACTED: np.array([self._acted])}
        for running in self._all:
            head = f"{_STORED}{running.row.component}."
            if running.output.can_be_stored:
                kept[f"{head}output"] = running.target[running.place : running.place + 1].copy()
                kept |= {f"{head}{k}": np.asarray(a) for k, a in running.output.memory().items()}
        return kept

    def recall(self, state: Mapping[str, NDArray[np.generic]]) -> bool:
        """Continue from :meth:`memory`; whether the controllers have already acted at this start.

        Raises
        ------
        InputError
            For a controller whose memory is not stored, or the memory of another one.
        """
        if not self._begun and _ACTED not in state:  # an operating point, at time zero
            return False
        for running in self._all:
            head = f"{_STORED}{running.row.component}."
            where = f"components.{running.row.component}"
            refuse_if(
                not running.output.can_be_stored,
                where,
                got="a run that continues from a stored state",
                expected="a run from its start: the memory of this controller is not stored",
                hint="compute the whole time in one run; a function in Python can be stored if "
                "it has the methods memory() and recall().",
            )
            found = {k[len(head) :]: a for k, a in state.items() if k.startswith(head)}
            try:
                running.target[running.place] = float(np.asarray(found.pop("output"))[0])
                running.output.recall(found)
            except (KeyError, IndexError) as error:
                raise InputError(
                    f"{where}: controller",
                    got=f"a stored state without its {error.args[0]}"
                    if isinstance(error, KeyError)
                    else "a stored state without its output",
                    expected="the state of a run with the same controller and sensors",
                    hint="continue with the case of that run, or run from the start.",
                ) from None
        self._acted = int(np.asarray(state[_ACTED])[0])
        return self._acted == self._begun

    def _running(self, row: ControllerRow) -> _Running:
        looks = round(row.period / self._look)
        refuse_key_if(
            looks < 1 or abs(row.period / self._look - looks) > _WHOLE * max(looks, 1),
            ("components", row.component, "sample_time"),
            got=format_si(row.period, "s", 8),
            expected=f"a whole number of steps of {format_si(self._look, 's', 8)}",
            hint="choose such a time, or another run.step, run.coarse or run.record.",
        )
        places = [self._column(row, i) for i in range(len(row.channels))]
        target, place, pushed = self._actuator(row)
        return _Running(
            row,
            looks,
            tuple(column for column, _ in places),
            tuple(scale for _, scale in places),
            target,
            place,
            pushed,
            0.0 if row.actuator == "pressure" else -inf,
            row.begin(),
        )

    def _column(self, row: ControllerRow, i: int) -> tuple[int, float]:
        key = ("components", row.component, "sensors", row.sensors[i])
        name, unit = present_name(row.channels[i], self._names), row.units[i]
        if name not in self._names:
            raise CaseProblem(
                (*key, "channel"),
                got=f"'{name}'",
                expected="a recorded channel: a displacement, velocity, force, pressure or current",
                hint=nearest(name, self._names, f"available are: {', '.join(self._names)[:600]}."),
            )
        column = self._names.index(name)
        si = self._units[column]
        if si in _OTHER:
            size = _OTHER[si].get(unit)
        else:
            kind = next(kind for kind in KINDS if kind.unit == si)
            try:
                size = parse_quantity(f"1 {unit}", kind, name)
            except InputError:
                size = None
        if size is None:
            raise CaseProblem(
                (*key, "unit"),
                got=f"'{unit}'",
                expected=f"a unit of '{name}', which is in {si}",
                hint=f"write {si}.",
            )
        return column, size

    def _actuator(
        self, row: ControllerRow
    ) -> tuple[NDArray[np.float64], int, tuple[tuple[int, float], ...]]:
        """Array and place that the output is written to, and whom it pushes at once."""
        network = self._network
        elements, parameters = network.elements, network.elements.parameters
        if row.actuator == "force":
            port = int(elements.ports[elements.port0[row.handle]])
            return parameters, int(elements.parameter0[row.handle]), ((port, 1.0),)
        if row.actuator == "pressure":
            nodes = network.nodes
            k = network.node_order.index(row.handle) - nodes.volumes
            walls = np.flatnonzero(nodes.wall_node[: nodes.walls] == nodes.volumes + k)
            areas = tuple((int(nodes.wall_port[w]), float(nodes.wall_area[w])) for w in walls)
            return nodes.pressure, int(nodes.table0[k]), areas
        k, program = network.rows.coils[row.handle]
        first = int(elements.parameter0[k])
        drive = first + int(parameters[first + program])
        block = drive + int(parameters[drive + 1])
        source = block + 3 + 4 * int(parameters[block + 2])
        return parameters, source, ()
