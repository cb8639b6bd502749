"""klack reduce: bending modes, and the node of a body as its output.

klack reduce with axisymmetric bodies: bending modes beside the axial ones.

Truth: exact frequencies of a free steel cylinder D4 x L30 mm (tests/data), Timoshenko's cantilever.

klack reduce with the node of a body as its output: what is told, drawn, written and refused.
"""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from quoted_output import compare

from klack.analyses.reduction.analysis import REDUCTION, reduction_told
from klack.analyses.reduction.one_node import node_chart
from klack.analyses.reduction.run import ReductionStudy, run_reduce
from klack.assembling.bending import bending_body
from klack.assembling.bodies import mesh_body
from klack.bodies.elasticity.eigen import eigenmodes
from klack.case import load_case
from klack.cli.main import main
from klack.errors import AccuracyWarning, InputError
from klack.mesh.mesh import Mesh
from klack.terminal.tables import TextTable
from klack.verification.lattice import lattice_mesh

RODS = (Path(__file__).parents[1] / "data" / "tiny_rods.yaml").read_text(encoding="utf-8")
LONG_30 = RODS.replace("-40]", "-30]")
EXACT = {"bending": [19587.12, 50362.64, 90819.01], "axial": [86117.56, 171706.49, 256161.95]}
HELD = LONG_30.replace(
    "    material: steel\n    mesh: {size: 1 mm}\ncontact:",
    "    material: steel\n    mesh: {size: 1 mm}\n    fixed: [{surface: far}]\ncontact:",
)


def study_of(folder: Path, text: str):
    path = folder / "rods.yaml"
    path.write_text(text, encoding="utf-8")
    return run_reduce(load_case(path))


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return study_of(tmp_path_factory.mktemp("rods"), LONG_30)


def bending_table(study) -> TextTable:
    (table,) = (
        t for t in reduction_told(study) if t.title.startswith("Lowest bending modes (order 1)")
    )
    return table


def test_frequencies_are_those_of_exact_elasticity(study):
    """Elements of 1 mm; their error grows with the fourth power of the wave number."""
    short, long = study.bending
    assert (short.body, long.body) == ("short", "long")
    assert (len(short.bending), len(long.bending)) == (5, 8)  # as many as the case keeps
    assert (len(short.axial), len(long.axial)) == (5, 8)
    np.testing.assert_allclose(long.bending[:3], EXACT["bending"], rtol=2e-4)
    np.testing.assert_allclose(long.axial[:3], EXACT["axial"], rtol=2e-4)
    assert short.bending[0] > 1.5 * long.bending[0]
    assert (short.rigid, long.rigid) == (2, 2)


@pytest.mark.slow
def test_a_held_rod_bends_as_a_cantilever(tmp_path):
    """Timoshenko lowers 1.8751^2 of Euler-Bernoulli by 2 % at length over diameter 7.5."""
    _, long = study_of(tmp_path, HELD).bending
    radius, length = 2e-3, 30e-3
    beam = np.sqrt(210e9 * radius**2 / 4 / 7850) / length**2 / (2 * np.pi) * 1.8751**2
    assert long.rigid == 0
    assert 0.96 < long.bending[0] / beam < 1.0


def test_table_stands_beside_the_axial_modes(study):
    table = bending_table(study)
    assert list(table.columns) == [
        "mode",
        "short bending [kHz]",
        "short axial [kHz]",
        "long bending [kHz]",
        "long axial [kHz]",
    ]
    assert len(table.rows) == 8
    assert table.rows[0][3:] == ("19.59", "86.12")
    assert table.rows[5][1:3] == ("-", "-")  # the short rod keeps five


def test_json_has_every_frequency(tmp_path, study):
    parts = REDUCTION.to_json(study)["bending"]
    assert parts["long"]["bending_frequencies_Hz"] == [float(f) for f in study.bending[1].bending]
    assert parts["long"]["axial_frequencies_Hz"][0] == pytest.approx(86117.56, rel=1e-4)
    assert parts["short"]["rigid_modes_of_order_1"] == 2


@pytest.mark.slow
def test_command_prints_and_writes_them(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("rods.yaml").write_text(LONG_30, encoding="utf-8")
    assert main(["reduce", "rods.yaml", "--json", "rods.json"]) == 0
    assert "Lowest bending modes (order 1)" in capsys.readouterr().out
    written = json.loads(Path("rods.json").read_text())
    assert written["bending"]["long"]["bending_frequencies_Hz"][0] == pytest.approx(19587, rel=1e-3)


def test_solids_have_no_table_of_their_own(tmp_path):
    """Their bending modes are among their modes already."""
    path = tmp_path / "rods.yaml"
    path.write_text(LONG_30, encoding="utf-8")
    case = load_case(path)
    mesh = mesh_body(case.bodies["long"], "long", ())
    assert bending_body(case, "long", mesh) is not None
    solid = replace(mesh, points=np.column_stack([mesh.points, 0 * mesh.points[:, 0]]))
    assert bending_body(case, "long", solid) is None


def test_matrices_of_another_program_have_no_bending(tmp_path):
    given = SimpleNamespace(bodies={"long": SimpleNamespace(matrices="K and M")})
    mesh = Mesh(points=np.zeros((4, 2)), blocks=())
    assert bending_body(given, "long", mesh) is None  # type: ignore[arg-type]


@pytest.mark.parametrize(("family", "least"), [("tri3", 0.08), ("quad4", 0.02)])
def test_linear_elements_lock_and_are_told_of(tmp_path, family, least):
    """Two across the radius of a bar: too high by 9 % and 2 %, against exact elasticity."""
    path = tmp_path / "rods.yaml"
    path.write_text(LONG_30, encoding="utf-8")
    mesh = lattice_mesh(family, [np.linspace(0, 2e-3, 3), np.linspace(0, 30e-3, 31)], solid="long")
    with pytest.warns(AccuracyWarning, match=rf"'long' are too high: .* \({family}\)"):
        body = bending_body(load_case(path), "long", replace(mesh, surfaces={}))
    deviation = eigenmodes(body, count=1).frequency[0] / EXACT["bending"][0] - 1
    assert least < deviation < 0.1


@pytest.mark.slow
def test_page_of_the_theory_prints_what_it_quotes(tmp_path, monkeypatch, capsys):
    """The example in Python, and the table of the shipped valve."""
    text = (Path(__file__).parents[2] / "docs" / "theory" / "elasticity.md").read_text("utf-8")
    section = text.split("## Bending of bodies of revolution")[1].split("\n## ")[0]
    code = re.search(r"```python\n(.*?)```", section, re.DOTALL)
    quoted = re.search(r"```console\n\$ klack (.*?)\n(.*?)```", section, re.DOTALL)
    assert code is not None
    assert quoted is not None
    exec(compile(code[1], "elasticity.md", "exec"), {})
    frequencies, moved = capsys.readouterr().out.splitlines()
    assert f"# {frequencies}" in code[1]
    assert f"# {moved}" in code[1]
    monkeypatch.chdir(tmp_path)
    assert main(quoted[1].split()) == 0
    compare(quoted[2], capsys.readouterr().out, "elasticity.md")


TRANSFER = "transfer: {from: 2 kHz, to: 150 kHz, points: 60, nodes: {NODES}}"
SHIFTS = "reduction:\n  shifts: {short: [-30 kHz, 90 kHz]}\n"


def text_of(nodes: str, shifts: str = SHIFTS) -> str:
    return RODS.replace("reduction:\n", shifts).replace(
        "  duration: 20 us\n",
        "  duration: 20 us\n  " + TRANSFER.replace("{NODES}", "{" + nodes + "}") + "\n",
    )


def study_of_node(folder: Path, nodes: str, shifts: str = SHIFTS) -> ReductionStudy:
    path = folder / "rods.yaml"
    path.write_text(text_of(nodes, shifts), encoding="utf-8")
    return run_reduce(load_case(path))


@pytest.fixture(scope="module")
def study_node(tmp_path_factory):
    return study_of_node(
        tmp_path_factory.mktemp("rods"), "short: [0.1 mm, 20 mm], long: [1 mm, 0 mm]"
    )


def test_the_node_next_to_the_place_is_told(study_node):
    short, long = study_node.nodes

    assert_allclose(short.place, [0.0, 20e-3], atol=1e-12)
    assert short.distance == pytest.approx(1e-4, rel=1e-9)
    assert_allclose(long.place, [1e-3, 0.0], atol=1e-12)
    assert (short.correction, long.correction) == ("shifted to -30 kHz and 90 kHz", "residual")
    table = next(t for t in reduction_told(study_node) if t.title.startswith("Displacement of one"))
    assert [row[0] for row in table.rows] == ["short", "long"]
    assert "(0, 20) mm" in table.rows[0][1]
    assert table.rows[0][3] == "100"  # um


def test_the_recipe_is_right_at_the_node_where_modes_alone_are_not(study_node):
    """50 modes with attachment modes against the full order, and exact at the shift of 90 kHz."""
    for node in study_node.nodes:
        item = node.transfer
        limits = dict(zip(item.labels, item.valid_up_to, strict=True))
        assert limits["50 modes with correction"] == item.frequencies[-1]
        assert limits["20 modes with correction"] == item.frequencies[-1]
    long = dict(
        zip(
            study_node.nodes[1].transfer.labels,
            study_node.nodes[1].transfer.valid_up_to,
            strict=True,
        )
    )
    assert long["only 20 modes"] < 0.5 * 150e3


def test_static_displacement_of_the_far_end_is_that_of_the_rod(study_node):
    """Free rod: -1/6 of L/EA at the far end against 1/3 at the loaded one, mean over the faces."""
    assert study_node.nodes[0].compliance == pytest.approx(
        -0.5, abs=0.02
    )  # the contact adds locally


def test_one_node_costs_energy_and_the_port_does_not(study_node):
    for item in study_node.impacts:
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


def test_the_chart_names_node_and_correction(study_node):
    chart = node_chart(study_node.nodes[0])

    assert "attachment modes shifted to -30 kHz and 90 kHz" in chart.note
    assert "100 um from the position in the case" in chart.note
    assert len(chart.panels[0].curves) == 5
    assert np.all(chart.panels[0].curves[0].y > 0)


def test_without_a_node_nothing_is_added(tmp_path):
    study = study_of_node(tmp_path, "")

    assert (study.nodes, study.impacts) == ((), ())
    assert REDUCTION.to_json(study)["one_node"] == {}
    assert [t.title[:13] for t in reduction_told(study)] == ["Two short rod", "Lowest bendin"]


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
        study_of_node(tmp_path, nodes, shifts)
    for word in words:
        assert word in str(caught.value)
