"""klack inspect through main(argv); truth: the drawing of the shipped needle."""

from pathlib import Path

from klack.case import find_case
from klack.cli.main import main

NEEDLE = find_case("needle-from-inp").parent / "needle.inp"


def test_a_mesh_shows_its_sets_and_where_they_lie(capsys):
    assert main(["inspect", str(NEEDLE), "--unit", "mm"]) == 0

    shown = " ".join(capsys.readouterr().out.split())
    assert "7670 nodes, 4741 elements" in shown
    assert "extent z 0 to 24 mm" in shown  # length of the drawn needle
    assert "surface top 82 faces, z 24 mm, r" in shown


def test_a_mesh_without_unit_is_refused(capsys):
    assert main(["inspect", str(NEEDLE)]) == 2
    assert "unit" in capsys.readouterr().err


def test_other_files_are_refused_with_what_is_read(tmp_path: Path, capsys):
    (tmp_path / "notes.txt").write_text("hello")

    assert main(["inspect", str(tmp_path / "notes.txt")]) == 2
    assert ".inp" in capsys.readouterr().err
