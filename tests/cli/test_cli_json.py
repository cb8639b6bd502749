"""Every command knows --json; truth: the schema that klack schema --kind result prints."""

import json
from pathlib import Path

import pytest
from json_schema_check import require_documented

from klack.cli.commands import COMMANDS
from klack.cli.main import main

DATA = Path(__file__).parents[1] / "data"
RODS = DATA / "tiny_rods.yaml"
VALVE = Path(__file__).parents[2] / "docs" / "how-to" / "small_valve.yaml"


def said(capsys: pytest.CaptureFixture[str], *words: object) -> dict:
    """JSON of a command on the terminal: nothing else may stand there."""
    assert main([*map(str, words), "--json", "-"]) == 0
    found = json.loads(capsys.readouterr().out)
    require_documented(found)
    return found


def test_every_command_takes_it(capsys):
    for command in COMMANDS:
        if command.__name__ == "app":  # a server: it ends with Ctrl-C
            continue
        capsys.readouterr()
        assert main([command.__name__, "--help"]) == 0
        assert "--json" in capsys.readouterr().out, command


def test_an_impact_its_report_its_export_and_its_files(tmp_path, capsys):
    out = tmp_path / "out"
    impact = said(capsys, "impact", RODS, "--no-report", "--no-certify", "--out", out)
    report = said(capsys, "report", out)
    export = said(capsys, "export", out, "--to", "csv", "--out", tmp_path / "csv")
    parts = said(capsys, "inspect", RODS)

    assert impact["schema"] == "klack-impact/1"
    assert impact["levels"]["reduced"]["peak_force_N"] > 0.0
    assert all((out / name).is_file() for name in report["files"])
    assert sorted(path.name for path in (tmp_path / "csv").iterdir()) == export["files"]
    assert set(parts["parts"]) == {"short", "long"}


def test_a_stroke_and_a_reduction(tmp_path, capsys):
    words = ("--no-report", "--variant", "dry", "--duration", "0.1 ms", "--out", tmp_path)
    stroke = said(capsys, "stroke", VALVE, *words)
    reduction = said(capsys, "reduce", RODS, "--out", tmp_path)

    assert stroke["schema"] == "klack-stroke/1"
    assert reduction["bodies"]["short"]["rigid_modes"] == 1


@pytest.mark.parametrize("kind", ["stroke", "stroke-steady", "shots", "stroke-shots", "noise"])
def test_who_reads_a_result_by_program_sees_its_doubts(kind, capsys):
    assert main(["schema", "--kind", "result"]) == 0
    (whole,) = (
        part["properties"]
        for part in json.loads(capsys.readouterr().out)["$defs"].values()
        if part["properties"].get("schema", {}).get("const") == f"klack-{kind}/1"
    )
    assert whole["warnings"]["items"] == {"type": "string"}


@pytest.mark.slow
def test_the_cache_and_a_verification(capsys):
    assert said(capsys, "cache")["schema"] == "klack-cache/1"
    assert all(
        check["passed"] for check in said(capsys, "verify", "--group", "mechanics")["checks"]
    )


def test_the_schema_is_printed(capsys):
    assert main(["schema", "--kind", "result"]) == 0
    schema = json.loads(capsys.readouterr().out)

    kinds = {
        definition["properties"]["schema"]["const"]
        for definition in schema["$defs"].values()
        if "schema" in definition["properties"]
    }
    commands = {kind.removeprefix("klack-").split("-")[0].split("/")[0] for kind in kinds}
    assert len(kinds) == len(schema["oneOf"])
    # demo writes what impact writes, optimise what study writes, app serves until Ctrl-C
    own = {command.__name__ for command in COMMANDS} - {"demo", "optimise", "schema", "app"}
    assert commands == own


@pytest.mark.parametrize("change", ["missing", "unknown", "type"])
def test_the_check_sees_what_differs(change, capsys):
    found = said(capsys, "cache")
    if change == "missing":
        del found["count"]
    else:
        found["count" if change == "type" else "kount"] = "many"
    with pytest.raises(AssertionError):
        require_documented(found)
