"""The transfer function from the contact force to one node, as a figure."""

from dataclasses import replace

from klack.analyses.impact.figures import transfer_chart
from klack.analyses.reduction.one_node import OneNode
from klack.report.chart import Chart
from klack.report.wording import sentence
from klack.units import format_si

__all__ = ["node_chart", "place_words"]


def place_words(node: OneNode) -> str:
    """Where the node is, for example ``(0, 0, -0.6) mm``."""
    return f"({', '.join(f'{round(1e3 * x, 4) + 0.0:g}' for x in node.place)}) mm"


def _attached(node: OneNode) -> str:
    return "without a shift (residual)" if node.correction == "residual" else node.correction


def node_chart(node: OneNode) -> Chart:
    """Displacement of the node per contact force, and the deviation from the full order there."""
    item = node.transfer
    drawn = transfer_chart(item)
    return replace(
        drawn,
        name=f"node-{node.body}",
        title=f"Transfer function of the {node.body} from the contact force to one node",
        note=(
            f"Above: axial displacement of node {node.node} at {place_words(node)}, per harmonic "
            "force over the contact area. With correction: attachment modes "
            f"{_attached(node)}. At the port: mean displacement, weighted like that load. Below: "
            "magnitude of the level difference from the full body at the node, averaged over a "
            f"sliding third octave; the level line is at {item.tolerance:g} dB, a vertical "
            "line marks where a curve first exceeds it. Structural damping with a loss factor of "
            f"{item.loss_factor:g} in every curve. {sentence(item.reference_note)} "
            f"The node is {format_si(node.distance, 'm', 3)} from the place in the case."
        ),
    )
