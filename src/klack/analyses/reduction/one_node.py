"""One node as the output of a reduced body, as the classical recipe takes it, beside the port.

The recipe reads its displacement at one node, ``c^T u`` under the load ``b`` of the contact area.
Its bodies carry the static correction of the recipe: attachment modes at the shifts that the case
gives a body (``reduction.shifts``), else the residual one.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from klack.analyses.impact.figures import transfer_chart
from klack.analyses.impact.transfer import LOSS_FACTOR, TRANSFER_COUNTS, sweep_of
from klack.assembling.gauges import placed_point
from klack.assembling.problem import ContactProblem
from klack.assembling.reduced_pair import recipe_stiffness
from klack.bodies.elasticity.body import ElasticBody
from klack.bodies.elasticity.eigen import Modes
from klack.bodies.elasticity.statics import Flexibility
from klack.bodies.gauges.located_point import locate
from klack.bodies.reduction.damping import LossFactor
from klack.bodies.reduction.full_order import (
    entry_of_receptance,
    full_order_receptance,
    receptance_of_entry,
)
from klack.bodies.reduction.ports import Observer, Port, node_observer
from klack.bodies.reduction.receptance import observed_receptance
from klack.bodies.reduction.reduce import Correction, reduce_body
from klack.bodies.reduction.reduced_body import ReducedBody
from klack.bodies.reduction.selection import ByCount
from klack.bodies.reduction.transfer import TransferComparison, compare_curves
from klack.case.schema import Case
from klack.machine.progress import Progress
from klack.mesh.rigid import Pose
from klack.report.chart import Chart
from klack.report.wording import sentence
from klack.simulation.observed_contact import ObservedImpact, observed_impact
from klack.units import format_si

__all__ = [
    "OneNode",
    "OneNodeImpact",
    "corrected_label",
    "node_chart",
    "one_node_impacts",
    "one_nodes",
    "place_words",
]


Floats = NDArray[np.float64]

_HALVINGS = 6  # of the step, at most
_SETTLED, _NOTHING = 0.02, 2e-5  # change of an energy that is left, of itself and of the impact


@dataclass(frozen=True, kw_only=True, eq=False)
class OneNode:
    """A node of a body as its output, in addition to the contact port.

    Parameters
    ----------
    node
        In the mesh of the body, from 0.
    place (2,) or (3,) [m]
        In the drawing of the body.
    distance [m]
        Distance from the position requested in the case.
    correction
        ``"residual"``, or the shifts of attachment modes.
    compliance [-]
        Static displacement of the node over that of the port; of a free body the elastic part.
    transfer
        From the contact force to the node: the full order first, 20 modes alone, 20 and 50 with
        the correction; last, the full order at the port.
    """

    body: str
    node: int
    place: Floats
    distance: float
    correction: str
    compliance: float
    transfer: TransferComparison


@dataclass(frozen=True, kw_only=True, eq=False)
class OneNodeImpact:
    """The impact of the recipe with its gap between nodes, and between the ports.

    ``modes`` are the kept elastic ones of each body; attachment modes come in addition.
    """

    modes: int
    nodes: ObservedImpact
    ports: ObservedImpact


def one_nodes(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    ports: tuple[Port, Port],
    *,
    progress: Progress,
) -> tuple[OneNode, ...]:
    """Transfer functions from the contact force to the nodes that a case names.

    InputError for a place outside of the body, with its distance and the nearest point of the body.
    """
    nodes = {} if problem.case.run.transfer is None else problem.case.run.transfer.nodes
    found: list[OneNode] = []
    for side in _sides(problem, ports):
        if side.body.name in nodes:
            progress("one node", len(found) / len(nodes))
            node, distance = _nearest_node(problem, side, nodes[side.body.name])
            found.append(_one_node(problem, pools[side.body.name], side, node, distance))
    if nodes:
        progress("one node", 1.0)
    return tuple(found)


def one_node_impacts(
    problem: ContactProblem,
    pools: Mapping[str, Modes],
    ports: tuple[Port, Port],
    found: tuple[OneNode, ...],
) -> tuple[OneNodeImpact, ...]:
    """What the nodes cost in energy where they stand for the contact, 20 and 50 modes a body.

    Bodies without a node named have their port as output.  The contact is linear, as the recipe has
    it; damping, springs and constant forces are left out.
    """
    nodes = {item.body: item.node for item in found}
    stiffness = recipe_stiffness(problem.case)
    impacts = []
    for count in TRANSFER_COUNTS if nodes else ():
        bodies, outputs = [], []
        for side in _sides(problem, ports):
            reduced = _recipe(
                problem, pools[side.body.name], side, count, nodes.get(side.body.name)
            )
            bodies.append(reduced)
            observed = reduced.observer_shapes if reduced.observer_names else reduced.port_shapes
            outputs.append(observed[:, 0])
        own = (bodies[0].port_shapes[:, 0], bodies[1].port_shapes[:, 0])
        read = (outputs[0], outputs[1])
        at_ports, at_nodes = _settled(problem.case, (bodies[0], bodies[1]), stiffness, own, read)
        impacts.append(OneNodeImpact(modes=count, nodes=at_nodes, ports=at_ports))
    return tuple(impacts)


def _settled(
    case: Case,
    bodies: tuple[ReducedBody, ReducedBody],
    stiffness: float,
    *reads: tuple[Floats, Floats],
) -> list[ObservedImpact]:
    """Impacts read in several ways, in steps that change none of their energies."""
    step, before = case.run.reduced_step, np.full(len(reads), np.nan)
    for _ in range(_HALVINGS):
        found = [
            observed_impact(
                *bodies,
                outputs=read,
                stiffness=stiffness,
                speed=case.motion.speed,
                duration=case.run.duration,
                step=step,
            )
            for read in reads
        ]
        change = np.array([one.energy - 1.0 for one in found])
        if np.all(np.abs(change - before) <= _SETTLED * np.abs(change) + _NOTHING):
            break
        step, before = step / 2.0, change
    return found


@dataclass(frozen=True, kw_only=True, eq=False)
class _Side:
    body: ElasticBody
    flexibility: Flexibility
    port: Port
    pose: Pose | None


def _sides(problem: ContactProblem, ports: tuple[Port, Port]) -> tuple[_Side, _Side]:
    pair = problem.pair
    return (
        _Side(
            body=pair.upper,
            flexibility=problem.flexibility_upper,
            port=ports[0],
            pose=pair.pose,
        ),
        _Side(body=pair.lower, flexibility=problem.flexibility_lower, port=ports[1], pose=None),
    )


def _nearest_node(
    problem: ContactProblem, side: _Side, place: tuple[float, ...]
) -> tuple[int, float]:
    mesh = side.body.mesh
    where = f"{problem.case.path or 'case'}: run.transfer.nodes.{side.body.name}"
    at = placed_point(np.array(place), side.pose)
    held = np.unique(np.concatenate([found.nodes for found in locate(mesh, at, where)]))
    distances = np.linalg.norm(mesh.points[held] - at, axis=1)
    return int(held[np.argmin(distances)]), float(distances.min())


def _one_node(
    problem: ContactProblem, pool: Modes, side: _Side, node: int, distance: float
) -> OneNode:
    body, port = side.body, side.port
    read = node_observer(body.mesh, node, "z", name="node")
    sweep = sweep_of(problem.case)
    both = [port, Port(read.name, read.weights)]
    full = side.flexibility.remembered(
        "full-order receptance",
        (port.name, port.pattern, node, sweep, LOSS_FACTOR, pool.omega, pool.shapes),
        lambda: full_order_receptance(
            body,
            both,
            sweep,
            loss_factor=LOSS_FACTOR,
            flexibility=side.flexibility,
            modes=pool,
        ),
        entry_of_receptance,
        receptance_of_entry,
    )
    words = _correction_words(problem, body.name)
    curves = {"full order at the node": full.receptance.between("node", port.name)}
    choices: list[tuple[int, Correction, str]] = [
        (TRANSFER_COUNTS[0], "none", f"only {TRANSFER_COUNTS[0]} modes"),
        *((count, "attachment", corrected_label(count)) for count in TRANSFER_COUNTS),
    ]
    for count, correction, label in choices:
        if count <= len(pool.omega):
            reduced = _recipe(problem, pool, side, count, node, correction)
            answer = observed_receptance(reduced, sweep, loss_factor=LOSS_FACTOR)
            curves[label] = answer[:, 0, 0]
    curves["full order at the port"] = full.receptance.drive(port.name)
    deflection = side.flexibility.deflections(port.pattern[:, None])[:, 0]
    point = body.mesh.points[node]
    return OneNode(
        body=body.name,
        node=node,
        place=point if side.pose is None else _drawn(point, side.pose),
        distance=distance,
        correction=words,
        compliance=float(read.weights @ deflection) / float(port.pattern @ deflection),
        transfer=compare_curves(
            sweep,
            curves,
            body=body.name,
            port=port.name,
            loss_factor=LOSS_FACTOR,
            reference_note=full.note,
        ),
    )


def _recipe(
    problem: ContactProblem,
    pool: Modes,
    side: _Side,
    count: int,
    node: int | None,
    correction: Correction = "attachment",
) -> ReducedBody:
    body = side.body
    observers: list[Observer] = []
    if node is not None:
        observers.append(node_observer(body.mesh, node, "z", name="node"))
    return reduce_body(
        body,
        [side.port],
        modes=ByCount(min(count, len(pool.omega))),
        correction=correction,
        damping=LossFactor(eta=LOSS_FACTOR),
        observers=observers,
        modes_pool=pool,
        flexibility=side.flexibility,
        shifts=problem.case.reduction.shifts_of(body.name, correction),
    )


def corrected_label(count: int) -> str:
    """Label of so many modes with the static correction."""
    return f"{count} modes with correction"


def _correction_words(problem: ContactProblem, body: str) -> str:
    shifts = problem.case.reduction.shifts.get(body)
    if shifts is None:
        return "residual"
    return f"shifted to {' and '.join(format_si(frequency, 'Hz') for frequency in shifts)}"


def _drawn(point: Floats, pose: Pose) -> Floats:
    if len(point) == 2:
        return point - pose.shift[2] * np.array([0.0, 1.0])
    return np.asarray(pose.drawn(point))


def place_words(node: OneNode) -> str:
    """Place of the node, for example ``(0, 0, -0.6) mm``."""
    return f"({', '.join(f'{round(1e3 * x, 4) + 0.0:g}' for x in node.place)}) mm"


def _attached(node: OneNode) -> str:
    return "without a shift (residual)" if node.correction == "residual" else node.correction


def node_chart(node: OneNode) -> Chart:
    """Displacement of the node per contact force, and its deviation."""
    item = node.transfer
    drawn = transfer_chart(item)
    return replace(
        drawn,
        name=f"node-{node.body}",
        title=f"Transfer function of the {node.body} from the contact force to one node",
        note=(
            f"Above: axial displacement of node {node.node} at {place_words(node)}, per harmonic "
            f"force over the contact area. With correction: attachment modes {_attached(node)}. "
            "At the port: mean displacement, weighted like that load. Below: magnitude of the "
            "level difference from the full body at the node, averaged over a sliding third "
            f"octave; the level line is at {item.tolerance:g} dB, a vertical line marks where a "
            "curve first exceeds it. Structural damping with a loss factor of "
            f"{item.loss_factor:g} in every curve. {sentence(item.reference_note)} The node is "
            f"{format_si(node.distance, 'm', 3)} from the position in the case."
        ),
    )
