"""A reduction in words and numbers."""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from klack.analyses.analysis import Analysis, Measured
from klack.analyses.impact.transfer import TRANSFER_COUNTS
from klack.analyses.json_parts import JsonForm, Key, by_name, measured_keys, schema_key
from klack.analyses.measures import Column, Measure, described_in, text_table
from klack.analyses.reduction.one_node import corrected_label, place_words
from klack.analyses.reduction.run import ReductionStudy
from klack.bodies.reduction.reduced_body import ReducedBody, elastic_count
from klack.bodies.reduction.transfer import TransferComparison
from klack.terminal.tables import TextTable

__all__ = ["BODY_MEASURES", "REDUCTION", "reduction_told"]

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
        definition="Mass of the body; missing where a reduced model does not state it.",
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
        definition="Kept rigid motions.",
        read=lambda body: body.rigid_count,
        kind="whole",
    ),
    Measure(
        key="elastic_modes",
        name="modes",
        symbol="n_e",
        definition="Kept elastic eigenmodes, without attachment modes.",
        read=elastic_count,
        kind="whole",
        column=Column("", 1.0, "d"),
    ),
    Measure(
        key="highest_mode",
        symbol="f_max",
        unit="Hz",
        definition="Highest frequency of the kept modes except attachment modes; 0 without any.",
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
        definition="Static compliance carried by the kept modes.",
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


def _limits(item: TransferComparison) -> dict[str, float]:
    """Frequency [Hz] up to which each kind of reduction is valid."""
    return dict(zip(item.labels, item.valid_up_to, strict=True))


_BODY = JsonForm(
    "ReducedBodyJson",
    "A body after reduction.",
    *measured_keys(BODY_MEASURES),
    Key(
        "frequencies_Hz",
        list[float],
        "Of the elastic modes, attachment modes included.",
        lambda body: body.frequencies[body.rigid_count :],
    ),
    Key("correction", str),
)
_TRANSFER = JsonForm(
    "TransferJson",
    "Transfer functions of a body.",
    Key("valid_up_to_Hz", dict[str, float], "By the kind of reduction.", _limits),
    Key("tolerance_dB", float, of="tolerance"),
    Key("loss_factor", float),
)
_ONE_NODE = JsonForm(
    "OneNodeJson",
    "A node of a body as its output, in addition to the contact port.",
    Key("node", int, "In the mesh, from 0."),
    Key("place_m", list[float], "Of the node, in the drawing.", "place"),
    Key("distance_m", float, "Distance from the position requested in the case.", "distance"),
    Key("correction", str, "Attachment modes of the recipe, in words."),
    Key(
        "compliance_over_port",
        float,
        "Static displacement of the node over that of the port.",
        "compliance",
    ),
    Key(
        "valid_up_to_Hz",
        dict[str, float],
        "By the kind of reduction.",
        lambda node: _limits(node.transfer),
    ),
)
_ONE_NODE_IMPACT = JsonForm(
    "OneNodeImpactJson",
    "The impact of the recipe with its gap between nodes.",
    Key("modes", int, "Kept elastic modes of each body."),
    Key(
        "energy_change",
        float,
        "Share of the impact energy created by the one-node outputs.",
        lambda item: item.nodes.energy - 1.0,
    ),
    Key("peak_force_N", float, of="nodes.peak_force"),
    Key("restitution", float, of="nodes.restitution"),
    Key("peak_force_of_ports_N", float, "Numbers with the gap at the ports.", "ports.peak_force"),
    Key("restitution_of_ports", float, of="ports.restitution"),
    Key("energy_change_of_ports", float, "Round-off.", lambda item: item.ports.energy - 1.0),
)
_BENDING = JsonForm(
    "BendingJson",
    "Lowest bending and axial modes of an axisymmetric body.",
    Key(
        "bending_frequencies_Hz",
        list[float],
        "Frequencies of Fourier order 1; each stands for two modes, in perpendicular directions.",
        "bending",
    ),
    Key(
        "axial_frequencies_Hz",
        list[float],
        "Frequencies of order 0 without torsion, the same number.",
        "axial",
    ),
    Key(
        "rigid_modes_of_order_1",
        int,
        "2 for a free body, shift and rotation; 0 for a held body.",
        "rigid",
    ),
)
_STUDY = JsonForm(
    "ReductionJson",
    "``klack reduce``.",
    schema_key("klack-reduce/1"),
    Key("case", str),
    Key("bodies", {str: _BODY}, "By name.", by_name("bodies")),
    Key("transfer", {str: _TRANSFER}, "By body.", lambda study: _by_body(study.transfer)),
    Key(
        "one_node",
        {str: _ONE_NODE},
        "By body, for bodies with run.transfer.nodes.",
        lambda study: _by_body(study.nodes),
    ),
    Key(
        "one_node_impacts",
        [_ONE_NODE_IMPACT],
        "With 20 and 50 modes, where there is a node.",
        "impacts",
    ),
    Key(
        "bending",
        {str: _BENDING},
        "By body; of axisymmetric bodies meshed here.",
        lambda study: _by_body(study.bending),
    ),
)


def _by_body(items: Iterable[Any]) -> dict[str, Any]:
    return {item.body: item for item in items}


def reduction_told(study: ReductionStudy) -> Iterator[TextTable]:
    """What a terminal shows: both bodies."""
    yield text_table(study.title, "body", BODY_MEASURES, ((b.name, b) for b in study.bodies))
    if study.nodes:
        yield _nodes_told(study)
        yield _impacts_told(study)
    if study.bending:
        yield _bending_told(study)


def _nodes_told(study: ReductionStudy) -> TextTable:
    """Nodes as outputs, and how high the recipe is valid there."""
    rows = []
    for node in study.nodes:
        limits = _limits(node.transfer)
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
    """Energy that nodes add or take in place of the contact."""
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
        title="Impact with the gap taken between these nodes",
        columns=("output", "peak force [N]", "restitution", "energy change [%]"),
        rows=rows,
    )


def _bending_told(study: ReductionStudy) -> TextTable:
    """Lowest modes of order 1 and axial ones; a dash where there are no more."""
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
        title="Lowest bending modes (order 1) and axial modes",
        columns=("mode", *(title for title, _ in columns)),
        rows=rows[:_BENDING_TOLD],
    )


def _khz(frequencies: NDArray[np.float64], i: int) -> str:
    return f"{1e-3 * frequencies[i]:.4g}" if i < len(frequencies) else "-"


def _change(percent: float) -> str:
    """With a sign; below 0.005 % it depends on the step."""
    if abs(percent) < 0.005:
        return "0.00"
    return f"{percent:+.2f}" if abs(percent) < 1.0 else f"{percent:+.1f}"


def _measured(study: ReductionStudy) -> Iterator[Measured]:
    for body in study.bodies:
        yield body.name, body, BODY_MEASURES


REDUCTION = Analysis(
    json=_STUDY.type,
    to_json=_STUDY.json,
    told=reduction_told,
    measures={"reduced body": BODY_MEASURES},
    measured=_measured,
)
