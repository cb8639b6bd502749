"""klack reduce with axisymmetric bodies: bending modes beside the axial ones.

Truth: exact frequencies of a free steel cylinder D4 x L30 mm (tests/data), Timoshenko's cantilever.
"""

import json
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from quoted_output import compare

from klack.analyses.reduction.analysis import REDUCTION, reduction_told
from klack.analyses.reduction.run import run_reduce
from klack.assembling.bending import bending_body
from klack.assembling.bodies import mesh_body
from klack.case import load_case
from klack.cli.main import main
from klack.elasticity.eigen import eigenmodes
from klack.errors import AccuracyWarning
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
    (table,) = (t for t in reduction_told(study) if t.title.startswith("Bending modes (order 1)"))
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
    assert "Bending modes (order 1)" in capsys.readouterr().out
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
