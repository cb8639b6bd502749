"""The few numbers of a reduction that a script or a terminal wants."""

from collections.abc import Iterator
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from typing_extensions import TypedDict

from klack.analyses.analysis import Measured
from klack.analyses.impact.transfer import TRANSFER_COUNTS
from klack.analyses.measures import (
    Column,
    Measure,
    described_in,
    json_of,
    text_table,
    with_measures,
)
from klack.analyses.reduction.node_figure import place_words
from klack.analyses.reduction.one_node import corrected_label
from klack.analyses.reduction.run import ReductionStudy
from klack.assembling.modes import elastic_count
from klack.reduction.reduced_body import ReducedBody
from klack.terminal.tables import TextTable

__all__ = [
    "BODY_MEASURES",
    "ReductionJson",
    "reduction_measured",
    "reduction_to_json",
    "reduction_told",
]

_THEORY = "theory/reduction"
_BENDING_TOLD = 10


def _highest(body: ReducedBody) -> float:
    kept = body.frequencies[: body.rigid_count + elastic_count(body)]
    return float(kept[-1]) if len(kept) else 0.0


def _share(body: ReducedBody) -> float | None:
    return float(body.compliance_share[0]) if body.static_compliance[0, 0] else None


BODY_MEASURES: tuple[Measure[ReducedBody], ...] = described_in(
    _THEORY,
    Measure(
        key="mass",
        symbol="m",
        unit="kg",
        definition="Mass of the body; missing where a reduced model does not tell it.",
    ),
    Measure(
        key="degrees_of_freedom",
        symbol="n",
        definition="Free displacements of the body before reduction.",
        read=lambda body: body.dof_count,
        kind="whole",
        column=Column("", 1.0, "d"),
    ),
    Measure(
        key="rigid_modes",
        symbol="n_r",
        definition="Rigid motions that are kept.",
        read=lambda body: body.rigid_count,
        kind="whole",
    ),
    Measure(
        key="elastic_modes",
        name="modes",
        symbol="n_e",
        definition="Elastic eigenmodes that are kept, without attachment modes.",
        read=elastic_count,
        kind="whole",
        column=Column("", 1.0, "d"),
    ),
    Measure(
        key="highest_mode",
        symbol="f_max",
        unit="Hz",
        definition="Highest frequency of a mode that is no attachment mode; 0 without any.",
        read=_highest,
        column=Column("kHz", 1e-3, ".4g", "up to"),
    ),
    Measure(
        key="static_compliance",
        symbol="b^T K^+ b",
        unit="m/N",
        definition="Displacement of the contact per static force on it, of the whole body.",
        read=lambda body: float(body.static_compliance[0, 0]),
        column=Column("m/N", 1.0, ".4g"),
    ),
    Measure(
        key="modal_compliance",
        symbol="sum phi^2/omega^2",
        unit="m/N",
        definition="Part of the static compliance that the kept modes have.",
        read=lambda body: float(body.modal_compliance[0, 0]),
    ),
    Measure(
        key="compliance_share",
        name="share of the modes",
        definition="Modal over static compliance.",
        read=_share,
        form="share",
        column=Column("%", 100.0, ".3g"),
    ),
)
"""Of one reduced body at its contact."""


@with_measures(BODY_MEASURES)
class ReducedBodyJson(TypedDict):
    """A body after reduction."""

    frequencies_Hz: Annotated[
        list[float], Field(description="Of the elastic modes, attachment modes included.")
    ]
    correction: str


class TransferJson(TypedDict):
    """Transfer functions of a body."""

    valid_up_to_Hz: Annotated[dict[str, float], Field(description="By the kind of reduction.")]
    tolerance_dB: float
    loss_factor: float


class OneNodeJson(TypedDict):
    """A node of a body as its output, beside the contact port."""

    node: Annotated[int, Field(description="In the mesh, from 0.")]
    place_m: Annotated[list[float], Field(description="Of the node, in the drawing.")]
    distance_m: Annotated[float, Field(description="From the place that the case asks for.")]
    correction: Annotated[str, Field(description="Attachment modes of the recipe, in words.")]
    compliance_over_port: Annotated[
        float, Field(description="Static displacement of the node over that of the port.")
    ]
    valid_up_to_Hz: Annotated[dict[str, float], Field(description="By the kind of reduction.")]


class OneNodeImpactJson(TypedDict):
    """The impact of the recipe with its gap between nodes."""

    modes: Annotated[int, Field(description="Kept elastic modes of each body.")]
    energy_change: Annotated[
        float, Field(description="Of the energy of the impact, made by the one-node outputs.")
    ]
    peak_force_N: float
    restitution: float
    peak_force_of_ports_N: Annotated[float, Field(description="With the gap at the ports.")]
    restitution_of_ports: float
    energy_change_of_ports: Annotated[float, Field(description="Round-off.")]


class BendingJson(TypedDict):
    """Elastic modes of an axisymmetric body, the lowest of either kind."""

    bending_frequencies_Hz: Annotated[
        list[float],
        Field(description="Of Fourier order 1; each is two modes, in directions at right angles."),
    ]
    axial_frequencies_Hz: Annotated[
        list[float], Field(description="Of order 0 without torsion, as many.")
    ]
    rigid_modes_of_order_1: Annotated[
        int, Field(description="2 of a free body, shift and rotation; 0 of a held one.")
    ]


class ReductionJson(TypedDict):
    """``klack reduce``."""

    schema: Literal["klack-reduce/1"]
    case: str
    bodies: Annotated[dict[str, ReducedBodyJson], Field(description="By name.")]
    transfer: Annotated[dict[str, TransferJson], Field(description="By body.")]
    one_node: Annotated[
        dict[str, OneNodeJson], Field(description="By body; of those with run.transfer.nodes.")
    ]
    one_node_impacts: Annotated[
        list[OneNodeImpactJson], Field(description="With 20 and 50 modes, where there is a node.")
    ]
    bending: Annotated[
        dict[str, BendingJson], Field(description="By body; of axisymmetric bodies meshed here.")
    ]


def reduction_told(study: ReductionStudy) -> Iterator[TextTable]:
    """What a terminal shows: both bodies."""
    yield text_table(study.title, "body", BODY_MEASURES, ((b.name, b) for b in study.bodies))
    if study.nodes:
        yield _nodes_told(study)
        yield _impacts_told(study)
    if study.bending:
        yield _bending_told(study)


def _nodes_told(study: ReductionStudy) -> TextTable:
    """Nodes as outputs, and how far up the recipe is right there."""
    rows = []
    for node in study.nodes:
        limits = dict(zip(node.transfer.labels, node.transfer.valid_up_to, strict=True))
        corrected = (limits.get(corrected_label(count)) for count in TRANSFER_COUNTS)
        rows.append(
            (
                node.body,
                f"{node.node} at {place_words(node)}",
                node.correction,
                f"{1e6 * node.distance:.3g}",
                f"{node.compliance:.4g}",
                *("none" if limit is None else f"{1e-3 * limit:.4g}" for limit in corrected),
            )
        )
    counts = [f"{count} modes valid to [kHz]" for count in TRANSFER_COUNTS]
    return TextTable(
        title="Displacement of one node per contact force",
        columns=(
            "body",
            "node",
            "attachment modes",
            "off by [um]",
            "static, over the port",
            *counts,
        ),
        rows=rows,
        left=3,
    )


def _impacts_told(study: ReductionStudy) -> TextTable:
    """Energy that these nodes make or take where they stand for the contact."""
    rows = []
    for item in study.impacts:
        for name, found in (("one node", item.nodes), ("port", item.ports)):
            rows.append(
                (
                    f"{item.modes} modes, {name}",
                    f"{found.peak_force:.2f}",
                    f"{found.restitution:.4f}",
                    _change(100.0 * (found.energy - 1.0)),
                )
            )
    return TextTable(
        title="Impact of the recipe with its gap read there",
        columns=("output", "peak force [N]", "restitution", "energy change [%]"),
        rows=rows,
    )


def _bending_told(study: ReductionStudy) -> TextTable:
    """Lowest modes of order 1 beside the axial ones; a dash where a body keeps no more."""
    columns = [
        (f"{item.body} {kind} [kHz]", frequencies)
        for item in study.bending
        for kind, frequencies in (("bending", item.bending), ("axial", item.axial))
    ]
    rows = [
        (str(i + 1), *(_khz(frequencies, i) for _, frequencies in columns))
        for i in range(max(len(frequencies) for _, frequencies in columns))
    ]
    return TextTable(
        title="Bending modes (order 1) beside the axial ones, the lowest of each",
        columns=("mode", *(title for title, _ in columns)),
        rows=rows[:_BENDING_TOLD],
    )


def _khz(frequencies: NDArray[np.float64], i: int) -> str:
    return f"{1e-3 * frequencies[i]:.4g}" if i < len(frequencies) else "-"


def _change(percent: float) -> str:
    """With a sign; what is below 0.005 % depends on the step and is not told."""
    if abs(percent) < 0.005:
        return "0.00"
    return f"{percent:+.2f}" if abs(percent) < 1.0 else f"{percent:+.1f}"


def reduction_measured(study: ReductionStudy) -> Iterator[Measured]:
    """Both bodies with their measures."""
    for body in study.bodies:
        yield body.name, body, BODY_MEASURES


def reduction_to_json(study: ReductionStudy) -> dict[str, Any]:
    """Plain numbers in SI, the unit in the key."""
    return {
        "schema": "klack-reduce/1",
        "case": study.case,
        "bodies": {
            body.name: {
                **json_of(BODY_MEASURES, body),
                "frequencies_Hz": [float(f) for f in body.frequencies[body.rigid_count :]],
                "correction": body.correction,
            }
            for body in study.bodies
        },
        "transfer": {
            item.body: {
                "valid_up_to_Hz": {
                    label: float(limit)
                    for label, limit in zip(item.labels, item.valid_up_to, strict=True)
                },
                "tolerance_dB": item.tolerance,
                "loss_factor": item.loss_factor,
            }
            for item in study.transfer
        },
        "one_node": {
            node.body: {
                "node": node.node,
                "place_m": [float(x) for x in node.place],
                "distance_m": node.distance,
                "correction": node.correction,
                "compliance_over_port": node.compliance,
                "valid_up_to_Hz": {
                    label: float(limit)
                    for label, limit in zip(
                        node.transfer.labels, node.transfer.valid_up_to, strict=True
                    )
                },
            }
            for node in study.nodes
        },
        "one_node_impacts": [
            {
                "modes": item.modes,
                "energy_change": item.nodes.energy - 1.0,
                "peak_force_N": item.nodes.peak_force,
                "restitution": item.nodes.restitution,
                "peak_force_of_ports_N": item.ports.peak_force,
                "restitution_of_ports": item.ports.restitution,
                "energy_change_of_ports": item.ports.energy - 1.0,
            }
            for item in study.impacts
        ],
        "bending": {
            item.body: {
                "bending_frequencies_Hz": [float(f) for f in item.bending],
                "axial_frequencies_Hz": [float(f) for f in item.axial],
                "rigid_modes_of_order_1": item.rigid,
            }
            for item in study.bending
        },
    }
