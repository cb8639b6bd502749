"""klack reduce with the node of a body as its output: what is told, drawn, written and refused."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from klack.analyses.reduction.analysis import REDUCTION, reduction_told
from klack.analyses.reduction.one_node import node_chart
from klack.analyses.reduction.run import ReductionStudy, run_reduce
from klack.case import load_case
from klack.cli.main import main
from klack.errors import InputError

RODS = (Path(__file__).parents[1] / "data" / "tiny_rods.yaml").read_text(encoding="utf-8")
TRANSFER = "transfer: {from: 2 kHz, to: 150 kHz, points: 60, nodes: {NODES}}"
SHIFTS = "reduction:\n  shifts: {short: [-30 kHz, 90 kHz]}\n"


def text_of(nodes: str, shifts: str = SHIFTS) -> str:
    return RODS.replace("reduction:\n", shifts).replace(
        "  duration: 20 us\n",
        "  duration: 20 us\n  " + TRANSFER.replace("{NODES}", "{" + nodes + "}") + "\n",
    )


def study_of(folder: Path, nodes: str, shifts: str = SHIFTS) -> ReductionStudy:
    path = folder / "rods.yaml"
    path.write_text(text_of(nodes, shifts), encoding="utf-8")
    return run_reduce(load_case(path))


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return study_of(tmp_path_factory.mktemp("rods"), "short: [0.1 mm, 20 mm], long: [1 mm, 0 mm]")


def test_the_node_next_to_the_place_is_told(study):
    short, long = study.nodes

    assert_allclose(short.place, [0.0, 20e-3], atol=1e-12)
    assert short.distance == pytest.approx(1e-4, rel=1e-9)
    assert_allclose(long.place, [1e-3, 0.0], atol=1e-12)
    assert (short.correction, long.correction) == ("shifted to -30 kHz and 90 kHz", "residual")
    table = next(t for t in reduction_told(study) if t.title.startswith("Displacement of one"))
    assert [row[0] for row in table.rows] == ["short", "long"]
    assert "(0, 20) mm" in table.rows[0][1]
    assert table.rows[0][3] == "100"  # um


def test_the_recipe_is_right_at_the_node_where_modes_alone_are_not(study):
    """50 modes with attachment modes against the full order, and exact at the shift of 90 kHz."""
    for node in study.nodes:
        item = node.transfer
        limits = dict(zip(item.labels, item.valid_up_to, strict=True))
        assert limits["50 modes with correction"] == item.frequencies[-1]
        assert limits["20 modes with correction"] == item.frequencies[-1]
    long = dict(
        zip(study.nodes[1].transfer.labels, study.nodes[1].transfer.valid_up_to, strict=True)
    )
    assert long["20 modes alone"] < 0.5 * 150e3


def test_static_displacement_of_the_far_end_is_that_of_the_rod(study):
    """Free rod: -1/6 of L/EA at the far end against 1/3 at the loaded one, mean over the faces."""
    assert study.nodes[0].compliance == pytest.approx(-0.5, abs=0.02)  # the contact adds locally


def test_one_node_costs_energy_and_the_port_does_not(study):
    for item in study.impacts:
        assert abs(item.ports.energy - 1.0) < 1e-10
        assert abs(item.nodes.energy - 1.0) > 0.01  # the far end moves later


@pytest.mark.slow
def test_json_and_files_say_the_same(tmp_path):
    case = tmp_path / "rods.yaml"
    case.write_text(text_of("short: [2 mm, 0 mm]"), encoding="utf-8")
    out = tmp_path / "out"

    assert main(["reduce", str(case), "--out", str(out), "--json", str(tmp_path / "r.json")]) == 0

    told = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
    assert set(told["one_node"]) == {"short"}
    assert told["one_node"]["short"]["place_m"] == pytest.approx([2e-3, 0.0], abs=1e-12)
    assert [item["modes"] for item in told["one_node_impacts"]] == [20, 50]
    with (out / "short.node.csv").open(newline="") as file:
        head, *rows = csv.reader(file)
    assert head[1] == "|full order at the node| [m/N]"
    assert len(rows) == 60
    for name in ("short.node.svg", "short.transfer.svg", "long.transfer.svg"):
        assert (out / name).read_bytes().startswith(b"<?xml")
    assert not (out / "long.node.svg").exists()


def test_the_chart_names_node_and_correction(study):
    chart = node_chart(study.nodes[0])

    assert "attachment modes shifted to -30 kHz and 90 kHz" in chart.note
    assert "100 um from the place in the case" in chart.note
    assert len(chart.panels[0].curves) == 5
    assert np.all(chart.panels[0].curves[0].y > 0)


def test_without_a_node_nothing_is_added(tmp_path):
    study = study_of(tmp_path, "")

    assert (study.nodes, study.impacts) == ((), ())
    assert REDUCTION.to_json(study)["one_node"] == {}
    assert [t.title[:13] for t in reduction_told(study)] == ["Two short rod", "Bending modes"]


@pytest.mark.parametrize(
    ("nodes", "shifts", "words"),
    [
        ("short: [3 mm, 20 mm]", SHIFTS, ["run.transfer.nodes.short", "1 mm outside"]),
        ("short: [0 mm, 0 mm, 1 mm]", SHIFTS, ["3 coordinates", "[r, z]"]),
        ("shrot: [0 mm, 0 mm]", SHIFTS, ["'shrot'", "did you mean 'short'"]),
        (
            "",
            SHIFTS.replace("short:", "shrot:"),
            ["reduction.shifts.shrot", "did you mean 'short'"],
        ),
        ("", SHIFTS.replace("90 kHz", "-30 kHz"), ["the same shift twice"]),
        ("", SHIFTS.replace("-30 kHz, 90 kHz", ""), ["0 shifts", "1 to 8"]),
        ("", SHIFTS.replace("90 kHz", "90"), ["reduction.shifts.short[1]", "unit"]),
        (
            "short: [0 mm, 0 mm]",
            SHIFTS.replace("90 kHz", "0 Hz"),
            ["its rigid motion", "below zero"],
        ),
    ],
)
def test_bad_nodes_and_shifts_are_refused(tmp_path, nodes, shifts, words):
    with pytest.raises(InputError) as caught:
        study_of(tmp_path, nodes, shifts)
    for word in words:
        assert word in str(caught.value)
