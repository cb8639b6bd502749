"""``klack advise`` where bodies come from STEP files, or from meshes that are given (interface).

What is measured is told from what is not: sizes of solids are made coarser and finer around the
case, a mesh that was given is left alone and its error is in no sum.
"""

import json
from pathlib import Path

import pytest

from klack.case import load_case
from klack.cli.main import main

pytestmark = pytest.mark.slow

PLUNGER = Path(__file__).parents[2] / "docs/tutorials/files/plunger.inp"

HEAD = """\
klack: 1
title: Parts of another program
materials:
  steel: {young: 210 GPa, poisson: 0.3, density: 7850 kg/m^3}
"""

GIVEN = f"""{HEAD}
bodies:
  plunger:
    geometry: {{model: axisymmetric, mesh: {{file: {PLUNGER}, unit: mm}}}}
    material: {{PLUNGER: steel}}
  ring:
    geometry: {{model: axisymmetric, mesh: {{file: {PLUNGER}, unit: mm}}}}
    material: {{RING: steel}}
    fixed: [{{surface: FOOT}}]
contact: {{between: [plunger.LAND, ring.STOP], gap: 0 um}}
motion: {{speed: 0.4 m/s}}
reduction: {{modes: {{plunger: {{count: 4}}, ring: {{count: 4}}}}}}
run: {{duration: 40 us, levels: [reduced]}}
"""

SOLIDS = f"""{HEAD}
bodies:
  pin:
    geometry: {{step: {{file: pin.step}}}}
    material: steel
    mesh: {{size: 0.6 mm, grading: 0.8, contact: {{size: 0.12 mm, extent: 0.1 mm}}}}
  plate:
    geometry: {{step: {{file: plate.step}}}}
    material: steel
    mesh: {{size: 0.7 mm, grading: 0.8, contact: {{size: 0.12 mm, extent: 0.1 mm}}}}
    fixed: [{{surface: foot}}]
contact: {{between: [pin.tip, plate.seat], gap: 0 um}}
motion: {{speed: 0.5 m/s}}
reduction: {{modes: {{pin: {{count: 2}}, plate: {{count: 2}}}}}}
run: {{duration: 15 us, levels: [reduced], reduced_step: 50 ns, interface_step: 50 ns}}
"""


def advised(path: Path, *options: str) -> dict:
    new, numbers = path.with_name("new.yaml"), path.with_name("advice.json")
    assert main(["advise", str(path), *options, "--write", str(new), "--json", str(numbers)]) == 0
    load_case(new)
    return json.loads(numbers.read_text())


def flat(text: str) -> str:
    return " ".join(text.split())


@pytest.mark.slow
def test_given_meshes_are_left_alone_and_said_to_be(tmp_path, capsys):
    path = tmp_path / "case.yaml"
    path.write_text(GIVEN)

    told = advised(path, "--up-to", "200 kHz", "--error", "5 %", "--bands", "3 dB")

    said = flat(capsys.readouterr().out)
    assert told["meshes_given"] == ["plunger", "ring"]
    assert {item["kind"] for item in told["settings"]} == {"modes", "step"}
    assert all(not key.startswith("bodies.") for key in told["changes"])
    assert "Only modes and step can be advised here." in said
    assert "sum, without the mesh of plunger, ring" in said
    assert "Meshes of 'plunger' and 'ring' are given" in said
    assert "half widths long: fine enough." in said
    assert "on the same meshes" in said  # the run again
    assert "finest meshes" not in said
    assert (
        told["run_again"]["now"]["force_history"]
        <= 1.5 * (told["expected_error"]["now"]["force_history"])
    )


@pytest.mark.slow
def test_solids_from_step_are_refined_around_the_case(tmp_path, capsys):
    """Convergence: advice brings a case that is far too coarse nearer to the finest run."""
    from netgen.occ import Box, Pnt, Sphere, Z

    dome = Sphere(Pnt(0, 0, 3), 3)
    dome.faces.name = "tip"
    (Box(Pnt(-0.7, -0.7, -1), Pnt(0.7, 0.7, 3)) * dome).WriteStep("pin.step")
    plate = Box(Pnt(-1, -1, -1), Pnt(1, 1, 0))
    plate.faces.Max(Z).name = "seat"
    plate.faces.Min(Z).name = "foot"
    plate.WriteStep("plate.step")
    path = tmp_path / "case.yaml"
    path.write_text(SOLIDS)

    told = advised(path, "--error", "5 %", "--bands", "5 dB")

    said = flat(capsys.readouterr().out)
    meshes = {item["name"]: item for item in told["settings"] if item["kind"] == "mesh"}
    for name in ("pin", "plate"):
        run = meshes[f"{name}, away from the contact"]["factors_run"]
        assert run == pytest.approx([1.5, 1.0, 2 / 3])
    # a grading of 0.8 cannot be 1.5 times as coarse: two levels, an assumed order, said so
    growth = meshes["growth in pin and plate"]
    assert growth["factors_run"] == pytest.approx([1.0, 2 / 3])
    assert not growth["order_measured"]
    assert min(meshes["contact of pin and plate"]["factors_run"]) == pytest.approx(2 / 3)
    assert told["meshes_given"] == []
    assert "they were coarsened" not in said
    again, expected = told["run_again"]["now"], told["expected_error"]["now"]
    assert 0 < again["force_history"] <= expected["force_history"]
    assert told["run_again"]["advised"]["force_history"] < again["force_history"]
