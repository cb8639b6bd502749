"""The page about studies: its commands run and print what it shows."""

import re
from pathlib import Path

import pytest
from quoted_output import compare

from klack.cli.main import main

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "how-to" / "studies.md").read_text(encoding="utf-8")
FILE = ROOT / "docs" / "how-to" / "small_study.yaml"
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)
QUOTED = [block for kind, block in BLOCKS if not kind and "klack " not in block]


def test_the_study_of_the_page_is_the_file_beside_it():
    """All but what the last step of the page adds."""
    shown, added = (block for kind, block in BLOCKS if kind == "yaml")
    left = FILE.read_text(encoding="utf-8")
    for line in (shown + added).splitlines():
        assert line in left
        left = left.replace(line, "", 1)
    assert left.split() == ["variant:", "dry"]


@pytest.mark.parametrize(
    ("place", "command", "design"),
    [(0, "study", "sobol"), (1, "study", "saltelli"), (2, "optimise", "sobol")],
)
def test_commands_print_what_the_page_shows(tmp_path, capsys, monkeypatch, place, command, design):
    monkeypatch.chdir(ROOT)
    file = tmp_path / "study.yaml"
    file.write_text(FILE.read_text().replace("kind: sobol", f"kind: {design}"))
    case = "docs/how-to/small_valve.yaml"
    out = str(tmp_path / "out")
    assert main([command, case, "--study", str(file), "--out", out, "--no-report"]) == 0
    compare(QUOTED[place], capsys.readouterr().out, f"studies.md, block {place}")
