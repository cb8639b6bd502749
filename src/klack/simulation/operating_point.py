"""Operating point of a network: where it rests while everything that drives it is constant.

The equations are those of :mod:`klack.simulation.static_start`, with the pressure of every volume
as an unknown; what the case states of it is where the search begins.  The point has *static
stiffnesses*: by the slopes of all forces and flows a force :math:`f` along +z shifts a body by
:math:`d` while pressures and flows find their new balance, and :math:`f/d` is the stiffness of
springs, contacts, magnets and fluid together.  Below zero, the body moves away from the point.
"""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from klack.arrays import Matrix, Vector
from klack.network.ranges import Travel
from klack.network.rows import Rows
from klack.simulation.impact_events import ImpactFinder
from klack.simulation.limits import Limits
from klack.simulation.network_compile import CompiledNetwork, compile_network
from klack.simulation.network_kernel import CLOCK
from klack.simulation.network_recorder import Recorder, values_now
from klack.simulation.network_result import ChannelData, StaticStart
from klack.simulation.network_run import read_rows, restore_state, saved_state
from klack.simulation.row_calls import SHARE_OF_STEP
from klack.simulation.static_start import SteadySlopes, begin_steady
from klack.simulation.step_sizes import step_sizes

__all__ = [
    "OperatingPoint",
    "compiled_at",
    "far_ends",
    "operating_point",
    "static_compliance",
    "steady_rows",
    "without_guesses",
]


@dataclass(frozen=True, kw_only=True, eq=False)
class OperatingPoint:
    """Where a network rests.

    Parameters
    ----------
    values
        Everything that a run records, one value each.
    state
        From which :func:`~klack.simulation.network_run.simulate_network` continues with steps of
        the usual size.
    inflow [m^3/s]
        Rest of the flow into each volume, at its density.
    compliance [m/N]
        Displacement of each free body per force on it.
    friction [m]
        How far from the point dry friction may hold each body.
    enclosed
        Volumes without an open way to a known pressure: they keep that of the start of the search,
        or share it.
    stable
        Whether a small push of the bodies is answered by a force back, the fluid at rest again.
    """

    start: StaticStart
    values: Mapping[str, ChannelData]
    state: Mapping[str, NDArray[np.generic]]
    inflow: Mapping[str, float]
    compliance: Mapping[str, float]
    friction: Mapping[str, float]
    enclosed: tuple[str, ...]
    stable: bool

    def value(self, channel: str) -> float:
        """Value of a recorded channel."""
        return float(self.values[channel].values[0])


def operating_point(
    rows: Rows,
    *,
    first: Mapping[str, float] | None = None,
    held: Collection[str] = (),
) -> OperatingPoint:
    """Find where a network rests.

    Parameters
    ----------
    first [m]
        Displacements of free bodies where the search begins, by component; 0 by default.
    held
        Bodies that are held at that displacement.

    Raises
    ------
    InputError
        If a body has no equilibrium, or a volume no steady pressure.
    ConvergenceError
        If none is found, or only one in which a law cannot be evaluated.
    """
    free = steady_rows(rows)
    sizes = step_sizes(free, "normal")
    network = compile_network(free, sizes)
    begun, slopes = begin_steady(network, sizes.step, first=first or {}, held=held)
    compliance, stable = static_compliance(slopes)
    values = _recorded(network, sizes.step)
    own = {name: float(compliance[b, b]) for b, name in enumerate(_moving(slopes))}
    return OperatingPoint(
        start=begun,
        values=values,
        state=saved_state(network, _clock()),
        inflow=dict(zip(slopes.volumes, (slopes.left / slopes.density).tolist(), strict=True)),
        compliance=own,
        friction=_friction(network, own),
        enclosed=tuple(
            name for name, known in zip(slopes.volumes, slopes.known, strict=True) if not known
        ),
        stable=stable,
    )


def compiled_at(rows: Rows, point: OperatingPoint) -> tuple[CompiledNetwork, float]:
    """The network in the state of a point, and the step of its arrays [s]."""
    free = steady_rows(rows)
    sizes = step_sizes(free, "normal")
    network = compile_network(free, sizes)
    restore_state(network, _clock(), point.state)
    return network, sizes.step


def without_guesses(rows: Rows) -> Rows:
    """Rows that begin with ambient pressure in every volume."""
    ambient = np.array([rows.ambient.pressure])
    nodes = {
        handle: node if node.prescribed else replace(node, pressure=ambient)
        for handle, node in rows.nodes.items()
    }
    return replace(rows, nodes=nodes)


def _clock() -> NDArray[np.int64]:
    clock = np.zeros(CLOCK, dtype=np.int64)
    clock[1] = -1
    return clock


def steady_rows(rows: Rows) -> Rows:
    """Rows in which every pressure of a volume is free, and no body begins in flight."""
    nodes = {
        handle: node if node.prescribed else replace(node, stated=False)
        for handle, node in rows.nodes.items()
    }
    return replace(
        rows,
        nodes=nodes,
        bodies=[replace(row, speed=0.0) for row in rows.bodies],
        elements=[
            row if row.at_steady is None else replace(row, at_rest=row.at_steady)
            for row in rows.elements
        ],
    )


def far_ends(rows: Rows) -> list[dict[str, float]]:
    """Displacements of the free bodies at their farthest stops: all together, then each alone.

    Bodies that nothing stops stay.
    """
    travel, ends = Travel.of(rows), dict[str, float]()
    for row in rows.bodies:
        if row.body.rigid_count == 0:
            continue
        name = row.component
        reach = (travel.highest({name: 1.0})[0], travel.lowest({name: 1.0})[0])
        known = [way for way in reach if np.isfinite(way) and way != 0.0]
        if known:
            ends[name] = max(known, key=abs)
    if len(ends) < 2:
        return [ends] if ends else []
    return [ends, *({name: way} for name, way in ends.items())]


def static_compliance(slopes: SteadySlopes) -> tuple[Matrix, bool]:
    """Displacement of each moving body per force on each of them [m/N], and whether it holds.

    Pressures and flows follow; those of enclosed volumes keep their mean.  It holds where the work
    of a small push, fluid and magnet at rest again, is positive for all of them.
    """
    moving = np.flatnonzero(slopes.moves)
    n, r, f = slopes.compliance.shape[0], slopes.axial.size, slopes.density.size
    c, count = slopes.friction.size, moving.size
    if not count:
        return np.zeros((0, 0)), True
    A = np.zeros((n + r + f + c, n + r + f + c))
    y, z, p = slice(0, n), slice(n, n + r), slice(n + r, n + r + f)
    A[y, y] = np.eye(n) - slopes.compliance @ slopes.force_by_port
    A[y, z] = -slopes.shapes.T
    A[y, p] = -slopes.compliance @ slopes.force_by_pressure
    A[z, y] = slopes.shapes @ slopes.force_by_port
    A[z, p] = slopes.shapes @ slopes.force_by_pressure
    for k in np.flatnonzero(~slopes.moves):
        A[n + k] = 0.0
        A[n + k, n + k] = 1.0
    A[p, y], A[p, p] = slopes.flow_by_port, slopes.flow_by_pressure
    for column, (a, b) in enumerate(slopes.ends):
        row = n + r + f + column
        A[row, row] = slopes.friction[column]
        for i, sign in ((int(a), 1.0), (int(b), -1.0)):
            if i >= 0:
                A[n + r + i, row] -= sign
                A[row, n + r + i] -= sign / slopes.density[i]
    right = np.zeros((A.shape[0], count))
    for j, k in enumerate(moving):
        right[n + k, j] = -1.0 / slopes.axial[k]
    rows = np.max(np.abs(A), axis=1)
    rows[rows == 0.0] = 1.0  # a volume that nothing fills: its pressure stays
    columns = np.max(np.abs(A / rows[:, None]), axis=0)
    columns[columns == 0.0] = 1.0
    scaled = A / rows[:, None] / columns
    found = np.linalg.lstsq(scaled, right / rows[:, None], rcond=1e-13)[0] / columns[:, None]
    compliance = found[n + moving] / slopes.axial[moving, None]
    symmetric = 0.5 * (compliance + compliance.T)
    return np.asarray(compliance), bool(np.all(np.linalg.eigvalsh(symmetric) > 0.0))


def _moving(slopes: SteadySlopes) -> list[str]:
    return [name for name, moves in zip(slopes.body, slopes.moves, strict=True) if moves]


def _friction(network: CompiledNetwork, compliance: Mapping[str, float]) -> dict[str, float]:
    """Distance over which sliders may hold each body [m]."""
    rows = network.rows
    owner = {handle: row.component for row in rows.bodies for handle in row.ports}
    held: dict[str, float] = {}
    for slider in rows.sliders:
        for handle in (slider.upper, slider.lower):
            name = owner.get(handle, "")
            if name in compliance:
                held[name] = held.get(name, 0.0) + slider.breakaway * abs(compliance[name])
    return held


def _put_states(network: CompiledNetwork, states: Vector) -> None:
    """Write recorded states into the rows; some follow from what else is known."""
    at = 0
    channels = (
        *((network.elements, k, row.channels) for k, row in enumerate(network.rows.elements)),
        *((network.branches, k, row.channels) for k, row in enumerate(network.rows.branches)),
    )
    for data, k, recorded in channels:
        for channel in recorded:
            if channel.derived:
                data.state[data.state0[k] + channel.index] = states[at]
            at += 1


def _recorded(network: CompiledNetwork, step: float) -> dict[str, ChannelData]:
    recorder = Recorder(network, records=1, looks=1, chunk=1, fine=1)
    recorder.start(0.0, ImpactFinder(network.rows, 0.0, step), fresh=True)
    short, speeds = SHARE_OF_STEP * step, recorder.port_speeds()
    read_rows(network, -short, short, speeds)
    limits = Limits(network, [column.name for column in recorder.points])
    points, now = recorder.recording.points[:1], np.zeros(1)
    limits.tell(points, now)
    if left := limits.left(points, now):
        raise left[1]
    acting, states = values_now(network, speeds, short)
    recorder.first(acting, states)
    _put_states(network, states)
    return {
        name: replace(data, values=data.values[:1].copy())
        for name, data in recorder.channels(0).items()
    }
