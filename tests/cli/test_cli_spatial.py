"""Commands that know a motion along the axis only; truth: one clear error, and nothing built."""

from pathlib import Path

import pytest

from klack.cli.main import main

CASE = Path(__file__).parents[2] / "docs" / "how-to" / "stroke_off_axis.yaml"
STROKES = Path(__file__).parents[2] / "cases" / "measured" / "strokes_synthetic.csv"
FITTED = (
    "calibration: {parameters: {preload: {key: network.components.spring.preload, "
    "lower: 8 N, upper: 16 N}}}\n"
)
POLISHED = (
    "study:\n  parameters: {network.components.spring.preload: {from: 8 N, to: 16 N}}\n"
    "  measures: [opening_time]\n  objectives: {opening_time: minimise}\n"
    "  search: {polish: 4}\n"
)


@pytest.mark.parametrize(
    ("command", "added"),
    [
        (["advise"], ""),
        (["sensitivities", "--parameter", "network.components.spring.preload"], ""),
        (["calibrate", "--measurement", str(STROKES)], FITTED),
        (["optimise"], POLISHED),
        *((["export", "--to", to], "") for to in ("fmu", "mat", "csv", "modelica")),
    ],
)
def test_what_knows_the_axis_only_says_so(command, added, tmp_path, capsys):
    case = tmp_path / "valve.yaml"
    case.write_text(CASE.read_text(encoding="utf-8") + added, encoding="utf-8")

    code = main([command[0], str(case), *command[1:], "--quiet"])

    told = capsys.readouterr().err
    assert code == 2
    assert "three-dimensional" in told or "three dimensions" in told
    assert "Try:" in told
    assert sorted(path.name for path in tmp_path.iterdir()) == ["valve.yaml"]


def test_an_impact_to_show_is_one_of_a_result(tmp_path, capsys):
    code = main(["export", str(CASE), "--to", "vtk", "--impact", "1", "--quiet"])

    assert code == 2
    assert "the folder of a stored stroke in three dimensions" in capsys.readouterr().err
    assert main(["export", str(CASE), "--to", "csv", "--impact", "1", "--quiet"]) == 2
    assert "--impact" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
