"""Forces at the start of a run: the record before its first step.

Later records hold means over the time before them; the first one holds the limit of that, values of
the started state itself.
"""

from collections.abc import Sequence

import numpy as np

from klack.arrays import Vector
from klack.contact.step_constants import NO_LAW
from klack.network.rows import BranchRow, ElementRow
from klack.simulation.contact_step import mean_force
from klack.simulation.interface_step import film_force
from klack.simulation.network_arrays import StepRows
from klack.simulation.network_compile import CompiledNetwork

__all__ = ["values_now"]


def values_now(network: CompiledNetwork, speeds: Vector, h: float) -> tuple[Vector, Vector]:
    """Forces, flows and recorded states now, after a short step of all rows up to now.

    Parameters
    ----------
    network : CompiledNetwork
    speeds : array [m/s]
        Of all ports, the ground last.
    h : float [s]
        Length of that step.

    Returns
    -------
    acting : array
        Forces of elements [N], flows of branches [kg/s], contact and film force of every
        interface [N], those of sliders [N], then the sums of each interface [N], and the forces of
        driven bodies [N].
    states : array
        Recorded states of elements, then of branches.
    """
    elements, branches, rows = network.elements, network.branches, network.rows
    forces = [
        elements.outputs[elements.output0[k] :][: len(row.ports)]
        for k, row in enumerate(rows.elements)
    ]
    flows = branches.outputs[branches.output0[:-1]]
    pressing, friction = _interfaces(network, speeds, h), _sliders(network, speeds)
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
    """Recorded states as they are, derived ones as the step functions gave them."""
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
    """Force [N] of every driven body: minus the sum of what acts on its ports."""
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
