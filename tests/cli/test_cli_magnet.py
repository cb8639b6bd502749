"""``klack magnet``: a map from a drawing, mistakes in drawings, and a stroke with the map."""

import json
import sys

import numpy as np
import pytest
from draws import each
from json_schema_check import require_documented
from pages import HOW_TO

import klack
from klack.analyses.magnet.analysis import MAGNET
from klack.analyses.magnet.case import load_magnet_case
from klack.cli.main import main

POT = """\
klack: 1
title: A small pot magnet
magnet:
  unit: mm
  iron: X6Cr17
  fixed:
    pot: {corners: [[0, 0], [3, 0], [3, 9], [6, 9], [6, 0], [7, 0], [7, 11], [0, 11]]}
  moving:
    plate: {corners: [[0, -3], [7, 0]]}
  coil: {corners: [[3, 1.5], [6, 9]], turns: 60}
  opens: downward
  current: [1 A, 2 A, 3 A, 4 A, 6 A, 8 A]
  gap: [20 um, 40 um, 60 um, 90 um, 130 um]
"""


@pytest.fixture
def pot(tmp_path):
    path = tmp_path / "pot.yaml"
    path.write_text(POT, encoding="utf-8")
    return path


@pytest.mark.slow
def test_a_map_and_a_stroke_with_it(pot, tmp_path, capsys):
    pytest.importorskip("ngsolve")
    gaps = "[0.1 mm, 0.13 mm, 0.17 mm, 0.22 mm]"
    text = POT.replace("[20 um, 40 um, 60 um, 90 um, 130 um]", gaps)
    text = text.replace("[1 A, 2 A, 3 A, 4 A, 6 A, 8 A]", "[1 A, 2 A, 3.5 A, 5.5 A, 8 A]")
    pot.write_text(text, encoding="utf-8")
    assert main(["magnet", str(pot), "--json", "pot.json"]) == 0

    said = capsys.readouterr().out
    assert "virtual work" in said
    folder = tmp_path / "klack-results" / "pot"
    assert {"map.csv", "magnet-map.png", "report.html", "report.pdf"} <= {
        path.name for path in folder.iterdir()
    }
    numbers = json.loads((tmp_path / "pot.json").read_text())
    require_documented(numbers)
    force = np.array(numbers["force_N"])
    assert force.shape == (5, 4)
    # forces: pull, more of it with the current and at a narrow gap; map and coenergy agree
    assert np.all(force < 0.0)
    assert np.all(np.diff(force, axis=0) < 0.0)
    assert np.all(np.diff(force, axis=1) > 0.0)
    assert numbers["virtual_work"] < 0.05
    assert numbers["force_error_of_mesh"] + numbers["force_error_of_air"] < 0.02
    record = klack.load_result(folder).record
    assert np.array_equal(record.force, force)
    titles = [section.title for section in MAGNET.content(record).sections]
    assert titles == ["Drawing", "Map", "At 8.000\N{NO-BREAK SPACE}A", "Computing time"]

    valve = (HOW_TO / "magnet_from_a_map.yaml").read_text(encoding="utf-8")
    valve = valve.replace("gap: 120 um", "gap: 220 um").replace("12 N}", "6 N}")
    given = "{file: magnet_map.csv, linkage_factor: 2, force_factor: 2, force_closing: positive}"
    assert given in valve
    (folder / "valve.yaml").write_text(valve.replace(given, "{file: map.csv}"), encoding="utf-8")
    assert main(["stroke", str(folder / "valve.yaml"), "--json", "stroke.json", "--no-report"]) == 0

    stroke = json.loads((tmp_path / "stroke.json").read_text())["variants"]["dry"]
    assert "force map" not in capsys.readouterr().out  # no doubt about force and linkage
    assert stroke["events"][0]["stop"] == "opening"  # pulled open against the spring
    assert abs(stroke["energy_residual"]) < 1e-9


def _mistake(old: str, new: str, *words: str) -> tuple[str, str, tuple[str, ...]]:
    return old, new, words


MISTAKES = (
    _mistake("[[3, 1.5], [6, 9]]", "[[3, 1.5], [6.5, 9]]", "a coil that overlaps 'pot'"),
    _mistake("[[3, 1.5], [6, 9]]", "[[3, -1], [6, 9]]", "'plate' that touches 'coil'"),
    _mistake("[[0, -3], [7, 0]]", "[[0, -3], [7, 1]]", "gap[0]", "'plate' that touches 'pot'"),
    _mistake("[20 um,", "[0 um, 20 um,", "gap[0]", "'plate' that touches 'pot'"),
    _mistake("[20 um,", "[2 um, 20 um,", "gap[0]", "2 um of air between 'plate' and 'pot'"),
    _mistake("[20 um,", "[60 um, 20 um,", "gap[1]", "20 um after 60 um"),
    _mistake("[1 A,", "[0 A, 0 A,", "current[1]", "0 A after 0 A"),
    _mistake("[1 A,", "[-1 A,", "current[0]", "-1 A"),
    _mistake("[1 A, 2 A, 3 A, 4 A, 6 A, 8 A]", "[0 A]", "current"),
    _mistake("turns: 60", "turns: 0", "coil.turns"),
    _mistake("[7, 0]]", "[-7, 0]]", "moving.plate.corners", "r >= 0"),
    _mistake("[7, 0], [7, 11]", "[7, 11], [7, 0]", "fixed.pot.corners", "a common point"),
    _mistake("unit: mm", "unit: mm\n  mesh_size: 0.1 mm", "a mesh of 100 um for 20 um of air"),
    _mistake(
        "iron: X6Cr17",
        "iron: {table: {flux_density: [1 T, 1.5 T], field_strength: [900 A/m, 800 A/m]}}",
        "iron.table",
        "both increasing",
    ),
    _mistake("corners: [[0, -3], [7, 0]]", "corners: [[0, -3]]", "moving.plate.corners"),
    _mistake("magnet:\n", "network: {}\nmagnet:\n", "unknown key 'network'"),
)


@each("mistake", MISTAKES)
def test_one_error_with_its_place(mistake, tmp_path, capsys):
    old, new, words = mistake
    assert old in POT
    path = tmp_path / "pot.yaml"
    path.write_text(POT.replace(old, new), encoding="utf-8")

    assert main(["magnet", str(path), "--out", str(tmp_path / "none")]) == 2

    said = capsys.readouterr().err
    assert said.count("Try:") == 1
    assert "pot.yaml:" in said
    for word in words:
        assert word in said, said
    assert not (tmp_path / "none").exists()


def test_kinds_of_cases_are_told_apart(pot, capsys):
    assert main(["magnet", "demo-stroke"]) == 2
    assert "run it with klack stroke" in capsys.readouterr().err
    assert main(["magnet", "demo-valve"]) == 2
    assert "run it with klack impact" in capsys.readouterr().err
    for command in ("impact", "stroke", "show"):
        assert main([command, str(pot)]) == 2
        assert "run it with klack magnet" in capsys.readouterr().err


def test_without_ngsolve(pot, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "ngsolve", None)

    assert main(["magnet", str(pot)]) == 2

    assert "--extra ngsolve" in capsys.readouterr().err


def test_a_drawing_with_the_gap_open_and_irons_of_their_own(pot):
    text = POT.replace("[[0, -3], [7, 0]]", "[[0, -3.1], [7, -0.1]], iron: DC01")
    pot.write_text(text.replace("opens: downward", "opens: downward\n  drawn_gap: 0.1 mm"))

    magnet = load_magnet_case(pot).magnet.magnet

    assert magnet.clearance(20e-6)[0] == pytest.approx(20e-6, rel=1e-6)
    assert magnet.moving[0].iron is not magnet.fixed[0].iron


@pytest.mark.slow
def test_doubts_and_a_gap_that_opens_the_other_way(pot, capsys, tmp_path):
    pytest.importorskip("ngsolve")
    few = POT.replace("[20 um, 40 um, 60 um, 90 um, 130 um]", "[0.1 mm, 0.2 mm, 0.3 mm]")
    few = few.replace("[1 A, 2 A, 3 A, 4 A, 6 A, 8 A]", "[4 A, 8 A]")
    table = "{table: {flux_density: [0.4 T, 0.8 T], field_strength: [200 A/m, 500 A/m]}}"
    pot.write_text(few.replace("iron: X6Cr17", f"iron: {table}"), encoding="utf-8")
    assert main(["magnet", str(pot), "--no-report"]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "beyond the last measured point" in said
    # two currents on the knee: linkages give another force than the fields, and that is told
    assert "a stroke derives the force from the linkages" in said
    assert "Try: more currents there, or more gaps." in said

    # iron far away, whose force is that of the mesh
    far = few.replace("[[0, -3], [7, 0]]", "[[0, -703], [7, -700]]")
    pot.write_text(far, encoding="utf-8")
    assert main(["magnet", str(pot), "--no-report"]) == 2
    assert "no more than its error" in capsys.readouterr().err

    # the plate as drawn far below the pot, and said to rise as its gap opens
    wrong = few.replace("[[0, -3], [7, 0]]", "[[0, -4], [7, -1]]")
    pot.write_text(wrong.replace("opens: downward", "opens: upward"), encoding="utf-8")
    assert main(["magnet", str(pot), "--no-report"]) == 2
    assert "opens: downward" in capsys.readouterr().err
