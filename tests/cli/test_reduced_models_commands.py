"""The commands on bodies of other programs, and the guide: truth = what they promise."""

import json
from pathlib import Path

import pytest
from pages import blocks, printed

from klack.case import load_case
from klack.cli.main import main

PAGE = (Path(__file__).parents[2] / "docs/how-to/bring-a-reduced-model.md").read_text()
CASE = Path(__file__).parents[2] / "cases/from-other-tools/case.yaml"


@pytest.mark.slow
def test_impact_and_reduce_of_the_shipped_case(capsys):
    assert main(["impact", "from-other-tools", "--json", "numbers.json", "--quiet"]) == 0
    numbers = json.loads(Path("numbers.json").read_text())["levels"]
    assert numbers["reduced"]["restitution"] == pytest.approx(0.5, abs=0.005)
    folder = Path("klack-results/from-other-tools")
    assert {"result.zarr", "report.html", "report.pdf"} <= {p.name for p in folder.iterdir()}
    page = (folder / "report.html").read_text()
    assert "state space in needle.csv" in page
    assert "modal data in seat.uff" in page
    assert main(["reduce", "from-other-tools", "--json", "bodies.json"]) == 0
    assert "98.5" in capsys.readouterr().out
    bodies = json.loads(Path("bodies.json").read_text())["bodies"]
    assert bodies["needle"]["mass_kg"] == pytest.approx(3.9458e-3, rel=1e-4)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (["impact", "from-other-tools", "--level", "full"], "levels among: lumped, reduced"),
        (["shots", "from-other-tools"], "shots"),
        (["export", "from-other-tools", "--to", "calculix"], "meshed surfaces"),
    ],
)
def test_what_needs_a_mesh_ends_with_a_message(capsys, command, words):
    assert main(command) == 2
    error = capsys.readouterr().err
    assert "Traceback" not in error
    assert words in error


@pytest.mark.slow
def test_noise_knows_the_force_alone(capsys):
    assert main(["noise", "from-other-tools"]) == 0
    assert "only the spectra of the force are known" in capsys.readouterr().out


def test_example_of_the_guide_prints_what_it_says():
    assert printed(blocks(PAGE, "python")[0], "guide") == blocks(PAGE, "text")[0]


def test_case_of_the_guide_can_be_read(tmp_path):
    text = blocks(PAGE, "yaml")[0]
    for name in ("needle.mat", "seat.uff"):
        (tmp_path / name).write_text("")
    (tmp_path / "case.yaml").write_text(
        f"klack: 1\ntitle: guide\n{text}motion: {{speed: 1 m/s}}\nlumped: {{stiffness: 1e9 N/m}}\n"
    )
    case = load_case(tmp_path / "case.yaml")
    assert case.bodies["seat"].reduced.ports["face"].input == "11 12 13 z"
